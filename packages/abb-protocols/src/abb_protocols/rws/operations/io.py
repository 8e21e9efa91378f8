"""Operations on I/O networks, devices and signals (``/rw/iosystem``), and the client's calls of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, ProtocolError
from abb_protocols.rws.documents import RwsState
from abb_protocols.rws.operations.operation import TRUTH_VALUES, absent_operations, get, post
from abb_protocols.rws.operations.operation_answer import record
from abb_protocols.rws.operations.service import Service
from abb_protocols.rws.values import Grant, SignalChange, SignalType

_SIGNAL = "/rw/iosystem/signals/{signal:.+}"
_DEVICE = "/rw/iosystem/devices/{device:.+}"
_NETWORK = "/rw/iosystem/networks/{network}"
_PROFINET = "/rw/iosystem/devices/{network}/{device}"
_IO = "/rw/iosystem"
_OF_SIGNAL = "name{0}, device{0}, network{0}, category{0}, category-pon{0}, type{0}=DO|DI|AO|AI|GO|GI"
_CONDITIONS = ", ".join(
    f"{_OF_SIGNAL.format(number)}, invert{number}={TRUTH_VALUES}, blocked{number}={TRUTH_VALUES}"
    for number in ("", "2")
)
_MS = 1000.0


@dataclass(frozen=True, slots=True)
class IoNetwork:
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
class RwsSignal:
    """One I/O signal and its logical value."""

    name: str
    type: SignalType
    value: float


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

    signal: RwsSignal
    category: str
    device: str
    is_simulated: bool
    is_valid: bool
    physical_value: float


@dataclass(frozen=True, slots=True)
class AccessRights:
    """From where a signal or device may be changed, by mode."""

    rapid: bool
    local_manual: Annotated[bool, "localmanual"]
    local_auto: Annotated[bool, "localauto"]
    remote_manual: Annotated[bool, "remotemanual"]
    remote_auto: Annotated[bool, "remoteauto"]


IO_SYSTEM = get(_IO)
NETWORKS = get(f"{_IO}/networks")
SEARCH_NETWORKS = post(f"{_IO}/networks", "search", "name, state", status=200)
NETWORK = get(_NETWORK)
NETWORK_CONFIG = get(_NETWORK, "configtype=1|2|3", resource="config")
SET_NETWORK = post(_NETWORK, "set", "lstate=start|stop", grant=Grant.IO_WRITE)
CONFIGURE_NETWORK = post(_NETWORK, "config", "config-type=BITS|GROUPS|BOTH|SCAN|UNITS", grant=Grant.IO_WRITE)
DEVICES = get(f"{_IO}/devices")
SEARCH_DEVICES = post(f"{_IO}/devices", "search", "name, lstate=enabled|disabled, network", status=200)
UPGRADE_OF_DEVICES = get(f"{_PROFINET}/upgradeinfo", status=204)
DEVICE = get(_DEVICE)
DEVICE_CONFIG = get(_DEVICE, "configtype=1|2|3", resource="config").shows(
    record("ios-device-config-runtime", AccessRights)
)
SET_DEVICE = post(_DEVICE, "set", "lstate=enable|disable", grant=Grant.IO_WRITE)
SET_DEVICE_INPUT = post(_DEVICE, "set-inputdata", "startbyte, signaldata, datamask", grant=Grant.IO_WRITE, status=400)
SET_DEVICE_OUTPUT = post(_DEVICE, "set-outputdata", "startbyte, signaldata, datamask", grant=Grant.IO_WRITE, status=400)
SIGNALS = get(f"{_IO}/signals", "start, limit")
SIGNAL_SEARCH = post(f"{_IO}/signals", "signal-search", _CONDITIONS, query="start, limit", status=200)
SIGNAL_SEARCHEX = post(f"{_IO}/signals", "signal-searchex", _CONDITIONS, query="start, limit", status=200)
UNBLOCK_SIGNALS = post(f"{_IO}/signals", "unblock-signal", grant=Grant.IO_WRITE)
SIGNAL = get(_SIGNAL)
SIGNAL_CONFIG = get(_SIGNAL, "configtype=1|2|3", resource="config").shows(
    record("ios-signal-config-runtime", AccessRights)
)
SET_SIGNAL = post(
    _SIGNAL,
    "set",
    "lvalue, lstate=simulated|not simulated, mode=value|invert|pulse|toggle|delay, Delay, Pulses, "
    "ActivePulse, PassivePulse, userlog=true|false, InputAsPhysical=true|false",
    grant=Grant.IO_WRITE,
)
ABSENT_FROM_IO = absent_operations(
    "PROFINET",
    "GET /rw/iosystem/devices/{network}/{device}/implicitdata"
    " | POST /rw/iosystem/devices/{network}/{device}/implicitdata"
    " | OPTIONS /rw/iosystem/devices/{network}/{device}/implicitdata"
    " | GET /rw/iosystem/devices/{network}/{device}/explicitdata"
    " | POST /rw/iosystem/devices/{network}/{device}/explicitdata"
    " | OPTIONS /rw/iosystem/devices/{network}/{device}/explicitdata"
    " | POST /rw/iosystem/devices/{network}/{device}/alarms/clear"
    " | OPTIONS /rw/iosystem/devices/{network}/{device}/alarms/clear"
    " | GET /rw/iosystem/devices/{network}/{device}/alarms",
)
"""What this robot lacks."""


def signal_of(state: RwsState) -> RwsSignal:
    """A signal, of whatever list."""
    return RwsSignal(state.text("name"), state.member(SignalType, "type"), state.number("lvalue"))


def read_signals(states: Iterable[RwsState]) -> Mapping[str, float]:
    """``/rw/iosystem/signals``: the values by name; an entry without a valid value is left out."""
    values: dict[str, float] = {}
    for state in states:
        with suppress(ProtocolError):
            values[state.text("name")] = state.number("lvalue")
    return values


class IoService(Service):
    """``/rw/iosystem``."""

    def signal(self, name: str) -> RwsSignal:
        """One I/O signal."""
        return signal_of(self._shown(f"reading signal {name}", SIGNAL, name).one("ios-signal", "ios-signal-li"))

    def signals(self) -> Mapping[str, float]:
        """The values of all I/O signals by their names, in one request where the controller does not make pages."""
        return read_signals(self._listed("reading all signals", SIGNALS))

    def set_signal(self, name: str, value: float) -> None:
        """Write the logical value of an I/O signal; group signals take whole numbers."""
        text = str(int(value)) if float(value).is_integer() else repr(value)
        self._call(f"writing signal {name}", SET_SIGNAL, name, lvalue=text)

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
        return _signal_details(self._shown(f"reading {name}", SIGNAL, name).one("ios-signal", "ios-signal-li"))

    def signal_access(self, name: str) -> AccessRights:
        """From where a signal may be written."""
        return self._answer(f"reading {name}", SIGNAL_CONFIG, name, configtype=1)

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
    ) -> tuple[RwsSignal, ...]:
        """Signals whose name contains ``name``, and that are as the rest says; or all others."""
        page = self._shown(
            "searching signals",
            SIGNAL_SEARCH,
            name=name or None,
            type=type,
            device=device or None,
            network=network or None,
            category=category or None,
            invert=all_others or None,
            blocked=is_blocked,
        )
        return tuple(map(signal_of, page.of_type("ios-signal-li")))

    def find_signal_details(self, name: str = "", other: str = "") -> tuple[SignalDetails, ...]:
        """Signals in full whose name contains ``name``, and ``other``, too."""
        page = self._shown("searching", SIGNAL_SEARCHEX, name=name or None, name2=other or None)
        return tuple(map(_signal_details, page.of_type("ios-signal-li")))

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
        self._call(
            f"writing signal {name}",
            SET_SIGNAL,
            name,
            mode=change,
            lvalue=None if value is None else f"{value:g}",
            Pulses=pulses,
            ActivePulse=_milliseconds(active),
            PassivePulse=_milliseconds(passive),
            Delay=_milliseconds(delay),
        )

    def simulate_signal(self, name: str, is_simulated: bool) -> None:
        """Cut a signal off its device, so that its logical value is set by hand, or connect it again."""
        state = "simulated" if is_simulated else "not simulated"
        self._call(f"simulating signal {name}", SET_SIGNAL, name, lstate=state)

    def unblock_signals(self) -> None:
        """Connect all simulated signals to their devices again."""
        self._call("connecting all signals", UNBLOCK_SIGNALS)

    def networks(self, name: str = "") -> tuple[IoNetwork, ...]:
        """The industrial networks whose name contains ``name``."""
        if not name:
            return tuple(map(_network, self._listed("reading the networks", NETWORKS)))
        return tuple(map(_network, self._shown("searching networks", SEARCH_NETWORKS, name=name).states))

    def network(self, name: str) -> IoNetwork:
        """One industrial network."""
        return _network(self._shown(f"reading {name}", NETWORK, name).one("ios-network"))

    def network_type(self, name: str) -> str:
        """What kind of network it is, such as ``DEV`` for DeviceNet."""
        page = self._shown(f"reading {name}", NETWORK_CONFIG, name, configtype=1)
        return page.one("ios-network-config-runtime").text("networktype")

    def start_network(self, name: str, is_started: bool) -> None:
        """Start or stop an industrial network."""
        what = f"{'starting' if is_started else 'stopping'} {name}"
        self._call(what, SET_NETWORK, name, lstate="start" if is_started else "stop")

    def configure_network(self, name: str, kind: str = "SCAN") -> None:
        """Let a network find its devices (``SCAN``, ``UNITS``), or make signals (``BITS``, ``GROUPS``, ``BOTH``)."""
        self._call(f"configuring {name}", CONFIGURE_NETWORK, name, config_type=kind)

    def devices(self, name: str = "", network: str = "") -> tuple[IoNetwork, ...]:
        """The I/O devices whose name contains ``name``, of one network or of all."""
        if name:
            states = self._shown("searching devices", SEARCH_DEVICES, name=name).states
        else:
            states = self._listed("reading the devices", DEVICES)
        return tuple(_network(state) for state in states if network in ("", state.title.partition("/")[0]))

    def device(self, name: str) -> IoNetwork:
        """One I/O device, such as ``DeviceNet/D652_10``."""
        return _network(self._shown(f"reading {name}", DEVICE, name).one("ios-device"))

    def device_access(self, name: str) -> AccessRights:
        """From where the signals of a device may be written."""
        return self._answer(f"reading {name}", DEVICE_CONFIG, name, configtype=1)

    def has_upgrade(self, network: str, name: str) -> bool:
        """Whether there is newer firmware for a device."""
        return bool(self._call(f"reading {name}", UPGRADE_OF_DEVICES, network, name).content)

    def enable_device(self, name: str, is_enabled: bool) -> None:
        """Enable or disable an I/O device."""
        what = f"{'enabling' if is_enabled else 'disabling'} {name}"
        self._call(what, SET_DEVICE, name, lstate="enable" if is_enabled else "disable")


def _milliseconds(time: float | None) -> int | None:
    return None if time is None else round(time * _MS)


def _signal_details(state: RwsState) -> SignalDetails:
    return SignalDetails(
        signal=signal_of(state),
        category=state.fields.get("category", ""),
        device=state.fields.get("unitnm", "/".join(state.title.split("/")[:-1])),
        is_simulated=state.text("lstate") == "simulated",
        is_valid=state.fields.get("phstate") == "valid",
        physical_value=state.number("pvalue"),
    )


def _network(state: RwsState) -> IoNetwork:
    is_enabled = state.text("lstate") in ("started", "enabled")
    return IoNetwork(state.text("name"), is_enabled, state.text("pstate") == "running", state.fields.get("address", ""))
