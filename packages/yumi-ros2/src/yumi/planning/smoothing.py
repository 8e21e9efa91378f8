"""Smooth splines through points with positions alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from operator import sub

from abb_protocols.errors import TrajectoryRefused
from abb_protocols.robot.joints import ZERO_JOINTS, JointLimits, Joints, joints
from yumi.control.motion.setpoint import Setpoint
from yumi.control.motion.spline import Segments, Spline, SplineSampler, TrajectoryPoint, spline_through
from yumi.control.motion.spline_limits import check_lead


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


_STOPS = (0.0, 0.05, 0.1, 0.2, 0.4, 0.8)  # [s] before its end a smoothed way slows down, tried in this order
_KNOTS = 10  # of the way on which it slows down
_MOST_SMOOTHED = 0.05  # [rad] points may be moved by
_PASSES = 40


def smooth_way(
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
        yield points, now.velocity if points[0].time == 0.0 else ZERO_JOINTS
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
