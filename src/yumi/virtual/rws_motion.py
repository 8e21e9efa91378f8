"""``/rw/motionsystem``: the mechanical units and where they stand (reference/rws.md §8)."""

from __future__ import annotations

from yumi.rws.codes import Code
from yumi.rws.pages import Link, Page, State
from yumi.virtual.mechanical_units import MechanicalUnit
from yumi.virtual.rws_port import Controller
from yumi.virtual.rws_routes import Call, Failure, Route, entry, resource

_BASE = "/rw/motionsystem/"
_NO_AXIS = 8.9e9  # 9E9 and above in RAPID: not connected


def _motion_system(controller: Controller, call: Call) -> Page:
    active = State("ms", "motionsystem", {"mechunit-name": controller.units[0].name})
    return resource("motionsystem", "/rw/", "motionsystem", active, entry("ms-mechunit-li", "mechunits"))


def _units(controller: Controller, call: Call) -> Page:
    entries = (_unit_entry(unit) for unit in controller.units)
    return resource("motionsystem", _BASE, "mechunits", *entries)


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
    return resource("motionsystem", f"{_BASE}mechunits/", unit.name, State("ms-mechunit", unit.name, fields))


def _joint_target(controller: Controller, call: Call) -> Page:
    unit = _find(controller, call)
    robax, extax = controller.joint_target(unit.name)
    fields = {f"rax_{axis}": _angle(angle) for axis, angle in enumerate(robax, start=1)}
    fields |= {f"eax_{letter}": _angle(angle) for letter, angle in zip("abcdef", extax, strict=True)}
    state = State("ms-jointtarget", unit.name, fields)
    return resource("motionsystem", f"{_BASE}mechunits/{unit.name}/", "jointtarget", state)


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


ROUTES = (
    Route("GET", "/rw/motionsystem", _motion_system),
    Route("GET", "/rw/motionsystem/mechunits", _units),
    Route("GET", "/rw/motionsystem/mechunits/{unit}", _unit),
    Route("GET", "/rw/motionsystem/mechunits/{unit}/jointtarget", _joint_target),
)
