"""``/fileservice``: the controller's disk (reference/rws.md §11)."""

from __future__ import annotations

from datetime import datetime, timezone

from yumi.links.http import HttpReply
from yumi.rws import forms
from yumi.rws.codes import Code
from yumi.rws.pages import Link, Page, State
from yumi.virtual.files import DEVICES, File
from yumi.virtual.refusal import Refusal, Refused
from yumi.virtual.rws_port import Controller
from yumi.virtual.rws_routes import Answer, Call, Failure, Route, entry, invalid, resource

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
