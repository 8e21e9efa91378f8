"""``/fileservice``: the controller's disk (reference/rws.md §11).

``/rw/cfg``: the system parameters, to read (reference/rws.md §9).

``/rw/elog``: the event log (reference/rws.md §12).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from datetime import datetime, timezone

from yumi.rws import documents as forms
from yumi.rws.documents import Argument, Link, Page, State
from yumi.rws.http import HttpReply
from yumi.rws.types import Code
from yumi.virtual.controller.configuration import Instance
from yumi.virtual.controller.errors import Refusal, Refused
from yumi.virtual.controller.events import Event
from yumi.virtual.controller.files import DEVICES, File
from yumi.virtual.rws.routes import Answer, Call, Controller, Failure, Route, entry, invalid, resource

_BASE = "/fileservice/"
_TEXT = (("Content-Type", "application/octet-stream"),)
_CREATED = 201
_OK = 200


def _devices(controller: Controller, call: Call) -> Page:
    return resource("File Service", _BASE, "", *(entry("fs-device", f"${device.lower()}") for device in DEVICES))


def _get(controller: Controller, call: Call) -> Answer:
    """The content of a file, or the list of a directory."""
    file = _find(controller, call)
    if file.content is not None:
        return HttpReply(_OK, _TEXT, file.content)
    states = map(_entry, controller.files.entries(file.path))
    return resource("File Service", f"{_BASE}{call.names['path']}/", "", *states)


def _head(controller: Controller, call: Call) -> None:
    _find(controller, call)


def _put(controller: Controller, call: Call) -> HttpReply:
    is_new = controller.files.write(_path(call), call.content)
    return HttpReply(_CREATED if is_new else _OK, _TEXT)


def _delete(controller: Controller, call: Call) -> None:
    controller.files.remove(_find(controller, call).path)


def _post(controller: Controller, call: Call) -> HttpReply | None:
    """Create a directory in one, copy or rename; what is asked for stands in the body."""
    if call.option("fs-action") is not None:
        raise invalid("Invalid/No Query Parameter: fs-action belongs into the body")
    action, name = call.required("fs-action"), call.required("fs-newname")
    if "/" in name or not name:
        raise invalid(f"fs-newname is a name without a path, not {name!r}")
    file = _find(controller, call)
    if action == "create":
        controller.files.make_directory(f"{file.path}/{name}")
        return HttpReply(_CREATED, _TEXT)
    if action not in ("copy", "rename"):
        raise invalid(f"fs-action is create, copy or rename, not {action!r}")
    _copy(controller, call, file, f"{file.path.rpartition('/')[0]}/{name}", is_move=action == "rename")
    return None


def _copy(controller: Controller, call: Call, file: File, target: str, *, is_move: bool) -> None:
    may_replace = forms.first(call.form, "fs-overwrite") == "true"
    if not may_replace and target.lower() in (entry.path.lower() for entry in _siblings(controller, file)):
        raise Failure(409, Code.INVALIDARG, f"{target} exists")
    controller.files.copy(file.path, target)
    if is_move:
        controller.files.remove(file.path)


def _siblings(controller: Controller, file: File) -> tuple[File, ...]:
    return controller.files.entries(file.path.rpartition("/")[0])


def _find(controller: Controller, call: Call) -> File:
    """The file of a call; that there is none is told with another status here than where RAPID looks for it."""
    try:
        return controller.files.get_file(_path(call))
    except Refused as refused:
        status = 404 if refused.reason is Refusal.NO_FILE else 400
        raise Failure(status, Code.FAIL, str(refused)) from refused


def _path(call: Call) -> str:
    """``$home/a.mod`` or ``HOME:/a.mod`` as RAPID writes it, ``HOME:/a.mod``."""
    device, _, rest = call.names["path"].partition("/")
    name = device.removeprefix("$").removesuffix(":").upper()
    if name not in DEVICES:
        raise Failure(404, Code.FAIL, f"there is no device {device}")
    if ".." in rest.split("/"):
        raise invalid("a path does not lead upwards")
    return f"{name}:/{rest}".rstrip("/")


def _entry(file: File) -> State:
    time = datetime.fromtimestamp(file.changed, timezone.utc).strftime("%Y-%m-%d T %H:%M:%S")
    fields = {"fs-cdate": time, "fs-mdate": time}
    if file.content is not None:
        fields |= {"fs-size": str(len(file.content)), "fs-readonly": "false"}
    return State("fs-dir" if file.content is None else "fs-file", file.name, fields, (Link("self", file.name),))


_PATH = "/fileservice/{path*}"
ROUTES = (
    Route("GET", "/fileservice", _devices),
    Route("GET", _PATH, _get),
    Route("HEAD", _PATH, _head),
    Route("PUT", _PATH, _put),
    Route("POST", _PATH, _post),
    Route("DELETE", _PATH, _delete),
)


_RWS_CFG_BASE = "/rw/cfg/"
_DOMAINS = ("EIO", "MMC", "MOC", "PROC", "SIO", "SYS")
_NUMBERED_OPTION = re.compile(r"(\d[\d/-]*-\d+) (.+)")


def _domains(controller: Controller, call: Call) -> Page:
    return resource("cfg", _RWS_CFG_BASE, "", *(entry("cfg-domain-li", domain) for domain in _DOMAINS))


def _instances(controller: Controller, call: Call) -> Page:
    place = _place(call)
    states = (_state("cfg-dt-instance-li", place, index, each) for index, each in enumerate(_found(controller, call)))
    return resource("cfg", _RWS_CFG_BASE, f"{place}/instances", *states)


def _instance(controller: Controller, call: Call) -> Page:
    place, name = _place(call), call.names["instance"]
    for index, each in enumerate(_found(controller, call)):
        if each.name == name:
            state = _state("cfg-dt-instance", place, index, each)
            return resource("cfg", _RWS_CFG_BASE, f"{place}/instances/{name}", state)
    raise Failure(400, Code.CFG_INSTANCE_INVALID, f"{place} has no instance {name}")


def _place(call: Call) -> str:
    return f"{call.names['domain'].upper()}/{call.names['type'].upper()}"


def _found(controller: Controller, call: Call) -> tuple[Instance, ...]:
    domain, type_name = call.names["domain"].upper(), call.names["type"].upper()
    if domain not in _DOMAINS:
        raise Failure(400, Code.CFG_DOMAIN_INVALID, f"there is no configuration domain {domain}")
    if (domain, type_name) == ("SYS", "PRESENT_OPTIONS"):
        return tuple(_present_options(controller.identity.options))
    found = tuple(controller.cfg(domain, type_name))
    if not found:
        raise Failure(400, Code.CFG_TYPE_INVALID, f"domain {domain} has no type {type_name} with instances")
    return found


def _present_options(options: Iterable[str]) -> Iterable[Instance]:
    """The options once more as system parameters: number and description apart, in this order."""
    for option in options:
        numbered = _NUMBERED_OPTION.fullmatch(option)
        name, description = numbered.groups() if numbered else (option, option)
        yield Instance(name, {"name": name, "desc": description})


def _state(type: str, place: str, index: int, instance: Instance) -> State:
    attributes = tuple(State("cfg-ia-t-li", name, {"value": text}) for name, text in instance.attributes.items())
    fields = {"rdonly": "false", "instanceid": str(index)}
    links = (Link("self", f"{place}/instances/{instance.name}"),)
    return State(type, instance.name, fields, links, attributes)


RWS_CFG_ROUTES = (
    Route("GET", "/rw/cfg", _domains),
    Route("GET", "/rw/cfg/{domain}/{type}/instances", _instances),
    Route("GET", "/rw/cfg/{domain}/{type}/instances/{instance}", _instance),
)


_RWS_ELOG_BASE = "/rw/elog/"
_PAGE = 50
_RWS_ELOG_DOMAINS: Mapping[int, str] = {
    0: "Common",
    1: "Operational",
    2: "System",
    3: "Hardware",
    4: "Program",
    5: "Motion",
    7: "I/O & Communication",
    8: "User",
    9: "Safety",
    10: "Internal",
    11: "Process",
    12: "Configuration",
    15: "RAPID",
    17: "Connected Services",
}


def _rws_elog_domains(controller: Controller, call: Call) -> Page:
    return resource("Elog", _RWS_ELOG_BASE, "", *(_domain(controller, call, number) for number in _RWS_ELOG_DOMAINS))


def _domain(controller: Controller, call: Call, number: int) -> State:
    fields = {} if call.option("lang") is None else {"domain-name": _RWS_ELOG_DOMAINS[number]}
    if call.option("resource") == "count":
        fields["numevts"] = str(len(controller.events.entries(number)))
    fields["buffsize"] = "20" if number else "1000"
    return State("elog-domain-li", str(number), fields, (Link("self", str(number)),))


def _messages(controller: Controller, call: Call) -> Page:
    """Newest first, in pages counted from 1."""
    domain = _number(call)
    entries = controller.events.entries(domain)
    ordered = tuple(reversed(entries)) if call.option("order") == "fifo" else entries
    size = min(call.number_option("limit", _PAGE), _PAGE)
    number = max(call.number_option("start", 1), 1)
    shown = ordered[(number - 1) * size : number * size]
    more = f"{domain}?start={number + 1}&limit={size}" if number * size < len(ordered) else None
    states = (_message("elog-message-li", domain, event, call) for event in shown)
    return resource("Elog", _RWS_ELOG_BASE, str(domain), *states, next_href=more)


def _one_message(controller: Controller, call: Call) -> Page:
    domain, wanted = _number(call), call.names["number"]
    for event in controller.events.entries(domain):
        if str(event.number) == wanted:
            state = _message("elog-message", domain, event, call)
            return resource("Elog", _RWS_ELOG_BASE, f"{domain}/{wanted}", state)
    raise Failure(404, Code.FAIL, f"domain {domain} has no message {wanted}")


def _clear(controller: Controller, call: Call) -> None:
    controller.events.clear(_number(call))


def _clear_all(controller: Controller, call: Call) -> None:
    controller.events.clear()


def _number(call: Call) -> int:
    text = call.names["domain"]
    if text not in map(str, _RWS_ELOG_DOMAINS):
        raise Failure(404, Code.FAIL, f"there is no event log {text!r}")
    return int(text)


def _message(type: str, domain: int, event: Event, call: Call) -> State:
    fields = {
        "msgtype": str(int(event.type)),
        "code": str(event.code),
        "src-name": "MC0",
        "tstamp": _time(event.time),
        "argc": str(len(event.arguments)),
    }
    if call.option("lang") is not None:
        texts = {"title": event.title, "desc": event.description}
        fields |= {**texts, "conseqs": "", "causes": "", "actions": ""}
    title = f"/rw/elog/{domain}/{event.number}"
    arguments = tuple(Argument("string", text) for text in event.arguments)
    return State(type, title, fields, (Link("self", f"{domain}/{event.number}"),), arguments=arguments)


def _time(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, timezone.utc).strftime("%Y-%m-%d T %H:%M:%S")


RWS_ELOG_ROUTES = (
    Route("GET", "/rw/elog", _rws_elog_domains),
    Route("POST", "/rw/elog", _clear_all, "clearall"),
    Route("GET", "/rw/elog/{domain}", _messages),
    Route("POST", "/rw/elog/{domain}", _clear, "clear"),
    Route("GET", "/rw/elog/{domain}/{number}", _one_message),
)
