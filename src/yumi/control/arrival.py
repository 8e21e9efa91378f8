"""When the next datagram of a robot is due, and how long before it is worth being awake.

The robot's period is known; what has to be learned is how late the machine wakes up from a sleep and how much the
arrivals jitter. The margin grows at once when a datagram was already waiting, and shrinks slowly otherwise, so that
it settles where a datagram is rarely missed and little time is spent looking.
"""

from __future__ import annotations

from math import inf

from yumi.robot.cycle import CYCLE

_STEADINESS = 1.0 / 64.0  # weight of one interval in the learned period
_BELIEVED = (0.5, 1.5)  # intervals outside of this share of the period are gaps or bursts, not the period
_ANOTHER_PERIOD = 8  # so many intervals in a row that are not believed are the period after all
_GROWTH = 1.5
_SHRINKAGE = 0.995
_SMALLEST = 50e-6  # [s] less than any sleep is late


class ArrivalForecast:
    """Forecasts the arrivals of one arm.

    Args:
        largest_share: the margin is at most this share of the period, which bounds the time spent looking.
    """

    def __init__(self, largest_share: float = 0.1) -> None:
        self.period = CYCLE
        self.margin = _SMALLEST * 4
        self._largest_share = largest_share
        self._unbelieved = 0
        self._last = -inf

    def note_arrival(self, now: float, *, was_waiting: bool) -> None:
        """A datagram came.

        Args:
            now: when [s].
            was_waiting: whether it was there before anybody looked.
        """
        interval = now - self._last
        self._last = now
        self._learn(interval)
        factor = _GROWTH if was_waiting else _SHRINKAGE
        self.margin = min(max(self.margin * factor, _SMALLEST), self._largest_share * self.period)

    def _learn(self, interval: float) -> None:
        low, high = _BELIEVED
        if low * self.period < interval < high * self.period:
            self.period += _STEADINESS * (interval - self.period)
            self._unbelieved = 0
            return
        self._unbelieved += 1
        if self._unbelieved == _ANOTHER_PERIOD:
            self.period, self._unbelieved = interval, 0

    def wake_at(self) -> float:
        """When to be awake for the next datagram [s]; minus infinity before the first."""
        return self._last + self.period - self.margin

    def give_up_at(self) -> float:
        """Until when to look for it without a pause [s]; after that it is late and a sleep costs nothing more."""
        return self._last + self.period + self.margin
