"""Clients of the driver's ROS interface for tests: the robot manager, one arm, one gripper."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

from action_msgs.msg import GoalStatus
from control_msgs.action import GripperCommand
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from yumi_interfaces.action import Recover, SetMode
from yumi_interfaces.msg import RobotState
from yumi_interfaces.srv import LoadModule, ReadSignal, ReadVariable, SetSpeedRatio, WriteSignal

from abb_protocols.errors import CommandRefused, GoalNotReached, RobotNotReady, StopNotConfirmed
from abb_protocols.robot.gripper_values import GripOutcome, outcome_of
from abb_protocols.robot.joints import Joints, Side, joint_names, joints
from abb_runtime.clock import SystemClock
from yumi.driver.robot_state import RobotMode
from yumi.ros.gripper_actions import GRIPPER_FAILURE, GRIPPER_FAILURES
from yumi.ros.messages import LATCHED_QOS

_POLL = 0.05  # [s]
_ANSWER = 30.0  # [s]
_ACTION = 120.0  # [s]; a controller that restarts does not answer for some twenty


class Spinner:
    """Spins one node until something has happened."""

    def __init__(self, node: Any) -> None:
        self.node = node
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(node)

    def close(self) -> None:
        self._executor.remove_node(self.node)
        self._executor.shutdown()

    def until(self, is_so: Callable[[], bool], timeout: float, what: str) -> None:
        """Spin until ``is_so``; RobotNotReady after ``timeout`` [s]."""
        clock = SystemClock()
        end = clock.now() + timeout
        while not is_so():
            if clock.now() > end:
                raise RobotNotReady(f"{what} did not happen within {timeout:g} s.")
            self._executor.spin_once(timeout_sec=_POLL)

    def result(self, future: Any, timeout: float, what: str) -> Any:
        self.until(future.done, timeout, what)
        return future.result()


class RobotManagerClient:
    """Services, actions and the newest ``state`` of the robot manager; a refusal is raised as RobotNotReady."""

    def __init__(self, spinner: Spinner) -> None:
        self.state: Any = None
        self._spinner = spinner
        self._services: dict[str, Any] = {}
        self._actions: dict[str, Any] = {}
        spinner.node.create_subscription(RobotState, "yumi_robot_manager/state", self._take_state, LATCHED_QOS)

    def wait_for_state(self, is_so: Callable[[Any], bool], timeout: float, what: str) -> Any:
        self._spinner.until(lambda: self.state is not None and is_so(self.state), timeout, what)
        return self.state

    def start_egm(self) -> str:
        return str(self.call(Trigger, "start_egm").message)

    def stop_egm(self) -> str:
        return str(self.call(Trigger, "stop_egm").message)

    def motors_on(self) -> str:
        return str(self.call(Trigger, "motors_on").message)

    def stop_rapid(self) -> str:
        return str(self.call(Trigger, "stop_rapid").message)

    def set_speed_ratio(self, percent: int) -> str:
        return str(self.call(SetSpeedRatio, "set_speed_ratio", percent=percent).message)

    def load_module(self, side: Side, file_name: str, text: str) -> str:
        return str(self.call(LoadModule, "load_module", arm=side.word, file_name=file_name, text=text).message)

    def read_signal(self, name: str) -> str:
        return str(self.call(ReadSignal, "read_signal", name=name).value)

    def write_signal(self, name: str, value: str) -> str:
        return str(self.call(WriteSignal, "write_signal", name=name, value=value).message)

    def read_variable(self, task: str, module: str, name: str) -> str:
        return str(self.call(ReadVariable, "read_variable", task=task, module=module, name=name).value)

    def set_mode(self, mode: RobotMode, on_step: Callable[[str], None] = lambda _: None) -> str:
        return self._carry_out(SetMode, "set_mode", SetMode.Goal(mode=mode.value), on_step)

    def recover(self, on_step: Callable[[str], None] = lambda _: None, confirm: str = "") -> str:
        """Raises StopNotConfirmed when a person has to confirm the stop whose id is in the message."""
        return self._carry_out(Recover, "recover", Recover.Goal(confirm_stop=confirm), on_step)

    def call(self, kind: Any, name: str, /, **fields: object) -> Any:
        """The response of a service that must succeed."""
        if name not in self._services:
            self._services[name] = self._spinner.node.create_client(kind, f"yumi_robot_manager/{name}")
        client = self._services[name]
        self._spinner.until(client.service_is_ready, _ANSWER, f"The appearance of {name}")
        response = self._spinner.result(client.call_async(kind.Request(**fields)), _ANSWER, f"The answer of {name}")
        if not response.success:
            raise RobotNotReady(str(response.message))
        return response

    def _carry_out(self, kind: Any, name: str, goal: Any, on_step: Callable[[str], None]) -> str:
        if name not in self._actions:
            self._actions[name] = ActionClient(self._spinner.node, kind, f"yumi_robot_manager/{name}")
        action = self._actions[name]
        self._spinner.until(action.server_is_ready, _ANSWER, f"The appearance of {name}")
        sent = action.send_goal_async(goal, feedback_callback=lambda message: on_step(str(message.feedback.step)))
        handle = self._spinner.result(sent, _ANSWER, f"The answer of {name}")
        result = self._spinner.result(handle.get_result_async(), _ACTION, f"The end of {name}").result
        message, stop = str(result.message), str(result.state.stop)
        if not result.success:
            raise StopNotConfirmed(message, stop) if stop and stop in message else RobotNotReady(message)
        return message

    def _take_state(self, message: Any) -> None:
        self.state = message


class ArmClient:
    """Goals and states of one arm.

    Attributes:
        position: of the newest joint state [rad].
        is_commanded: whether EGM runs and a controller commands the arm.
    """

    def __init__(self, spinner: Spinner, side: Side) -> None:
        self.position: Joints | None = None
        self.is_commanded = False
        self._has_status = False
        self._spinner = spinner
        self._side = side
        node, name = spinner.node, side.value
        self._publisher = node.create_publisher(JointState, f"{name}/joint_commands", 10)
        node.create_subscription(JointState, f"{name}/joint_states", self._take, 100)
        node.create_subscription(DiagnosticStatus, f"{name}/egm_state", self._take_status, 1)

    def wait_for_state(self, timeout: float) -> Joints:
        self._spinner.until(lambda: self.position is not None, timeout, f"A joint state of the {self._side.word} arm")
        assert self.position is not None
        return self.position

    def wait_for_status(self, timeout: float) -> None:
        self._spinner.until(lambda: self._has_status, timeout, f"The EGM state of the {self._side.word} arm")

    def wait_for_command(self, timeout: float) -> None:
        self._spinner.until(lambda: self.is_commanded, timeout, f"A controller that commands the {self._side.word} arm")

    def move(self, goal: Joints) -> None:
        """Publish a goal [rad]; returns at once."""
        self._spinner.until(
            lambda: self._publisher.get_subscription_count() > 0, _ANSWER, f"A subscriber to {self._publisher.topic}"
        )
        self._publisher.publish(JointState(name=list(joint_names(self._side)), position=list(goal)))

    def error(self, goal: Joints) -> float:
        """Largest distance of a joint from ``goal`` [rad]."""
        return max(abs(now - wanted) for now, wanted in zip(self.wait_for_state(5.0), goal, strict=True))

    def _take(self, message: Any) -> None:
        self.position = joints(message.position)

    def _take_status(self, message: Any) -> None:
        values = {pair.key: pair.value for pair in message.values}
        self.is_commanded = values["running"] == values["commanded"] == str(True)
        self._has_status = True


class GripperClient:
    """The action ``gripper_cmd`` of one gripper; a failure is raised with the reason in ``gripper/state``."""

    def __init__(self, spinner: Any, side: Side) -> None:
        self._spinner = spinner
        self._side = side
        self._failures = (0, "")
        name = f"{side.value}/gripper"
        spinner.node.create_subscription(DiagnosticStatus, f"{name}/state", self._take_state, LATCHED_QOS)
        self._action = ActionClient(spinner.node, GripperCommand, f"{name}/gripper_cmd")

    def begin(self, position: float, effort: float = 0.0) -> Callable[[], GripOutcome]:
        """Send the fingers to ``position`` [m]; returns what waits for the outcome."""
        goal, failed_before = GripperCommand.Goal(), self._failures[0]
        goal.command.position, goal.command.max_effort = position, effort
        self._spinner.until(self._action.server_is_ready, _ANSWER, "The appearance of the gripper's action")
        sent = self._action.send_goal_async(goal)
        self._spinner.until(sent.done, _ANSWER, "The answer of the gripper")
        handle = sent.result()
        if not handle.accepted:
            raise CommandRefused(f"The {self._side.word} gripper refused the goal: {self._why_failed(failed_before)}")

        def wait() -> GripOutcome:
            ended = handle.get_result_async()
            self._spinner.until(ended.done, _ANSWER, "The end of the gripper's motion")
            if ended.result().status != GoalStatus.STATUS_SUCCEEDED:
                raise GoalNotReached(self._why_failed(failed_before))
            result = ended.result().result
            return outcome_of(result.position, result.effort, stalled=result.stalled, reached_goal=result.reached_goal)

        return wait

    def _why_failed(self, before: int) -> str:
        with suppress(RobotNotReady):
            self._spinner.until(lambda: self._failures[0] > before, 5.0, "The reason")
        return self._failures[1]

    def _take_state(self, status: Any) -> None:
        values = {each.key: each.value for each in status.values}
        self._failures = (int(values.get(GRIPPER_FAILURES, 0)), values.get(GRIPPER_FAILURE, ""))
