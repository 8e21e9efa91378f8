"""``/rw/cfg``: the system parameters (reference/rws.md §9); what is changed acts after a restart."""

from __future__ import annotations

import re

from yumi.errors import SettingsError
from yumi.rws.documents import Link, Page, State
from yumi.rws.types import Code
from yumi.virtual.controller.controller import Irc5
from yumi.virtual.controller.signals import Instance
from yumi.virtual.rws.files import path_of_file
from yumi.virtual.rws.operations import Call, Failure, Operation, entry, invalid, resource

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


def set_instance(controller: Irc5, call: Call) -> None:
    domain, type_name, name = _existing(controller, call)
    known = controller.configuration.instances(domain, type_name)[0].attributes
    for attribute, _ in call.form:
        if attribute not in known:
            raise invalid(f"{domain}/{type_name} has no attribute {attribute}")
    controller.configuration.change(domain, type_name, name, dict(call.form))


def remove_instance(controller: Irc5, call: Call) -> None:
    controller.configuration.remove(*_existing(controller, call))


def load(controller: Irc5, call: Call) -> None:
    """Load a file: all of it, or nothing."""
    mode = call.parameter("action-type", "add")
    path = path_of_file(call.required("filepath"))
    try:
        controller.configuration.load(controller.files[path], replace=mode == "replace")
    except KeyError as error:
        raise Failure(400, Code.FILE_NOT_FOUND, f"there is no file {path}") from error
    except SettingsError as error:
        raise invalid(str(error)) from error


def save(controller: Irc5, call: Call) -> None:
    domain = call.names["domain"].upper()
    if domain not in _DOMAINS:
        raise Failure(400, Code.CFG_DOMAIN_INVALID, f"there is no configuration domain {domain}")
    controller.files[path_of_file(call.required("filepath"))] = controller.configuration.text(domain)


def _existing(controller: Irc5, call: Call) -> tuple[str, str, str]:
    domain, type_name, name = call.names["domain"].upper(), call.names["type"].upper(), call.names["instance"]
    if controller.configuration.find(domain, type_name, name) is None:
        raise Failure(400, Code.CFG_INSTANCE_INVALID, f"{domain}/{type_name} has no instance {name}")
    return domain, type_name, name


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


_INSTANCE = "/rw/cfg/{domain}/{type}/instances/{instance}"
OPERATIONS = (
    Operation("GET", "/rw/cfg", get_domains),
    Operation("GET", "/rw/cfg/{domain}/{type}/instances", get_instances),
    Operation("GET", _INSTANCE, get_instance),
    Operation("POST", _INSTANCE, set_instance, "set", needs_mastership="cfg"),
    Operation("DELETE", _INSTANCE, remove_instance, needs_mastership="cfg"),
    Operation("POST", "/rw/cfg", load, "load", {"action-type": ("add", "replace")}, needs_mastership="cfg"),
    Operation("POST", "/rw/cfg/{domain}", save, "saveas"),
)
