"""Operations on the controller (``/ctrl``, ``/progress``): clock, network, backup, compression, jobs, systems.

With the client's calls of them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from datetime import datetime
from typing import Annotated, Any

from abb_protocols.catalogue import message
from abb_protocols.errors import ControllerRefused, NoConnection, ProtocolError
from abb_protocols.rws.documents import RwsState
from abb_protocols.rws.operations.files import file_path
from abb_protocols.rws.operations.operation import TRUTH_VALUES, Operation, absent_operations, delete, get, post, put
from abb_protocols.rws.operations.operation_answer import TEXT, TEXT_OR_NONE, Spelling, choice, flag, record, single
from abb_protocols.rws.operations.service import OnProgress, Service
from abb_protocols.rws.operations.system import SystemInfo
from abb_protocols.rws.values import Grant

_TIME = "%Y-%m-%d T %H:%M:%S"
_OK, _ACCEPTED = 200, 202
_JOB_POLL = 0.5  # [s]
_JOB_DEADLINE = 600.0  # [s]
_PROGRESS = re.compile(r"/progress/([\w-]+)")


@dataclass(frozen=True, slots=True)
class NetworkPort:
    """A network port of the controller."""

    name: str
    address: Annotated[str, "addr"]
    mask: str


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


_PORT = record("ctrl-netw", NetworkPort)  # in a list

CONTROLLER = get("/ctrl")
RESTART_CONTROLLER = post(
    "/ctrl", None, "restart-mode=restart|istart|pstart|bstart|shutdown|xstart", grant=Grant.REMOTE_WARMSTART, status=200
)
SET_CONTROLLER_LANGUAGE = post(
    "/ctrl",
    "set-lang",
    "lang=en|de|sv|fr|it|es|pt|da|fi|nl|cs|ja|ko|zh|ru|hu|pl",
    grant=Grant.CONTROLLER_PROPERTIES_WRITE,
)
CONTROLLER_ENVIRONMENT = get("/ctrl/${variable}").shows(single("ctrl-env", "value", TEXT))
CONTROLLER_IDENTITY = get("/ctrl/identity").shows(
    record("ctrl-identity-info|ctrl-identity-info-li", ControllerIdentity)
)
SET_CONTROLLER_IDENTITY = put(
    "/ctrl/identity", "ctrl-name, ctrl-id", grant=Grant.CONTROLLER_PROPERTIES_WRITE, status=204
)
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
CLOCK_TIMEZONE = get("/ctrl/clock/timezone").shows(single("ctrl-timezone", "timezone", TEXT))
SET_CLOCK_TIMEZONE_TOO = post("/ctrl/clock/timezone", None, "timezone", grant=Grant.CONTROLLER_PROPERTIES_WRITE)
SET_CLOCK_TIMEZONE = post("/ctrl/clock/timezone", "set-timezone", "timezone", grant=Grant.CONTROLLER_PROPERTIES_WRITE)
CLOCK_TIMESERVER = get("/ctrl/clock/timeserver").shows(single("ctrl-timeserver", "timeserver", TEXT))
CLOCK_SERVER_TIME = get("/ctrl/clock/timeserver", "server-ip", resource="servertime", status=400)
SET_CLOCK_TIMESERVER = post(
    "/ctrl/clock/timeserver", "set-timeserver", "timeserver", grant=Grant.CONTROLLER_PROPERTIES_WRITE
)
NETWORK = get("/ctrl/network")
SET_NETWORK = post("/ctrl/network", "set", "method=fixip|dhcp|noip, address, mask, gateway", status=202)
NETWORK_DNS = get("/ctrl/network/dns")
NETWORK_ROUTES = get("/ctrl/network/routes").shows(record("ctrl-netw-route", NetworkRoute))
ADD_NETWORK_ROUTE = post("/ctrl/network/route/add", None, "destination, gateway")
ADD_NETWORK_ROUTE_OPTIONS = post("/ctrl/network/route/add", method="OPTIONS")
REMOVE_NETWORK_ROUTE = post("/ctrl/network/route/remove", None, "destination", status=202)
REMOVE_NETWORK_ROUTE_OPTIONS = post("/ctrl/network/route/remove", method="OPTIONS")
BACKUP = get("/ctrl/backup")
BACKUP_STATE = get("/ctrl/backup", action="backupstate").shows(single("ctrl-backup-state", "backup-state", TEXT))
CHECK_BACKUP = get("/ctrl/backup", "backup, ignore", action="check-restore").shows(
    single("ctrl-check-restore", "status", choice("Accepted", "Rejected"))
)
CREATE_BACKUP = post("/ctrl/backup", "backup", f"backup, archive={TRUTH_VALUES}", grant=Grant.BACKUP, status=202)
RESTORE_BACKUP = post(
    "/ctrl/backup",
    "restore",
    f"backup, ignore=all|system-id|template-id|none, delete-dir={TRUTH_VALUES}, include-cs={TRUTH_VALUES}, "
    f"include-ss={TRUTH_VALUES}, include=cfg|modules|all",
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
CONTROLLER_OPTIONS = get("/ctrl/options", status=204)
CONTROLLER_OPTION = get("/ctrl/options/{option:.+}")
COMPATIBLE = get("/ctrl/compatible").shows(single("ctrl-compatibility", "compatible", flag()))
COMPATIBILITY = get("/ctrl/compatibility/{version}").shows(single("ctrl-compatibility", "compatible", flag()))
SAFETY = get("/ctrl/safety")
ABSENT_FROM_CONTROLLER = (
    *absent_operations(
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
    *absent_operations(
        "virtual time, which RobotStudio's controllers alone have",
        "GET /ctrl/virtualtime | GET /ctrl/virtualtime/vttime | GET /ctrl/virtualtime/vtstate"
        " | GET /ctrl/virtualtime/vtspeed | GET /ctrl/virtualtime/vttimeslice"
        " | POST /ctrl/virtualtime/vtstate | POST /ctrl/virtualtime/vtspeed"
        " | POST /ctrl/virtualtime/vttimeslice | POST /ctrl/virtualtime/vtrun",
    ),
)
"""What this robot lacks."""


class ControllerService(Service):
    """``/ctrl`` and ``/progress``."""

    def identity(self) -> ControllerIdentity:
        """Name, serial number and kind of the controller."""
        return self._answer("reading the identity", CONTROLLER_IDENTITY)

    def set_identity(self, *, name: str | None = None, id: str | None = None) -> None:
        """Change the controller's name or id."""
        self._call("changing the identity", SET_CONTROLLER_IDENTITY, ctrl_name=name, ctrl_id=id)

    def environment(self, variable: str) -> str:
        """What an environment variable such as ``HOME`` stands for."""
        return self._answer(f"reading ${variable}", CONTROLLER_ENVIRONMENT, variable)

    def set_controller_language(self, code: str) -> None:
        """Language of the messages, such as ``en``."""
        self._call("setting the language", SET_CONTROLLER_LANGUAGE, lang=code)

    def restart_controller(self, mode: str = "restart") -> None:
        """Restart the controller's computer.

        Args:
            mode: ``restart``, ``istart``, ``pstart``, ``bstart`` as in ``restart``; or ``shutdown``, ``xstart``, after
                which a person has to switch it on.
        """
        self._call("restarting the controller", RESTART_CONTROLLER, restart_mode=mode)

    # Clock

    def clock(self) -> datetime:
        """Its local time; the controller does not say in which zone."""
        return self._answer("reading the clock", CLOCK)

    def set_clock(self, time: datetime) -> None:
        """Set the controller's local time."""
        parts = {"year": time.year, "month": time.month, "day": time.day}
        parts |= {"hour": time.hour, "min": time.minute, "sec": time.second}
        self._call("setting the clock", SET_CLOCK, **{f"sys_clock_{name}": part for name, part in parts.items()})

    def timezone(self) -> str:
        """Time zone, such as ``Europe/Stockholm``."""
        return self._answer("reading the time zone", CLOCK_TIMEZONE)

    def set_timezone(self, name: str) -> None:
        """Set the time zone."""
        self._call("setting the time zone", SET_CLOCK_TIMEZONE, timezone=name)

    def time_server(self) -> str:
        """Address of the NTP server, "" for none."""
        return self._answer("reading the time server", CLOCK_TIMESERVER)

    def set_time_server(self, address: str) -> None:
        """Take the time from an NTP server."""
        self._call("setting the time server", SET_CLOCK_TIMESERVER, timeserver=address)

    # Network

    def network_ports(self) -> tuple[NetworkPort, ...]:
        """The controller's network ports."""
        return tuple(map(_PORT.read, self._listed("reading the network", NETWORK)))

    def set_network(self, method: str, address: str = "", mask: str = "", gateway: str = "") -> None:
        """Address of the WAN port, after a restart; ``method`` is ``fixip``, ``dhcp`` or ``noip``."""
        rest = {"address": address or None, "mask": mask or None, "gateway": gateway or None}
        self._call("setting the network", SET_NETWORK, method=method, **rest)

    def name_server(self) -> str:
        """Address of the DNS server, "" for none."""
        return self._shown("reading the name server", NETWORK_DNS).one("ctrl-netw").text("addr")

    def routes(self) -> dict[str, str]:
        """Gateways by destination."""
        return {each.destination: each.gateway for each in self._answers("reading the routes", NETWORK_ROUTES)}

    def add_route(self, destination: str, gateway: str) -> None:
        """Send what goes to a network such as ``10.1.0.0/16`` to a gateway."""
        self._call("adding a route", ADD_NETWORK_ROUTE, destination=destination, gateway=gateway)

    def remove_route(self, destination: str) -> None:
        """Remove a route."""
        self._call("removing a route", REMOVE_NETWORK_ROUTE, destination=destination)

    # Backups and other jobs

    def backup(self, name: str, on_progress: OnProgress = lambda text: None) -> str:
        """Have the controller back itself up; where the backup is, such as ``BACKUP:/before_yumi``.

        Args:
            name: of the directory of the backup.
            on_progress: gets the state of it as the controller says it.

        Raises:
            ControllerRefused: it cannot, or the backup failed.
            NoConnection: it does not end in time.
            ProtocolError: the controller does not say where its progress is.
        """
        self._job(f"making the backup {name}", on_progress, CREATE_BACKUP, backup=f"/fileservice/$BACKUP/{name}")
        return f"BACKUP:/{name}"

    def restore(self, name: str) -> None:
        """Have the controller become as in the backup ``name`` in BACKUP; it restarts, see ``wait_for_restart``."""
        self._call(f"restoring the backup {name}", RESTORE_BACKUP, backup=f"/fileservice/$BACKUP/{name}")

    def backup_state(self) -> str:
        """What has become of the last backup, such as ``None`` or ``Backup Ready``."""
        return self._answer("reading the backup", BACKUP_STATE)

    def can_restore(self, name: str) -> bool:
        """Whether a backup in BACKUP is of this system."""
        return self._answer(f"checking the backup {name}", CHECK_BACKUP, backup=f"$BACKUP/{name}")

    def backup_system(self, name: str) -> str:
        """Name of the system that a backup in BACKUP is of."""
        return self._answer(f"reading {name}", BACKUP_INFO, backup_path=f"/fileservice/$BACKUP/{name}")

    def compress(self, source: str, target: str, on_progress: OnProgress = lambda text: None) -> None:
        """Pack a file or directory of the controller into a directory of it."""
        paths = {"srcpath": file_path(source), "dstpath": file_path(target)}
        self._job(f"packing {source}", on_progress, COMPRESS, **paths)

    def decompress(self, source: str, target: str, on_progress: OnProgress = lambda text: None) -> None:
        """Unpack a file of the controller into a directory of it."""
        paths = {"srcpath": file_path(source), "dstpath": file_path(target)}
        self._job(f"unpacking {source}", on_progress, DECOMPRESS, **paths)

    def save_diagnostics(self, path: str, on_progress: OnProgress = lambda text: None) -> None:
        """Write what ABB's support asks for to a file of the controller."""
        self._job("saving the diagnostics", on_progress, SAVE_DIAGNOSTICS, dstpath=file_path(path))

    def _job(self, what: str, on_progress: OnProgress, operation: Operation[Any], /, **arguments: object) -> None:
        """Have the controller begin a job, and wait until it has ended.

        Raises:
            ControllerRefused: it cannot, or the job failed.
            NoConnection: it does not end in time.
            ProtocolError: the controller does not say where its progress is.
        """
        reply = self._call(what, operation, **arguments)
        found = _PROGRESS.search(reply.headers.get("Location", ""))
        if found is None and reply.status_code == _ACCEPTED:
            raise ProtocolError(message("job_without_progress", address=self.address, what=what))
        if found is None:
            return
        for _ in self._polls(_JOB_POLL, _JOB_DEADLINE):
            state = self._first(what, PROGRESS, found[1])
            on_progress(state.state)
            if state.is_pending:
                continue
            if state.code not in (0, JOB_DONE):
                said = message("job_failed", address=self.address, what=what, state=state.state)
                raise ControllerRefused(said, status=0, code=state.code)
            return
        raise NoConnection(message("job_not_ended", address=self.address, what=what, deadline=_JOB_DEADLINE))

    # Installed systems

    def systems(self) -> tuple[str, ...]:
        """Names of the installed systems."""
        return tuple(state.title for state in self._listed("reading the systems", SYSTEMS))

    def installed_system(self, name: str) -> SystemInfo:
        """One of the installed systems."""
        found = self._answer(f"reading the system {name}", SYSTEM, name)
        version = tuple(int(part) for part in found.version.split(".") if part.isdecimal())
        return SystemInfo(found.name, version, (), found.id)

    def rename_system(self, name: str, to: str) -> None:
        """Give an installed system another name."""
        self._call(f"renaming {name}", RENAME_SYSTEM, name, newname=to)

    def has_option(self, option: str) -> bool:
        """Whether the system has an option, named as in ``system().options``."""
        return self._call(f"asking for {option}", CONTROLLER_OPTION, option).status_code == _OK

    def is_compatible(self, version: str = "") -> bool:
        """Whether clients for a version of RobotWare, or for the present one, can be used."""
        what = "asking for the version"
        return self._answer(what, COMPATIBILITY, version) if version else self._answer(what, COMPATIBLE)

    def has_safety_controller(self) -> bool:
        """Whether there is a safety controller (SafeMove)."""
        return bool(self._listed("reading the safety controller", SAFETY))
