"""Where an arm may come until it rests: its braking path, as segments in joint space.

A segment says of a part of the path that each joint has a range there: a straight line, and how far each joint may be
off it. Segments are cut in two as long as they say too little (docs/explanation/decisions/0032-arms-keep-apart.md).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from math import dist

import numpy as np
from numpy.typing import NDArray

from yumi.control.motion import BrakingPath, Setpoint, braking_paths, braking_positions
from yumi.robot.joints import JOINT_COUNT, JointLimits, Joints, joints

Array = NDArray[np.float64]

MIDDLE, ALONG, OFF, HALF = range(4)
"""The rows of a segment; see :class:`Segment`."""

NOISE = 1e-3
"""Of where the robot plans to be [rad]."""

_SAMPLES = 64  # of each curve of a braking path; a power of two
_ENDS = 2
_TINY = 1e-12  # [rad²]


class Segment:
    """Of a braking path: a straight line in joint space, and how far each joint may be off it.

    Args:
        rows: the four attributes [rad], (4, 7).
        cut: makes its parts; none of the smallest segments.

    Attributes:
        rows: as above.
        middle: of the line.
        along: from there to its end.
        off: it by so much, at most.
        half: how far each joint is from the middle, at most.
    """

    __slots__ = ("_cut", "_parts", "rows")

    def __init__(self, rows: Array, cut: Callable[[], tuple[Segment, ...]]) -> None:
        self.rows = rows
        self._cut = cut
        self._parts: tuple[Segment, ...] | None = None

    @property
    def middle(self) -> Array:
        return np.asarray(self.rows[MIDDLE])

    @property
    def along(self) -> Array:
        return np.asarray(self.rows[ALONG])

    @property
    def off(self) -> Array:
        return np.asarray(self.rows[OFF])

    @property
    def half(self) -> Array:
        return np.asarray(self.rows[HALF])

    @property
    def parts(self) -> tuple[Segment, ...]:
        """What it consists of."""
        if self._parts is None:
            self._parts = self._cut()
        return self._parts


class _Curve:
    """Segments of a braking path, level by level.

    Args:
        postures: along it [rad], (_SAMPLES + 1, 7); or the ends of a straight line, (2, 7).
    """

    def __init__(self, postures: Array) -> None:
        self._postures = postures
        self._levels: dict[int, Array] = {}

    def segment(self, level: int = 0, index: int = 0) -> Segment:
        """One of the 2 ** level segments of the same number of postures."""

        def cut() -> tuple[Segment, ...]:
            finer = level + 1
            return () if 1 << level == _SAMPLES else tuple(self.segment(finer, 2 * index + each) for each in (0, 1))

        return Segment(self._rows(level)[index], cut)

    def _rows(self, level: int) -> Array:
        """Of all segments of a level, (2 ** level, 4, 7)."""
        if level not in self._levels:
            is_straight, step = len(self._postures) == _ENDS, _SAMPLES >> level
            if is_straight:
                first, last = self._postures
                ends = first + np.linspace(0.0, 1.0, (1 << level) + 1)[:, None] * (last - first)
            else:
                ends = self._postures[::step]
            rows = np.zeros((len(ends) - 1, 4, JOINT_COUNT))
            rows[:, MIDDLE], rows[:, ALONG] = 0.5 * (ends[:-1] + ends[1:]), 0.5 * (ends[1:] - ends[:-1])
            along = rows[:, ALONG]
            if step > 1 and not is_straight:
                inner = self._postures[:-1].reshape(-1, step, JOINT_COUNT)[:, 1:] - rows[:, None, MIDDLE]
                lengths = np.maximum((along * along).sum(1), _TINY)[:, None, None]
                shares = np.minimum(np.maximum(inner @ along[:, :, None] / lengths, -1.0), 1.0)
                rows[:, OFF] = np.abs(inner - shares * along[:, None]).max(1)
            rows[:, HALF] = np.abs(along) + rows[:, OFF]
            self._levels[level] = rows
        return self._levels[level]


def _hull(postures: Sequence[Joints | Array], cut: Callable[[], tuple[Segment, ...]]) -> Segment:
    """All that lies between some postures [rad], (n, 7), whichever joint moves first."""
    all_of_them = np.array(postures)
    low, high = all_of_them.min(0), all_of_them.max(0)
    rows = np.zeros((4, JOINT_COUNT))
    rows[MIDDLE], rows[OFF] = 0.5 * (low + high), 0.5 * (high - low)
    rows[HALF] = rows[OFF]
    return Segment(rows, cut)


STILL = Segment(np.zeros((4, JOINT_COUNT)), tuple)
"""Instead of the other arm's, where what stands still is compared."""


class ArmMotion:
    """How an arm moves, and where it may come until it rests.

    Args:
        planned: where the robot plans to be [rad], (7,).
        sent: how the position sent moves.
        robot: how the robot itself moves where speeds are fed forward to it; None where it follows the position sent.
        limits: of the joints.
        coasts_to: where the robot may go if it is not heard any more [rad], (7,).
    """

    def __init__(
        self,
        planned: Joints,
        sent: Setpoint,
        robot: Setpoint | None,
        limits: JointLimits,
        coasts_to: Joints | None = None,
    ) -> None:
        self.planned, self.sent, self.robot, self.coasts_to = planned, sent, robot, coasts_to
        self._limits = limits

    def stays(self, planned: Joints, sent: Setpoint, robot: Setpoint | None) -> bool:
        """Whether a command changes nothing; arguments as of the class. Most of the time an arm stands."""
        if self.sent != sent or self.robot != robot:
            return False
        return self.planned is planned or dist(self.planned, planned) < NOISE

    @cached_property
    def _paths(self) -> tuple[BrakingPath, ...]:
        """How each joint comes to rest, as the position sent."""
        return braking_paths(self.sent, self._limits)

    @cached_property
    def length(self) -> float:
        """How far all joints together get from where they are until they rest [rad]."""
        return sum(path.highest - path.lowest for path in self._paths)

    # No segment holds a motion: the control process collects no garbage, and what refers to itself would stay for ever.

    @cached_property
    def ahead(self) -> Segment:
        """Where a new command may lead the arm that it did not come by earlier ones: its braking path."""
        limits, starts = self._limits, [self.sent] if self.robot is None else [self.sent, self.robot]
        postures = _extremes(self.sent, self._paths)
        if self.robot is not None:
            postures += _extremes(self.robot, braking_paths(self.robot, limits))
        return _hull(
            postures, lambda: tuple(_Curve(braking_positions(start, limits, _SAMPLES)).segment() for start in starts)
        )

    @cached_property
    def reachable(self) -> Segment:
        """Where it may come from now on: from where the robot plans to be to where it rests.

        A robot follows the position sent late, by the time constant of its position loop; what that takes it off the
        path of that position is left to the margin.
        """
        ahead, planned = self.ahead, self.planned
        ends = [self.sent.position, self.coasts_to, self.robot and self.robot.position]
        lines = [end for end in ends if end is not None]
        postures = (ahead.middle - ahead.half, ahead.middle + ahead.half, np.array(planned), *map(np.array, lines))
        return _hull(
            postures,
            lambda: (*(_Curve(np.array((planned, end))).segment() for end in lines), *(ahead.parts or (ahead,))),
        )


def _extremes(start: Setpoint, paths: Sequence[BrakingPath]) -> tuple[Joints, ...]:
    """How far the joints get backwards and forwards while they brake [rad], (7,) each."""
    rows = list(zip(start.position, paths, strict=True))
    return joints([at + path.lowest for at, path in rows]), joints([at + path.highest for at, path in rows])
