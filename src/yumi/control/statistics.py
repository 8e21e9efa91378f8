"""Running statistics by Welford's method: no memory that grows, a handful of operations for each value.

The stations of a cycle and the clock that notes when each was done: where the microseconds of a reply go.

::

    begin ─ receive ─ decode ─ update ─ admit ─ encode ─ send ─ after the reply
            └ the arm's read ┘ manager  guard   └ the arm's write ┘

The cycle notes those of the middle, the arm those within its read and write, the arm's line the first and the last.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, sqrt
from typing import TypeVar


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


T = TypeVar("T")

BEGIN, RECEIVE, DECODE, UPDATE, ADMIT, ENCODE, SEND, AFTER_REPLY = range(8)
"""What a mark means: the cycle began, or the station of that name was done."""

MARK_COUNT = 8


@dataclass(frozen=True, slots=True)
class StationTimes:
    """How long each station of one cycle took [s].

    Attributes:
        receive: taking the datagrams from the socket.
        decode: bytes to state, with what the session counts.
        update: the controllers.
        admit: the guard.
        encode: command to bytes.
        send: handing them to the socket.
        after_reply: what can wait until after the reply, without the flight recorder itself.
    """

    receive: float
    decode: float
    update: float
    admit: float
    encode: float
    send: float
    after_reply: float

    @property
    def reply(self) -> float:
        """From the beginning of the cycle until the reply had left [s]."""
        return self.receive + self.decode + self.update + self.admit + self.encode + self.send


class StationClock:
    """Notes when the stations of the cycle that runs now were done.

    Args:
        now: tells the time on the machine's monotonic clock [s]. Without it every station takes no time.
    """

    __slots__ = ("_now", "marks")

    def __init__(self, now: Callable[[], float] = lambda: 0.0) -> None:
        self.marks = [0.0] * MARK_COUNT
        self._now = now

    def begin(self, now: float) -> None:
        """A cycle begins; ``now`` by the same clock."""
        self.marks = [now] * MARK_COUNT

    def note(self, station: int) -> None:
        """``station`` is done."""
        self.marks[station] = self._now()

    def timed(self, station: int, result: T) -> T:
        """``station`` is done and this is its ``result``."""
        self.marks[station] = self._now()
        return result


def station_times(marks: Sequence[float]) -> StationTimes:
    """Durations from the marks of one cycle; a station that nobody noted took no time."""
    durations, last = [], marks[BEGIN]
    for mark in marks[RECEIVE:]:
        durations.append(max(0.0, mark - last))
        last = max(last, mark)
    return StationTimes(*durations)
