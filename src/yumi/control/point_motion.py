"""Motions to a single point, planned online: jerk-limited, all joints together, from whatever the joints do now.

A plan is calculated once, by the online trajectory generator Ruckig, and then only looked up by its time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import inf, sqrt
from typing import Any, NamedTuple, cast

from ruckig import ControlInterface, InputParameter, Result, Ruckig, Synchronization, Trajectory

from yumi.errors import CommandRefused
from yumi.robot.joints import CHAIN_AXES, JOINT_COUNT, Joints, joints
from yumi.robot.limits import JointLimits
from yumi.robot.values import ZERO

_ROUNDING = 1e-6  # [rad] a plan that turns round at the end of a range exceeds it in the last digits


class Setpoint(NamedTuple):
    """Where the joints shall be at one moment, and how they move.

    Attributes:
        position: chain order [rad], (7,).
        velocity: [rad/s], (7,); the tuple ``ZERO`` itself at rest.
        acceleration: [rad/s²], (7,).
    """

    position: Joints
    velocity: Joints = ZERO
    acceleration: Joints = ZERO

    def scaled(self, factor: float) -> Setpoint:
        """The same point of a motion for which time goes by ``factor`` times as fast."""
        if factor == 1.0 or self.velocity is ZERO:
            return self
        return Setpoint(
            self.position,
            _fixed([factor * each for each in self.velocity]),
            _fixed([factor * factor * each for each in self.acceleration]),
        )

    def unscaled(self, factor: float) -> Setpoint:
        """The point of a motion for which time will go by ``factor`` times as fast as outside.

        An acceleration would be far beyond a joint's limits there; it is left out, and the limiter takes it back.
        """
        if factor == 1.0 or self.velocity is ZERO:
            return self
        return Setpoint(self.position, _fixed([each / factor for each in self.velocity]))


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

    def at(self, time: float) -> Setpoint:
        """Where the joints shall be ``time`` [s] >= 0 after the begin."""
        if self._at_time is None or time >= self.duration:
            return Setpoint(self.end)
        position, velocity, acceleration = self._at_time(time)
        return Setpoint(_fixed(position), _fixed(velocity), _fixed(acceleration))


def slower(limits: JointLimits, speed: float = 1.0, acceleration: float = 1.0, top_speed: float = inf) -> JointLimits:
    """``limits`` for a gentler motion.

    Args:
        limits: what the joints may do.
        speed: share of the speeds, above 0 up to 1.
        acceleration: share of the accelerations and jerks, above 0 up to 1.
        top_speed: no joint is faster than this share of it [rad/s].
    """
    return replace(
        limits,
        velocity=_fixed([speed * min(each, top_speed) for each in limits.velocity]),
        acceleration=_fixed([acceleration * each for each in limits.acceleration]),
        jerk=_fixed([acceleration * each for each in limits.jerk]),
    )


def travel(start: Setpoint, goal: Joints, limits: JointLimits) -> PointMotion:
    """To ``goal``, all joints arriving together; a straight way in joint space where the start allows it.

    Args:
        start: what the joints do when it begins.
        goal: where it ends [rad], (7,).
        limits: speeds, accelerations and jerks it keeps; a start that is faster comes down to them at once.

    Raises:
        CommandRefused: the way would leave the range of a joint: it cannot turn round before its end.
    """
    plan = _plan(start, limits)
    plan.target_position = goal
    plan.max_velocity = limits.velocity
    plan.synchronization = Synchronization.Phase
    trajectory = _calculated(plan)
    _check_range(trajectory, start.position, limits)
    return PointMotion(trajectory, goal)


def stop(start: Setpoint, limits: JointLimits) -> PointMotion:
    """From what the joints do now to rest, each joint as soon as ``limits`` let it."""
    plan = _plan(start, limits)
    plan.control_interface = ControlInterface.Velocity
    plan.synchronization = Synchronization.No
    trajectory = _calculated(plan)
    return PointMotion(trajectory, joints(trajectory.at_time(trajectory.duration)[0]))


def _plan(start: Setpoint, limits: JointLimits) -> InputParameter:
    plan = InputParameter(JOINT_COUNT)
    plan.current_position, plan.current_velocity, plan.current_acceleration = start
    plan.max_acceleration, plan.max_jerk = limits.acceleration, limits.jerk
    return plan


def _calculated(plan: InputParameter) -> Trajectory:
    trajectory = Trajectory(JOINT_COUNT)
    result = Ruckig(JOINT_COUNT).calculate(plan, trajectory)
    if result not in (Result.Working, Result.Finished):
        raise CommandRefused(
            f"Goal refused: no motion within the limits leads there from {plan.current_position} rad ({result}); "
            "let the arm come to rest first."
        )
    return trajectory


def _check_range(trajectory: Trajectory, start: Joints, limits: JointLimits) -> None:
    for index, profile in enumerate(trajectory.profiles[0]):
        turns = list(_turning_points(profile))
        lowest, highest = min(limits.lower[index], start[index]), max(limits.upper[index], start[index])
        if turns and not lowest - _ROUNDING <= min(turns) <= max(turns) <= highest + _ROUNDING:
            raise CommandRefused(
                f"Goal refused: axis {CHAIN_AXES[index]} is too fast to turn round within its range "
                f"({limits.range_deg(index)}) at this acceleration; ask for a higher one or let the arm stop first."
            )


def _turning_points(profile: Any) -> Iterator[float]:
    """Positions [rad] where a joint turns round; Ruckig's own extrema leave some out (0.19)."""
    for part in (profile.brake, profile):
        for duration, p, v, a, j in zip(part.t, part.p, part.v, part.a, part.j, strict=False):
            for time in _standstills(v, a, j):
                if 0.0 < time <= duration:
                    yield p + time * (v + time * (a / 2.0 + time * j / 6.0))


def _standstills(v: float, a: float, j: float) -> tuple[float, ...]:
    """Times [s] at which the speed ``v + a·t + j·t²/2`` is zero."""
    if j == 0.0:
        return (-v / a,) if a != 0.0 else ()
    square = a * a - 2.0 * j * v
    return () if square < 0.0 else ((-a - sqrt(square)) / j, (-a + sqrt(square)) / j)


def _fixed(values: Sequence[float]) -> Joints:
    return cast("Joints", tuple(values))
