"""Datagrams to values and back, for both ends of EGM and any robot; protobuf, degrees and millimetres stay below.

Each datagram gets a message of its own: one that is used again keeps the memory of all it ever held. The fast line has
a leaner codec, see :mod:`yumi.egm.joint_codec`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import isfinite
from typing import TypeVar, cast

from google.protobuf.message import DecodeError

from yumi.egm import egm_pb2 as pb
from yumi.egm.messages import (
    PartialJoints,
    PathCorrection,
    Pose,
    RapidData,
    RobotMessage,
    SensorMessage,
)
from yumi.egm.parts import (
    MCI_STATES,
    MOTOR_STATES,
    RAPID_STATES,
    ROBOT_AXES,
    Motion,
    read_axes,
    read_clock,
    read_collision,
    read_data,
    read_goal,
    read_partial,
    read_pose,
    read_stamp,
    read_twist,
    write_axes,
    write_data,
    write_goal,
    write_motion,
    write_times,
    write_twist,
)
from yumi.egm.units import M_PER_MM, MM_PER_M, UINT32
from yumi.errors import ProtocolError

LARGEST_DATAGRAM = 1024
"""Longer datagrams are no EGM: the usual servers cut them there (reference/egm.md §8.1) [bytes]."""

MOST_NUMBERS = 40
"""Numbers a RAPID program and a sensor may tell each other in one datagram (reference/egm.md §1)."""

DATA = pb.EgmHeader.MSGTYPE_DATA
_SEVEN = 7
_Parsed = TypeVar(
    "_Parsed",
    pb.EgmRobot,
    pb.EgmSensor,
    pb.EgmSensorPathCorr,
    pb.EgmMeasuredForce6,
    pb.EgmMeasuredForce7,
    pb.EgmJoints,
    pb.JointRobot,
)


class SensorCodec:
    """Our end: reads what any robot sends, writes what it is told.

    Args:
        axes: 7 for a seven-axis arm, 6 for a robot whose external axes are no part of it; None takes the first
            external axis, where there is one, for the arm's seventh.
    """

    def __init__(self, *, axes: int | None = None) -> None:
        if axes not in {None, ROBOT_AXES, _SEVEN}:
            raise ValueError(f"a robot has {ROBOT_AXES} or {_SEVEN} axes, not {axes}")
        self._axes = axes

    def decode(self, datagram: bytes) -> RobotMessage:
        """The robot's message.

        Raises:
            ProtocolError: the datagram is not a complete message of a robot with these axes.
        """
        robot = parse(pb.EgmRobot, datagram)
        header, feedback, planned = robot.header, robot.feedBack, robot.planned
        if header.mtype != DATA or not header.HasField("seqno"):
            raise ProtocolError(
                f"EGM datagram of type {header.mtype}: a robot sends type {DATA} with a sequence number."
            )
        check_states(robot)
        axes = self._axes or (_SEVEN if feedback.externalJoints.joints else ROBOT_AXES)
        measured, measured_external = _checked_axes(feedback, axes, "feedBack")
        goal, goal_external = _checked_axes(planned, axes, "planned")
        force, force_control = _read_force(robot)
        return RobotMessage(
            seqno=header.seqno,
            sent_ms=header.tm,
            measured=measured,
            planned=goal,
            measured_pose=_checked_pose(feedback),
            planned_pose=_checked_pose(planned),
            measured_time=_checked_time(feedback),
            planned_time=read_clock(planned),
            motors=MOTOR_STATES[robot.motorState.state],
            mci=MCI_STATES[robot.mciState.state],
            rapid=RAPID_STATES[robot.rapidExecState.state],
            is_converged=robot.mciConvergenceMet,
            utilization=robot.utilizationRate / 100.0 if robot.HasField("utilizationRate") else None,
            measured_external=measured_external,
            planned_external=goal_external,
            measured_stamp_ns=read_stamp(feedback),
            planned_stamp_ns=read_stamp(planned),
            force=force,
            force_control=force_control,
            move_index=robot.moveIndex if robot.HasField("moveIndex") else None,
            collision=read_collision(robot),
            rapid_data=read_data(robot.RAPIDfromRobot),
            torque=tuple(robot.torqueRef.joints) or None,
            test_signals=tuple(robot.testSignals.signals),
        )

    def encode(self, message: SensorMessage) -> bytes:
        """The datagram that tells the robot ``message``.

        Raises:
            ValueError: a value is not finite or left out: NaN crashes the controller (reference/egm.md §4.5).
        """
        sensor = pb.EgmSensor()
        _write_header(sensor.header, message.seqno, pb.EgmHeader.MSGTYPE_CORRECTION)
        _write_planned(sensor, message)
        _write_speed(sensor, message)
        if message.rapid_data is not None:
            write_data(sensor.RAPIDtoRobot, _checked_data(message.rapid_data))
        return sensor.SerializeToString()

    def encode_joints(self, seqno: int, position: PartialJoints, velocity: PartialJoints | None) -> bytes:
        """The datagram that gives the robot's joints a position [rad] and a velocity [rad/s].

        Raises:
            ValueError: as :meth:`encode`.
        """
        return self.encode(SensorMessage(seqno, position, velocity))

    def encode_correction(self, correction: PathCorrection) -> bytes:
        """The datagram that corrects the robot's path.

        Raises:
            ValueError: a value is not finite.
        """
        message = pb.EgmSensorPathCorr()
        _write_header(message.header, correction.seqno, pb.EgmHeader.MSGTYPE_PATH_CORRECTION)
        x, y, z = (value * MM_PER_M for value in _finite(correction.offset))
        message.pathCorr.pos.x, message.pathCorr.pos.y, message.pathCorr.pos.z = x, y, z
        message.pathCorr.age = correction.age_ms
        return message.SerializeToString()


class RobotCodec:
    """The robot's end: writes what the controller sends, reads any sensor's answer.

    Args:
        axes: 7 for a seven-axis arm, 6 for another robot.
    """

    def __init__(self, *, axes: int = _SEVEN) -> None:
        self._axes = axes

    def decode(self, datagram: bytes) -> SensorMessage:
        """The sensor's message; header fields may be missing, empty parts count as absent.

        Raises:
            ProtocolError: the datagram is no EgmSensor.
        """
        sensor = parse(pb.EgmSensor, datagram)
        header, planned, speed = sensor.header, sensor.planned, sensor.speedRef
        position, external = read_partial(planned, self._axes)
        velocity, external_velocity = read_partial(speed, self._axes)
        tool_position, tool_orientation = read_goal(planned.cartesian)
        return SensorMessage(
            seqno=header.seqno if header.HasField("seqno") else None,
            position=position,
            velocity=velocity,
            sent_ms=header.tm if header.HasField("tm") else None,
            tool_position=tool_position,
            tool_orientation=tool_orientation,
            twist=read_twist(speed),
            external=external,
            external_velocity=external_velocity,
            rapid_data=read_data(sensor.RAPIDtoRobot),
        )

    def decode_correction(self, datagram: bytes) -> PathCorrection:
        """The sensor's message to a robot under path correction, where field 2 means something else.

        Raises:
            ProtocolError: the datagram is no EgmSensorPathCorr.
        """
        message = parse(pb.EgmSensorPathCorr, datagram)
        if not message.pathCorr.HasField("pos"):
            raise ProtocolError("EGM path correction has no position: a robot that moves on a path needs one.")
        pos = message.pathCorr.pos
        seqno = message.header.seqno if message.header.HasField("seqno") else None
        return PathCorrection(seqno, (pos.x * M_PER_MM, pos.y * M_PER_MM, pos.z * M_PER_MM), message.pathCorr.age)

    def encode(self, message: RobotMessage) -> bytes:
        """The controller's datagram; each field that is None belongs to a newer RobotWare and is left out."""
        robot = pb.EgmRobot()
        _write_header(robot.header, message.seqno, DATA)
        robot.header.tm = message.sent_ms % UINT32
        write_motion(robot.feedBack, message.measured, message.measured_external, message.measured_pose)
        write_times(robot.feedBack, message.measured_time, message.measured_stamp_ns)
        write_motion(robot.planned, message.planned, message.planned_external, message.planned_pose)
        write_times(robot.planned, message.planned_time, message.planned_stamp_ns)
        robot.testSignals.signals[:] = message.test_signals
        robot.testSignals.SetInParent()  # the controller sends it even when it is empty
        _write_states(robot, message)
        _write_newer(robot, message)
        return robot.SerializeToString()


def parse(kind: type[_Parsed], datagram: bytes) -> _Parsed:
    """Read ``datagram`` into a message of its own, which is faster than emptying another, too.

    Raises:
        ProtocolError: it is too long, or no message at all.
    """
    if len(datagram) > LARGEST_DATAGRAM:
        raise ProtocolError(f"EGM datagram of {len(datagram)} bytes: at most {LARGEST_DATAGRAM} are allowed.")
    try:
        return kind.FromString(datagram)
    except DecodeError as error:
        raise ProtocolError(f"EGM datagram of {len(datagram)} bytes cannot be decoded: {error}.") from error


def check_states(robot: pb.EgmRobot | pb.JointRobot) -> None:
    """See that the message was not cut off: every robot sends its three states, also undefined ones.

    Raises:
        ProtocolError: one is missing (reference/egm.md §3.1, §8.2 rule 6).
    """
    for name in ("motorState", "mciState", "rapidExecState"):
        if not robot.HasField(name):
            raise ProtocolError(f"EGM datagram has no {name}: it was cut off, a robot always sends it.")


def _checked_axes(motion: Motion, axes: int, name: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    robax, external = len(motion.joints.joints), len(motion.externalJoints.joints)
    if robax != ROBOT_AXES or (axes == _SEVEN and not external):
        wanted = f"a YuMi arm sends {ROBOT_AXES} and 1" if axes == _SEVEN else f"a robot sends {ROBOT_AXES}"
        raise ProtocolError(f"EGM {name} has {robax} joints and {external} external joints: {wanted}.")
    values, beside = read_axes(motion, axes)
    if not _are_finite((*values, *beside)):
        raise ProtocolError(f"EGM {name} has a joint that is not a finite number: {list(values)}, {list(beside)}.")
    return values, beside


def _checked_pose(motion: Motion) -> Pose | None:
    pose = read_pose(motion)
    if pose is not None and not _are_finite((*pose.position, *pose.orientation)):
        raise ProtocolError(f"EGM has a tool pose that is not finite numbers: {pose.position}, {pose.orientation}.")
    return pose


def _checked_time(feedback: pb.EgmFeedBack) -> float:
    time = read_clock(feedback)
    if time is None:
        raise ProtocolError(
            "EGM feedBack has no time: RobotWare before 6.07, whose joints are radians; RobotWare 6.07 is needed."
        )
    return time


def _read_force(robot: pb.EgmRobot) -> tuple[tuple[float, ...] | None, bool | None]:
    """Force, and whether force control is active where the controller has RobotWare 7's layout."""
    if not robot.measuredForce:
        return None, None
    six = parse(pb.EgmMeasuredForce6, robot.measuredForce)
    if six.force:
        return tuple(six.force), None
    seven = parse(pb.EgmMeasuredForce7, robot.measuredForce)
    return tuple(seven.force) or None, seven.fcActive if seven.HasField("fcActive") else None


def _write_header(header: pb.EgmHeader, seqno: int | None, kind: pb.EgmHeader.MessageType) -> None:
    header.mtype = kind
    header.seqno = (seqno or 0) % UINT32


def _write_planned(sensor: pb.EgmSensor, message: SensorMessage) -> None:
    if message.position is not None or message.external:
        write_axes(sensor.planned, _finite(message.position or ()), _finite(message.external))
    if message.tool_position is not None or message.tool_orientation is not None:
        _finite((*(message.tool_position or ()), *(message.tool_orientation or ())))
        write_goal(sensor.planned.cartesian, message.tool_position, message.tool_orientation)


def _write_speed(sensor: pb.EgmSensor, message: SensorMessage) -> None:
    if message.velocity is not None or message.external_velocity:
        write_axes(sensor.speedRef, _finite(message.velocity or ()), _finite(message.external_velocity))
    if message.twist is not None:
        _finite(message.twist)
        write_twist(sensor.speedRef, message.twist)


def _write_states(robot: pb.EgmRobot, message: RobotMessage) -> None:
    robot.motorState.state = cast("pb.EgmMotorState.MotorStateType", int(message.motors))
    robot.mciState.state = cast("pb.EgmMCIState.MCIStateType", int(message.mci))
    robot.rapidExecState.state = cast("pb.EgmRapidCtrlExecState.RapidCtrlExecStateType", int(message.rapid))
    robot.mciConvergenceMet = message.is_converged


def _write_newer(robot: pb.EgmRobot, message: RobotMessage) -> None:
    """What came after RobotWare 6.07, or is not always there."""
    if message.utilization is not None:
        robot.utilizationRate = message.utilization * 100.0
    if message.force is not None or message.force_control is not None:
        robot.measuredForce = _force_bytes(message.force or (), message.force_control)
    if message.move_index is not None:
        robot.moveIndex = message.move_index
    if message.collision is not None:
        robot.CollisionInfo.collsionTriggered = message.collision.is_triggered
        robot.CollisionInfo.collDetQuota[:] = message.collision.quotas
    if message.rapid_data is not None:
        write_data(robot.RAPIDfromRobot, message.rapid_data)
    if message.torque is not None:
        robot.torqueRef.joints[:] = message.torque


def _force_bytes(force: Iterable[float], force_control: bool | None) -> bytes:
    if force_control is None:
        return pb.EgmMeasuredForce6(force=force).SerializeToString()
    return pb.EgmMeasuredForce7(fcActive=force_control, force=force).SerializeToString()


def _checked_data(data: RapidData) -> RapidData:
    if len(data.numbers) > MOST_NUMBERS:
        raise ValueError(f"a RAPID program takes at most {MOST_NUMBERS} numbers, got {len(data.numbers)}")
    _finite(data.numbers)
    return data


def _finite(values: Sequence[float | None]) -> Sequence[float]:
    if None in values or not _are_finite(cast("Sequence[float]", values)):
        raise ValueError(f"a reference needs finite values for all axes, got {values}")
    return cast("Sequence[float]", values)


def _are_finite(values: Sequence[float]) -> bool:
    return all(map(isfinite, values))
