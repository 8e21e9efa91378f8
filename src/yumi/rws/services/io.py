"""The I/O system, the files and the configuration of a controller.

The I/O system has networks, devices and signals. Paths of files and directories are as in RAPID (``HOME:/pick.mod``).
The configuration has domains, types, instances with their attributes, and cfg files.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

from yumi.errors import CommandRefused, ControllerRefused
from yumi.rws import documents
from yumi.rws.documents import CfgInstance, FileInfo, Pairs, Signal, State
from yumi.rws.session import OnProgress, Request, Requests, file_path, get, given, post
from yumi.rws.types import SignalType

_SIGNALS = "/rw/iosystem/signals"
_NETWORKS = "/rw/iosystem/networks"
_DEVICES = "/rw/iosystem/devices"
_MS = 1000.0
_REFUSED = 400
_NOT_FOUND = (400, 404)  # which of the two differs by version


class SignalChange(Enum):
    """How a write changes a signal."""

    VALUE = "value"
    INVERT = "invert"
    PULSE = "pulse"
    TOGGLE = "toggle"
    DELAY = "delay"


@dataclass(frozen=True, slots=True)
class Network:
    """An industrial network, or a device on one.

    Attributes:
        name: of it; of a device without its network.
        is_enabled: whether it is started or enabled by the configuration.
        is_running: whether it works now.
        address: of a device, "-" where it has none.
    """

    name: str
    is_enabled: bool
    is_running: bool
    address: str = ""


@dataclass(frozen=True, slots=True)
class SignalDetails:
    """One signal in full.

    Attributes:
        signal: name, type, logical value.
        category: of the configuration.
        device: that has it; empty for a virtual signal.
        is_simulated: whether its logical value is set by hand instead of by its device.
        is_valid: whether the device's value is known.
        physical_value: of the device.
    """

    signal: Signal
    category: str
    device: str
    is_simulated: bool
    is_valid: bool
    physical_value: float


@dataclass(frozen=True, slots=True)
class AccessRights:
    """From where a signal or device may be changed, by mode."""

    rapid: bool
    local_manual: bool
    local_auto: bool
    remote_manual: bool
    remote_auto: bool


class Io(Requests):
    """``/rw/iosystem``."""

    def signal(self, name: str) -> Signal:
        """One I/O signal."""
        return self._read(get(f"{_SIGNALS}/{name}"), documents.read_signal, f"reading signal {name}")

    def signals(self) -> Mapping[str, float]:
        """The values of all I/O signals by their names, in one request where the controller does not make pages."""
        found: dict[str, float] = {}
        query: Pairs | None = ()
        while query is not None:
            page = self._page(self._session.exchange(get(_SIGNALS, *query)), "reading all signals")
            found |= documents.read_signals(page)
            query = page.next_query if page.states else None
        return found

    def set_signal(self, name: str, value: float) -> None:
        """Write the logical value of an I/O signal; group signals take whole numbers."""
        text = str(int(value)) if float(value).is_integer() else repr(value)
        self._do(post(f"{_SIGNALS}/{name}", "set", ("lvalue", text)), f"writing signal {name}")

    def pulse_signal(self, name: str) -> None:
        """Give a rising edge, which is what RAPID interrupts wait for; the signal stays high.

        Each level is read back, since a cross connection or another client may hold the signal
        (reference/statemachine.md §2.2).

        Raises:
            CommandRefused: the signal does not keep what is written.
        """
        for level in (0, 1):
            self.set_signal(name, level)
            if self.signal(name).value != level:
                raise CommandRefused(
                    f"Signal {name} of {self.address} does not keep the value {level}; find what else writes it."
                )

    def signal_details(self, name: str) -> SignalDetails:
        """One signal in full."""
        request = get(f"{_SIGNALS}/{name}")
        return self._read(
            request, lambda page: _signal_details(page.one("ios-signal", "ios-signal-li")), f"reading {name}"
        )

    def signal_access(self, name: str) -> AccessRights:
        """From where a signal may be written."""
        query = (("resource", "config"), ("configtype", "1"))
        return _access_rights(self._state(f"reading {name}", f"{_SIGNALS}/{name}", "ios-signal-config-runtime", *query))

    def find_signals(
        self,
        name: str = "",
        *,
        type: SignalType | None = None,
        device: str = "",
        network: str = "",
        category: str = "",
        all_others: bool = False,
        is_blocked: bool | None = None,
    ) -> tuple[Signal, ...]:
        """Signals whose name contains ``name``, and that are as the rest says; or all others."""
        form = given(
            name=name or None,
            type=None if type is None else type.value,
            device=device or None,
            network=network or None,
            category=category or None,
            invert=all_others or None,
            blocked=is_blocked,
        )
        request = Request("POST", _SIGNALS, (("action", "signal-search"),), form)
        return self._read(
            request, lambda page: tuple(map(documents.signal_of, page.of_type("ios-signal-li"))), "searching signals"
        )

    def find_signal_details(self, name: str = "", other: str = "") -> tuple[SignalDetails, ...]:
        """Signals in full whose name contains ``name``, and ``other``, too."""
        form = given(name=name or None, name2=other or None)
        request = Request("POST", _SIGNALS, (("action", "signal-searchex"),), form)
        return self._read(request, lambda page: tuple(map(_signal_details, page.of_type("ios-signal-li"))), "searching")

    def change_signal(
        self,
        name: str,
        change: SignalChange,
        value: float | None = None,
        *,
        pulses: int | None = None,
        active: float | None = None,
        passive: float | None = None,
        delay: float | None = None,
    ) -> None:
        """Write a signal in another way than ``set_signal``.

        Args:
            name: of the signal.
            change: how it changes.
            value: logical value, where the change has one.
            pulses: number of pulses.
            active: length of a pulse [s].
            passive: time between two pulses [s].
            delay: time before the change [s].
        """
        times = {"ActivePulse": active, "PassivePulse": passive, "Delay": delay}
        form = (
            ("mode", change.value),
            *given(lvalue=None if value is None else f"{value:g}", Pulses=pulses),
            *((key, str(round(time * _MS))) for key, time in times.items() if time is not None),
        )
        self._do(post(f"{_SIGNALS}/{name}", "set", *form), f"writing signal {name}")

    def simulate_signal(self, name: str, is_simulated: bool) -> None:
        """Cut a signal off its device, so that its logical value is set by hand, or connect it again."""
        text = "simulated" if is_simulated else "not simulated"
        self._do(post(f"{_SIGNALS}/{name}", "set", ("lstate", text)), f"simulating signal {name}")

    def unblock_signals(self) -> None:
        """Connect all simulated signals to their devices again."""
        self._do(post(_SIGNALS, "unblock-signal"), "connecting all signals")

    def networks(self, name: str = "") -> tuple[Network, ...]:
        """The industrial networks whose name contains ``name``."""
        if not name:
            return tuple(map(_network, self._states("reading the networks", _NETWORKS)))
        request = post(_NETWORKS, "search", ("name", name))
        return self._read(request, lambda page: tuple(map(_network, page.states)), "searching networks")

    def network(self, name: str) -> Network:
        """One industrial network."""
        return _network(self._state(f"reading {name}", f"{_NETWORKS}/{name}", "ios-network"))

    def network_type(self, name: str) -> str:
        """What kind of network it is, such as ``DEV`` for DeviceNet."""
        query = (("resource", "config"), ("configtype", "1"))
        state = self._state(f"reading {name}", f"{_NETWORKS}/{name}", "ios-network-config-runtime", *query)
        return state.text("networktype")

    def start_network(self, name: str, is_started: bool) -> None:
        """Start or stop an industrial network."""
        form = ("lstate", "start" if is_started else "stop")
        self._do(post(f"{_NETWORKS}/{name}", "set", form), f"{'starting' if is_started else 'stopping'} {name}")

    def configure_network(self, name: str, kind: str = "SCAN") -> None:
        """Let a network find its devices (``SCAN``, ``UNITS``), or make signals (``BITS``, ``GROUPS``, ``BOTH``)."""
        self._do(post(f"{_NETWORKS}/{name}", "config", ("config-type", kind)), f"configuring {name}")

    def devices(self, name: str = "", network: str = "") -> tuple[Network, ...]:
        """The I/O devices whose name contains ``name``, of one network or of all."""
        if name:
            states = self._read(post(_DEVICES, "search", ("name", name)), lambda page: page.states, "searching devices")
        else:
            states = self._states("reading the devices", _DEVICES)
        return tuple(_network(state) for state in states if network in ("", state.title.partition("/")[0]))

    def device(self, name: str) -> Network:
        """One I/O device, such as ``DeviceNet/D652_10``."""
        return _network(self._state(f"reading {name}", f"{_DEVICES}/{name}", "ios-device"))

    def device_access(self, name: str) -> AccessRights:
        """From where the signals of a device may be written."""
        query = (("resource", "config"), ("configtype", "1"))
        return _access_rights(self._state(f"reading {name}", f"{_DEVICES}/{name}", "ios-device-config-runtime", *query))

    def has_upgrade(self, network: str, name: str) -> bool:
        """Whether there is newer firmware for a device."""
        reply = self._session.exchange(get(f"{_DEVICES}/{network}/{name}/upgradeinfo"))
        self._accepted(reply, f"reading {name}")
        return bool(reply.content)

    def enable_device(self, name: str, is_enabled: bool) -> None:
        """Enable or disable an I/O device."""
        form = ("lstate", "enable" if is_enabled else "disable")
        self._do(post(f"{_DEVICES}/{name}", "set", form), f"{'enabling' if is_enabled else 'disabling'} {name}")


def _signal_details(state: State) -> SignalDetails:
    return SignalDetails(
        signal=documents.signal_of(state),
        category=state.fields.get("category", ""),
        device=state.fields.get("unitnm", "/".join(state.title.split("/")[:-1])),
        is_simulated=state.text("lstate") == "simulated",
        is_valid=state.fields.get("phstate") == "valid",
        physical_value=state.number("pvalue"),
    )


def _network(state: State) -> Network:
    is_enabled = state.text("lstate") in ("started", "enabled")
    return Network(state.text("name"), is_enabled, state.text("pstate") == "running", state.fields.get("address", ""))


def _access_rights(state: State) -> AccessRights:
    names = ("rapid", "localmanual", "localauto", "remotemanual", "remoteauto")
    return AccessRights(*(state.flag(name) for name in names))


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
            raise CommandRefused(f"RAPID files hold Latin-1 only; {path} cannot have {wrong!r} in it.") from error
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
