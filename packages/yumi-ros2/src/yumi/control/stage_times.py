"""The stages of a cycle and their times: where the microseconds of a reply go.

::

    begin ─ receive ─ decode ─ update ─ limit ─ encode ─ send ─ after the reply
            └ the arm's receive ┘ manager └ the arm's reply ┘

The cycle notes what the controllers take, the arm what the core does, the control loop the first and the last.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, sqrt

from yumi.control.controller_info import Statistics

CYCLE_BEGIN, RECEIVE_STAGE, DECODE_STAGE, UPDATE_STAGE, LIMIT_STAGE, ENCODE_STAGE, SEND_STAGE, AFTER_REPLY = range(8)
"""Indices of marks: the cycle began, or the stage of that name was done."""

STAGE_MARK_COUNT = 8


@dataclass(frozen=True, slots=True)
class StageTimes:
    """How long each stage of one cycle took [s].

    Attributes:
        receive: taking the datagrams from the socket.
        decode: bytes to state, with what the session counts and whether that state can be true.
        update: the controllers.
        limit: the limiter.
        encode: command to bytes.
        send: handing them to the socket.
        after_reply: what can wait until after the reply, without the flight recorder itself.
    """

    receive: float
    decode: float
    update: float
    limit: float
    encode: float
    send: float
    after_reply: float

    @staticmethod
    def of(marks: Sequence[float]) -> StageTimes:
        """From the marks of one cycle [s]; a stage that was not noted took no time."""
        durations, last = [], marks[CYCLE_BEGIN]
        for mark in marks[RECEIVE_STAGE:]:
            durations.append(max(0.0, mark - last))
            last = max(last, mark)
        return StageTimes(*durations)

    @property
    def reply(self) -> float:
        """From the beginning of the cycle until the reply had left [s]."""
        return self.receive + self.decode + self.update + self.limit + self.encode + self.send


class StageClock:
    """Notes when the stages of the current cycle were done.

    Args:
        now: returns the time on the machine's monotonic clock [s]. Without it every stage takes no time.
    """

    __slots__ = ("_is_timed", "_now", "marks")

    def __init__(self, now: Callable[[], float] | None = None) -> None:
        self.marks = [0.0] * STAGE_MARK_COUNT
        self._now = now or float  # 0.0
        self._is_timed = now is not None

    def begin(self, now: float) -> None:
        """A cycle begins; ``now`` by the same clock."""
        self.marks = [now if self._is_timed else 0.0] * STAGE_MARK_COUNT

    def note(self, stage: int) -> None:
        """``stage`` is done."""
        self.marks[stage] = self._now()


class RunningStatistics:
    """Adds up a series of values by Welford's method: no memory that grows, a handful of operations for each value."""

    __slots__ = ("_count", "_current", "_maximum", "_mean", "_minimum", "_squares")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget all values."""
        self._count = 0
        self._current = self._mean = self._squares = 0.0
        self._minimum, self._maximum = inf, -inf

    def add(self, value: float) -> None:
        """Take one more value."""
        self._count += 1
        self._current = value
        step = value - self._mean
        self._mean += step / self._count
        self._squares += step * (value - self._mean)
        self._minimum, self._maximum = min(self._minimum, value), max(self._maximum, value)

    def result(self) -> Statistics:
        """The statistics of the values until now."""
        if not self._count:
            return Statistics()
        deviation = sqrt(self._squares / self._count)
        return Statistics(self._count, self._current, self._mean, self._minimum, self._maximum, deviation)
