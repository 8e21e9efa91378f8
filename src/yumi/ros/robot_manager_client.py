"""A client of everything that ``yumi_robot_manager`` offers; what is refused is raised, in the driver's words."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import Trigger
from yumi_interfaces.action import Recover, SetMode
from yumi_interfaces.msg import RobotState
from yumi_interfaces.srv import (
    LoadModule,
    ReadSignal,
    ReadVariable,
    RunModule,
    RunRoutine,
    SetSpeedRatio,
    WriteSignal,
    WriteVariable,
)

from yumi.errors import RobotNotReady, StopNotConfirmed, YumiError
from yumi.hardware.manager_state import Mode
from yumi.hardware.rapid_routines import LONGEST_ROUTINE
from yumi.robot.joints import Side
from yumi.ros.service_calls import ServiceCalls
from yumi.ros.spinner import Spinner

NAME = "yumi_robot_manager"
_ANSWER = 30.0  # [s]
_READ = 10.0  # [s]
_ROUTINE = LONGEST_ROUTINE + _ANSWER
_ACTION = 120.0  # [s]; a controller that restarts is dark for some twenty
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)

OnStep = Callable[[str], None]
"""Told each step of an action."""


def _ignore(_: str) -> None:
    return None


class RobotManagerClient:
    """The services, actions and the state of ``yumi_robot_manager``.

    Every call that changes something raises RobotNotReady when it was refused or failed; the message says why.

    Attributes:
        state: the newest ``yumi_interfaces/RobotState``; None before the first.

    Args:
        spinner: spins the node it belongs to.
    """

    def __init__(self, spinner: Spinner) -> None:
        self.state: Any = None
        self._spinner = spinner
        self._services = ServiceCalls(spinner, NAME)
        self._actions: dict[str, Any] = {}
        spinner.node.create_subscription(RobotState, f"{NAME}/state", self._take_state, _LATCHED)
        for name in ("start_egm", "stop_egm", "robot_is_ready", "get_state"):  # finding them takes a moment
            self._services.prepare(Trigger, name)

    def robot_is_ready(self) -> str | None:
        """None when EGM can be started, else the reason why not."""
        response = self._services.call(Trigger, "robot_is_ready", _READ)
        return None if response.success else str(response.message)

    def get_state(self) -> str:
        """The robot's state in one line."""
        return self._demand(Trigger, "get_state")

    def wait_for_state(self, is_so: Callable[[Any], bool], timeout: float, what: str) -> Any:
        """Wait until ``is_so`` of the state; returns it.

        Raises:
            RobotNotReady: ``what`` did not come.
        """
        self._spinner.until(lambda: self.state is not None and is_so(self.state), timeout, what)
        return self.state

    def start_egm(self) -> str:
        """Make the robot ready if need be, start EGM on both arms and activate their position controllers."""
        return self._demand(Trigger, "start_egm")

    def stop_egm(self) -> str:
        """Deactivate what commands the arms, and stop EGM."""
        return self._demand(Trigger, "stop_egm")

    @contextmanager
    def egm_running(self, report: OnStep = _ignore) -> Iterator[None]:
        """EGM on both arms for the time of a block, ended on every way out: ``with manager.egm_running():``.

        Args:
            report: told what the driver says when EGM has started, and when it has ended.

        Raises:
            RobotNotReady: EGM did not start, or did not end after a block that went well.
        """
        has_begun = True  # as far as anybody knows: Ctrl-C may come while the driver starts EGM
        try:
            try:
                report(self.start_egm())
            except YumiError:
                has_begun = False
                raise
            yield
        except BaseException:  # Ctrl-C too
            if has_begun:
                with suppress(YumiError):  # what went wrong in the block matters more
                    report(self.stop_egm())
            raise
        report(self.stop_egm())

    def motors_on(self) -> str:
        """Switch the motors on."""
        return self._demand(Trigger, "motors_on")

    def motors_off(self) -> str:
        """Switch the motors off; the brakes hold the arms."""
        return self._demand(Trigger, "motors_off")

    def start_rapid(self) -> str:
        """Start the RAPID program from where its program pointers are."""
        return self._demand(Trigger, "start_rapid")

    def stop_rapid(self) -> str:
        """Stop the RAPID program."""
        return self._demand(Trigger, "stop_rapid")

    def pp_to_main(self) -> str:
        """Move the program pointers to main; RAPID must be stopped."""
        return self._demand(Trigger, "pp_to_main")

    def set_speed_ratio(self, percent: int) -> str:
        """Set the share of all speeds that RAPID moves with [%]."""
        return self._demand(SetSpeedRatio, "set_speed_ratio", percent=percent)

    def run_routine(self, side: Side, routine: str) -> str:
        """Run a RAPID routine without parameters, and wait for its end."""
        return str(self._services.demand(RunRoutine, "run_routine", _ROUTINE, arm=side.word, routine=routine).message)

    def load_module(self, side: Side, file_name: str, text: str) -> str:
        """Write a RAPID module to the controller and load it into the arm's task."""
        return self._demand(LoadModule, "load_module", arm=side.word, file_name=file_name, text=text)

    def run_module(self, side: Side, file_name: str, text: str, routine: str) -> str:
        """Write and load a RAPID module and run one of its routines, and wait for its end."""
        fields = {"arm": side.word, "file_name": file_name, "text": text, "routine": routine}
        return str(self._services.demand(RunModule, "run_module", _ROUTINE, **fields).message)

    def read_signal(self, name: str) -> str:
        """The value of an I/O signal."""
        return str(self._services.demand(ReadSignal, "read_signal", _READ, name=name).value)

    def write_signal(self, name: str, value: str) -> str:
        """Write an I/O signal."""
        return self._demand(WriteSignal, "write_signal", name=name, value=value)

    def read_variable(self, task: str, module: str, name: str) -> str:
        """The value of a RAPID variable, as RAPID writes it."""
        fields = {"task": task, "module": module, "name": name}
        return str(self._services.demand(ReadVariable, "read_variable", _READ, **fields).value)

    def write_variable(self, task: str, module: str, name: str, value: str) -> str:
        """Write a RAPID variable; ``value`` as RAPID writes it."""
        fields = {"task": task, "module": module, "name": name, "value": value}
        return self._demand(WriteVariable, "write_variable", **fields)

    def set_mode(self, mode: Mode, on_step: OnStep = _ignore) -> str:
        """Bring the robot to a named state, step by step."""
        return self._carry_out(SetMode, "set_mode", SetMode.Goal(mode=mode.value), on_step)

    def recover(self, on_step: OnStep = _ignore, confirm: str = "") -> str:
        """Have what stopped the robot cleared, as far as it may be, and the robot brought to ready; what was done.

        Args:
            on_step: told each step.
            confirm: the stop that a person has looked at and confirms, ``state.stop``; needed after an emergency stop,
                a guard stop or a collision.

        Raises:
            StopNotConfirmed: a person has to confirm the stop first; its id is the error's ``stop``.
            RobotNotReady: a step failed; the message says which and what to do.
        """
        return self._carry_out(Recover, "recover", Recover.Goal(confirm_stop=confirm), on_step)

    def _take_state(self, message: Any) -> None:
        self.state = message

    def _demand(self, kind: Any, service: str, /, **fields: object) -> str:
        return str(self._services.demand(kind, service, _ANSWER, **fields).message)

    def _carry_out(self, kind: Any, name: str, goal: Any, on_step: OnStep) -> str:
        if name not in self._actions:
            self._actions[name] = ActionClient(self._spinner.node, kind, f"{NAME}/{name}")
        action = self._actions[name]
        self._spinner.until(action.server_is_ready, _READ, f"The action {name} of the driver: its appearance")
        sent = action.send_goal_async(goal, feedback_callback=lambda message: on_step(str(message.feedback.step)))
        self._spinner.until(sent.done, _READ, f"The answer of {name}")
        result = self._result(sent.result(), name)
        message, stop = str(result.message), str(result.state.stop)
        if not result.success and stop and stop in message:  # the state is newer: a stop it alone knows was not shown
            raise StopNotConfirmed(message, stop)
        if not result.success:
            raise RobotNotReady(message)
        return message

    def _result(self, handle: Any, name: str) -> Any:
        ended = handle.get_result_async()
        try:
            self._spinner.until(ended.done, _ACTION, f"The end of {name}")
        except BaseException:
            handle.cancel_goal_async()
            raise
        return ended.result().result
