"""What RAPID programs find on the virtual controller: its files, system parameters, I/O devices and names."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping

from yumi.rapid.devices import Devices, LoggedEvent, NoNetwork
from yumi.rapid.program import Severity
from yumi.rapid.task import Task
from yumi.rws.types import EventType
from yumi.virtual.controller.events import Event, EventLog
from yumi.virtual.controller.files import FileStore, RapidDisk
from yumi.virtual.controller.signals import Configuration, Instance, Signals
from yumi.virtual.controller.units import Identity

_CFG_PARTS = 3  # /DOMAIN/TYPE/instance
_TYPES = {
    Severity.ERROR: EventType.ERROR,
    Severity.WARNING: EventType.WARNING,
    Severity.INFORMATION: EventType.INFORMATION,
}
_BITS = re.compile(r"(\d+)(?:\s*-\s*(\d+))?")
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
            pieces = _BITS.findall(attributes.get("DeviceMap", ""))
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
    events: EventLog,
    *,
    now: Callable[[], float],
    tasks: Callable[[], Mapping[str, Task]],
    restart: Callable[[], None],
) -> Devices:
    """What all tasks of a controller share; it has no network until one is given to it."""

    def log(number: int, title: str, text: str, severity: Severity, arguments: tuple[str, ...]) -> None:
        events.append(number, title, text, _TYPES[severity], arguments=arguments)

    devices = Devices(
        RapidDisk(files),
        NoNetwork(),
        facts={
            "SerialNo": "14000-500000",
            "SWVersion": f"ROBOTWARE_{identity.robotware}",
            "RobotType": "14000-0.5/0.5",
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
        severity = next(severity for severity, type_ in _TYPES.items() if type_ is event.type)
        number = event.code % 10_000
        logged = LoggedEvent(event.domain, number, severity, event.title, event.description, event.arguments)
        for watcher in tuple(devices.watchers):
            watcher(logged)

    events.watchers.append(show)
    return devices
