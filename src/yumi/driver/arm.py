"""An arm behind EGM: datagrams from a link become states, commands become datagrams; and a perfect arm for tests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from yumi.control.cycle import WireCounters
from yumi.control.statistics import ENCODE, RECEIVE, SEND, StageClock
from yumi.egm.messages import (
    JointReport,
    MciState,
    MotorState,
    RapidState,
    RobotMessage,
)
from yumi.egm.session import Counted, Message, SensorSession
from yumi.robot.joints import CYCLE, ZERO, ArmCommand, ArmState, Joints, change_rate

LONGEST_PERIOD = 0.100
"""The robot's clock is not believed beyond this [s]."""


PUNCTUAL = 0.5 * CYCLE, 1.25 * CYCLE
"""Times between two datagrams at which nothing else can wait behind the second [s]."""

_ON, _RUNNING, _STOPPED = MotorState.ON, MciState.RUNNING, RapidState.STOPPED  # the enumerations are slow to look into


class DatagramLink(Protocol):
    """A socket that talks to one robot, or anything that behaves like one."""

    @property
    def foreign(self) -> int:
        """How many datagrams came from elsewhere and were left aside."""

    @property
    def is_pinned(self) -> bool:
        """Whether only one sender is heard."""

    def pin(self) -> None:
        """From now on hear only the sender of what was handed out last."""

    def release(self) -> None:
        """From now on hear every sender again."""

    def receive_next(self) -> bytes | None:
        """The oldest datagram that waits, if any; never waits."""

    def receive(self) -> Sequence[bytes]:
        """All datagrams of one sender that wait, oldest first; never waits."""

    def send(self, datagram: bytes) -> None:
        """Answer the sender of what was handed out last."""


def accept_from(
    link: DatagramLink, session: SensorSession[Message], datagrams: Sequence[bytes], now: float
) -> Message | None:
    """Take what has arrived; the sender of what begins a session is the only one heard until the session ends."""
    while datagrams:
        message = session.accept(datagrams, now)
        if link.is_pinned:
            return message
        if message is not None:
            link.pin()
            return message
        datagrams = link.receive()
    return None


class EgmArm:
    """One seven-axis arm guided by EGM.

    Args:
        link: where its datagrams come from.
        session: its conversation.
        stages: what notes where a cycle's time goes.
        keep: given the datagram of each cycle after it was answered, for who wants to know what else is in it.
    """

    def __init__(
        self,
        link: DatagramLink,
        session: SensorSession[JointReport],
        stages: StageClock | None = None,
        keep: Callable[[bytes], None] = lambda datagram: None,
    ) -> None:
        self._keep = keep
        self._datagram = b""
        self._link = link
        self._session = session
        self._stages = stages or StageClock()
        self._before: JointReport | None = None

    def read(self, now: float) -> ArmState | None:
        datagrams = self._stages.timed(RECEIVE, self._datagrams(now))
        if not datagrams:
            return None
        session = self._session
        message = accept_from(self._link, session, datagrams, now)
        if message is None:
            return None
        self._datagram = datagrams[-1]
        before = None if session.is_first or session.is_resumed else self._before
        self._before = message
        dt = period(before, message)
        return ArmState(
            now,
            dt,
            session.number,
            message.measured,
            ZERO if before is None or dt <= 0.0 else change_rate(message.measured, before.measured, dt),
            message.planned,
            is_running(message),
        )

    def _datagrams(self, now: float) -> Sequence[bytes]:
        """Everything that waits; of a robot that is on time only one can, and another look would cost time."""
        earliest, latest = PUNCTUAL
        if not earliest < self._session.silence(now) < latest or not self._link.is_pinned:
            return self._link.receive()
        datagram = self._link.receive_next()
        return () if datagram is None else (datagram,)

    def write(self, command: ArmCommand) -> None:
        velocity = None if command.velocity is ZERO else command.velocity
        self._link.send(self._stages.timed(ENCODE, self._session.reply(command.position, velocity)))
        self._stages.note(SEND)
        self._session.settle()
        self._keep(self._datagram)

    def silence(self, now: float) -> float:
        return self._session.silence(now)

    def lost_after(self, now: float) -> float | None:
        if not self._session.close_if_silent(now):
            return None
        self._link.release()
        return self._session.silence(now)

    def wire_counters(self) -> WireCounters:
        return wire_counters(self._session, self._link.foreign)


def is_running(message: JointReport | RobotMessage) -> bool:
    """Whether the robot follows; undefined counts: a restart of the controller leaves it so (reference/egm.md §3.3)."""
    return message.motors is _ON and message.mci is _RUNNING and message.rapid is not _STOPPED


def period(before: Counted | None, message: Counted) -> float:
    """Robot time from one message to the next [s], 0 where there is none before."""
    if before is None:
        return 0.0
    passed = message.measured_time - before.measured_time
    return passed if 0.0 < passed <= LONGEST_PERIOD else CYCLE


def wire_counters(session: SensorSession[Message], foreign: int) -> WireCounters:
    counters, arrivals = session.counters, session.arrivals
    return WireCounters(
        session.number,
        counters.missed,
        counters.lost,
        counters.late,
        counters.stale,
        counters.repeated,
        counters.malformed,
        foreign,
        arrivals.jitter,
        arrivals.worst_jitter,
        arrivals.drift_ppm,
        arrivals.cycle_time,
    )


class PerfectArm:
    """An arm without dynamics; every ``read`` is one cycle later.

    Attributes:
        is_running: whether it follows commands; set it to stop the robot.

    Args:
        position: where it begins, chain order [rad].
    """

    def __init__(self, position: Joints) -> None:
        self.is_running = True
        self._position = position
        self._velocity = ZERO
        self._dt = 0.0

    def read(self, now: float) -> ArmState | None:
        state = ArmState(now, self._dt, 1, self._position, self._velocity, self._position, self.is_running)
        self._dt = CYCLE
        return state

    def write(self, command: ArmCommand) -> None:
        if not self.is_running:
            return
        self._velocity = change_rate(command.position, self._position, CYCLE)
        self._position = command.position

    def silence(self, now: float) -> float:
        return 0.0

    def lost_after(self, now: float) -> float | None:
        return None

    def wire_counters(self) -> WireCounters:
        return WireCounters(session=1)
