"""The I/O system: signals, who may write them, and their edges (reference/rws.md §7)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from enum import Enum

from yumi.virtual.controller.configuration import Configuration
from yumi.virtual.controller.errors import Refusal, Refused

OnChange = Callable[[str, float, float], None]
"""Called with name, old and new value, before the write returns."""


class SignalType(Enum):
    """Digital, analog or group; input or output."""

    DI = "DI"
    DO = "DO"
    AI = "AI"
    AO = "AO"
    GI = "GI"
    GO = "GO"

    @property
    def is_output(self) -> bool:
        return self.value.endswith("O")

    @property
    def is_digital(self) -> bool:
        return self.value.startswith("D")


@dataclass(frozen=True, slots=True)
class Signal:
    """A signal as it is now.

    Attributes:
        name: its name.
        type: kind and direction.
        category: what the configuration calls it, often empty.
        access: ``All`` lets clients write; ``Default`` and ``ReadOnly`` do not.
        value: 0 or 1 for digital signals, a whole number for groups.
        device: the device it is on; empty for a virtual signal.
        network: the network the device is on; empty for a virtual signal.
    """

    name: str
    type: SignalType
    category: str
    access: str
    value: float
    device: str
    network: str = ""


class Signals:
    """All signals, found in any letter case; a change is announced at once, so that no edge is ever missed."""

    def __init__(self, signals: Iterable[Signal], on_change: OnChange) -> None:
        self._signals = {signal.name.lower(): signal for signal in signals}
        self._on_change = on_change
        self._defaults = {signal.name: signal.value for signal in self._signals.values()}

    @classmethod
    def configured(cls, configuration: Configuration, on_change: OnChange) -> Signals:
        """The signals the configuration declares, at their default values."""
        kinds = ("ETHERNETIP_DEVICE", "DEVICENET_DEVICE")
        devices = [device for kind in kinds for device in configuration.instances("EIO", kind)]
        networks = {device.name: device.attributes["Network"] for device in devices}
        signals = []
        for instance in configuration.instances("EIO", "EIO_SIGNAL"):
            attributes = instance.attributes
            signals.append(
                Signal(
                    name=instance.name,
                    type=SignalType(attributes["SignalType"]),
                    category=attributes["Category"],
                    access=attributes["Access"],
                    value=float(attributes["Default"]),
                    device=attributes["Device"],
                    network=networks.get(attributes["Device"], ""),
                )
            )
        return cls(signals, on_change)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(signal.name for signal in self._signals.values())

    def get(self, name: str) -> Signal:
        """The signal as it is now.

        Raises:
            Refused: UNKNOWN.
        """
        signal = self._signals.get(name.lower())
        if signal is None:
            raise Refused(Refusal.UNKNOWN, f"there is no signal {name}.")
        return signal

    def set(self, name: str, value: float) -> None:
        """Write a signal as a client does.

        Raises:
            Refused: UNKNOWN, READ_ONLY when the access level does not let clients write, OUT_OF_RANGE.
        """
        signal = self.get(name)
        if signal.access.upper() != "ALL":
            raise Refused(
                Refusal.READ_ONLY,
                f"signal {name} has access level {signal.access}; clients write those with All.",
            )
        self.drive(name, value)

    def drive(self, name: str, value: float) -> None:
        """Write a signal as the controller itself or a device does, whatever its access level.

        Raises:
            Refused: UNKNOWN or OUT_OF_RANGE.
        """
        signal = self.get(name)
        if signal.type.is_digital and value not in (0, 1):
            raise Refused(Refusal.OUT_OF_RANGE, f"signal {signal.name} is digital: 0 or 1, not {value:g}.")
        if value != signal.value:
            self._signals[signal.name.lower()] = replace(signal, value=value)
            self._on_change(signal.name, signal.value, value)

    def restore_defaults(self) -> None:
        """Give the signals that are on no device the value they start with."""
        for name, value in self._defaults.items():
            if not self.get(name).device:
                self.drive(name, value)


def path_of(signal: Signal) -> str:
    """Network, device and name, as far as it has them."""
    return "/".join(part for part in (signal.network, signal.device, signal.name) if part)


def printed(value: float) -> str:
    """A value as the controller prints it: whole numbers without decimals."""
    return str(int(value)) if value == int(value) else repr(value)
