r"""RAPID's path recorder (option Path Recovery): the way back is the way the arm came.

It records where the arm was planned to be in each cycle, whatever moves the way was made of.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

import numpy as np

from abb_protocols.robot.joints import Joints
from virtual_irc5.instructions.moves import MOVES, MoveInstructions, standing
from virtual_irc5.mechanics.path_geometry import CornerZone, Leg, LegSpeed, followed, retraced_leg
from virtual_irc5.rapid import Call, Library, Wait

_MOST_RECORDED = 50_000  # positions: what is older is forgotten
_RECORDED_STEP = radians(0.1)  # between two positions, of the axis that moves most
_RECORDER = "path recorder"
_OFFSET_SHARE = 0.1  # of the way: within it \ToolOffs is reached
_RETRACING_SPEED = LegSpeed(0.25, radians(90.0))  # without \Speed


@dataclass(eq=False, slots=True)
class PathIdentity:
    """What a pathrecid stands for: a place on the recorded path; None before PathRecStart.

    Attributes:
        recording: which recording it is of.
        index: of the position there.
    """

    recording: int = 0
    index: int | None = None


RECORDER = Library(MOVES)
RECORDER.object_type("pathrecid", PathIdentity)
_WAY = r"\VAR pathrecid ID, \pos ToolOffs, \speeddata Speed"


class PathRecorder:
    """The path recorder of one task."""

    def __init__(self, motion: MoveInstructions) -> None:
        self._motion = motion
        self._unit = motion.unit
        self._positions: list[Joints] = []
        self._recording = 0
        self._at: int | None = None  # the position where the arm is on its way back and forth; None at the end
        self._is_retracing = False

    @RECORDER.instruction("PathRecStart", "VAR pathrecid ID")
    def start(self, call: Call) -> None:
        """Record from here on; while it records, mark this place."""
        self._unit.observers[_RECORDER] = self._observe
        self._unit.beginnings[_RECORDER] = self._forget
        self._observe(is_mark=True)
        call["ID"].recording, call["ID"].index = self._recording, len(self._positions) - 1

    @RECORDER.instruction("PathRecStop", r"\switch Clear")
    def stop(self, call: Call) -> None:
        r"""Record no more; with \Clear what is recorded is forgotten."""
        self._unit.observers.pop(_RECORDER, None)
        if call.present("Clear"):
            self._clear()

    def _clear(self) -> None:
        self._positions.clear()
        self._recording += 1
        self._at = None

    def _forget(self) -> None:
        """The program begins at main: nothing is recorded, until PathRecStart."""
        self._unit.observers.pop(_RECORDER, None)
        self._clear()
        self._is_retracing = False

    def _observe(self, *, is_mark: bool = False) -> None:
        """Record where the arm is planned to be, but not while it goes back or forth, or on a path between."""
        if self._is_retracing or self._unit.path_level > 1:
            return
        here, positions = self._unit.arm.planned, self._positions
        if self._at is not None:  # the program goes on: what lay ahead of here is another path now
            del positions[self._at + 1 :]
            self._at = None
        moved = max(abs(a - b) for a, b in zip(here, positions[-1], strict=True)) if positions else _RECORDED_STEP
        if moved >= _RECORDED_STEP or (is_mark and moved > 0.0):
            positions.append(here)
            if len(positions) > _MOST_RECORDED:
                del positions[: _MOST_RECORDED // 2]
                self._recording += 1  # places that were marked before cannot be reached any more

    @RECORDER.instruction("PathRecMoveBwd", _WAY)
    def back(self, call: Call) -> Wait:
        r"""To the place of \ID, or where the recording began."""
        end = self._end(call, 0)
        if not self._is_behind(end):
            raise call.error("ERR_PATHDIST", "that place is not on the path behind the arm.")
        yield from self._retrace(call, end)

    @RECORDER.instruction("PathRecMoveFwd", _WAY)
    def forth(self, call: Call) -> Wait:
        r"""To the place of \ID, or where the way back began."""
        end = self._end(call, len(self._positions) - 1)
        if not self._is_ahead(end):
            raise call.error("ERR_PATHDIST", "that place is not on the path ahead of the arm.")
        yield from self._retrace(call, end)

    @RECORDER.function("PathRecValidBwd", r"\VAR pathrecid ID", "bool")
    def is_valid_back(self, call: Call) -> bool:
        return self._is_behind(self._end(call, 0))

    @RECORDER.function("PathRecValidFwd", r"\VAR pathrecid ID", "bool")
    def is_valid_forth(self, call: Call) -> bool:
        return self._is_ahead(self._end(call, len(self._positions) - 1))

    def _end(self, call: Call, default: int) -> int | None:
        """Where a call goes to; None for a place of another recording."""
        if not call.present("ID"):
            return default if self._positions else None
        identity: PathIdentity = call["ID"]
        return identity.index if identity.recording == self._recording else None

    def _is_behind(self, end: int | None) -> bool:
        at = len(self._positions) - 1 if self._at is None else self._at
        return end is not None and (end < at or (end == at and self._at is None and len(self._positions) > 0))

    def _is_ahead(self, end: int | None) -> bool:
        return end is not None and self._at is not None and end > self._at

    def _retrace(self, call: Call, end: int | None) -> Wait:
        assert end is not None, "it was checked"
        positions, arm = self._positions, self._unit.arm
        yield from standing(arm)
        if self._at is None:
            self._at = len(positions) - 1
            if positions[-1] != arm.planned:  # where the way back begins is where the way forth ends
                positions.append(arm.planned)
                self._at += 1
        step = 1 if end >= self._at else -1
        way = [arm.planned, *positions[self._at + step : end + step if end + step >= 0 else None : step]]
        offset = call.get("ToolOffs", (0.0, 0.0, 0.0))
        speed = self._motion.speed(call, call["Speed"]) if call.present("Speed") else _RETRACING_SPEED
        frames = self._motion.read_frames(call)

        def build(start: Joints, entry: CornerZone) -> Leg:
            joints = np.array(way if len(way) > 1 else way * 2)
            if any(offset):
                # The way back comes beside the path by even parts, so that it begins where the arm stands.
                shares = np.minimum(np.linspace(0.0, 1.0, len(joints)) / _OFFSET_SHARE, 1.0)
                points, rotations = frames.tip(*arm.kinematics.forward(joints))
                points = points + shares[:, None] * (rotations @ (np.array(offset) * 1e-3))
                joints = followed(arm.kinematics, points, rotations, arm.kinematics.angles(joints), frames, start)
            return retraced_leg(arm.kinematics, joints, frames, speed)

        self._is_retracing = True
        try:
            yield from self._motion.passed(call, build)
        finally:
            self._is_retracing = False
        self._at = end
