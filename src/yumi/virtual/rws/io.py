"""``/rw/iosystem``: the signals (reference/rws.md §7).

``/rw/motionsystem``: the mechanical units and where they stand (reference/rws.md §8).
"""

from __future__ import annotations

from math import isfinite

from yumi.rws import documents as forms
from yumi.rws.documents import Link, Page, State
from yumi.rws.types import Code
from yumi.virtual.controller.signals import Signal, path_of, printed
from yumi.virtual.controller.units import MechanicalUnit
from yumi.virtual.rws.routes import Call, Controller, Failure, Route, entry, invalid, resource

_BASE = "/rw/iosystem/"
_DEFAULT_LIMIT = 100


def _io_system(controller: Controller, call: Call) -> Page:
    return resource("io", _BASE, "", entry("ios-signals-li", "signals"))


def _signals(controller: Controller, call: Call) -> Page:
    """All signals, or one page of them where the client asks for pages."""
    names = controller.signals.names
    start, limit = call.number_option("start", 0), call.number_option("limit", _DEFAULT_LIMIT)
    is_paged = call.option("start") is not None or call.option("limit") is not None
    shown = names[start : start + limit] if is_paged else names
    following = start + limit
    more = f"signals?start={following}&limit={limit}" if is_paged and following < len(names) else None
    entries = (_entry(controller.signals.get(name)) for name in shown)
    return resource("io", _BASE, "signals", *entries, next_href=more)


def _signal(controller: Controller, call: Call) -> Page:
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


def _set_signal(controller: Controller, call: Call) -> None:
    """Write a signal; the interrupts of its edge run before the answer."""
    signal = controller.signals.get(_name(call))
    _check_writable(controller, signal)
    controller.signals.set(signal.name, _wanted(signal, call))
    controller.settle()


def _check_writable(controller: Controller, signal: Signal) -> None:
    if controller.mode.value != "AUTO":
        raise Failure(403, Code.REJECT, f"Rejected: signal {signal.name} is not written in manual mode")
    if signal.device and signal.type.value.endswith("I"):
        raise Failure(403, Code.UNBLOCKED_INSIGNAL, f"input signal {signal.name} is not simulated")


def _wanted(signal: Signal, call: Call) -> float:
    """The value a write asks for; pulses and delays of the controller's own are not offered."""
    mode = forms.first(call.form, "mode") or "value"
    if mode in ("invert", "toggle"):
        return 1.0 - signal.value
    if mode != "value":
        raise Failure(400, Code.NOTIMPL, f"mode {mode} is not available")
    text = call.required("lvalue")
    try:
        value = float(text)
    except ValueError:
        raise invalid(f"lvalue is a number, not {text!r}") from None
    if not isfinite(value):
        raise invalid(f"lvalue is a finite number, not {text!r}")
    return value


def _name(call: Call) -> str:
    """The last part: network and device may be left out, and may be wrong for a virtual signal (rws.md §17)."""
    return call.names["signal"].rpartition("/")[2]


def _entry(signal: Signal) -> State:
    path = path_of(signal)
    return State("ios-signal-li", path, _fields(signal), (Link("self", f"signals/{path}"),))


def _fields(signal: Signal) -> dict[str, str]:
    return {
        "name": signal.name,
        "type": signal.type.value,
        "category": signal.category,
        "lvalue": printed(signal.value),
        "lstate": "not simulated",
    }


ROUTES = (
    Route("GET", "/rw/iosystem", _io_system),
    Route("GET", "/rw/iosystem/signals", _signals),
    Route("GET", "/rw/iosystem/signals/{signal*}", _signal),
    Route("POST", "/rw/iosystem/signals/{signal*}", _set_signal, "set"),
)


_RWS_MOTION_BASE = "/rw/motionsystem/"
_NO_AXIS = 8.9e9  # 9E9 and above in RAPID: not connected


def _motion_system(controller: Controller, call: Call) -> Page:
    active = State("ms", "motionsystem", {"mechunit-name": controller.units[0].name})
    return resource("motionsystem", "/rw/", "motionsystem", active, entry("ms-mechunit-li", "mechunits"))


def _units(controller: Controller, call: Call) -> Page:
    entries = (_unit_entry(unit) for unit in controller.units)
    return resource("motionsystem", _RWS_MOTION_BASE, "mechunits", *entries)


def _unit_entry(unit: MechanicalUnit) -> State:
    fields = {"mode": unit.mode, "activation-allowed": "True", "drive-module": str(unit.drive_module)}
    return State("ms-mechunit-li", unit.name, fields, (Link("self", f"mechunits/{unit.name}"),))


def _unit(controller: Controller, call: Call) -> Page:
    """A unit's fields: all, or the groups and single fields in ``resource``, joined by ``;``."""
    unit = _find(controller, call)
    static, dynamic = _static(unit), _dynamic(unit)
    wanted = (call.option("resource") or "static;dynamic").split(";")
    fields = {
        name: text
        for group, members in (("static", static), ("dynamic", dynamic))
        for name, text in members.items()
        if group in wanted or name in wanted or name.removesuffix("-name") in wanted
    }
    return resource("motionsystem", f"{_RWS_MOTION_BASE}mechunits/", unit.name, State("ms-mechunit", unit.name, fields))


def _joint_target(controller: Controller, call: Call) -> Page:
    unit = _find(controller, call)
    robax, extax = controller.joint_target(unit.name)
    fields = {f"rax_{axis}": _angle(angle) for axis, angle in enumerate(robax, start=1)}
    fields |= {f"eax_{letter}": _angle(angle) for letter, angle in zip("abcdef", extax, strict=True)}
    state = State("ms-jointtarget", unit.name, fields)
    return resource("motionsystem", f"{_RWS_MOTION_BASE}mechunits/{unit.name}/", "jointtarget", state)


def _find(controller: Controller, call: Call) -> MechanicalUnit:
    name = call.names["unit"]
    for unit in controller.units:
        if unit.name.upper() == name.upper():
            return unit
    raise Failure(404, Code.NO_SUCH_MECHUNIT, f"there is no mechanical unit {name}")


def _static(unit: MechanicalUnit) -> dict[str, str]:
    return {
        "task-name": unit.task,
        "type": unit.type,
        "axes": str(unit.axes),
        "axes-total": str(unit.axes_total),
        "is-integrated-unit": unit.is_integrated_unit,
        "has-integrated-unit": unit.has_integrated_unit,
    }


def _dynamic(unit: MechanicalUnit) -> dict[str, str]:
    return {
        "tool-name": unit.tool,
        "wobj-name": unit.wobj,
        "payload-name": unit.payload,
        "total-payload-name": unit.total_payload,
        "status": unit.status,
        "mode": unit.mode,
        "jog-mode": unit.jog_mode,
        "coord-system": unit.coord_system,
    }


def _angle(angle_deg: float) -> str:
    return "9E+09" if angle_deg > _NO_AXIS else f"{angle_deg:.7g}"


RWS_MOTION_ROUTES = (
    Route("GET", "/rw/motionsystem", _motion_system),
    Route("GET", "/rw/motionsystem/mechunits", _units),
    Route("GET", "/rw/motionsystem/mechunits/{unit}", _unit),
    Route("GET", "/rw/motionsystem/mechunits/{unit}/jointtarget", _joint_target),
)
