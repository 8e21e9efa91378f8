"""Clients of the driver's ROS interface: what an application needs to move both arms and both grippers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from control_msgs.action import GripperCommand
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from yumi.errors import CommandRefused, RobotNotReady
from yumi.robot.joints import Joints, Side, joint_names, joints

_SPIN = 0.05  # [s]


class Spinner:
    """Spins one node until something has happened; everything an application waits for goes through here.

    Args:
        node: the application's node.
        check: called again and again while waiting; raises when waiting has become useless.
    """

    def __init__(self, node: Any, check: Callable[[], None] = lambda: None) -> None:
        self.node = node
        self._check = check
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(node)

    def close(self) -> None:
        """Let go of the node, so that another spinner may have it."""
        self._executor.remove_node(self.node)
        self._executor.shutdown()

    def until(self, is_so: Callable[[], bool], timeout: float, what: str) -> None:
        """Spin until ``is_so``.

        Raises:
            RobotNotReady: it did not become so within ``timeout`` [s].
            Exception: whatever the check raises.
        """
        clock = self.node.get_clock()
        end = clock.now().nanoseconds + int(timeout * 1e9)
        while not is_so():
            self._check()
            if clock.now().nanoseconds > end:
                raise RobotNotReady(f"{what} did not happen within {timeout:g} s.")
            self._executor.spin_once(timeout_sec=_SPIN)


class RobotManagerClient:
    """The services of ``yumi_robot_manager``."""

    def __init__(self, spinner: Spinner) -> None:
        self._spinner = spinner
        self._clients = {
            name: spinner.node.create_client(Trigger, f"yumi_robot_manager/{name}")
            for name in ("start_egm", "stop_egm", "robot_is_ready", "get_state")
        }

    def robot_is_ready(self) -> str | None:
        """None when EGM can be started, else the reason why not."""
        response = self._call("robot_is_ready", 10.0)
        return None if response.success else str(response.message)

    def start_egm(self) -> str:
        """Start EGM on both arms.

        Raises:
            RobotNotReady: it did not start; the message says why.
        """
        return self._demand("start_egm")

    def stop_egm(self) -> str:
        """Stop EGM on both arms.

        Raises:
            RobotNotReady: it did not stop; the message says why.
        """
        return self._demand("stop_egm")

    def get_state(self) -> str:
        """The robot's state in one line."""
        return self._demand("get_state")

    def _demand(self, name: str) -> str:
        response = self._call(name, 30.0)
        if not response.success:
            raise RobotNotReady(str(response.message))
        return str(response.message)

    def _call(self, name: str, timeout: float) -> Any:
        client = self._clients[name]
        self._spinner.until(client.service_is_ready, timeout, f"The service {name} of the driver: its appearance")
        future = client.call_async(Trigger.Request())
        self._spinner.until(future.done, timeout, f"The answer of {name}")
        return future.result()


@dataclass(frozen=True, slots=True)
class Grip:
    """How a gripper command ended.

    Attributes:
        position: finger position [m].
        effort: holding force [N]; 0 when nothing is held.
        is_holding: whether an object is held.
        reached_goal: whether the fingers are where they were sent.
    """

    position: float
    effort: float
    is_holding: bool
    reached_goal: bool

    @property
    def word(self) -> str:
        """``holding``, ``open``, ``closed``, ``in place`` or ``stalled``."""
        if self.is_holding:
            return "holding"
        if not self.reached_goal:
            return "stalled"
        return "closed" if self.position < 0.001 else "open" if self.position > 0.024 else "in place"


class GripperClient:
    """The action ``gripper_cmd`` of one hand."""

    def __init__(self, spinner: Spinner, side: Side) -> None:
        self._spinner = spinner
        self._side = side
        self._client = ActionClient(spinner.node, GripperCommand, f"{side.value}/gripper/gripper_cmd")

    def begin(self, position: float, effort: float = 0.0) -> Callable[[], Grip]:
        """Send the fingers to ``position`` [m] with ``effort`` [N]; returns what waits for the result.

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
        result = future.result().result
        return Grip(
            position=result.position,
            effort=result.effort,
            is_holding=result.stalled and result.effort > 0.0,
            reached_goal=result.reached_goal,
        )


class ArmClient:
    """Goals and joint states of one arm.

    Attributes:
        position: of the newest joint state [rad]; None before the first.
        missed: cycles without an answer, as the driver counts them since its start.

    Args:
        spinner: spins the node it belongs to.
        side: which arm.
        on_state: called with time [s] and positions [rad] of every joint state.
    """

    def __init__(self, spinner: Spinner, side: Side, on_state: Callable[[float, Joints], None]) -> None:
        self.position: Joints | None = None
        self.missed = 0
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
        self._has_status = True
