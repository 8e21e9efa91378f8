"""One robot's EGM conversation as we see it: which datagrams count, when a session begins, when the robot is silent.

The robot speaks first and counts its datagrams from 0 in each session; nothing in the protocol announces an end
(reference/egm.md §2.1, §4). A robot that comes back after a silence either has counted on all the while, then the
session goes on and so does what it was last told, or it has begun anew, then everything begins at where it stands.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Generic, Protocol, TypeVar

from yumi.egm.arrivals import Arrivals
from yumi.errors import ProtocolError
from yumi.robot.cycle import CYCLE
from yumi.robot.joints import Joints

SILENCE = 0.020
"""A robot that says nothing for five cycles is lost [s]."""

REORDERED = 16
"""A sequence number lower by at most this may be an old datagram; lower by more, the robot began anew [datagrams]."""

LARGEST_GAP = 64
"""A sequence number higher by more than this is none of the session: so many cycles are a silence [datagrams]."""

STRAGGLER = 1.0
"""A datagram older than this by the robot's clock is none: the clock was set [s]."""

_CLOCK_TOLERANCE = 0.05  # by so much the time a robot needed for its datagrams may differ from their number
_WINDOW = (2 << REORDERED) - 1


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


class SensorSession(Generic[Message]):
    """Turns datagrams into messages that count, and commands into datagrams.

    Attributes:
        number: number of the session, 0 before the first.
        is_first: whether the message accepted last is the first of its session.
        is_resumed: whether it is the first after a silence that the session has outlived.
        arrivals: how regularly its datagrams come.
        last_error: what was wrong with the malformed datagram that came last.
    """

    def __init__(self, codec: Codec[Message], *, silence: float = SILENCE) -> None:
        self.counters = SessionCounters()
        self.arrivals = Arrivals()
        self.number = 0
        self.is_first = self.is_resumed = False
        self.last_error = ""
        self._codec = codec
        self._silence = silence
        self._first_seqno = self._last_seqno = -1
        self._first_time = self._last_time = 0.0
        self._last_arrival = -inf
        self._seen = 0  # a bit for each of the newest sequence numbers, bit 0 for the last
        self._sent = 0  # datagrams the robot sent since the one settled last
        self._is_open = False
        self._reply_seqno = 0

    @property
    def is_open(self) -> bool:
        """Whether a session is going on."""
        return self._is_open

    def accept(self, datagrams: Sequence[bytes], now: float) -> Message | None:
        """Take what has arrived, oldest first; the newest counts, the others are too late to answer.

        Args:
            datagrams: everything that waits in the socket; usually one.
            now: arrival time [s].

        Returns:
            What is to be answered, or None.
        """
        accepted: Message | None = None
        self.is_first = self.is_resumed = False
        for datagram in datagrams:
            try:
                message = self._codec.decode(datagram)
            except ProtocolError as error:
                self.counters.malformed += 1
                self.last_error = str(error)
                continue
            if not self._is_newest(message, now):
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
        if self._sent:
            self.arrivals.note(self._last_arrival, self._last_time, self._sent)
            self._sent = 0

    def silence(self, now: float) -> float:
        """Time since the last datagram that counted [s]."""
        return now - self._last_arrival

    def close_if_silent(self, now: float) -> bool:
        """Close the session when the robot has been silent for too long; tells whether it was closed now."""
        if not self._is_open or self.silence(now) <= self._silence:
            return False
        self._is_open = False
        return True

    def _is_newest(self, message: Message, now: float) -> bool:
        ahead = message.seqno - self._last_seqno
        is_heard = self._is_open and now - self._last_arrival <= self._silence
        if self._goes_on(message, ahead, now, is_heard=is_heard):
            self._go_on(ahead)
        elif is_heard and self._is_old(ahead, message.measured_time):
            self._count_old(-ahead)
            return False
        else:
            self._begin(message, now)
        self.counters.received += 1
        self._last_seqno, self._last_time, self._last_arrival = message.seqno, message.measured_time, now
        return True

    def _goes_on(self, message: Message, ahead: int, now: float, *, is_heard: bool) -> bool:
        if ahead == 1 and self._is_open:
            return True  # after a long time: not the robot was silent, we were
        if is_heard:
            return 0 < ahead <= LARGEST_GAP
        return ahead > 0 and self.number > 0 and self._has_counted_on(message, ahead, now)

    def _has_counted_on(self, message: Message, ahead: int, now: float) -> bool:
        """Whether a robot that was silent has sent as many datagrams as its number says, by its own clock and ours.

        Ours does not count for the very next datagram: the robot has stood still with us, as a virtual one does on a
        machine that stalls.
        """
        since = self._last_time - self._first_time
        cycle = since / (self._last_seqno - self._first_seqno) if since > 0.0 else CYCLE
        passed = message.measured_time - self._last_time
        tolerance = cycle + _CLOCK_TOLERANCE * passed
        if abs(passed - ahead * cycle) > tolerance:
            return False
        return ahead == 1 or abs(passed - self.silence(now)) <= tolerance + self._silence

    def _go_on(self, ahead: int) -> None:
        self.is_resumed = self.is_resumed or not self._is_open
        self._is_open = True
        self.counters.lost += ahead - 1
        self._seen = (self._seen << min(ahead, REORDERED + 1) | 1) & _WINDOW
        self._sent += ahead

    def _begin(self, message: Message, now: float) -> None:
        self._is_open = self.is_first = True
        self.is_resumed = False
        self.number += 1
        self._reply_seqno = self._sent = 0
        self._seen = 1
        self._first_seqno, self._first_time = message.seqno, message.measured_time
        self.arrivals.begin(now, message.measured_time)

    def _is_old(self, ahead: int, time: float) -> bool:
        """Whether a number out of order is that of an old datagram; else the robot has begun to count anew."""
        age = self._last_time - time
        if ahead > 0:  # left over from the session before, or a session that begins with a high number
            return 0.0 < age < STRAGGLER
        return -ahead <= REORDERED and 0.0 <= age < STRAGGLER

    def _count_old(self, behind: int) -> None:
        if behind >= 0 and self._seen >> behind & 1:
            self.counters.repeated += 1
            return
        self.counters.stale += 1
        if 0 < behind < self._last_seqno - self._first_seqno:
            self.counters.lost -= 1  # it was counted as such when a newer one came
            self._seen |= 1 << behind
