"""Whole motions to a point and to rest, planned by Ruckig once and then looked up by time."""

from __future__ import annotations

from collections.abc import Iterator
from math import sqrt
from typing import Any

from ruckig import ControlInterface, InputParameter, Result, Ruckig, RuckigError, Synchronization, Trajectory

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import CHAIN_AXES, JOINT_COUNT, JointLimits, Joints, joints
from yumi.control.motion.setpoint import Setpoint

_RANGE_ROUNDING = 1e-6  # [rad] a plan that turns round at the end of a range exceeds it in the last digits


class PointMotion:
    """A motion that ends at rest.

    Args:
        trajectory: the way; None for a motion that is over.
        end: where it ends exactly [rad], (7,).

    Attributes:
        end: as above.
        duration: time until it ends [s].
    """

    def __init__(self, trajectory: Trajectory | None, end: Joints) -> None:
        self._at_time = trajectory.at_time if trajectory else None
        self.end = end
        self.duration = float(trajectory.duration) if trajectory else 0.0

    def motion(self, time: float) -> tuple[Joints, Joints]:
        """Positions [rad] and velocities [rad/s] ``time`` [s] >= 0 after the begin."""
        return self.setpoint(time)[:2]

    def setpoint(self, time: float) -> Setpoint:
        """Where the joints are ``time`` [s] >= 0 after the begin."""
        if self._at_time is None or time >= self.duration:
            return Setpoint(self.end)
        return Setpoint(*map(tuple, self._at_time(time)))


def point_travel(start: Setpoint, goal: Joints, limits: JointLimits) -> PointMotion:
    """To ``goal``, all joints arriving together; a straight way in joint space where the start allows it.

    Args:
        start: how the joints move when it begins.
        goal: where it ends [rad], (7,).
        limits: speeds, accelerations and jerks it keeps; a start that is faster comes down to them at once.

    Raises:
        CommandRefused: the way would leave the range of a joint: it cannot turn round before its end.
    """
    plan = _plan_from(start, limits)
    plan.synchronization = Synchronization.Phase
    plan.target_position, plan.max_velocity = goal, limits.velocity
    trajectory = _calculate(plan)
    for index, profile in enumerate(trajectory.profiles[0]):
        lowest = min(limits.lower[index], start.position[index]) - _RANGE_ROUNDING
        highest = max(limits.upper[index], start.position[index]) + _RANGE_ROUNDING
        if not all(lowest <= turn <= highest for turn in _turning_points(profile)):
            raise CommandRefused(
                message(
                    "goal_turn_too_fast",
                    axis=CHAIN_AXES[index],
                    lower=limits.lower[index],
                    upper=limits.upper[index],
                )
            )
    return PointMotion(trajectory, goal)


def point_stop(start: Setpoint, limits: JointLimits) -> PointMotion:
    """From how the joints move now to rest, each joint as soon as ``limits`` let it."""
    plan = _plan_from(start, limits)
    plan.control_interface = ControlInterface.Velocity
    plan.synchronization = Synchronization.No  # a joint that needs longer does not make others wait
    trajectory = _calculate(plan)
    return PointMotion(trajectory, joints(trajectory.at_time(trajectory.duration)[0]))


def _plan_from(start: Setpoint, limits: JointLimits) -> InputParameter:
    plan = InputParameter(JOINT_COUNT)
    plan.current_position, plan.current_velocity, plan.current_acceleration = start
    plan.max_acceleration, plan.max_jerk = limits.acceleration, limits.jerk
    return plan


def _calculate(plan: InputParameter) -> Trajectory:
    """The trajectory that Ruckig finds; at a few degrees a second it sometimes finds none.

    Ruckig raises in some cases where its documentation returns a result; ValueError stands for results that its Python
    side does not know (0.19). A new generator for each plan keeps no state between plans.
    """
    trajectory = Trajectory(JOINT_COUNT)
    result: Result | Exception
    try:
        result = Ruckig(JOINT_COUNT).calculate(plan, trajectory)
    except (RuckigError, ValueError) as error:
        result = error
    if result not in (Result.Working, Result.Finished):
        start = tuple(map(float, plan.current_position))
        raise CommandRefused(message("goal_without_motion", start=start, result=str(result)))
    return trajectory


def _turning_points(profile: Any) -> Iterator[float]:
    """Positions [rad] where a joint turns round; Ruckig's own extrema leave some out (0.19)."""
    for part in (profile.brake, profile):
        for duration, p, v, a, j in zip(part.t, part.p, part.v, part.a, part.j, strict=False):
            # Its speed v + a·t + j·t²/2 is zero.
            times: tuple[float, ...] = ()
            if j == 0.0:
                times = (-v / a,) if a != 0.0 else ()
            elif (square := a * a - 2.0 * j * v) >= 0.0:
                times = ((-a - sqrt(square)) / j, (-a + sqrt(square)) / j)
            for time in times:
                if 0.0 < time <= duration:
                    yield p + time * (v + time * (a / 2.0 + time * j / 6.0))
