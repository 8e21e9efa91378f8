"""The stations of a cycle and the clock that notes when each was done: where the microseconds of a reply go.

::

    begin ─ receive ─ decode ─ update ─ admit ─ encode ─ send ─ after the reply
            └ the arm's read ┘ manager  guard   └ the arm's write ┘

The cycle notes those of the middle, the arm those within its read and write, the arm's line the first and the last.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

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
