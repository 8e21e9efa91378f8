"""``/rw/cfg``: the system parameters, to read (reference/rws.md §9)."""

from __future__ import annotations

import re

from yumi.rws.documents import Link, Page, State
from yumi.rws.types import Code
from yumi.virtual.controller.controller import Irc5
from yumi.virtual.controller.signals import Instance
from yumi.virtual.rws.operations import Call, Failure, Operation, entry, resource

_BASE = "/rw/cfg/"
_DOMAINS = ("EIO", "MMC", "MOC", "PROC", "SIO", "SYS")
_NUMBERED_OPTION = re.compile(r"(\d[\d/-]*-\d+) (.+)")


def get_domains(controller: Irc5, call: Call) -> Page:
    return resource("cfg", _BASE, "", *(entry("cfg-domain-li", domain) for domain in _DOMAINS))


def get_instances(controller: Irc5, call: Call) -> Page:
    place = _place(call)
    states = (_state("cfg-dt-instance-li", place, index, each) for index, each in enumerate(_found(controller, call)))
    return resource("cfg", _BASE, f"{place}/instances", *states)


def get_instance(controller: Irc5, call: Call) -> Page:
    place, name = _place(call), call.names["instance"]
    for index, each in enumerate(_found(controller, call)):
        if each.name == name:
            state = _state("cfg-dt-instance", place, index, each)
            return resource("cfg", _BASE, f"{place}/instances/{name}", state)
    raise Failure(400, Code.CFG_INSTANCE_INVALID, f"{place} has no instance {name}")


def _place(call: Call) -> str:
    return f"{call.names['domain'].upper()}/{call.names['type'].upper()}"


def _found(controller: Irc5, call: Call) -> tuple[Instance, ...]:
    domain, type_name = call.names["domain"].upper(), call.names["type"].upper()
    if domain not in _DOMAINS:
        raise Failure(400, Code.CFG_DOMAIN_INVALID, f"there is no configuration domain {domain}")
    if (domain, type_name) == ("SYS", "PRESENT_OPTIONS"):
        # The options once more as system parameters: number and description apart, in this order.
        split = ((_NUMBERED_OPTION.fullmatch(option), option) for option in controller.identity.options)
        pairs = (numbered.groups() if numbered else (option, option) for numbered, option in split)
        return tuple(Instance(name, {"name": name, "desc": description}) for name, description in pairs)
    found = tuple(controller.cfg(domain, type_name))
    if not found:
        raise Failure(400, Code.CFG_TYPE_INVALID, f"domain {domain} has no type {type_name} with instances")
    return found


def _state(type: str, place: str, index: int, instance: Instance) -> State:
    attributes = tuple(State("cfg-ia-t-li", name, {"value": text}) for name, text in instance.attributes.items())
    fields = {"rdonly": "false", "instanceid": str(index)}
    links = (Link("self", f"{place}/instances/{instance.name}"),)
    return State(type, instance.name, fields, links, attributes)


OPERATIONS = (
    Operation("GET", "/rw/cfg", get_domains),
    Operation("GET", "/rw/cfg/{domain}/{type}/instances", get_instances),
    Operation("GET", "/rw/cfg/{domain}/{type}/instances/{instance}", get_instance),
)
