"""Running statistics by Welford's method: no memory that grows, a handful of operations for each value."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, sqrt


@dataclass(frozen=True, slots=True)
class Statistics:
    """What a series of values was like; all zero while there was none.

    Attributes:
        count: how many values.
        current: the last one.
        mean: their mean.
        minimum: the smallest.
        maximum: the largest.
        deviation: their standard deviation.
    """

    count: int = 0
    current: float = 0.0
    mean: float = 0.0
    minimum: float = 0.0
    maximum: float = 0.0
    deviation: float = 0.0


class RunningStatistics:
    """Adds up a series of values."""

    __slots__ = ("_count", "_current", "_maximum", "_mean", "_minimum", "_squares")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget all values."""
        self._count = 0
        self._current = self._mean = self._squares = 0.0
        self._minimum, self._maximum = inf, -inf

    def add(self, value: float) -> None:
        """Take one more value; done several times in each cycle, hence the plain comparisons."""
        self._count = count = self._count + 1
        self._current = value
        step = value - self._mean
        self._mean = mean = self._mean + step / count
        self._squares += step * (value - mean)
        if value > self._maximum or value < self._minimum:
            self._maximum, self._minimum = max(self._maximum, value), min(self._minimum, value)

    def result(self) -> Statistics:
        """What the values were like until now."""
        if not self._count:
            return Statistics()
        deviation = sqrt(self._squares / self._count)
        return Statistics(self._count, self._current, self._mean, self._minimum, self._maximum, deviation)
