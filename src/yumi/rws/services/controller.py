"""The controller itself: its panel, event log, system, files, configuration and users.

The panel has motors, operating mode, speed, collision detection, and the restart of RobotWare; the system identity,
clock, network, backups, options, licence, energy and jobs. Paths of files and directories are as in RAPID
(``HOME:/pick.mod``). The configuration has domains, types, instances with their attributes, and cfg files. To users
belong grants, mastership, and the remote manual mode privilege (RMMP).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from enum import Enum

import httpx

from yumi.catalogue import message
from yumi.errors import CommandRefused, ControllerRefused, NoConnection, ProtocolError
from yumi.rws import documents
from yumi.rws.documents import CfgInstance, ControllerIdentity, Event, FileInfo, Pairs, State, SystemInfo
from yumi.rws.session import OnProgress, Request, Requests, file_path, get, given, post
from yumi.rws.types import Code, CollisionState, ControllerState, OperatingMode

_EVENTS_PER_PAGE = 50
_JOB_POLL = 0.5  # [s]
_JOB_DEADLINE = 600.0  # [s]
_PROGRESS = re.compile(r"/progress/[\w-]+")
_REFUSED = 400
_NOT_FOUND = (400, 404)  # which of the two differs by version
_RMMP = "/users/rmmp"
_RMMP_POLL = 0.25  # [s]; the controller forgets a request that is not polled for 10 s


# The panel


class RestartMode(Enum):
    """What a restart keeps."""

    WARM = "restart"
    """All: programs and configuration; a changed configuration takes effect."""
    RESET_SYSTEM = "istart"
    """Nothing: the system becomes as it was installed."""
    RESET_RAPID = "pstart"
    """The configuration; programs are removed."""
    LAST_SAVED = "bstart"
    """The state of the last good shutdown."""


class Panel(Requests):
    """``/rw/panel``."""

    def controller_state(self) -> ControllerState:
        """Motors on or off, or the stop that keeps them off."""
        return self._read(
            get("/rw/panel/ctrlstate"), documents.read_controller_state, "reading the state of the motors"
        )

    def set_motors(self, on: bool) -> None:
        """Switch the motors; they may need a moment after the call until ``controller_state`` says so."""
        state = ControllerState.MOTORS_ON if on else ControllerState.MOTORS_OFF
        self._do(
            post("/rw/panel/ctrlstate", "setctrlstate", ("ctrl-state", state.value)),
            f"switching the motors {'on' if on else 'off'}",
        )

    def operating_mode(self) -> OperatingMode:
        """Position of the mode switch."""
        return self._read(get("/rw/panel/opmode"), documents.read_operating_mode, "reading the operating mode")

    def collision_state(self) -> CollisionState:
        """State of the collision detection."""
        return self._read(get("/rw/panel/coldetstate"), documents.read_collision_state, "reading the collision state")

    def speed_ratio(self) -> int:
        """Override of all speeds [%]."""
        return self._read(get("/rw/panel/speedratio"), documents.read_speed_ratio, "reading the speed ratio")

    def set_speed_ratio(self, percent: int) -> None:
        """Set the override of all speeds, 0 to 100 %.

        Raises:
            CommandRefused: outside that range.
        """
        if not 0 <= percent <= 100:
            raise CommandRefused(message("speed_ratio_out_of_range", percent=percent, lowest=0, highest=100))
        self._do(
            post("/rw/panel/speedratio", "setspeedratio", ("speed-ratio", str(percent))),
            f"setting the speed ratio to {percent} %",
        )

    def restart(self, mode: RestartMode = RestartMode.WARM) -> None:
        """Restart: every connection and session ends, and the controller does not answer for some time."""
        self._do(post("/rw/panel", "restart", ("restart-mode", mode.value)), "restarting the controller")

    def acknowledge_operating_mode(self, mode: OperatingMode) -> None:
        """Confirm a change of the mode switch to AUTO or MANUAL_FULL, which waits for it."""
        name = {OperatingMode.AUTO: "auto", OperatingMode.MANUAL_FULL: "manf"}.get(mode)
        if name is None:
            raise CommandRefused(message("mode_needs_no_confirmation", mode=mode.value))
        self._do(post("/rw/panel/opmode", "acknowledge", ("opmode", name)), "confirming the operating mode")

    def acknowledge_collision(self) -> None:
        """Confirm that the collision detection was triggered, after a person has looked at the robot."""
        self._do(post("/rw/panel/opmode", "acknowledge", ("opmode", "coldet")), "confirming the collision")

    def is_operating_mode_locked(self) -> bool:
        """Whether the mode switch is locked with a PIN."""
        what = "reading the lock of the operating mode"
        state = self._state(what, "/rw/panel/opmode", "pnl-opmode-lock", ("resource", "lock-state"))
        return state.text("lock-state") != "unlocked"

    def lock_operating_mode(self, pin: str, *, permanent: bool = False) -> None:
        """Lock the mode switch; ``permanent`` outlives a restart."""
        form = (("pin", pin), ("permanent", "1" if permanent else "0"))
        self._do(post("/rw/panel/opmode", "lock", *form), "locking the operating mode")

    def unlock_operating_mode(self, pin: str) -> None:
        """Unlock the mode switch."""
        self._do(post("/rw/panel/opmode", "unlock", ("pin", pin)), "unlocking the operating mode")

    def set_language(self, code: str) -> None:
        """Language of the FlexPendant, such as ``en``."""
        self._do(post("/rw/panel", "setlang", *given(lang_code=code)), "setting the language")


# The event log


@dataclass(frozen=True, slots=True)
class EventDomain:
    """A part of the event log: how many messages it has, and can have."""

    number: int
    name: str
    messages: int
    capacity: int


class EventLog(Requests):
    """``/rw/elog``."""

    def events(self, domain: int = 0, count: int = _EVENTS_PER_PAGE) -> tuple[Event, ...]:
        """The newest ``count`` messages of the event log, newest first; domain 0 holds all domains."""
        size = min(count, _EVENTS_PER_PAGE)
        found: tuple[Event, ...] = ()
        while len(found) < count:
            number = len(found) // size + 1
            query = (("lang", "en"), ("order", "lifo"), ("start", str(number)), ("limit", str(size)))
            page = self._read(
                get(f"/rw/elog/{domain}", *query), documents.read_events, f"reading the event log {domain}"
            )
            found += page
            if len(page) < size:
                break
        return found[:count]

    def clear_events(self, domain: int = 0) -> None:
        """Empty an event log; domain 0 empties all."""
        self._do(post(f"/rw/elog/{domain}", "clear"), f"clearing the event log {domain}")

    def event_domains(self) -> tuple[EventDomain, ...]:
        """The domains of the event log; 0 holds all."""
        states = self._states("reading the event log", "/rw/elog", ("lang", "en"), ("resource", "count"))
        return tuple(
            EventDomain(int(state.title), state.text("domain-name"), state.whole("numevts"), state.whole("buffsize"))
            for state in states
        )

    def event(self, number: int, domain: int = 0) -> Event:
        """One message, by its number."""
        request = get(f"/rw/elog/{domain}/{number}", ("lang", "en"))
        (found,) = self._read(request, documents.read_events, f"reading event {number}")
        return found

    def clear_all_events(self) -> None:
        """Empty all event logs."""
        self._do(post("/rw/elog", "clearall"), "clearing the event logs")

    def save_events(self, path: str) -> None:
        """Write the event log to a file of the controller."""
        self._do(post("/rw/elog", "saveraw", ("path", file_path(path))), "saving the event log")


# The system


@dataclass(frozen=True, slots=True)
class NetworkPort:
    """A network port of the controller."""

    name: str
    address: str
    mask: str


@dataclass(frozen=True, slots=True)
class Energy:
    """What the robot has consumed since ``reset_at`` [J]."""

    total: float
    reset_at: str


@dataclass(frozen=True, slots=True)
class ReturnCode:
    """What one of ABB's return codes means; severity is Success, Warning or Error."""

    code: int
    name: str
    severity: str
    description: str


class Controller(Requests):
    """``/ctrl``, ``/rw/system``, ``/rw/devices``, ``/rw/retcode`` and ``/progress``."""

    def identity(self) -> ControllerIdentity:
        """Name, serial number and kind of the controller."""
        return self._read(get("/ctrl/identity"), documents.read_identity, "reading the identity")

    def system(self) -> SystemInfo:
        """Name, RobotWare version and options."""
        return self._read(get("/rw/system"), documents.read_system, "reading the system")

    def clock(self) -> datetime:
        """Its local time; the controller does not say in which zone."""
        return self._read(get("/ctrl/clock"), documents.read_clock, "reading the clock")

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
        form = ("backup", f"/fileservice/$BACKUP/{name}")
        self._job(post("/ctrl/backup", "backup", form), f"making the backup {name}", on_progress)
        return f"BACKUP:/{name}"

    def restore(self, name: str) -> None:
        """Have the controller become as in the backup ``name`` in BACKUP; it restarts, see ``wait_for_restart``."""
        form = ("backup", f"/fileservice/$BACKUP/{name}")
        self._do(post("/ctrl/backup", "restore", form), f"restoring the backup {name}")

    def set_identity(self, *, name: str | None = None, id: str | None = None) -> None:
        """Change the controller's name or id."""
        request = Request("PUT", "/ctrl/identity", form=given(ctrl_name=name, ctrl_id=id))
        self._do(request, "changing the identity")

    def environment(self, variable: str) -> str:
        """What an environment variable such as ``HOME`` stands for."""
        return self._state(f"reading ${variable}", f"/ctrl/${variable}", "ctrl-env").text("value")

    def set_controller_language(self, code: str) -> None:
        """Language of the messages, such as ``en``."""
        self._do(post("/ctrl", "set-lang", ("lang", code)), "setting the language")

    def restart_controller(self, mode: str = "restart") -> None:
        """Restart the controller's computer.

        Args:
            mode: ``restart``, ``istart``, ``pstart``, ``bstart`` as in ``restart``; or ``shutdown``, ``xstart``, after
                which a person has to switch it on.
        """
        self._do(Request("POST", "/ctrl", form=(("restart-mode", mode),)), "restarting the controller")

    def _job(self, request: Request, what: str, on_progress: OnProgress) -> None:
        """Have the controller begin a job, and wait until it has ended.

        Raises:
            ControllerRefused: it cannot, or the job failed.
            NoConnection: it does not end in time.
            ProtocolError: the controller does not say where its progress is.
        """
        reply = self._session.exchange(request)
        self._accepted(reply, what)
        found = _PROGRESS.search(reply.headers.get("Location", ""))
        if found is None and reply.status_code == httpx.codes.ACCEPTED:
            raise ProtocolError(message("job_without_progress", address=self.address, what=what))
        start = self._clock.now()
        while found is not None:
            state = self._read(get(found[0]), documents.read_progress, what)
            on_progress(state.state)
            if not state.is_pending:
                if state.code not in (0, documents.JOB_DONE):
                    said = message("job_failed", address=self.address, what=what, state=state.state)
                    raise ControllerRefused(said, status=0, code=state.code)
                break
            if self._clock.now() - start > _JOB_DEADLINE:
                raise NoConnection(message("job_not_ended", address=self.address, what=what, deadline=_JOB_DEADLINE))
            self._clock.wait(_JOB_POLL)

    # Clock

    def set_clock(self, time: datetime) -> None:
        """Set the controller's local time."""
        parts = {"year": time.year, "month": time.month, "day": time.day}
        parts |= {"hour": time.hour, "min": time.minute, "sec": time.second}
        form = tuple((f"sys-clock-{name}", str(value)) for name, value in parts.items())
        self._do(Request("PUT", "/ctrl/clock", form=form), "setting the clock")

    def timezone(self) -> str:
        """Time zone, such as ``Europe/Stockholm``."""
        return self._state("reading the time zone", "/ctrl/clock/timezone", "ctrl-timezone").text("timezone")

    def set_timezone(self, name: str) -> None:
        """Set the time zone."""
        self._do(post("/ctrl/clock/timezone", "set-timezone", ("timezone", name)), "setting the time zone")

    def time_server(self) -> str:
        """Address of the NTP server, "" for none."""
        return self._state("reading the time server", "/ctrl/clock/timeserver", "ctrl-timeserver").text("timeserver")

    def set_time_server(self, address: str) -> None:
        """Take the time from an NTP server."""
        self._do(post("/ctrl/clock/timeserver", "set-timeserver", ("timeserver", address)), "setting the time server")

    # Network

    def network_ports(self) -> tuple[NetworkPort, ...]:
        """The controller's network ports."""
        states = self._states("reading the network", "/ctrl/network")
        return tuple(NetworkPort(state.text("name"), state.text("addr"), state.text("mask")) for state in states)

    def set_network(self, method: str, address: str = "", mask: str = "", gateway: str = "") -> None:
        """Address of the WAN port, after a restart; ``method`` is ``fixip``, ``dhcp`` or ``noip``."""
        form = given(method=method, address=address or None, mask=mask or None, gateway=gateway or None)
        self._do(post("/ctrl/network", "set", *form), "setting the network")

    def name_server(self) -> str:
        """Address of the DNS server, "" for none."""
        return self._state("reading the name server", "/ctrl/network/dns", "ctrl-netw").text("addr")

    def routes(self) -> dict[str, str]:
        """Gateways by destination."""
        states = self._states("reading the routes", "/ctrl/network/routes")
        return {state.text("destination"): state.text("gateway") for state in states}

    def add_route(self, destination: str, gateway: str) -> None:
        """Send what goes to a network such as ``10.1.0.0/16`` to a gateway."""
        form = given(destination=destination, gateway=gateway)
        self._do(Request("POST", "/ctrl/network/route/add", form=form), "adding a route")

    def remove_route(self, destination: str) -> None:
        """Remove a route."""
        form = given(destination=destination)
        self._do(Request("POST", "/ctrl/network/route/remove", form=form), "removing a route")

    # Jobs

    def backup_state(self) -> str:
        """What has become of the last backup, such as ``None`` or ``Backup Ready``."""
        query = ("action", "backupstate")
        return self._state("reading the backup", "/ctrl/backup", "ctrl-backup-state", query).text("backup-state")

    def can_restore(self, name: str) -> bool:
        """Whether a backup in BACKUP is of this system."""
        query = (("action", "check-restore"), ("backup", f"$BACKUP/{name}"))
        state = self._state(f"checking the backup {name}", "/ctrl/backup", "ctrl-check-restore", *query)
        return state.text("status") == "Accepted"

    def backup_system(self, name: str) -> str:
        """Name of the system that a backup in BACKUP is of."""
        query = ("backup-path", f"/fileservice/$BACKUP/{name}")
        return self._state(f"reading {name}", "/ctrl/backup/info", "ctrl-backup-info", query).text("system-name")

    def compress(self, source: str, target: str, on_progress: OnProgress = lambda text: None) -> None:
        """Pack a file or directory of the controller into a directory of it."""
        form = (("srcpath", file_path(source)), ("dstpath", file_path(target)))
        self._job(post("/ctrl/compress", "comp", *form), f"packing {source}", on_progress)

    def decompress(self, source: str, target: str, on_progress: OnProgress = lambda text: None) -> None:
        """Unpack a file of the controller into a directory of it."""
        form = (("srcpath", file_path(source)), ("dstpath", file_path(target)))
        self._job(post("/ctrl/compress", "dcomp", *form), f"unpacking {source}", on_progress)

    def save_diagnostics(self, path: str, on_progress: OnProgress = lambda text: None) -> None:
        """Write what ABB's support asks for to a file of the controller."""
        form = ("dstpath", file_path(path))
        self._job(post("/ctrl/diagnostics", "save", form), "saving the diagnostics", on_progress)

    # System

    def systems(self) -> tuple[str, ...]:
        """Names of the installed systems."""
        return tuple(state.title for state in self._states("reading the systems", "/ctrl/system"))

    def installed_system(self, name: str) -> SystemInfo:
        """One of the installed systems."""
        state = self._state(f"reading the system {name}", f"/ctrl/system/{name}", "ctrl-system")
        version = tuple(int(part) for part in state.text("rwversion").split(".") if part.isdecimal())
        return SystemInfo(state.text("system-name"), version, (), state.text("system-id"))

    def rename_system(self, name: str, to: str) -> None:
        """Give an installed system another name."""
        self._do(post(f"/ctrl/system/{name}", "rename", ("newname", to)), f"renaming {name}")

    def has_option(self, option: str) -> bool:
        """Whether the system has an option, named as in ``system().options``."""
        reply = self._session.exchange(get(f"/ctrl/options/{option}"))
        self._accepted(reply, f"asking for {option}")
        return reply.status_code == httpx.codes.OK

    def options(self) -> tuple[str, ...]:
        """Names of the system's options."""
        page = self._page(self._session.exchange(get("/rw/system/options")), "reading the options")
        return tuple(child.text("option") for state in page.states for child in state.children)

    def is_compatible(self, version: str = "") -> bool:
        """Whether clients for a version of RobotWare, or for the present one, can be used."""
        path = f"/ctrl/compatibility/{version}" if version else "/ctrl/compatible"
        return self._state("asking for the version", path, "ctrl-compatibility").flag("compatible")

    def has_safety_controller(self) -> bool:
        """Whether there is a safety controller (SafeMove)."""
        return bool(self._states("reading the safety controller", "/ctrl/safety"))

    def robot_types(self) -> tuple[str, ...]:
        """Types of the robots, such as ``IRB 14000-0.5/0.5``."""
        return tuple(state.text("robot-type") for state in self._states("reading the type", "/rw/system/robottype"))

    def license(self) -> str:
        """The system's licence."""
        return self._state("reading the licence", "/rw/system/license", "sys-license").text("license")

    def products(self) -> dict[str, str]:
        """Versions of the installed products by name."""
        states = self._states("reading the products", "/rw/system/products")
        return {state.text("title"): state.text("version-name") for state in states}

    def energy(self) -> Energy:
        """What the robot has consumed."""
        state = self._state("reading the energy", "/rw/system/energy", "sys-energy-state-li")
        return Energy(state.number("accumulated-energy"), state.text("reset-time"))

    def energy_change_count(self) -> int:
        """Rises with every change of what the robot has consumed."""
        path, query = "/rw/system/energy", ("resource", "change-count")
        return self._state("reading the energy", path, "sys-energy-changecount-li", query).whole("change-count")

    def reset_energy(self) -> None:
        """Begin to count anew."""
        self._do(post("/rw/system/energy", "reset"), "resetting the energy")

    def return_codes(self) -> tuple[ReturnCode, ...]:
        """All of the controller's return codes."""
        return tuple(
            ReturnCode(state.whole("code"), *(state.text(name) for name in ("name", "severity", "description")))
            for state in self._states("reading the return codes", "/rw/retcode")
        )

    def hardware(self, path: str = "") -> tuple[str, ...]:
        """Paths of the hardware below ``path``, such as ``HW_DEVICES/CONTROLLER``."""
        page = self._page(self._session.exchange(get(f"/rw/devices/{path}".rstrip("/"))), "reading the hardware")
        return tuple(child.title for state in page.of_type("dev-id-li") for child in state.children)

    def hardware_properties(self, path: str) -> dict[str, str]:
        """Properties of a piece of hardware, with their units."""
        states = self._states("reading the hardware", f"/rw/devices/{path}")
        return {
            state.text("name"): f"{state.text('value')} {state.fields.get('unit', '')}".rstrip()
            for state in states
            if state.type.startswith("dev-prop")
        }


# Files


@dataclass(frozen=True, slots=True)
class Volume:
    """A device of the controller, such as ``HOME``; its sizes [byte]."""

    name: str
    total: int
    free: int
    is_read_only: bool


class Files(Requests):
    """``/fileservice``; the content of a file takes as long as it needs, as long as it goes on."""

    def write_file(self, path: str, content: bytes) -> None:
        """Create or replace a file such as ``HOME:/logo.png``."""
        self._do(Request("PUT", file_path(path), content=content), f"writing {path}")

    def read_file(self, path: str) -> bytes:
        """Content of a file such as ``HOME:/pick.mod``."""
        reply = self._session.exchange(get(file_path(path)))
        self._accepted(reply, f"reading {path}")
        return reply.content

    def read_tree(self, path: str, on_progress: OnProgress = lambda text: None) -> dict[str, bytes]:
        """Every file in a directory and those below it, by its path behind ``path``."""
        found: dict[str, bytes] = {}
        folders = [""]
        while folders:
            folder = folders.pop()
            for entry in self.files(f"{path}{folder}"):
                name = f"{folder}/{entry.name}"
                if entry.size is None:
                    folders.append(name)
                else:
                    found[name.lstrip("/")] = self.read_file(f"{path}{name}")
                    on_progress(f"{path}{name}")
        return found

    def make_directory(self, path: str) -> None:
        """Create a directory such as ``HOME:/yumi``; the one above it must be there."""
        above, _, name = path.rstrip("/").rpartition("/")
        form = (("fs-action", "create"), ("fs-newname", name))
        self._do(Request("POST", file_path(f"{above}/").rstrip("/"), form=form), f"creating {path}")

    def copy_file(self, path: str, name: str, *, replace: bool = False) -> None:
        """Copy a file within its directory, to the name ``name``."""
        form = (("fs-action", "copy"), ("fs-newname", name), ("fs-overwrite", "true" if replace else "false"))
        self._do(Request("POST", file_path(path), form=form), f"copying {path}")

    def rename_file(self, path: str, name: str) -> None:
        """Give a file or directory another name in its directory."""
        form = (("fs-action", "rename"), ("fs-newname", name))
        self._do(Request("POST", file_path(path), form=form), f"renaming {path}")

    def upload(self, path: str, text: str) -> None:
        """Create or replace a file such as ``HOME:/pick.mod``; RAPID's files are Latin-1.

        Raises:
            CommandRefused: the text has characters that such a file cannot hold.
        """
        try:
            content = text.encode("latin-1")
        except UnicodeEncodeError as error:
            wrong = text[error.start]
            raise CommandRefused(message("file_not_latin_1", path=path, character=wrong)) from error
        self.write_file(path, content)

    def download(self, path: str) -> str:
        """Content of a file such as ``HOME:/pick.mod``."""
        return self.read_file(path).decode("latin-1")

    def files(self, path: str) -> tuple[FileInfo, ...]:
        """What is in a directory such as ``HOME:/yumi``."""
        states = self._states(f"listing {path}", file_path(path.rstrip("/") + "/"))
        return tuple(
            FileInfo(state.title, state.whole("fs-size") if state.type == "fs-file" else None)
            for state in states
            if state.type in ("fs-dir", "fs-file")
        )

    def delete_file(self, path: str) -> None:
        """Remove a file, or a directory with all that is in it."""
        self._do(Request("DELETE", file_path(path)), f"removing {path}")

    def volumes(self) -> tuple[Volume, ...]:
        """The devices on which there are files."""
        return tuple(
            Volume(
                state.title.lstrip("$").upper(),
                state.whole("fs-total-space"),
                state.whole("fs-free-space"),
                state.flag("fs-readonly"),
            )
            for state in self._states("reading the devices", "/fileservice")
            if state.type == "fs-device"
        )

    def has_file(self, path: str) -> bool:
        """Whether there is a file or directory."""
        reply = self._session.exchange(Request("HEAD", file_path(path)))
        if reply.status_code in _NOT_FOUND:
            return False
        self._accepted(reply, f"looking for {path}")
        return True


# The configuration


@dataclass(frozen=True, slots=True)
class CfgAttribute:
    """An attribute of a type.

    Attributes:
        name: of it.
        type: such as ``string`` or ``float``.
        lowest, highest: limits of its value, or of its length.
        initial: value of a new instance.
        is_mandatory: whether an instance must have it.
    """

    name: str
    type: str
    lowest: str
    highest: str
    initial: str
    is_mandatory: bool


class Configuration(Requests):
    """``/rw/cfg``."""

    def cfg(self, domain: str, type: str) -> tuple[CfgInstance, ...]:
        """All instances of a configuration type, such as ``SIO`` and ``COM_TRP``."""
        found: tuple[CfgInstance, ...] = ()
        query: Pairs | None = ()
        while query is not None:
            request = get(f"/rw/cfg/{domain}/{type}/instances", *query)
            page = self._page(self._session.exchange(request), f"reading the configuration {domain}/{type}")
            found += documents.read_cfg_instances(page)
            query = page.next_query if page.states else None
        return found

    def set_cfg(self, domain: str, type: str, name: str, attributes: Mapping[str, str]) -> None:
        """Change attributes of an instance of the configuration; they act after the next restart."""
        with self.holding("cfg"):
            request = post(f"/rw/cfg/{domain}/{type}/instances/{name}", "set", *attributes.items())
            self._do(request, f"changing {domain}/{type}/{name}")

    def create_cfg(self, domain: str, type: str, name: str) -> None:
        """Add an instance with default values to the configuration; it acts after the next restart."""
        with self.holding("cfg"):
            request = post(f"/rw/cfg/{domain}/{type}/instances", "create-default", ("name", name))
            self._do(request, f"adding {domain}/{type}/{name}")

    def remove_cfg(self, domain: str, type: str, name: str) -> None:
        """Remove an instance of the configuration; it is gone after the next restart."""
        with self.holding("cfg"):
            request = Request("DELETE", f"/rw/cfg/{domain}/{type}/instances/{name}")
            self._do(request, f"removing {domain}/{type}/{name}")

    def load_cfg(self, path: str, *, replace: bool = False) -> None:
        """Load a cfg file of the controller such as ``HOME:/SIO.cfg``; it acts after the next restart.

        Args:
            path: the file as RAPID names it.
            replace: whether its instances take the place of those of the same names, which are an error otherwise.
        """
        form = (("filepath", file_path(path)), ("action-type", "replace" if replace else "add"))
        with self.holding("cfg"):
            self._do(post("/rw/cfg", "load", *form), f"loading {path}")

    def save_cfg(self, domain: str, path: str) -> None:
        """Write a domain of the configuration, such as ``SIO``, to a file of the controller."""
        self._do(post(f"/rw/cfg/{domain}", "saveas", ("filepath", file_path(path))), f"saving {domain} to {path}")

    def cfg_domains(self) -> tuple[str, ...]:
        """The domains: ``EIO``, ``MMC``, ``MOC``, ``PROC``, ``SIO``, ``SYS``."""
        return tuple(state.title for state in self._states("reading the domains", "/rw/cfg"))

    def cfg_types(self, domain: str) -> tuple[str, ...]:
        """The types of a domain."""
        return tuple(state.title for state in self._states(f"reading the types of {domain}", f"/rw/cfg/{domain}"))

    def cfg_size(self, domain: str, type: str) -> tuple[int, int]:
        """Number of attributes and of instances of a type."""
        state = self._state(f"reading {domain}/{type}", f"/rw/cfg/{domain}/{type}", "cfg-dt")
        return state.whole("cfg-no-of-attributes"), state.whole("cfg-no-of-instances")

    def cfg_attributes(self, domain: str, type: str) -> tuple[CfgAttribute, ...]:
        """The attributes of a type."""
        states = self._states(f"reading the attributes of {domain}/{type}", f"/rw/cfg/{domain}/{type}/attributes")
        return tuple(
            CfgAttribute(
                name=state.text("name"),
                type=state.text("type"),
                lowest=state.fields.get("mini", ""),
                highest=state.fields.get("max", ""),
                initial=state.fields.get("init", ""),
                is_mandatory=state.flag("mandatory"),
            )
            for state in states
        )

    def cfg_instance(self, domain: str, type: str, name: str) -> CfgInstance:
        """One instance."""
        path = f"/rw/cfg/{domain}/{type}/instances/{name}"
        state = self._state(f"reading {domain}/{type}/{name}", path, "cfg-dt-instance")
        return documents.cfg_instance_of(state)

    def check_cfg_file(self, path: str, *, replace: bool = False) -> bool:
        """Whether a cfg file of the controller can be loaded."""
        form = (("filepath", file_path(path)), ("action-type", "replace" if replace else "add"))
        return self._is_valid(post("/rw/cfg", "validate", *form), f"checking {path}")

    def can_change_cfg(self, domain: str, type: str, names: Sequence[str]) -> bool:
        """Whether instances may be changed."""
        form = given(cfgdomain=domain, cfgtype=type, instances=",".join(names), instancescount=len(names), operation=1)
        return self._is_valid(post("/rw/cfg", "validate-instances", *form), f"checking {domain}/{type}")

    def can_remove_cfg(self, name: str) -> bool:
        """Whether an instance may be removed, as no other one names it."""
        return self._is_valid(post("/rw/cfg", "validate-inst-at-del", ("name", name)), f"checking {name}")

    def _is_valid(self, request: Request, what: str) -> bool:
        try:
            self._do(request, what)
        except ControllerRefused as error:
            if error.status != _REFUSED:
                raise
            return False
        return True

    def reset_cfg(self, domain: str, type: str = "") -> None:
        """Make a domain, or one type of it, as a new system has it; it acts after the next restart."""
        path = f"/rw/cfg/{domain}/{type}/instances" if type else f"/rw/cfg/{domain}"
        with self.holding("cfg"):
            self._do(post(path, "reset"), f"resetting {domain} {type}".rstrip())


# Users, masterships and the remote manual mode privilege


class Privilege(Enum):
    """What a client may do in manual mode."""

    MODIFY = "modify"
    """Write data and programs."""
    EXECUTE = "exec"
    """Start programs, too."""


class RmmpStatus(Enum):
    """What became of a request for the remote manual mode privilege."""

    PENDING = "PENDING"
    GRANTED = "GRANTED"
    DENIED = "DENIED"


@dataclass(frozen=True, slots=True)
class User:
    """A client that is logged in."""

    uid: int
    name: str
    application: str
    location: str
    is_local: bool


@dataclass(frozen=True, slots=True)
class Rmmp:
    """Who has the remote manual mode privilege, or asks for it.

    Attributes:
        user: who; None for no user.
        privilege: ``none``, ``pending modify``, ``modify`` or ``exec``.
        is_own: whether it is this client.
    """

    user: User | None
    privilege: str
    is_own: bool


class Users(Requests):
    """``/users`` and ``/rw/mastership``."""

    def users(self) -> tuple[User, ...]:
        """Clients that are logged in; some controllers show this one only."""
        return tuple(_user(state, "uid", "ulocale") for state in self._states("reading the users", "/users"))

    def register(
        self, name: str = "Default User", application: str = "yumi-ros2", location: str = "", *, is_local: bool = False
    ) -> None:
        """Say who this client is, for the FlexPendant and other clients."""
        locale = "local" if is_local else "remote"
        form = given(username=name, application=application, location=location, ulocale=locale)
        self._do(Request("POST", "/users", form=form), "registering")

    def set_local(self, is_local: bool) -> None:
        """Become a local client, which needs the enabling device within 5 s, or a remote one."""
        self._do(post("/users", "set-locale", ("type", "local" if is_local else "remote")), "changing the locale")

    def impersonate(self, uid: int) -> None:
        """Act as another client that is logged in; for local clients."""
        self._do(post("/users", "impersonate", ("uid", str(uid))), "acting as another client")

    def grants(self) -> tuple[str, ...]:
        """What the user is permitted, such as ``UAS_RAPID_EXECUTE``."""
        states = self._states("reading the grants", "/users/grants")
        return tuple(  # the title is the name, or "user-grant" with the name in a field
            next((text for text in state.fields.values() if text.startswith("UAS_")), state.title) for state in states
        )

    def log_in_remotely(self) -> None:
        """Take the rights of a remote user."""
        self._do(post("/users/remoteuser", "remotelogin"), "logging in as remote user")

    def log_out_remotely(self) -> None:
        """Give up the rights of a remote user."""
        self._do(post("/users/remoteuser", "remotelogout"), "logging out as remote user")

    # Remote manual mode privilege

    def rmmp(self) -> Rmmp:
        """Who has the remote manual mode privilege."""
        state = self._state("reading the privilege", _RMMP, "user-rmmp")
        privilege = state.text("privilege")
        user = None if privilege == "none" else _user(state, "userid", "ulocale")
        return Rmmp(user, privilege, state.flag("rmmpheldbyme"))

    def request_rmmp(self, privilege: Privilege = Privilege.MODIFY) -> None:
        """Ask for the privilege to change something in manual mode; a person grants it on the FlexPendant.

        ``poll_rmmp`` at least every ten seconds, or the request is forgotten.
        """
        form = (("privilege", privilege.value),)
        self._do(Request("POST", _RMMP, form=form), "asking for the remote manual mode privilege")

    def poll_rmmp(self) -> RmmpStatus:
        """What became of the request; a granted privilege ends when it is not polled, too.

        Raises:
            ControllerRefused: there is no request.
        """
        state = self._state("asking for the privilege", f"{_RMMP}/poll", "user-rmmp-poll")
        if state.text("code") == str(int(Code.NO_SUCH_REQUEST)):
            said = message("no_privilege_requested", address=self.address)
            raise ControllerRefused(said, status=0, code=Code.NO_SUCH_REQUEST)
        return state.member(RmmpStatus, "status")

    def cancel_rmmp(self) -> None:
        """Withdraw the request, or give the privilege back."""
        self._do(post(_RMMP, "cancel"), "giving the privilege back")

    def grant_rmmp(self, uid: int, privilege: Privilege | None) -> None:
        """Grant another client's request, or deny it with None; for local clients."""
        form = given(uid=uid, privilege="deny" if privilege is None else privilege.value)
        self._do(post(_RMMP, "set", *form), "answering a request for the privilege")

    @contextmanager
    def holding_rmmp(self, privilege: Privilege = Privilege.MODIFY, timeout: float = 30.0) -> Iterator[None]:
        """The remote manual mode privilege for the time of the block, which has to poll it when it takes long.

        Args:
            privilege: what for.
            timeout: longest time that a person has to grant it [s].

        Raises:
            ControllerRefused: it was denied.
            NoConnection: no one answered in time.
        """
        self.request_rmmp(privilege)
        try:
            end = self._clock.now() + timeout
            while (status := self.poll_rmmp()) is RmmpStatus.PENDING:
                if self._clock.now() >= end:
                    raise NoConnection(message("privilege_not_granted", address=self.address, timeout=timeout))
                self._clock.wait(_RMMP_POLL)
            if status is RmmpStatus.DENIED:
                said = message("privilege_denied", address=self.address)
                raise ControllerRefused(said, status=0, code=Code.DENIED)
            yield
        finally:
            self.cancel_rmmp()

    # Mastership

    def mastership(self, domain: str) -> str:
        """Which other client holds the right to change ``cfg``, ``rapid`` or ``motion``; empty where none does."""
        return self._read(
            get(f"/rw/mastership/{domain}"), documents.read_mastership, f"reading the mastership of {domain}"
        )

    def mastership_domains(self) -> tuple[str, ...]:
        """What a client can have the mastership of: ``cfg``, ``motion``, ``rapid``."""
        return tuple(state.title for state in self._states("reading the masterships", "/rw/mastership"))

    def request_all_masterships(self) -> None:
        """Take the mastership of all domains; the FlexPendant is locked out until they are released."""
        self._do(post("/rw/mastership", "request"), "requesting all masterships")

    def release_all_masterships(self) -> None:
        """Release the mastership of all domains."""
        self._do(post("/rw/mastership", "release"), "releasing all masterships")


def _user(state: State, uid: str, locale: str) -> User:
    names = ("alias", "application", "location")
    name, application, location = (state.fields.get(name, "") for name in names)
    return User(state.whole(uid), name, application, location, state.fields.get(locale, "") == "local")
