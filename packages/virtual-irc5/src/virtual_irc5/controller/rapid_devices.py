"""Devices of RAPID programs on this controller: disk, I/O devices, system parameters, names, and the event log."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

from abb_protocols.rws.values import EventType
from virtual_irc5.controller.file_store import DISK_CAPACITY, File, FileStore, clean_path
from virtual_irc5.controller.identity import Identity
from virtual_irc5.controller.installed_system import InstalledRobot
from virtual_irc5.controller.signals import Signals
from virtual_irc5.controller_log import ControllerEventLog, ControllerLogEvent, Refused
from virtual_irc5.rapid.devices import Devices, DiskEntry, LoggedEvent, NoNetwork
from virtual_irc5.rapid.states import Severity
from virtual_irc5.rapid.task import Task
from virtual_irc5.system_parameters import SystemConfiguration, SystemParameters

_BIT_RANGE = re.compile(r"(\d+)(?:\s*-\s*(\d+))?")
_MOST_BITS = 32
"""Of a group signal."""


class RapidDisk:
    """The files as RAPID's instructions see them; what the store refuses is an OSError (:class:`Disk`)."""

    def __init__(self, files: FileStore) -> None:
        self._files = files

    def read(self, path: str) -> bytes:
        """The content of a file."""
        content = self._find(path).content
        if content is None:
            raise IsADirectoryError(f"{path} is a directory.")
        return content

    def write(self, path: str, content: bytes) -> None:
        """Create or replace a file in a directory that exists."""
        self._find(clean_path(path).rpartition("/")[0])
        with _os_errors():
            self._files.write(path, content)

    def entry(self, path: str) -> DiskEntry:
        """The file or directory of that path."""
        return _entry(self._find(path))

    def entries(self, path: str) -> tuple[DiskEntry, ...]:
        """What is in a directory."""
        if self._find(path).content is not None:
            raise NotADirectoryError(f"{path} is a file.")
        return tuple(map(_entry, self._files.entries(path)))

    def make_directory(self, path: str) -> None:
        """Create a directory in another one."""
        self._check_free(path)
        self._find(clean_path(path).rpartition("/")[0])
        with _os_errors():
            self._files.make_directory(path)

    def remove(self, path: str) -> None:
        """Remove a file, or a directory with what is in it."""
        self._find(path)
        with _os_errors():
            self._files.remove(path)

    def copy(self, path: str, to: str) -> None:
        """Copy a file."""
        self.write(to, self.read(path))

    def rename(self, path: str, to: str) -> None:
        """Give a file or directory another path."""
        self._check_free(to)
        self._find(path)
        self._find(clean_path(to).rpartition("/")[0])
        with _os_errors():
            self._files.copy(path, to)
            self._files.remove(path)

    def space(self) -> tuple[int, int]:
        """Size of the disk, and what is free of it [bytes]."""
        return DISK_CAPACITY, DISK_CAPACITY - self._files.used

    def _find(self, path: str) -> File:
        try:
            return self._files.get_file(path)
        except Refused as refused:
            raise FileNotFoundError(str(refused)) from refused

    def _check_free(self, path: str) -> None:
        try:
            self._files.get_file(path)
        except Refused:
            return
        raise FileExistsError(f"{path} exists already.")


def _entry(file: File) -> DiskEntry:
    return DiskEntry(file.name, file.content is None, file.size, file.changed)


@contextmanager
def _os_errors() -> Iterator[None]:
    try:
        yield
    except Refused as refused:
        raise OSError(str(refused)) from refused


class IoUnits:
    """The devices that signals are on (:class:`virtual_irc5.rapid.devices.IoDevices`)."""

    def __init__(self, configuration: SystemConfiguration, signals: Signals) -> None:
        self._configuration = configuration
        self._signals = signals

    def device_of(self, signal: str) -> str:
        """The device of a signal."""
        return self._attributes(signal).get("Device", "")

    def type_of(self, signal: str) -> str:
        """The signal's type."""
        return self._attributes(signal).get("SignalType", "DI")

    def limits(self, signal: str) -> tuple[float, float]:
        """What a group of bits or an analog signal takes."""
        attributes = self._attributes(signal)
        if attributes.get("SignalType") in ("GI", "GO"):
            pieces = _BIT_RANGE.findall(attributes.get("DeviceMap", ""))
            bits = sum(int(last or first) - int(first) + 1 for first, last in pieces) or _MOST_BITS
            return 0.0, float(2 ** min(bits, _MOST_BITS) - 1)
        if attributes.get("SignalType") in ("AI", "AO") and float(attributes.get("MaxLog", "0")):
            return float(attributes.get("MinLog", "0")), float(attributes["MaxLog"])
        return -math.inf, math.inf

    def devices(self) -> Mapping[str, str]:
        """The network of each device."""
        kinds = ("ETHERNETIP_DEVICE", "DEVICENET_DEVICE", "PROFINET_DEVICE")
        found = (each for kind in kinds for each in self._configuration.instances("EIO", kind))
        return {each.name: each.attributes.get("Network", "") for each in found}

    def _attributes(self, signal: str) -> Mapping[str, str]:
        """Of the signal's instance; none for a signal that the controller has by itself."""
        found = self._configuration.find("EIO", "EIO_SIGNAL", signal)
        if found is not None:
            return found.attributes
        for instance in self._configuration.instances("EIO", "EIO_SIGNAL"):
            if instance.name.lower() == signal.lower():
                return instance.attributes
        return {}


def rapid_devices(
    files: FileStore,
    configuration: SystemConfiguration,
    signals: Signals,
    identity: Identity,
    robot: InstalledRobot,
    events: ControllerEventLog,
    *,
    now: Callable[[], float],
    tasks: Callable[[], Mapping[str, Task]],
    restart: Callable[[], None],
) -> Devices:
    """What all tasks of a controller share; it has no network until one is given to it."""

    def log(number: int, title: str, text: str, severity: Severity, arguments: tuple[str, ...]) -> None:
        events.append(number, title, text, EventType(severity.value), arguments=arguments)

    devices = Devices(
        RapidDisk(files),
        NoNetwork(),
        facts={
            "SerialNo": robot.serial_number,
            "SWVersion": f"ROBOTWARE_{identity.robotware}",
            "SWVersionName": identity.robotware,
            "RobotType": robot.type_name,
            "CtrlId": identity.controller_name,
            "LanIp": "192.168.125.1",
            "CtrlLang": "en",
            "SystemName": identity.system_name,
            "SystemId": identity.system_id,
            "UserName": "Default User",
        },
        time=now,
        tasks=tasks,
        io=IoUnits(configuration, signals),
        configuration=SystemParameters(configuration),
        restart=restart,
        log=log,
    )

    def show(event: ControllerLogEvent) -> None:
        number, severity = event.code % 10_000, Severity(event.type.value)
        logged = LoggedEvent(event.domain, number, severity, event.title, event.description, event.arguments)
        for watcher in tuple(devices.watchers):
            watcher(logged)

    events.watchers.append(show)
    return devices
