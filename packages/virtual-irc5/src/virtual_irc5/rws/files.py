"""The virtual controller's answers on ``/fileservice``: its disk (reference/rws.md §11)."""

from __future__ import annotations

from datetime import datetime, timezone

from abb_protocols.rws.documents import Page, RwsLink, RwsState
from abb_protocols.rws.operations import files as table
from abb_protocols.rws.values import RwsCode
from virtual_irc5.controller.file_store import DISK_CAPACITY, DISK_DEVICES, File
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.controller_log import RefusalReason, Refused
from virtual_irc5.rws.http import HttpReply
from virtual_irc5.rws.render import page_at, page_entry
from virtual_irc5.rws.router import Routes
from virtual_irc5.rws.rws_call import CallFailure, RwsCall, Shown, bad_call

_FILES_BASE = "/fileservice/"
_OCTETS = (("Content-Type", "application/octet-stream"),)
_CREATED = 201
_OK = 200

ROUTES = Routes()


@ROUTES.answer(table.DISKS)
def _get_disks(controller: Irc5, call: RwsCall) -> Page:
    states = (
        page_entry(
            "fs-device",
            f"${device.lower()}",
            fs_device_type="ramdisk" if device == "RAMDISK" else "fixed",
            fs_total_space=str(DISK_CAPACITY),
            fs_free_space=str(DISK_CAPACITY - controller.files.used),
            fs_enabled="TRUE",
            fs_readonly="FALSE",
        )
        for device in DISK_DEVICES
    )
    return page_at("File Service", _FILES_BASE, "", *states)


@ROUTES.answer(table.FILE)
def _get_file(controller: Irc5, call: RwsCall) -> Shown:
    """The content of a file, or the list of a directory."""
    file = _file_of(controller, call)
    if file.content is not None:
        return HttpReply(_OK, _OCTETS, file.content)
    states = []
    for each in controller.files.entries(file.path):
        time = datetime.fromtimestamp(each.changed, timezone.utc).strftime("%Y-%m-%d T %H:%M:%S")
        fields = {"fs-cdate": time, "fs-mdate": time}
        if each.content is not None:
            fields |= {"fs-size": str(each.size), "fs-readonly": "false"}
        kind = "fs-dir" if each.content is None else "fs-file"
        states.append(RwsState(kind, each.name, fields, (RwsLink("self", each.name),)))
    return page_at("File Service", f"{_FILES_BASE}{call.names['path']}/", "", *states)


@ROUTES.answer(table.HEAD_FILE)
def _head_file(controller: Irc5, call: RwsCall) -> None:
    _file_of(controller, call)


@ROUTES.answer(table.PUT_FILE)
def _put_file(controller: Irc5, call: RwsCall) -> HttpReply:
    is_new = controller.files.write(_path_of(call), call.content)
    return HttpReply(_CREATED if is_new else _OK, _OCTETS)


@ROUTES.answer(table.DELETE_FILE)
def _delete_file(controller: Irc5, call: RwsCall) -> None:
    controller.files.remove(_file_of(controller, call).path)


@ROUTES.answer(table.CHANGE_FILE)
def _change_file(controller: Irc5, call: RwsCall) -> HttpReply | None:
    """Create a directory in one, copy or rename; the body names the action."""
    if call.option("fs-action") is not None:
        raise bad_call("Invalid/No Query Parameter: fs-action belongs into the body")
    action, name = call.required("fs-action"), call.required("fs-newname").rstrip("/")
    file = _file_of(controller, call)
    folder = file.path.rpartition("/")[0]
    if not name or ".." in name.split("/"):
        raise bad_call("fs-newname is a name, or a path from /fileservice")
    if action == "create":
        controller.files.make_directory(f"{file.path}/{name}")
        return HttpReply(_CREATED, _OCTETS)
    target = path_of_file(name) if name.startswith("/fileservice/") else f"{folder}/{name}"
    if action == "rename" and "/" in name:
        raise bad_call(f"fs-newname is a name without a path, not {name[:50]!r}")
    is_taken = target.lower() in (entry.path.lower() for entry in controller.files.entries(target.rpartition("/")[0]))
    if is_taken and call.parameter("fs-overwrite", "false") != "true":
        raise CallFailure(409, RwsCode.INVALIDARG, f"{target} exists")
    controller.files.copy(file.path, target)
    if action == "rename":
        controller.files.remove(file.path)
    return HttpReply(_OK, _OCTETS) if action == "rename" and file.content is None else None


def _file_of(controller: Irc5, call: RwsCall) -> File:
    """The file of a call; a missing one has another status here than where RAPID loads it."""
    try:
        return controller.files.get_file(_path_of(call))
    except Refused as refused:
        status = 404 if refused.reason is RefusalReason.NO_FILE else 400
        raise CallFailure(status, RwsCode.FAIL, str(refused)) from refused


def _path_of(call: RwsCall) -> str:
    return path_of_file(call.names["path"])


def path_of_file(text: str) -> str:
    """``$home/a.mod`` or ``HOME:/a.mod``, with or without ``/fileservice/`` before it, as RAPID writes it."""
    device, _, rest = text.removeprefix("/fileservice/").partition("/")
    name = device.removeprefix("$").removesuffix(":").upper()
    if name not in DISK_DEVICES:
        raise CallFailure(404, RwsCode.FAIL, f"there is no device {device}")
    if ".." in rest.split("/"):
        raise bad_call("a path does not lead upwards")
    return f"{name}:/{rest}".rstrip("/")
