"""The client's service for the controller's computer: identity, clock, network, backups, jobs, systems, options."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import httpx

from abb_protocols.catalogue import message
from abb_protocols.errors import ControllerRefused, NoConnection, ProtocolError
from abb_protocols.rws.documents import SystemInfo
from abb_protocols.rws.operations import ctrl as table
from abb_protocols.rws.operations.ctrl import ControllerIdentity
from abb_protocols.rws.operations.operation import Operation
from abb_runtime.rws.services.service import Service
from abb_runtime.rws.session import OnProgress, file_path

_JOB_POLL = 0.5  # [s]
_JOB_DEADLINE = 600.0  # [s]
_PROGRESS = re.compile(r"/progress/([\w-]+)")


@dataclass(frozen=True, slots=True)
class NetworkPort:
    """A network port of the controller."""

    name: str
    address: str
    mask: str


class ControllerService(Service):
    """``/ctrl`` and ``/progress``."""

    def identity(self) -> ControllerIdentity:
        """Name, serial number and kind of the controller."""
        return self._answer("reading the identity", table.IDENTITY)

    def set_identity(self, *, name: str | None = None, id: str | None = None) -> None:
        """Change the controller's name or id."""
        self._call("changing the identity", table.SET_IDENTITY, ctrl_name=name, ctrl_id=id)

    def environment(self, variable: str) -> str:
        """What an environment variable such as ``HOME`` stands for."""
        return self._answer(f"reading ${variable}", table.ENVIRONMENT, variable)

    def set_controller_language(self, code: str) -> None:
        """Language of the messages, such as ``en``."""
        self._call("setting the language", table.SET_LANGUAGE, lang=code)

    def restart_controller(self, mode: str = "restart") -> None:
        """Restart the controller's computer.

        Args:
            mode: ``restart``, ``istart``, ``pstart``, ``bstart`` as in ``restart``; or ``shutdown``, ``xstart``, after
                which a person has to switch it on.
        """
        self._call("restarting the controller", table.RESTART, restart_mode=mode)

    # Clock

    def clock(self) -> datetime:
        """Its local time; the controller does not say in which zone."""
        return self._answer("reading the clock", table.CLOCK)

    def set_clock(self, time: datetime) -> None:
        """Set the controller's local time."""
        parts = {"year": time.year, "month": time.month, "day": time.day}
        parts |= {"hour": time.hour, "min": time.minute, "sec": time.second}
        self._call("setting the clock", table.SET_CLOCK, **{f"sys_clock_{name}": part for name, part in parts.items()})

    def timezone(self) -> str:
        """Time zone, such as ``Europe/Stockholm``."""
        return self._answer("reading the time zone", table.TIMEZONE)

    def set_timezone(self, name: str) -> None:
        """Set the time zone."""
        self._call("setting the time zone", table.SET_TIMEZONE, timezone=name)

    def time_server(self) -> str:
        """Address of the NTP server, "" for none."""
        return self._answer("reading the time server", table.TIMESERVER)

    def set_time_server(self, address: str) -> None:
        """Take the time from an NTP server."""
        self._call("setting the time server", table.SET_TIMESERVER, timeserver=address)

    # Network

    def network_ports(self) -> tuple[NetworkPort, ...]:
        """The controller's network ports."""
        states = self._listed("reading the network", table.NETWORK)
        return tuple(NetworkPort(state.text("name"), state.text("addr"), state.text("mask")) for state in states)

    def set_network(self, method: str, address: str = "", mask: str = "", gateway: str = "") -> None:
        """Address of the WAN port, after a restart; ``method`` is ``fixip``, ``dhcp`` or ``noip``."""
        rest = {"address": address or None, "mask": mask or None, "gateway": gateway or None}
        self._call("setting the network", table.SET_NETWORK, method=method, **rest)

    def name_server(self) -> str:
        """Address of the DNS server, "" for none."""
        return self._shown("reading the name server", table.DNS).one("ctrl-netw").text("addr")

    def routes(self) -> dict[str, str]:
        """Gateways by destination."""
        return {each.destination: each.gateway for each in self._answers("reading the routes", table.ROUTES)}

    def add_route(self, destination: str, gateway: str) -> None:
        """Send what goes to a network such as ``10.1.0.0/16`` to a gateway."""
        self._call("adding a route", table.ADD_ROUTE, destination=destination, gateway=gateway)

    def remove_route(self, destination: str) -> None:
        """Remove a route."""
        self._call("removing a route", table.REMOVE_ROUTE, destination=destination)

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
        self._job(f"making the backup {name}", on_progress, table.BACK_UP, backup=f"/fileservice/$BACKUP/{name}")
        return f"BACKUP:/{name}"

    def restore(self, name: str) -> None:
        """Have the controller become as in the backup ``name`` in BACKUP; it restarts, see ``wait_for_restart``."""
        self._call(f"restoring the backup {name}", table.RESTORE, backup=f"/fileservice/$BACKUP/{name}")

    def backup_state(self) -> str:
        """What has become of the last backup, such as ``None`` or ``Backup Ready``."""
        return self._answer("reading the backup", table.BACKUP_STATE)

    def can_restore(self, name: str) -> bool:
        """Whether a backup in BACKUP is of this system."""
        return self._answer(f"checking the backup {name}", table.CHECK_RESTORE, backup=f"$BACKUP/{name}")

    def backup_system(self, name: str) -> str:
        """Name of the system that a backup in BACKUP is of."""
        return self._answer(f"reading {name}", table.BACKUP_INFO, backup_path=f"/fileservice/$BACKUP/{name}")

    def compress(self, source: str, target: str, on_progress: OnProgress = lambda text: None) -> None:
        """Pack a file or directory of the controller into a directory of it."""
        paths = {"srcpath": file_path(source), "dstpath": file_path(target)}
        self._job(f"packing {source}", on_progress, table.COMPRESS, **paths)

    def decompress(self, source: str, target: str, on_progress: OnProgress = lambda text: None) -> None:
        """Unpack a file of the controller into a directory of it."""
        paths = {"srcpath": file_path(source), "dstpath": file_path(target)}
        self._job(f"unpacking {source}", on_progress, table.DECOMPRESS, **paths)

    def save_diagnostics(self, path: str, on_progress: OnProgress = lambda text: None) -> None:
        """Write what ABB's support asks for to a file of the controller."""
        self._job("saving the diagnostics", on_progress, table.SAVE_DIAGNOSTICS, dstpath=file_path(path))

    def _job(self, what: str, on_progress: OnProgress, operation: Operation[Any], /, **arguments: object) -> None:
        """Have the controller begin a job, and wait until it has ended.

        Raises:
            ControllerRefused: it cannot, or the job failed.
            NoConnection: it does not end in time.
            ProtocolError: the controller does not say where its progress is.
        """
        reply = self._call(what, operation, **arguments)
        found = _PROGRESS.search(reply.headers.get("Location", ""))
        if found is None and reply.status_code == httpx.codes.ACCEPTED:
            raise ProtocolError(message("job_without_progress", address=self.address, what=what))
        start = self._clock.now()
        while found is not None:
            state = self._first(what, table.PROGRESS, found[1])
            on_progress(state.state)
            if not state.is_pending:
                if state.code not in (0, table.JOB_DONE):
                    said = message("job_failed", address=self.address, what=what, state=state.state)
                    raise ControllerRefused(said, status=0, code=state.code)
                break
            if self._clock.now() - start > _JOB_DEADLINE:
                raise NoConnection(message("job_not_ended", address=self.address, what=what, deadline=_JOB_DEADLINE))
            self._clock.wait(_JOB_POLL)

    # Installed systems

    def systems(self) -> tuple[str, ...]:
        """Names of the installed systems."""
        return tuple(state.title for state in self._listed("reading the systems", table.SYSTEMS))

    def installed_system(self, name: str) -> SystemInfo:
        """One of the installed systems."""
        found = self._answer(f"reading the system {name}", table.SYSTEM, name)
        version = tuple(int(part) for part in found.version.split(".") if part.isdecimal())
        return SystemInfo(found.name, version, (), found.id)

    def rename_system(self, name: str, to: str) -> None:
        """Give an installed system another name."""
        self._call(f"renaming {name}", table.RENAME_SYSTEM, name, newname=to)

    def has_option(self, option: str) -> bool:
        """Whether the system has an option, named as in ``system().options``."""
        return self._call(f"asking for {option}", table.OPTION, option).status_code == httpx.codes.OK

    def is_compatible(self, version: str = "") -> bool:
        """Whether clients for a version of RobotWare, or for the present one, can be used."""
        what = "asking for the version"
        return self._answer(what, table.COMPATIBILITY, version) if version else self._answer(what, table.COMPATIBLE)

    def has_safety_controller(self) -> bool:
        """Whether there is a safety controller (SafeMove)."""
        return bool(self._listed("reading the safety controller", table.SAFETY))
