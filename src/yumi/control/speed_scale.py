"""The factor on the speed of whatever moves an arm, as its control loop uses it: ``speed_scale``."""

from __future__ import annotations

from yumi.control.feed_forward import ramped
from yumi.control.mailbox import Mailbox

FULL = 1.0

_FASTEST = 4.0  # [1/s] at full speed a change takes two thirds of a joint's acceleration
_HARSHEST = 40.0  # [1/s²] and not half of its jerk


class SpeedScale:
    """One factor for all controllers and for the limiter of one arm.

    Planned motions let time go by slower by it, along the same path; whatever else is commanded is limited to that
    share of the joints' speeds. It changes gradually: no joint exceeds its acceleration or jerk, in the middle of a
    motion, too.

    Args:
        wanted: where others put what it shall be, above 0 up to 1; without one it stays at 1.

    Attributes:
        value: the factor in this cycle.
    """

    def __init__(self, wanted: Mailbox | None = None) -> None:
        self._wanted = wanted
        self._rate = 0.0
        letter = wanted.peek() if wanted else None
        self.value = letter[1][0] if letter else FULL

    def advance(self, dt: float) -> bool:
        """Go on for ``dt`` [s]; to be called once between two cycles.

        Returns:
            Whether :attr:`value` has changed.
        """
        letter = self._wanted.peek() if self._wanted else None
        if letter is None or (letter[1][0] == self.value and not self._rate) or dt <= 0.0:
            return False
        wanted, before = letter[1][0], self.value
        self.value, self._rate = ramped(wanted, before, self._rate, FULL, _FASTEST, _HARSHEST, dt)
        if min(before, wanted) > self.value or self.value > max(before, wanted):  # by the last digits of a ramp
            self.value, self._rate = wanted, 0.0
        return True
