"""One robot's EGM conversation as we see it: which datagrams count, when a session begins, when the robot is silent.

The robot speaks first and counts its datagrams from 0 in each session; nothing in the protocol announces an end
(reference/egm.md §2.1, §4). A robot that comes back after a silence either has counted on all the while, then the
session goes on and so does the last reference, or it has begun anew, then everything begins at where it stands.

UDP may deliver a datagram late, twice or after a newer one. The robot's number and its clock tell these from the next
datagram of the session and from the first of another: accidents are meant, not a sender that forges both
(docs/explanation/decisions/0055-threat-model.md).

How regularly a robot's datagrams arrive: running estimates, a few additions per datagram and no memory of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from math import inf
from typing import Generic, Protocol, TypeVar

from yumi.errors import ProtocolError
from yumi.robot.joints import CYCLE, Joints

_SMOOTHING = 16.0  # of the jitter, as in RFC 3550
_WINDOW = 1.0  # [s] in which the fastest datagram is taken as undelayed
_CLOCK_JUMP = 1.0  # [s] by which a clock was set, not a datagram delayed


class Arrivals:
    """The arrivals of one session, by our clock and the robot's.

    Attributes:
        jitter: mean difference of two datagrams' delays, as RFC 3550 smooths it [s].
        worst_jitter: the largest such difference of the session [s].
        drift_ppm: by how much the robot's clock is faster than ours, from the fastest datagrams of its first and its
            last full second [ppm]; 0 before the second of them.
    """

    def __init__(self) -> None:
        self._offset = self._lowest = self._lowest_at = self._window_end = 0.0
        self._before: tuple[float, float] | None = None
        self.begin(0.0, 0.0)

    @property
    def cycle_time(self) -> float:
        """Mean time between two datagrams that the robot sent, by our clock [s]; 0 before the second."""
        return (self._last_arrival - self._first_arrival) / self._count if self._count else 0.0

    def begin(self, now: float, robot_time: float) -> None:
        """The first datagram of a session arrived [s], with a robot's time [s]."""
        self.jitter = self.worst_jitter = self.drift_ppm = 0.0
        self._count = 0
        self._first_arrival = self._last_arrival = now
        self._set_clock(now, now - robot_time)

    def note(self, now: float, robot_time: float, sent: int) -> None:
        """Another arrived, after ``sent`` that the robot sent since the one before, itself included."""
        offset = now - robot_time
        deviation = abs(offset - self._offset)
        self._count += sent
        self._last_arrival = now
        if deviation > _CLOCK_JUMP:
            self._set_clock(now, offset)
            return
        self._offset = offset
        self.jitter += (deviation - self.jitter) / _SMOOTHING
        self.worst_jitter = max(self.worst_jitter, deviation)
        if offset < self._lowest:
            self._lowest, self._lowest_at = offset, now
        if now >= self._window_end:
            if self._before is None:
                self._before = (self._lowest, self._lowest_at)
            else:
                lowest, since = self._before
                self.drift_ppm = (lowest - self._lowest) / (self._lowest_at - since) * 1e6
            self._lowest, self._window_end = inf, now + _WINDOW

    def _set_clock(self, now: float, offset: float) -> None:
        self._offset = self._lowest = offset
        self._lowest_at = now
        self._before = None
        self._window_end = now + _WINDOW


SILENCE = 0.020
"""A robot that says nothing for five cycles is lost [s]."""

REORDERED = 16
"""So many of the newest sequence numbers are remembered: what is counted as lost may still arrive [datagrams]."""

LARGEST_GAP = 64
"""A sequence number higher by more than this is none of the session: so many cycles are a silence [datagrams]."""

LONG_SILENCE = 1.0
"""After this time a datagram begins a session whatever the robot's clock says: the controller was restarted [s]."""

_CLOCK_TOLERANCE = 0.05  # by so much the time a robot needed for its datagrams may differ from their number
_RANGE = 2**32
_SESSION_WINDOW = (2 << REORDERED) - 1


class Counted(Protocol):
    """What a session needs to know of a robot's message."""

    @property
    def seqno(self) -> int:
        """The robot's count of its datagrams."""

    @property
    def measured_time(self) -> float:
        """The robot's clock [s]."""


Message = TypeVar("Message", bound=Counted)
Message_co = TypeVar("Message_co", bound=Counted, covariant=True)


class Codec(Protocol[Message_co]):
    """What a session needs of a codec."""

    def decode(self, datagram: bytes) -> Message_co:
        """The robot's message; raises ProtocolError."""

    def encode_joints(self, seqno: int, position: Joints, velocity: Joints | None) -> bytes:
        """The datagram with a reference."""


@dataclass(slots=True)
class SessionCounters:
    """What happened on the wire since the start, in datagrams.

    Attributes:
        received: datagrams that count.
        lost: datagrams the robot sent in a session that never arrived.
        late: datagrams that waited together with a newer one, which was answered instead.
        stale: datagrams that arrived after a newer one was answered.
        repeated: datagrams that arrived before.
        malformed: datagrams that are no EGM of such a robot.
    """

    received: int = 0
    lost: int = 0
    late: int = 0
    stale: int = 0
    repeated: int = 0
    malformed: int = 0

    @property
    def missed(self) -> int:
        """Datagrams the robot sent in a session that got no answer of their own."""
        return self.lost + self.late + self.stale


@dataclass(slots=True)  # frozen, it would take three times as long to make, in every cycle
class _Heard(Generic[Message]):
    """A datagram and when it arrived [s]."""

    message: Message
    arrival: float


class _State(Enum):
    NONE = 0  # no robot has been heard
    BEGUN = 1  # open, and the message accepted last is of a session that began with it, or with one just before it
    RESUMED = 2  # the same of a session that has outlived a silence
    OPEN = 3
    SILENT = 4


_NONE, _BEGUN, _RESUMED, _OPEN, _SILENT = _State  # an enumeration is slow to look into


class SensorSession(Generic[Message]):
    """Turns datagrams into messages that count, and commands into datagrams.

    Attributes:
        number: number of the session, 0 before the first.
        arrivals: how regularly its datagrams come.
        last_error: what was wrong with the malformed datagram that came last.
    """

    def __init__(self, codec: Codec[Message], *, silence: float = SILENCE) -> None:
        self.counters = SessionCounters()
        self.arrivals = Arrivals()
        self.number = 0
        self.last_error = ""
        self._codec = codec
        self._silence = silence
        self._state = _NONE
        self._last: _Heard[Message] | None = None  # accepted last
        self._first_seqno = 0
        self._seen = 0  # a bit for each of the newest sequence numbers, bit 0 for the last
        self._sent = 0  # datagrams the robot sent since the one settled last
        self._reply_seqno = 0

    @property
    def is_open(self) -> bool:
        """Whether a session is going on."""
        return self._state is not _NONE and self._state is not _SILENT

    @property
    def is_first(self) -> bool:
        """Whether the message accepted last is the first of its session."""
        return self._state is _BEGUN

    @property
    def is_resumed(self) -> bool:
        """Whether the message accepted last is the first after a silence that the session has outlived."""
        return self._state is _RESUMED

    def accept(self, datagrams: Sequence[bytes], now: float) -> Message | None:
        """Take what has arrived, oldest first; the newest counts, the others are too late to answer.

        Args:
            datagrams: everything that waits in the socket; usually one.
            now: arrival time [s].

        Returns:
            What is to be answered, or None.
        """
        accepted: Message | None = None
        if self._state is _BEGUN or self._state is _RESUMED:
            self._state = _OPEN
        for datagram in datagrams:
            try:
                message = self._codec.decode(datagram)
            except ProtocolError as error:
                self.counters.malformed += 1
                self.last_error = str(error)
                continue
            if not self._takes(message, now):
                continue
            if accepted is not None:
                self.counters.late += 1
            accepted = message
        return accepted

    def reply(self, position: Joints, velocity: Joints | None) -> bytes:
        """The answer to the message accepted last [rad], [rad/s]."""
        return self._codec.encode_joints(self.next_seqno(), position, velocity)

    def next_seqno(self) -> int:
        """The number of our next datagram in this session."""
        seqno = self._reply_seqno
        self._reply_seqno = seqno + 1
        return seqno

    def settle(self) -> None:
        """After the reply: take the message accepted last into the statistics."""
        if self._sent and self._last is not None:
            self.arrivals.note(self._last.arrival, self._last.message.measured_time, self._sent)
            self._sent = 0

    def silence(self, now: float) -> float:
        """Time since the last datagram that counted [s]."""
        return now - self._last.arrival if self._last is not None else inf

    def close_if_silent(self, now: float) -> bool:
        """Close the session when the robot has been silent for too long; returns whether it was closed now."""
        if not self.is_open or self.silence(now) <= self._silence:
            return False
        self._state = _SILENT
        return True

    def _takes(self, message: Message, now: float) -> bool:
        """Whether a message is newer than all before it: the session's next one, or the first of another."""
        last = self._last
        if last is None:
            self._begin(message, now)
            return True
        ahead = _ahead(last.message, message)
        later = message.measured_time - last.message.measured_time
        silence = now - last.arrival
        if self._state is not _SILENT and (silence <= self._silence or ahead == 1):
            # The very next number counts whatever the robot's clock says, which may have been set.
            goes_on, is_new = ahead == 1 or (later > 0.0 and 0 < ahead <= LARGEST_GAP), later > 0.0
        else:
            is_of_session = self._agree(ahead, later)
            goes_on = is_of_session and ahead > 0
            is_new = not is_of_session and (later > 0.0 or silence > LONG_SILENCE)
        if goes_on:
            self._go_on(message, ahead, now)
        elif is_new:
            self._begin(message, now)
        else:
            self._count_old(message, -ahead)
        return goes_on or is_new

    def _agree(self, ahead: int, later: float) -> bool:
        """Whether the robot's clock has gone on by the time of ``ahead`` datagrams, or back where these are negative.

        Our clock does not count: a virtual robot stands still with us on a machine that stalls.
        """
        cycle = self.arrivals.cycle_time or CYCLE
        return abs(later - ahead * cycle) <= cycle + _CLOCK_TOLERANCE * abs(later)

    def _go_on(self, message: Message, ahead: int, now: float) -> None:
        if self._state is _SILENT:
            self._state = _RESUMED
        self.counters.received += 1
        self.counters.lost += ahead - 1
        self._seen = (self._seen << min(ahead, REORDERED + 1) | 1) & _SESSION_WINDOW
        self._sent += ahead
        self._last = _Heard(message, now)

    def _begin(self, message: Message, now: float) -> None:
        self._state = _BEGUN
        self.number += 1
        self.counters.received += 1
        self._reply_seqno = self._sent = 0
        self._seen = 1
        self._first_seqno = message.seqno
        self._last = _Heard(message, now)
        self.arrivals.begin(now, message.measured_time)

    def _count_old(self, message: Message, behind: int) -> None:
        """Count a datagram that is left aside; what belongs to another session is stale, too."""
        if 0 <= behind <= REORDERED and self._seen >> behind & 1:
            self.counters.repeated += 1
            return
        self.counters.stale += 1
        if 0 < behind <= REORDERED and (message.seqno - self._first_seqno) % _RANGE < _RANGE // 2:
            self.counters.lost -= 1  # it was counted as such when a newer one came
            self._seen |= 1 << behind


def _ahead(before: Counted, message: Counted) -> int:
    """How many datagrams ``message`` was sent after ``before``; the robot's count is a uint32 that wraps."""
    return (message.seqno - before.seqno + _RANGE // 2) % _RANGE - _RANGE // 2
