"""The controller's disk, and what else of the controller RAPID programs find: system parameters, I/O devices, names.

Files are known by the path RAPID gives them, such as ``HOME:/yumi/TRobMain.mod``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, MutableMapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from yumi.rapid.devices import Devices, Entry, LoggedEvent, NoNetwork
from yumi.rapid.program import Severity
from yumi.rapid.task import Task
from yumi.rws.types import EventType
from yumi.virtual.controller.events import Event, EventLog, Refusal, Refused
from yumi.virtual.controller.signals import Configuration, Instance, Signals

if TYPE_CHECKING:
    from yumi.virtual.controller.system import Identity, Robot

DEVICES = ("HOME", "TEMP", "BACKUP", "RAMDISK")
ENCODING = "latin-1"
"""Of RAPID's files, unless they are UTF-8."""

CAPACITY = 64 * 1024 * 1024
"""Of all devices together [bytes]."""

MOST_FILES = 1000
"""Files and directories of all devices together."""

LONGEST_PATH = 1000
"""Characters."""


def decoded(content: bytes) -> str:
    """The text of a file: UTF-8 when it is, Latin-1 otherwise; RobotStudio writes either."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode(ENCODING)


def encoded(text: str) -> bytes:
    """A file with the text: Latin-1 where it has the characters, UTF-8 otherwise."""
    try:
        return text.encode(ENCODING)
    except UnicodeEncodeError:
        return text.encode("utf-8")


@dataclass(frozen=True, slots=True)
class File:
    """One file or directory.

    Attributes:
        path: as it was written first.
        content: its bytes; None for a directory.
        changed: when it was written, on the controller's clock [s].
    """

    path: str
    content: bytes | None
    changed: float

    @property
    def name(self) -> str:
        """The last part of the path."""
        return self.path.rpartition("/")[2]


class FileStore(MutableMapping[str, str]):
    """Files, found in any letter case; as a mapping it shows their texts.

    Args:
        files: texts or contents by path.
        now: the controller's clock [s].
    """

    def __init__(self, files: Mapping[str, str] | Mapping[str, bytes], now: Callable[[], float] = lambda: 0.0) -> None:
        self._now = now
        self._files: dict[str, File] = {}
        for device in DEVICES:
            self._put(f"{device}:", None)
        for path, given in files.items():
            self.write(path, given if isinstance(given, bytes) else encoded(given))

    def __getitem__(self, path: str) -> str:
        content = self._files[_key(path)].content
        if content is None:
            raise KeyError(path)
        return decoded(content)

    def __setitem__(self, path: str, text: str) -> None:
        self.write(path, encoded(text))

    def __delitem__(self, path: str) -> None:
        del self._files[_key(path)]

    def __iter__(self) -> Iterator[str]:
        return (file.path for file in tuple(self._files.values()) if file.content is not None)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    @property
    def used(self) -> int:
        """Of the capacity [bytes]."""
        return sum(map(_size, self._files.values()))

    def get_file(self, path: str) -> File:
        """A file or directory.

        Raises:
            Refused: NO_FILE.
        """
        found = self._files.get(_key(path))
        if found is None:
            raise Refused(Refusal.NO_FILE, f"there is no file {path}.")
        return found

    def entries(self, path: str) -> tuple[File, ...]:
        """What is in a directory, by name.

        Raises:
            Refused: NO_FILE.
        """
        place = _key(self.get_file(path).path)
        inside = (file for key, file in self._files.items() if key.rpartition("/")[0] == place)
        return tuple(sorted(inside, key=lambda file: file.name.lower()))

    def write(self, path: str, content: bytes) -> bool:
        """Create or replace a file; whether it is new. Directories on the way come into being.

        Raises:
            Refused: NO_FILE for an unknown device, BAD_VALUE where a directory has the name, NO_SPACE.
        """
        known = self._files.get(_key(path))
        if known is not None and known.content is None:
            raise Refused(Refusal.BAD_VALUE, f"{path} is a directory.")
        if known is None:
            self._check_space(len(content))
        else:
            self._check_space(len(content) - _size(known), files=0)
        self.make_directory(_clean(path).rpartition("/")[0])
        self._put(path, content)
        return known is None

    def make_directory(self, path: str) -> None:
        """Create a directory and those above it; nothing happens when it is there.

        Raises:
            Refused: NO_FILE for an unknown device, BAD_VALUE where a file has the name, NO_SPACE.
        """
        found = self._files.get(_key(path))
        if found is not None and found.content is not None:
            raise Refused(Refusal.BAD_VALUE, f"{path} is a file.")
        if found is None:
            above = _clean(path).rpartition("/")[0]
            if not above:
                raise Refused(Refusal.NO_FILE, f"there is no device {path!r}.")
            self.make_directory(above)
            self._put(path, None)

    def remove(self, path: str) -> None:
        """Remove a file, or a directory with what is in it.

        Raises:
            Refused: NO_FILE, READ_ONLY for a device.
        """
        place = _key(self.get_file(path).path)
        if "/" not in place:
            raise Refused(Refusal.READ_ONLY, f"the device {path} cannot be removed.")
        for key in [key for key in self._files if key == place or key.startswith(f"{place}/")]:
            del self._files[key]

    def copy(self, path: str, to: str) -> None:
        """Copy a file or a directory with what is in it, over what has the name.

        Raises:
            Refused: NO_FILE, NO_SPACE.
        """
        source, target = _clean(self.get_file(path).path), _clean(to)
        inside = [file for key, file in self._files.items() if f"{key}/".startswith(f"{_key(source)}/")]
        self._check_space(sum(map(_size, inside)), len(inside))
        for file in inside:
            moved = f"{target}{_clean(file.path)[len(source) :]}"
            self._files[_key(moved)] = replace(file, path=moved, changed=self._now())

    def _check_space(self, more: int, files: int = 1) -> None:
        used = self.used
        if used + more > CAPACITY or len(self._files) + files > MOST_FILES:
            raise Refused(
                Refusal.NO_SPACE,
                f"the disk is full: it has {CAPACITY} bytes and {MOST_FILES} files, {used} and {len(self._files)} are "
                "in use; delete some.",
            )

    def _put(self, path: str, content: bytes | None) -> None:
        if len(path) > LONGEST_PATH:
            raise Refused(Refusal.BAD_VALUE, f"a path has up to {LONGEST_PATH} characters, not {len(path)}.")
        if content is None and self._files.get(_key(path)) is None:
            self._check_space(0)
        self._files[_key(path)] = File(_clean(path), content, self._now())


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
        self._find(_clean(path).rpartition("/")[0])
        with _os_errors():
            self._files.write(path, content)

    def entry(self, path: str) -> Entry:
        """The file or directory of that path."""
        file = self._find(path)
        return Entry(file.name, file.content is None, _size(file), file.changed)

    def entries(self, path: str) -> tuple[Entry, ...]:
        """What is in a directory."""
        if self._find(path).content is not None:
            raise NotADirectoryError(f"{path} is a file.")
        return tuple(Entry(e.name, e.content is None, _size(e), e.changed) for e in self._files.entries(path))

    def make_directory(self, path: str) -> None:
        """Create a directory in another one."""
        self._check_free(path)
        self._find(_clean(path).rpartition("/")[0])
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
        self._find(_clean(to).rpartition("/")[0])
        with _os_errors():
            self._files.copy(path, to)
            self._files.remove(path)

    def space(self) -> tuple[int, int]:
        """Size of the disk, and what is free of it [bytes]."""
        return CAPACITY, CAPACITY - self._files.used

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


@contextmanager
def _os_errors() -> Iterator[None]:
    try:
        yield
    except Refused as refused:
        raise OSError(str(refused)) from refused


def _size(file: File) -> int:
    return len(file.content or b"")


def _clean(path: str) -> str:
    """The path as the store has it: ``$HOME/x`` and ``HOME:x`` are ``HOME:/x``."""
    path = path.rstrip("/")
    if path.startswith("$"):
        device, slash, rest = path[1:].partition("/")
        path = f"{device.upper().rstrip(':')}:{slash}{rest}"
    device, colon, rest = path.partition(":")
    return f"{device}:/{rest}" if colon and rest and not rest.startswith("/") else path


def _key(path: str) -> str:
    return _clean(path).lower()


_CFG_PARTS = 3  # /DOMAIN/TYPE/instance
_EVENT_TYPES = {
    Severity.ERROR: EventType.ERROR,
    Severity.WARNING: EventType.WARNING,
    Severity.INFORMATION: EventType.INFORMATION,
}
_BIT_RANGE = re.compile(r"(\d+)(?:\s*-\s*(\d+))?")
_MOST_BITS = 32
"""Of a group signal."""


class SystemParameters:
    """The configuration as ReadCfgData and WriteCfgData name it (:class:`yumi.rapid.devices.Configuration`)."""

    def __init__(self, configuration: Configuration) -> None:
        self._configuration = configuration

    def read(self, path: str, attribute: str) -> str:
        """An attribute of an instance; raises KeyError."""
        return self._instance(path)[1].attributes[attribute]

    def write(self, path: str, attribute: str, value: str) -> None:
        """Change an attribute that exists; raises KeyError."""
        (domain, type_name), instance = self._instance(path)
        if attribute not in instance.attributes:
            raise KeyError(attribute)
        self._configuration.change(domain, type_name, instance.name, {attribute: value})

    def save(self, domain: str) -> str:
        """The domain as a cfg file; raises KeyError."""
        if domain.upper() not in self._configuration.domains:
            raise KeyError(domain)
        lines = [f"{domain.upper()}:CFG_1.0:6:1::", "#"]
        for type_name in self._configuration.types(domain):
            lines += ["", f"{type_name}:", ""]
            for instance in self._configuration.instances(domain, type_name):
                lines.append("      " + " ".join(f'-{key} "{value}"' for key, value in instance.attributes.items()))
        return "\n".join(lines) + "\n"

    def _instance(self, path: str) -> tuple[tuple[str, str], Instance]:
        parts = path.strip("/").split("/")
        found = self._configuration.find(*parts) if len(parts) == _CFG_PARTS else None
        if found is None:
            raise KeyError(path)
        return (parts[0], parts[1]), found


class IoUnits:
    """The devices that signals are on (:class:`yumi.rapid.devices.IoDevices`)."""

    def __init__(self, configuration: Configuration, signals: Signals) -> None:
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
    configuration: Configuration,
    signals: Signals,
    identity: Identity,
    robot: Robot,
    events: EventLog,
    *,
    now: Callable[[], float],
    tasks: Callable[[], Mapping[str, Task]],
    restart: Callable[[], None],
) -> Devices:
    """What all tasks of a controller share; it has no network until one is given to it."""

    def log(number: int, title: str, text: str, severity: Severity, arguments: tuple[str, ...]) -> None:
        events.append(number, title, text, _EVENT_TYPES[severity], arguments=arguments)

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

    def show(event: Event) -> None:
        severity = next(severity for severity, type_ in _EVENT_TYPES.items() if type_ is event.type)
        number = event.code % 10_000
        logged = LoggedEvent(event.domain, number, severity, event.title, event.description, event.arguments)
        for watcher in tuple(devices.watchers):
            watcher(logged)

    events.watchers.append(show)
    return devices
