"""``/``, ``/rw``, ``/ctrl`` and ``/rw/system``: the services, and the controller's identity (reference/rws.md §4)."""

from __future__ import annotations

from datetime import datetime

from yumi.rws.documents import Link, Page, State
from yumi.virtual.controller.controller import Irc5
from yumi.virtual.rws.operations import Call, Operation, entry, resource

_ROOT = ("ctrl", "rw", "fileservice", "subscription")
_SERVICES = ("cfg", "elog", "iosystem", "mastership", "motionsystem", "panel", "rapid", "system")


def get_root(controller: Irc5, call: Call) -> Page:
    return resource("", "/", "", *(entry("srvlst-service-li", name) for name in _ROOT))


def get_services(controller: Irc5, call: Call) -> Page:
    return resource("rw", "/rw/", "", *(entry("rwservice-li", name) for name in _SERVICES))


def _identity_fields(controller: Irc5) -> dict[str, str]:
    identity = controller.identity
    kind = "Virtual Controller" if identity.is_virtual else "Real Controller"
    number = {} if identity.is_virtual else {"ctrl-id": identity.controller_name}
    return {"ctrl-name": identity.controller_name, **number, "ctrl-type": kind}


def get_controller(controller: Irc5, call: Call) -> Page:
    identity = State("ctrl-identity-info-li", "identity", _identity_fields(controller), (Link("self", "identity"),))
    return resource("ctrl", "/ctrl/", "", identity)


def get_identity(controller: Irc5, call: Call) -> Page:
    fields = {**_identity_fields(controller), "ctrl-level": "System Level"}
    return resource("ctrl", "/ctrl/", "identity", State("ctrl-identity-info", "identity", fields))


def get_clock(controller: Irc5, call: Call) -> Page:
    """Local time without its zone, as on the FlexPendant."""
    shown = datetime.fromtimestamp(controller.time).strftime("%Y-%m-%d T %H:%M:%S")
    return resource("ctrl", "/ctrl/", "clock", State("ctrl-clock-info", "clock", {"datetime": shown}))


def get_system(controller: Irc5, call: Call) -> Page:
    identity = controller.identity
    fields = {
        "name": identity.system_name,
        "rwversion": ".".join(identity.robotware.split(".")[:3]),
        "sysid": identity.system_id,
        "rwversionname": identity.robotware,
    }
    states = (State("sys-system-li", "system", fields), _option_list(controller, "system/options"))
    return resource("system", "/rw/", "system", *states)


def get_options(controller: Irc5, call: Call) -> Page:
    return resource("system", "/rw/system/", "options", _option_list(controller, "options"))


def _option_list(controller: Irc5, href: str) -> State:
    names = controller.identity.options
    options = tuple(State("sys-option-li", str(index), {"option": name}) for index, name in enumerate(names))
    return State("sys-options-li", "options", {}, (Link("self", href),), options)


OPERATIONS = (
    Operation("GET", "/", get_root),
    Operation("GET", "/rw", get_services),
    Operation("GET", "/ctrl", get_controller),
    Operation("GET", "/ctrl/identity", get_identity),
    Operation("GET", "/ctrl/clock", get_clock),
    Operation("GET", "/rw/system", get_system),
    Operation("GET", "/rw/system/options", get_options),
)
