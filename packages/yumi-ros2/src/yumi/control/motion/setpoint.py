"""The setpoint of an arm's joints: where they are at one moment and how they move."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from typing import NamedTuple

from abb_protocols.robot.joints import ZERO, JointLimits, Joints


class Setpoint(NamedTuple):
    """Where the joints are at one moment, and how they move.

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
            tuple([factor * each for each in self.velocity]),
            tuple([factor * factor * each for each in self.acceleration]),
        )

    def unscaled(self, factor: float) -> Setpoint:
        """The point of a motion for which time will go by ``factor`` times as fast as outside.

        An acceleration would be far beyond a joint's limits there; it is left out, and the limiter takes it back.
        """
        if factor == 1.0 or self.velocity is ZERO:
            return self
        return Setpoint(self.position, tuple([each / factor for each in self.velocity]))


def slower(limits: JointLimits, speed: float = 1.0, acceleration: float = 1.0, top_speed: float = inf) -> JointLimits:
    """``limits`` for a gentler motion.

    Args:
        limits: of the joints.
        speed: factor on the speeds, above 0 up to 1.
        acceleration: factor on accelerations and jerks, above 0 up to 1.
        top_speed: no joint is faster than ``speed`` times this [rad/s].
    """
    return replace(
        limits,
        velocity=tuple([speed * min(each, top_speed) for each in limits.velocity]),
        acceleration=tuple([acceleration * each for each in limits.acceleration]),
        jerk=tuple([acceleration * each for each in limits.jerk]),
    )


def largest_difference(left: Joints, right: Joints) -> float:
    """Of two positions, by the joint that differs most [rad]."""
    return max(abs(a - b) for a, b in zip(left, right, strict=True))
