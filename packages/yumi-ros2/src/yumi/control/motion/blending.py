"""The blend from what an arm is sent now onto a trajectory: without a step, within the limits."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

from abb_protocols.catalogue import message
from abb_protocols.errors import TrajectoryRefused
from abb_protocols.robot.joints import ZERO_JOINTS, JointLimits, Joints, joint_names
from yumi.control.motion.setpoint import Setpoint, largest_difference
from yumi.control.motion.spline import Spline, SplineSampler, TrajectoryPoint, segment_between
from yumi.control.motion.spline_limits import check_lead, check_motion
from yumi.control.trajectory_commands import ArmPlan, ResultCode, trajectory_refused

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
        raise trajectory_refused(message("trajectory_is_over", late=now - spline.end), ResultCode.OLD_HEADER_TIMESTAMP)
    is_at_rest = setpoint.velocity is ZERO_JOINTS
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
        largest_difference(setpoint.position, by_now.position) <= _SAME_POSITION
        and largest_difference(setpoint.velocity, by_now.velocity) <= _SAME_VELOCITY
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
    raise trajectory_refused(message("trajectory_too_far_away", duration=_DURATIONS[-1])) from refusal


def _check_begin(plan: ArmPlan, setpoint: Setpoint, begin: float, by_now: Joints, tolerance: float) -> None:
    """The arm must be where the trajectory begins, or between there and where it is by now."""
    for index, (first, now, place) in enumerate(zip(plan.first.position, by_now, setpoint.position, strict=True)):
        if min(first, now) - tolerance <= place <= max(first, now) + tolerance:
            continue
        raise trajectory_refused(
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
