"""The virtual controller's answers on ``/rw/iosystem``: networks, devices and signals (reference/rws.md §7)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from abb_protocols.rws.documents import Page, Pairs, RwsLink, RwsState, first_value
from abb_protocols.rws.operations import io as table
from abb_protocols.rws.values import RwsCode
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.controller.signals import ControllerSignal, printed_signal, signal_path
from virtual_irc5.rws.render import page_at, page_entry
from virtual_irc5.rws.router import Routes, absent_routes
from virtual_irc5.rws.rws_call import CallFailure, RwsCall, bad_call

_IO_BASE = "/rw/iosystem/"
_DEFAULT_LIMIT = 100
_LOCAL = "Local"
_LOCAL_DEVICES = ("DRV_1", "PANEL")
_DEVICE_TYPES = ("ETHERNETIP_DEVICE", "DEVICENET_DEVICE", "ETHERNETIP_INTERNAL_DEVICE", "DEVICENET_INTERNAL_DEVICE")
_LONGEST_TIME_MS = 1e6  # of a delay or pulse
_MOST_PULSES = 1000


ROUTES = Routes()


@dataclass(frozen=True, slots=True)
class _Device:
    """One I/O device: its network and address as the configuration says."""

    name: str
    network: str
    address: str = "-"


@ROUTES.answer(table.IO_SYSTEM)
def _get_io_system(controller: Irc5, call: RwsCall) -> Page:
    names = ("networks", "devices", "signals")
    return page_at(
        "io", "/rw/", "iosystem", *(page_entry(f"ios-{name}-li", name, f"iosystem/{name}") for name in names)
    )


# Networks and devices


def _devices(controller: Irc5) -> list[_Device]:
    found = [_Device(name, _LOCAL) for name in _LOCAL_DEVICES]
    for kind in _DEVICE_TYPES:
        for each in controller.effective.instances("EIO", kind):
            network = each.attributes.get("Network") or kind.partition("_")[0].capitalize()
            found.append(_Device(each.name, network, each.attributes.get("Address") or "-"))
    return found


def _networks(controller: Irc5) -> list[str]:
    return list(dict.fromkeys(device.network for device in _devices(controller)))


def _network_state(controller: Irc5, name: str, type: str) -> RwsState:
    stopped = name in controller.signals.stopped
    fields = {
        "name": name,
        "pstate": "halted" if stopped else "running",
        "lstate": "stopped" if stopped else "started",
    }
    return RwsState(type, name, fields, (RwsLink("self", f"networks/{name}"), RwsLink("devices", "devices")))


@ROUTES.answer(table.NETWORKS)
def _get_networks(controller: Irc5, call: RwsCall) -> Page:
    states = (_network_state(controller, name, "ios-network-li") for name in _networks(controller))
    return page_at("io", _IO_BASE, "networks", *states)


@ROUTES.answer(table.SEARCH_NETWORKS)
def _search_networks(controller: Irc5, call: RwsCall) -> Page:
    name, state = call.parameter("name", ""), call.parameter("state", "")
    if not name and not state:
        raise bad_call("a search needs name or state")
    states = [_network_state(controller, each, "ios-network-li") for each in _networks(controller)]
    found = (
        each
        for each in states
        if name.lower() in each.title.lower() and state in ("", each.fields["pstate"], each.fields["lstate"])
    )
    return page_at("io", _IO_BASE, "networks", *found)


def _network(controller: Irc5, call: RwsCall) -> str:
    asked = call.names["network"]
    for name in _networks(controller):
        if name.lower() == asked.lower():
            return name
    raise CallFailure(404, RwsCode.UNRESOLVED_URL, f"there is no network {asked[:50]!r}")


@ROUTES.answer(table.NETWORK)
def _get_network(controller: Irc5, call: RwsCall) -> Page:
    name = _network(controller, call)
    return page_at("io", _IO_BASE, f"networks/{name}", _network_state(controller, name, "ios-network"))


@ROUTES.answer(table.SET_NETWORK)
def _set_network(controller: Irc5, call: RwsCall) -> None:
    name = _network(controller, call)
    if call.required("lstate") == "start":
        controller.signals.stopped.discard(name)
    elif name == _LOCAL:
        raise CallFailure(403, RwsCode.UNIT_DISABLE_NOT_ALLOWED, "the network Local cannot be stopped")
    else:
        controller.signals.stopped.add(name)


@ROUTES.answer(table.NETWORK_CONFIG)
def _get_network_config(controller: Irc5, call: RwsCall) -> Page:
    name = _network(controller, call)
    fields = {"networkname": name, "networktype": name[:3].upper(), "networkaddress": "-"}
    return page_at("io", _IO_BASE, f"networks/{name}", RwsState("ios-network-config-runtime", name, fields))


@ROUTES.answer(table.CONFIGURE_NETWORK)
def _configure_network(controller: Irc5, call: RwsCall) -> None:
    """Ask a network to write its configuration anew: ours is always that of the system parameters."""
    _network(controller, call)
    call.required("config-type")


def _device_state(controller: Irc5, device: _Device, type: str) -> RwsState:
    disabled, stopped = device.name in controller.signals.disabled, device.network in controller.signals.stopped
    fields = {
        "name": device.name,
        "lstate": "disabled" if disabled else "enabled",
        "pstate": "deact" if disabled else "unconnect" if stopped else "running",
        "address": device.address,
    }
    path = f"{device.network}/{device.name}"
    return RwsState(type, path, fields, (RwsLink("self", f"devices/{path}"),))


@ROUTES.answer(table.DEVICES)
def _get_devices(controller: Irc5, call: RwsCall) -> Page:
    states = (_device_state(controller, device, "ios-device-li") for device in _devices(controller))
    return page_at("io", _IO_BASE, "devices", *states)


@ROUTES.answer(table.SEARCH_DEVICES)
def _search_devices(controller: Irc5, call: RwsCall) -> Page:
    name, state, network = (call.parameter(each, "").lower() for each in ("name", "lstate", "network"))
    if not name and not state:
        raise bad_call("a search needs name or lstate")
    states = [_device_state(controller, device, "ios-device-li") for device in _devices(controller)]
    found = (
        each
        for each in states
        if name in each.fields["name"].lower()
        and state in ("", each.fields["lstate"])
        and network in ("", each.title.partition("/")[0].lower())
    )
    return page_at("io", _IO_BASE, "devices", *found)


def _device(controller: Irc5, call: RwsCall) -> _Device:
    name = call.names["device"].rpartition("/")[2]
    for device in _devices(controller):
        if device.name.lower() == name.lower():
            return device
    raise CallFailure(404, RwsCode.UNRESOLVED_URL, f"there is no device {name[:50]!r}")


@ROUTES.answer(table.DEVICE)
def _get_device(controller: Irc5, call: RwsCall) -> Page:
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
    return page_at("io", _IO_BASE, f"devices/{state.title}", replace(state, fields={**state.fields, **contents}))


def _bits(controller: Irc5, signal: ControllerSignal) -> Sequence[int]:
    """The bits of a device that a signal has, lowest first: ``5`` or ``8-15`` of its DeviceMap."""
    instance = controller.effective.find("EIO", "EIO_SIGNAL", signal.name)
    first, _, last = (instance.attributes.get("DeviceMap", "") if instance else "").partition("-")
    return range(int(first), int(last or first) + 1) if first.isdecimal() and (last or first).isdecimal() else ()


@ROUTES.answer(table.SET_DEVICE)
def _set_device(controller: Irc5, call: RwsCall) -> None:
    device = _device(controller, call)
    if call.required("lstate") == "enable":
        controller.signals.disabled.discard(device.name)
    elif device.network == _LOCAL:
        raise CallFailure(403, RwsCode.UNIT_DISABLE_NOT_ALLOWED, f"the device {device.name} cannot be disabled")
    else:
        controller.signals.disabled.add(device.name)


@ROUTES.answer(table.DEVICE_CONFIG)
def _get_device_config(controller: Irc5, call: RwsCall) -> Page:
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
        **table.DEVICE_CONFIG.answered.write(table.AccessRights(True, True, True, True, True)),
        "unitaddress": device.address,
        "denydeactivate": "TRUE" if device.network == _LOCAL else "FALSE",
    }
    path = f"devices/{device.network}/{device.name}"
    return page_at("io", _IO_BASE, path, RwsState("ios-device-config-runtime", device.name, fields))


@ROUTES.answer(table.UPGRADE_OF_DEVICES)
def _get_upgrade(controller: Irc5, call: RwsCall) -> None:
    """No firmware is waiting for a device."""
    _device(controller, call)


@ROUTES.answer(table.SET_DEVICE_INPUT, table.SET_DEVICE_OUTPUT)
def _refuse_data(controller: Irc5, call: RwsCall) -> None:
    _device(controller, call)
    raise CallFailure(
        400, RwsCode.SERVICE_NOT_SUPPORTED, "the data of a device are set in RobotStudio's controllers alone"
    )


# Signals


def _signals(controller: Irc5) -> Iterable[ControllerSignal]:
    return map(controller.signals.get, controller.signals.names)


@ROUTES.answer(table.SIGNALS)
def _get_signals(controller: Irc5, call: RwsCall) -> Page:
    """All signals, or one page of them where the client asks for pages."""
    return _listed(controller, call, list(_signals(controller)), "signals")


def _listed(
    controller: Irc5, call: RwsCall, signals: Sequence[ControllerSignal], href: str, *, is_full: bool = False
) -> Page:
    start, limit = call.number_option("start", 0), call.number_option("limit", _DEFAULT_LIMIT)
    is_paged = call.option("start") is not None or call.option("limit") is not None
    shown = signals[start : start + limit] if is_paged else signals
    following = start + limit
    more = f"{href}?start={following}&limit={limit}" if is_paged and following < len(signals) else None
    entries = (
        RwsState(
            "ios-signal-li",
            signal_path(one),
            {**_signal_fields(one), **(_physical_fields(one) | {"write-access-level": one.access} if is_full else {})},
            (RwsLink("self", f"signals/{signal_path(one)}"),),
        )
        for one in shown
    )
    return page_at("io", _IO_BASE, href, *entries, next_href=more)


@ROUTES.answer(table.SIGNAL_SEARCH, table.SIGNAL_SEARCHEX)
def _search_signals(controller: Irc5, call: RwsCall) -> Page:
    """The signals that fit; two sets of conditions may be given, one of them inverted."""
    found = [
        signal
        for signal in _signals(controller)
        if _fits(controller, signal, call.form, "") and _fits(controller, signal, call.form, "2")
    ]
    return _listed(controller, call, found, "signals", is_full=call.option("action") == "signal-searchex")


def _fits(controller: Irc5, signal: ControllerSignal, form: Pairs, suffix: str) -> bool:
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


@ROUTES.answer(table.UNBLOCK_SIGNALS)
def _unblock_signals(controller: Irc5, call: RwsCall) -> None:
    controller.signals.end_simulations()
    controller.settle()


@ROUTES.answer(table.SIGNAL)
def _get_signal(controller: Irc5, call: RwsCall) -> Page:
    signal = controller.signals.get(_signal_name(call))
    fields = {**_signal_fields(signal), "unitnm": signal.device, **_physical_fields(signal)}
    links = (RwsLink("device", f"devices/{signal.device}"),) if signal.device else ()
    return page_at(
        "io", _IO_BASE, f"signals/{signal_path(signal)}", RwsState("ios-signal", signal_path(signal), fields, links)
    )


@ROUTES.answer(table.SIGNAL_CONFIG)
def _get_signal_config(controller: Irc5, call: RwsCall) -> Page:
    signal = controller.signals.get(_signal_name(call))
    may_write = signal.access.upper() == "ALL"
    rights = table.AccessRights(True, True, may_write, may_write, may_write)
    fields = {
        "signalname": signal.name,
        "signalbits": str(max(len(_bits(controller, signal)), 1)),
        **table.SIGNAL_CONFIG.answered.write(rights),
        "setbydevicetransfer": "FALSE",
    }
    return page_at(
        "io", _IO_BASE, f"signals/{signal_path(signal)}", RwsState("ios-signal-config-runtime", signal.name, fields)
    )


@ROUTES.answer(table.SET_SIGNAL)
def _set_signal(controller: Irc5, call: RwsCall) -> None:
    """Write a signal or simulate it; the interrupts of its edge run before the answer."""
    signals = controller.signals
    signal = signals.get(_signal_name(call))
    if controller.mode.value != "AUTO" and call.privilege == "none":
        raise CallFailure(403, RwsCode.REJECT, f"Rejected: signal {signal.name} is not written in manual mode")
    simulated = call.parameter("lstate", "")
    if simulated:
        signals.simulate(signal.name, signal.value if simulated == "simulated" else None)
        if first_value(call.form, "lvalue") is None:
            controller.settle()
            return
        signal = signals.get(signal.name)
    if signal.device and not signal.type.is_output and not signal.is_simulated:
        raise CallFailure(403, RwsCode.UNBLOCKED_INSIGNAL, f"input signal {signal.name} is not simulated")
    mode = call.parameter("mode", "value")
    if mode in ("invert", "toggle", "pulse") and signal.type.value.startswith("A"):
        raise bad_call(f"an analog signal is not {mode}d")
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


def _pulse(controller: Irc5, call: RwsCall, signal: ControllerSignal) -> None:
    """Pulse a signal: it becomes its opposite, or what ``lvalue`` says, and back again."""
    count = int(call.number("Pulses"))
    if not 1 <= count <= _MOST_PULSES:
        raise bad_call(f"Pulses is 1 to {_MOST_PULSES}")
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


def _inverted(controller: Irc5, signal: ControllerSignal) -> float:
    """All bits of a digital or group signal the other way round."""
    return float((1 << max(len(_bits(controller, signal)), 1)) - 1 - int(signal.value))


def _milliseconds(call: RwsCall, name: str) -> float:
    """A time of the body [s]."""
    value = call.number(name) if first_value(call.form, name) is not None else 0.0
    if not 0.0 <= value <= _LONGEST_TIME_MS:
        raise bad_call(f"{name} is 0 to {_LONGEST_TIME_MS:.0f} ms")
    return value * 1e-3


def _signal_name(call: RwsCall) -> str:
    """The last part: network and device may be left out, and may be wrong for a virtual signal (rws.md §17)."""
    return call.names["signal"].rpartition("/")[2]


def _signal_fields(signal: ControllerSignal) -> dict[str, str]:
    return {
        "name": signal.name,
        "type": signal.type.value,
        "category": signal.category,
        "lvalue": printed_signal(signal.value),
        "lstate": "simulated" if signal.is_simulated else "not simulated",
    }


def _physical_fields(signal: ControllerSignal) -> dict[str, str]:
    return {
        "phstate": "valid",
        "pvalue": printed_signal(signal.value if signal.physical is None else signal.physical),
        "ltime-sec": "0",
        "ltime-microsec": "0",
        "ptime-sec": "0",
        "ptime-microsec": "0",
        "quality": "1",
    }


ROUTES += absent_routes(table.ABSENT_FROM_IO)
