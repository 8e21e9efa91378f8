"""The I/O system of a controller: networks, devices and signals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from yumi.catalogue import message
from yumi.errors import CommandRefused
from yumi.rws import documents
from yumi.rws.documents import Pairs, Signal, State
from yumi.rws.session import Request, Requests, get, given, post
from yumi.rws.types import SignalType

_SIGNALS = "/rw/iosystem/signals"
_NETWORKS = "/rw/iosystem/networks"
_DEVICES = "/rw/iosystem/devices"
_MS = 1000.0


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
                raise CommandRefused(message("signal_does_not_keep", signal=name, address=self.address, value=level))

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
