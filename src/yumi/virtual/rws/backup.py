"""``/ctrl/backup`` and ``/progress``: the controller's backups of itself (reference/rws.md §4.2, §4.4)."""

from __future__ import annotations

from yumi.rws.documents import Page, State
from yumi.rws.replies import DONE
from yumi.virtual.controller.controller import Irc5
from yumi.virtual.controller.events import Refusal, Refused
from yumi.virtual.rws.files import path_of_file
from yumi.virtual.rws.http import HttpReply
from yumi.virtual.rws.operations import Call, Operation, invalid, resource

_ACCEPTED = 202
_DOMAINS = ("EIO", "MOC", "SIO", "SYS")


def back_up(controller: Irc5, call: Call) -> HttpReply:
    """HOME, the loaded modules of each task, and the system parameters; it is done at once."""
    path = path_of_file(call.required("backup"))
    if not path.startswith("BACKUP:/"):
        raise invalid("a backup is a directory in /fileservice/$BACKUP")
    files = controller.files
    if any(file.path.lower() == path.lower() for file in files.entries("BACKUP:")):
        raise Refused(Refusal.NAME_TAKEN, f"{path} exists.")
    identity = controller.identity
    options = "".join(f"  {option}\n" for option in identity.options)
    files[f"{path}/BACKINFO/backinfo.txt"] = f"{identity.system_name}\n{identity.robotware}\n{options}"
    for file in tuple(files):
        if file.startswith("HOME:/"):
            files.write(f"{path}/HOME/{file.removeprefix('HOME:/')}", files.get_file(file).content or b"")
    for number, task in enumerate(controller.tasks.values(), 1):
        for module in task.modules:
            folder, suffix = ("SYSMOD", "sys") if module.is_system else ("PROGMOD", "mod")
            files[f"{path}/RAPID/TASK{number}/{folder}/{module.name}.{suffix}"] = module.text
    for domain in _DOMAINS:
        files[f"{path}/SYSPAR/{domain}.cfg"] = controller.configuration.text(domain)
    return HttpReply(_ACCEPTED, (("Location", "/progress/1"),))


def get_progress(controller: Irc5, call: Call) -> Page:
    fields = {"code": str(DONE), "state": "Ready"}
    return resource("progress", "/progress/", call.names["job"], State("progress", call.names["job"], fields))


OPERATIONS = (
    Operation("POST", "/ctrl/backup", back_up, "backup"),
    Operation("GET", "/progress/{job}", get_progress),
)
