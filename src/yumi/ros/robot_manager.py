"""The robot manager's services, actions and ``speed_scale`` in ROS, see :mod:`yumi.driver.robot_manager`.

What only reads, what brings the robot to a stop, and what writes a signal or variable or allows a collision is served
beside what takes its time. The actions ``set_mode`` and ``recover`` run one at a time, but for the mode ``motors_off``,
with one sentence of feedback for each step. A goal that cannot be met is not rejected, since a rejection has no text:
it is aborted at once, with the reason.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from enum import Enum, auto
from functools import partial
from threading import Lock
from typing import Any

from control_msgs.msg import SpeedScalingFactor
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger
from yumi_interfaces.action import Recover, SetMode
from yumi_interfaces.srv import (
    AllowCollision,
    LoadModule,
    ReadSignal,
    ReadVariable,
    RunModule,
    RunRoutine,
    SetPayload,
    SetSpeedRatio,
    SetSpeedScale,
    SetTool,
    WriteSignal,
    WriteVariable,
)

from yumi.catalogue import message
from yumi.control.speed_scale import FULL
from yumi.driver.readiness import Mode
from yumi.driver.robot_manager import RobotManager
from yumi.driver.state_machine import LOWEST_SPEED_SCALE, SpeedSetting
from yumi.errors import CommandRefused, YumiError
from yumi.robot.joints import Side
from yumi.ros.messages import (
    GPIO_STATES,
    LATCHED,
    SERVICES,
    gpio_states,
    mass_of,
    mode_of,
    pose_of,
    robot_state,
    say_why,
    side_of,
)
from yumi.ros.nodes import TimerThread

CheckArms = Callable[[Iterable[Side]], None]
"""Raises CommandRefused where one of some arms has been deactivated."""


class _Group(Enum):
    """Services of one group wait for each other."""

    READ = auto()
    STOP = auto()
    CHANGE = auto()
    WRITE = auto()  # signals, variables and the speed, for which a routine may wait
    CONTACT = auto()


class RobotManagerServices:
    """The services of the robot manager's node.

    Args:
        node: the robot manager's node.
        manager: what carries them out.
        check_arms: refuses what needs an arm that is not active.
        on_change: called after each service that may have changed controllers or EGM.
    """

    def __init__(self, node: Any, manager: RobotManager, check_arms: CheckArms, on_change: Callable[[], None]) -> None:
        self._node = node
        self._log = node.get_logger()
        self._on_change = on_change
        self._callback_groups = {group: MutuallyExclusiveCallbackGroup() for group in _Group}

        def start_egm() -> str:
            check_arms(Side)
            return manager.start_egm()

        def write_signal(request: Any) -> str:
            manager.write_signal(request.name, request.value)
            return f"Signal {request.name} is {request.value}"

        def write_variable(request: Any) -> str:
            manager.panel.write_variable(request.task, request.module, request.name, request.value)
            return f"{request.task}/{request.module}/{request.name} is {request.value}"

        def allow_collision(request: Any) -> str:
            if request.seconds == 0.0:
                return manager.end_allowed_collision(request.part, request.other)
            return manager.allow_collision(request.part, request.other, request.seconds)

        triggers: dict[str, tuple[_Group, Callable[[], str]]] = {
            "robot_is_ready": (_Group.READ, manager.check_ready),
            "get_state": (_Group.READ, manager.describe),
            "start_egm": (_Group.CHANGE, start_egm),
            "stop_egm": (_Group.STOP, manager.stop_egm),
            "motors_on": (_Group.CHANGE, manager.motors_on),
            "motors_off": (_Group.STOP, manager.motors_off),
            "start_rapid": (_Group.CHANGE, manager.start_rapid),
            "stop_rapid": (_Group.STOP, manager.stop_rapid),
            "pp_to_main": (_Group.CHANGE, manager.pp_to_main),
        }
        for name, (group, trigger) in triggers.items():
            self._serve(Trigger, name, group, partial(_without_request, trigger))
        changes: dict[str, tuple[Any, Callable[[Any], str]]] = {
            "run_routine": (RunRoutine, lambda ask: manager.run_routine(side_of(ask.arm), ask.routine)),
            "load_module": (LoadModule, lambda ask: manager.load_module(side_of(ask.arm), ask.file_name, ask.text)),
            "run_module": (
                RunModule,
                lambda ask: manager.run_module(side_of(ask.arm), ask.file_name, ask.text, ask.routine),
            ),
            "set_tool": (
                SetTool,
                lambda ask: manager.set_tool(side_of(ask.arm), pose_of(ask.tcp), mass_of(ask.load)),
            ),
            "set_payload": (SetPayload, lambda ask: manager.set_payload(side_of(ask.arm), mass_of(ask.payload))),
        }
        writes: dict[str, tuple[Any, Callable[[Any], str]]] = {
            "set_speed_ratio": (SetSpeedRatio, lambda ask: manager.set_speed_ratio(ask.percent)),
            "write_signal": (WriteSignal, write_signal),
            "write_variable": (WriteVariable, write_variable),
        }
        reads: dict[str, tuple[Any, Callable[[Any], str]]] = {
            "read_signal": (ReadSignal, lambda ask: manager.panel.read_signal(ask.name)),
            "read_variable": (ReadVariable, lambda ask: manager.panel.read_variable(ask.task, ask.module, ask.name)),
        }
        for name, (kind, call) in changes.items():
            self._serve(kind, name, _Group.CHANGE, call)
        for name, (kind, call) in writes.items():
            self._serve(kind, name, _Group.WRITE, call)
        self._serve(AllowCollision, "allow_collision", _Group.CONTACT, allow_collision)
        for name, (kind, call) in reads.items():
            self._serve(kind, name, _Group.READ, call, answer_field="value")

    def _serve(
        self, kind: Any, name: str, group: _Group, call: Callable[[Any], str], answer_field: str = "message"
    ) -> None:
        def answer(request: Any, response: Any) -> Any:
            try:
                setattr(response, answer_field, call(request))
                response.success = True
            except YumiError as error:
                response.success = False
                say_why(response, error)
                if group is not _Group.READ:
                    self._log.error(f"{name}: {error}")
            if group is not _Group.READ:
                self._on_change()
            return response

        callbacks = self._callback_groups[group]
        self._node.create_service(kind, f"~/{name}", answer, qos_profile=SERVICES, callback_group=callbacks)


def _without_request(call: Callable[[], str], _: Any) -> str:
    return call()


class _Cancelled(Exception):
    """The client has cancelled the goal; the next step has not begun. It is not reported as a failure."""


class RobotManagerActions:
    """The actions of the robot manager's node; arguments as of :class:`RobotManagerServices`, ``frame`` is the base."""

    def __init__(
        self,
        node: Any,
        manager: RobotManager,
        check_arms: CheckArms,
        on_change: Callable[[], None],
        frame: str = "",
    ) -> None:
        self._node = node
        self._frame = frame
        self._log = node.get_logger()
        self._clock = node.get_clock()
        self._manager = manager
        self._on_change = on_change
        self._busy = Lock()

        def set_mode(handle: Any, check: Callable[[str], None]) -> str:
            mode = mode_of(handle.request.mode)
            check_arms(mode.arms)
            return manager.go_to(mode, _report_steps(handle, SetMode, check))

        def recover(handle: Any, check: Callable[[str], None]) -> str:
            check_arms(manager.egm_arms)
            report = _report_steps(handle, Recover, check)
            confirmed = handle.request.confirm_stop.strip()
            return manager.recover(report, lambda: check("while the controller did not answer"), confirmed)

        self._servers = [self._serve(SetMode, "set_mode", set_mode), self._serve(Recover, "recover", recover)]

    def destroy(self) -> None:
        for server in self._servers:
            server.destroy()

    def _serve(self, kind: Any, name: str, call: Callable[[Any, Callable[[str], None]], str]) -> Any:
        def execute(handle: Any) -> Any:
            def check(when: str) -> None:
                if handle.is_cancel_requested:
                    raise _Cancelled(f"Cancelled {when}.")

            result, is_alone = kind.Result(), self._busy.acquire(blocking=False)
            is_stop = getattr(handle.request, "mode", "") == Mode.MOTORS_OFF.value  # which ends what is being done
            try:
                if not is_alone and not is_stop:
                    raise CommandRefused(message("another_mode_change"))
                result.message = call(handle, check)
                result.success = True
                handle.succeed()
            except _Cancelled as cancelled:
                result.message = str(cancelled)
                handle.canceled()
            except YumiError as error:
                say_why(result, error)
                self._log.error(f"{name}: {error}")
                handle.abort()
            finally:
                if is_alone:
                    self._busy.release()
            result.state = robot_state(self._manager.monitor.state(), self._clock.now().nanoseconds, self._frame)
            self._on_change()
            return result

        return ActionServer(
            self._node,
            kind,
            f"~/{name}",
            execute_callback=execute,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=ReentrantCallbackGroup(),
        )


def _report_steps(handle: Any, kind: Any, check: Callable[[str], None]) -> Callable[[str], None]:
    """Publishes each step as feedback, unless the goal has been cancelled before it."""

    def report(step: str) -> None:
        check(f"before: {step}")
        handle.publish_feedback(kind.Feedback(step=step))

    return report


_POLL_PERIOD = 0.05  # [s]
_SIGNALS_PERIOD = 0.5  # [s]: one request each, of the 19.6 a second that the controller answers


class SignalsTopic:
    """Publishes ``~/gpio_states``, all I/O signals of the controller, twice a second while a client listens.

    Args:
        node: the robot manager's node.
        read: reads them all; raises YumiError.
        timers: of its own, since a controller may take seconds to answer.
        frame: of the robot's base.
    """

    def __init__(
        self, node: Any, read: Callable[[], Mapping[str, float]], timers: TimerThread, frame: str = ""
    ) -> None:
        self._frame = frame
        self._log = node.get_logger()
        self._clock = node.get_clock()
        self._read = read
        if GPIO_STATES is not None:
            self._publisher = node.create_publisher(GPIO_STATES, "~/gpio_states", 1)
            timers.every(_SIGNALS_PERIOD, "gpio_states", self._publish)

    def _publish(self) -> None:
        if not self._publisher.get_subscription_count():
            return
        try:
            values = self._read()
        except YumiError as error:
            self._log.warning(f"gpio_states: {error}", throttle_duration_sec=10.0)
            return
        self._publisher.publish(gpio_states(values, self._clock.now().nanoseconds, self._frame))


NAME = "speed_scale"


class SpeedScaleInterface:
    """``speed_scale`` as the service ``~/set_speed_scale`` and as a parameter; both change the one setting.

    It can be set in every state of the robot, and waits for no other service. ``~/speed_scale`` is what holds now.
    """

    def __init__(self, node: Any, speed: SpeedSetting, timers: TimerThread) -> None:
        self._node = node
        self._speed = speed
        self._log = node.get_logger()
        described = ParameterDescriptor(
            description="The factor on the speed of every controller.",
            floating_point_range=[FloatingPointRange(from_value=LOWEST_SPEED_SCALE, to_value=FULL)],
        )
        node.add_on_set_parameters_callback(self._on_set_parameters)
        node.declare_parameter(NAME, speed.value, described)  # the callback takes a value of the command line
        self._publisher = node.create_publisher(SpeedScalingFactor, "~/speed_scale", LATCHED)
        self._published = 0.0
        timers.every(_POLL_PERIOD, "speed_scale", self._publish)
        node.create_service(
            SetSpeedScale,
            "~/set_speed_scale",
            self._set,
            qos_profile=SERVICES,
            callback_group=MutuallyExclusiveCallbackGroup(),
        )

    def _publish(self) -> None:
        if self._speed.in_force != self._published:
            self._published = self._speed.in_force
            self._publisher.publish(SpeedScalingFactor(factor=self._published))

    def _on_set_parameters(self, parameters: list[Any]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name == NAME and parameter.value != self._speed.value:
                try:
                    self._log.info(self._speed.set(parameter.value))
                except CommandRefused as error:
                    return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _set(self, request: Any, response: Any) -> Any:
        try:
            response.message = self._speed.set(request.speed_scale)
            response.success = True
            self._node.set_parameters([Parameter(NAME, value=self._speed.value)])
            self._log.info(response.message)
        except CommandRefused as error:
            say_why(response, error)
        return response
