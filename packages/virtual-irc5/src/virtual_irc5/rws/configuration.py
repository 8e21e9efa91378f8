"""The virtual controller's answers on ``/rw/cfg``: system parameters; changes act after a restart (rws.md §9)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from abb_protocols.errors import SettingsError
from abb_protocols.rws.cfg_files import read_cfg
from abb_protocols.rws.documents import Page, RwsLink, RwsState
from abb_protocols.rws.operations import configuration as table
from abb_protocols.rws.values import RwsCode
from virtual_irc5.controller.installed_system import PARAMETER_DOMAINS
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.rws.files import path_of_file
from virtual_irc5.rws.http import HttpReply
from virtual_irc5.rws.render import page_at, page_entry
from virtual_irc5.rws.router import Routes
from virtual_irc5.rws.rws_call import CallFailure, RwsCall, bad_call
from virtual_irc5.system_parameters import Instance, SystemConfiguration, defaults_of

_CFG_BASE = "/rw/cfg/"
_MOST_TYPES = 70

_OF_ROBOT = {
    *(("MOC", name) for name in ("MECHANICAL_UNIT", "ROBOT", "SINGLE", "JOINT", "ARM", "TRANSMISSION")),
    ("SYS", "MECHANICAL_UNIT_GROUP"),
    ("SYS", "PRESENT_OPTIONS"),
}
"""What describes the robot itself: it is neither removed nor reset."""

_NUMBER_ATTRIBUTES = {"RemotePortNumber", "Default", "ramp_time", "ext_motion_level", "ext_motion_Kp", "logical_axis"}

_LISTED_DEFAULTS = {
    ("SYS", "CAB_TASK_MODULES"): {
        **dict.fromkeys(("ModName", "Task"), ""),
        **dict.fromkeys(("Install", "Shared", "AllTask", "AllMotionTask", "Hidden"), "false"),
    }
}
"""Values of attributes that a file leaves out: they are listed all the same, but not saved (reference/rws.md §9)."""

_NUMBERED_OPTION = re.compile(r"(\d[\d/-]*-\d+) (.+)")


ROUTES = Routes()


# System parameters


@ROUTES.answer(table.CFG_DOMAINS)
def _get_domains(controller: Irc5, call: RwsCall) -> Page:
    return page_at("cfg", _CFG_BASE, "", *(page_entry("cfg-domain-li", domain) for domain in PARAMETER_DOMAINS))


@ROUTES.answer(table.CFG_TYPES)
def _get_types(controller: Irc5, call: RwsCall) -> Page:
    """The types of a domain, in pages of 70."""
    domain = _domain(call)
    types = controller.configuration.types(domain)
    number = max(call.number_option("start", 1), 1)
    size = min(call.number_option("limit", _MOST_TYPES), _MOST_TYPES)
    shown = types[(number - 1) * size : number * size]
    more = f"{domain}?start={number + 1}&limit={size}" if number * size < len(types) else None
    return page_at(
        "cfg", _CFG_BASE, domain, *(page_entry("cfg-dt-li", name, f"{domain}/{name}") for name in shown), next_href=more
    )


@ROUTES.answer(table.CFG_TYPE)
def _get_type(controller: Irc5, call: RwsCall) -> Page:
    place, found = _place(call), _instances(controller, call)
    attributes = page_entry("cfg-dt-attributes-li", "attributes", f"{place}/attributes")
    instances = page_entry("cfg-dt-instances-li", "instances", f"{place}/instances")
    size = table.CFG_TYPE.answered.state(place.rpartition("/")[2], (len(_attributes(found)), len(found)))
    return page_at("cfg", _CFG_BASE, place, size, attributes, instances)


@ROUTES.answer(table.CFG_ATTRIBUTES)
def _get_attributes(controller: Irc5, call: RwsCall) -> Mapping[str, table.CfgAttribute]:
    """What instances of a type have, as far as those that exist show it."""
    place, found = _place(call), _instances(controller, call)
    domain, type_name = place.split("/")
    initial = {**_LISTED_DEFAULTS.get((domain, type_name), {}), **defaults_of(domain, type_name)}
    shown = {}
    for name in _attributes(found):
        kind, lowest, highest = ("float", "", "") if name in _NUMBER_ATTRIBUTES else ("string", "0", "80")
        is_mandatory = name.lower() == "name"
        shown[name] = table.CfgAttribute(name, kind, "1", lowest, highest, initial.get(name, ""), is_mandatory)
    return shown


def _attributes(instances: Iterable[Instance]) -> list[str]:
    return list(dict.fromkeys(name for instance in instances for name in instance.attributes))


@ROUTES.answer(table.CFG_INSTANCES)
def _get_instances(controller: Irc5, call: RwsCall) -> Page:
    place = _place(call)
    found = list(enumerate(_instances(controller, call)))
    start, limit = call.number_option("start", 0), call.number_option("limit", len(found))
    is_paged = call.option("start") is not None or call.option("limit") is not None
    shown = found[start : start + limit] if is_paged else found
    more = f"{place}/instances?start={start + limit}&limit={limit}" if is_paged and start + limit < len(found) else None
    states = (_instance_state("cfg-dt-instance-li", place, index, each) for index, each in shown)
    return page_at("cfg", _CFG_BASE, f"{place}/instances", *states, next_href=more)


@ROUTES.answer(table.CREATE_CFG_INSTANCE)
def _create_instance(controller: Irc5, call: RwsCall) -> HttpReply:
    """An instance with the default values of its type."""
    place, name, found = _place(call), call.required("name"), _instances(controller, call)
    domain, type_name = place.split("/")
    if (domain, type_name) in _OF_ROBOT:
        raise CallFailure(403, RwsCode.REJECT, f"{place} describes the robot; nothing is added to it")
    if any(each.name == name for each in found):
        raise CallFailure(400, RwsCode.CFG_NAME_EXIST, f"{place} has {name} already")
    known = _attributes(found)
    key = "name" if "name" in known else "Name"
    values = {key: name, **{each: "" for each in known if each != key}, **defaults_of(domain, type_name)}
    if type_name == "EIO_SIGNAL":
        values["SignalType"] = "DI"
    controller.configuration.put(domain, type_name, values)
    return HttpReply.at(f"/rw/cfg/{place}/instances/{name}", 201)


@ROUTES.answer(table.RESET_CFG_INSTANCES)
def _reset_instances(controller: Irc5, call: RwsCall) -> None:
    _instances(controller, call)
    _reset(controller.configuration, *_place(call).split("/"))


@ROUTES.answer(table.RESET_CFG_DOMAIN)
def _reset_domain(controller: Irc5, call: RwsCall) -> None:
    _reset(controller.configuration, _domain(call))


@ROUTES.answer(table.VALIDATE_CFG_REMOVAL)
def _validate_removal(controller: Irc5, call: RwsCall) -> None:
    """Refuse to remove an instance that another one names."""
    _check_unused(controller, call.required("name"))


@ROUTES.answer(table.VALIDATE_CFG_INSTANCES)
def _validate_instances(controller: Irc5, call: RwsCall) -> None:
    domain, type_name = call.required("cfgdomain").upper(), call.required("cfgtype").upper()
    names = [name for name in call.required("instances").split(",") if name]
    if len(names) != call.number("instancescount"):
        raise bad_call("instancescount is not the number of instances")
    for name in names:
        is_there = controller.configuration.find(domain, type_name, name) is not None
        if call.parameter("operation", "0") == "1":
            if not is_there:
                raise CallFailure(
                    400, RwsCode.CFG_INSTANCE_INVALID, f"{domain}/{type_name} has no instance {name[:50]}"
                )
            _check_unused(controller, name)
        elif is_there:
            raise CallFailure(400, RwsCode.CFG_NAME_EXIST, f"{domain}/{type_name} has {name} already")


def _check_unused(controller: Irc5, name: str) -> None:
    cfg = controller.configuration
    for domain in cfg.domains:
        for type_name in cfg.types(domain):
            for each in cfg.instances(domain, type_name):
                if each.name != name and name in each.attributes.values():
                    raise CallFailure(
                        400, RwsCode.CFG_DATA_INCORRECT, f"{domain}/{type_name}/{each.name} names {name[:50]}"
                    )


@ROUTES.answer(table.KEYLESS)
def _refuse_keyless(controller: Irc5, call: RwsCall) -> None:
    raise CallFailure(403, RwsCode.MODE_REJECT, "the motors are switched on with the button on the controller")


@ROUTES.answer(table.CFG_INSTANCE)
def _get_instance(controller: Irc5, call: RwsCall) -> Page:
    place, name = _place(call), call.names["instance"]
    for index, each in enumerate(_instances(controller, call)):
        if each.name == name:
            state = _instance_state("cfg-dt-instance", place, index, each)
            return page_at("cfg", _CFG_BASE, f"{place}/instances/{name}", state)
    raise CallFailure(400, RwsCode.CFG_INSTANCE_INVALID, f"{place} has no instance {name}")


@ROUTES.answer(table.SET_CFG_INSTANCE)
def _set_instance(controller: Irc5, call: RwsCall) -> None:
    domain, type_name, name = _existing_place(controller, call)
    known = _instances(controller, call)[0].attributes
    for attribute, _ in call.form:
        if attribute not in known:
            raise bad_call(f"{domain}/{type_name} has no attribute {attribute}")
    controller.configuration.change(domain, type_name, name, dict(call.form))


@ROUTES.answer(table.REMOVE_CFG_INSTANCE)
def _remove_instance(controller: Irc5, call: RwsCall) -> None:
    domain, type_name, name = _existing_place(controller, call)
    if (domain, type_name) in _OF_ROBOT:
        raise CallFailure(403, RwsCode.REJECT, f"{domain}/{type_name} describes the robot; nothing is removed from it")
    controller.configuration.remove(domain, type_name, name)


@ROUTES.answer(table.LOAD_CFG_FILE)
def _load_file(controller: Irc5, call: RwsCall) -> None:
    """Load a file: all of it, or nothing."""
    controller.configuration.become(_with_file(controller, call))


@ROUTES.answer(table.VALIDATE_CFG_FILE)
def _validate_file(controller: Irc5, call: RwsCall) -> Page:
    _with_file(controller, call)
    return page_at("cfg", "/rw/", "cfg", RwsState("cfg-validate", "validate", {"status": "OK"}))


def _with_file(controller: Irc5, call: RwsCall) -> SystemConfiguration:
    """The configuration with a file loaded as the call says: added, replacing, or in the place of what was added."""
    mode = call.parameter("action-type", "add")
    path, loaded = path_of_file(call.required("filepath")), controller.configuration.copy()
    try:
        text = controller.files[path]
        if mode == "add-with-reset":
            _reset(loaded, read_cfg(text).domain)
        loaded.load(text, replace=mode != "add")
    except KeyError as error:
        raise CallFailure(400, RwsCode.FILE_NOT_FOUND, f"there is no file {path}") from error
    except SettingsError as error:
        raise bad_call(str(error)) from error
    return loaded


def _reset(configuration: SystemConfiguration, domain: str, type_name: str = "") -> None:
    """Remove all instances that are not the robot's own."""
    for kind in configuration.types(domain):
        if (domain, kind) in _OF_ROBOT or (type_name and kind != type_name):
            continue
        for instance in configuration.instances(domain, kind):
            configuration.remove(domain, kind, instance.name)


@ROUTES.answer(table.SAVE_CFG_DOMAIN)
def _save_domain(controller: Irc5, call: RwsCall) -> None:
    domain = _domain(call)
    controller.files[path_of_file(call.required("filepath"))] = controller.configuration.text(domain)


def _domain(call: RwsCall) -> str:
    domain = call.names["domain"].upper()
    if domain not in PARAMETER_DOMAINS:
        raise CallFailure(400, RwsCode.CFG_DOMAIN_INVALID, f"there is no configuration domain {domain[:50]}")
    return domain


def _existing_place(controller: Irc5, call: RwsCall) -> tuple[str, str, str]:
    domain, type_name, name = call.names["domain"].upper(), call.names["type"].upper(), call.names["instance"]
    if controller.configuration.find(domain, type_name, name) is None:
        raise CallFailure(400, RwsCode.CFG_INSTANCE_INVALID, f"{domain}/{type_name} has no instance {name}")
    return domain, type_name, name


def _place(call: RwsCall) -> str:
    return f"{call.names['domain'].upper()}/{call.names['type'].upper()}"


def _instances(controller: Irc5, call: RwsCall) -> tuple[Instance, ...]:
    domain, type_name = _domain(call), call.names["type"].upper()
    if (domain, type_name) == ("SYS", "PRESENT_OPTIONS"):
        # The options once more as system parameters: number and description apart, in this order.
        split = ((_NUMBERED_OPTION.fullmatch(option), option) for option in controller.identity.options)
        pairs = (numbered.groups() if numbered else (option, option) for numbered, option in split)
        return tuple(Instance(name, {"name": name, "desc": description}) for name, description in pairs)
    found = controller.configuration.instances(domain, type_name)
    if not found:
        raise CallFailure(400, RwsCode.CFG_TYPE_INVALID, f"domain {domain} has no type {type_name} with instances")
    listed = _LISTED_DEFAULTS.get((domain, type_name), {})
    return tuple(
        Instance(each.name, {**each.attributes, **{k: v for k, v in listed.items() if k not in each.attributes}})
        for each in found
    )


def _instance_state(type: str, place: str, index: int, instance: Instance) -> RwsState:
    attributes = tuple(RwsState("cfg-ia-t-li", name, {"value": text}) for name, text in instance.attributes.items())
    is_own = tuple(place.split("/")) == ("SYS", "PRESENT_OPTIONS")
    fields = {"rdonly": "true" if is_own else "false", "instanceid": str(index)}
    links = (RwsLink("self", f"{place}/instances/{instance.name}"),)
    return RwsState(type, instance.name, fields, links, attributes)
