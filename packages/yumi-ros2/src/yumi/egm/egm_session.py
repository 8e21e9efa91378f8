"""One robot's EGM sessions as we see them: which datagrams count, when a session begins, when the robot is silent.

Both are decided in ``core/egm_session.hpp``. :class:`SensorSession` gives the core messages of any codec; of an arm of
the control loop the core reads the datagrams itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Generic, NamedTuple, Protocol, TypeVar

from abb_protocols.errors import ProtocolError
from yumi.core.library import SessionValues, load, new_handle

ROBOT_SILENCE = 0.020
"""A robot that says nothing for five cycles is lost [s]."""

_NONE, _BEGUN, _RESUMED, _OPEN, _SILENT = range(5)  # states of a session, as in the core


class Counted(Protocol):
    """What a session needs to know of a robot's message."""

    @property
    def seqno(self) -> int:
        """The robot's count of its datagrams."""

    @property
    def measured_time(self) -> float:
        """The robot's clock [s]."""


_Message = TypeVar("_Message", bound=Counted)
_Message_co = TypeVar("_Message_co", bound=Counted, covariant=True)


class Codec(Protocol[_Message_co]):
    """What a session needs of a codec."""

    def decode(self, datagram: bytes) -> _Message_co:
        """The robot's message; raises ProtocolError."""


class SessionCounters(NamedTuple):
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


class Arrivals(NamedTuple):
    """How regularly the datagrams of a session arrive, by our clock and the robot's.

    Attributes:
        jitter: mean difference of two datagrams' delays, as RFC 3550 smooths it [s].
        worst_jitter: the largest such difference of the session [s].
        drift_ppm: by how much the robot's clock is faster than ours, from the fastest datagrams of its first and its
            last full second [ppm]; 0 before the second of them.
        cycle_time: mean time between two datagrams that the robot sent, by our clock [s]; 0 before the second.
    """

    jitter: float
    worst_jitter: float
    drift_ppm: float
    cycle_time: float


class Session:
    """What the sessions of all robots have.

    Args:
        silence: a robot that says nothing for longer is lost [s].

    Attributes:
        handle: what the core calls it.
    """

    def __init__(self, silence: float = ROBOT_SILENCE) -> None:
        self._library = load()
        self.handle = new_handle(self, "session", silence)
        self._values = SessionValues.from_address(self.handle)

    @property
    def number(self) -> int:
        """Number of the session, 0 before the first."""
        return int(self._values.number)

    @property
    def counters(self) -> SessionCounters:
        """What happened on the wire since the start."""
        return SessionCounters(*self._values.counters)

    @property
    def arrivals(self) -> Arrivals:
        """How regularly the session's datagrams come."""
        return Arrivals(*self._values.arrivals)

    @property
    def period(self) -> float:
        """Robot time since the message answered before [s]; 0 for the first of a session or after a silence."""
        return float(self._values.period)

    @property
    def is_open(self) -> bool:
        """Whether a session is going on."""
        return self._values.state not in (_NONE, _SILENT)

    @property
    def is_first(self) -> bool:
        """Whether the message accepted last is the first of its session."""
        return bool(self._values.state == _BEGUN)

    @property
    def is_resumed(self) -> bool:
        """Whether the message accepted last is the first after a silence that the session has outlived."""
        return bool(self._values.state == _RESUMED)

    def settle(self) -> None:
        """After the reply: take the message accepted last into the statistics."""
        self._library.session_settle(self.handle)

    def silence(self, now: float) -> float:
        """Time since the last datagram that counted [s]."""
        return float(self._library.session_silence(self.handle, now))

    def close_if_silent(self, now: float) -> bool:
        """Close the session when the robot has been silent for too long; returns whether it was closed now."""
        return bool(self._library.session_close_if_silent(self.handle, now))


class SensorSession(Session, Generic[_Message]):
    """Turns datagrams into messages that count, and numbers the answers.

    Args:
        codec: of the robot's messages.
        silence: a robot that says nothing for longer is lost [s].

    Attributes:
        last_error: what was wrong with the malformed datagram that came last.
    """

    def __init__(self, codec: Codec[_Message], *, silence: float = ROBOT_SILENCE) -> None:
        super().__init__(silence)
        self.last_error = ""
        self._codec = codec

    def accept(self, datagrams: Sequence[bytes], now: float) -> _Message | None:
        """Take what has arrived, oldest first; the newest counts, the others are too late to answer.

        Args:
            datagrams: everything that waits in the socket; usually one.
            now: arrival time [s].

        Returns:
            What is to be answered, or None.
        """
        accepted: _Message | None = None
        self._library.session_begin_batch(self.handle)
        for datagram in datagrams:
            try:
                message = self._codec.decode(datagram)
            except ProtocolError as error:
                self._library.session_note_malformed(self.handle)
                self.last_error = str(error)
                continue
            if self._library.session_takes(self.handle, message.seqno, message.measured_time, now):
                accepted = message
        return accepted

    def next_seqno(self) -> int:
        """The number of our next datagram in this session."""
        return int(self._library.session_next_seqno(self.handle))
