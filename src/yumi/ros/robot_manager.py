"""The robot manager's services (:mod:`yumi.hardware.robot_manager`): what each is called, asks for and answers.

What only reads, and what brings the robot to a stop, is served beside what takes its time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from std_srvs.srv import Trigger
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

from yumi.errors import YumiError
from yumi.hardware.robot_manager import RobotManager
from yumi.robot.joints import Side
from yumi.ros.managed_node import demand
from yumi.ros.permission import Permission
from yumi.ros.robot_messages import side_of


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
        manager.write_variable(ask.task, ask.module, ask.name, ask.value)
        return f"{ask.task}/{ask.module}/{ask.name} is {ask.value}"

    return (
        Offer("read_signal", ReadSignal, Lane.READ, lambda ask: manager.read_signal(ask.name), is_reading=True),
        Offer("write_signal", WriteSignal, Lane.CHANGE, write_signal),
        Offer(
            "read_variable",
            ReadVariable,
            Lane.READ,
            lambda ask: manager.read_variable(ask.task, ask.module, ask.name),
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
