r"""RAPID's world zones (option 608-1): shapes, and what happens when the tool is in one.

The tool's point is that of the last motion's tool. A zone that stops the arm does so where it is: on the path, within
the braking distance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import radians
from typing import Any, cast

from yumi.rapid.errors import RapidRuntimeError
from yumi.rapid.library import Call, Library
from yumi.robot.joints import Joints, Vector, chain_from_abb
from yumi.virtual.controller.units import ArmUnit
from yumi.virtual.instructions.motion import FATAL
from yumi.virtual.mechanics.zones import Box, JointRange, Outside, Shape, Sphere, UprightCylinder, WorldZone

_SMALLEST_M = 0.01  # of a zone: ABB's limit of 10 mm
_MOST_ZONES = 20


@dataclass(eq=False, slots=True)
class ShapeData:
    """A shapedata; None until it is defined."""

    shape: Shape | None = None


@dataclass(eq=False, slots=True)
class ZoneData:
    """A wztemporary or wzstationary; None until it is defined, or when it is freed."""

    zone: WorldZone | None = None


class WorldZoneInstructions:
    """The world zones of one task."""

    def __init__(self, unit: ArmUnit) -> None:
        self._unit = unit

    def define_box(self, call: Call) -> None:
        """WZBoxDef."""
        low, high = (tuple(value * 1e-3 for value in call[name]) for name in ("LowPoint", "HighPoint"))
        pairs = list(zip(low, high, strict=True))
        corners = [tuple(min(pair) for pair in pairs), tuple(max(pair) for pair in pairs)]
        self._check_size(call, min(abs(a - b) for a, b in pairs))
        self._define(call, Box(*(cast("Vector", corner) for corner in corners)))

    def define_sphere(self, call: Call) -> None:
        """WZSphDef."""
        self._check_size(call, call["Radius"] * 1e-3)
        self._define(call, Sphere(_metres(call["CentrePoint"]), call["Radius"] * 1e-3))

    def define_cylinder(self, call: Call) -> None:
        """WZCylDef."""
        radius, height = call["Radius"] * 1e-3, call["Height"] * 1e-3
        self._check_size(call, min(radius, abs(height)))
        self._define(call, UprightCylinder(_metres(call["CentrePoint"]), radius, height))

    def define_home(self, call: Call) -> None:
        """WZHomeJointDef: joints beside a middle."""
        middle, delta = (self._joints(call[name]) for name in ("MiddleJointVal", "DeltaJointVal"))
        low, high = (tuple(m + sign * abs(d) for m, d in zip(middle, delta, strict=True)) for sign in (-1.0, 1.0))
        self._define(call, JointRange(cast("Joints", low), cast("Joints", high)))

    def define_limits(self, call: Call) -> None:
        """WZLimJointDef: joints between two positions."""
        low, high = (self._joints(call[name]) for name in ("LowJointVal", "HighJointVal"))
        self._define(call, JointRange(low, high))

    def supervise(self, call: Call) -> None:
        """WZLimSup: the arm stops when its tool comes into the zone."""
        unit, name = self._unit, call.reference("WorldZone").name

        def changed(is_inside: bool) -> None:
            if is_inside:
                unit.zone_fault = f"{unit.mechanical_unit} has come into the world zone {name}, which WZLimSup forbids."

        self._add(call, changed)

    def set_output(self, call: Call) -> None:
        """WZDOSet: a signal has a value in the zone, and the other one outside."""
        task, signal, value = call.task, call["Signal"].name, 1.0 if call["SetValue"] else 0.0
        self._add(call, lambda is_inside: task.write_signal(signal, value if is_inside else 1.0 - value))

    def enable(self, call: Call) -> None:
        """WZEnable."""
        self._zone(call).is_enabled = True

    def disable(self, call: Call) -> None:
        """WZDisable."""
        self._zone(call).is_enabled = False

    def free(self, call: Call) -> None:
        """WZFree."""
        self._unit.zones.remove(self._zone(call))
        call["WorldZone"].zone = None

    def _define(self, call: Call, shape: Shape) -> None:
        call["Shape"].shape = Outside(shape) if call.present("Outside") else shape

    @staticmethod
    def _check_size(call: Call, smallest: float) -> None:
        if smallest < _SMALLEST_M:
            sentence = f"{call.name}: a zone is at least {_SMALLEST_M * 1e3:g} mm wide, not {smallest * 1e3:g} mm."
            raise RapidRuntimeError(FATAL, sentence)

    def _joints(self, target: Any) -> Joints:
        """Joint positions [rad] of a jointtarget in chain order."""
        if self._unit.arm.kinematics.reference is None:
            return cast("Joints", tuple(map(radians, target.robax)))
        return cast("Joints", tuple(map(radians, chain_from_abb(target.robax, target.extax[0]))))

    def _add(self, call: Call, changed: Callable[[bool], None]) -> None:
        shape, data = call["Shape"].shape, call["WorldZone"]
        if shape is None:
            raise RapidRuntimeError(FATAL, f"{call.name}: the shape has to be defined before, by WZBoxDef or its like.")
        if data.zone is not None:
            raise RapidRuntimeError(FATAL, f"{call.name}: the zone is in use already; WZFree gives it back.")
        if len(self._unit.zones) >= _MOST_ZONES:
            raise RapidRuntimeError(FATAL, f"{call.name}: {_MOST_ZONES} world zones are in use.")
        data.zone = WorldZone(shape, changed)
        self._unit.zones.append(data.zone)

    @staticmethod
    def _zone(call: Call) -> WorldZone:
        zone: WorldZone | None = call["WorldZone"].zone
        if zone is None:
            raise RapidRuntimeError(FATAL, f"{call.name}: the zone is not defined, by WZDOSet or WZLimSup.")
        return zone


def _metres(position: Any) -> Vector:
    x, y, z = (value * 1e-3 for value in position)
    return (x, y, z)


def add_world_zones(library: Library, unit: ArmUnit) -> None:
    """Register the world zones of one task."""
    own = WorldZoneInstructions(unit)
    library.object_type("shapedata", ShapeData)
    library.object_type("wztemporary", ZoneData)
    library.object_type("wzstationary", ZoneData)
    shape = r"\switch Inside | \switch Outside, VAR shapedata Shape"
    zone = r"\switch Temp | \switch Stat, INOUT anytype WorldZone"
    for name, signature, implementation in (
        ("WZBoxDef", f"{shape}, pos LowPoint, pos HighPoint", own.define_box),
        ("WZSphDef", f"{shape}, pos CentrePoint, num Radius", own.define_sphere),
        ("WZCylDef", f"{shape}, pos CentrePoint, num Radius, num Height", own.define_cylinder),
        ("WZHomeJointDef", f"{shape}, jointtarget MiddleJointVal, jointtarget DeltaJointVal", own.define_home),
        ("WZLimJointDef", f"{shape}, jointtarget LowJointVal, jointtarget HighJointVal", own.define_limits),
        ("WZLimSup", f"{zone}, VAR shapedata Shape", own.supervise),
        (
            "WZDOSet",
            rf"{zone}, \switch Inside | \switch Before, VAR shapedata Shape, VAR signaldo Signal, num SetValue",
            own.set_output,
        ),
        ("WZEnable", "INOUT anytype WorldZone", own.enable),
        ("WZDisable", "INOUT anytype WorldZone", own.disable),
        ("WZFree", "INOUT anytype WorldZone", own.free),
    ):
        library.instruction(name, signature)(implementation)
