"""A requested joint trajectory: its checks, and the plan of each arm.

Everything that can be checked without the arm is checked here, in the process that receives the trajectory, and the
splines are calculated here; nothing of it costs the control loop time. The control process judges the plan where it
takes an arm over (:mod:`yumi.control.motion.blending`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import isfinite

from abb_protocols.catalogue import Message, message
from abb_protocols.robot.joints import ZERO_JOINTS, JointLimits, Joints, Side, joint_names
from yumi.control.goals import looks_like_degrees
from yumi.control.motion.setpoint import Setpoint
from yumi.control.motion.spline import TrajectoryPoint, spline_through
from yumi.control.motion.spline_limits import ROUNDING, check_motion
from yumi.control.trajectory_commands import ArmPlan, ResultCode, trajectory_refused
from yumi.planning.smoothing import smooth_way

MOST_POINTS = 20_000
"""A trajectory has at most so many points: 80 s at 250 Hz, or hours of waypoints."""

_AT_REST = 1e-7  # [rad/s] upstream's: the resolution of a float32
_LATEST = 2.0**31  # [s] the end of a ROS duration; its resolution is the shortest time between two points
_SHORTEST = 0.9e-9  # [s] a nanosecond, as the difference of two floats


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


def check_trajectory_length(points: int) -> None:
    """Refuse a trajectory of more than :data:`MOST_POINTS` points, before anything is done with them."""
    if points > MOST_POINTS:
        raise trajectory_refused(message("trajectory_too_long", points=points, most=MOST_POINTS))


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
    check_trajectory_length(len(trajectory.points))
    column_of = {name: column for column, name in enumerate(trajectory.joint_names)}
    known = [name for side in sides for name in joint_names(side)]
    check_trajectory_joints(trajectory.joint_names, known, held is not None)
    _check_points(trajectory)
    plans = {}
    for side in sides:
        names = joint_names(side)
        columns = [column_of.get(name) for name in names]
        resting = (held[side] if held else ZERO_JOINTS, ZERO_JOINTS, ZERO_JOINTS)
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
            points[0], spline = smooth_way(points, smoothed_from[side], names, limits)
        check_motion(spline.segments, names, limits)
        left_out = tuple(name for name in names if name not in column_of)
        plans[side] = ArmPlan(side, points[0], spline, trajectory.start, left_out, is_smoothed)
    return plans


def timed_trajectory(trajectory: JointTrajectory, frequency: float) -> JointTrajectory:
    """A trajectory whose points all bear no time gets them: ``1 / frequency`` [s] apart, the first one, too."""
    if any(each.time for each in trajectory.points):
        return trajectory
    points = [each._replace(time=number / frequency) for number, each in enumerate(trajectory.points, 1)]
    return replace(trajectory, points=tuple(points))


def check_trajectory_joints(given: Sequence[str], known: Sequence[str], may_leave_out: bool) -> None:
    """Check the joints that a request names.

    Raises:
        TrajectoryRefused: it names none, one twice, one that is not known, or not all where it may leave none out.
    """
    if not given:
        raise trajectory_refused(message("trajectory_without_joints", joints=tuple(known)), ResultCode.INVALID_JOINTS)
    for number, name in enumerate(given):
        if name in given[:number]:
            raise trajectory_refused(message("trajectory_joint_twice", joint=name), ResultCode.INVALID_JOINTS)
        if name not in known:
            said = message("trajectory_joint_unknown", joint=name, joints=tuple(known))
            raise trajectory_refused(said, ResultCode.INVALID_JOINTS)
    missing = tuple(name for name in known if name not in given)
    if missing and not may_leave_out:
        raise trajectory_refused(message("trajectory_joints_missing", missing=missing), ResultCode.INVALID_JOINTS)


def _check_points(trajectory: JointTrajectory) -> None:
    """Times, counts and numbers, whatever the joints."""
    points, count = trajectory.points, len(trajectory.joint_names)
    if not points:
        raise trajectory_refused(message("trajectory_without_points"))
    if trajectory.start is not None and not isfinite(trajectory.start):
        raise trajectory_refused(message("trajectory_start_not_finite", start=str(trajectory.start)))
    for number, point in enumerate(points, 1):
        fault = _fault(number, point, count)
        if fault is not None:
            raise trajectory_refused(fault)
    if points[0].time < 0.0:
        raise trajectory_refused(message("trajectory_begins_too_early", time=points[0].time))
    for number, (before, after) in enumerate(pairwise(points), 2):
        if not after.time - before.time >= _SHORTEST:
            raise trajectory_refused(
                message(
                    "trajectory_times_not_increasing",
                    point=number,
                    time=after.time,
                    before=number - 1,
                    time_before=before.time,
                )
            )
    if not points[-1].time < _LATEST:
        raise trajectory_refused(message("trajectory_ends_too_late", time=points[-1].time, latest=_LATEST))
    if any(abs(speed) > _AT_REST for speed in points[-1].velocity):
        raise trajectory_refused(message("trajectory_ends_in_motion"))


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
                raise trajectory_refused(
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
                if not abs(value) <= limit * ROUNDING:
                    raise trajectory_refused(
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
