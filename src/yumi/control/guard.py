"""The last station before the wire: no command leaves that a robot must never see.

It refuses what is not a number, keeps positions inside the joint limits, and lets the command move only as fast, and
change its motion only as quickly, as the joints may, measured from the command admitted before: hold means the last
admitted command, not the measured position, which creeps under load.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

from yumi.control.shaper import MotionShaper
from yumi.robot.joints import Joints, joints
from yumi.robot.limits import JointLimits
from yumi.robot.values import ZERO, ArmCommand, ArmState

LONGEST_STEP = 0.020
"""A gap in the feedback gives no more room to move than this [s]."""


@dataclass(slots=True)
class GuardCounters:
    """What the guard changed, in cycles.

    Attributes:
        refused: commands with a value that is no finite number; the arm held instead.
        position_limited: commands cut at a joint's range.
        slowed: commands that would have exceeded a joint's speed, acceleration or jerk.
    """

    refused: int = 0
    position_limited: int = 0
    slowed: int = 0


class Guard:
    """Admits commands of one arm.

    Args:
        limits: what the joints may do; speeds, accelerations and jerks bound how the admitted position moves.
    """

    def __init__(self, limits: JointLimits) -> None:
        self.counters = GuardCounters()
        self._limits = limits
        self._session = 0
        self._shaper = MotionShaper(limits)
        self._velocity = ZERO

    def admit(self, state: ArmState, wanted: ArmCommand | None) -> ArmCommand:
        """The command that may leave, next to ``wanted``; None holds.

        The first command of a session, and every command while the robot does not follow, equals the measured
        position: a robot that begins to follow finds no step.
        """
        if state.session != self._session or not state.is_running:
            self._session = state.session
            return self._hold(state.position)
        if wanted is None:
            return self._hold(self._shaper.position)
        if not isfinite(sum(wanted.position) + sum(wanted.velocity)):
            self.counters.refused += 1
            return self._hold(self._shaper.position)
        dt = min(state.dt, LONGEST_STEP)
        if dt <= 0.0:
            return ArmCommand(self._shaper.position, self._velocity)
        return ArmCommand(self._shape(self._inside(wanted.position), dt), self._slow(wanted.velocity, dt))

    def _hold(self, position: Joints) -> ArmCommand:
        self._shaper.rest_at(position)
        self._velocity = ZERO
        return ArmCommand(position)

    def _shape(self, position: Joints, dt: float) -> Joints:
        if self._shaper.passes(position, dt):
            return position
        self.counters.slowed += 1
        return self._shaper.approach(position, dt)

    def _inside(self, position: Joints) -> Joints:
        """Cut at the range; an arm that stands outside of it may come back but not go further."""
        lower, upper, last = self._limits.lower, self._limits.upper, self._shaper.position
        if self._limits.outside(position) is None:
            return position
        self.counters.position_limited += 1
        ranges = zip(lower, upper, last, position, strict=True)
        return joints([max(min(low, now), min(max(high, now), value)) for low, high, now, value in ranges])

    def _slow(self, velocity: Joints, dt: float) -> Joints:
        """A speed that is fed forward, within the joints' speeds and accelerations."""
        if velocity is ZERO and self._velocity is ZERO:
            return ZERO
        steps = zip(self._velocity, velocity, self._limits.velocity, self._limits.acceleration, strict=True)
        self._velocity = joints(
            [max(-top, min(top, max(old - gain * dt, min(old + gain * dt, new)))) for old, new, top, gain in steps]
        )
        return self._velocity
