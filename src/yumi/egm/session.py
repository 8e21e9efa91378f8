"""One arm's EGM conversation as we see it: which datagrams count, when a session begins, when the robot is silent.

The robot speaks first and counts its datagrams from 0 in each session; nothing in the protocol announces an end
(reference/egm.md §2.1, §4). A robot that comes back after a silence counts as a new session here too, so that
whatever begins with a session begins without a jump.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

from yumi.egm.codec import SensorCodec
from yumi.egm.messages import RobotMessage, SensorMessage
from yumi.errors import ProtocolError
from yumi.robot.joints import Joints

SILENCE = 0.050
"""A robot that says nothing for twelve cycles is lost; a busy machine may skip a few [s]."""

REORDERED = 16
"""A sequence number lower by at most this is an old datagram; lower by more, the robot began anew [datagrams]."""


@dataclass(frozen=True, slots=True)
class Received:
    """A datagram that counts.

    Attributes:
        message: what the robot said.
        session: number of the session, from 1.
        is_first: whether it is the first of its session.
    """

    message: RobotMessage
    session: int
    is_first: bool


@dataclass(slots=True)
class SessionCounters:
    """What went wrong on the wire since the start, in datagrams.

    Attributes:
        received: datagrams that count.
        missed: datagrams the robot sent in a running session that got no answer of their own.
        stale: old or repeated datagrams that were left aside.
        malformed: datagrams that are no EGM of a seven-axis robot.
    """

    received: int = 0
    missed: int = 0
    stale: int = 0
    malformed: int = 0


class SensorSession:
    """Turns datagrams into messages that count, and commands into datagrams."""

    def __init__(self, codec: SensorCodec, *, silence: float = SILENCE) -> None:
        self.counters = SessionCounters()
        self.number = 0
        self.last_error = ""
        self._codec = codec
        self._silence = silence
        self._last_seqno = -1
        self._last_arrival = -inf
        self._is_open = False
        self._reply_seqno = 0

    @property
    def is_open(self) -> bool:
        """Whether a session is going on."""
        return self._is_open

    def accept(self, datagrams: Sequence[bytes], now: float) -> Received | None:
        """Take what has arrived, oldest first; the newest good datagram counts, older ones are too late to answer.

        Args:
            datagrams: everything that waits in the socket; usually one.
            now: arrival time [s].

        Returns:
            What is to be answered, or None.
        """
        for datagram in reversed(datagrams):
            try:
                message = self._codec.decode(datagram)
            except ProtocolError as error:
                self.counters.malformed += 1
                self.last_error = str(error)
                continue
            return self._count(message, now)
        return None

    def reply(self, position: Joints, velocity: Joints | None) -> bytes:
        """The answer to the datagram accepted last [rad], [rad/s]."""
        datagram = self._codec.encode(SensorMessage(self._reply_seqno, position, velocity, sent_ms=None))
        self._reply_seqno += 1
        return datagram

    def silence(self, now: float) -> float:
        """Time since the last datagram that counted [s]."""
        return now - self._last_arrival

    def close_if_silent(self, now: float) -> bool:
        """Close the session when the robot has been silent for too long; tells whether it was closed now."""
        if not self._is_open or self.silence(now) <= self._silence:
            return False
        self._is_open = False
        return True

    def _count(self, message: RobotMessage, now: float) -> Received | None:
        behind = self._last_seqno - message.seqno
        was_silent = self.silence(now) > self._silence
        is_first = not self._is_open or was_silent or behind > REORDERED or (message.seqno == 0 and behind > 0)
        if not is_first and behind >= 0:
            self.counters.stale += 1
            return None
        if is_first:
            self._open()
        else:
            self.counters.missed += -behind - 1
        self.counters.received += 1
        self._last_seqno, self._last_arrival = message.seqno, now
        return Received(message, self.number, is_first)

    def _open(self) -> None:
        self._is_open = True
        self.number += 1
        self._reply_seqno = 0
