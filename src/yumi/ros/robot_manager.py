"""The robot manager's services (:mod:`yumi.driver.robot_manager`): what each is called, asks for and answers.

What only reads, and what brings the robot to a stop, is served beside what takes its time.

The robot manager's actions ``set_mode`` and ``recover``: one at a time, with a sentence of feedback for each step.

A goal that cannot be met is not rejected, which would tell nobody why: it is aborted at once, with the reason.

``speed_scale`` on the robot manager's node: the service ``~/set_speed_scale`` and a parameter of the same name.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from functools import partial
from threading import Lock
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger
from yumi_interfaces.action import Recover, SetMode
from yumi_interfaces.srv import (
    LoadModule,
    ReadSignal,
    ReadVariable,
    RunModule,
    RunRoutine,
    SetSpeedRatio,
    SetSpeedScale,
    WriteSignal,
    WriteVariable,
)

from yumi.control.limiter import FULL
from yumi.driver.robot_manager import RobotManager
from yumi.driver.speed import LOWEST, SpeedSetting
from yumi.errors import CommandRefused, RobotNotReady, YumiError
from yumi.robot.joints import Side
from yumi.ros.lifecycle import demand
from yumi.ros.messages import mode_of, robot_state, side_of
from yumi.ros.permission import Permission


class Lane(Enum):
    """Services of one lane wait for each other."""

    READ = "read"
    STOP = "stop"
    CHANGE = "change"


@dataclass(frozen=True, slots=True)
class Offer:
    """One service.

    Attributes:
        name: under the node's name.
        kind: its type.
        lane: which others it waits for; what changes the robot needs it to be active, the rest a connection.
        carry: does it; what the answer says.
        arms: those that must be active for it.
        is_reading: whether the answer has a value, which ``carry`` gives.
    """

    name: str
    kind: Any
    lane: Lane
    carry: Callable[[Any], str]
    arms: tuple[Side, ...] = ()
    is_reading: bool = False


def offers(manager: RobotManager) -> tuple[Offer, ...]:
    """All services."""
    return (*_triggers(manager), *_orders(manager), *_values(manager))


def _triggers(manager: RobotManager) -> tuple[Offer, ...]:
    def trigger(name: str, lane: Lane, carry: Callable[[], str], arms: tuple[Side, ...] = ()) -> Offer:
        return Offer(name, Trigger, lane, lambda _: carry(), arms)

    return (
        trigger("robot_is_ready", Lane.READ, manager.check_ready),
        trigger("get_state", Lane.READ, manager.describe),
        trigger("start_egm", Lane.CHANGE, manager.start_egm, tuple(Side)),
        trigger("stop_egm", Lane.STOP, manager.stop_egm),
        trigger("motors_on", Lane.CHANGE, manager.motors_on),
        trigger("motors_off", Lane.STOP, manager.motors_off),
        trigger("start_rapid", Lane.CHANGE, manager.start_rapid),
        trigger("stop_rapid", Lane.STOP, manager.stop_rapid),
        trigger("pp_to_main", Lane.CHANGE, manager.pp_to_main),
    )


def _orders(manager: RobotManager) -> tuple[Offer, ...]:
    return (
        Offer("set_speed_ratio", SetSpeedRatio, Lane.CHANGE, lambda ask: manager.set_speed_ratio(ask.percent)),
        Offer("run_routine", RunRoutine, Lane.CHANGE, lambda ask: manager.run_routine(side_of(ask.arm), ask.routine)),
        Offer(
            "load_module",
            LoadModule,
            Lane.CHANGE,
            lambda ask: manager.load_module(side_of(ask.arm), ask.file_name, ask.text),
        ),
        Offer(
            "run_module",
            RunModule,
            Lane.CHANGE,
            lambda ask: manager.run_module(side_of(ask.arm), ask.file_name, ask.text, ask.routine),
        ),
    )


def _values(manager: RobotManager) -> tuple[Offer, ...]:
    def write_signal(ask: Any) -> str:
        manager.write_signal(ask.name, ask.value)
        return f"Signal {ask.name} is {ask.value}"

    def write_variable(ask: Any) -> str:
        manager.panel.write_variable(ask.task, ask.module, ask.name, ask.value)
        return f"{ask.task}/{ask.module}/{ask.name} is {ask.value}"

    return (
        Offer("read_signal", ReadSignal, Lane.READ, lambda ask: manager.panel.read_signal(ask.name), is_reading=True),
        Offer("write_signal", WriteSignal, Lane.CHANGE, write_signal),
        Offer(
            "read_variable",
            ReadVariable,
            Lane.READ,
            lambda ask: manager.panel.read_variable(ask.task, ask.module, ask.name),
            is_reading=True,
        ),
        Offer("write_variable", WriteVariable, Lane.CHANGE, write_variable),
    )


class RobotManagerServices:
    """Serves them on the robot manager's node.

    Args:
        node: the robot manager's node.
        manager: what is offered.
        permission: who must be configured or active.
        on_change: called after each service, since controllers and EGM may have changed.
    """

    def __init__(self, node: Any, manager: RobotManager, permission: Permission, on_change: Callable[[], None]) -> None:
        self._log = node.get_logger()
        self._permission = permission
        self._on_change = on_change
        groups = {lane: MutuallyExclusiveCallbackGroup() for lane in Lane}
        for offer in offers(manager):
            node.create_service(
                offer.kind, f"~/{offer.name}", self._answer_with(offer), callback_group=groups[offer.lane]
            )

    def _answer_with(self, offer: Offer) -> Callable[[Any, Any], Any]:
        def answer(request: Any, response: Any) -> Any:
            try:
                self._check(offer)
                said = offer.carry(request)
                response.success = True
            except YumiError as error:
                said = str(error)
                response.success = False
                if offer.lane is not Lane.READ:
                    self._log.error(f"{offer.name}: {error}")
            self._fill(offer, response, said)
            if offer.lane is not Lane.READ:
                self._on_change()
            return response

        return answer

    def _check(self, offer: Offer) -> None:
        if offer.lane is Lane.CHANGE:
            demand(self._permission.to_move(offer.arms))
        else:
            demand(self._permission.to_ask())

    def _fill(self, offer: Offer, response: Any, said: str) -> None:
        if response.success and offer.is_reading:
            response.value = said
        else:
            response.message = said


class _Cancelled(Exception):
    """Somebody has cancelled the goal; the step that was to come has not begun. Nobody explains it as a failure."""


class _Steps:
    """Tells a goal's client each step, unless the goal has been cancelled or nothing may move any more."""

    def __init__(self, handle: Any, kind: Any, permission: Permission) -> None:
        self._handle = handle
        self._kind = kind
        self._permission = permission

    def __call__(self, step: str) -> None:
        self.check(f"before: {step}")
        self._handle.publish_feedback(self._kind.Feedback(step=step))

    def check(self, when: str) -> None:
        """Raise when the goal shall end here; ``when`` says where that is."""
        if self._handle.is_cancel_requested:
            raise _Cancelled(f"Cancelled {when}.")
        reason = self._permission.to_move()
        if reason is not None:
            raise RobotNotReady(f"Given up {when}; {reason}")


class RobotManagerActions:
    """Serves them on the robot manager's node.

    Args:
        node: the robot manager's node.
        manager: what carries them out.
        permission: who must be active.
        on_change: called after each, since controllers and EGM may have changed.
    """

    def __init__(self, node: Any, manager: RobotManager, permission: Permission, on_change: Callable[[], None]) -> None:
        self._log = node.get_logger()
        self._clock = node.get_clock()
        self._manager = manager
        self._permission = permission
        self._on_change = on_change
        self._busy = Lock()
        self._servers = [
            ActionServer(
                node,
                kind,
                f"~/{name}",
                execute_callback=self._executing(name, kind, carry),
                cancel_callback=lambda _: CancelResponse.ACCEPT,
                callback_group=ReentrantCallbackGroup(),
            )
            for name, kind, carry in (("set_mode", SetMode, self._set_mode), ("recover", Recover, self._recover))
        ]

    def destroy(self) -> None:
        for server in self._servers:
            server.destroy()

    def _set_mode(self, goal: Any, report: _Steps) -> str:
        mode = mode_of(goal.mode)
        demand(self._permission.to_move(mode.arms))
        return self._manager.go_to(mode, report)

    def _recover(self, goal: Any, report: _Steps) -> str:
        demand(self._permission.to_move(self._manager.egm_arms))
        check = partial(report.check, "while the controller did not answer")
        return self._manager.recover(report, check, goal.confirm_stop.strip())

    def _executing(self, name: str, kind: Any, carry: Callable[[Any, _Steps], str]) -> Callable[[Any], Any]:
        def execute(handle: Any) -> Any:
            result = kind.Result()
            try:
                result.message = self._alone(lambda: carry(handle.request, _Steps(handle, kind, self._permission)))
                result.success = True
                handle.succeed()
            except _Cancelled as cancelled:
                result.message = str(cancelled)
                handle.canceled()
            except YumiError as error:
                result.message = str(error)
                self._log.error(f"{name}: {error}")
                handle.abort()
            result.state = robot_state(self._manager.monitor.state(), self._clock.now().nanoseconds)
            self._on_change()
            return result

        return execute

    def _alone(self, carry: Callable[[], str]) -> str:
        if not self._busy.acquire(blocking=False):
            raise CommandRefused("Another set_mode or recover is being carried out; wait for its result or cancel it.")
        try:
            return carry()
        finally:
            self._busy.release()


NAME = "speed_scale"


class SpeedScaleInterface:
    """Both change the one setting, in whatever state the robot is; who slows it down waits for nothing else.

    Args:
        node: the robot manager's node.
        speed: the setting.
    """

    def __init__(self, node: Any, speed: SpeedSetting) -> None:
        self._node = node
        self._speed = speed
        self._log = node.get_logger()
        described = ParameterDescriptor(
            description="The factor on the speed of every controller.",
            floating_point_range=[FloatingPointRange(from_value=LOWEST, to_value=FULL)],
        )
        node.add_on_set_parameters_callback(self._take)
        node.declare_parameter(NAME, speed.value, described)  # one given on the command line is taken by it
        node.create_service(
            SetSpeedScale, "~/set_speed_scale", self._serve, callback_group=MutuallyExclusiveCallbackGroup()
        )

    def _take(self, parameters: list[Any]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name == NAME and parameter.value != self._speed.value:
                try:
                    self._log.info(self._speed.set(parameter.value))
                except CommandRefused as error:
                    return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _serve(self, request: Any, response: Any) -> Any:
        """The service refuses with its own sentence; what it takes, the parameter tells, too."""
        try:
            response.message = self._speed.set(request.speed_scale)
            response.success = True
            self._node.set_parameters([Parameter(NAME, value=self._speed.value)])
            self._log.info(response.message)
        except CommandRefused as error:
            response.message = str(error)
        return response
