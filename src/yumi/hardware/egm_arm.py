"""An arm behind EGM: datagrams from a link become states, commands become datagrams."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from yumi.control.port import WireCounters
from yumi.control.stations import ENCODE, RECEIVE, SEND, StationClock
from yumi.egm.messages import MciState, MotorState, RapidState, RobotMessage
from yumi.egm.session import SensorSession
from yumi.robot.joints import Joints
from yumi.robot.values import ZERO, ArmCommand, ArmState

CYCLE = 0.004032
"""The robot's cycle, where its own clock does not tell [s] (reference/egm.md §2.5)."""

LONGEST_PERIOD = 0.100
"""The robot's clock is not believed beyond this [s]."""


class DatagramLink(Protocol):
    """A socket that talks to one robot, or anything that behaves like one."""

    def receive(self) -> Sequence[bytes]:
        """All datagrams that wait, oldest first; never waits."""

    def send(self, datagram: bytes) -> None:
        """Answer the sender of the datagram received last."""


class EgmArm:
    """One seven-axis arm guided by EGM.

    Args:
        link: where its datagrams come from.
        session: its conversation.
        stations: what notes where a cycle's time goes.
    """

    def __init__(self, link: DatagramLink, session: SensorSession, stations: StationClock | None = None) -> None:
        self._link = link
        self._session = session
        self._stations = stations or StationClock()
        self._before: RobotMessage | None = None

    def read(self, now: float) -> ArmState | None:
        datagrams = self._stations.timed(RECEIVE, self._link.receive())
        if not datagrams:
            return None
        received = self._session.accept(datagrams, now)
        if received is None:
            return None
        message, before = received.message, None if received.is_first else self._before
        self._before = message
        dt = _period(before, message)
        return ArmState(
            time=now,
            dt=dt,
            session=received.session,
            position=message.measured,
            velocity=_velocity(before, message, dt),
            planned=message.planned,
            is_running=_is_running(message),
        )

    def write(self, command: ArmCommand) -> None:
        velocity = None if command.velocity is ZERO else command.velocity
        self._link.send(self._stations.timed(ENCODE, self._session.reply(command.position, velocity)))
        self._stations.note(SEND)

    def lost_after(self, now: float) -> float | None:
        return self._session.silence(now) if self._session.close_if_silent(now) else None

    def wire_counters(self) -> WireCounters:
        counters = self._session.counters
        return WireCounters(self._session.number, counters.missed, counters.stale, counters.malformed)


def _is_running(message: RobotMessage) -> bool:
    """Undefined counts as running: after a restart the controller leaves it so (reference/egm.md §3.3)."""
    return (
        message.motors is MotorState.ON and message.mci is MciState.RUNNING and message.rapid is not RapidState.STOPPED
    )


def _period(before: RobotMessage | None, message: RobotMessage) -> float:
    if before is None:
        return 0.0
    cycles = message.seqno - before.seqno
    if before.measured_time is None or message.measured_time is None:
        return min(cycles * CYCLE, LONGEST_PERIOD)
    period = message.measured_time - before.measured_time
    return period if 0.0 < period <= LONGEST_PERIOD else CYCLE


def _velocity(before: RobotMessage | None, message: RobotMessage, dt: float) -> Joints:
    if before is None or dt <= 0.0:
        return ZERO
    a, b, c, d, e, f, g = message.measured
    oa, ob, oc, od, oe, of, og = before.measured
    return (
        (a - oa) / dt,
        (b - ob) / dt,
        (c - oc) / dt,
        (d - od) / dt,
        (e - oe) / dt,
        (f - of) / dt,
        (g - og) / dt,
    )
