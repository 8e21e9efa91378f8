"""The sensor's end of EGM: datagrams of a link become states of a robot, references become its replies.

:class:`EgmServer` guides any ABB robot that has EGM from a plain Python loop, without ROS.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import hypot, isfinite
from typing import Protocol, TypeVar, cast

from abb_protocols.catalogue import message
from abb_protocols.egm.codec import (
    MOST_NUMBERS,
    PathCorrection,
    RapidData,
    RobotMessage,
    SensorCodec,
    SensorMessage,
    Twist,
)
from abb_protocols.errors import CommandRefused, NoConnection, ProtocolError, RobotNotReady
from abb_protocols.robot.joints import Pose, Quaternion, Vector
from abb_runtime.clock import Clock, SystemClock
from abb_runtime.udp import Poller, UdpServer, address_towards
from yumi.control.counters import WireCounters
from yumi.core.library import load
from yumi.egm.egm_session import ROBOT_SILENCE, SensorSession, Session

_POLL_PERIOD = 0.050
"""How often a wait checks whether it is to end [s]."""

MOST_UNREADABLE = 25
"""So many datagrams that cannot be read, and none that can: this is no robot we know."""

_NORM_TOLERANCE = 1e-3  # by how much the norm of a quaternion may differ from 1
_OLDEST_MEASUREMENT = 1e6  # [s]


@dataclass(frozen=True, slots=True)
class EgmState:
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
        return _is_running(self.message)


class EgmServer:
    """Listens for one robot, whose controller speaks first; each state it sends is to be answered with :meth:`send`.

    ::

        with EgmServer(6510) as server:
            for state in server:
                server.send(joints=[goal for goal in state.joints])

    The loop goes on over sessions and waits while the robot is silent; it ends with :meth:`stop`, or when nothing
    came for ``timeout`` seconds.

    Args:
        port: UDP port that the controller sends to; 0 for any free one.
        host: address to listen on: this machine's own towards the robot, or ``""`` for all; by default the one that
            faces ``robot``, else the loopback, where only programs of this machine are heard.
        robot: only datagrams from this address are taken; None takes all.
        axes: 7 for a seven-axis arm, 6 for a robot whose external axes are no part of it; None takes the first
            external axis that the robot sends, if it does, for the arm's seventh.
        timeout: longest wait of the loop for the robot [s]; None waits for ever.
        silence: a robot that comes back after this time begins a new session [s].
        clock: of the arrivals.

    Raises:
        NoConnection: the port is taken or the address is not this machine's.
    """

    def __init__(
        self,
        port: int,
        *,
        host: str | None = None,
        robot: str | None = None,
        axes: int | None = None,
        timeout: float | None = None,
        silence: float = ROBOT_SILENCE,
        clock: Clock | None = None,
    ) -> None:
        self._codec = SensorCodec(axes=axes)
        self._session = SensorSession[RobotMessage](self._codec, silence=silence)
        self._silence = silence
        self._timeout = timeout
        self._clock = clock or SystemClock()
        self._arrived: EgmState | None = None
        self._state: EgmState | None = None
        self._held = SensorMessage(0)
        self._is_stopped = False
        self._hears_this_machine_only = host is None and robot is None
        if host is None:
            host = address_towards(robot) if robot else "127.0.0.1"
        self._link = UdpServer(host, port, remote=robot)
        self._poller = Poller()
        self._poller.watch(self._link, self._take)

    def __enter__(self) -> EgmServer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __iter__(self) -> Iterator[EgmState]:
        """The robot's states as they come, the newest where several wait.

        Raises:
            NoConnection: no robot spoke within the timeout.
            ProtocolError: what speaks is no robot this server understands.
        """
        while (state := self.receive(self._timeout)) is not None:
            yield state
        if self._state is None and not self._is_stopped:
            raise NoConnection(
                message(
                    "no_robot_spoke_on_this_machine" if self._hears_this_machine_only else "no_robot_spoke",
                    port=self.port,
                    timeout=self._timeout,
                )
            )

    @property
    def port(self) -> int:
        return self._link.port

    @property
    def address(self) -> str:
        """Where it listens; 0.0.0.0 is all of this machine's addresses."""
        return self._link.host

    @property
    def wire(self) -> WireCounters:
        """What the connection has seen so far."""
        return wire_counters(self._session, self._link.foreign)

    def close(self) -> None:
        """Free the port; the robot holds its last reference until its communication timeout."""
        self._poller.close()
        self._link.close()

    def stop(self) -> None:
        """End the loop; may be called from another thread or a signal handler."""
        self._is_stopped = True

    def receive(self, timeout: float | None = None) -> EgmState | None:
        """The robot's next state; None after ``timeout`` [s] or :meth:`stop`.

        Raises:
            ProtocolError: what speaks is no robot this server understands.
        """
        self._session.settle()
        self._arrived = None
        end = None if timeout is None else self._clock.now() + timeout
        while self._arrived is None and not self._is_stopped:
            left = _POLL_PERIOD if end is None else end - self._clock.now()
            if left < 0.0:
                return None
            self._poller.wait(min(left, _POLL_PERIOD))
        return self._arrived

    def send(
        self,
        *,
        joints: Sequence[float] | None = None,
        pose: Pose | None = None,
        speed: Sequence[float] | None = None,
        twist: Sequence[float] | None = None,
        external: Sequence[float] | None = None,
        external_speed: Sequence[float] | None = None,
        data: RapidData | None = None,
    ) -> None:
        """Answer the state received last; to be called once for each.

        Without any reference the robot is to hold: it is sent what it measured with its session's first answer, and
        the position sent last afterwards. In joint mode the robot heeds joints and speed, in pose mode pose and twist.

        Args:
            joints: positions to reach, as many and in the order of :attr:`EgmState.joints` [rad].
            pose: where the tool is to be, in EGM's correction frame.
            speed: joint speeds [rad/s]; in a velocity loop (PosCorrGain 0) all there is.
            twist: speed of the tool, along x, y, z [m/s] and about x, y, z [rad/s].
            external: positions of the external axes that are no part of the arm [rad], linear ones [m].
            external_speed: their speeds.
            data: for the RAPID program; RobotWare 7.7.

        Raises:
            CommandRefused: a value is not finite, or there are not as many as the robot has; nothing was sent.
            RobotNotReady: no robot has spoken yet.
        """
        state = self._answered()
        axes, beside = len(state.joints), len(state.external)
        orientation: Quaternion | None = None
        if pose is not None:
            w, x, y, z = _finite("orientation of pose", pose.orientation, 4)
            norm = hypot(w, x, y, z)
            if abs(norm - 1.0) > _NORM_TOLERANCE:
                raise CommandRefused(message("reference_not_unit_quaternion", norm=norm))
            orientation = (w / norm, x / norm, y / norm, z / norm)
        if data is not None:
            if len(data.numbers) > MOST_NUMBERS:
                raise CommandRefused(message("rapid_data_too_long", count=len(data.numbers), limit=MOST_NUMBERS))
            data = RapidData(data.flag, _finite("data", data.numbers, len(data.numbers)))
        wanted = SensorMessage(
            seqno=0,
            position=None if joints is None else _finite("joints", joints, axes),
            velocity=None if speed is None else _finite("speed", speed, axes),
            tool_position=None if pose is None else _vector("position of pose", pose.position),
            tool_orientation=orientation,
            twist=None if twist is None else cast("Twist", _finite("twist", twist, 6)),
            external=() if external is None else _finite("external", external, beside),
            external_velocity=() if external_speed is None else _finite("external_speed", external_speed, beside),
            rapid_data=data,
        )
        if not _moves(wanted):
            wanted = replace(self._held, rapid_data=wanted.rapid_data)
        elif _is_placed(wanted):
            self._held = replace(wanted, velocity=None, twist=None, external_velocity=(), rapid_data=None)
        self._link.send(self._codec.encode(replace(wanted, seqno=self._session.next_seqno())))

    def send_correction(self, offset: Vector, *, age: float = 0.0) -> None:
        """Correct the path of a robot that moves with EGMMoveL or EGMMoveC.

        Args:
            offset: where the path was measured, seen from the sensor's tool frame [m].
            age: of the measurement [s].

        Raises:
            CommandRefused: a value is not finite, or the age is negative; nothing was sent.
            RobotNotReady: no robot has spoken yet.
        """
        self._answered()
        if not 0.0 <= age <= _OLDEST_MEASUREMENT:
            raise CommandRefused(message("correction_of_other_age", age=age, limit=_OLDEST_MEASUREMENT))
        place = _vector("offset", offset)
        correction = PathCorrection(self._session.next_seqno(), place, round(age * 1000.0))
        self._link.send(self._codec.encode_correction(correction))

    def _answered(self) -> EgmState:
        if self._state is None:
            raise RobotNotReady(message("no_state_to_answer"))
        return self._state

    def _take(self) -> None:
        now, session = self._clock.now(), self._session
        if session.silence(now) > self._silence:
            self._link.release()  # the robot may come back from another port
        received = _accept_from(self._link, session.accept, self._link.receive(), now)
        if received is not None:
            self._arrived = self._state = EgmState(now, session.period, session.number, session.is_first, received)
            if session.is_first:
                self._held = _standstill(received)
        elif not session.number and session.counters.malformed >= MOST_UNREADABLE:
            raise ProtocolError(message("sender_cannot_be_guided", port=self.port, reason=session.last_error))


def _standstill(message: RobotMessage) -> SensorMessage:
    """Stay where ``message`` was measured, whether the robot heeds its joints or its tool."""
    pose = message.measured_pose
    return SensorMessage(
        seqno=0,
        position=message.measured,
        external=message.measured_external,
        tool_position=None if pose is None else pose.position,
        tool_orientation=None if pose is None else pose.orientation,
    )


def _is_placed(message: SensorMessage) -> bool:
    """Whether it says where the robot is to be."""
    return message.position is not None or message.tool_position is not None or bool(message.external)


def _moves(message: SensorMessage) -> bool:
    """Whether it has any reference, be it zero."""
    return (
        _is_placed(message)
        or message.velocity is not None
        or message.twist is not None
        or bool(message.external_velocity)
    )


def _finite(name: str, values: Sequence[float], count: int) -> tuple[float, ...]:
    given = tuple(float(value) for value in values)
    if len(given) != count:
        raise CommandRefused(message("reference_of_other_length", name=name, count=len(given), needed=count))
    for value in given:
        if not isfinite(value):
            raise CommandRefused(message("reference_not_finite", name=name, value=value))
    return given


def _vector(name: str, values: Sequence[float]) -> Vector:
    x, y, z = _finite(name, values, 3)
    return (x, y, z)


class DatagramLink(Protocol):
    """A socket that talks to one robot, or anything that behaves like one."""

    @property
    def foreign(self) -> int:
        """How many datagrams came from elsewhere, while no sender was pinned, and were left aside."""

    @property
    def is_pinned(self) -> bool:
        """Whether only one sender is heard."""

    def fileno(self) -> int:
        """Of the socket; -1 where the link is none."""

    def pin(self) -> None:
        """From now on hear only the sender of what was handed out last."""

    def release(self) -> None:
        """From now on hear every sender again."""

    def receive(self) -> Sequence[bytes]:
        """All datagrams of one sender that wait, oldest first; never waits."""

    def send(self, datagram: bytes) -> None:
        """Answer the sender of what was handed out last."""


_Accepted = TypeVar("_Accepted")


def _accept_from(
    link: DatagramLink,
    accept: Callable[[Sequence[bytes], float], _Accepted | None],
    datagrams: Sequence[bytes],
    now: float,
) -> _Accepted | None:
    """Take what has arrived; the sender of what begins a session is the only one heard until the session ends."""
    while datagrams:
        accepted = accept(datagrams, now)
        if link.is_pinned:
            return accepted
        if accepted is not None:
            link.pin()
            return accepted
        datagrams = link.receive()
    return None


def _is_running(message: RobotMessage) -> bool:
    """Whether the robot follows, as the core judges it of the arms of the control loop."""
    return bool(load().codec_is_running(message.motors, message.mci, message.rapid))


def wire_counters(session: Session, foreign: int) -> WireCounters:
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
