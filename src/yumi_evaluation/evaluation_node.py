"""The application of an evaluation: a ROS 2 node of its own that sends goals over topics and subscribes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import rclpy
from builtin_interfaces.msg import Duration, Time
from controller_manager_msgs.srv import SwitchController
from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.srv import SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from yumi_interfaces.srv import LoadModule

from yumi.control.trajectory import TrajectoryPoint
from yumi.errors import RobotNotReady
from yumi.robot.joints import Joints, Side, joint_names, joints
from yumi.settings import Values

POSITION_CONTROLLER = "joint_position_controller"
TRAJECTORY_CONTROLLER = "joint_trajectory_controller"
COUNTED = ("cycles", "missed", "lost")
"""Counters of ``egm_state`` from which packet loss follows."""

_QUEUE = QoSProfile(depth=2000)  # nothing that is measured may be lost here
_TIMEOUT = 30.0  # [s]


class HeardJointState(NamedTuple):
    """A joint state of an arm.

    Attributes:
        stamp: the time of its cycle, on the machine's monotonic clock [s].
        heard: when it came [s].
        position: measured [rad], (7,).
    """

    stamp: float
    heard: float
    position: Joints


class EvaluationNode:
    """One arm's topics and the services of the driver; everything happens in the thread that calls.

    Args:
        side: the arm.
        check: called while waiting; raises when waiting has become useless.

    Attributes:
        side: the arm.
        states: what was heard of it.
        check: as given.
    """

    def __init__(self, side: Side, check: Callable[[], None]) -> None:
        self.side = side
        self.states: list[HeardJointState] = []
        self.check = check
        # Without parameter services looking for work is quicker, and what is measured is less about the application.
        self._node = rclpy.create_node(f"evaluation_{side.value}", start_parameter_services=False)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        # From the machine's monotonic clock to the time of day [ns]; an interrupted reading is too large.
        self._behind = min(time.time_ns() - time.monotonic_ns() for _ in range(100))
        self._counters: dict[str, int] = {}
        self._callers: dict[str, Any] = {}
        namespace = side.value
        self._goals = self._node.create_publisher(JointState, f"{namespace}/joint_commands", 10)
        self._trajectories = self._node.create_publisher(
            JointTrajectory, f"{namespace}/{TRAJECTORY_CONTROLLER}/joint_trajectory", 10
        )
        self._node.create_subscription(JointState, f"{namespace}/joint_states", self._take, _QUEUE)
        self._node.create_subscription(DiagnosticStatus, f"{namespace}/egm_state", self._take_status, 10)

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._node.destroy_node()

    def start_egm(self) -> None:
        """Raises RobotNotReady with the driver's sentence."""
        self._call(Trigger, "yumi_robot_manager/start_egm", Trigger.Request())

    def stop_egm(self) -> None:
        """Raises RobotNotReady with the driver's sentence."""
        self._call(Trigger, "yumi_robot_manager/stop_egm", Trigger.Request())

    def is_ready(self) -> bool:
        """Ask the robot manager, which answers at once while EGM runs."""
        return bool(self._ask(Trigger, "yumi_robot_manager/robot_is_ready", Trigger.Request()).success)

    def load_module(self, side: Side, file_name: str, text: str) -> None:
        """Have the robot manager load a RAPID module; raises RobotNotReady with its sentence."""
        request = LoadModule.Request(arm=side.word, file_name=file_name, text=text)
        self._call(LoadModule, "yumi_robot_manager/load_module", request)

    def set_controller(self, values: Values) -> None:
        """Parameters of the arm's joint position controller.

        Raises:
            RobotNotReady: it refused one.
        """
        request = SetParameters.Request()
        request.parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        answer = self._call(SetParameters, f"{self.side.value}/{POSITION_CONTROLLER}/set_parameters", request)
        for result in answer.results:
            if not result.successful:
                raise RobotNotReady(f"The controller's parameters could not be set: {result.reason}")

    def switch(self, activate: str, deactivate: str) -> None:
        """Let another controller command the arm.

        Raises:
            RobotNotReady: the controller manager refused it.
        """
        request = SwitchController.Request(strictness=SwitchController.Request.STRICT)
        request.activate_controllers, request.deactivate_controllers = [activate], [deactivate]
        answer = self._call(SwitchController, f"{self.side.value}/controller_manager/switch_controller", request)
        if not answer.ok:
            raise RobotNotReady(f"The controllers could not be switched: {getattr(answer, 'message', '')}")

    def send_trajectory(self, points: Sequence[TrajectoryPoint], begin: float) -> None:
        """Publish a trajectory that begins at that time [s]."""
        self.until(lambda: self._trajectories.get_subscription_count() > 0, "finding the trajectory controller")
        wall = int(begin * 1e9) + self._behind
        message = JointTrajectory(joint_names=list(joint_names(self.side)))
        message.header.stamp = Time(sec=wall // 10**9, nanosec=wall % 10**9)
        for each in points:
            nanoseconds = round(each.time * 1e9)
            point = JointTrajectoryPoint(positions=list(each.position), velocities=list(each.velocity or ()))
            point.accelerations = list(each.acceleration or ())
            point.time_from_start = Duration(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
            message.points.append(point)
        self._trajectories.publish(message)

    def position(self) -> Joints:
        """Where the arm stands now [rad], (7,)."""
        self.states.clear()
        self.until(lambda: bool(self.states) and self._goals.get_subscription_count() > 0, "hearing the arm's state")
        return self.states[-1].position

    @contextmanager
    def echoes(self) -> Iterator[list[tuple[float, float]]]:
        """When each goal came to a second listener of the topic [s], and the position of its last joint [rad]."""
        heard: list[tuple[float, float]] = []
        listener = self._node.create_subscription(
            JointState,
            f"{self.side.value}/joint_commands",
            lambda message: heard.append((time.monotonic(), message.position[-1])),
            _QUEUE,
        )
        self.until(lambda: self._goals.get_subscription_count() > 1, "hearing our own goals")
        yield heard
        self._node.destroy_subscription(listener)

    def counters(self) -> dict[str, int]:
        """The arm's counters, newer than this call."""
        self._counters = {}
        self.until(lambda: bool(self._counters), "hearing the state of EGM")
        return dict(self._counters)

    def send(self, goal: Joints) -> float:
        """Publish a goal; returns when [s]."""
        wall = time.time_ns()
        message = JointState(name=list(joint_names(self.side)), position=list(goal))
        message.header.stamp = Time(sec=wall // 10**9, nanosec=wall % 10**9)
        sent = time.monotonic()
        self._goals.publish(message)
        return sent

    def stream(self, goal_at: Callable[[float], Joints], due: Sequence[float]) -> list[tuple[float, Joints]]:
        """Publish the goal of the moment at each time of ``due`` since now [s]; returns what was sent when.

        A sender that comes late sends what is right for the moment, as the thesis's loop did.
        """
        begin, sent = time.monotonic(), []
        for moment in due:
            self.spin_until(begin + moment)
            goal = goal_at(time.monotonic() - begin)
            sent.append((self.send(goal), goal))
        return sent

    def spin_until(self, end: float) -> None:
        """Listen until that time [s]."""
        while (left := end - time.monotonic()) > 0.0:
            self.check()
            self._executor.spin_once(timeout_sec=left)

    def until(self, is_so: Callable[[], bool], what: str, timeout: float = _TIMEOUT) -> None:
        """Listen until ``is_so``.

        Raises:
            RobotNotReady: it did not become so in time.
        """
        end = time.monotonic() + timeout
        while not is_so():
            self.check()
            if time.monotonic() > end:
                raise RobotNotReady(f"{what} did not happen within {timeout:g} s.")
            self._executor.spin_once(timeout_sec=0.05)

    def _call(self, kind: Any, name: str, request: Any) -> Any:
        answer = self._ask(kind, name, request)
        if not getattr(answer, "success", True):
            raise RobotNotReady(answer.message)
        return answer

    def _ask(self, kind: Any, name: str, request: Any) -> Any:
        if name not in self._callers:
            self._callers[name] = self._node.create_client(kind, name)
        caller = self._callers[name]
        self.until(caller.service_is_ready, f"finding {name}")
        future = caller.call_async(request)
        self.until(future.done, name)
        return future.result()

    def _take(self, message: Any) -> None:
        stamp = message.header.stamp
        moment = (stamp.sec * 10**9 + stamp.nanosec - self._behind) * 1e-9
        self.states.append(HeardJointState(moment, time.monotonic(), joints(message.position)))

    def _take_status(self, message: Any) -> None:
        values = {pair.key: pair.value for pair in message.values}
        self._counters = {name: int(values[name]) for name in COUNTED}


@contextmanager
def evaluation_node(side: Side, check: Callable[[], None]) -> Iterator[EvaluationNode]:
    """The node while it is needed; ROS 2 is open."""
    node = EvaluationNode(side, check)
    try:
        yield node
    finally:
        node.close()
