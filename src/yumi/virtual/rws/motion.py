"""``/rw/motionsystem``: the mechanical units and their positions (reference/rws.md §8)."""

from __future__ import annotations

from yumi.rws.documents import Page, State
from yumi.rws.types import Code
from yumi.virtual.controller.controller import Irc5
from yumi.virtual.controller.units import MechanicalUnit
from yumi.virtual.rws.operations import Call, Failure, Operation, entry, resource

_BASE = "/rw/motionsystem/"
_NO_AXIS = 8.9e9  # 9E9 and above in RAPID: not connected


def get_motion_system(controller: Irc5, call: Call) -> Page:
    active = State("ms", "motionsystem", {"mechunit-name": controller.units[0].name})
    return resource("motionsystem", "/rw/", "motionsystem", active, entry("ms-mechunit-li", "mechunits"))


def get_units(controller: Irc5, call: Call) -> Page:
    entries = (
        entry(
            "ms-mechunit-li",
            unit.name,
            f"mechunits/{unit.name}",
            mode=unit.mode,
            activation_allowed="True",
            drive_module=str(unit.drive_module),
        )
        for unit in controller.units
    )
    return resource("motionsystem", _BASE, "mechunits", *entries)


def get_unit(controller: Irc5, call: Call) -> Page:
    """A unit's fields: all, or the groups and single fields in ``resource``, joined by ``;``."""
    unit = _find(controller, call)
    groups = {
        "static": {
            "task-name": unit.task,
            "type": unit.type,
            "axes": str(unit.axes),
            "axes-total": str(unit.axes_total),
            "is-integrated-unit": unit.is_integrated_unit,
            "has-integrated-unit": unit.has_integrated_unit,
        },
        "dynamic": {
            "tool-name": unit.tool,
            "wobj-name": unit.wobj,
            "payload-name": unit.payload,
            "total-payload-name": unit.total_payload,
            "status": unit.status,
            "mode": unit.mode,
            "jog-mode": unit.jog_mode,
            "coord-system": unit.coord_system,
        },
    }
    asked = (call.option("resource") or "static;dynamic").split(";")
    fields = {
        name: text
        for group, members in groups.items()
        for name, text in members.items()
        if group in asked or name in asked or name.removesuffix("-name") in asked
    }
    return resource("motionsystem", f"{_BASE}mechunits/", unit.name, State("ms-mechunit", unit.name, fields))


def get_joint_target(controller: Irc5, call: Call) -> Page:
    unit = _find(controller, call)
    robax, extax = controller.joint_target(unit.name)
    names = (*(f"rax_{axis}" for axis in range(1, 7)), *(f"eax_{letter}" for letter in "abcdef"))
    fields = {
        name: "9E+09" if angle_deg > _NO_AXIS else f"{angle_deg:.7g}"
        for name, angle_deg in zip(names, (*robax, *extax), strict=True)
    }
    state = State("ms-jointtarget", unit.name, fields)
    return resource("motionsystem", f"{_BASE}mechunits/{unit.name}/", "jointtarget", state)


def _find(controller: Irc5, call: Call) -> MechanicalUnit:
    name = call.names["unit"]
    for unit in controller.units:
        if unit.name.upper() == name.upper():
            return unit
    raise Failure(404, Code.NO_SUCH_MECHUNIT, f"there is no mechanical unit {name}")


OPERATIONS = (
    Operation("GET", "/rw/motionsystem", get_motion_system),
    Operation("GET", "/rw/motionsystem/mechunits", get_units),
    Operation("GET", "/rw/motionsystem/mechunits/{unit}", get_unit),
    Operation("GET", "/rw/motionsystem/mechunits/{unit}/jointtarget", get_joint_target),
)
