"""Splines of an arm's joints over time: points, segments and coefficients, and the sampler that reads them.

The order of a segment is that of what both of its ends give: positions make it linear, velocities cubic, accelerations
quintic, as in ros2_control's joint trajectory controller (reference/ros2_control.md §3.2).
"""

from __future__ import annotations

from array import array
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from math import inf
from pickle import PickleBuffer
from typing import Any, NamedTuple, SupportsIndex, cast, overload

from abb_protocols.robot.joints import ZERO_JOINTS, Joints
from yumi.control.motion.setpoint import Setpoint

Coefficients = tuple[float, float, float, float, float, float]
"""Of one joint's position over the time since its segment began, the constant one first."""


class TrajectoryPoint(NamedTuple):
    """Where the joints are at one time.

    Attributes:
        time: since the start of the trajectory [s].
        position: [rad], one for each joint.
        velocity: [rad/s], one for each joint, or none at all.
        acceleration: [rad/s²], one for each joint, or none at all.
    """

    time: float
    position: tuple[float, ...]
    velocity: tuple[float, ...] = ()
    acceleration: tuple[float, ...] = ()


class Segment(NamedTuple):
    """A spline between two points.

    Attributes:
        begin: when it begins [s].
        end: when the next one begins [s].
        rows: the coefficients of each joint.
    """

    begin: float
    end: float
    rows: tuple[Coefficients, ...]


_TERMS = 6  # coefficients of a joint
_SEGMENTS_PER_BLOCK = 1500  # half a megabyte for seven joints: mapped and unmapped in less than 0.1 ms


class Segments(Sequence[Segment]):
    """The segments of a spline as plain numbers in blocks of bounded size.

    A long trajectory crosses to the control process as these blocks, each read between two cycles, without an object
    for each number: unpickling 20 000 segments as tuples takes 100 ms, and freeing them 20 ms.

    Args:
        segments: in the order of time.
    """

    __slots__ = ("_blocks", "_count", "_first", "_lead", "_width")

    def __init__(self, segments: Iterable[Segment] = ()) -> None:
        self._lead: tuple[Segment, ...] = ()
        self._first = self._count = self._width = 0
        blocks: list[array[float]] = []
        for segment in segments:
            if self._count % _SEGMENTS_PER_BLOCK == 0:
                blocks.append(array("d"))
                self._width = 2 + _TERMS * len(segment.rows)
            blocks[-1].extend(segment[:2])
            for row in segment.rows:
                blocks[-1].extend(row)
            self._count += 1
        self._blocks: tuple[memoryview[float], ...] = tuple(memoryview(block) for block in blocks)

    def after(self, lead: Segment) -> Segments:
        """``lead``, then what of these segments is not over by its end; the numbers are not copied."""
        joined = Segments()
        joined._blocks, joined._count, joined._width = self._blocks, self._count, self._width
        joined._first = bisect_right(range(self._count), lead.end, lo=self._first, key=self._end)
        joined._lead = (lead,)
        return joined

    def end(self, index: int) -> float:
        """When the segment ``index`` >= 0 ends [s]."""
        before = len(self._lead)
        return self._lead[index].end if index < before else self._end(index - before + self._first)

    def __len__(self) -> int:
        return len(self._lead) + self._count - self._first

    @overload
    def __getitem__(self, index: SupportsIndex) -> Segment: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Segment, ...]: ...

    def __getitem__(self, index: SupportsIndex | slice) -> Segment | tuple[Segment, ...]:
        if isinstance(index, slice):
            return tuple(self[each] for each in range(*index.indices(len(self))))
        place = range(len(self))[index]
        before = len(self._lead)
        if place < before:
            return self._lead[place]
        block, place = divmod(place - before + self._first, _SEGMENTS_PER_BLOCK)
        begin, end, *terms = self._blocks[block][place * self._width : (place + 1) * self._width]
        rows = [tuple(terms[start : start + _TERMS]) for start in range(0, len(terms), _TERMS)]
        return Segment(begin, end, cast("tuple[Coefficients, ...]", tuple(rows)))

    def __iter__(self) -> Iterator[Segment]:
        return (self[index] for index in range(len(self)))

    def __reduce_ex__(self, protocol: SupportsIndex) -> tuple[Any, ...]:
        blocks = [PickleBuffer(block) if int(protocol) >= 5 else block.tobytes() for block in self._blocks]
        return _unpickled, (blocks, self._count, self._width, self._first, self._lead)

    def _end(self, number: int) -> float:
        block, place = divmod(number, _SEGMENTS_PER_BLOCK)
        return self._blocks[block][place * self._width + 1]


def _unpickled(
    blocks: Sequence[bytes | memoryview], count: int, width: int, first: int, lead: tuple[Segment, ...]
) -> Segments:
    segments = Segments()
    segments._blocks = tuple(memoryview(block).cast("B").cast("d") for block in blocks)
    segments._count, segments._width, segments._first, segments._lead = count, width, first, lead
    return segments


class Spline(NamedTuple):
    """The way through all points.

    Attributes:
        segments: in the order of time, without gaps; none for a single point.
        last: the last point, where the joints stay.
    """

    segments: Segments
    last: TrajectoryPoint

    @property
    def begin(self) -> float:
        """When it begins [s]."""
        return self.segments[0].begin if self.segments else self.last.time

    @property
    def end(self) -> float:
        """When it has arrived [s]."""
        return self.last.time


def spline_through(points: Sequence[TrajectoryPoint]) -> Spline:
    """The spline through ``points``, whose times increase."""
    return Spline(Segments(segment_between(start, end) for start, end in pairwise(points)), points[-1])


def segment_between(start: TrajectoryPoint, end: TrajectoryPoint) -> Segment:
    """The segment from ``start`` to ``end``, as smooth as what both of them give."""
    t = end.time - start.time
    rows: list[Coefficients] = []
    if start.acceleration and end.acceleration:
        for p0, v0, a0, p1, v1, a1 in zip(*start[1:], *end[1:], strict=True):
            way = p1 - p0
            c3 = (20.0 * way - (8.0 * v1 + 12.0 * v0) * t + (a1 - 3.0 * a0) * t**2) / (2.0 * t**3)
            c4 = (-30.0 * way + (14.0 * v1 + 16.0 * v0) * t + (3.0 * a0 - 2.0 * a1) * t**2) / (2.0 * t**4)
            c5 = (12.0 * way - 6.0 * (v1 + v0) * t + (a1 - a0) * t**2) / (2.0 * t**5)
            rows.append((p0, v0, 0.5 * a0, c3, c4, c5))
    elif start.velocity and end.velocity:
        for p0, v0, p1, v1 in zip(*start[1:3], *end[1:3], strict=True):
            way = p1 - p0
            c2 = (3.0 * way - (2.0 * v0 + v1) * t) / t**2
            rows.append((p0, v0, c2, (-2.0 * way + (v0 + v1) * t) / t**3, 0.0, 0.0))
    else:
        rows += [(p0, (p1 - p0) / t, 0.0, 0.0, 0.0, 0.0) for p0, p1 in zip(start.position, end.position, strict=True)]
    return Segment(start.time, end.time, tuple(rows))


class SplineSampler:
    """Reads a spline of seven joints at times that mostly increase; it remembers in which segment it was.

    Args:
        spline: of seven joints.

    Attributes:
        segment: that was read last; an empty one before the first.
    """

    def __init__(self, spline: Spline) -> None:
        self._segments = spline.segments
        self._begin, self._end = spline.begin, spline.end
        self._last = spline.last.position
        self._index = -1
        self._entry, self._exit = inf, -inf  # when the segment was entered that is read now, and when it is left
        self.segment = Segment(0.0, 0.0, ())

    def motion(self, time: float) -> tuple[Joints, Joints]:
        """Positions [rad] and velocities [rad/s]; at rest before the begin and from the end on."""
        position = self.position(time)
        if not self._begin <= time < self._end:
            return position, ZERO_JOINTS
        t, rows = time - self.segment.begin, self.segment.rows
        velocity = [b + t * (2.0 * c + t * (3.0 * d + t * (4.0 * e + t * 5.0 * f))) for _, b, c, d, e, f in rows]
        return position, tuple(velocity)

    def position(self, time: float) -> Joints:
        """Positions [rad]; those of the ends before the begin and from the end on."""
        if time >= self._end or not self._segments:
            return self._last
        segment = self._find(time)
        t = max(0.0, time - segment.begin)
        position = [a + t * (b + t * (c + t * (d + t * (e + t * f)))) for a, b, c, d, e, f in segment.rows]
        return tuple(position)

    def setpoint(self, time: float) -> Setpoint:
        """Positions, velocities and accelerations."""
        position, velocity = self.motion(time)
        if velocity is ZERO_JOINTS:
            return Setpoint(position)
        t, rows = time - self.segment.begin, self.segment.rows
        acceleration = [2.0 * c + t * (6.0 * d + t * (12.0 * e + t * 20.0 * f)) for _, _, c, d, e, f in rows]
        return Setpoint(position, velocity, tuple(acceleration))

    def _find(self, time: float) -> Segment:
        """The first segment that ends after ``time``; it may be entered later than it begins."""
        if self._entry <= time < self._exit:
            return self.segment
        segments, index = self._segments, self._index + 1
        if not (self._exit <= time and index < len(segments) and time < segments.end(index)):
            index = bisect_right(range(len(segments)), time, key=segments.end)
        self._index, self.segment = index, segments[index]
        self._entry, self._exit = segments.end(index - 1) if index else -inf, self.segment.end
        return self.segment
