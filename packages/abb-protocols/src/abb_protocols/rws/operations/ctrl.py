"""Operations on the controller (``/ctrl``, ``/progress``): clock, identity, network, backup, jobs, systems."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime
from typing import Annotated

from abb_protocols.catalogue import message
from abb_protocols.errors import ProtocolError
from abb_protocols.rws.documents import RwsState
from abb_protocols.rws.operations.operation import TRUTH, absent, delete, get, post, put
from abb_protocols.rws.operations.operation_answer import TEXT, TEXT_OR_NONE, Spelling, choice, flag, record, single
from abb_protocols.rws.values import Grant

_TIME = "%Y-%m-%d T %H:%M:%S"


def _read_time(state: RwsState, name: str) -> datetime:
    text = state.text(name)
    try:
        return datetime.strptime(text, _TIME)
    except ValueError as error:
        raise ProtocolError(message("clock_shows_no_time", text=text)) from error


_IS_VIRTUAL = Spelling(
    lambda state, name: state.text(name).startswith("Virtual"),
    lambda name, is_virtual: {name: "Virtual Controller" if is_virtual else "Real Controller"},
)

JOB_PENDING, JOB_DONE = 294914, 294912
"""Codes of a job's progress (reference/rws.md §4.4)."""


@dataclass(frozen=True, slots=True)
class ControllerIdentity:
    """Which controller it is; the serial number is empty for a virtual one."""

    name: Annotated[str, "ctrl-name"]
    serial: Annotated[str, "ctrl-id", TEXT_OR_NONE] = ""
    is_virtual: Annotated[bool, "ctrl-type", _IS_VIRTUAL] = field(kw_only=True)


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a job of the controller is, in its words, with its code."""

    code: int
    state: str

    @property
    def is_pending(self) -> bool:
        """Whether it goes on."""
        return self.code == JOB_PENDING


@dataclass(frozen=True, slots=True)
class NetworkRoute:
    """A way to another network."""

    destination: str
    gateway: str


@dataclass(frozen=True, slots=True)
class InstalledSystem:
    """A system on the controller's disk."""

    name: Annotated[str, "system-name"]
    id: Annotated[str, "system-id"]
    version: Annotated[str, "rwversion"]


CONTROLLER = get("/ctrl")
RESTART = post(
    "/ctrl", None, "restart-mode=restart|istart|pstart|bstart|shutdown|xstart", grant=Grant.REMOTE_WARMSTART, status=200
)
SET_LANGUAGE = post(
    "/ctrl",
    "set-lang",
    "lang=en|de|sv|fr|it|es|pt|da|fi|nl|cs|ja|ko|zh|ru|hu|pl",
    grant=Grant.CONTROLLER_PROPERTIES_WRITE,
)
ENVIRONMENT = get("/ctrl/${variable}").shows(single("ctrl-env", "value", TEXT))
IDENTITY = get("/ctrl/identity").shows(record("ctrl-identity-info|ctrl-identity-info-li", ControllerIdentity))
SET_IDENTITY = put("/ctrl/identity", "ctrl-name, ctrl-id", grant=Grant.CONTROLLER_PROPERTIES_WRITE, status=204)
CLOCK = get("/ctrl/clock").shows(
    single(
        "ctrl-clock-info|ctrl-clock-info-li",
        "datetime",
        Spelling(_read_time, lambda name, time: {name: time.strftime(_TIME)}),
    )
)
SET_CLOCK = put(
    "/ctrl/clock",
    "sys-clock-year, sys-clock-month, sys-clock-day, sys-clock-hour, sys-clock-min, sys-clock-sec",
    grant=Grant.CONTROLLER_PROPERTIES_WRITE,
    status=204,
)
TIMEZONE = get("/ctrl/clock/timezone").shows(single("ctrl-timezone", "timezone", TEXT))
SET_TIMEZONE_TOO = post("/ctrl/clock/timezone", None, "timezone", grant=Grant.CONTROLLER_PROPERTIES_WRITE)
SET_TIMEZONE = post("/ctrl/clock/timezone", "set-timezone", "timezone", grant=Grant.CONTROLLER_PROPERTIES_WRITE)
TIMESERVER = get("/ctrl/clock/timeserver").shows(single("ctrl-timeserver", "timeserver", TEXT))
SERVER_TIME = get("/ctrl/clock/timeserver", "server-ip", resource="servertime", status=400)
SET_TIMESERVER = post("/ctrl/clock/timeserver", "set-timeserver", "timeserver", grant=Grant.CONTROLLER_PROPERTIES_WRITE)
NETWORK = get("/ctrl/network")
SET_NETWORK = post("/ctrl/network", "set", "method=fixip|dhcp|noip, address, mask, gateway", status=202)
DNS = get("/ctrl/network/dns")
ROUTES = get("/ctrl/network/routes").shows(record("ctrl-netw-route", NetworkRoute))
ADD_ROUTE = post("/ctrl/network/route/add", None, "destination, gateway")
ADD_ROUTE_OPTIONS = post("/ctrl/network/route/add", method="OPTIONS")
REMOVE_ROUTE = post("/ctrl/network/route/remove", None, "destination", status=202)
REMOVE_ROUTE_OPTIONS = post("/ctrl/network/route/remove", method="OPTIONS")
BACKUP = get("/ctrl/backup")
BACKUP_STATE = get("/ctrl/backup", action="backupstate").shows(single("ctrl-backup-state", "backup-state", TEXT))
CHECK_RESTORE = get("/ctrl/backup", "backup, ignore", action="check-restore").shows(
    single("ctrl-check-restore", "status", choice("Accepted", "Rejected"))
)
BACK_UP = post("/ctrl/backup", "backup", f"backup, archive={TRUTH}", grant=Grant.BACKUP, status=202)
RESTORE = post(
    "/ctrl/backup",
    "restore",
    f"backup, ignore=all|system-id|template-id|none, delete-dir={TRUTH}, include-cs={TRUTH}, "
    f"include-ss={TRUTH}, include=cfg|modules|all",
    grant=Grant.RESTORE,
)
BACKUP_INFO = get("/ctrl/backup/info", "backup-path").shows(single("ctrl-backup-info", "system-name", TEXT))
PROGRESS_LIST = get("/progress")
PROGRESS = get("/progress/{job}").shows(record("progress", Progress))
COMPRESSION = get("/ctrl/compress")
COMPRESS = post("/ctrl/compress", "comp", "srcpath, dstpath", grant=Grant.FTP_WRITE, status=202)
DECOMPRESS = post("/ctrl/compress", "dcomp", "srcpath, dstpath", grant=Grant.FTP_WRITE, status=202)
DIAGNOSTICS = get("/ctrl/diagnostics")
SAVE_DIAGNOSTICS = post("/ctrl/diagnostics", "save", "dstpath", grant=Grant.FTP_WRITE, status=202)
SYSTEMS = get("/ctrl/system", "type=selected")
SYSTEM = get("/ctrl/system/{system}").shows(record("ctrl-system", InstalledSystem))
RENAME_SYSTEM = post("/ctrl/system/{system}", "rename", "newname", grant=Grant.SYSTEM_ADMINISTRATION, status=201)
ACTIVATE_SYSTEM = post("/ctrl/system/{system}", "activate", grant=Grant.SYSTEM_ADMINISTRATION, status=409)
DELETE_SYSTEM = delete("/ctrl/system/{system}", grant=Grant.SYSTEM_ADMINISTRATION, status=400)
OPTIONS = get("/ctrl/options", status=204)
OPTION = get("/ctrl/options/{option:.+}")
COMPATIBLE = get("/ctrl/compatible").shows(single("ctrl-compatibility", "compatible", flag()))
COMPATIBILITY = get("/ctrl/compatibility/{version}").shows(single("ctrl-compatibility", "compatible", flag()))
SAFETY = get("/ctrl/safety")
ABSENT = (
    *absent(
        "a safety controller (SafeMove)",
        "GET /ctrl/safety/zones | POST /ctrl/safety/cyclic-brake-check"
        " | GET /ctrl/safety?resource=config-status | GET /ctrl/safety?resource=safety-mode"
        " | GET /ctrl/safety?resource=cbc-status | GET /ctrl/safety?resource=loadoperation-status"
        " | GET /ctrl/safety?resource=safety-config | GET /ctrl/safety?resource=violation-info"
        " | POST /ctrl/safety?action=load | POST /ctrl/safety?action=set-mode"
        " | POST /ctrl/safety?action=unlock | POST /ctrl/safety?action=syncack"
        " | POST /ctrl/safety?action=validate-cfg | POST /ctrl/safety?action=invalidate-cfg"
        " | POST /ctrl/safety?action=reset",
    ),
    *absent(
        "virtual time, which RobotStudio's controllers alone have",
        "GET /ctrl/virtualtime | GET /ctrl/virtualtime/vttime | GET /ctrl/virtualtime/vtstate"
        " | GET /ctrl/virtualtime/vtspeed | GET /ctrl/virtualtime/vttimeslice"
        " | POST /ctrl/virtualtime/vtstate | POST /ctrl/virtualtime/vtspeed"
        " | POST /ctrl/virtualtime/vttimeslice | POST /ctrl/virtualtime/vtrun",
    ),
)
"""What this robot lacks."""
