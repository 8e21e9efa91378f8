"""The controllers an arm starts with: loaded, given their parameters and led to their initial states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from yumi.control.manager import ControllerManager
from yumi.errors import CommandRefused, SettingsError, SwitchFailed
from yumi.settings import MANAGER_SETTINGS, ControllerSettings, InitialState


def start_controllers(
    manager: ControllerManager, controllers: Sequence[ControllerSettings]
) -> tuple[ControllerSettings, ...]:
    """Lead ``controllers`` to their initial states; their settings, each with its own parameters only.

    Raises:
        SettingsError: a type is unknown, a parameter not allowed or known to nobody, or a state cannot be reached.
    """
    started = tuple(_start(manager, settings) for settings in controllers)
    _check_general(controllers, started)
    return started


def _start(manager: ControllerManager, settings: ControllerSettings) -> ControllerSettings:
    if settings.kind not in manager.kinds:
        known = ", ".join(manager.kinds)
        raise SettingsError(
            f"{settings.place}: controller {settings.name!r} has type {settings.kind!r}; known are: {known}."
        )
    if settings.state is InitialState.UNLOADED:
        return settings
    try:
        manager.load_kind(settings.name, settings.kind)
    except CommandRefused as refusal:
        raise SettingsError(f"{settings.place}: {refusal}") from refusal
    own = _set_parameters(manager, settings)
    _lead_to_state(manager, settings)
    return own


def _set_parameters(manager: ControllerManager, settings: ControllerSettings) -> ControllerSettings:
    """One by one, so that a refusal names its line."""
    known = {info.parameter.name for info in manager.parameters(settings.name)}
    own = {key: entry for key, entry in settings.entries.items() if key in known or not entry.is_general}
    for key, entry in own.items():
        try:
            manager.set_parameters(settings.name, {key: entry.value})
        except CommandRefused as refusal:
            raise SettingsError(f"{entry.place}: {refusal}") from refusal
    return replace(settings, entries=own)


def _lead_to_state(manager: ControllerManager, settings: ControllerSettings) -> None:
    if settings.state is InitialState.UNCONFIGURED:
        return
    try:
        manager.configure(settings.name)
        if settings.state is InitialState.ACTIVE or (settings.state is None and not _commands(manager, settings.name)):
            manager.switch((settings.name,), (), None)
    except (CommandRefused, SwitchFailed) as refusal:
        raise SettingsError(f"{settings.place}: {refusal}") from refusal


def _commands(manager: ControllerManager, name: str) -> bool:
    return any(info.required for info in manager.controllers() if info.name == name)


def _check_general(controllers: Sequence[ControllerSettings], started: Sequence[ControllerSettings]) -> None:
    """What stands under a wildcard must be for somebody: another mistyped word would pass in silence."""
    taken = {entry.place for settings in started for entry in settings.entries.values()}
    for settings in controllers:
        for key, entry in settings.entries.items():
            if entry.place not in taken and not key.endswith(MANAGER_SETTINGS):
                raise SettingsError(f"{entry.place}: no controller has a parameter {key!r}.")
