"""``/rw/cfg`` and ``/fileservice``: the system parameters and the controller's disk (reference/rws.md §9, §11).

What is changed of the parameters acts after a restart.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from datetime import datetime, timezone

from yumi.errors import SettingsError
from yumi.rws.documents import Link, Page, State
from yumi.rws.types import Code, Grant, read_cfg
from yumi.virtual.controller.file_store import CAPACITY, DEVICES, File
from yumi.virtual.controller.installed_system import DOMAINS
from yumi.virtual.controller.irc5 import Irc5
from yumi.virtual.controller_log import Refusal, Refused
from yumi.virtual.rws.http import HttpReply, entry, resource
from yumi.virtual.rws.operations import Answer, Call, Failure, Operation, Values, invalid
from yumi.virtual.system_parameters import Configuration, Instance, defaults_of

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
_FILES_BASE = "/fileservice/"
_OCTETS = (("Content-Type", "application/octet-stream"),)
_CREATED = 201
_OK = 200


# System parameters


def get_domains(controller: Irc5, call: Call) -> Page:
    return resource("cfg", _CFG_BASE, "", *(entry("cfg-domain-li", domain) for domain in DOMAINS))


def get_types(controller: Irc5, call: Call) -> Page:
    """The types of a domain, in pages of 70."""
    domain = _domain(call)
    types = controller.configuration.types(domain)
    number = max(call.number_option("start", 1), 1)
    size = min(call.number_option("limit", _MOST_TYPES), _MOST_TYPES)
    shown = types[(number - 1) * size : number * size]
    more = f"{domain}?start={number + 1}&limit={size}" if number * size < len(types) else None
    return resource(
        "cfg", _CFG_BASE, domain, *(entry("cfg-dt-li", name, f"{domain}/{name}") for name in shown), next_href=more
    )


def get_type(controller: Irc5, call: Call) -> Page:
    place, found = _place(call), _instances(controller, call)
    attributes = entry("cfg-dt-attributes-li", "attributes", f"{place}/attributes")
    instances = entry("cfg-dt-instances-li", "instances", f"{place}/instances")
    fields = {"cfg-no-of-attributes": str(len(_attributes(found))), "cfg-no-of-instances": str(len(found))}
    return resource("cfg", _CFG_BASE, place, State("cfg-dt", place.rpartition("/")[2], fields), attributes, instances)


def get_attributes(controller: Irc5, call: Call) -> Page:
    """What instances of a type have, as far as those that exist show it."""
    place, found = _place(call), _instances(controller, call)
    domain, type_name = place.split("/")
    initial = {**_LISTED_DEFAULTS.get((domain, type_name), {}), **defaults_of(domain, type_name)}
    states = []
    for name in _attributes(found):
        kind = "float" if name in _NUMBER_ATTRIBUTES else "string"
        fields = {
            "name": name,
            "type": kind,
            "numbers": "1",
            "mini": "" if kind == "float" else "0",
            "max": "" if kind == "float" else "80",
            "init": initial.get(name, ""),
            "mandatory": "true" if name.lower() == "name" else "false",
        }
        states.append(State("cfg-dt-attribute-li", name, fields))
    return resource("cfg", _CFG_BASE, f"{place}/attributes", *states)


def _attributes(instances: Iterable[Instance]) -> list[str]:
    return list(dict.fromkeys(name for instance in instances for name in instance.attributes))


def get_instances(controller: Irc5, call: Call) -> Page:
    place = _place(call)
    found = list(enumerate(_instances(controller, call)))
    start, limit = call.number_option("start", 0), call.number_option("limit", len(found))
    is_paged = call.option("start") is not None or call.option("limit") is not None
    shown = found[start : start + limit] if is_paged else found
    more = f"{place}/instances?start={start + limit}&limit={limit}" if is_paged and start + limit < len(found) else None
    states = (_instance_state("cfg-dt-instance-li", place, index, each) for index, each in shown)
    return resource("cfg", _CFG_BASE, f"{place}/instances", *states, next_href=more)


def create_instance(controller: Irc5, call: Call) -> HttpReply:
    """An instance with the default values of its type."""
    place, name, found = _place(call), call.required("name"), _instances(controller, call)
    domain, type_name = place.split("/")
    if (domain, type_name) in _OF_ROBOT:
        raise Failure(403, Code.REJECT, f"{place} describes the robot; nothing is added to it")
    if any(each.name == name for each in found):
        raise Failure(400, Code.CFG_NAME_EXIST, f"{place} has {name} already")
    known = _attributes(found)
    key = "name" if "name" in known else "Name"
    values = {key: name, **{each: "" for each in known if each != key}, **defaults_of(domain, type_name)}
    if type_name == "EIO_SIGNAL":
        values["SignalType"] = "DI"
    controller.configuration.put(domain, type_name, values)
    instances = f"{place}/instances/{name}"
    return HttpReply(201, (("Location", f"/rw/cfg/{instances}"), ("Content-Type", "application/xhtml+xml")))


def reset_instances(controller: Irc5, call: Call) -> None:
    _instances(controller, call)
    _reset(controller.configuration, *_place(call).split("/"))


def reset_domain(controller: Irc5, call: Call) -> None:
    _reset(controller.configuration, _domain(call))


def validate_removal(controller: Irc5, call: Call) -> None:
    """Refuse to remove an instance that another one names."""
    _check_unused(controller, call.required("name"))


def validate_instances(controller: Irc5, call: Call) -> None:
    domain, type_name = call.required("cfgdomain").upper(), call.required("cfgtype").upper()
    names = [name for name in call.required("instances").split(",") if name]
    if len(names) != call.number("instancescount"):
        raise invalid("instancescount is not the number of instances")
    for name in names:
        is_there = controller.configuration.find(domain, type_name, name) is not None
        if call.parameter("operation", "0") == "1":
            if not is_there:
                raise Failure(400, Code.CFG_INSTANCE_INVALID, f"{domain}/{type_name} has no instance {name[:50]}")
            _check_unused(controller, name)
        elif is_there:
            raise Failure(400, Code.CFG_NAME_EXIST, f"{domain}/{type_name} has {name} already")


def _check_unused(controller: Irc5, name: str) -> None:
    cfg = controller.configuration
    for domain in cfg.domains:
        for type_name in cfg.types(domain):
            for each in cfg.instances(domain, type_name):
                if each.name != name and name in each.attributes.values():
                    raise Failure(400, Code.CFG_DATA_INCORRECT, f"{domain}/{type_name}/{each.name} names {name[:50]}")


def refuse_keyless(controller: Irc5, call: Call) -> None:
    raise Failure(403, Code.MODE_REJECT, "the motors are switched on with the button on the controller")


def get_instance(controller: Irc5, call: Call) -> Page:
    place, name = _place(call), call.names["instance"]
    for index, each in enumerate(_instances(controller, call)):
        if each.name == name:
            state = _instance_state("cfg-dt-instance", place, index, each)
            return resource("cfg", _CFG_BASE, f"{place}/instances/{name}", state)
    raise Failure(400, Code.CFG_INSTANCE_INVALID, f"{place} has no instance {name}")


def set_instance(controller: Irc5, call: Call) -> None:
    domain, type_name, name = _existing_place(controller, call)
    known = _instances(controller, call)[0].attributes
    for attribute, _ in call.form:
        if attribute not in known:
            raise invalid(f"{domain}/{type_name} has no attribute {attribute}")
    controller.configuration.change(domain, type_name, name, dict(call.form))


def remove_instance(controller: Irc5, call: Call) -> None:
    domain, type_name, name = _existing_place(controller, call)
    if (domain, type_name) in _OF_ROBOT:
        raise Failure(403, Code.REJECT, f"{domain}/{type_name} describes the robot; nothing is removed from it")
    controller.configuration.remove(domain, type_name, name)


def load_file(controller: Irc5, call: Call) -> None:
    """Load a file: all of it, or nothing."""
    controller.configuration.become(_with_file(controller, call))


def validate_file(controller: Irc5, call: Call) -> Page:
    _with_file(controller, call)
    return resource("cfg", "/rw/", "cfg", State("cfg-validate", "validate", {"status": "OK"}))


def _with_file(controller: Irc5, call: Call) -> Configuration:
    """The configuration with a file loaded as the call says: added, replacing, or in the place of what was added."""
    mode = call.parameter("action-type", "add")
    path = path_of_file(call.required("filepath"))
    loaded = Configuration()
    loaded.become(controller.configuration)
    try:
        text = controller.files[path]
        if mode == "add-with-reset":
            _reset(loaded, read_cfg(text).domain)
        loaded.load(text, replace=mode != "add")
    except KeyError as error:
        raise Failure(400, Code.FILE_NOT_FOUND, f"there is no file {path}") from error
    except SettingsError as error:
        raise invalid(str(error)) from error
    return loaded


def _reset(configuration: Configuration, domain: str, type_name: str = "") -> None:
    """Remove all instances that are not the robot's own."""
    for kind in configuration.types(domain):
        if (domain, kind) in _OF_ROBOT or (type_name and kind != type_name):
            continue
        for instance in configuration.instances(domain, kind):
            configuration.remove(domain, kind, instance.name)


def save_domain(controller: Irc5, call: Call) -> None:
    domain = _domain(call)
    controller.files[path_of_file(call.required("filepath"))] = controller.configuration.text(domain)


def _domain(call: Call) -> str:
    domain = call.names["domain"].upper()
    if domain not in DOMAINS:
        raise Failure(400, Code.CFG_DOMAIN_INVALID, f"there is no configuration domain {domain[:50]}")
    return domain


def _existing_place(controller: Irc5, call: Call) -> tuple[str, str, str]:
    domain, type_name, name = call.names["domain"].upper(), call.names["type"].upper(), call.names["instance"]
    if controller.configuration.find(domain, type_name, name) is None:
        raise Failure(400, Code.CFG_INSTANCE_INVALID, f"{domain}/{type_name} has no instance {name}")
    return domain, type_name, name


def _place(call: Call) -> str:
    return f"{call.names['domain'].upper()}/{call.names['type'].upper()}"


def _instances(controller: Irc5, call: Call) -> tuple[Instance, ...]:
    domain, type_name = call.names["domain"].upper(), call.names["type"].upper()
    if domain not in DOMAINS:
        raise Failure(400, Code.CFG_DOMAIN_INVALID, f"there is no configuration domain {domain}")
    if (domain, type_name) == ("SYS", "PRESENT_OPTIONS"):
        # The options once more as system parameters: number and description apart, in this order.
        split = ((_NUMBERED_OPTION.fullmatch(option), option) for option in controller.identity.options)
        pairs = (numbered.groups() if numbered else (option, option) for numbered, option in split)
        return tuple(Instance(name, {"name": name, "desc": description}) for name, description in pairs)
    found = tuple(controller.cfg(domain, type_name))
    if not found:
        raise Failure(400, Code.CFG_TYPE_INVALID, f"domain {domain} has no type {type_name} with instances")
    listed = _LISTED_DEFAULTS.get((domain, type_name), {})
    return tuple(
        Instance(each.name, {**each.attributes, **{k: v for k, v in listed.items() if k not in each.attributes}})
        for each in found
    )


def _instance_state(type: str, place: str, index: int, instance: Instance) -> State:
    attributes = tuple(State("cfg-ia-t-li", name, {"value": text}) for name, text in instance.attributes.items())
    is_own = tuple(place.split("/")) == ("SYS", "PRESENT_OPTIONS")
    fields = {"rdonly": "true" if is_own else "false", "instanceid": str(index)}
    links = (Link("self", f"{place}/instances/{instance.name}"),)
    return State(type, instance.name, fields, links, attributes)


# Files


def get_disks(controller: Irc5, call: Call) -> Page:
    free = CAPACITY - sum(len(controller.files.get_file(path).content or b"") for path in controller.files)
    states = (
        entry(
            "fs-device",
            f"${device.lower()}",
            fs_device_type="ramdisk" if device == "RAMDISK" else "fixed",
            fs_total_space=str(CAPACITY),
            fs_free_space=str(free),
            fs_enabled="TRUE",
            fs_readonly="FALSE",
        )
        for device in DEVICES
    )
    return resource("File Service", _FILES_BASE, "", *states)


def get_file(controller: Irc5, call: Call) -> Answer:
    """The content of a file, or the list of a directory."""
    file = _file_of(controller, call)
    if file.content is not None:
        return HttpReply(_OK, _OCTETS, file.content)
    states = []
    for each in controller.files.entries(file.path):
        time = datetime.fromtimestamp(each.changed, timezone.utc).strftime("%Y-%m-%d T %H:%M:%S")
        fields = {"fs-cdate": time, "fs-mdate": time}
        if each.content is not None:
            fields |= {"fs-size": str(len(each.content)), "fs-readonly": "false"}
        kind = "fs-dir" if each.content is None else "fs-file"
        states.append(State(kind, each.name, fields, (Link("self", each.name),)))
    return resource("File Service", f"{_FILES_BASE}{call.names['path']}/", "", *states)


def head_file(controller: Irc5, call: Call) -> None:
    _file_of(controller, call)


def put_file(controller: Irc5, call: Call) -> HttpReply:
    is_new = controller.files.write(_path_of(call), call.content)
    return HttpReply(_CREATED if is_new else _OK, _OCTETS)


def delete_file(controller: Irc5, call: Call) -> None:
    controller.files.remove(_file_of(controller, call).path)


def change_file(controller: Irc5, call: Call) -> HttpReply | None:
    """Create a directory in one, copy or rename; the body names the action."""
    if call.option("fs-action") is not None:
        raise invalid("Invalid/No Query Parameter: fs-action belongs into the body")
    action, name = call.required("fs-action"), call.required("fs-newname").rstrip("/")
    file = _file_of(controller, call)
    folder = file.path.rpartition("/")[0]
    if not name or ".." in name.split("/"):
        raise invalid("fs-newname is a name, or a path from /fileservice")
    if action == "create":
        controller.files.make_directory(f"{file.path}/{name}")
        return HttpReply(_CREATED, _OCTETS)
    target = path_of_file(name) if name.startswith("/fileservice/") else f"{folder}/{name}"
    if action == "rename" and "/" in name:
        raise invalid(f"fs-newname is a name without a path, not {name[:50]!r}")
    is_taken = target.lower() in (entry.path.lower() for entry in controller.files.entries(target.rpartition("/")[0]))
    if is_taken and call.parameter("fs-overwrite", "false") != "true":
        raise Failure(409, Code.INVALIDARG, f"{target} exists")
    controller.files.copy(file.path, target)
    if action == "rename":
        controller.files.remove(file.path)
    return HttpReply(_OK, _OCTETS) if action == "rename" and file.content is None else None


def _file_of(controller: Irc5, call: Call) -> File:
    """The file of a call; a missing one has another status here than where RAPID loads it."""
    try:
        return controller.files.get_file(_path_of(call))
    except Refused as refused:
        status = 404 if refused.reason is Refusal.NO_FILE else 400
        raise Failure(status, Code.FAIL, str(refused)) from refused


def _path_of(call: Call) -> str:
    return path_of_file(call.names["path"])


def path_of_file(text: str) -> str:
    """``$home/a.mod`` or ``HOME:/a.mod``, with or without ``/fileservice/`` before it, as RAPID writes it."""
    device, _, rest = text.removeprefix("/fileservice/").partition("/")
    name = device.removeprefix("$").removesuffix(":").upper()
    if name not in DEVICES:
        raise Failure(404, Code.FAIL, f"there is no device {device}")
    if ".." in rest.split("/"):
        raise invalid("a path does not lead upwards")
    return f"{name}:/{rest}".rstrip("/")


_INSTANCE = "/rw/cfg/{domain}/{type}/instances/{instance}"
_TYPE = "/rw/cfg/{domain}/{type}"
_CFG_FILE: Values = {"filepath": (), "action-type": ("add", "replace", "add-with-reset")}
_PAGES: Values = {"start": (), "limit": ()}
_OF_INSTANCES: Values = {"operation": ("0", "1"), "cfgdomain": (), "cfgtype": (), "instances": (), "instancescount": ()}
_FILE_PATH = "/fileservice/{path:.+}"

_FILE_ACTIONS: Values = {
    "fs-action": ("create", "copy", "rename"),
    "fs-newname": (),
    "fs-overwrite": ("true", "false"),
}

OPERATIONS = (
    Operation("GET", "/rw/cfg", get_domains),
    Operation("POST", "/rw/cfg", load_file, "load", _CFG_FILE, needs_mastership="cfg", needs_grant=Grant.CFG_WRITE),
    Operation("POST", "/rw/cfg", validate_file, "validate", _CFG_FILE, status=200),
    Operation("POST", "/rw/cfg", validate_removal, "validate-inst-at-del", {"name": ()}),
    Operation("POST", "/rw/cfg", validate_instances, "validate-instances", _OF_INSTANCES),
    Operation("POST", "/rw/cfg", refuse_keyless, "keyless", {"state": ("run",)}, status=403),
    Operation("GET", "/rw/cfg/{domain}", get_types, query=_PAGES),
    Operation(
        "POST", "/rw/cfg/{domain}", save_domain, "saveas", {"filepath": (), "save-mode": ()}, needs_grant=Grant.BACKUP
    ),
    Operation(
        "POST",
        "/rw/cfg/{domain}",
        reset_domain,
        "reset",
        needs_mastership="cfg",
        status=200,
        needs_grant=Grant.CFG_WRITE,
    ),
    Operation("GET", _TYPE, get_type),
    Operation("GET", f"{_TYPE}/attributes", get_attributes),
    Operation("GET", f"{_TYPE}/instances", get_instances, query=_PAGES),
    Operation(
        "POST", f"{_TYPE}/instances", reset_instances, "reset", needs_mastership="cfg", needs_grant=Grant.CFG_WRITE
    ),
    Operation(
        "POST",
        f"{_TYPE}/instances",
        create_instance,
        "create-default",
        {"name": ()},
        needs_mastership="cfg",
        status=201,
        needs_grant=Grant.CFG_WRITE,
    ),
    Operation("GET", _INSTANCE, get_instance),
    Operation("POST", _INSTANCE, set_instance, "set", needs_mastership="cfg", needs_grant=Grant.CFG_WRITE),
    Operation("DELETE", _INSTANCE, remove_instance, needs_mastership="cfg", needs_grant=Grant.CFG_WRITE),
    Operation("GET", "/fileservice", get_disks, needs_grant=Grant.FTP_READ),
    Operation("GET", _FILE_PATH, get_file, needs_grant=Grant.FTP_READ),
    Operation("HEAD", _FILE_PATH, head_file, needs_grant=Grant.FTP_READ),
    Operation("PUT", _FILE_PATH, put_file, needs_grant=Grant.FTP_WRITE),
    Operation("POST", _FILE_PATH, change_file, values=_FILE_ACTIONS, needs_grant=Grant.FTP_WRITE),
    Operation("DELETE", _FILE_PATH, delete_file, needs_grant=Grant.FTP_WRITE),
)
