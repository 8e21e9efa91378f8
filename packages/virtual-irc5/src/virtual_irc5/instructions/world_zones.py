r"""RAPID's world zones of one arm (option 608-1): they watch the point of the last motion's tool.

A zone that stops the arm does so where it is: on the path, within the braking distance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import radians
from typing import Any, cast

from abb_protocols.robot.joints import Joints, Vector, chain_from_abb
from virtual_irc5.instructions.moves import FATAL
from virtual_irc5.instructions.robot_data import ROBOT_DATA
from virtual_irc5.mechanics.units import ArmUnit
from virtual_irc5.mechanics.watched_zones import (
    WorldZone,
    ZoneBox,
    ZoneCylinder,
    ZoneJoints,
    ZoneOutside,
    ZoneShape,
    ZoneSphere,
)
from virtual_irc5.rapid import Call, Library

_SMALLEST_ZONE_M = 0.01  # ABB's limit
_MOST_ZONES = 20


@dataclass(eq=False, slots=True)
class ShapeData:
    """A shapedata; None until it is defined."""

    shape: ZoneShape | None = None


@dataclass(eq=False, slots=True)
class ZoneData:
    """A wztemporary or wzstationary; None until it is defined, or when it is freed."""

    zone: WorldZone | None = None


ZONES = Library(ROBOT_DATA)
ZONES.object_type("shapedata", ShapeData)
ZONES.object_type("wztemporary", ZoneData)
ZONES.object_type("wzstationary", ZoneData)
_SHAPE = r"\switch Inside | \switch Outside, VAR shapedata Shape"
_ZONE = r"\switch Temp | \switch Stat, INOUT anytype WorldZone"


class WorldZoneInstructions:
    """The world zones of one task."""

    def __init__(self, unit: ArmUnit) -> None:
        self._unit = unit

    @ZONES.instruction("WZBoxDef", f"{_SHAPE}, pos LowPoint, pos HighPoint")
    def define_box(self, call: Call) -> None:
        low, high = (_metres(call[name]) for name in ("LowPoint", "HighPoint"))
        pairs = list(zip(low, high, strict=True))
        corners = [tuple(min(pair) for pair in pairs), tuple(max(pair) for pair in pairs)]
        self._check_size(call, min(abs(a - b) for a, b in pairs))
        self._define(call, ZoneBox(*(cast("Vector", corner) for corner in corners)))

    @ZONES.instruction("WZSphDef", f"{_SHAPE}, pos CentrePoint, num Radius")
    def define_sphere(self, call: Call) -> None:
        self._check_size(call, call["Radius"] * 1e-3)
        self._define(call, ZoneSphere(_metres(call["CentrePoint"]), call["Radius"] * 1e-3))

    @ZONES.instruction("WZCylDef", f"{_SHAPE}, pos CentrePoint, num Radius, num Height")
    def define_cylinder(self, call: Call) -> None:
        radius, height = call["Radius"] * 1e-3, call["Height"] * 1e-3
        self._check_size(call, min(radius, abs(height)))
        self._define(call, ZoneCylinder(_metres(call["CentrePoint"]), radius, height))

    @ZONES.instruction("WZHomeJointDef", f"{_SHAPE}, jointtarget MiddleJointVal, jointtarget DeltaJointVal")
    def define_home(self, call: Call) -> None:
        """Joints beside a middle."""
        middle, delta = (self._joints(call[name]) for name in ("MiddleJointVal", "DeltaJointVal"))
        low, high = (tuple(m + sign * abs(d) for m, d in zip(middle, delta, strict=True)) for sign in (-1.0, 1.0))
        self._define(call, ZoneJoints(low, high))

    @ZONES.instruction("WZLimJointDef", f"{_SHAPE}, jointtarget LowJointVal, jointtarget HighJointVal")
    def define_limits(self, call: Call) -> None:
        """Joints between two positions."""
        low, high = (self._joints(call[name]) for name in ("LowJointVal", "HighJointVal"))
        self._define(call, ZoneJoints(low, high))

    @ZONES.instruction("WZLimSup", f"{_ZONE}, VAR shapedata Shape")
    def supervise(self, call: Call) -> None:
        """The arm stops when its tool comes into the zone."""
        unit, name = self._unit, call.reference("WorldZone").name

        def changed(is_inside: bool) -> None:
            if is_inside:
                sentence = f"{unit.mechanical_unit} has come into the world zone {name}, which WZLimSup forbids."
                unit.faults.append((80001, "World zone", sentence))

        self._add(call, changed)

    @ZONES.instruction(
        "WZDOSet",
        rf"{_ZONE}, \switch Inside | \switch Before, VAR shapedata Shape, VAR signaldo Signal, num SetValue",
    )
    def set_output(self, call: Call) -> None:
        """A signal has a value in the zone, and the other one outside."""
        task, signal, value = call.task, call["Signal"].name, 1.0 if call["SetValue"] else 0.0
        self._add(call, lambda is_inside: task.write_signal(signal, value if is_inside else 1.0 - value))

    @ZONES.instruction("WZEnable", "INOUT anytype WorldZone")
    @ZONES.instruction("WZDisable", "INOUT anytype WorldZone")
    def enable(self, call: Call) -> None:
        self._zone(call).is_enabled = call.name == "WZEnable"

    @ZONES.instruction("WZFree", "INOUT anytype WorldZone")
    def free(self, call: Call) -> None:
        self._unit.zones.remove(self._zone(call))
        call["WorldZone"].zone = None

    def _define(self, call: Call, shape: ZoneShape) -> None:
        call["Shape"].shape = ZoneOutside(shape) if call.present("Outside") else shape

    @staticmethod
    def _check_size(call: Call, smallest: float) -> None:
        if smallest < _SMALLEST_ZONE_M:
            sentence = f"a zone is at least {_SMALLEST_ZONE_M * 1e3:g} mm wide, not {smallest * 1e3:g} mm."
            raise call.error(FATAL, sentence)

    def _joints(self, target: Any) -> Joints:
        """Joint positions [rad] of a jointtarget in chain order."""
        if self._unit.arm.kinematics.reference is None:
            return tuple(map(radians, target.robax))
        return tuple(map(radians, chain_from_abb(target.robax, target.extax[0])))

    def _add(self, call: Call, changed: Callable[[bool], None]) -> None:
        shape, data = call["Shape"].shape, call["WorldZone"]
        if shape is None:
            raise call.error(FATAL, "the shape has to be defined before, by WZBoxDef or its like.")
        if data.zone is not None:
            raise call.error(FATAL, "the zone is in use already; WZFree gives it back.")
        if len(self._unit.zones) >= _MOST_ZONES:
            raise call.error(FATAL, f"{_MOST_ZONES} world zones are in use.")
        data.zone = WorldZone(shape, changed)
        self._unit.zones.append(data.zone)

    @staticmethod
    def _zone(call: Call) -> WorldZone:
        zone: WorldZone | None = call["WorldZone"].zone
        if zone is None:
            raise call.error(FATAL, "the zone is not defined, by WZDOSet or WZLimSup.")
        return zone


def _metres(position: Any) -> Vector:
    x, y, z = (value * 1e-3 for value in position)
    return (x, y, z)
