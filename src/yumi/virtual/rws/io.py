"""``/rw/iosystem`` and ``/rw/dipc``: networks, devices, signals; message queues (reference/rws.md §7, §13).

The queues are those of clients and RAPID tasks.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace

from yumi.rapid.devices import LONGEST_MESSAGE, MOST_MESSAGES, Message
from yumi.rapid.types import RapidRuntimeError
from yumi.rws.documents import Link, Page, Pairs, State, first_value
from yumi.rws.types import Code, Grant
from yumi.virtual.controller.irc5 import Irc5
from yumi.virtual.controller.signals import Signal, path_of, printed
from yumi.virtual.rws.http import entry, resource
from yumi.virtual.rws.operations import Call, Failure, Operation, Values, invalid, not_there

_IO_BASE = "/rw/iosystem/"
_DEFAULT_LIMIT = 100
_LOCAL = "Local"
_LOCAL_DEVICES = ("DRV_1", "PANEL")
_DEVICE_TYPES = ("ETHERNETIP_DEVICE", "DEVICENET_DEVICE", "ETHERNETIP_INTERNAL_DEVICE", "DEVICENET_INTERNAL_DEVICE")
_MODES = ("value", "invert", "pulse", "toggle", "delay")
_NO_PROFINET = "PROFINET"
_LONGEST_TIME_MS = 1e6  # of a delay or pulse
_MOST_PULSES = 1000


@dataclass(frozen=True, slots=True)
class Device:
    """One I/O device: its network and address as the configuration says."""

    name: str
    network: str
    address: str = "-"


def get_io_system(controller: Irc5, call: Call) -> Page:
    names = ("networks", "devices", "signals")
    return resource("io", "/rw/", "iosystem", *(entry(f"ios-{name}-li", name, f"iosystem/{name}") for name in names))


# Networks and devices


def _devices(controller: Irc5) -> list[Device]:
    found = [Device(name, _LOCAL) for name in _LOCAL_DEVICES]
    for kind in _DEVICE_TYPES:
        for each in controller.effective.instances("EIO", kind):
            network = each.attributes.get("Network") or kind.partition("_")[0].capitalize()
            found.append(Device(each.name, network, each.attributes.get("Address") or "-"))
    return found


def _networks(controller: Irc5) -> list[str]:
    return list(dict.fromkeys(device.network for device in _devices(controller)))


def _network_state(controller: Irc5, name: str, type: str) -> State:
    stopped = name in controller.signals.stopped
    fields = {
        "name": name,
        "pstate": "halted" if stopped else "running",
        "lstate": "stopped" if stopped else "started",
    }
    return State(type, name, fields, (Link("self", f"networks/{name}"), Link("devices", "devices")))


def get_networks(controller: Irc5, call: Call) -> Page:
    states = (_network_state(controller, name, "ios-network-li") for name in _networks(controller))
    return resource("io", _IO_BASE, "networks", *states)


def search_networks(controller: Irc5, call: Call) -> Page:
    name, state = call.parameter("name", ""), call.parameter("state", "")
    if not name and not state:
        raise invalid("a search needs name or state")
    states = [_network_state(controller, each, "ios-network-li") for each in _networks(controller)]
    found = (
        each
        for each in states
        if name.lower() in each.title.lower() and state in ("", each.fields["pstate"], each.fields["lstate"])
    )
    return resource("io", _IO_BASE, "networks", *found)


def _network(controller: Irc5, call: Call) -> str:
    asked = call.names["network"]
    for name in _networks(controller):
        if name.lower() == asked.lower():
            return name
    raise Failure(404, Code.UNRESOLVED_URL, f"there is no network {asked[:50]!r}")


def get_network(controller: Irc5, call: Call) -> Page:
    name = _network(controller, call)
    return resource("io", _IO_BASE, f"networks/{name}", _network_state(controller, name, "ios-network"))


def set_network(controller: Irc5, call: Call) -> None:
    name = _network(controller, call)
    if call.required("lstate") == "start":
        controller.signals.stopped.discard(name)
    elif name == _LOCAL:
        raise Failure(403, Code.UNIT_DISABLE_NOT_ALLOWED, "the network Local cannot be stopped")
    else:
        controller.signals.stopped.add(name)


def get_network_config(controller: Irc5, call: Call) -> Page:
    name = _network(controller, call)
    fields = {"networkname": name, "networktype": name[:3].upper(), "networkaddress": "-"}
    return resource("io", _IO_BASE, f"networks/{name}", State("ios-network-config-runtime", name, fields))


def configure_network(controller: Irc5, call: Call) -> None:
    """Ask a network to write its configuration anew: ours is always that of the system parameters."""
    _network(controller, call)
    call.required("config-type")


def _device_state(controller: Irc5, device: Device, type: str) -> State:
    disabled, stopped = device.name in controller.signals.disabled, device.network in controller.signals.stopped
    fields = {
        "name": device.name,
        "lstate": "disabled" if disabled else "enabled",
        "pstate": "deact" if disabled else "unconnect" if stopped else "running",
        "address": device.address,
    }
    path = f"{device.network}/{device.name}"
    return State(type, path, fields, (Link("self", f"devices/{path}"),))


def get_devices(controller: Irc5, call: Call) -> Page:
    states = (_device_state(controller, device, "ios-device-li") for device in _devices(controller))
    return resource("io", _IO_BASE, "devices", *states)


def search_devices(controller: Irc5, call: Call) -> Page:
    name, state, network = (call.parameter(each, "").lower() for each in ("name", "lstate", "network"))
    if not name and not state:
        raise invalid("a search needs name or lstate")
    states = [_device_state(controller, device, "ios-device-li") for device in _devices(controller)]
    found = (
        each
        for each in states
        if name in each.fields["name"].lower()
        and state in ("", each.fields["lstate"])
        and network in ("", each.title.partition("/")[0].lower())
    )
    return resource("io", _IO_BASE, "devices", *found)


def _device(controller: Irc5, call: Call) -> Device:
    name = call.names["device"].rpartition("/")[2]
    for device in _devices(controller):
        if device.name.lower() == name.lower():
            return device
    raise Failure(404, Code.UNRESOLVED_URL, f"there is no device {name[:50]!r}")


def get_device(controller: Irc5, call: Call) -> Page:
    """The device with its data: each signal's bits where DeviceMap has them."""
    device = _device(controller, call)
    state = _device_state(controller, device, "ios-device")
    data = {True: bytearray(), False: bytearray()}  # outputs and inputs
    used = {True: bytearray(), False: bytearray()}
    for signal in _signals(controller):
        if signal.device == device.name:
            for place, bit in enumerate(_bits(controller, signal)):
                for content in (data, used):
                    missing = bit // 8 + 1 - len(content[signal.type.is_output])
                    content[signal.type.is_output].extend(bytes(max(missing, 0)))
                used[signal.type.is_output][bit // 8] |= 1 << bit % 8
                data[signal.type.is_output][bit // 8] |= (int(signal.value) >> place & 1) << bit % 8
    contents = {
        "indata": data[False].hex(),
        "inmask": used[False].hex(),
        "outdata": data[True].hex(),
        "outmask": used[True].hex(),
    }
    return resource("io", _IO_BASE, f"devices/{state.title}", replace(state, fields={**state.fields, **contents}))


def _bits(controller: Irc5, signal: Signal) -> Sequence[int]:
    """The bits of a device that a signal has, lowest first: ``5`` or ``8-15`` of its DeviceMap."""
    instance = controller.effective.find("EIO", "EIO_SIGNAL", signal.name)
    first, _, last = (instance.attributes.get("DeviceMap", "") if instance else "").partition("-")
    return range(int(first), int(last or first) + 1) if first.isdecimal() and (last or first).isdecimal() else ()


def set_device(controller: Irc5, call: Call) -> None:
    device = _device(controller, call)
    if call.required("lstate") == "enable":
        controller.signals.disabled.discard(device.name)
    elif device.network == _LOCAL:
        raise Failure(403, Code.UNIT_DISABLE_NOT_ALLOWED, f"the device {device.name} cannot be disabled")
    else:
        controller.signals.disabled.add(device.name)


def get_device_config(controller: Irc5, call: Call) -> Page:
    device = _device(controller, call)
    signals = [signal for signal in _signals(controller) if signal.device == device.name]
    bits = {
        is_output: sum(len(_bits(controller, each)) for each in signals if each.type.is_output is is_output)
        for is_output in (False, True)
    }
    fields = {
        "unitname": device.name,
        "networkname": device.network,
        "inputbits": str(bits[False]),
        "outputbits": str(bits[True]),
        **dict.fromkeys(("rapid", "localmanual", "localauto", "remotemanual", "remoteauto"), "TRUE"),
        "unitaddress": device.address,
        "denydeactivate": "TRUE" if device.network == _LOCAL else "FALSE",
    }
    path = f"devices/{device.network}/{device.name}"
    return resource("io", _IO_BASE, path, State("ios-device-config-runtime", device.name, fields))


def get_upgrade(controller: Irc5, call: Call) -> None:
    """No firmware is waiting for a device."""
    _device(controller, call)


def refuse_data(controller: Irc5, call: Call) -> None:
    _device(controller, call)
    raise Failure(400, Code.SERVICE_NOT_SUPPORTED, "the data of a device are set in RobotStudio's controllers alone")


# Signals


def _signals(controller: Irc5) -> Iterable[Signal]:
    return map(controller.signals.get, controller.signals.names)


def get_signals(controller: Irc5, call: Call) -> Page:
    """All signals, or one page of them where the client asks for pages."""
    return _listed(controller, call, list(_signals(controller)), "signals")


def _listed(controller: Irc5, call: Call, signals: Sequence[Signal], href: str, *, is_full: bool = False) -> Page:
    start, limit = call.number_option("start", 0), call.number_option("limit", _DEFAULT_LIMIT)
    is_paged = call.option("start") is not None or call.option("limit") is not None
    shown = signals[start : start + limit] if is_paged else signals
    following = start + limit
    more = f"{href}?start={following}&limit={limit}" if is_paged and following < len(signals) else None
    entries = (
        State(
            "ios-signal-li",
            path_of(one),
            {**_signal_fields(one), **(_physical_fields(one) | {"write-access-level": one.access} if is_full else {})},
            (Link("self", f"signals/{path_of(one)}"),),
        )
        for one in shown
    )
    return resource("io", _IO_BASE, href, *entries, next_href=more)


def search_signals(controller: Irc5, call: Call) -> Page:
    """The signals that fit; two sets of conditions may be given, one of them inverted."""
    found = [
        signal
        for signal in _signals(controller)
        if _fits(controller, signal, call.form, "") and _fits(controller, signal, call.form, "2")
    ]
    return _listed(controller, call, found, "signals", is_full=call.option("action") == "signal-searchex")


def _fits(controller: Irc5, signal: Signal, form: Pairs, suffix: str) -> bool:
    def asked(name: str) -> str:
        return (first_value(form, f"{name}{suffix}") or "").lower()

    instance = controller.effective.find("EIO", "EIO_SIGNAL", signal.name)
    conditions = [
        asked("name") in signal.name.lower(),
        asked("device") in ("", signal.device.lower()),
        asked("network") in ("", signal.network.lower()),
        asked("category") in signal.category.lower(),
        asked("category-pon") in ("", (instance.attributes.get("CategoryPon", "") if instance else "").lower()),
        asked("type") in ("", signal.type.value.lower()),
        asked("blocked") in ("", str(signal.is_simulated).lower()),
    ]
    given = any(asked(name) for name in ("name", "device", "network", "category", "category-pon", "type", "blocked"))
    return all(conditions) is not (asked("invert") == "true") if given else True


def unblock_signals(controller: Irc5, call: Call) -> None:
    controller.signals.end_simulations()
    controller.settle()


def get_signal(controller: Irc5, call: Call) -> Page:
    signal = controller.signals.get(_signal_name(call))
    fields = {**_signal_fields(signal), "unitnm": signal.device, **_physical_fields(signal)}
    links = (Link("device", f"devices/{signal.device}"),) if signal.device else ()
    return resource("io", _IO_BASE, f"signals/{path_of(signal)}", State("ios-signal", path_of(signal), fields, links))


def get_signal_config(controller: Irc5, call: Call) -> Page:
    signal = controller.signals.get(_signal_name(call))
    may_write = "TRUE" if signal.access.upper() == "ALL" else "FALSE"
    fields = {
        "signalname": signal.name,
        "signalbits": str(max(len(_bits(controller, signal)), 1)),
        "rapid": "TRUE",
        "localmanual": "TRUE",
        **dict.fromkeys(("localauto", "remotemanual", "remoteauto"), may_write),
        "setbydevicetransfer": "FALSE",
    }
    return resource(
        "io", _IO_BASE, f"signals/{path_of(signal)}", State("ios-signal-config-runtime", signal.name, fields)
    )


def set_signal(controller: Irc5, call: Call) -> None:
    """Write a signal or simulate it; the interrupts of its edge run before the answer."""
    signals = controller.signals
    signal = signals.get(_signal_name(call))
    if controller.mode.value != "AUTO" and call.privilege == "none":
        raise Failure(403, Code.REJECT, f"Rejected: signal {signal.name} is not written in manual mode")
    simulated = call.parameter("lstate", "")
    if simulated:
        signals.simulate(signal.name, signal.value if simulated == "simulated" else None)
        if first_value(call.form, "lvalue") is None:
            controller.settle()
            return
        signal = signals.get(signal.name)
    if signal.device and not signal.type.is_output and not signal.is_simulated:
        raise Failure(403, Code.UNBLOCKED_INSIGNAL, f"input signal {signal.name} is not simulated")
    mode = call.parameter("mode", "value")
    if mode in ("invert", "toggle", "pulse") and signal.type.value.startswith("A"):
        raise invalid(f"an analog signal is not {mode}d")
    if mode in ("toggle", "pulse") and first_value(call.form, "Pulses") is not None:
        _pulse(controller, call, signal)
        return
    value = _inverted(controller, signal) if mode in ("invert", "toggle") else call.number("lvalue")
    if mode == "delay":
        signals.get(signal.name)
        controller.jobs.later(_milliseconds(call, "Delay"), lambda: _drive(controller, signal.name, value))
        return
    signals.set(signal.name, value)
    controller.settle()
    if mode == "pulse":
        back = _inverted(controller, signals.get(signal.name))
        controller.jobs.later(_milliseconds(call, "ActivePulse"), lambda: _drive(controller, signal.name, back))


def _pulse(controller: Irc5, call: Call, signal: Signal) -> None:
    """Pulse a signal: it becomes its opposite, or what ``lvalue`` says, and back again."""
    count = int(call.number("Pulses"))
    if not 1 <= count <= _MOST_PULSES:
        raise invalid(f"Pulses is 1 to {_MOST_PULSES}")
    is_toggle = call.parameter("mode", "value") == "toggle"
    active = _inverted(controller, signal) if is_toggle else call.number("lvalue")
    passive = signal.value if active != signal.value else _inverted(controller, signal)
    on, off = _milliseconds(call, "ActivePulse"), _milliseconds(call, "PassivePulse")
    controller.signals.set(signal.name, active)
    controller.settle()
    time = 0.0
    for number in range(count):
        time += on
        controller.jobs.later(time, lambda: _drive(controller, signal.name, passive))
        time += off
        if number < count - 1:
            controller.jobs.later(time, lambda: _drive(controller, signal.name, active))


def _drive(controller: Irc5, name: str, value: float) -> None:
    """The end of a delay or pulse; the signal may have gone with a restart meanwhile."""
    if name in controller.signals.names:
        controller.signals.drive(name, value)
        controller.settle()


def _inverted(controller: Irc5, signal: Signal) -> float:
    """All bits of a digital or group signal the other way round."""
    return float((1 << max(len(_bits(controller, signal)), 1)) - 1 - int(signal.value))


def _milliseconds(call: Call, name: str) -> float:
    """A time of the body [s]."""
    value = call.number(name) if first_value(call.form, name) is not None else 0.0
    if not 0.0 <= value <= _LONGEST_TIME_MS:
        raise invalid(f"{name} is 0 to {_LONGEST_TIME_MS:.0f} ms")
    return value * 1e-3


def _signal_name(call: Call) -> str:
    """The last part: network and device may be left out, and may be wrong for a virtual signal (rws.md §17)."""
    return call.names["signal"].rpartition("/")[2]


def _signal_fields(signal: Signal) -> dict[str, str]:
    return {
        "name": signal.name,
        "type": signal.type.value,
        "category": signal.category,
        "lvalue": printed(signal.value),
        "lstate": "simulated" if signal.is_simulated else "not simulated",
    }


def _physical_fields(signal: Signal) -> dict[str, str]:
    return {
        "phstate": "valid",
        "pvalue": printed(signal.value if signal.physical is None else signal.physical),
        "ltime-sec": "0",
        "ltime-microsec": "0",
        "ptime-sec": "0",
        "ptime-microsec": "0",
        "quality": "1",
    }


_SIGNALS = "/rw/iosystem/signals"
_NETWORK = "/rw/iosystem/networks/{network}"
_DEVICE = "/rw/iosystem/devices/{device:.+}"
_PROFINET = "/rw/iosystem/devices/{network}/{device}"
_SIGNAL_TYPES = ("DO", "DI", "AO", "AI", "GO", "GI")
_CONDITIONS: Values = {
    f"{name}{suffix}": allowed
    for suffix in ("", "2")
    for name, allowed in {
        "name": (),
        "device": (),
        "network": (),
        "category": (),
        "category-pon": (),
        "type": _SIGNAL_TYPES,
        "invert": ("true", "false", "TRUE", "FALSE"),
        "blocked": ("true", "false", "TRUE", "FALSE"),
    }.items()
}
_PAGES: Values = {"start": (), "limit": ()}
_WRITE: Values = {
    "lvalue": (),
    "lstate": ("simulated", "not simulated"),
    "mode": _MODES,
    "Delay": (),
    "Pulses": (),
    "ActivePulse": (),
    "PassivePulse": (),
    "userlog": ("true", "false"),
    "InputAsPhysical": ("true", "false"),
}
_DATA: Values = {"startbyte": (), "signaldata": (), "datamask": ()}
_CONFIG: Values = {"configtype": ("1", "2", "3")}
OPERATIONS = (
    Operation("GET", "/rw/iosystem", get_io_system),
    Operation("GET", "/rw/iosystem/networks", get_networks),
    Operation("POST", "/rw/iosystem/networks", search_networks, "search", {"name": (), "state": ()}, status=200),
    Operation("GET", _NETWORK, get_network),
    Operation("GET", _NETWORK, get_network_config, resource="config", query=_CONFIG),
    Operation("POST", _NETWORK, set_network, "set", {"lstate": ("start", "stop")}, needs_grant=Grant.IO_WRITE),
    Operation(
        "POST",
        _NETWORK,
        configure_network,
        "config",
        {"config-type": ("BITS", "GROUPS", "BOTH", "SCAN", "UNITS")},
        needs_grant=Grant.IO_WRITE,
    ),
    Operation("GET", "/rw/iosystem/devices", get_devices),
    Operation(
        "POST",
        "/rw/iosystem/devices",
        search_devices,
        "search",
        {"name": (), "lstate": ("enabled", "disabled"), "network": ()},
        status=200,
    ),
    Operation("GET", f"{_PROFINET}/upgradeinfo", get_upgrade, status=204),
    *(
        Operation(method, f"{_PROFINET}/{name}", not_there, lacks=_NO_PROFINET)
        for name in ("implicitdata", "explicitdata", "alarms/clear")
        for method in ("GET", "POST", "OPTIONS")
        if (name, method) != ("alarms/clear", "GET")
    ),
    Operation("GET", f"{_PROFINET}/alarms", not_there, lacks=_NO_PROFINET),
    Operation("GET", _DEVICE, get_device),
    Operation("GET", _DEVICE, get_device_config, resource="config", query=_CONFIG),
    Operation("POST", _DEVICE, set_device, "set", {"lstate": ("enable", "disable")}, needs_grant=Grant.IO_WRITE),
    Operation("POST", _DEVICE, refuse_data, "set-inputdata", _DATA, status=400, needs_grant=Grant.IO_WRITE),
    Operation("POST", _DEVICE, refuse_data, "set-outputdata", _DATA, status=400, needs_grant=Grant.IO_WRITE),
    Operation("GET", _SIGNALS, get_signals, query=_PAGES),
    Operation("POST", _SIGNALS, search_signals, "signal-search", _CONDITIONS, query=_PAGES, status=200),
    Operation("POST", _SIGNALS, search_signals, "signal-searchex", _CONDITIONS, query=_PAGES, status=200),
    Operation("POST", _SIGNALS, unblock_signals, "unblock-signal", needs_grant=Grant.IO_WRITE),
    Operation("GET", f"{_SIGNALS}/{{signal:.+}}", get_signal),
    Operation("GET", f"{_SIGNALS}/{{signal:.+}}", get_signal_config, resource="config", query=_CONFIG),
    Operation("POST", f"{_SIGNALS}/{{signal:.+}}", set_signal, "set", _WRITE, needs_grant=Grant.IO_WRITE),
)


# Message queues

_DIPC_BASE = "/rw/dipc/"
_DIPC_TITLE = "RobAPI2 DIPC"
MOST_DATA_BYTES = 444
"""Of the data of a message."""

MOST_QUEUES = 100
_RAPID_MESSAGE = re.compile(r"\s*(\w{1,32})\s*(?:\{([\d, ]{1,50})\})?\s*;(.*)", re.DOTALL)
"""What a RAPID program understands: ``string;"text"``, ``num{2};[1,2]``."""


@dataclass(frozen=True, slots=True)
class DipcMessage:
    """One message: its data as the sender wrote them, and who sent it."""

    data: str
    user_def: str
    kind: str
    command: str
    sender: str


@dataclass(slots=True)
class DipcQueue:
    """One queue.

    Attributes:
        session: of the client it belongs to.
        size: messages it holds.
        largest: longest message [bytes].
        slot: its number.
        taken: messages that have been taken from it.
    """

    name: str
    session: str
    size: int
    largest: int
    slot: int
    messages: deque[DipcMessage] = field(default_factory=deque)
    taken: int = 0

    def take(self) -> DipcMessage:
        """The oldest message, which the queue has no longer."""
        self.taken += 1
        return self.messages.popleft()


class MessageService:
    """The queues of all clients, which RAPID's tasks find and write to; a task's queue is ``RMQ_`` and its name."""

    def __init__(self, controller: Irc5) -> None:
        self._controller = controller
        self._queues: dict[str, DipcQueue] = {}
        self._made = 0
        path = "/rw/dipc/{queue}"
        size = {"dipc-queue-name": (), "dipc-queue-size": (), "dipc-max-msg-size": ()}
        message = {
            "dipc-src-queue-name": (),
            "dipc-cmd": (),
            "dipc-userdef": (),
            "dipc-msgtype": ("0", "1"),
            "dipc-data": (),
        }
        self.operations = (
            Operation("GET", "/rw/dipc", self.get_queues),
            Operation("POST", "/rw/dipc", self.create, "dipc-create", size, status=201),
            Operation("GET", path, self.get_queue),
            Operation("GET", path, self.read, "dipc-read", query={"timeout": ()}),
            Operation("POST", path, self.send, "dipc-send", message, status=200),
            Operation("DELETE", path, self.delete),
        )

    def keep(self, sessions: Collection[str]) -> None:
        """Forget the queues of all other sessions."""
        for queue in [queue for queue in self._queues.values() if queue.session not in sessions]:
            self._forget(queue)

    def find(self, name: str) -> DipcQueue | None:
        """The queue of that name, or None."""
        return self._queues.get(name.lower())

    def get_queues(self, controller: Irc5, call: Call) -> Page:
        sizes = entry("dipc-info-li", "info", "", max_body_size=str(MOST_DATA_BYTES), max_pkg_size="5000")
        queues = (entry("dipc-queue-li", queue.name, f"dipc/{queue.name}") for queue in self._queues.values())
        tasks = (entry("dipc-queue-li", f"RMQ_{name}", f"dipc/RMQ_{name}") for name in controller.tasks)
        return resource(_DIPC_TITLE, "/rw/", "dipc", sizes, *tasks, *queues)

    def create(self, controller: Irc5, call: Call) -> None:
        name = call.required("dipc-queue-name")
        size, largest = int(call.number("dipc-queue-size")), int(call.number("dipc-max-msg-size"))
        if not name or not 1 <= size <= 32767 or not 1 <= largest <= MOST_DATA_BYTES:
            raise invalid(f"a queue has a name, a size of 1 to 32767 and messages of 1 to {MOST_DATA_BYTES} bytes")
        if self.find(name) is not None or name.lower() in (f"rmq_{task}".lower() for task in controller.tasks):
            raise invalid(f"there is a queue {name} already")
        if len(self._queues) >= MOST_QUEUES:
            raise Failure(400, Code.MAX_LIMIT_REACHED, f"there are {MOST_QUEUES} queues at most")
        self._made += 1
        queue = self._queues[name.lower()] = DipcQueue(name, call.session, size, largest, self._made)

        def receive(message: Message) -> bool:
            sizes = f"{{{','.join(map(str, message.sizes))}}}" if message.sizes else ""
            data = f"{message.type_name}{sizes};{message.text}"
            if len(queue.messages) >= queue.size:
                raise RapidRuntimeError("ERR_RMQ_FULL", f"The message queue '{name}' holds {queue.size} messages.")
            queue.messages.append(DipcMessage(data, f"{message.user_defined:g}", "1", "111", message.sender))
            return True

        queues = controller.devices.queues
        queues.open(name)
        queues.listeners[name.lower()] = receive

    def get_queue(self, controller: Irc5, call: Call) -> Page:
        for number, task in enumerate(controller.tasks, 1):
            if f"RMQ_{task}".lower() == call.names["queue"].lower():
                of_task = DipcQueue(f"RMQ_{task}", "", MOST_MESSAGES, LONGEST_MESSAGE, MOST_QUEUES + number)
                return self._page(of_task)
        return self._page(self._find(call))

    def _page(self, queue: DipcQueue) -> Page:
        fields = {
            "queue-size": str(queue.size),
            "queue-name": queue.name,
            "queue-max-msg-size": str(queue.largest),
            "queue-slot-id": str(queue.slot),
        }
        return resource(_DIPC_TITLE, _DIPC_BASE, queue.name, State("dipc-queue", queue.name, fields))

    def read(self, controller: Irc5, call: Call) -> Page:
        """The oldest message; an empty page when there is none: the answer does not wait for one."""
        queue = self._find(call)
        states = []
        if queue.messages:
            message = queue.take()
            sender = self.find(message.sender)
            fields = {
                "dipc-data": message.data,
                "dipc-userdef": message.user_def,
                "dipc-msgtype": message.kind,
                "dipc-cmd": message.command,
                "queue-name": queue.name,
                "queue-size": str(queue.size),
                "queue-sid": str(queue.slot),
                "queue-did": str(sender.slot if sender else 0),
            }
            states.append(State("dipc-read-li", queue.name, fields))
        return resource(_DIPC_TITLE, _DIPC_BASE, queue.name, *states)

    def send(self, controller: Irc5, call: Call) -> None:
        task = next((name for name in controller.tasks if f"RMQ_{name}".lower() == call.names["queue"].lower()), None)
        if task is not None:
            self._send_to_task(task, call)
            return
        queue, data = self._find(call), call.required("dipc-data")
        if len(data.encode()) > queue.largest:
            raise invalid(f"a message to {queue.name} has up to {queue.largest} bytes")
        if len(queue.messages) >= queue.size:
            raise Failure(400, Code.MAX_LIMIT_REACHED, f"the queue {queue.name} is full")
        queue.messages.append(
            DipcMessage(
                data,
                call.required("dipc-userdef"),
                call.required("dipc-msgtype"),
                call.required("dipc-cmd"),
                call.required("dipc-src-queue-name"),
            )
        )

    def delete(self, controller: Irc5, call: Call) -> None:
        queue = self._find(call)
        if queue.session != call.session:
            raise Failure(403, Code.DENIED, f"the queue {queue.name} belongs to another client")
        self._forget(queue)

    def _forget(self, queue: DipcQueue) -> None:
        queues = self._controller.devices.queues
        queues.listeners.pop(queue.name.lower(), None)
        queues.close(queue.name)
        del self._queues[queue.name.lower()]

    def _send_to_task(self, task: str, call: Call) -> None:
        queues, name = self._controller.devices.queues, f"RMQ_{task}"
        sender, user_defined = call.required("dipc-src-queue-name"), call.number("dipc-userdef")
        match = _RAPID_MESSAGE.fullmatch(call.required("dipc-data"))
        if match is None:
            raise invalid('a RAPID task takes a type and a value, such as string;"text" or num{2};[1,2]')
        type_name, sizes, text = match.groups()
        dimensions = tuple(int(size) for size in (sizes or "").split(",") if size.strip().isdecimal())
        if len(text.encode()) > LONGEST_MESSAGE:
            raise invalid(f"a message to {name} has up to {LONGEST_MESSAGE} bytes")
        queues.open(name)
        try:
            queues.send(name, Message(type_name, dimensions, text, sender, user_defined))
        except RapidRuntimeError as error:
            raise Failure(400, Code.MAX_LIMIT_REACHED, str(error)) from error

    def _find(self, call: Call) -> DipcQueue:
        queue = self.find(call.names["queue"])
        if queue is None:
            raise Failure(404, Code.UNRESOLVED_URL, f"there is no queue {call.names['queue'][:50]!r}")
        return queue
