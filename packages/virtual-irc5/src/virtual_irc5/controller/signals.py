"""The I/O signals of the controller by the system parameters, and cross connections (reference/rws.md §7)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

from abb_protocols.rws.values import SignalType
from virtual_irc5.controller_log import RefusalReason, Refused
from virtual_irc5.system_parameters import NETWORKS, SystemConfiguration, Value


@dataclass(frozen=True, slots=True)
class CrossConnection:
    """A signal that follows up to five others (EIO_CROSS); AND comes before OR.

    Attributes:
        resultant: name of the signal that follows.
        terms: of which one has to be fulfilled: in each, all signals with whether they are inverted.
    """

    resultant: str
    terms: tuple[tuple[tuple[str, bool], ...], ...]

    @classmethod
    def of(cls, attributes: Mapping[str, Value]) -> CrossConnection:
        """From system parameters."""
        terms: list[list[tuple[str, bool]]] = [[]]
        for number in range(1, _MOST_ACTORS + 1):
            if name := attributes.get(f"Act{number}", ""):
                terms[-1].append((name, f"Act{number}_invert" in attributes))
            if attributes.get(f"Oper{number}", "").upper() == "OR":
                terms.append([])
        return cls(attributes["Res"], tuple(tuple(term) for term in terms if term))

    @property
    def actors(self) -> frozenset[str]:
        """The names of the signals that it follows, in lower case."""
        return frozenset(name.lower() for term in self.terms for name, _ in term)

    def value(self, read: Callable[[str], float]) -> float:
        """The resultant's value; of a single signal its own, so that groups may be connected."""
        if len(self.terms) == 1 and len(self.terms[0]) == 1:
            ((name, inverted),) = self.terms[0]
            return float(not read(name)) if inverted else read(name)
        return float(any(all(bool(read(name)) is not inverted for name, inverted in term) for term in self.terms))


DRIVE_SIGNALS: Mapping[str, SignalType] = {
    "DRV1K1": SignalType("DI"),
    "DRV1K2": SignalType("DI"),
    "DRV1BRAKEFB": SignalType("DI"),
    "DRV1BRAKE": SignalType("DO"),
    "DRV1CHAIN1": SignalType("DO"),
    "DRV1CHAIN2": SignalType("DO"),
}
"""Of the drive module, which every controller has beside the configured ones: contactors, brakes and run chains; all
are 1 while the motors are on."""

_MOST_ACTORS = 5
_DEEPEST_CROSS = 20  # connections that lead from one signal to the next, as on a controller

_OnChange = Callable[[str, float, float], None]
"""Called with name, old and new value, before the write returns."""


@dataclass(frozen=True, slots=True)
class ControllerSignal:
    """A signal as it is now.

    Attributes:
        name: its name.
        type: kind and direction.
        category: what the configuration calls it, often empty.
        access: ``All`` lets clients write; ``Default`` and ``ReadOnly`` do not.
        value: 0 or 1 for digital signals, a whole number for groups.
        device: the device it is on; empty for a virtual signal.
        network: the network the device is on; empty for a virtual signal.
        physical: what the device has, while the signal is simulated; None where that is the value itself.
    """

    name: str
    type: SignalType
    category: str
    access: str
    value: float
    device: str
    network: str = ""
    physical: float | None = None

    @property
    def is_simulated(self) -> bool:
        """Whether its value is a client's and not the device's."""
        return self.physical is not None


class Signals:
    """All signals, found in any letter case; a change is announced at once, so that no edge is ever missed.

    Attributes:
        disabled: devices that have been disabled.
        stopped: networks that have been stopped.
        rejected: why cross connections of the configuration do nothing.
    """

    def __init__(self, signals: Iterable[ControllerSignal], on_change: _OnChange) -> None:
        self._signals = {signal.name.lower(): signal for signal in signals}
        self._on_change = on_change
        self._crosses: dict[str, list[CrossConnection]] = {}  # by actor
        self._depth = 0
        self.rejected: list[str] = []
        self.disabled: set[str] = set()
        self.stopped: set[str] = set()
        self._defaults = {signal.name: signal.value for signal in self._signals.values()}

    def configure(self, configuration: SystemConfiguration) -> None:
        """Become the signals the configuration declares, at their default values; those on a device keep theirs."""
        devices = [(kind, device) for kind in NETWORKS for device in configuration.instances("EIO", kind)]
        networks = {device.name: device.attributes.get("Network", NETWORKS[kind]) for kind, device in devices}
        known, self._signals, self._defaults = self._signals, {}, {}
        for instance in configuration.instances("EIO", "EIO_SIGNAL"):
            attributes = instance.attributes
            default = float(attributes["Default"])
            before = known.get(instance.name.lower())
            self._defaults[instance.name] = default
            self._signals[instance.name.lower()] = ControllerSignal(
                name=instance.name,
                type=SignalType(attributes["SignalType"].upper()),
                category=attributes["Category"],
                access=attributes["Access"],
                value=before.value if before is not None and before.device else default,
                device=attributes["Device"],
                network=networks.get(attributes["Device"], ""),
            )
        for name, type_ in DRIVE_SIGNALS.items():
            if name.lower() not in self._signals:
                value = known[name.lower()].value if name.lower() in known else 0.0
                self._signals[name.lower()] = ControllerSignal(
                    name, type_, "safety", "ReadOnly", value, "DRV_1", "Local"
                )
        self._crosses, self.rejected = {}, []
        crosses = []
        for cross in (CrossConnection.of(each.attributes) for each in configuration.instances("EIO", "EIO_CROSS")):
            unknown = [name for name in (cross.resultant, *sorted(cross.actors)) if name not in self]
            if unknown:
                self.rejected.append(
                    f"The cross connection of {cross.resultant} names {unknown[0]}, which is no signal."
                )
                continue
            crosses.append(cross)
            for actor in cross.actors:
                self._crosses.setdefault(actor, []).append(cross)
        for cross in crosses * min(len(crosses), _DEEPEST_CROSS):  # at the start nothing is announced
            resultant = self.get(cross.resultant)
            value = cross.value(lambda name: self.get(name).value)
            self._signals[resultant.name.lower()] = replace(resultant, value=value)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(signal.name for signal in self._signals.values())

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name.lower() in self._signals

    def get(self, name: str) -> ControllerSignal:
        """The signal as it is now.

        Raises:
            Refused: UNKNOWN.
        """
        signal = self._signals.get(name.lower())
        if signal is None:
            raise Refused(RefusalReason.UNKNOWN, f"there is no signal {name}.")
        return signal

    def set(self, name: str, value: float) -> None:
        """Write a signal as a client does.

        Raises:
            Refused: UNKNOWN, READ_ONLY when the access level does not let clients write, OUT_OF_RANGE.
        """
        signal = self.get(name)
        if signal.access.upper() != "ALL":
            raise Refused(
                RefusalReason.READ_ONLY,
                f"signal {name} has access level {signal.access}; clients write those with All.",
            )
        if signal.device in self.disabled or signal.network in self.stopped:
            raise Refused(RefusalReason.NOT_STOPPED, f"the device {signal.device} of signal {name} does not run.")
        if signal.is_simulated:
            self.simulate(name, value)
        else:
            self.drive(name, value)

    def simulate(self, name: str, value: float | None) -> None:
        """Give a signal a value of a client's own, whatever its device says; None ends that.

        Raises:
            Refused: UNKNOWN or OUT_OF_RANGE.
        """
        signal = self.get(name)
        physical = signal.value if signal.physical is None else signal.physical
        self._signals[signal.name.lower()] = replace(signal, physical=None)
        self.drive(name, physical if value is None else value)
        if value is not None:
            changed = self.get(name)
            self._signals[signal.name.lower()] = replace(changed, physical=physical)

    def end_simulations(self) -> None:
        """Give all signals their devices' values again."""
        for signal in tuple(self._signals.values()):
            if signal.is_simulated:
                self.simulate(signal.name, None)

    def drive(self, name: str, value: float) -> None:
        """Write a signal as the controller itself or a device does, whatever its access level.

        Raises:
            Refused: UNKNOWN or OUT_OF_RANGE.
        """
        signal = self.get(name)
        if value == signal.value and not signal.is_simulated:  # in most cycles
            return
        if signal.type.is_digital and value not in (0, 1):
            raise Refused(RefusalReason.OUT_OF_RANGE, f"signal {signal.name} is digital: 0 or 1, not {value:g}.")
        if signal.is_simulated:  # the device's value waits until the simulation ends
            self._signals[signal.name.lower()] = replace(signal, physical=value)
        else:
            self._signals[signal.name.lower()] = replace(signal, value=value)
            self._on_change(signal.name, signal.value, value)
            for cross in self._crosses.get(signal.name.lower(), ()):
                self._follow(cross)

    def _follow(self, cross: CrossConnection) -> None:
        """Give a signal that is cross-connected its value; a circle of them ends after some rounds."""
        if self._depth >= _DEEPEST_CROSS:
            return
        self._depth += 1
        try:
            self.drive(cross.resultant, cross.value(lambda name: self.get(name).value))
        finally:
            self._depth -= 1

    def restore_defaults(self) -> None:
        """Give the signals that are on no device the value they start with."""
        for name, value in self._defaults.items():
            if not self.get(name).device:
                self.drive(name, value)


def signal_path(signal: ControllerSignal) -> str:
    """Network, device and name, as far as it has them."""
    return "/".join(part for part in (signal.network, signal.device, signal.name) if part)


def printed_signal(value: float) -> str:
    """A value as the controller prints it: whole numbers without decimals."""
    return str(int(value)) if value == int(value) else repr(value)
