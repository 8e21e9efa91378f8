"""``/rw/panel``: motors, operating mode, speed ratio (reference/rws.md §5).

``/``, ``/rw``, ``/ctrl`` and ``/rw/system``: what there is and who the controller is (reference/rws.md §4).
"""

from __future__ import annotations

from datetime import datetime
from math import isfinite

from yumi.rws.documents import Link, Page, State
from yumi.rws.types import Code
from yumi.virtual.rws.routes import Call, Controller, Failure, Route, entry, invalid, resource

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


_ROOT = ("ctrl", "rw", "fileservice", "subscription")
_SERVICES = ("cfg", "elog", "iosystem", "mastership", "motionsystem", "panel", "rapid", "system")


def _root(controller: Controller, call: Call) -> Page:
    return resource("", "/", "", *(entry("srvlst-service-li", name) for name in _ROOT))


def _services(controller: Controller, call: Call) -> Page:
    return resource("rw", "/rw/", "", *(entry("rwservice-li", name) for name in _SERVICES))


def _controller(controller: Controller, call: Call) -> Page:
    identity = State("ctrl-identity-info-li", "identity", _identity_fields(controller), (Link("self", "identity"),))
    return resource("ctrl", "/ctrl/", "", identity)


def _identity(controller: Controller, call: Call) -> Page:
    fields = {**_identity_fields(controller), "ctrl-level": "System Level"}
    return resource("ctrl", "/ctrl/", "identity", State("ctrl-identity-info", "identity", fields))


def _clock(controller: Controller, call: Call) -> Page:
    """Local time without its zone, as on the pendant."""
    shown = datetime.fromtimestamp(controller.time).strftime("%Y-%m-%d T %H:%M:%S")
    return resource("ctrl", "/ctrl/", "clock", State("ctrl-clock-info", "clock", {"datetime": shown}))


def _identity_fields(controller: Controller) -> dict[str, str]:
    identity = controller.identity
    kind = "Virtual Controller" if identity.is_virtual else "Real Controller"
    number = {} if identity.is_virtual else {"ctrl-id": identity.controller_name}
    return {"ctrl-name": identity.controller_name, **number, "ctrl-type": kind}


def _system(controller: Controller, call: Call) -> Page:
    identity = controller.identity
    fields = {
        "name": identity.system_name,
        "rwversion": ".".join(identity.robotware.split(".")[:3]),
        "sysid": identity.system_id,
        "rwversionname": identity.robotware,
    }
    states = (State("sys-system-li", "system", fields), _option_list(controller, "system/options"))
    return resource("system", "/rw/", "system", *states)


def _options(controller: Controller, call: Call) -> Page:
    return resource("system", "/rw/system/", "options", _option_list(controller, "options"))


def _option_list(controller: Controller, href: str) -> State:
    names = controller.identity.options
    options = tuple(State("sys-option-li", str(index), {"option": name}) for index, name in enumerate(names))
    return State("sys-options-li", "options", {}, (Link("self", href),), options)


RWS_SYSTEM_ROUTES = (
    Route("GET", "/", _root),
    Route("GET", "/rw", _services),
    Route("GET", "/ctrl", _controller),
    Route("GET", "/ctrl/identity", _identity),
    Route("GET", "/ctrl/clock", _clock),
    Route("GET", "/rw/system", _system),
    Route("GET", "/rw/system/options", _options),
)
