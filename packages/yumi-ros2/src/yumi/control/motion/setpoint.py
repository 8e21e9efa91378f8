"""The setpoint of an arm's joints: where they are at one moment and how they move."""

from __future__ import annotations

from operator import sub
from typing import NamedTuple

from abb_protocols.robot.joints import ZERO_JOINTS, Joints


class Setpoint(NamedTuple):
    """Where the joints are at one moment, and how they move.

    Attributes:
        position: chain order [rad], (7,).
        velocity: [rad/s], (7,); the tuple ``ZERO_JOINTS`` itself at rest.
        acceleration: [rad/s²], (7,).
    """

    position: Joints
    velocity: Joints = ZERO_JOINTS
    acceleration: Joints = ZERO_JOINTS

    def scaled(self, factor: float) -> Setpoint:
        """The same point of a motion for which time goes by ``factor`` times as fast."""
        if factor == 1.0 or self.velocity is ZERO_JOINTS:
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
        if factor == 1.0 or self.velocity is ZERO_JOINTS:
            return self
        return Setpoint(self.position, tuple([each / factor for each in self.velocity]))


def largest_difference(left: Joints, right: Joints) -> float:
    """Of two positions, by the joint that differs most [rad]."""
    differences: map[float] = map(sub, left, right)  # asked four times in each cycle
    return max(map(abs, differences))
