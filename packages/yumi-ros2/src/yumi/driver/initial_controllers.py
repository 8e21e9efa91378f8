"""The controllers that an arm starts with: its controller manager, and how each is led to its initial state."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from abb_protocols.catalogue import message, said_by
from abb_protocols.errors import CommandRefused, SettingsError, SwitchFailed
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, JointLimits, Side, joint_names
from yumi.control.controller import Controller, find_controller_parameter
from yumi.control.controllers import find_controllers
from yumi.control.manager.controller_manager import ControllerManager
from yumi.control.place import Place
from yumi.control.shared_state import read_snapshot
from yumi.control.speed_scale import SpeedScale
from yumi.control.tool_limits import ToolLimits
from yumi.driver.control_process import ArmBuffers
from yumi.driver.settings import MANAGER_SETTINGS, ControllerSettings, InitialState

Controllers = Mapping[Side, tuple[ControllerSettings, ...]]
"""What runs on each arm."""

Halves = dict[str, dict[Side, object]]
"""The active halves of controllers that move both arms, by the controllers' name and arm."""

CONTROLLER_KINDS: Mapping[str, Callable[[Place], Controller]] = {each.kind: each.make for each in find_controllers()}
"""How a controller of each type is made."""


def check_controllers(controllers: Controllers) -> Controllers:
    """``controllers`` as the control process can start them: tried, and without what a wildcard says for others.

    Raises:
        SettingsError: a controller has an unknown type, a parameter it cannot have, or a state it cannot start in.
    """
    halves: Halves = {}
    return {
        side: start_controllers(controller_manager_of(side, ArmBuffers(), halves), entries)
        for side, entries in controllers.items()
    }


def controller_manager_of(
    side: Side,
    buffers: ArmBuffers,
    halves: Halves,
    limits: JointLimits = YUMI_LIMITS,
    period: float = CYCLE,
    speed: SpeedScale | None = None,
    tool_limits: ToolLimits = ToolLimits(),  # noqa: B008 - it is frozen
) -> ControllerManager:
    """A controller manager for an arm, which has every kind of controller and has loaded none."""
    speed = speed or SpeedScale()

    def factory(make: Callable[[Place], Controller]) -> Callable[[str], Controller]:
        return lambda name: make(
            Place(name, side, buffers, halves.setdefault(name, {}), limits, period, speed, tool_limits)
        )

    kinds = {kind: factory(make) for kind, make in CONTROLLER_KINDS.items()}
    counted = read_snapshot(buffers.snapshots).activity
    return ControllerManager(joint_names(side), kinds, side.unit, time.monotonic, counted)


def start_controllers(
    manager: ControllerManager, controllers: Sequence[ControllerSettings]
) -> tuple[ControllerSettings, ...]:
    """Lead ``controllers`` to their initial states; their settings, each with its own parameters only.

    Raises:
        SettingsError: a type is unknown, a parameter not allowed or not known, or a state cannot be reached.
    """
    started = tuple(_start_controller(manager, settings) for settings in controllers)
    # What stands under a wildcard must be for a controller: a mistyped word would pass unseen.
    taken = {entry.place for settings in started for entry in settings.entries.values()}
    for settings in controllers:
        for key, entry in settings.entries.items():
            if entry.place not in taken and not key.endswith(MANAGER_SETTINGS):
                raise SettingsError(message("parameter_of_no_controller", place=entry.place, parameter=key))
    return started


def _start_controller(manager: ControllerManager, settings: ControllerSettings) -> ControllerSettings:
    name, state = settings.name, settings.state
    if settings.kind not in manager.kinds:
        raise SettingsError(
            message(
                "controller_of_unknown_type",
                place=settings.place,
                controller=name,
                type=settings.kind,
                known=tuple(manager.kinds),
            )
        )
    if state is InitialState.UNLOADED:
        return settings
    place = settings.place  # of what may be refused
    try:
        manager.load_kind(name, settings.kind)
        has = [info.parameter for info in manager.parameters(name)]
        own = {
            key: entry
            for key, entry in settings.entries.items()
            if find_controller_parameter(has, key) or not entry.is_general
        }
        for key, entry in own.items():
            place = entry.place
            manager.set_parameters(name, {key: entry.value})
        place = settings.place
        if state is not InitialState.UNCONFIGURED:
            manager.configure(name)
            commands = any(info.required for info in manager.controllers() if info.name == name)
            if state is InitialState.ACTIVE or (state is None and not commands):
                manager.switch((name,), (), None)
    except (CommandRefused, SwitchFailed) as refusal:
        raise SettingsError(message("setting_refused", place=place, reason=said_by(refusal))) from refusal
    return replace(settings, entries=own)
