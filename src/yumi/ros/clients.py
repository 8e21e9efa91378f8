"""Clients of the driver's ROS interface: what an application needs to move both arms and both grippers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from action_msgs.msg import GoalStatus
from control_msgs.action import GripperCommand
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.action import ActionClient
from sensor_msgs.msg import JointState

from yumi.errors import CommandRefused, GoalNotReached
from yumi.robot.gripper import Outcome, outcome_of
from yumi.robot.joints import Joints, Side, joint_names, joints
from yumi.ros.robot_manager_client import RobotManagerClient
from yumi.ros.spinner import Spinner

__all__ = ["ArmClient", "Grip", "GripperClient", "RobotManagerClient", "Spinner"]


@dataclass(frozen=True, slots=True)
class Grip:
    """How a gripper command ended.

    Attributes:
        position: finger position [m].
        effort: holding force [N]; 0 when nothing is held.
        outcome: what became of it.
    """

    position: float
    effort: float
    outcome: Outcome

    @property
    def word(self) -> str:
        """``holding``, ``open``, ``closed``, ``in place`` or ``stalled``."""
        return self.outcome.value


class GripperClient:
    """The action ``gripper_cmd`` of one hand."""

    def __init__(self, spinner: Spinner, side: Side) -> None:
        self._spinner = spinner
        self._side = side
        self._client = ActionClient(spinner.node, GripperCommand, f"{side.value}/gripper/gripper_cmd")

    def begin(self, position: float, effort: float = 0.0) -> Callable[[], Grip]:
        """Send the fingers to ``position`` [m] with ``effort`` [N]; returns what waits for the result.

        What waits raises GoalNotReached when the driver could not carry the goal out.

        Raises:
            CommandRefused: the driver refused the goal; its log says why.
        """
        self._spinner.until(
            self._client.server_is_ready, 10.0, f"The {self._side.word} gripper's action: its appearance"
        )
        goal = GripperCommand.Goal()
        goal.command.position, goal.command.max_effort = position, effort
        sent = self._client.send_goal_async(goal)
        self._spinner.until(sent.done, 10.0, f"The answer of the {self._side.word} gripper")
        handle = sent.result()
        if not handle.accepted:
            raise CommandRefused(f"The {self._side.word} gripper refused the goal; the driver's log says why.")
        return lambda: self._result(handle)

    def _result(self, handle: Any) -> Grip:
        future = handle.get_result_async()
        self._spinner.until(future.done, 30.0, f"The end of the {self._side.word} gripper's motion")
        if future.result().status != GoalStatus.STATUS_SUCCEEDED:
            raise GoalNotReached(f"The {self._side.word} gripper did not do it; the driver's log says why.")
        result = future.result().result
        return Grip(
            position=result.position,
            effort=result.effort,
            outcome=outcome_of(
                result.position, result.effort, stalled=result.stalled, reached_goal=result.reached_goal
            ),
        )


class ArmClient:
    """Goals and joint states of one arm.

    Attributes:
        position: of the newest joint state [rad]; None before the first.
        missed: cycles without an answer, as the driver counts them since its start.
        is_commanded: whether EGM runs and a controller commands the arm.

    Args:
        spinner: spins the node it belongs to.
        side: which arm.
        on_state: called with time [s] and positions [rad] of every joint state.
    """

    def __init__(self, spinner: Spinner, side: Side, on_state: Callable[[float, Joints], None]) -> None:
        self.position: Joints | None = None
        self.missed = 0
        self.is_commanded = False
        self._has_status = False
        self._spinner = spinner
        self._side = side
        self._on_state = on_state
        node, name = spinner.node, side.value
        self._publisher = node.create_publisher(JointState, f"{name}/joint_commands", 10)
        node.create_subscription(JointState, f"{name}/joint_states", self._take, 100)
        node.create_subscription(DiagnosticStatus, f"{name}/egm_state", self._take_status, 1)

    def wait_for_state(self, timeout: float) -> Joints:
        """The arm's position [rad], waiting for the first joint state.

        Raises:
            RobotNotReady: none came.
        """
        self._spinner.until(lambda: self.position is not None, timeout, f"A joint state of the {self._side.word} arm")
        assert self.position is not None
        return self.position

    def wait_for_status(self, timeout: float) -> None:
        """Wait until ``missed`` is known.

        Raises:
            RobotNotReady: the driver did not tell.
        """
        self._spinner.until(lambda: self._has_status, timeout, f"The EGM state of the {self._side.word} arm")

    def move(self, goal: Joints) -> None:
        """Publish a goal [rad]; returns at once."""
        self._spinner.until(
            lambda: self._publisher.get_subscription_count() > 0,
            10.0,
            f"A listener for goals of the {self._side.word} arm",
        )
        message = JointState()
        message.name = list(joint_names(self._side))
        message.position = list(goal)
        self._publisher.publish(message)

    def wait_for_command(self, timeout: float) -> None:
        """Wait until a controller commands the arm.

        Raises:
            RobotNotReady: none does.
        """
        self._spinner.until(lambda: self.is_commanded, timeout, f"A controller that commands the {self._side.word} arm")

    def error(self, goal: Joints) -> float:
        """Largest distance of a joint from ``goal`` [rad]."""
        position = self.wait_for_state(5.0)
        return max(abs(now - wanted) for now, wanted in zip(position, goal, strict=True))

    def _take(self, message: Any) -> None:
        self.position = joints(message.position)
        self._on_state(message.header.stamp.sec + message.header.stamp.nanosec * 1e-9, self.position)

    def _take_status(self, message: Any) -> None:
        values = {pair.key: pair.value for pair in message.values}
        self.missed = int(values["missed"])
        self.is_commanded = values["running"] == values["commanded"] == str(True)
        self._has_status = True
