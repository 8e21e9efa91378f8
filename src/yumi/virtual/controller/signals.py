"""The system parameters from ABB's cfg files, and the I/O signals they define (reference/rws.md §7, §9)."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import count
from types import MappingProxyType

from yumi.errors import SettingsError
from yumi.rws.types import SignalType, read_cfg, write_cfg
from yumi.virtual.controller.events import Refusal, Refused

Value = str
"""Attributes are text, as in the file; their reader converts numbers."""

# A type lists its defaulted attributes too (reference/rws.md §9); those that clients or our modules read.
_BASE_FRAME: Mapping[str, Value] = {
    "base_frame_pos_x": "0",
    "base_frame_pos_y": "0",
    "base_frame_pos_z": "0",
    "base_frame_orient_u0": "1",
    "base_frame_orient_u1": "0",
    "base_frame_orient_u2": "0",
    "base_frame_orient_u3": "0",
    "base_frame_coordinated": "",
}
_DEFAULTS: Mapping[tuple[str, str], Mapping[str, Value]] = {
    ("MOC", "MECHANICAL_UNIT"): {"use_robot": "", **{f"use_single_{n}": "" for n in range(6)}},
    ("MOC", "ROBOT"): _BASE_FRAME,
    ("MOC", "SINGLE"): _BASE_FRAME,
    ("MOC", "ARM"): {"cal_position": "0"},
    ("MOC", "EXT_MOTION_DATA"): {
        "ext_motion_level": "1",
        "do_not_restart_after_motors_off": "false",
        "ramp_time": "0.5",
        "ext_motion_Kp": "5",
        "ext_motion_filter_bandwidth": "20",
    },
    ("SYS", "MECHANICAL_UNIT_GROUP"): {"Robot": "", **{f"MechanicalUnit_{n}": "" for n in range(1, 7)}},
    ("EIO", "EIO_SIGNAL"): {
        "Device": "",
        "DeviceMap": "",
        "Category": "",
        "Access": "Default",
        "Default": "0",
    },
    ("SIO", "COM_TRP"): {"PhyChannel": ""},
}


def defaults_of(domain: str, type_name: str) -> Mapping[str, Value]:
    """The values a new instance of a type has, as far as they are known."""
    return _DEFAULTS.get((domain.upper(), type_name.upper()), {})


@dataclass(frozen=True, slots=True)
class Instance:
    """One instance of a configuration type.

    Attributes:
        name: its name.
        attributes: every attribute by its name as the template spells it, the name included.
    """

    name: str
    attributes: Mapping[str, Value]


class Configuration:
    """All instances; domains and types are found in any letter case, as on the controller.

    Attributes:
        changes: rises with each change.
    """

    def __init__(self, texts: Iterable[str] = ()) -> None:
        self._instances: dict[tuple[str, str], dict[str, Instance]] = {}
        self._headers: dict[str, str] = {}
        self.changes = 0
        for text in texts:
            self.load(text)

    def load(self, text: str, replacing: Container[str] = (), *, replace: bool = True) -> None:
        """Add the instances of a cfg file: all, or none.

        Args:
            text: of the file.
            replacing: types, in capitals, of which what there was is removed where the file has instances of them.
            replace: whether an instance of the same name is replaced; it is an error otherwise.

        Raises:
            SettingsError: the text is not a cfg file, or an instance cannot be added.
        """
        file = read_cfg(text)
        loaded = Configuration()
        loaded.become(self)
        for type_name in dict.fromkeys(type_name.upper() for type_name, _ in file.instances):
            if type_name in replacing:
                loaded._instances.pop((file.domain.upper(), type_name), None)
        for type_name, attributes in file.instances:
            name = attributes.get("name") or attributes.get("Name") or ""
            if not replace and loaded.find(file.domain, type_name, name) is not None:
                raise SettingsError(f"{file.domain}/{type_name} has {name} already.")
            loaded.put(file.domain, type_name, attributes)
        self.become(loaded)
        self._headers[file.domain] = file.header

    def text(self, domain: str) -> str:
        """The cfg file of a domain."""
        types = [type_name for found, type_name in self._instances if found == domain]
        instances = [(name, each.attributes) for name in types for each in self.instances(domain, name)]
        return write_cfg(self._headers.get(domain, f"{domain}:CFG_1.0:6:0::"), instances)

    def remove(self, domain: str, type_name: str, name: str) -> None:
        """Remove an instance that exists."""
        key = (domain.upper(), type_name.upper())
        self.changes += 1
        del self._instances[key][name]
        if not self._instances[key]:
            del self._instances[key]

    def put(self, domain: str, type_name: str, attributes: Mapping[str, Value]) -> None:
        """Add one instance, completed with the defaults of its type.

        An instance of a type without names is the same as another one when all its attributes are.

        Raises:
            SettingsError: a signal of a kind that does not exist.
        """
        key = (domain.upper(), type_name.upper())
        complete = {**attributes, **{k: v for k, v in _DEFAULTS.get(key, {}).items() if k not in attributes}}
        _check(key, complete)
        instances = self._instances.setdefault(key, {})
        name = complete.get("name") or complete.get("Name")
        if not name:
            if any(each.attributes == complete for each in instances.values()):
                return
            name = next(free for n in count() if (free := f"{type_name}_{n}") not in instances)
        self.changes += 1
        instances[name] = Instance(name, MappingProxyType(complete))

    def change(self, domain: str, type_name: str, name: str, attributes: Mapping[str, Value]) -> None:
        """Give an instance that exists other values of some attributes; raises SettingsError as :meth:`put`."""
        instances = self._instances[domain.upper(), type_name.upper()]
        changed = {**instances[name].attributes, **attributes}
        _check((domain.upper(), type_name.upper()), changed)
        self.changes += 1
        instances[name] = replace(instances[name], attributes=MappingProxyType(changed))

    def become(self, other: Configuration) -> None:
        """Take over all instances of another configuration: what the controller does when it starts."""
        self._instances = {key: dict(instances) for key, instances in other._instances.items()}
        self._headers = dict(other._headers)
        self.changes += 1

    @property
    def domains(self) -> tuple[str, ...]:
        return tuple(sorted({domain for domain, _ in self._instances}))

    def types(self, domain: str) -> tuple[str, ...]:
        """Types of the domain that have instances."""
        return tuple(type_name for found, type_name in self._instances if found == domain.upper())

    def instances(self, domain: str, type_name: str) -> tuple[Instance, ...]:
        """Instances in the order they were loaded; none when the type has none."""
        return tuple(self._instances.get((domain.upper(), type_name.upper()), {}).values())

    def find(self, domain: str, type_name: str, name: str) -> Instance | None:
        """The instance of that name, or None."""
        return self._instances.get((domain.upper(), type_name.upper()), {}).get(name)


# What a device of each type is on where its -Network is left out, as RobotStudio writes it.
_NETWORKS: Mapping[str, str] = {
    "ETHERNETIP_DEVICE": "EtherNetIP",
    "DEVICENET_DEVICE": "DeviceNet",
    "DEVICENET_INTERNAL_DEVICE": "DeviceNet",
    "PROFINET_DEVICE": "PROFINET",
    "PROFINET_INTERNAL_DEVICE": "PROFINET",
    "PROFIBUS_DEVICE": "PROFIBUS",
    "PROFIBUS_INTERNAL_ANYBUS": "PROFIBUS_Anybus",
    "LOCAL_DEVICE": "Local",
}


def _check(key: tuple[str, str], attributes: Mapping[str, Value]) -> None:
    """Refuse a signal of a kind that does not exist, or without a number to start with."""
    if key != ("EIO", "EIO_SIGNAL"):
        return
    kind, value = attributes.get("SignalType", ""), attributes.get("Default", "")
    try:
        SignalType(kind.upper()), float(value)
    except ValueError:
        raise SettingsError(
            f"the signal {attributes.get('Name', '')} of the EIO parameters has the SignalType {kind!r} and the "
            f"Default {value!r}; allowed are {', '.join(each.value for each in SignalType)} and a number."
        ) from None


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

OnChange = Callable[[str, float, float], None]
"""Called with name, old and new value, before the write returns."""


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

    def __init__(self, signals: Iterable[Signal], on_change: OnChange) -> None:
        self._signals = {signal.name.lower(): signal for signal in signals}
        self._on_change = on_change
        self._crosses: dict[str, list[CrossConnection]] = {}  # by actor
        self._depth = 0
        self.rejected: list[str] = []
        self.disabled: set[str] = set()
        self.stopped: set[str] = set()
        self._defaults = {signal.name: signal.value for signal in self._signals.values()}

    @classmethod
    def configured(cls, configuration: Configuration, on_change: OnChange) -> Signals:
        """The signals the configuration declares, at their default values."""
        signals = cls((), on_change)
        signals.configure(configuration)
        return signals

    def configure(self, configuration: Configuration) -> None:
        """Become the signals the configuration declares, at their default values; those on a device keep theirs."""
        devices = [(kind, device) for kind in _NETWORKS for device in configuration.instances("EIO", kind)]
        networks = {device.name: device.attributes.get("Network", _NETWORKS[kind]) for kind, device in devices}
        known, self._signals, self._defaults = self._signals, {}, {}
        for instance in configuration.instances("EIO", "EIO_SIGNAL"):
            attributes = instance.attributes
            default = float(attributes["Default"])
            before = known.get(instance.name.lower())
            self._defaults[instance.name] = default
            self._signals[instance.name.lower()] = Signal(
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
                self._signals[name.lower()] = Signal(name, type_, "safety", "ReadOnly", value, "DRV_1", "Local")
        self._crosses, self.rejected = {}, []
        crosses = []
        for cross in (CrossConnection.of(each.attributes) for each in configuration.instances("EIO", "EIO_CROSS")):
            unknown = [name for name in (cross.resultant, *sorted(cross.actors)) if not self.has(name)]
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
        if signal.device in self.disabled or signal.network in self.stopped:
            raise Refused(Refusal.NOT_STOPPED, f"the device {signal.device} of signal {name} does not run.")
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
            raise Refused(Refusal.OUT_OF_RANGE, f"signal {signal.name} is digital: 0 or 1, not {value:g}.")
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

    def has(self, name: str) -> bool:
        """Whether there is a signal of that name."""
        return name.lower() in self._signals

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
