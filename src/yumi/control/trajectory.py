"""Trajectories as they are asked for, checked, and as one arm can follow them.

Everything that can be checked without the arm is checked here, by whoever takes the trajectory from the outside; the
splines are calculated here, too, so that nothing of it costs the fast line time.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise
from math import degrees, isfinite

from yumi.control.goals import looks_like_degrees
from yumi.control.polynomial import derivative, excess
from yumi.control.spline import Piece, Spline, TrajectoryPoint, spline_through
from yumi.errors import TrajectoryRefused
from yumi.robot.joints import Side, joint_names
from yumi.robot.limits import JointLimits

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
    """A trajectory as somebody asks for it, for any joints in any order.

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
    """What one arm does of a checked trajectory.

    Attributes:
        side: which arm.
        first: its first point, chain order.
        spline: the way from there on, seven joints in chain order.
        start: when it starts, on the machine's monotonic clock [s]; None is at once.
    """

    side: Side
    first: TrajectoryPoint
    spline: Spline
    start: float | None


def time_to_start(points: int) -> float:
    """So long after it was asked for do both arms start a trajectory of so many points [s]: each has it by then."""
    return max(_TOGETHER, points * _HANDING_OVER)


def plan_trajectory(trajectory: JointTrajectory, sides: Sequence[Side], limits: JointLimits) -> Mapping[Side, ArmPlan]:
    """What each of ``sides`` does of a trajectory that names all their joints, in any order.

    Args:
        trajectory: what is asked for.
        sides: the arms that shall follow it.
        limits: what the joints of an arm may do.

    Raises:
        TrajectoryRefused: it has a fault, see the sentence; or it asks more of a joint than that may do.
    """
    check_count(len(trajectory.points))
    _check_joints(trajectory.joint_names, [name for side in sides for name in joint_names(side)])
    _check_points(trajectory)
    return {side: _plan_arm(trajectory, side, limits) for side in sides}


def check_count(points: int) -> None:
    """Refuse a trajectory of more points than are taken, before anything is done with them.

    Raises:
        TrajectoryRefused: it has more than :data:`MOST_POINTS`.
    """
    if points > MOST_POINTS:
        raise refused(
            f"it has {points} points; at most {MOST_POINTS} are taken: leave out points, or send it in several goals."
        )


def check_motion(pieces: Sequence[Piece], names: Sequence[str], limits: JointLimits) -> None:
    """Refuse a way on which a joint leaves its range or is too fast, between the points, too.

    Raises:
        TrajectoryRefused: with the joint, the time and the limit.
    """
    bounds = list(zip(limits.lower, limits.upper, limits.velocity, limits.acceleration, strict=True))
    for piece in pieces:
        length = piece.end - piece.begin
        for index, (row, (low, high, speed, strength)) in enumerate(zip(piece.rows, bounds, strict=True)):
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
                _check_row(piece, row, names[index], index, limits)


def check_jerk(piece: Piece, names: Sequence[str], jerk: Sequence[float]) -> None:
    """Refuse a piece that jerks a joint too much; a way that is chosen here does not, one that is given may.

    Raises:
        TrajectoryRefused: with the joint, the time and the limit.
    """
    for name, row, limit in zip(names, piece.rows, jerk, strict=True):
        jerks = derivative(derivative(derivative(row)))
        _check_rate("jerk", "rad/s³", jerks, limit, name, piece)


def refused(reason: str, code: ResultCode = ResultCode.INVALID_GOAL) -> TrajectoryRefused:
    """The error for a trajectory that cannot be followed because of ``reason``."""
    return TrajectoryRefused(f"Trajectory refused: {reason}", code)


def _plan_arm(trajectory: JointTrajectory, side: Side, limits: JointLimits) -> ArmPlan:
    names = joint_names(side)
    columns = [trajectory.joint_names.index(name) for name in names]
    points = [
        TrajectoryPoint(point.time, *(_picked(values, columns) for values in point[1:])) for point in trajectory.points
    ]
    _check_range(points, names, limits)
    _check_rates(points, names, limits)
    spline = spline_through(points)
    check_motion(spline.pieces, names, limits)
    return ArmPlan(side, points[0], spline, trajectory.start)


def _picked(values: object, columns: Sequence[int]) -> tuple[float, ...]:
    assert isinstance(values, tuple)
    return tuple([float(values[column]) for column in columns]) if values else ()


def _check_joints(given: Sequence[str], known: Sequence[str]) -> None:
    choices = ", ".join(known)
    if not given:
        raise refused(f"it names no joints; name {choices}.", ResultCode.INVALID_JOINTS)
    for number, name in enumerate(given):
        if name in given[:number]:
            raise refused(f"it names the joint {name!r} twice; name each once.", ResultCode.INVALID_JOINTS)
        if name not in known:
            raise refused(
                f"{name!r} is no joint of this controller; its joints are {choices}.", ResultCode.INVALID_JOINTS
            )
    missing = [name for name in known if name not in given]
    if missing:
        raise refused(f"it leaves out {', '.join(missing)}; all joints must be named.", ResultCode.INVALID_JOINTS)


def _check_points(trajectory: JointTrajectory) -> None:
    points, count = trajectory.points, len(trajectory.joint_names)
    if not points:
        raise refused("it has no points; to stop a motion, cancel its goal.")
    if trajectory.start is not None and not isfinite(trajectory.start):
        raise refused(f"its start is {trajectory.start}; a time is a finite number of seconds.")
    for number, point in enumerate(points, 1):
        for reason in _faults(point, count):
            raise refused(f"point {number} {reason}")
    _check_times(points)
    if any(abs(speed) > _AT_REST for speed in points[-1].velocity):
        raise refused("its last point has a velocity; a trajectory ends at rest.")


def _check_times(points: Sequence[TrajectoryPoint]) -> None:
    if points[0].time < 0.0:
        raise refused(f"point 1 is due at {points[0].time:g} s; time_from_start is 0 s or later.")
    for number, (before, after) in enumerate(pairwise(points), 2):
        if not after.time - before.time >= _SHORTEST:
            raise refused(
                f"point {number} is due at {after.time:g} s, not after point {number - 1} at {before.time:g} s; "
                "the times of the points increase."
            )
    if not points[-1].time < _LATEST:
        raise refused(f"its last point is due at {points[-1].time:g} s; the latest is at {_LATEST:.0f} s.")


def _faults(point: TrajectoryPoint, count: int) -> Iterator[str]:
    if not isfinite(point.time):
        yield f"is due at {point.time} s; a time is a finite number of seconds."
    if not point.position:
        yield "has no positions; every point has one for each joint."
    if point.acceleration and not point.velocity:
        yield "has accelerations without velocities; give both or neither."
    for what, values in zip(("positions", "velocities", "accelerations"), point[1:], strict=True):
        if values and len(values) != count:
            yield f"has {len(values)} {what} for {count} joints; give one for each joint, or none."
        for value in values:
            if not isfinite(value):
                yield f"has {value} among its {what}; all values are finite numbers."


def _check_range(points: Sequence[TrajectoryPoint], names: Sequence[str], limits: JointLimits) -> None:
    for number, point in enumerate(points, 1):
        for index, value in enumerate(point.position):
            if not limits.lower[index] <= value <= limits.upper[index]:
                hint = f"; {value:g} looks like degrees" if looks_like_degrees(index, value) else ""
                raise refused(
                    f"point {number} wants {names[index]} at {degrees(value):.1f}°; "
                    f"its range is {limits.range_deg(index)}{hint}."
                )


def _check_rates(points: Sequence[TrajectoryPoint], names: Sequence[str], limits: JointLimits) -> None:
    """Those of the points themselves: a first point has no piece before it, on which they would be seen."""
    for number, point in enumerate(points, 1):
        for values, most, what, unit in (
            (point.velocity, limits.velocity, "move", "rad/s"),
            (point.acceleration, limits.acceleration, "accelerate", "rad/s²"),
        ):
            for name, value, limit in zip(names, values, most, strict=False):
                if not abs(value) <= limit * _ROUNDING:
                    raise refused(
                        f"point {number} wants {name} to {what} with {value:.4g} {unit}; "
                        f"its limit is {limit:.2f} {unit}; give it more time."
                    )


def _check_row(piece: Piece, row: Sequence[float], name: str, index: int, limits: JointLimits) -> None:
    length, low, high = piece.end - piece.begin, limits.lower[index], limits.upper[index]
    low, high = min(low, row[0]) - _RANGE_ROUNDING, max(high, row[0]) + _RANGE_ROUNDING
    out = excess(row, length, low, high)
    if out is not None:
        raise refused(
            f"{name} would be at {degrees(out.value):.1f}° at {piece.begin + out.time:.3f} s, between two points; "
            f"its range is {limits.range_deg(index)}."
        )
    velocity = derivative(row)
    _check_rate("velocity", "rad/s", velocity, limits.velocity[index], name, piece)
    _check_rate("acceleration", "rad/s²", derivative(velocity), limits.acceleration[index], name, piece)


def _check_rate(what: str, unit: str, rate: Sequence[float], limit: float, name: str, piece: Piece) -> None:
    out = excess(rate, piece.end - piece.begin, -limit * _ROUNDING, limit * _ROUNDING)
    if out is not None:
        raise refused(
            f"{name} would have the {what} {out.value:.2f} {unit} at {piece.begin + out.time:.3f} s; "
            f"its limit is {limit:.2f} {unit}; give it more time."
        )
