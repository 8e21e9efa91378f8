"""Operations on I/O networks, devices and signals (``/rw/iosystem``)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from abb_protocols.rws.operations.operation import TRUTH, absent, get, post
from abb_protocols.rws.operations.operation_answer import record
from abb_protocols.rws.values import Grant

_SIGNAL = "/rw/iosystem/signals/{signal:.+}"
_DEVICE = "/rw/iosystem/devices/{device:.+}"
_NETWORK = "/rw/iosystem/networks/{network}"
_PROFINET = "/rw/iosystem/devices/{network}/{device}"
_IO = "/rw/iosystem"
_OF_SIGNAL = "name{0}, device{0}, network{0}, category{0}, category-pon{0}, type{0}=DO|DI|AO|AI|GO|GI"
_CONDITIONS = ", ".join(
    f"{_OF_SIGNAL.format(number)}, invert{number}={TRUTH}, blocked{number}={TRUTH}" for number in ("", "2")
)


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
UPGRADE = get(f"{_PROFINET}/upgradeinfo", status=204)
DEVICE = get(_DEVICE)
DEVICE_CONFIG = get(_DEVICE, "configtype=1|2|3", resource="config").shows(
    record("ios-device-config-runtime", AccessRights)
)
SET_DEVICE = post(_DEVICE, "set", "lstate=enable|disable", grant=Grant.IO_WRITE)
SET_INPUTDATA = post(_DEVICE, "set-inputdata", "startbyte, signaldata, datamask", grant=Grant.IO_WRITE, status=400)
SET_OUTPUTDATA = post(_DEVICE, "set-outputdata", "startbyte, signaldata, datamask", grant=Grant.IO_WRITE, status=400)
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
ABSENT = (
    *absent(
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
    ),
)
"""What this robot lacks."""
