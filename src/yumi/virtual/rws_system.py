"""``/``, ``/rw``, ``/ctrl`` and ``/rw/system``: what there is and who the controller is (reference/rws.md §4)."""

from __future__ import annotations

from datetime import datetime

from yumi.rws.pages import Link, Page, State
from yumi.virtual.rws_port import Controller
from yumi.virtual.rws_routes import Call, Route, entry, resource

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


ROUTES = (
    Route("GET", "/", _root),
    Route("GET", "/rw", _services),
    Route("GET", "/ctrl", _controller),
    Route("GET", "/ctrl/identity", _identity),
    Route("GET", "/ctrl/clock", _clock),
    Route("GET", "/rw/system", _system),
    Route("GET", "/rw/system/options", _options),
)
