"""Controllers, hardware and their states as messages of controller_manager_msgs, for older and newer installations."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from controller_manager_msgs.msg import ControllerState, HardwareComponentState, HardwareInterface
from lifecycle_msgs.msg import State as LifecycleState

from yumi.control.inventory import ControllerInfo, HardwareInfo, InterfaceInfo
from yumi.control.lifecycle import State
from yumi.errors import CommandRefused
from yumi.ros.conversions import stamp

try:
    from controller_manager_msgs.msg import ControllerManagerActivity, NamedLifecycleState
except ImportError:  # installations from before April 2025
    ControllerManagerActivity = NamedLifecycleState = None

ACTIVITY: Any = ControllerManagerActivity
"""The type of ``~/activity``; None where the installed package is older."""

PLUGIN = "yumi_ros2/EgmSystem"
"""What the tools show as the plug-in of an arm's hardware component."""

_IDS = {
    State.UNCONFIGURED: LifecycleState.PRIMARY_STATE_UNCONFIGURED,
    State.INACTIVE: LifecycleState.PRIMARY_STATE_INACTIVE,
    State.ACTIVE: LifecycleState.PRIMARY_STATE_ACTIVE,
    State.FINALIZED: LifecycleState.PRIMARY_STATE_FINALIZED,
}


def filled(message: Any, /, **values: object) -> Any:
    """``message`` with ``values`` in the fields that the installed type has; some came within one ROS distribution."""
    for name, value in values.items():
        if hasattr(message, name):
            setattr(message, name, value)
    return message


def lifecycle_state(state: State) -> LifecycleState:
    """Id and label, since some tools compare the one and some the other."""
    return LifecycleState(id=_IDS[state], label=state.value)


def state_of(message: Any) -> State:
    """The primary state that ``message`` names by its id, or by its label where the id is 0.

    Raises:
        CommandRefused: it names none.
    """
    for state, number in _IDS.items():
        if message.id == number or (message.id == 0 and message.label == state.value):
            return state
    choices = ", ".join(f"{number} {state.value}" for state, number in _IDS.items())
    raise CommandRefused(f"State {message.id} {message.label!r} is no state to be in; choose from: {choices}.")


def controller_state(info: ControllerInfo, update_rate: int) -> ControllerState:
    """What ``list_controllers`` tells of one controller; required interfaces only from configuring on, as upstream."""
    is_configured = info.state in {State.INACTIVE, State.ACTIVE}
    return filled(
        ControllerState(),
        name=info.name,
        state=info.state.value,
        type=info.kind,
        is_async=False,
        update_rate=update_rate,
        claimed_interfaces=list(info.claimed),
        required_command_interfaces=list(info.required) if is_configured else [],
        required_state_interfaces=list(info.required_state) if is_configured else [],
        is_chainable=False,
        is_chained=False,
    )


def hardware_state(info: HardwareInfo, rate: int) -> HardwareComponentState:
    """What ``list_hardware_components`` tells of an arm; ``rate`` in [Hz]."""
    return filled(
        HardwareComponentState(),
        name=info.name,
        type="system",
        is_async=False,
        rw_rate=rate,
        plugin_name=PLUGIN,
        state=lifecycle_state(info.state),
        command_interfaces=hardware_interfaces(info.command_interfaces),
        state_interfaces=hardware_interfaces(info.state_interfaces),
    )


def hardware_interfaces(infos: Iterable[InterfaceInfo]) -> list[HardwareInterface]:
    """Command or state interfaces; all are doubles."""
    return [
        filled(
            HardwareInterface(),
            name=info.name,
            data_type="double",
            is_available=info.is_available,
            is_claimed=info.is_claimed,
        )
        for info in infos
    ]


def activity(controllers: Iterable[ControllerInfo], hardware: HardwareInfo, time_ns: int) -> ControllerManagerActivity:
    """Who is in which state; only where the installed package has the type."""
    message = ControllerManagerActivity()
    message.header.stamp = stamp(time_ns)
    message.controllers = [_named_state(info.name, info.state) for info in controllers]
    message.hardware_components = [_named_state(hardware.name, hardware.state)]
    return message


def _named_state(name: str, state: State) -> NamedLifecycleState:
    return NamedLifecycleState(name=name, state=lifecycle_state(state))
