"""The codec of EGM, for both ends: datagrams to messages of robot and sensor: joints, states, twists, path corrections.

The names follow ABB: the *robot* sends :class:`RobotMessage`, the *sensor* (that is us, or anyone who guides the
robot) answers with :class:`SensorMessage` or :class:`PathCorrection` (reference/egm.md §1-3). They are frozen values in
SI units; the wire has degrees, millimetres, microseconds and percent. The joints of a seven-axis arm come in chain
order, those of another robot in ABB's, axes 1 to 6.

:class:`SensorCodec` is our end, :class:`RobotCodec` the robot's. Each datagram gets a message of its own: one that is
used again keeps the memory of all it ever held.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from math import hypot, isfinite, pi
from struct import pack, unpack
from typing import TypeVar, cast

from google.protobuf.message import DecodeError

from abb_protocols.catalogue import Message, message, said_by
from abb_protocols.egm import egm_pb2 as pb
from abb_protocols.errors import ProtocolError
from abb_protocols.robot.joints import Pose, Quaternion, Vector
from abb_protocols.robot.kinematics import euler_zyx, quaternion_from_euler_zyx

Twist = tuple[float, float, float, float, float, float]
"""Speed of the tool: along x, y, z [m/s], then about x, y, z [rad/s]."""


class MotorState(IntEnum):
    """EgmMotorState."""

    UNDEFINED = 0
    ON = 1
    OFF = 2


class MciState(IntEnum):
    """EgmMCIState: the controller's motion correction interface, which EGM drives."""

    UNDEFINED = 0
    ERROR = 1
    STOPPED = 2
    RUNNING = 3


class RapidState(IntEnum):
    """EgmRapidCtrlExecState."""

    UNDEFINED = 0
    STOPPED = 1
    RUNNING = 2


@dataclass(frozen=True, slots=True)
class EgmCollision:
    """EgmCollisionInfo, RobotWare 7.6.

    Attributes:
        is_triggered: whether the motion supervision sees a collision.
        quotas: how near each axis is to that; 1.0 or 100 %, the manual does not say.
    """

    is_triggered: bool
    quotas: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class RapidData:
    """What the RAPID program and the sensor may send each other, RobotWare 7.7.

    Attributes:
        flag: a digital signal; None when there is none.
        numbers: at most 40 numbers, their meaning is the program's.
    """

    flag: bool | None = None
    numbers: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class RobotMessage:
    """One datagram of the robot.

    Attributes:
        seqno: counts datagrams; a session starts at 0.
        sent_ms: the controller's send time stamp [ms], uint32.
        measured: measured joint positions [rad]; seven in chain order, or axes 1 to 6.
        planned: reference joint positions [rad], as ``measured``.
        measured_pose: tool pose of ``measured``; None when the robot sent none.
        planned_pose: tool pose of ``planned``; None when the robot sent none.
        measured_time: when ``measured`` held, controller clock of unknown epoch [s].
        planned_time: when the robot will be at ``planned``, same clock [s]; None when the robot does not say.
        motors: state of the motors.
        mci: state of the motion correction interface.
        rapid: state of the RAPID execution.
        is_converged: whether the robot is within its convergence band.
        utilization: share of the robot's performance in use, 1.0 is full; None before RobotWare 6.10.
        measured_external: measured positions of the external axes that are no part of the arm [rad], linear ones [m].
        planned_external: their references.
        measured_stamp_ns: IEEE 1588 time of ``measured`` [ns]; None before RobotWare 7.16.
        planned_stamp_ns: the same of ``planned``.
        force: measured forces [N] and torques [Nm], (6,); None without a force sensor.
        force_control: whether force control is active; None before RobotWare 7.
        move_index: counts movements and changes of target; None before RobotWare 7.6.
        collision: what the motion supervision sees; None before RobotWare 7.6.
        rapid_data: what the RAPID program sends; None before RobotWare 7.7.
        torque: torque references of the axes, in ABB's order and unit; None when the robot does not say.
        test_signals: ABB's own.
    """

    seqno: int
    sent_ms: int
    measured: tuple[float, ...]
    planned: tuple[float, ...]
    measured_pose: Pose | None
    planned_pose: Pose | None
    measured_time: float
    planned_time: float | None
    motors: MotorState
    mci: MciState
    rapid: RapidState
    is_converged: bool
    utilization: float | None = None
    measured_external: tuple[float, ...] = ()
    planned_external: tuple[float, ...] = ()
    measured_stamp_ns: int | None = None
    planned_stamp_ns: int | None = None
    force: tuple[float, ...] | None = None
    force_control: bool | None = None
    move_index: int | None = None
    collision: EgmCollision | None = None
    rapid_data: RapidData | None = None
    torque: tuple[float, ...] | None = None
    test_signals: tuple[float, ...] = ()


PartialJoints = tuple["float | None", ...]
"""Joint values, None where the sender gave none: the robot keeps that axis' last reference."""


@dataclass(frozen=True, slots=True)
class SensorMessage:
    """One datagram to the robot.

    A field that is None is not on the wire: without a position the robot keeps its last one, without a velocity it
    takes zero. A message with neither keeps the session alive and moves nothing. The robot heeds joints in joint mode
    and the tool in pose mode.

    Attributes:
        seqno: counts our datagrams; None when a third party left it out.
        position: joint positions to reach [rad]; seven in chain order or axes 1 to 6, partial when read from the wire.
        velocity: joint velocities [rad/s], as ``position``.
        sent_ms: the sender's time stamp [ms]; the robot ignores it.
        tool_position: where the tool is to be, in EGM's correction frame [m].
        tool_orientation: its orientation; a unit quaternion, w first.
        twist: speed of the tool.
        external: positions of external axes that are no part of the arm [rad], linear ones [m].
        external_velocity: their velocities.
        rapid_data: for the RAPID program; RobotWare 7.7.
    """

    seqno: int | None
    position: PartialJoints | None = None
    velocity: PartialJoints | None = None
    sent_ms: int | None = None
    tool_position: Vector | None = None
    tool_orientation: Quaternion | None = None
    twist: Twist | None = None
    external: tuple[float, ...] = ()
    external_velocity: tuple[float, ...] = ()
    rapid_data: RapidData | None = None


@dataclass(frozen=True, slots=True)
class PathCorrection:
    """One datagram to a robot that moves along its own path (EGMMoveL, EGMMoveC).

    Attributes:
        seqno: counts our datagrams; None when a third party left it out.
        offset: where the path was measured, seen from the sensor's tool frame [m].
        age_ms: how old the measurement is [ms].
    """

    seqno: int | None
    offset: Vector
    age_ms: int = 0


LARGEST_DATAGRAM = 1024
"""Longer datagrams are no EGM: the usual servers cut them there (reference/egm.md §8.1) [bytes]."""

MOST_NUMBERS = 40
"""Numbers a RAPID program and a sensor may send each other in one datagram (reference/egm.md §1)."""

_DATA = pb.EgmHeader.MSGTYPE_DATA

_ROBOT_AXES = 6  # in EgmJoints; a seventh travels as the first external one (reference/egm.md §3.2)
_SEVEN_AXES = 7

_MOTOR_STATES = {int(state): state for state in MotorState}
_MCI_STATES = {int(state): state for state in MciState}
_RAPID_STATES = {int(state): state for state in RapidState}

_RAD_PER_DEG = pi / 180.0
_DEG_PER_RAD = 180.0 / pi
_M_PER_MM = 1e-3
_MM_PER_M = 1e3
_UINT32 = 2**32
_NS_PER_S = 1_000_000_000

_Motion = pb.EgmFeedBack | pb.EgmPlanned
_Reference = pb.EgmPlanned | pb.EgmSpeedRef
_Parsed = TypeVar(
    "_Parsed",
    pb.EgmRobot,
    pb.EgmSensor,
    pb.EgmSensorPathCorr,
    pb.EgmMeasuredForce6,
    pb.EgmMeasuredForce7,
    pb.EgmJoints,
)


class SensorCodec:
    """Our end: reads what any robot sends, writes references.

    Args:
        axes: 7 for a seven-axis arm, 6 for a robot whose external axes are no part of it; None takes the first
            external axis, where there is one, for the arm's seventh.
    """

    def __init__(self, *, axes: int | None = None) -> None:
        if axes not in {None, _ROBOT_AXES, _SEVEN_AXES}:
            raise ValueError(f"a robot has {_ROBOT_AXES} or {_SEVEN_AXES} axes, not {axes}")
        self._axes = axes

    def decode(self, datagram: bytes) -> RobotMessage:
        """The robot's message.

        Raises:
            ProtocolError: the datagram is not a complete message of a robot with these axes.
        """
        robot = parse_egm(pb.EgmRobot, datagram)
        header, feedback, planned = robot.header, robot.feedBack, robot.planned
        if header.mtype != _DATA or not header.HasField("seqno"):
            raise ProtocolError(message("datagram_of_wrong_type", type=int(header.mtype), expected=_DATA))
        _check_states(robot)
        axes = self._axes or (_SEVEN_AXES if feedback.externalJoints.joints else _ROBOT_AXES)
        measured, measured_external = _checked_axes(feedback, axes, "feedBack")
        goal, goal_external = _checked_axes(planned, axes, "planned")
        force, force_control = _read_force(robot)
        measured_time = _read_clock(feedback)
        if measured_time is None:
            raise ProtocolError(message("datagram_without_time"))
        return RobotMessage(
            seqno=header.seqno,
            sent_ms=header.tm,
            measured=measured,
            planned=goal,
            measured_pose=_checked_pose(feedback),
            planned_pose=_checked_pose(planned),
            measured_time=measured_time,
            planned_time=_read_clock(planned),
            motors=_MOTOR_STATES[robot.motorState.state],
            mci=_MCI_STATES[robot.mciState.state],
            rapid=_RAPID_STATES[robot.rapidExecState.state],
            is_converged=robot.mciConvergenceMet,
            utilization=robot.utilizationRate / 100.0 if robot.HasField("utilizationRate") else None,
            measured_external=measured_external,
            planned_external=goal_external,
            measured_stamp_ns=_read_stamp(feedback),
            planned_stamp_ns=_read_stamp(planned),
            force=force,
            force_control=force_control,
            move_index=robot.moveIndex if robot.HasField("moveIndex") else None,
            collision=_read_collision(robot),
            rapid_data=_read_data(robot.RAPIDfromRobot),
            torque=tuple(robot.torqueRef.joints) or None,
            test_signals=tuple(robot.testSignals.signals),
        )

    def encode(self, message: SensorMessage) -> bytes:
        """The datagram with ``message``.

        Raises:
            ValueError: a value is not finite or left out: NaN crashes the controller (reference/egm.md §4.5).
        """
        sensor = pb.EgmSensor()
        _write_header(sensor.header, message.seqno, pb.EgmHeader.MSGTYPE_CORRECTION)
        if message.position is not None or message.external:
            _write_axes(sensor.planned, _finite(message.position or ()), _finite(message.external))
        if message.tool_position is not None or message.tool_orientation is not None:
            _finite((*(message.tool_position or ()), *(message.tool_orientation or ())))
            _write_goal(sensor.planned.cartesian, message.tool_position, message.tool_orientation)
        if message.velocity is not None or message.external_velocity:
            _write_axes(sensor.speedRef, _finite(message.velocity or ()), _finite(message.external_velocity))
        if message.twist is not None:
            _finite(message.twist)
            _write_twist(sensor.speedRef, message.twist)
        data = message.rapid_data
        if data is not None:
            if len(data.numbers) > MOST_NUMBERS:
                raise ValueError(f"a RAPID program takes at most {MOST_NUMBERS} numbers, got {len(data.numbers)}")
            _finite(data.numbers)
            _write_data(sensor.RAPIDtoRobot, data)
        return sensor.SerializeToString()

    def encode_correction(self, correction: PathCorrection) -> bytes:
        """The datagram that corrects the robot's path.

        Raises:
            ValueError: a value is not finite.
        """
        message = pb.EgmSensorPathCorr()
        _write_header(message.header, correction.seqno, pb.EgmHeader.MSGTYPE_PATH_CORRECTION)
        x, y, z = (value * _MM_PER_M for value in _finite(correction.offset))
        message.pathCorr.pos.x, message.pathCorr.pos.y, message.pathCorr.pos.z = x, y, z
        message.pathCorr.age = correction.age_ms
        return message.SerializeToString()


class RobotCodec:
    """The robot's end: writes what the controller sends, reads any sensor's answer.

    Args:
        axes: 7 for a seven-axis arm, 6 for another robot.
    """

    def __init__(self, *, axes: int = _SEVEN_AXES) -> None:
        self._axes = axes

    def decode(self, datagram: bytes) -> SensorMessage:
        """The sensor's message; header fields may be missing, empty parts count as absent.

        Raises:
            ProtocolError: the datagram is no EgmSensor.
        """
        sensor = parse_egm(pb.EgmSensor, datagram)
        header, planned, speed = sensor.header, sensor.planned, sensor.speedRef
        # The same field numbers have other contents: an offset of the path would be read as the position of axis 1.
        if header.mtype == pb.EgmHeader.MSGTYPE_PATH_CORRECTION:
            raise ProtocolError(message("datagram_corrects_path", type=int(header.mtype)))
        position, external = _read_partial(planned, self._axes)
        velocity, external_velocity = _read_partial(speed, self._axes)
        tool_position, tool_orientation = _read_goal(planned.cartesian)
        return SensorMessage(
            seqno=header.seqno if header.HasField("seqno") else None,
            position=position,
            velocity=velocity,
            sent_ms=header.tm if header.HasField("tm") else None,
            tool_position=tool_position,
            tool_orientation=tool_orientation,
            twist=_read_twist(speed),
            external=external,
            external_velocity=external_velocity,
            rapid_data=_read_data(sensor.RAPIDtoRobot),
        )

    def decode_correction(self, datagram: bytes) -> PathCorrection:
        """The sensor's message to a robot under path correction, where field 2 means something else.

        Raises:
            ProtocolError: the datagram is no EgmSensorPathCorr.
        """
        sensor = parse_egm(pb.EgmSensorPathCorr, datagram)
        if sensor.header.mtype == pb.EgmHeader.MSGTYPE_CORRECTION:
            raise ProtocolError(message("datagram_has_references", type=int(sensor.header.mtype)))
        if not sensor.pathCorr.HasField("pos"):
            raise ProtocolError(message("correction_without_position"))
        pos = sensor.pathCorr.pos
        seqno = sensor.header.seqno if sensor.header.HasField("seqno") else None
        return PathCorrection(seqno, (pos.x * _M_PER_MM, pos.y * _M_PER_MM, pos.z * _M_PER_MM), sensor.pathCorr.age)

    def encode(self, message: RobotMessage) -> bytes:
        """The controller's datagram; each field that is None belongs to a newer RobotWare and is left out."""
        robot = pb.EgmRobot()
        _write_header(robot.header, message.seqno, _DATA)
        robot.header.tm = message.sent_ms % _UINT32
        _write_motion(robot.feedBack, message.measured, message.measured_external, message.measured_pose)
        _write_times(robot.feedBack, message.measured_time, message.measured_stamp_ns)
        _write_motion(robot.planned, message.planned, message.planned_external, message.planned_pose)
        _write_times(robot.planned, message.planned_time, message.planned_stamp_ns)
        robot.testSignals.signals[:] = message.test_signals
        robot.testSignals.SetInParent()  # the controller sends it even when it is empty
        robot.motorState.state = cast("pb.EgmMotorState.MotorStateType", int(message.motors))
        robot.mciState.state = cast("pb.EgmMCIState.MCIStateType", int(message.mci))
        robot.rapidExecState.state = cast("pb.EgmRapidCtrlExecState.RapidCtrlExecStateType", int(message.rapid))
        robot.mciConvergenceMet = message.is_converged
        # What came after RobotWare 6.07, or is not always there.
        if message.utilization is not None:
            robot.utilizationRate = message.utilization * 100.0
        force = message.force or ()
        if message.force_control is not None:
            force_seven = pb.EgmMeasuredForce7(fcActive=message.force_control, force=force)
            robot.measuredForce = force_seven.SerializeToString()
        elif message.force is not None:
            robot.measuredForce = pb.EgmMeasuredForce6(force=force).SerializeToString()
        if message.move_index is not None:
            robot.moveIndex = message.move_index
        if message.collision is not None:
            robot.CollisionInfo.collsionTriggered = message.collision.is_triggered
            robot.CollisionInfo.collDetQuota[:] = message.collision.quotas
        if message.rapid_data is not None:
            _write_data(robot.RAPIDfromRobot, message.rapid_data)
        if message.torque is not None:
            robot.torqueRef.joints[:] = message.torque
        return robot.SerializeToString()


# ---- parts of datagrams


def parse_egm(kind: type[_Parsed], datagram: bytes) -> _Parsed:
    """Read ``datagram`` into a message of its own, which is faster than emptying another, too.

    Raises:
        ProtocolError: it is too long, or no message at all.
    """
    if len(datagram) > LARGEST_DATAGRAM:
        raise ProtocolError(message("datagram_too_long", size=len(datagram), most=LARGEST_DATAGRAM))
    try:
        return kind.FromString(datagram)
    except DecodeError as error:
        raise ProtocolError(message("datagram_not_decoded", size=len(datagram), error=said_by(error))) from error


def _check_states(robot: pb.EgmRobot) -> None:
    """See that the message was not cut off: every robot sends its three states, also undefined ones.

    Raises:
        ProtocolError: one is missing (reference/egm.md §3.1, §8.2 rule 6).
    """
    for name in ("motorState", "mciState", "rapidExecState"):
        if not robot.HasField(name):
            raise ProtocolError(message("datagram_without_state", part=name))


def _checked_axes(motion: _Motion, axes: int, name: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    robax, external = len(motion.joints.joints), len(motion.externalJoints.joints)
    if robax != _ROBOT_AXES or (axes == _SEVEN_AXES and not external):
        raise ProtocolError(wrong_axes(name, robax, external, axes))
    values, beside = _read_axes(motion, axes)
    if not _are_finite((*values, *beside)):
        raise ProtocolError(
            message(
                "datagram_joint_not_finite",
                part=name,
                joints=tuple(map(str, values)),
                external=tuple(map(str, beside)),
            )
        )
    return values, beside


def wrong_axes(name: str, robax: int, external: int, axes: int) -> Message:
    """That a part of a datagram has other joints than a robot with these axes."""
    return message(
        "datagram_axes_not_of_yumi" if axes == _SEVEN_AXES else "datagram_axes_not_of_robot",
        part=name,
        joints=robax,
        external=external,
        expected=_ROBOT_AXES,
    )


def _checked_pose(motion: _Motion) -> Pose | None:
    pose = _read_pose(motion)
    if pose is not None and not _are_finite((*pose.position, *pose.orientation)):
        raise ProtocolError(
            message(
                "datagram_pose_not_finite",
                position=tuple(map(str, pose.position)),
                orientation=tuple(map(str, pose.orientation)),
            )
        )
    return pose


def _read_force(robot: pb.EgmRobot) -> tuple[tuple[float, ...] | None, bool | None]:
    """Force, and whether force control is active where the controller has RobotWare 7's layout."""
    if not robot.measuredForce:
        return None, None
    six = parse_egm(pb.EgmMeasuredForce6, robot.measuredForce)
    if six.force:
        return tuple(six.force), None
    seven = parse_egm(pb.EgmMeasuredForce7, robot.measuredForce)
    return tuple(seven.force) or None, seven.fcActive if seven.HasField("fcActive") else None


def _write_header(header: pb.EgmHeader, seqno: int | None, kind: pb.EgmHeader.MessageType) -> None:
    header.mtype = kind
    header.seqno = (seqno or 0) % _UINT32


def _finite(values: Sequence[float | None]) -> Sequence[float]:
    if None in values or not _are_finite(cast("Sequence[float]", values)):
        raise ValueError(f"a reference needs finite values for all axes, got {values}")
    return cast("Sequence[float]", values)


def _are_finite(values: Sequence[float]) -> bool:
    return all(map(isfinite, values))


def _radians_of(values: Iterable[float]) -> tuple[float, ...]:
    return tuple([value * _RAD_PER_DEG for value in values])


def _read_axes(motion: _Motion, axes: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """The arm's joints, seven in chain order or those of ``EgmJoints``, and what external axes are left [rad]."""
    robax, external = _radians_of(motion.joints.joints), _radians_of(motion.externalJoints.joints)
    if axes <= _ROBOT_AXES:
        return robax, external
    a1, a2, a3, a4, a5, a6 = robax
    return (a1, a2, external[0], a3, a4, a5, a6), external[1:]


def _read_partial(part: _Reference, axes: int) -> tuple[PartialJoints | None, tuple[float, ...]]:
    """As :func:`_read_axes`, of what a sensor wrote: axes it left out are None (reference/egm.md §10 item 18)."""
    robax, external = part.joints.joints[:_ROBOT_AXES], _radians_of(part.externalJoints.joints)
    known: list[float | None] = [*_radians_of(robax), *[None] * (_ROBOT_AXES - len(robax))]
    rest = external
    if axes > _ROBOT_AXES:
        known.insert(2, external[0] if external else None)
        rest = external[1:]
    return (None if known == [None] * len(known) else tuple(known)), rest


def _write_axes(
    part: _Motion | pb.EgmSpeedRef,
    values: Sequence[float],
    external: Sequence[float],
    rounded: Callable[[Sequence[float]], Sequence[float]] = tuple,
) -> None:
    """The opposite of :func:`_read_axes`; seven values are in chain order [rad]."""
    robax = list(values)
    beside = list(external)
    if len(robax) > _ROBOT_AXES:
        beside.insert(0, robax.pop(2))
    if robax:
        part.joints.joints[:] = rounded([value * _DEG_PER_RAD for value in robax])
    if beside:
        part.externalJoints.joints[:] = rounded([value * _DEG_PER_RAD for value in beside])


def _read_pose(motion: _Motion) -> Pose | None:
    """The robot's pose; the quaternion counts, and the Euler angles where there is none."""
    if not motion.HasField("cartesian"):
        return None
    cartesian = motion.cartesian
    orientation = _quaternion(cartesian.orient) if cartesian.HasField("orient") else _from_euler(cartesian.euler)
    return Pose(_position(cartesian.pos), orientation)


def _read_goal(cartesian: pb.EgmPose) -> tuple[Vector | None, Quaternion | None]:
    """A sensor's pose: where both are given Euler angles win over the quaternion (reference/egm.md §1.1)."""
    position = _position(cartesian.pos) if cartesian.HasField("pos") else None
    if cartesian.HasField("euler"):
        return position, _from_euler(cartesian.euler)
    if not cartesian.HasField("orient"):
        return position, None
    w, x, y, z = _quaternion(cartesian.orient)
    norm = hypot(w, x, y, z) or 1.0
    return position, (w / norm, x / norm, y / norm, z / norm)


def _write_goal(cartesian: pb.EgmPose, position: Vector | None, orientation: Quaternion | None) -> None:
    if position is not None:
        _put_vector(cartesian.pos, [value * _MM_PER_M for value in position])
    if orientation is not None:
        _put_quaternion(cartesian.orient, orientation)


def _write_pose(cartesian: pb.EgmPose, pose: Pose) -> None:
    """As the controller does: in single precision, with Euler angles made of the rounded quaternion (§2.4)."""
    *position, w, x, y, z = _singles([*[value * _MM_PER_M for value in pose.position], *pose.orientation])
    _put_vector(cartesian.pos, position)
    _put_quaternion(cartesian.orient, (w, x, y, z))
    _put_vector(cartesian.euler, [angle * _DEG_PER_RAD for angle in euler_zyx((w, x, y, z))])


def _read_twist(speed: pb.EgmSpeedRef) -> Twist | None:
    """Missing values are zero; None when there are none."""
    values = speed.cartesians.value
    if not values:
        return None
    vx, vy, vz, wx, wy, wz = [*values[:6], *[0.0] * (6 - len(values))]
    return (vx * _M_PER_MM, vy * _M_PER_MM, vz * _M_PER_MM, wx * _RAD_PER_DEG, wy * _RAD_PER_DEG, wz * _RAD_PER_DEG)


def _write_twist(speed: pb.EgmSpeedRef, twist: Twist) -> None:
    linear, angular = twist[:3], twist[3:]
    speed.cartesians.value[:] = [v * _MM_PER_M for v in linear] + [w * _DEG_PER_RAD for w in angular]


def _read_clock(motion: _Motion) -> float | None:
    return motion.time.sec + motion.time.usec * 1e-6 if motion.HasField("time") else None


def _read_stamp(motion: _Motion) -> int | None:
    return motion.timeStamp.sec * _NS_PER_S + motion.timeStamp.nsec if motion.HasField("timeStamp") else None


def _write_motion(motion: _Motion, values: Sequence[float], external: Sequence[float], pose: Pose | None) -> None:
    """A part of the robot's message, in single precision."""
    _write_axes(motion, values, external, _singles)
    if pose is not None:
        _write_pose(motion.cartesian, pose)


def _write_times(motion: _Motion, time: float | None, stamp_ns: int | None) -> None:
    if time is not None:
        motion.time.sec, motion.time.usec = divmod(round(time * 1e6), 1_000_000)
    if stamp_ns is not None:
        motion.timeStamp.sec, motion.timeStamp.nsec = divmod(stamp_ns, _NS_PER_S)


def _read_collision(robot: pb.EgmRobot) -> EgmCollision | None:
    if not robot.HasField("CollisionInfo"):
        return None
    return EgmCollision(robot.CollisionInfo.collsionTriggered, tuple(robot.CollisionInfo.collDetQuota))


def _read_data(data: pb.EgmRAPIDdata) -> RapidData | None:
    """None when it is empty."""
    flag = data.digVal if data.HasField("digVal") else None
    return RapidData(flag, tuple(data.dnum)) if data.dnum or flag is not None else None


def _write_data(data: pb.EgmRAPIDdata, value: RapidData) -> None:
    if value.flag is not None:
        data.digVal = value.flag
    data.dnum[:] = value.numbers


def _position(part: pb.EgmCartesian) -> Vector:
    return (part.x * _M_PER_MM, part.y * _M_PER_MM, part.z * _M_PER_MM)


def _quaternion(part: pb.EgmQuaternion) -> Quaternion:
    return (part.u0, part.u1, part.u2, part.u3)


def _from_euler(part: pb.EgmEuler) -> Quaternion:
    angles = (part.x * _RAD_PER_DEG, part.y * _RAD_PER_DEG, part.z * _RAD_PER_DEG)
    if not all(isfinite(angle) for angle in angles):
        return angles[0], *angles  # trigonometry refuses what is not finite; the reader checks it
    return quaternion_from_euler_zyx(angles)


def _put_vector(part: pb.EgmCartesian | pb.EgmEuler, values: Sequence[float]) -> None:
    part.x, part.y, part.z = values


def _put_quaternion(part: pb.EgmQuaternion, values: Quaternion) -> None:
    part.u0, part.u1, part.u2, part.u3 = values


def _singles(values: Sequence[float]) -> tuple[float, ...]:
    """Round to single precision, in which the controller computes (reference/egm.md §2.4)."""
    layout = f"<{len(values)}f"
    return unpack(layout, pack(layout, *values))
