"""Trajectories: checked where they come in, as splines that one arm can follow, and the blend onto a running one.

Everything that can be checked without the arm is checked here, when the trajectory is received; the
splines are calculated here, too, so that nothing of it costs the control loop time.

The order of a segment is that of what both of its ends give: positions make it linear, velocities cubic, accelerations
quintic, as in ros2_control's joint trajectory controller (reference/ros2_control.md §3.2).

Polynomials over a stretch of time: whether they stay within a range, and where they leave it farthest.

A polynomial is the sequence of its coefficients, the constant one first.

The path from the present command of an arm onto a trajectory: without a step, within the limits.
"""

from __future__ import annotations

from array import array
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import IntEnum
from itertools import pairwise
from math import comb, inf, isfinite, nan
from operator import sub
from pickle import PickleBuffer
from typing import Any, NamedTuple, SupportsIndex, cast, overload

from yumi.catalogue import Message, message
from yumi.control.controller import looks_like_degrees
from yumi.control.motion import Setpoint
from yumi.errors import TrajectoryRefused
from yumi.robot.joints import ZERO, JointLimits, Joints, Side, joint_names, joints

# ---- polynomials: the sequence of their coefficients, the constant one first
#
# Without numpy: its linear algebra starts threads, not wanted in the control process, where blends are checked.

_HALVINGS = 50

_BERNSTEIN = {
    count: [[comb(i, k) / comb(count - 1, k) for k in range(i + 1)] for i in range(count)] for count in range(1, 7)
}
"""How much of each scaled coefficient is in each Bernstein coefficient, for polynomials of so many coefficients."""


class Excess(NamedTuple):
    """Where a polynomial is farthest outside of a range.

    Attributes:
        time: from the begin of its stretch.
        value: its value there.
    """

    time: float
    value: float


def value_at(polynomial: Sequence[float], time: float) -> float:
    """Its value, by Horner's rule."""
    value = 0.0
    for coefficient in reversed(polynomial):
        value = value * time + coefficient
    return value


def derivative(polynomial: Sequence[float]) -> tuple[float, ...]:
    """Its rate of change."""
    return tuple([power * coefficient for power, coefficient in enumerate(polynomial)][1:])


def excess(polynomial: Sequence[float], length: float, lowest: float, highest: float) -> Excess | None:
    """Where it is farthest outside of ``lowest`` to ``highest`` for times from 0 to ``length``; None if nowhere.

    Its Bernstein coefficients bound it from both sides, which is enough for most. A polynomial whose numbers are too
    large to be calculated with is nowhere inside: its value is NaN.
    """
    scaled = [coefficient * length**power for power, coefficient in enumerate(polynomial)]
    hull = [sum([part * term for part, term in zip(row, scaled, strict=False)]) for row in _BERNSTEIN[len(scaled)]]
    if not all(map(isfinite, hull)):
        return Excess(0.0, nan)
    if lowest <= min(hull) and max(hull) <= highest:
        return None

    def outside(point: Excess) -> float:
        return max(lowest - point.value, point.value - highest)

    times = (0.0, *_roots(derivative(polynomial), length), length)
    worst = max((Excess(time, value_at(polynomial, time)) for time in times), key=outside)
    return None if outside(worst) <= 0.0 else worst


def _roots(polynomial: Sequence[float], length: float) -> list[float]:
    """Where it changes its sign between 0 and ``length``, in order: by halving between the points where it turns."""
    if len(polynomial) < 2:
        return []
    turns = (0.0, *_roots(derivative(polynomial), length), length)
    found = []
    for begin, end in pairwise(turns):
        low, high, start = begin, end, value_at(polynomial, begin)
        if start * value_at(polynomial, end) > 0.0:
            continue
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if value_at(polynomial, middle) * start > 0.0 else (low, middle)
        found.append(0.5 * (low + high))
    return found


# ---- splines

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


def smooth_spline_through(points: Sequence[TrajectoryPoint], velocity: Sequence[float] = ()) -> Spline:
    """The cubic spline through positions alone: its velocity and acceleration do not jump, and it ends at rest.

    Args:
        points: whose times increase; their velocities and accelerations do not count.
        velocity: at the first point [rad/s], one for each joint; at rest when left out.
    """
    if len(points) < 2:
        return spline_through(points)
    first = tuple(velocity) or (0.0,) * len(points[0].position)
    # The inner velocities follow from equal accelerations on both sides: one system with three diagonals (Thomas).
    lengths = [after.time - before.time for before, after in pairwise(points)]
    ways = [
        [(b - a) / length for a, b in zip(before.position, after.position, strict=True)]
        for (before, after), length in zip(pairwise(points), lengths, strict=True)
    ]
    upper, right = [0.0], [list(first)]
    for index in range(1, len(points) - 1):
        before, after = 1.0 / lengths[index - 1], 1.0 / lengths[index]
        pivot = 2.0 * (before + after) - before * upper[-1]
        upper.append(after / pivot)
        rows = zip(ways[index - 1], ways[index], right[-1], strict=True)
        right.append([(3.0 * (before * v + after * w) - before * last) / pivot for v, w, last in rows])
    velocities = [[0.0] * len(first)]
    for index in range(len(points) - 2, -1, -1):
        factor = upper[index]
        velocities.append([own - factor * next_ for own, next_ in zip(right[index], velocities[-1], strict=True)])
    velocities.reverse()
    return spline_through(
        [TrajectoryPoint(each.time, each.position, tuple(own)) for each, own in zip(points, velocities, strict=True)]
    )


def stretched(plan: ArmPlan, end: float) -> ArmPlan:
    """The same way in more time: it ends at ``end`` [s], at or after its own end."""
    spline, factor = plan.spline, end / plan.spline.end if plan.spline.end else 1.0
    if factor == 1.0:
        return plan

    def slower(row: Coefficients) -> Coefficients:
        a, b, c, d, e, f = row
        return a, b / factor, c / factor**2, d / factor**3, e / factor**4, f / factor**5

    segments = Segments(
        Segment(each.begin * factor, each.end * factor, tuple(map(slower, each.rows))) for each in spline.segments
    )
    return replace(plan, spline=Spline(segments, spline.last._replace(time=end, velocity=(), acceleration=())))


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
    """

    def __init__(self, spline: Spline) -> None:
        self._segments = spline.segments
        self._begin, self._end = spline.begin, spline.end
        self._last = spline.last.position
        self._index = -1
        self._entry, self._exit = inf, -inf  # when the segment was entered that is read now, and when it is left
        self._current = Segment(0.0, 0.0, ())

    def motion(self, time: float) -> tuple[Joints, Joints]:
        """Positions [rad] and velocities [rad/s]; at rest before the begin and from the end on."""
        position = self.position(time)
        if not self._begin <= time < self._end:
            return position, ZERO
        t, rows = time - self._current.begin, self._current.rows
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
        if velocity is ZERO:
            return Setpoint(position)
        t, rows = time - self._current.begin, self._current.rows
        acceleration = [2.0 * c + t * (6.0 * d + t * (12.0 * e + t * 20.0 * f)) for _, _, c, d, e, f in rows]
        return Setpoint(position, velocity, tuple(acceleration))

    def _find(self, time: float) -> Segment:
        """The first segment that ends after ``time``; it may be entered later than it begins."""
        if self._entry <= time < self._exit:
            return self._current
        segments, index = self._segments, self._index + 1
        if not (self._exit <= time and index < len(segments) and time < segments.end(index)):
            index = bisect_right(range(len(segments)), time, key=segments.end)
        self._index, self._current = index, segments[index]
        self._entry, self._exit = segments.end(index - 1) if index else -inf, self._current.end
        return self._current


# ---- what is asked for, and its checks

MOST_POINTS = 20_000
"""A trajectory has at most so many points: 80 s at 250 Hz, or hours of waypoints."""

_TOGETHER = 0.1  # [s] each arm has a short trajectory by then
_HANDING_OVER = 30e-6  # [s] for each point, to both arms, twice
_ROUNDING = 1.0 + 1e-6  # a spline that uses a limit fully is not refused for its last digit
_RANGE_ROUNDING = 1e-9  # [rad]
_AT_REST = 1e-7  # [rad/s] upstream's: the resolution of a float32
_LATEST = 2.0**31  # [s] the end of a ROS duration; its resolution is the shortest time between two points
_SHORTEST = 0.9e-9  # [s] a nanosecond, as the difference of two floats


class ResultCode(IntEnum):
    """How the motion along a trajectory ended; the numbers of control_msgs/action/FollowJointTrajectory."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


@dataclass(frozen=True, slots=True)
class JointTrajectory:
    """A trajectory as it is asked for, for any joints in any order.

    Attributes:
        joint_names: whose values the points have.
        points: in the order of time.
        start: when it starts, on the machine's monotonic clock [s]; None is at once.
    """

    joint_names: tuple[str, ...]
    points: tuple[TrajectoryPoint, ...]
    start: float | None = None


@dataclass(frozen=True, slots=True)
class ArmPlan:
    """One arm's part of a checked trajectory.

    Attributes:
        side: which arm.
        first: its first point, chain order.
        spline: the way from there on, seven joints in chain order.
        start: when it starts, on the machine's monotonic clock [s]; None is at once.
        left_out: the joints that the trajectory does not name.
        is_smoothed: whether its points came without velocities and got them here: an arm that cannot be at the first
            one in time may leave for a later one.
    """

    side: Side
    first: TrajectoryPoint
    spline: Spline
    start: float | None
    left_out: tuple[str, ...] = ()
    is_smoothed: bool = False


def time_to_start(points: int) -> float:
    """So long after it was asked for do both arms start a trajectory of so many points [s]: each has it by then."""
    return max(_TOGETHER, points * _HANDING_OVER)


def refused(said: Message, code: ResultCode = ResultCode.INVALID_GOAL) -> TrajectoryRefused:
    """The error for a trajectory that cannot be followed."""
    return TrajectoryRefused(said, code)


def check_count(points: int) -> None:
    """Refuse a trajectory of more than :data:`MOST_POINTS` points, before anything is done with them."""
    if points > MOST_POINTS:
        raise refused(message("trajectory_too_long", points=points, most=MOST_POINTS))


def plan_trajectory(
    trajectory: JointTrajectory,
    sides: Sequence[Side],
    limits: JointLimits,
    held: Mapping[Side, Joints] | None = None,
    smoothed_from: Mapping[Side, Setpoint] | None = None,
) -> Mapping[Side, ArmPlan]:
    """The plan of each of ``sides`` for a trajectory that names their joints in any order.

    Args:
        trajectory: what is asked for.
        sides: the arms that follow it.
        limits: of the joints of an arm.
        held: where joints hold that the trajectory leaves out [rad], by arm; None: it must name all.
        smoothed_from: points with positions alone are followed by a spline without jumps of velocity or acceleration,
            which begins with how each arm is commanded now; None: on straight lines between them.

    Raises:
        TrajectoryRefused: it has a fault, see the sentence; or it asks more of a joint than its limits allow.
    """
    check_count(len(trajectory.points))
    column_of = {name: column for column, name in enumerate(trajectory.joint_names)}
    _check_joints(trajectory.joint_names, [name for side in sides for name in joint_names(side)], held is not None)
    _check_points(trajectory)
    plans = {}
    for side in sides:
        names = joint_names(side)
        columns = [column_of.get(name) for name in names]
        resting = (held[side] if held else ZERO, ZERO, ZERO)
        points = []
        for point in trajectory.points:
            rows = [
                [rest if column is None else float(values[column]) for column, rest in zip(columns, row, strict=True)]
                if values
                else []
                for values, row in zip(point[1:], resting, strict=True)
            ]
            points.append(TrajectoryPoint(point.time, *map(tuple, rows)))
        _check_values(points, names, limits)
        is_smoothed = smoothed_from is not None and not any(each.velocity for each in points)
        spline = spline_through(points)
        if smoothed_from is not None and is_smoothed:
            points[0], spline = _smoothed(points, smoothed_from[side], names, limits)
        check_motion(spline.segments, names, limits)
        left_out = tuple(name for name in names if name not in column_of)
        plans[side] = ArmPlan(side, points[0], spline, trajectory.start, left_out, is_smoothed)
    return plans


_STOPS = (0.0, 0.05, 0.1, 0.2, 0.4, 0.8)  # [s] before its end a smoothed way slows down, tried in this order
_KNOTS = 10  # of the way on which it slows down
_MOST_SMOOTHED = 0.05  # [rad] points may be moved by
_PASSES = 40


def _smoothed(
    points: Sequence[TrajectoryPoint], now: Setpoint, names: Sequence[str], limits: JointLimits
) -> tuple[TrajectoryPoint, Spline]:
    """The first point and the way from there on, through positions alone, within the limits.

    It begins as the arm moves ``now``, and comes to rest at the last point along the way, not within one interval.
    Points that ask for too much are averaged with their neighbours, which takes the noise of a policy away.

    Raises:
        TrajectoryRefused: it takes more than that; the reason is that of the points as they are.
    """
    refusal: TrajectoryRefused | None = None
    moved = list(points)
    for _ in range(_PASSES):
        for knots, velocity in _starts(moved, now):
            for slowing in (each for each in _STOPS if each <= knots[-1].time - knots[0].time):
                spline = smooth_spline_through(_slowed(knots, velocity, slowing), velocity)
                if len(knots) > len(points):  # the way to the first point is planned from what is commanded then
                    spline = Spline(Segments(spline.segments[1:]), spline.last)
                try:
                    for segment in spline.segments:
                        check_lead(segment, names, limits)
                except TrajectoryRefused as error:
                    refusal = refusal or error
                    continue
                first = SplineSampler(spline).setpoint(spline.begin)
                return (points[0] if points[0].time == 0.0 else TrajectoryPoint(spline.begin, *first)), spline
        for index, three in enumerate(zip(*(tuple(moved)[shift:] for shift in range(3)), strict=False), 1):
            rows = zip(*(each.position for each in three), strict=True)
            moved[index] = moved[index]._replace(position=tuple([0.25 * a + 0.5 * b + 0.25 * c for a, b, c in rows]))
        pairs = zip(points, moved, strict=True)
        if any(max(map(abs, map(sub, each.position, own.position))) > _MOST_SMOOTHED for each, own in pairs):
            break
    assert refusal is not None
    raise refusal


def _starts(points: Sequence[TrajectoryPoint], now: Setpoint) -> Iterator[tuple[Sequence[TrajectoryPoint], Joints]]:
    """Knots and their first velocity: from where the arm is; or, where the points lie elsewhere, as their first two."""
    if points[0].time == 0.0 or len(points) < 2:
        yield points, now.velocity if points[0].time == 0.0 else ZERO
        return
    yield [TrajectoryPoint(0.0, now.position), *points], now.velocity
    gap = points[1].time - points[0].time
    yield points, joints([(b - a) / gap for a, b in zip(points[0].position, points[1].position, strict=True)])


def _slowed(points: Sequence[TrajectoryPoint], velocity: Joints, slowing: float) -> Sequence[TrajectoryPoint]:
    """The same points, where the way slows down for the last ``slowing`` [s], which take twice as long."""
    if slowing == 0.0:
        return points
    # Beyond the end it would go on as it came: the end has no say in the way before it.
    last, before = points[-1], points[-2]
    beyond = [2.0 * a - b for a, b in zip(last.position, before.position, strict=True)]
    further = TrajectoryPoint(2.0 * last.time - before.time, tuple(beyond))
    way = SplineSampler(smooth_spline_through([*points, further], velocity))
    begin = last.time - slowing
    kept = [each for each in points if each.time < begin - 0.25 * slowing / _KNOTS]
    slow = []
    for number in range(_KNOTS + 1):
        share = number / _KNOTS
        # From speed 1 to 0 without a jump of the rate: its integral over twice the time is the way that is left.
        gone = 2.0 * slowing * (share - share**3 + 0.5 * share**4)
        slow.append(TrajectoryPoint(begin + 2.0 * slowing * share, way.position(begin + gone)))
    return [*kept, *slow[:-1], TrajectoryPoint(slow[-1].time, last.position)]


def timed(trajectory: JointTrajectory, frequency: float) -> JointTrajectory:
    """A trajectory whose points all bear no time gets them: ``1 / frequency`` [s] apart, the first one, too."""
    if any(each.time for each in trajectory.points):
        return trajectory
    points = [each._replace(time=number / frequency) for number, each in enumerate(trajectory.points, 1)]
    return replace(trajectory, points=tuple(points))


def _check_joints(given: Sequence[str], known: Sequence[str], may_leave_out: bool) -> None:
    if not given:
        raise refused(message("trajectory_without_joints", joints=tuple(known)), ResultCode.INVALID_JOINTS)
    for number, name in enumerate(given):
        if name in given[:number]:
            raise refused(message("trajectory_joint_twice", joint=name), ResultCode.INVALID_JOINTS)
        if name not in known:
            said = message("trajectory_joint_unknown", joint=name, joints=tuple(known))
            raise refused(said, ResultCode.INVALID_JOINTS)
    missing = tuple(name for name in known if name not in given)
    if missing and not may_leave_out:
        raise refused(message("trajectory_joints_missing", missing=missing), ResultCode.INVALID_JOINTS)


def _check_points(trajectory: JointTrajectory) -> None:
    """Times, counts and numbers, whatever the joints."""
    points, count = trajectory.points, len(trajectory.joint_names)
    if not points:
        raise refused(message("trajectory_without_points"))
    if trajectory.start is not None and not isfinite(trajectory.start):
        raise refused(message("trajectory_start_not_finite", start=str(trajectory.start)))
    for number, point in enumerate(points, 1):
        fault = _fault(number, point, count)
        if fault is not None:
            raise refused(fault)
    if points[0].time < 0.0:
        raise refused(message("trajectory_begins_too_early", time=points[0].time))
    for number, (before, after) in enumerate(pairwise(points), 2):
        if not after.time - before.time >= _SHORTEST:
            raise refused(
                message(
                    "trajectory_times_not_increasing",
                    point=number,
                    time=after.time,
                    before=number - 1,
                    time_before=before.time,
                )
            )
    if not points[-1].time < _LATEST:
        raise refused(message("trajectory_ends_too_late", time=points[-1].time, latest=_LATEST))
    if any(abs(speed) > _AT_REST for speed in points[-1].velocity):
        raise refused(message("trajectory_ends_in_motion"))


def _fault(number: int, point: TrajectoryPoint, count: int) -> Message | None:
    """The first fault of a point by itself, of which there are many: most have none."""
    if not isfinite(point.time):
        return message("point_time_not_finite", point=number, time=str(point.time))
    if not point.position:
        return message("point_without_positions", point=number)
    if point.acceleration and not point.velocity:
        return message("point_without_velocities", point=number)
    for quantity, values in zip(("positions", "velocities", "accelerations"), point[1:], strict=True):
        if values and len(values) != count:
            return message("point_value_count", point=number, count=len(values), quantity=quantity, joints=count)
        for value in values:
            if not isfinite(value):
                return message("point_value_not_finite", point=number, value=str(value), quantity=quantity)
    return None


def _check_values(points: Sequence[TrajectoryPoint], names: Sequence[str], limits: JointLimits) -> None:
    """Those of the points themselves: a first point has no segment before it, on which they would be seen."""
    for number, point in enumerate(points, 1):
        for index, value in enumerate(point.position):
            if not limits.lower[index] <= value <= limits.upper[index]:
                raise refused(
                    message(
                        "point_in_degrees" if looks_like_degrees(index, value) else "point_out_of_range",
                        point=number,
                        joint=names[index],
                        position=value,
                        lower=limits.lower[index],
                        upper=limits.upper[index],
                    )
                )
    for number, point in enumerate(points, 1):
        for values, most, quantity, unit in (
            (point.velocity, limits.velocity, "velocity", "rad/s"),
            (point.acceleration, limits.acceleration, "acceleration", "rad/s²"),
        ):
            for name, value, limit in zip(names, values, most, strict=False):
                if not abs(value) <= limit * _ROUNDING:
                    raise refused(
                        message(
                            "point_beyond_limit",
                            point=number,
                            joint=name,
                            quantity=quantity,
                            value=value,
                            limit=limit,
                            unit=unit,
                        )
                    )


def check_motion(segments: Sequence[Segment], names: Sequence[str], limits: JointLimits) -> None:
    """Refuse a way on which a joint leaves its range or is too fast, between the points, too.

    Raises:
        TrajectoryRefused: with the joint, the time and the limit.
    """
    bounds = list(zip(limits.lower, limits.upper, limits.velocity, limits.acceleration, strict=True))
    for segment in segments:
        length = segment.end - segment.begin
        for index, (row, (low, high, speed, strength)) in enumerate(zip(segment.rows, bounds, strict=True)):
            # Sums of what each term adds bound the motion; for dense points that is all there is to calculate.
            start, b, c, d, e, f = row
            b, c, d, e, f = abs(b), abs(c) * length, abs(d) * length**2, abs(e) * length**3, abs(f) * length**4
            way = length * (b + c + d + e + f)
            if not (
                low <= start - way
                and start + way <= high
                and b + 2.0 * c + 3.0 * d + 4.0 * e + 5.0 * f <= speed
                and 2.0 * c + 6.0 * d + 12.0 * e + 20.0 * f <= strength * length
            ):
                out = excess(row, length, min(low, start) - _RANGE_ROUNDING, max(high, start) + _RANGE_ROUNDING)
                if out is not None:
                    raise refused(
                        message(
                            "trajectory_leaves_range",
                            joint=names[index],
                            position=out.value,
                            time=segment.begin + out.time,
                            lower=limits.lower[index],
                            upper=limits.upper[index],
                        )
                    )
                velocity = derivative(row)
                _check_rate("velocity", "rad/s", velocity, speed, names[index], segment)
                _check_rate("acceleration", "rad/s²", derivative(velocity), strength, names[index], segment)


def check_lead(lead: Segment, names: Sequence[str], limits: JointLimits) -> None:
    """As :func:`check_motion`; a way that is chosen here must not jerk a joint too much, one that is given may."""
    check_motion((lead,), names, limits)
    for name, row, limit in zip(names, lead.rows, limits.jerk, strict=True):
        _check_rate("jerk", "rad/s³", derivative(derivative(derivative(row))), limit, name, lead)


def _check_rate(quantity: str, unit: str, rate: Sequence[float], limit: float, name: str, segment: Segment) -> None:
    out = excess(rate, segment.end - segment.begin, -limit * _ROUNDING, limit * _ROUNDING)
    if out is not None:
        raise refused(
            message(
                "trajectory_beyond_limit",
                joint=name,
                quantity=quantity,
                value=out.value,
                unit=unit,
                time=segment.begin + out.time,
                limit=limit,
            )
        )


# ---- the blend from what an arm gets now onto a trajectory: without a step, within the limits

START_TOLERANCE = 0.02
"""A trajectory whose first point is due at 0 s begins at most so far from the arm [rad], a little over 1°."""

_DURATIONS = (0.1, 0.2, 0.4, 0.8, 1.6)  # [s] tried in this order, until the limits are kept
_SAME_POSITION = 1e-6  # [rad]
_SAME_VELOCITY = 1e-4  # [rad/s]


def blend(
    plan: ArmPlan, setpoint: Setpoint, now: float, limits: JointLimits, tolerance: float = START_TOLERANCE
) -> Spline:
    """The whole way, from ``setpoint`` to the end of the trajectory.

    An arm at rest waits for the start of the trajectory; one that moves leaves for it at once. A trajectory that has
    started without the arm is caught up with.

    Args:
        plan: the trajectory.
        setpoint: what the arm gets now.
        now: the time on the trajectory's own clock [s], below 0 before its start.
        limits: of the joints.
        tolerance: how far from ``setpoint`` the trajectory may begin where it leaves no time to go there [rad].

    Raises:
        TrajectoryRefused: it is over, it begins somewhere else, or its first point cannot be reached in time.
    """
    spline, names = plan.spline, joint_names(plan.side)
    if now > spline.end:
        raise refused(message("trajectory_is_over", late=now - spline.end), ResultCode.OLD_HEADER_TIMESTAMP)
    is_at_rest = setpoint.velocity is ZERO
    sampler = SplineSampler(spline)
    begin = max(now, 0.0) if is_at_rest else now
    if begin < plan.first.time > 0.0:
        # To the first point, in the time it leaves; as smooth as its fields at rest, without any step in motion.
        end = plan.first
        if not is_at_rest:
            after = sampler.setpoint(end.time)
            end = end._replace(
                velocity=end.velocity or after.velocity, acceleration=end.acceleration or after.acceleration
            )
        lead = segment_between(TrajectoryPoint(begin, *setpoint), end)
        if not plan.is_smoothed:
            check_motion((lead,), names, limits)
            return Spline(spline.segments.after(lead), spline.last)
        with suppress(TrajectoryRefused):
            check_lead(lead, names, limits)
            return Spline(spline.segments.after(lead), spline.last)
    begin = max(begin, 0.0)
    by_now = sampler.setpoint(begin)
    if is_at_rest or not plan.is_smoothed:
        _check_begin(plan, setpoint, begin, by_now.position, tolerance)
    if (
        max(abs(a - b) for a, b in zip(setpoint.position, by_now.position, strict=True)) <= _SAME_POSITION
        and max(abs(a - b) for a, b in zip(setpoint.velocity, by_now.velocity, strict=True)) <= _SAME_VELOCITY
    ):
        return spline
    return _joined(spline, setpoint, begin, names, limits)


def _joined(spline: Spline, setpoint: Setpoint, begin: float, names: Sequence[str], limits: JointLimits) -> Spline:
    """Onto the running trajectory, as soon as the limits let it."""
    sampler = SplineSampler(spline)
    refusal: TrajectoryRefused | None = None
    for duration in _DURATIONS:
        if begin + duration < spline.begin:
            continue
        end = TrajectoryPoint(begin + duration, *sampler.setpoint(begin + duration))
        lead = segment_between(TrajectoryPoint(begin, *setpoint), end)
        try:
            check_lead(lead, names, limits)
        except TrajectoryRefused as error:
            refusal = error
            continue
        return Spline(spline.segments.after(lead), spline.last if spline.end > end.time else end)
    raise refused(message("trajectory_too_far_away", duration=_DURATIONS[-1])) from refusal


def _check_begin(plan: ArmPlan, setpoint: Setpoint, begin: float, by_now: Joints, tolerance: float) -> None:
    """The arm must be where the trajectory begins, or between there and where it is by now."""
    for index, (first, now, place) in enumerate(zip(plan.first.position, by_now, setpoint.position, strict=True)):
        if min(first, now) - tolerance <= place <= max(first, now) + tolerance:
            continue
        raise refused(
            message(
                "trajectory_is_elsewhere" if begin > plan.first.time else "trajectory_begins_elsewhere",
                time=plan.first.time,
                joint=joint_names(plan.side)[index],
                first=first,
                now=now,
                since=begin - plan.first.time,
                position=place,
            )
        )
