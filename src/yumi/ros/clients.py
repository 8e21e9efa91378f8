"""Clients of the driver's ROS interface: what an application needs to move both arms and both grippers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import JointState

from yumi.errors import GoalNotReached, RobotNotReady
from yumi.robot.joints import Joints, Side, joint_names, joints
from yumi.ros.gripper_client import Grip, GripperClient
from yumi.ros.managed_node_client import ManagedNodeClient
from yumi.ros.robot_manager_client import RobotManagerClient
from yumi.ros.spinner import Spinner, application

__all__ = ["ArmClient", "Grip", "GripperClient", "ManagedNodeClient", "RobotManagerClient", "Spinner", "application"]


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
        self._status = ""
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

    def reach(self, goal: Joints, tolerance: float, timeout: float) -> None:
        """Publish a goal and wait until all joints are nearer to it than ``tolerance`` [rad].

        Raises:
            GoalNotReached: they were not in ``timeout`` [s], or the arm follows no more.
        """
        self.wait_for_command(timeout)
        self.move(goal)
        is_there = False

        def has_ended() -> bool:
            nonlocal is_there
            is_there = self.error(goal) < tolerance
            return is_there or not self.is_commanded

        try:
            self._spinner.until(has_ended, timeout, "Arrival")
        except RobotNotReady:
            raise GoalNotReached(
                f"The {self._side.word} arm has not reached its goal within {timeout:g} s: the farthest joint is "
                f"{self.error(goal):.3f} rad away."
            ) from None
        if not is_there:
            raise GoalNotReached(
                f"The {self._side.word} arm follows no more ({self._status}); the driver's log says why."
            )

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
        self._status = message.message
        self._has_status = True
