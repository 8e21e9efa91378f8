"""The last station before the wire: no command leaves that a robot must never see.

It refuses what is not a number, keeps positions inside the joint limits, and lets the command move no faster than
the joint speeds allow, measured from the command admitted before: hold means the last admitted command, not the
measured position, which creeps under load.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

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
        velocity_limited: commands slowed down to a joint's speed.
    """

    refused: int = 0
    position_limited: int = 0
    velocity_limited: int = 0


class Guard:
    """Admits commands of one arm.

    Args:
        limits: what the joints may do; the speeds bound how fast the admitted position moves.
    """

    def __init__(self, limits: JointLimits) -> None:
        self.counters = GuardCounters()
        self._limits = limits
        self._session = 0
        self._admitted = ArmCommand(ZERO)

    def admit(self, state: ArmState, wanted: ArmCommand | None) -> ArmCommand:
        """The command that may leave, next to ``wanted``; None holds.

        The first command of a session, and every command while the robot does not follow, equals the measured
        position: a robot that begins to follow finds no step.
        """
        if state.session != self._session or not state.is_running:
            self._session = state.session
            self._admitted = ArmCommand(state.position)
        elif wanted is None:
            self._admitted = ArmCommand(self._admitted.position)
        elif not isfinite(sum(wanted.position) + sum(wanted.velocity)):
            self.counters.refused += 1
            self._admitted = ArmCommand(self._admitted.position)
        else:
            self._admitted = self._limit(wanted, min(state.dt, LONGEST_STEP))
        return self._admitted

    def _limit(self, wanted: ArmCommand, dt: float) -> ArmCommand:
        position = self._inside(wanted.position)
        share = self._share_of_step(position, dt)
        velocity = self._slow(wanted.velocity)
        if share < 1.0:
            self.counters.velocity_limited += 1
            position = joints(
                [old + share * (new - old) for old, new in zip(self._admitted.position, position, strict=True)]
            )
        return ArmCommand(position, velocity)

    def _inside(self, position: Joints) -> Joints:
        """Cut at the range; an arm that stands outside of it may come back but not go further."""
        lower, upper, last = self._limits.lower, self._limits.upper, self._admitted.position
        if self._limits.outside(position) is None:
            return position
        self.counters.position_limited += 1
        return joints(
            [
                max(min(low, now), min(max(high, now), value))
                for low, high, now, value in zip(lower, upper, last, position, strict=True)
            ]
        )

    def _share_of_step(self, position: Joints, dt: float) -> float:
        """The part of the way that the slowest joint may go; all joints share it, which keeps the direction."""
        share = 1.0
        for old, new, speed in zip(self._admitted.position, position, self._limits.velocity, strict=True):
            step, room = abs(new - old), speed * dt
            if step > room:
                share = min(share, room / step)
        return share

    def _slow(self, velocity: Joints) -> Joints:
        if velocity is ZERO:
            return velocity
        limits = self._limits.velocity
        return joints([max(-limit, min(limit, value)) for value, limit in zip(velocity, limits, strict=True)])
