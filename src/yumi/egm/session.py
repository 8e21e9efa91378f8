"""One robot's EGM conversation as we see it: which datagrams count, when a session begins, when the robot is silent.

The robot speaks first and counts its datagrams from 0 in each session; nothing in the protocol announces an end
(reference/egm.md §2.1, §4). A robot that comes back after a silence either has counted on all the while, then the
session goes on and so does the last reference, or it has begun anew, then everything begins at where it stands.

UDP may deliver a datagram late, twice, or from another sender, so a single datagram proves little. One goes on with the
session when its number, the robot's clock and our clock agree with the datagram accepted before. Where two accepted
ones contradict each other, the one before them decides: a single false datagram never makes the true ones look old.
Numbers that begin anew are believed when several datagrams in a row agree with each other.

How regularly a robot's datagrams arrive: running estimates, a few additions per datagram and no memory of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
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

AGREEING = 3
"""So many datagrams in a row that agree with each other, and not with the session, are a new session [datagrams]."""

LONG_SILENCE = 1.0
"""After this time a single datagram begins a session, if it is newer by the robot's clock [s]."""

EARLIEST = 0.050
"""By so much the time between two datagrams may be shorter by our clock than by the robot's: delays vary [s]."""

_CLOCK_TOLERANCE = 0.05  # by so much the time a robot needed for its datagrams may differ from their number
_CLOCK_STEPS = 2.0  # cycles by which its clock may jitter besides
_EARLY = 0.75  # of a cycle: sooner than the fastest datagrams, the robot cannot have sent it
_FORGETTING = 1.0 / 256.0  # how fast a fastest datagram is forgotten: the clocks drift against each other
_SAME_CYCLE = 0.1  # two periods that differ by less are the same
_PERIODS = 0.0005, 0.25  # [s] a robot's datagrams may have
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
        self._last: _Heard[Message] | None = None  # accepted last
        self._sure: _Heard[Message] | None = None  # the newest before it that went on with its predecessor
        self._is_last_sure = False  # whether the last one did
        self._lost_with_last = 0
        self._candidate: _Heard[Message] | None = None  # the last of a row that may become a session
        self._candidates = 0
        self._candidates_since = 0.0
        self._candidates_cycle = CYCLE  # their period
        self._first_seqno = 0
        self._cycle = CYCLE
        self._other_cycle = 0.0  # a period seen last that was not believed
        self._fastest = inf  # smallest difference of our clock and the robot's at an arrival
        self._is_last_early = False
        self._last_arrival = -inf
        self._seen = 0  # a bit for each of the newest sequence numbers, bit 0 for the last
        self._seen_before = 0  # the same before the last was accepted
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
        if self._sent and self._last is not None:
            self.arrivals.note(self._last_arrival, self._last.message.measured_time, self._sent)
            self._sent = 0

    def silence(self, now: float) -> float:
        """Time since the last datagram that counted [s]."""
        return now - self._last_arrival

    def close_if_silent(self, now: float) -> bool:
        """Close the session when the robot has been silent for too long; returns whether it was closed now."""
        if not self._is_open or self.silence(now) <= self._silence:
            return False
        self._is_open = False
        return True

    def _is_newest(self, message: Message, now: float) -> bool:
        last = self._last
        if last is None:
            self._begin(message, now)
            return True
        ahead = _ahead(last.message, message)
        if self._is_open and (now - self._last_arrival <= self._silence or ahead == 1):
            is_accepted = self._accept_live(last, message, ahead, now)
        else:
            is_accepted = self._accept_after_silence(last, message, ahead, now)
        if is_accepted:
            return True
        self._count_old(-ahead)
        if message == last.message or self._is_overtaken(last, message, -ahead, now):  # these are no other session
            return False
        before = self._candidate
        if not self._is_new_session(message, now):
            return False
        self._begin(message, now)
        self._sure = before  # those that agreed with it have shown it: a single other one does not begin a session
        return True

    def _accept_live(self, last: _Heard[Message], message: Message, ahead: int, now: float) -> bool:
        """Whether the robot, heard a moment ago, goes on with ``message``."""
        if 0 < ahead <= LARGEST_GAP and self._follows(last, message, ahead, now):
            self._go_on(message, ahead, now, is_sure=True)
            return True
        sure = self._sure
        if sure is not None and self._is_contradicted(last, message, ahead):
            from_sure = _ahead(sure.message, message)
            if 0 < from_sure <= LARGEST_GAP and self._follows(sure, message, from_sure, now):
                self._replace_last(sure, message, from_sure, now)
                return True
        if ahead == 1:  # the very next number counts whatever the robot's clock says: the clock may have been set
            self._go_on(message, ahead, now, is_sure=False)
            return True
        is_newer = message.measured_time > last.message.measured_time
        if sure is None and is_newer and not self._agree(message, last.message, -ahead):
            self._begin(message, now)  # of two that contradict each other the first is no better than the second
            return True
        return False

    def _accept_after_silence(self, last: _Heard[Message], message: Message, ahead: int, now: float) -> bool:
        for heard in (last, self._sure):
            if heard is None:
                continue
            gap = _ahead(heard.message, message)
            if gap > 0 and self._has_counted_on(heard, message, gap, now):
                if heard is last:
                    self._go_on(message, gap, now, is_sure=True)
                else:
                    self._replace_last(heard, message, gap, now)
                return True
        if now - self._last_arrival > LONG_SILENCE and message.measured_time > last.message.measured_time:
            self._begin(message, now)
            return True
        return False

    def _follows(
        self, before: _Heard[Message], message: Message, ahead: int, now: float, cycle: float | None = None
    ) -> bool:
        """Whether the robot may have sent ``message`` ``ahead`` datagrams after ``before``, by its clock and ours."""
        cycle = cycle or self._cycle
        is_early = ahead * cycle - (now - before.arrival) > EARLIEST + cycle
        return not is_early and self._agree(before.message, message, ahead, cycle)

    def _agree(self, before: Message, message: Message, ahead: int, cycle: float | None = None) -> bool:
        """Whether the robot's clock shows the time in which it sends ``ahead`` datagrams, one each ``cycle`` [s]."""
        cycle = cycle or self._cycle
        due = ahead * cycle
        passed = message.measured_time - before.measured_time
        tolerance = _CLOCK_STEPS * cycle + _CLOCK_TOLERANCE * due
        return ahead > 0 and passed > -0.5 * cycle and abs(passed - due) <= tolerance

    def _is_contradicted(self, last: _Heard[Message], message: Message, ahead: int) -> bool:
        """Whether ``last`` and ``message`` cannot both be true, or ``last`` is the one to be doubted."""
        if ahead == 0:
            return message != last.message
        if not self._is_last_sure:
            return True
        is_out_of_order = message.measured_time > last.message.measured_time - 0.1 * self._cycle
        return ahead < 0 and (self._is_last_early or is_out_of_order)

    def _has_counted_on(self, before: _Heard[Message], message: Message, ahead: int, now: float) -> bool:
        """Whether a robot that was silent has sent as many datagrams as its number says, by its own clock and ours.

        Ours does not count for the very next datagram: the robot has stood still with us, as a virtual one does on a
        machine that stalls. It does where other datagrams have come that may begin a session: then this one is late.
        """
        passed = message.measured_time - before.message.measured_time
        tolerance = self._cycle + _CLOCK_TOLERANCE * passed
        if abs(passed - ahead * self._cycle) > tolerance:
            return False
        stood_still = ahead == 1 and not self._candidates
        return stood_still or abs(passed - (now - before.arrival)) <= tolerance + self._silence

    def _go_on(self, message: Message, ahead: int, now: float, *, is_sure: bool) -> None:
        if self._is_last_sure or self._sure is None:
            self._sure = self._last
        self._seen_before = self._seen
        self._take(message, ahead, now, is_sure=is_sure)

    def _replace_last(self, sure: _Heard[Message], message: Message, ahead: int, now: float) -> None:
        """Go on from ``sure``: what was accepted after it was no datagram of this session."""
        self.counters.lost -= self._lost_with_last
        self._seen = self._seen_before
        self._sent = 0
        self._take(message, ahead, now, is_sure=True)

    def _take(self, message: Message, ahead: int, now: float, *, is_sure: bool) -> None:
        self.is_resumed = self.is_resumed or not self._is_open
        self._is_open = True
        before, self._last = self._last, _Heard(message, now)
        if before is not None and ahead == 1:
            self._learn_cycle(message.measured_time - before.message.measured_time)
        self._is_last_sure = is_sure
        self._lost_with_last = ahead - 1
        self.counters.lost += ahead - 1
        self._seen = (self._seen << min(ahead, REORDERED + 1) | 1) & _SESSION_WINDOW
        self._sent += ahead
        self._note_arrival(message, now)

    def _note_arrival(self, message: Message, now: float) -> None:
        self.counters.received += 1
        self._last_arrival = now
        self._candidates = 0
        later = now - message.measured_time - self._fastest
        self._is_last_early = later < -_EARLY * self._cycle
        if self._is_last_sure:
            self._fastest += later * (1.0 if -_EARLY * self._cycle <= later < 0.0 else _FORGETTING)

    def _learn_cycle(self, passed: float) -> None:
        """Learn from the time between two datagrams; another period is believed when it comes twice."""
        if 0.5 * self._cycle < passed < 1.5 * self._cycle:
            self._cycle += (passed - self._cycle) / 16.0
            return
        shortest, longest = _PERIODS
        if shortest < passed < longest and abs(passed - self._other_cycle) < _SAME_CYCLE * passed:
            self._cycle = passed
        self._other_cycle = passed

    def _begin(self, message: Message, now: float) -> None:
        self._is_open = self.is_first = True
        self.is_resumed = False
        self.number += 1
        self._reply_seqno = self._sent = 0
        self._seen = self._seen_before = 1
        self._first_seqno = message.seqno
        self._sure, self._last = None, _Heard(message, now)
        self._is_last_sure = True
        self._lost_with_last = 0
        self._fastest = now - message.measured_time
        self._note_arrival(message, now)
        self.arrivals.begin(now, message.measured_time)

    def _is_new_session(self, message: Message, now: float) -> bool:
        """Whether a datagram that does not go on with the session is one of several that agree with each other."""
        before, self._candidate = self._candidate, _Heard(message, now)
        ahead = 0 if before is None or not self._candidates else _ahead(before.message, message)
        if before is not None and self._candidates == 1:
            self._candidates_cycle = self._cycle_between(before.message, message, ahead)
        cycle = self._candidates_cycle
        if before is None or not (0 < ahead <= LARGEST_GAP and self._follows(before, message, ahead, now, cycle)):
            self._candidates, self._candidates_since = 1, now
            return False
        self._candidates += 1
        # Old datagrams that arrive at once, or read in two cycles, agree with each other, too; a robot needs its time.
        if self._candidates < AGREEING or now - self._candidates_since < 0.75 * (AGREEING - 1) * cycle:
            return False
        self._cycle = cycle
        return True

    def _is_overtaken(self, last: _Heard[Message], message: Message, behind: int, now: float) -> bool:
        """Whether a datagram of this session is late: its number and its clock say so, and it was long on its way."""
        is_late = now - message.measured_time - self._fastest > _EARLY * self._cycle
        return is_late and 0 < behind <= LARGEST_GAP and self._agree(message, last.message, behind)

    def _cycle_between(self, before: Message, message: Message, ahead: int) -> float:
        """The period of a robot that sent these: the session's, or another one since it has begun anew."""
        if ahead <= 0 or self._agree(before, message, ahead):
            return self._cycle
        shortest, longest = _PERIODS
        cycle = (message.measured_time - before.measured_time) / ahead
        return cycle if shortest < cycle < longest else self._cycle

    def _count_old(self, behind: int) -> None:
        """Count a datagram that is left aside; what belongs to another session is stale, too."""
        if 0 <= behind <= REORDERED and self._seen >> behind & 1:
            self.counters.repeated += 1
            return
        self.counters.stale += 1
        last = self._last
        if last is not None and 0 < behind <= REORDERED and behind < (last.message.seqno - self._first_seqno) % _RANGE:
            self.counters.lost -= 1  # it was counted as such when a newer one came
            self._seen |= 1 << behind


def _ahead(before: Counted, message: Counted) -> int:
    """How many datagrams ``message`` was sent after ``before``; the robot's count is a uint32 that wraps."""
    return (message.seqno - before.seqno + _RANGE // 2) % _RANGE - _RANGE // 2
