r"""RAPID's path corrections (option 612-1, Path Offset): offsets that a program adds to moves with \Corr.

They are in path coordinates: x along the path, y across it and the tool's z axis, z completes them. An offset is taken
over while the arm moves, smoothly; at standstill nothing changes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from abb_protocols.robot.arm_kinematics import PathLost
from abb_protocols.robot.joints import Joints
from abb_protocols.rws.values import EventType
from virtual_irc5.controller_log import ControllerEventLog
from virtual_irc5.instructions.moves import MOVES, place_of
from virtual_irc5.mechanics.path import Passage
from virtual_irc5.mechanics.path_geometry import Leg, MotionFault
from virtual_irc5.mechanics.units import ArmUnit
from virtual_irc5.rapid import Call, Library

_Array = NDArray[np.float64]
_MOST_GENERATORS = 5
_CORRECTION_TIME = 0.08  # [s] in which most of a step is taken over
_CORRECTION_SPEED = 0.01  # [m/s] of the path, below which corrections come more slowly, and at standstill not at all
_NO_OFFSET = 1e-9  # [m]


@dataclass(eq=False, slots=True)
class CorrectionGenerator:
    """What a corrdescr stands for; its offset [m] is None until it is connected."""

    offset: _Array | None = None


CORRECTIONS = Library(MOVES)
CORRECTIONS.object_type("corrdescr", CorrectionGenerator)


class PathCorrections:
    """The corrections of one task, and what becomes of the arm's path (`PathMotion.corrector`).

    Each leg of the path says where its offset comes from: the program's generators, or EGM's sensor.
    """

    def __init__(self, unit: ArmUnit, events: ControllerEventLog) -> None:
        self._unit, self._events = unit, events
        self._generators: list[CorrectionGenerator] = []
        self._offset, self._rate = np.zeros(3), np.zeros(3)
        self._point: _Array | None = None
        self._axes: _Array | None = None
        self._beside: _Array | None = None  # corrected minus planned joint positions of the last cycle [rad]
        self._has_failed = False

    # Generators ---------------------------------------------------------------------------------------------------

    @CORRECTIONS.instruction("CorrCon", "VAR corrdescr Descr")
    def connect(self, call: Call) -> None:
        generator = call["Descr"]
        if generator in self._generators:
            return
        if len(self._generators) >= _MOST_GENERATORS:
            raise call.error("CORR_NOFREE", f"{_MOST_GENERATORS} generators are connected already.")
        generator.offset = np.zeros(3)
        self._generators.append(generator)
        self.attach()
        self._unit.beginnings["path corrections"] = self.clear

    @CORRECTIONS.instruction("CorrDiscon", "VAR corrdescr Descr")
    def disconnect(self, call: Call) -> None:
        generator = self._connected(call)
        self._generators.remove(generator)
        generator.offset = None

    @CORRECTIONS.instruction("CorrClear")
    def clear_all(self, call: Call) -> None:
        self.clear()

    def clear(self) -> None:
        """Disconnect all generators, as when the program begins at main."""
        for generator in self._generators:
            generator.offset = None
        self._generators.clear()

    @CORRECTIONS.instruction("CorrWrite", "VAR corrdescr Descr, pos Data")
    def write(self, call: Call) -> None:
        """The offset of one generator [mm]; it replaces the one before."""
        self._connected(call).offset = np.array(call["Data"]) * 1e-3
        self.attach()

    @CORRECTIONS.function("CorrRead", "", "pos")
    def read(self, call: Call) -> tuple[float, ...]:
        """The sum of all generators' offsets [mm]."""
        if not self._generators:
            raise call.error("CORR_NOOBJECT", "no correction generator is connected; use CorrCon.")
        return tuple((self.total() * 1e3).tolist())

    def _connected(self, call: Call) -> CorrectionGenerator:
        generator: CorrectionGenerator = call["Descr"]
        if generator not in self._generators:
            name = call.reference("Descr").name
            raise call.error("CORR_NOTCONN", f"{name} is not connected; use CorrCon before.")
        return generator

    def total(self) -> _Array:
        """The sum of all generators' offsets [m], (3,)."""
        offsets = (each.offset for each in self._generators if each.offset is not None)
        return sum(offsets, start=np.zeros(3))

    # The path -----------------------------------------------------------------------------------------------------

    def attach(self) -> None:
        """Correct the arm's path from now on; what cannot be reached is reported once until this is called again."""
        self._unit.arm.path.corrector = self
        self._has_failed = False

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

    def corrected(self, position: Joints, passage: Passage, dt: float) -> Joints:
        """Where the arm is instead of a position on its path [rad], after ``dt`` [s]."""
        leg, wanted = passage.leg, np.zeros(3) if passage.offset is None else passage.offset()
        if not wanted.any() and not self._offset.any() and not self._rate.any():
            self._point = self._beside = None  # of where the arm is when it is corrected again they say nothing
            return position
        kinematics = self._unit.arm.kinematics
        point, rotation, angle = place_of(kinematics, position, leg.frames)
        along = np.zeros(3) if self._point is None else point - self._point
        self._point = point
        way = float(np.linalg.norm(along))
        if way > _NO_OFFSET:
            across = np.cross(rotation[:, 2], along / way)
            if np.linalg.norm(across) > 1e-3:  # the tool does not point along the path
                across = across / np.linalg.norm(across)
                self._axes = np.array([along / way, across, np.cross(along / way, across)])
        if self._axes is None:
            return position
        before = self._offset.copy(), self._rate.copy()
        passed = min(1.0, way / dt / _CORRECTION_SPEED) * dt  # a critically damped step, as far as the path moves
        self._rate = self._rate + ((wanted - self._offset) / _CORRECTION_TIME - 2.0 * self._rate) * (
            passed / _CORRECTION_TIME
        )
        self._offset = self._offset + self._rate * passed
        found = self._reached(point, rotation, angle, leg, position)
        if found is None:
            self._offset, self._rate = before[0], np.zeros(3)
            if not self._has_failed:
                code, title = MotionFault.OUT_OF_REACH.value
                sentence = "The path correction is out of reach: the arm keeps the one it has. Write a smaller one."
                self._events.append(code, title, sentence, EventType.ERROR)
            self._has_failed = True
            found = self._reached(point, rotation, angle, leg, position) or self._returning(point, leg, position, dt)
        if np.max(np.abs(wanted - self._offset)) < _NO_OFFSET and np.max(np.abs(self._rate)) < _NO_OFFSET:
            self._offset, self._rate = wanted, np.zeros(3)
        self._beside = np.subtract(found, position)
        return found

    def _reached(self, point: _Array, rotation: _Array, angle: float, leg: Leg, near: Joints) -> Joints | None:
        """The joint positions [rad] of the corrected place, None where there are none in the joints' range."""
        assert self._axes is not None, "it was found"
        kinematics = self._unit.arm.kinematics
        at, turned = leg.frames.tool0((point + self._offset @ self._axes)[None], rotation[None])
        try:
            # From as far beside the path as the last corrected posture was.
            start = near if self._beside is None else tuple((near + self._beside).tolist())
            found = kinematics.follow(at, turned, np.array([angle]), start)[0]
        except PathLost:
            return None
        position = tuple(found.tolist())
        return None if kinematics.limits.outside(position) is not None else position

    def _returning(self, point: _Array, leg: Leg, near: Joints, dt: float) -> Joints:
        """The joint positions [rad] on the way back to the path, where not even the correction before is in reach."""
        if self._beside is None:
            self._offset = np.zeros(3)
            return near
        assert self._axes is not None, "it was found"
        kinematics = self._unit.arm.kinematics
        beside = near + self._beside * max(0.0, 1.0 - dt / _CORRECTION_TIME)
        found = tuple(np.clip(beside, kinematics.limits.lower, kinematics.limits.upper).tolist())
        self._offset = self._axes @ (place_of(kinematics, found, leg.frames)[0] - point)
        return found
