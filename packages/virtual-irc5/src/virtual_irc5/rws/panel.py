"""The virtual controller's answers on ``/rw/panel``: motors, mode, speed ratio, collision detection, restart."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any

from abb_protocols.rws.documents import Page
from abb_protocols.rws.operations import panel as table
from abb_protocols.rws.operations.operation import Operation
from abb_protocols.rws.values import OperatingMode, RwsCode
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.rws import ctrl
from virtual_irc5.rws.render import page_at, page_entry
from virtual_irc5.rws.router import Route, Routes
from virtual_irc5.rws.rws_call import CallFailure, RwsCall, bad_call

_VALUES: Mapping[str, tuple[Operation[Any], Callable[[Irc5], object]]] = {
    "ctrlstate": (table.CONTROLLER_STATE, lambda controller: controller.controller_state),
    "opmode": (table.OPERATING_MODE, lambda controller: controller.mode),
    "speedratio": (table.SPEED_RATIO, lambda controller: controller.speed_ratio),
    "coldetstate": (table.COLLISION_STATE, lambda controller: controller.collision_state),
}
TITLES = {"coldetstate": "collisiondetectstate"}
"""Of what the panel shows, where it is not the name."""

_MODES = {"auto": OperatingMode.AUTO, "man": OperatingMode.MANUAL_REDUCED, "manfs": OperatingMode.MANUAL_FULL}
ROUTES = Routes()
ROUTES.answer(table.RESTART_BY_PANEL)(ctrl.restart)
ROUTES.answer(table.SET_PANEL_LANGUAGE)(ctrl.set_language)


@ROUTES.answer(table.PANEL)
def _get_panel(controller: Irc5, call: RwsCall) -> Page:
    return page_at("panel", "/rw/", "panel", *(page_entry(f"pnl-{name}-li", name, f"panel/{name}") for name in _VALUES))


def _get_panel_value(controller: Irc5, call: RwsCall) -> Mapping[str, object]:
    name = call.path[-1]
    return {TITLES.get(name, name): _VALUES[name][1](controller)}


ROUTES += [Route(operation, _get_panel_value) for operation, _ in _VALUES.values()]


def panel_text(controller: Irc5, name: str) -> str:
    """What the panel shows, for subscriptions."""
    operation, read = _VALUES[name]
    (text,) = operation.answered.write(read(controller)).values()
    return text


@ROUTES.answer(table.SET_CONTROLLER_STATE)
def _set_controller_state(controller: Irc5, call: RwsCall) -> None:
    controller.set_motors(call.required("ctrl-state") == "motoron")


@ROUTES.answer(table.SET_SPEED_RATIO)
def _set_speed_ratio(controller: Irc5, call: RwsCall) -> None:
    controller.set_speed_ratio(int(call.number("speed-ratio")))


@ROUTES.answer(table.ACKNOWLEDGE_MODE)
def _acknowledge(controller: Irc5, call: RwsCall) -> None:
    what = call.required("opmode")
    if what != "coldet":
        raise CallFailure(403, RwsCode.MODE_REJECT, f"{what} is acknowledged on the FlexPendant")
    controller.acknowledge_collision()


@ROUTES.answer(table.MODE_LOCK)
def _get_mode_lock(controller: Irc5, call: RwsCall) -> Mapping[str, str]:
    return {"lock-state": controller.own_settings.mode_lock}


@ROUTES.answer(table.LOCK_MODE)
def _lock_mode(controller: Irc5, call: RwsCall) -> None:
    own, pin = controller.own_settings, call.required("pin")
    if not re.fullmatch(r"\d{4}", pin):
        raise bad_call("pin has four digits")
    if own.mode_lock != "unlocked":
        raise CallFailure(403, RwsCode.DENIED, "the operating mode is locked already")
    own.pin = pin
    own.mode_lock = "permlocked" if call.required("permanent") == "1" else "locked"


@ROUTES.answer(table.UNLOCK_MODE)
def _unlock_mode(controller: Irc5, call: RwsCall) -> None:
    own = controller.own_settings
    if own.mode_lock == "unlocked":
        raise bad_call("the operating mode is not locked")
    if call.required("pin") != own.pin:
        raise CallFailure(403, RwsCode.DENIED, "the pin is another one")
    own.mode_lock, own.pin = "unlocked", ""


@ROUTES.answer(table.SELECT_MODE)
def _select_mode(controller: Irc5, call: RwsCall) -> None:
    """The mode is selected by a key on the controller; RobotStudio's controllers alone have none."""
    mode = _MODES[call.required("opmode")]
    if not controller.identity.is_virtual:
        raise CallFailure(403, RwsCode.MODE_REJECT, "the operating mode is selected by the key on the controller")
    if controller.own_settings.mode_lock != "unlocked":
        raise CallFailure(403, RwsCode.MODE_REJECT, "the operating mode is locked")
    controller.select_mode(mode)
