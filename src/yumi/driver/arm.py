"""An arm behind EGM: datagrams from a link become states, commands become datagrams.

A perfect arm in memory: it is wherever it was told to be one cycle ago. For controllers under test.

What a user of the EGM server may ask of a robot, checked against what that robot is.

The state of any robot behind EGM, as one datagram tells it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, isfinite
from typing import Protocol

from yumi.control.cycle import WireCounters
from yumi.control.statistics import ENCODE, RECEIVE, SEND, StageClock
from yumi.egm.codec import MOST_NUMBERS
from yumi.egm.messages import (
    JointReport,
    MciState,
    MotorState,
    PathCorrection,
    RapidData,
    RapidState,
    RobotMessage,
    SensorMessage,
    Twist,
)
from yumi.egm.session import Counted, Message, SensorSession
from yumi.errors import CommandRefused
from yumi.robot.joints import CYCLE, ZERO, ArmCommand, ArmState, Joints, Pose, Quaternion, Vector, joints

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
        stations: what notes where a cycle's time goes.
    """

    def __init__(
        self, link: DatagramLink, session: SensorSession[JointReport], stations: StageClock | None = None
    ) -> None:
        self._link = link
        self._session = session
        self._stations = stations or StageClock()
        self._before: JointReport | None = None

    def read(self, now: float) -> ArmState | None:
        datagrams = self._stations.timed(RECEIVE, self._datagrams(now))
        if not datagrams:
            return None
        session = self._session
        message = accept_from(self._link, session, datagrams, now)
        if message is None:
            return None
        before = None if session.is_first or session.is_resumed else self._before
        self._before = message
        dt = period(before, message)
        return ArmState(
            now,
            dt,
            session.number,
            message.measured,
            _velocity(before, message, dt),
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
        self._link.send(self._stations.timed(ENCODE, self._session.reply(command.position, velocity)))
        self._stations.note(SEND)
        self._session.settle()

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


def _velocity(before: JointReport | None, message: JointReport, dt: float) -> Joints:
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
        way = zip(self._position, command.position, strict=True)
        self._velocity = joints([(new - old) / CYCLE for old, new in way])
        self._position = command.position

    def silence(self, now: float) -> float:
        return 0.0

    def lost_after(self, now: float) -> float | None:
        return None

    def wire_counters(self) -> WireCounters:
        return WireCounters(session=1)


@dataclass(frozen=True, slots=True)
class RobotState:
    """What a robot says in one datagram, and when.

    Attributes:
        time: when it arrived, on this machine's monotonic clock [s].
        dt: robot time since the state before, 0 for the first of a session or after a silence [s].
        session: counts EGM sessions from 1; a change means that the robot began anew.
        is_first: whether it is the first of its session.
        message: all of it.
    """

    time: float
    dt: float
    session: int
    is_first: bool
    message: RobotMessage

    @property
    def joints(self) -> tuple[float, ...]:
        """Measured joint positions [rad]: axes 1 to 6, or 1, 2, 7, 3, 4, 5, 6 of a seven-axis arm."""
        return self.message.measured

    @property
    def external(self) -> tuple[float, ...]:
        """Measured positions of external axes that are no part of the arm [rad], linear ones [m]."""
        return self.message.measured_external

    @property
    def planned(self) -> tuple[float, ...]:
        """Joint positions the controller is heading for [rad]."""
        return self.message.planned

    @property
    def pose(self) -> Pose | None:
        """Measured pose of the tool, in the frame that RAPID gave EGM; None when the robot sent none."""
        return self.message.measured_pose

    @property
    def is_running(self) -> bool:
        """Whether the robot follows what it is sent; a position stream alone does not."""
        return is_running(self.message)


_UNIT = 1e-3  # by how much the norm of a quaternion may differ from 1
_OLDEST = 1e6  # [s]


def standstill(message: RobotMessage) -> SensorMessage:
    """Stay where ``message`` was measured, whether the robot heeds its joints or its tool."""
    pose = message.measured_pose
    return SensorMessage(
        seqno=0,
        position=message.measured,
        external=message.measured_external,
        tool_position=None if pose is None else pose.position,
        tool_orientation=None if pose is None else pose.orientation,
    )


def reference(
    state: RobotState,
    *,
    joints: Sequence[float] | None = None,
    pose: Pose | None = None,
    speed: Sequence[float] | None = None,
    twist: Sequence[float] | None = None,
    external: Sequence[float] | None = None,
    external_speed: Sequence[float] | None = None,
    data: RapidData | None = None,
) -> SensorMessage:
    """The message with these references, see :meth:`yumi.driver.egm_server.EgmServer.send`.

    Raises:
        CommandRefused: a value is not finite, or there are not as many as the robot has.
    """
    axes, beside = len(state.joints), len(state.external)
    return SensorMessage(
        seqno=0,
        position=None if joints is None else _finite("joints", joints, axes),
        velocity=None if speed is None else _finite("speed", speed, axes),
        tool_position=None if pose is None else _vector("position of pose", pose.position),
        tool_orientation=None if pose is None else _unit(pose.orientation),
        twist=None if twist is None else _twist(twist),
        external=() if external is None else _finite("external", external, beside),
        external_velocity=() if external_speed is None else _finite("external_speed", external_speed, beside),
        rapid_data=None if data is None else _numbers(data),
    )


def correction(offset: Sequence[float], age: float) -> PathCorrection:
    """The path correction by ``offset`` [m], measured ``age`` [s] ago.

    Raises:
        CommandRefused: a value is not finite, or the age is negative.
    """
    if not 0.0 <= age <= _OLDEST:
        raise CommandRefused(f"Correction refused: age is {age} s; a measurement is 0 to {_OLDEST:g} s old.")
    return PathCorrection(0, _vector("offset", offset), round(age * 1000.0))


def is_placed(message: SensorMessage) -> bool:
    """Whether it says where the robot shall be."""
    return message.position is not None or message.tool_position is not None or bool(message.external)


def moves(message: SensorMessage) -> bool:
    """Whether it has any reference, be it zero."""
    return (
        is_placed(message)
        or message.velocity is not None
        or message.twist is not None
        or bool(message.external_velocity)
    )


def _finite(name: str, values: Sequence[float], count: int) -> tuple[float, ...]:
    given = tuple(float(value) for value in values)
    if len(given) != count:
        raise CommandRefused(f"Reference refused: {name} has {len(given)} values; this robot takes {count}.")
    for value in given:
        if not isfinite(value):
            raise CommandRefused(f"Reference refused: {name} has {value}; the robot takes finite numbers only.")
    return given


def _vector(name: str, values: Sequence[float]) -> Vector:
    x, y, z = _finite(name, values, 3)
    return (x, y, z)


def _twist(values: Sequence[float]) -> Twist:
    vx, vy, vz, wx, wy, wz = _finite("twist", values, 6)
    return (vx, vy, vz, wx, wy, wz)


def _unit(orientation: Sequence[float]) -> Quaternion:
    w, x, y, z = _finite("orientation of pose", orientation, 4)
    norm = hypot(w, x, y, z)
    if abs(norm - 1.0) > _UNIT:
        raise CommandRefused(f"Reference refused: orientation of pose has norm {norm:g}; a unit quaternion has 1.")
    return (w / norm, x / norm, y / norm, z / norm)


def _numbers(data: RapidData) -> RapidData:
    if len(data.numbers) > MOST_NUMBERS:
        raise CommandRefused(f"Data refused: {len(data.numbers)} numbers; a RAPID program takes {MOST_NUMBERS}.")
    return RapidData(data.flag, _finite("data", data.numbers, len(data.numbers)))
