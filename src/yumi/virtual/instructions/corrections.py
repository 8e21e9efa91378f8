r"""RAPID's path corrections (option 612-1, Path Offset): offsets that a program adds to moves with \Corr.

An offset is in path coordinates: x along the path, y across it and the tool's z axis, z completes them. It is taken
over while the arm moves, smoothly; at standstill nothing changes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from yumi.rapid.errors import RapidRuntimeError
from yumi.rapid.library import Call, Library
from yumi.robot.arms import Lost
from yumi.robot.joints import Joints
from yumi.rws.types import EventType
from yumi.virtual.controller.events import EventLog
from yumi.virtual.controller.units import ArmUnit
from yumi.virtual.instructions.motion import place_of
from yumi.virtual.mechanics.course import Fault, Leg

MOST_GENERATORS = 5
_TIME = 0.08  # [s] in which most of a step is taken over
_FULL_SPEED = 0.01  # [m/s] of the path, below which corrections come more slowly, and at standstill not at all
_SAME = 1e-9  # [m]

Array = NDArray[np.float64]


@dataclass(eq=False, slots=True)
class CorrectionGenerator:
    """What a corrdescr stands for; its offset [m] is None until it is connected."""

    offset: Array | None = None


class PathCorrection:
    """The corrections of one task, and what becomes of the arm's path (`PathMotion.corrector`)."""

    def __init__(self, unit: ArmUnit, events: EventLog) -> None:
        self._unit, self._events = unit, events
        self._generators: list[CorrectionGenerator] = []
        self._offset, self._rate = np.zeros(3), np.zeros(3)
        self._point: Array | None = None
        self._axes: Array | None = None
        self._beside: Array | None = None  # corrected minus planned joint positions of the last cycle [rad]
        self._has_failed = False

    # Generators ---------------------------------------------------------------------------------------------------

    def connect(self, call: Call) -> None:
        """CorrCon."""
        generator = call["Descr"]
        if generator in self._generators:
            return
        if len(self._generators) >= MOST_GENERATORS:
            raise RapidRuntimeError("CORR_NOFREE", f"CorrCon: {MOST_GENERATORS} generators are connected already.")
        generator.offset = np.zeros(3)
        self._generators.append(generator)
        self._unit.arm.path.corrector = self
        self._unit.beginnings["path corrections"] = self.clear

    def disconnect(self, call: Call) -> None:
        """CorrDiscon."""
        generator = self._connected(call)
        self._generators.remove(generator)
        generator.offset = None

    def clear(self) -> None:
        """CorrClear, and the program begins at main."""
        for generator in self._generators:
            generator.offset = None
        self._generators.clear()

    def write(self, call: Call) -> None:
        """CorrWrite: the offset of one generator [mm]; it replaces the one before."""
        self._connected(call).offset = np.array(call["Data"]) * 1e-3
        self._has_failed = False

    def read(self, call: Call) -> tuple[float, ...]:
        """CorrRead: the sum of all generators' offsets [mm]."""
        if not self._generators:
            raise RapidRuntimeError("CORR_NOOBJECT", "CorrRead: no correction generator is connected; use CorrCon.")
        return tuple((self._total() * 1e3).tolist())

    def _connected(self, call: Call) -> CorrectionGenerator:
        generator: CorrectionGenerator = call["Descr"]
        if generator not in self._generators:
            name = call.reference("Descr").name
            raise RapidRuntimeError("CORR_NOTCONN", f"{call.name}: {name} is not connected; use CorrCon before.")
        return generator

    def _total(self) -> Array:
        total = np.zeros(3)
        for each in self._generators:
            if each.offset is not None:
                total += each.offset
        return total

    # The path -----------------------------------------------------------------------------------------------------

    def restart(self) -> None:
        """The path begins anew where the arm stands: nothing is corrected there."""
        self._offset, self._rate = np.zeros(3), np.zeros(3)
        self._point = self._axes = self._beside = None

    @property
    def memory(self) -> object:
        """What a path that is put aside has to be restored with."""
        return self._offset, self._rate, self._point, self._axes, self._beside

    @memory.setter
    def memory(self, value: Any) -> None:
        self._offset, self._rate, self._point, self._axes, self._beside = value

    def corrected(self, position: Joints, leg: Leg, dt: float, *, is_corrected: bool) -> Joints:
        """Where the arm is instead of a position on its path [rad], after ``dt`` [s]."""
        wanted = self._total() if is_corrected and self._generators else np.zeros(3)
        if not wanted.any() and not self._offset.any() and not self._rate.any():
            self._point = self._beside = None  # of where the arm is when it is corrected again they say nothing
            return position
        kinematics = self._unit.arm.kinematics
        point, rotation, angle = place_of(kinematics, position, leg.frames)
        along = np.zeros(3) if self._point is None else point - self._point
        self._point = point
        way = float(np.linalg.norm(along))
        if way > _SAME:
            across = np.cross(rotation[:, 2], along / way)
            if np.linalg.norm(across) > 1e-3:  # the tool does not point along the path
                across = across / np.linalg.norm(across)
                self._axes = np.array([along / way, across, np.cross(along / way, across)])
        if self._axes is None:
            return position
        before = self._offset.copy(), self._rate.copy()
        passed = min(1.0, way / dt / _FULL_SPEED) * dt  # a critically damped step, as far as the path moves
        self._rate = self._rate + ((wanted - self._offset) / _TIME - 2.0 * self._rate) * (passed / _TIME)
        self._offset = self._offset + self._rate * passed
        found = self._reached(point, rotation, angle, leg, position)
        if found is None:
            self._offset, self._rate = before[0], np.zeros(3)
            if not self._has_failed:
                code, title = Fault.OUT_OF_REACH.value
                sentence = "The path correction is out of reach: the arm keeps the one it has. Write a smaller one."
                self._events.append(code, title, sentence, EventType.ERROR)
            self._has_failed = True
            found = self._reached(point, rotation, angle, leg, position) or self._returning(point, leg, position, dt)
        if np.max(np.abs(wanted - self._offset)) < _SAME and np.max(np.abs(self._rate)) < _SAME:
            self._offset, self._rate = wanted, np.zeros(3)
        self._beside = np.subtract(found, position)
        return found

    def _reached(self, point: Array, rotation: Array, angle: float, leg: Leg, near: Joints) -> Joints | None:
        """The joint positions [rad] of the corrected place, None where there are none in the joints' range."""
        assert self._axes is not None, "it was found"
        kinematics = self._unit.arm.kinematics
        at, turned = leg.frames.tool0((point + self._offset @ self._axes)[None], rotation[None])
        try:
            found = kinematics.follow(at, turned, np.array([angle]), self._start(near))[0]
        except Lost:
            return None
        position = cast("Joints", tuple(found.tolist()))
        return None if kinematics.limits.outside(position) is not None else position

    def _start(self, near: Joints) -> Joints:
        """The posture [rad] that the corrected one is looked for from: as far beside the path as the last one was."""
        return near if self._beside is None else cast("Joints", tuple((near + self._beside).tolist()))

    def _returning(self, point: Array, leg: Leg, near: Joints, dt: float) -> Joints:
        """The joint positions [rad] on the way back to the path, where not even the correction before is in reach."""
        if self._beside is None:
            self._offset = np.zeros(3)
            return near
        assert self._axes is not None, "it was found"
        kinematics = self._unit.arm.kinematics
        beside = near + self._beside * max(0.0, 1.0 - dt / _TIME)
        found = tuple(np.clip(beside, kinematics.limits.lower, kinematics.limits.upper).tolist())
        self._offset = self._axes @ (place_of(kinematics, cast("Joints", found), leg.frames)[0] - point)
        return cast("Joints", found)


def add_corrections(library: Library, unit: ArmUnit, events: EventLog) -> None:
    """Register the path corrections of one task."""
    own = PathCorrection(unit, events)
    library.object_type("corrdescr", CorrectionGenerator)
    library.instruction("CorrCon", "VAR corrdescr Descr")(own.connect)
    library.instruction("CorrDiscon", "VAR corrdescr Descr")(own.disconnect)
    library.instruction("CorrClear", "")(lambda call: own.clear())
    library.instruction("CorrWrite", "VAR corrdescr Descr, pos Data")(own.write)
    library.function("CorrRead", "", "pos")(own.read)
