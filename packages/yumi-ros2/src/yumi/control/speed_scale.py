"""The speed scale of an arm: one factor on the speed of whatever moves it."""

from __future__ import annotations

from typing import NamedTuple

from yumi.control.goals import Buffer
from yumi.control.motion.joint_steps import ramp_speed

FULL_SPEED = 1.0

_FASTEST = 4.0  # [1/s] at full speed a change takes two thirds of a joint's acceleration
_HARSHEST = 40.0  # [1/s²] and not half of its jerk


class SpeedFactor(NamedTuple):
    """A factor on the speed of one arm, above 0 up to 1."""

    value: float


class SpeedScale:
    """One factor on speed for all controllers and for the limiter of one arm.

    Planned motions let time go by slower by it, along the same path; whatever else is commanded is limited to that
    factor of the joints' speeds. It changes gradually: no joint exceeds its acceleration or jerk, in the middle of a
    motion, too.

    Args:
        goal: where the factor to go to is set, above 0 up to 1; without one it stays at 1.

    Attributes:
        value: the factor in this cycle.
        highest: it is not above this, whatever is set.
    """

    def __init__(self, goal: Buffer[SpeedFactor] | None = None) -> None:
        self._goal = goal
        self._rate = 0.0
        self.highest = FULL_SPEED
        self.value = self._set_value()

    def _set_value(self) -> float:
        newest = self._goal.read() if self._goal else None
        return min(newest[1].value if newest else FULL_SPEED, self.highest)

    def jump(self) -> None:
        """Go to what is set at once, of an arm that does not move."""
        self.value, self._rate = self._set_value(), 0.0

    def advance(self, dt: float) -> bool:
        """Go on for ``dt`` [s]; to be called once between two cycles.

        Returns:
            Whether :attr:`value` has changed.
        """
        goal, before = self._set_value(), self.value
        if (goal == before and not self._rate) or dt <= 0.0:
            return False
        self.value, self._rate = ramp_speed(goal, before, self._rate, FULL_SPEED, _FASTEST, _HARSHEST, dt)
        if min(before, goal) > self.value or self.value > max(before, goal):  # by the last digits of a ramp
            self.value, self._rate = goal, 0.0
        return True
