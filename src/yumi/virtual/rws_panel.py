"""``/rw/panel``: motors, operating mode, speed ratio (reference/rws.md §5)."""

from __future__ import annotations

from math import isfinite

from yumi.rws.codes import Code
from yumi.rws.pages import Page, State
from yumi.virtual.rws_port import Controller
from yumi.virtual.rws_routes import Call, Failure, Route, entry, invalid, resource

_BASE = "/rw/panel/"
_RESTARTS = ("restart", "istart", "pstart", "bstart")
_MOTORS = {"motoron": True, "motoroff": False}


def _panel(controller: Controller, call: Call) -> Page:
    kinds = ("ctrlstate", "opmode", "speedratio", "coldetstate")
    return resource("panel", "/rw/", "panel", *(entry(f"pnl-{kind}-li", kind, f"panel/{kind}") for kind in kinds))


def _one(name: str, text: str) -> Page:
    return resource("panel", _BASE, name, State(f"pnl-{name}", name, {name: text}))


def _controller_state(controller: Controller, call: Call) -> Page:
    return _one("ctrlstate", controller.controller_state.value)


def _set_controller_state(controller: Controller, call: Call) -> None:
    state = call.required("ctrl-state")
    if state not in _MOTORS:
        raise invalid(f"ctrl-state is motoron or motoroff, not {state!r}")
    controller.set_motors(_MOTORS[state])


def _operating_mode(controller: Controller, call: Call) -> Page:
    return _one("opmode", controller.mode.value)


def _speed_ratio(controller: Controller, call: Call) -> Page:
    return _one("speedratio", str(controller.speed_ratio))


def _set_speed_ratio(controller: Controller, call: Call) -> None:
    text = call.required("speed-ratio")
    try:
        percent = float(text)
    except ValueError:
        raise invalid(f"speed-ratio is a number, not {text!r}") from None
    if not isfinite(percent):
        raise invalid(f"speed-ratio is 0 to 100, not {text}")
    controller.set_speed_ratio(int(percent))


def _collision_state(controller: Controller, call: Call) -> Page:
    """The trailing blank is ABB's."""
    state = State("pnl-coldetstate", "collisiondetectstate", {"coldetstate ": controller.collision_state.value})
    return resource("panel", _BASE, "coldetstate", state)


def _acknowledge(controller: Controller, call: Call) -> None:
    what = call.required("opmode")
    if what != "coldet":
        raise Failure(403, Code.MODE_REJECT, f"{what} is acknowledged on the FlexPendant")
    controller.acknowledge_collision()


def _restart(controller: Controller, call: Call) -> None:
    mode = call.required("restart-mode")
    if mode not in _RESTARTS:
        raise invalid(f"restart-mode is {' or '.join(_RESTARTS)}, not {mode!r}")
    if mode != "restart":
        raise Failure(400, Code.NOTIMPL, f"the virtual controller cannot {mode}; it knows restart")
    controller.restart()


ROUTES = (
    Route("GET", "/rw/panel", _panel),
    Route("POST", "/rw/panel", _restart, "restart"),
    Route("POST", "/rw/panel/opmode", _acknowledge, "acknowledge"),
    Route("GET", "/rw/panel/coldetstate", _collision_state),
    Route("GET", "/rw/panel/ctrlstate", _controller_state),
    Route("POST", "/rw/panel/ctrlstate", _set_controller_state, "setctrlstate"),
    Route("GET", "/rw/panel/opmode", _operating_mode),
    Route("GET", "/rw/panel/speedratio", _speed_ratio),
    Route("POST", "/rw/panel/speedratio", _set_speed_ratio, "setspeedratio"),
)
