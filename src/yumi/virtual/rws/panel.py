"""``/rw/panel``: motors, operating mode, speed ratio (reference/rws.md §5)."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

from yumi.rws.documents import Page, State
from yumi.rws.types import Code, Grant, OperatingMode
from yumi.virtual.controller.controller import Irc5
from yumi.virtual.rws import ctrl
from yumi.virtual.rws.operations import Call, Failure, Operation, entry, invalid, resource

VALUES: Mapping[str, Callable[[Irc5], str]] = {
    "ctrlstate": lambda controller: controller.controller_state.value,
    "opmode": lambda controller: controller.mode.value,
    "speedratio": lambda controller: str(controller.speed_ratio),
    "coldetstate": lambda controller: controller.collision_state.value,
}
"""What the panel shows, to read and to subscribe to."""

_RESTARTS = ("restart", "istart", "pstart", "bstart")


def get_panel(controller: Irc5, call: Call) -> Page:
    return resource("panel", "/rw/", "panel", *(entry(f"pnl-{name}-li", name, f"panel/{name}") for name in VALUES))


def get_value(controller: Irc5, call: Call) -> Page:
    name = call.path[-1]
    text = VALUES[name](controller)
    if name == "coldetstate":  # the other title and the trailing blank are ABB's
        state = State("pnl-coldetstate", "collisiondetectstate", {"coldetstate ": text})
    else:
        state = State(f"pnl-{name}", name, {name: text})
    return resource("panel", "/rw/panel/", name, state)


def set_controller_state(controller: Irc5, call: Call) -> None:
    controller.set_motors(call.required("ctrl-state") == "motoron")


def set_speed_ratio(controller: Irc5, call: Call) -> None:
    controller.set_speed_ratio(int(call.number("speed-ratio")))


def acknowledge(controller: Irc5, call: Call) -> None:
    what = call.required("opmode")
    if what != "coldet":
        raise Failure(403, Code.MODE_REJECT, f"{what} is acknowledged on the FlexPendant")
    controller.acknowledge_collision()


def get_lock_state(controller: Irc5, call: Call) -> Page:
    fields = {"lock-state": controller.own_settings.mode_lock}
    return resource("panel", "/rw/panel/", "opmode", State("pnl-opmode-lock", "lock-state", fields))


def lock(controller: Irc5, call: Call) -> None:
    own, pin = controller.own_settings, call.required("pin")
    if not re.fullmatch(r"\d{4}", pin):
        raise invalid("pin has four digits")
    if own.mode_lock != "unlocked":
        raise Failure(403, Code.DENIED, "the operating mode is locked already")
    own.pin = pin
    own.mode_lock = "permlocked" if call.required("permanent") == "1" else "locked"


def unlock(controller: Irc5, call: Call) -> None:
    own = controller.own_settings
    if own.mode_lock == "unlocked":
        raise invalid("the operating mode is not locked")
    if call.required("pin") != own.pin:
        raise Failure(403, Code.DENIED, "the pin is another one")
    own.mode_lock, own.pin = "unlocked", ""


_MODES = {"auto": OperatingMode.AUTO, "man": OperatingMode.MANUAL_REDUCED, "manfs": OperatingMode.MANUAL_FULL}


def select_mode(controller: Irc5, call: Call) -> None:
    """The mode is selected by a key on the controller; RobotStudio's controllers alone have none."""
    mode = _MODES[call.required("opmode")]
    if not controller.identity.is_virtual:
        raise Failure(403, Code.MODE_REJECT, "the operating mode is selected by the key on the controller")
    if controller.own_settings.mode_lock != "unlocked":
        raise Failure(403, Code.MODE_REJECT, "the operating mode is locked")
    controller.select_mode(mode)


OPERATIONS = (
    Operation("GET", "/rw/panel", get_panel),
    Operation(
        "POST", "/rw/panel", ctrl.restart, "restart", {"restart-mode": _RESTARTS}, needs_grant=Grant.REMOTE_WARMSTART
    ),
    Operation(
        "POST",
        "/rw/panel",
        ctrl.set_language,
        "setlang",
        {"lang-code": ()},
        needs_grant=Grant.CONTROLLER_PROPERTIES_WRITE,
    ),
    *(Operation("GET", f"/rw/panel/{name}", get_value) for name in VALUES),
    Operation(
        "POST",
        "/rw/panel/ctrlstate",
        set_controller_state,
        "setctrlstate",
        {"ctrl-state": ("motoron", "motoroff")},
    ),
    Operation("POST", "/rw/panel/opmode", select_mode, values={"opmode": tuple(_MODES)}, status=403),
    Operation("POST", "/rw/panel/opmode", acknowledge, "acknowledge", {"opmode": ("auto", "manf", "coldet")}),
    Operation("GET", "/rw/panel/opmode", get_lock_state, resource="lock-state"),
    Operation("POST", "/rw/panel/opmode", lock, "lock", {"pin": (), "permanent": ("0", "1")}),
    Operation("POST", "/rw/panel/opmode", unlock, "unlock", {"pin": ()}),
    Operation(
        "POST",
        "/rw/panel/speedratio",
        set_speed_ratio,
        "setspeedratio",
        {"speed-ratio": ()},
        needs_grant=Grant.SPEED_DECREASE,
    ),
)
