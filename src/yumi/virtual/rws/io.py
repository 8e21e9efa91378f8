"""``/rw/iosystem``: the signals (reference/rws.md §7)."""

from __future__ import annotations

from yumi.rws.documents import Link, Page, State
from yumi.rws.types import Code
from yumi.virtual.controller.controller import Irc5
from yumi.virtual.controller.signals import Signal, path_of, printed
from yumi.virtual.rws.operations import Call, Failure, Operation, entry, resource

_BASE = "/rw/iosystem/"
_DEFAULT_LIMIT = 100


def get_io_system(controller: Irc5, call: Call) -> Page:
    return resource("io", _BASE, "", entry("ios-signals-li", "signals"))


def get_signals(controller: Irc5, call: Call) -> Page:
    """All signals, or one page of them where the client asks for pages."""
    names = controller.signals.names
    start, limit = call.number_option("start", 0), call.number_option("limit", _DEFAULT_LIMIT)
    is_paged = call.option("start") is not None or call.option("limit") is not None
    shown = names[start : start + limit] if is_paged else names
    following = start + limit
    more = f"signals?start={following}&limit={limit}" if is_paged and following < len(names) else None
    signals = [(path_of(signal), signal) for signal in map(controller.signals.get, shown)]
    entries = (State("ios-signal-li", path, _fields(one), (Link("self", f"signals/{path}"),)) for path, one in signals)
    return resource("io", _BASE, "signals", *entries, next_href=more)


def get_signal(controller: Irc5, call: Call) -> Page:
    signal = controller.signals.get(_name(call))
    text = printed(signal.value)
    fields = {
        **_fields(signal),
        "unitnm": signal.device,
        "phstate": "valid",
        "pvalue": text,
        "ltime-sec": "0",
        "ltime-microsec": "0",
        "ptime-sec": "0",
        "ptime-microsec": "0",
        "quality": "1",
    }
    links = (Link("device", f"devices/{signal.device}"),) if signal.device else ()
    return resource("io", _BASE, f"signals/{path_of(signal)}", State("ios-signal", path_of(signal), fields, links))


def set_signal(controller: Irc5, call: Call) -> None:
    """Write a signal; the interrupts of its edge run before the answer."""
    signal = controller.signals.get(_name(call))
    if controller.mode.value != "AUTO":
        raise Failure(403, Code.REJECT, f"Rejected: signal {signal.name} is not written in manual mode")
    if signal.device and not signal.type.is_output:
        raise Failure(403, Code.UNBLOCKED_INSIGNAL, f"input signal {signal.name} is not simulated")
    mode = call.parameter("mode", "value")
    if mode in ("invert", "toggle"):
        value = 1.0 - signal.value
    elif mode == "value":
        value = call.number("lvalue")
    else:  # pulses and delays of the controller's own
        raise Failure(400, Code.NOTIMPL, f"mode {mode} is not available")
    controller.signals.set(signal.name, value)
    controller.settle()


def _name(call: Call) -> str:
    """The last part: network and device may be left out, and may be wrong for a virtual signal (rws.md §17)."""
    return call.names["signal"].rpartition("/")[2]


def _fields(signal: Signal) -> dict[str, str]:
    return {
        "name": signal.name,
        "type": signal.type.value,
        "category": signal.category,
        "lvalue": printed(signal.value),
        "lstate": "not simulated",
    }


OPERATIONS = (
    Operation("GET", "/rw/iosystem", get_io_system),
    Operation("GET", "/rw/iosystem/signals", get_signals),
    Operation("GET", "/rw/iosystem/signals/{signal:.+}", get_signal),
    Operation("POST", "/rw/iosystem/signals/{signal:.+}", set_signal, "set"),
)
