"""How a wanted position moves, told from its last steps, as far as a joint that is behind can make use of it."""

from __future__ import annotations

from math import copysign
from typing import NamedTuple

from yumi.robot.joints import JOINT_COUNT, Joints, joints
from yumi.robot.limits import JointLimits
from yumi.robot.values import ZERO

_PACE = 0.9  # a goal that moves nearly as fast as the joint, or is nearly as strong, cannot be caught up with


class Goal(NamedTuple):
    """A joint's wanted position [rad], its velocity [rad/s] and acceleration [rad/s²] at the end of a step."""

    position: float
    velocity: float
    acceleration: float


class GoalMotion:
    """The motion of the wanted position of one arm.

    Args:
        limits: what the joints may do.
    """

    def __init__(self, limits: JointLimits) -> None:
        self._limits = limits
        self.rest_at(ZERO)

    def limit(self, limits: JointLimits) -> None:
        """Take other limits from the next step on."""
        self._limits = limits

    def rest_at(self, position: Joints) -> None:
        """Begin again, at rest."""
        self.note(position, ZERO, ZERO)

    def note(self, position: Joints, velocity: Joints, acceleration: Joints) -> None:
        """The wanted position was reached, with these differences of the joints' own."""
        self._position, self._velocity, self._acceleration = position, velocity, acceleration

    def move(self, position: Joints, dt: float, elapsed: float) -> list[Goal]:
        """The goals of the joints, of which ``position`` is wanted now.

        Args:
            position: what is wanted at the end of the step [rad], (7,).
            dt: how long the step is [s].
            elapsed: since the last position [s]; longer than ``dt`` after a gap.
        """
        before, last = self._acceleration, self._position
        velocity = joints([(new - old) / elapsed for old, new in zip(last, position, strict=True)])
        acceleration = joints([(new - old) / elapsed for old, new in zip(self._velocity, velocity, strict=True)])
        self.note(position, velocity, acceleration)
        return [
            self._goal(index, last[index], abs(acceleration[index] - before[index]) / elapsed, dt)
            for index in range(JOINT_COUNT)
        ]

    def _goal(self, index: int, last: float, change: float, dt: float) -> Goal:
        """At rest where it cannot be followed; without acceleration where two steps tell none that a joint has."""
        limits, position = self._limits, self._position[index]
        velocity, acceleration = self._velocity[index], self._acceleration[index]
        if not self._can_be_followed(index, last, velocity, dt):
            return Goal(position, 0.0, 0.0)
        if abs(acceleration) > _PACE * limits.acceleration[index] or change > limits.jerk[index]:
            return Goal(position, velocity, 0.0)  # noise, a stream with uneven steps, or a jump
        top = _PACE * limits.velocity[index]
        return Goal(position, max(-top, min(top, velocity + 0.5 * acceleration * dt)), acceleration)

    def _can_be_followed(self, index: int, last: float, velocity: float, dt: float) -> bool:
        """A jump is no motion; and towards the end of its range a joint must still be able to brake after its goal.

        Its jerk and the length of a step are taken into account.
        """
        limits, speed = self._limits, abs(velocity)
        top, jerk = limits.acceleration[index], limits.jerk[index]
        if speed > _PACE * limits.velocity[index]:
            return False
        end = limits.upper[index] if velocity > 0.0 else limits.lower[index]
        room = (end - last) * copysign(1.0, velocity)
        return speed * (speed / top + 2.0 * top / jerk + 2.0 * dt) < room
