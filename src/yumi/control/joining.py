"""The way from what an arm is told now onto a trajectory: without a step, within the limits."""

from __future__ import annotations

from math import degrees

from yumi.control.point_motion import Setpoint
from yumi.control.spline import Piece, Spline, TrajectoryPoint, Walk, piece_between
from yumi.control.trajectory import ArmPlan, ResultCode, check_jerk, check_motion, refused
from yumi.errors import TrajectoryRefused
from yumi.robot.joints import joint_names
from yumi.robot.limits import JointLimits
from yumi.robot.values import ZERO

START_TOLERANCE = 0.02
"""A trajectory whose first point is due at 0 s begins at most so far from the arm [rad], a little over 1°."""

_DURATIONS = (0.1, 0.2, 0.4, 0.8, 1.6)  # [s] tried in this order, until the limits are kept
_SAME_POSITION = 1e-6  # [rad]
_SAME_VELOCITY = 1e-4  # [rad/s]


def join(
    plan: ArmPlan, setpoint: Setpoint, now: float, limits: JointLimits, tolerance: float = START_TOLERANCE
) -> Spline:
    """The whole way, from ``setpoint`` to the end of the trajectory.

    An arm at rest waits for the start of the trajectory; one that moves leaves for it at once. A trajectory that has
    started without the arm is caught up with.

    Args:
        plan: the trajectory.
        setpoint: what the arm is told now.
        now: the time on the trajectory's own clock [s], below 0 before its start.
        limits: what the joints may do.
        tolerance: how far from ``setpoint`` the trajectory may begin where it leaves no time to go there [rad].

    Raises:
        TrajectoryRefused: it is over, it begins somewhere else, or its first point cannot be reached in time.
    """
    spline = plan.spline
    if now > spline.end:
        raise refused(
            f"it ended {now - spline.end:.3f} s ago; send it before its end, or with the stamp 0 to start at once.",
            ResultCode.OLD_HEADER_TIMESTAMP,
        )
    is_at_rest = setpoint.velocity is ZERO
    begin = max(now, 0.0) if is_at_rest else now
    if begin < plan.first.time > 0.0:
        return _lead_in(plan, setpoint, begin, limits)
    begin = max(begin, 0.0)
    _check_begin(plan, setpoint, begin, tolerance)
    return _merge(plan, setpoint, begin, limits)


def _check_begin(plan: ArmPlan, setpoint: Setpoint, begin: float, tolerance: float) -> None:
    """The arm must be where the trajectory begins, or between there and where it is by now."""
    by_now = Walk(plan.spline).position(begin)
    for index, (first, now, told) in enumerate(zip(plan.first.position, by_now, setpoint.position, strict=True)):
        if min(first, now) - tolerance <= told <= max(first, now) + tolerance:
            continue
        where = f"{joint_names(plan.side)[index]} at {degrees(first):.1f}°"
        if begin > plan.first.time:
            where += f" and moved it to {degrees(now):.1f}° in the {begin - plan.first.time:.3f} s since then"
        raise refused(
            f"its first point, due at {plan.first.time:g} s, has {where}, while the arm is told to be at "
            f"{degrees(told):.1f}°; begin where the arm is, or give it time to go there."
        )


def _lead_in(plan: ArmPlan, setpoint: Setpoint, begin: float, limits: JointLimits) -> Spline:
    """To the first point, in the time it leaves; as smooth as its fields at rest, without any step in motion."""
    first = plan.first
    if setpoint.velocity is ZERO:
        end = first
    else:
        after = Walk(plan.spline).setpoint(first.time)
        end = TrajectoryPoint(
            first.time, first.position, first.velocity or after.velocity, first.acceleration or after.acceleration
        )
    piece = piece_between(TrajectoryPoint(begin, *setpoint), end)
    check_motion((piece,), joint_names(plan.side), limits)
    return Spline(plan.spline.pieces.behind(piece), plan.spline.last)


def _merge(plan: ArmPlan, setpoint: Setpoint, begin: float, limits: JointLimits) -> Spline:
    """Onto the running trajectory, as soon as the limits let it."""
    spline, walk = plan.spline, Walk(plan.spline)
    if _is_there(setpoint, walk.setpoint(begin)):
        return spline
    refusal: TrajectoryRefused | None = None
    for duration in _DURATIONS:
        meeting = begin + duration
        end = TrajectoryPoint(meeting, *walk.setpoint(meeting))
        piece = piece_between(TrajectoryPoint(begin, *setpoint), end)
        try:
            check_motion((piece,), joint_names(plan.side), limits)
            check_jerk(piece, joint_names(plan.side), limits.jerk)
        except TrajectoryRefused as error:
            refusal = error
            continue
        return _continued(piece, end, spline)
    raise refused(f"the arm is too far from it to join it in motion, within {_DURATIONS[-1]:g} s.") from refusal


def _continued(piece: Piece, meeting: TrajectoryPoint, spline: Spline) -> Spline:
    return Spline(spline.pieces.behind(piece), spline.last if spline.end > meeting.time else meeting)


def _is_there(setpoint: Setpoint, wanted: Setpoint) -> bool:
    return (
        max(abs(a - b) for a, b in zip(setpoint.position, wanted.position, strict=True)) <= _SAME_POSITION
        and max(abs(a - b) for a, b in zip(setpoint.velocity, wanted.velocity, strict=True)) <= _SAME_VELOCITY
    )
