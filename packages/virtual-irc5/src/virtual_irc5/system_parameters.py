"""The system parameters of a controller: domains, types, instances and their defaults (reference/rws.md §9)."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import count
from types import MappingProxyType

from abb_protocols.errors import SettingsError
from abb_protocols.rws.cfg_files import read_cfg, write_cfg
from abb_protocols.rws.values import SignalType

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


class SystemConfiguration:
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
        file, loaded = read_cfg(text), self.copy()
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

    def become(self, other: SystemConfiguration) -> None:
        """Take over all instances of another configuration: what the controller does when it starts."""
        self._instances = {key: dict(instances) for key, instances in other._instances.items()}
        self._headers = dict(other._headers)
        self.changes += 1

    def copy(self) -> SystemConfiguration:
        """A configuration with the same instances, which changes apart from this one."""
        made = SystemConfiguration()
        made.become(self)
        return made

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
NETWORKS: Mapping[str, str] = {
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


_CFG_PARTS = 3  # /DOMAIN/TYPE/instance


class SystemParameters:
    """The configuration as ReadCfgData names it (:class:`virtual_irc5.rapid.devices.ConfigurationDevice`)."""

    def __init__(self, configuration: SystemConfiguration) -> None:
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
        return self._configuration.text(domain.upper())

    def _instance(self, path: str) -> tuple[tuple[str, str], Instance]:
        parts = path.strip("/").split("/")
        found = self._configuration.find(*parts) if len(parts) == _CFG_PARTS else None
        if found is None:
            raise KeyError(path)
        return (parts[0], parts[1]), found
