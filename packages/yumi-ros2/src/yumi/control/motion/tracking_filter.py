"""The tracking filter: brings the joints to a target that was predicted.

Near the target the difference dies away as a critically damped filter of third order would have it, which lets noise of
the target through only far below its corner. A joint that this would ask too much of is brought there as fast as its
limits allow, by :func:`yumi.control.motion.joint_steps.step_towards`.
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp

from abb_protocols.robot.joints import JOINT_COUNT, ZERO_JOINTS, JointLimits, Joints, joints
from yumi.control.motion.joint_steps import step_to_rest, step_towards
from yumi.control.motion.setpoint import Setpoint
from yumi.control.motion.speed_motion import SHARE_OF_LIMITS

_FOLLOWABLE = 0.9  # a target nearly as fast or as strong as the joint cannot be caught up with
_ALL = (True,) * JOINT_COUNT
_NEAR = 3e-4  # a chase ends when the filter would go no further than this past the target [rad]


class TrackingFilter:
    """The joints of one arm after a target.

    Args:
        limits: of the joints.

    Attributes:
        stiffness: corner of the filter [rad/s]; larger follows more closely and lets more noise through.
    """

    def __init__(self, limits: JointLimits) -> None:
        self.stiffness = 40.0
        self._limits = limits.slower(SHARE_OF_LIMITS, SHARE_OF_LIMITS)
        self.begin(ZERO_JOINTS)

    def begin(self, position: Joints, velocity: Joints = ZERO_JOINTS) -> None:
        """Begin again, at ``position`` [rad] with ``velocity`` [rad/s], (7,)."""
        self._now = Setpoint(position, velocity)
        self._is_chasing = [False] * JOINT_COUNT

    @property
    def chasing(self) -> int | None:
        """The first joint whose limits let it not follow the target; None where all follow."""
        return self._is_chasing.index(True) if any(self._is_chasing) else None

    def brake(self, dt: float) -> Setpoint:
        """Go on for ``dt`` [s] > 0, braking to standstill as hard as the joints may; where they are then."""
        self._now = step_to_rest(self._now, self._limits, dt, _ALL)
        self._is_chasing = [False] * JOINT_COUNT
        return self._now

    def rebase(self, change: Callable[[Setpoint], Setpoint], mixed: range) -> None:
        """Count positions from elsewhere; ``change`` says what a motion is there, ``mixed`` which joints it mixes."""
        self._now = change(self._now)
        is_chasing = any(self._is_chasing[index] for index in mixed)
        for index in mixed:
            self._is_chasing[index] = is_chasing

    def step(self, target: Setpoint, dt: float, scale: float = 1.0) -> Setpoint:
        """Go on for ``dt`` [s] > 0, with at most ``scale`` times the joints' speeds; where the joints are then.

        Args:
            target: where the target is at the end of the step.
            dt: time that passes [s].
            scale: factor on the speeds.
        """
        limits = self._limits if scale == 1.0 else self._limits.slower(scale)
        rows = zip(*self._now, *target, limits.velocity, limits.acceleration, limits.jerk, strict=True)
        steps = [self._filtered(chasing, dt, *row) for chasing, row in zip(self._is_chasing, rows, strict=True)]
        self._is_chasing = [step is None for step in steps]
        if any(self._is_chasing):
            # A joint can catch up only with what it is stronger than.
            goal = target._replace(
                velocity=_followable(target.velocity, limits.velocity),
                acceleration=_followable(target.acceleration, limits.acceleration),
            )
            chase = step_towards(self._now, goal, limits, dt, self._is_chasing)
            chase = chase or step_to_rest(self._now, limits, dt, self._is_chasing)
            steps = [step or chased for step, chased in zip(steps, zip(*chase, strict=True), strict=True)]
        self._now = Setpoint(*(joints([step[field] for step in steps if step]) for field in range(3)))
        return self._now

    def _filtered(
        self,
        is_chasing: bool,
        dt: float,
        position: float,
        velocity: float,
        acceleration: float,
        target: float,
        speed: float,
        gain: float,
        fastest: float,
        strongest: float,
        jerk: float,
    ) -> tuple[float, float, float] | None:
        """Position, velocity and acceleration of one joint after the filter's step; None where it has to chase."""
        w = self.stiffness
        behind = position - (target - dt * (speed - 0.5 * dt * gain))
        slower_by = velocity - (speed - dt * gain)
        weaker_by = acceleration - gain
        if is_chasing and max(abs(behind), abs(slower_by) / w, abs(weaker_by) / (w * w)) > _NEAR:
            return None
        # The difference is (a + b·t + c·t²)·exp(-w·t).
        b, c = slower_by + w * behind, 0.5 * (weaker_by + w * (2.0 * slower_by + w * behind))
        left, value, slope = exp(-w * dt), behind + dt * (b + dt * c), b + 2.0 * c * dt
        after = (
            target + value * left,
            speed + (slope - w * value) * left,
            gain + (2.0 * c - 2.0 * w * slope + w * w * value) * left,
        )
        is_within = (
            abs(after[1]) <= fastest and abs(after[2]) <= strongest and abs(after[2] - acceleration) <= jerk * dt
        )
        return after if is_within else None


def _followable(values: Joints, limits: Joints) -> Joints:
    rows = zip(values, limits, strict=True)
    return joints([value if abs(value) < _FOLLOWABLE * top else 0.0 for value, top in rows])
