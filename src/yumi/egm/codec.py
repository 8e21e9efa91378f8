"""Datagrams to values and back, for both ends of EGM; the only place that knows protobuf, degrees and millimetres.

One codec serves one arm: it reuses its two protobuf messages, which is what makes the fast line fast
(reference/performance.md, recommendation 9). It is not thread-safe.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import cast

from google.protobuf.message import DecodeError

from yumi.egm import egm_pb2 as pb
from yumi.egm.messages import (
    MciState,
    MotorState,
    PartialJoints,
    Pose,
    RapidState,
    RobotMessage,
    SensorMessage,
)
from yumi.egm.units import DEG_PER_RAD, M_PER_MM, MM_PER_M, RAD_PER_DEG, UINT32, clock_fields, single
from yumi.errors import ProtocolError
from yumi.robot.joints import Joints, abb_from_chain
from yumi.robot.kinematics import euler_zyx

LARGEST_DATAGRAM = 1024
"""Longer datagrams are no EGM: the usual servers cut them there (reference/egm.md §8.1) [bytes]."""

_AXES_1_TO_6 = 6
_DATA = pb.EgmHeader.MSGTYPE_DATA
_CORRECTION = pb.EgmHeader.MSGTYPE_CORRECTION
_Motion = pb.EgmFeedBack | pb.EgmPlanned


class SensorCodec:
    """Our end: reads what a seven-axis robot sends, writes what it is told.

    Args:
        reads_poses: whether to read the tool poses too; the joint controllers of the fast line need none.
    """

    def __init__(self, *, reads_poses: bool = True) -> None:
        self._reads_poses = reads_poses
        self._robot = pb.EgmRobot()
        self._sensor = pb.EgmSensor()
        self._sensor.header.mtype = _CORRECTION

    def decode(self, datagram: bytes) -> RobotMessage:
        """The robot's message.

        Raises:
            ProtocolError: the datagram is not a complete message of a seven-axis robot.
        """
        robot = self._robot
        _parse(robot, datagram)
        header, feedback, planned = robot.header, robot.feedBack, robot.planned
        if header.mtype != _DATA or not header.HasField("seqno"):
            raise ProtocolError(
                f"EGM datagram of type {header.mtype}: a robot sends type {_DATA} with a sequence number."
            )
        return RobotMessage(
            seqno=header.seqno,
            sent_ms=header.tm,
            measured=_read_joints(feedback, "feedBack"),
            planned=_read_joints(planned, "planned"),
            measured_pose=_read_pose(feedback) if self._reads_poses else None,
            planned_pose=_read_pose(planned) if self._reads_poses else None,
            measured_time=_read_clock(feedback),
            planned_time=_read_clock(planned),
            motors=MotorState(robot.motorState.state),
            mci=MciState(robot.mciState.state),
            rapid=RapidState(robot.rapidExecState.state),
            is_converged=robot.mciConvergenceMet,
            utilization=robot.utilizationRate / 100.0 if robot.HasField("utilizationRate") else None,
        )

    def encode(self, message: SensorMessage) -> bytes:
        """The datagram that tells the robot ``message``.

        Raises:
            ValueError: a value is not finite: a reference with NaN crashes the controller (reference/egm.md §4.5).
        """
        sensor = self._sensor
        sensor.header.seqno = (message.seqno or 0) % UINT32
        if message.position is None:
            sensor.ClearField("planned")
        else:
            _write_joints(sensor.planned, _complete(message.position))
        if message.velocity is None:
            sensor.ClearField("speedRef")
        else:
            _write_joints(sensor.speedRef, _complete(message.velocity))
        return sensor.SerializeToString()


class RobotCodec:
    """The robot's end: writes what the controller sends, reads any sensor's answer."""

    def __init__(self) -> None:
        self._robot = pb.EgmRobot()
        self._robot.header.mtype = _DATA
        self._robot.testSignals.SetInParent()  # present and empty, as the controller sends it
        self._sensor = pb.EgmSensor()

    def decode(self, datagram: bytes) -> SensorMessage:
        """The sensor's message; header fields may be missing, empty parts count as absent.

        Raises:
            ProtocolError: the datagram is no EgmSensor.
        """
        sensor = self._sensor
        _parse(sensor, datagram)
        header = sensor.header
        return SensorMessage(
            seqno=header.seqno if header.HasField("seqno") else None,
            position=_read_partial(sensor.planned.joints.joints, sensor.planned.externalJoints.joints),
            velocity=_read_partial(sensor.speedRef.joints.joints, sensor.speedRef.externalJoints.joints),
            sent_ms=header.tm if header.HasField("tm") else None,
        )

    def encode(self, message: RobotMessage) -> bytes:
        """The datagram of a RobotWare 6.07-6.09 controller; 6.10 and later when ``utilization`` is given."""
        robot = self._robot
        robot.header.seqno = message.seqno % UINT32
        robot.header.tm = message.sent_ms % UINT32
        _write_motion(robot.feedBack, message.measured, message.measured_pose, message.measured_time)
        _write_motion(robot.planned, message.planned, message.planned_pose, message.planned_time)
        robot.motorState.state = cast("pb.EgmMotorState.MotorStateType", int(message.motors))
        robot.mciState.state = cast("pb.EgmMCIState.MCIStateType", int(message.mci))
        robot.rapidExecState.state = cast("pb.EgmRapidCtrlExecState.RapidCtrlExecStateType", int(message.rapid))
        robot.mciConvergenceMet = message.is_converged
        if message.utilization is None:
            robot.ClearField("utilizationRate")
        else:
            robot.utilizationRate = message.utilization * 100.0
        return robot.SerializeToString()


def _parse(message: pb.EgmRobot | pb.EgmSensor, datagram: bytes) -> None:
    if len(datagram) > LARGEST_DATAGRAM:
        raise ProtocolError(f"EGM datagram of {len(datagram)} bytes: at most {LARGEST_DATAGRAM} are allowed.")
    try:
        message.ParseFromString(datagram)
    except DecodeError as error:
        raise ProtocolError(f"EGM datagram of {len(datagram)} bytes cannot be decoded: {error}.") from error


def _read_joints(motion: _Motion, name: str) -> Joints:
    robax, external = motion.joints.joints, motion.externalJoints.joints
    if len(robax) != _AXES_1_TO_6 or not external:
        raise ProtocolError(
            f"EGM {name} has {len(robax)} joints and {len(external)} external joints: a YuMi arm sends 6 and 1."
        )
    a1, a2, a3, a4, a5, a6 = robax
    values = (
        a1 * RAD_PER_DEG,
        a2 * RAD_PER_DEG,
        external[0] * RAD_PER_DEG,
        a3 * RAD_PER_DEG,
        a4 * RAD_PER_DEG,
        a5 * RAD_PER_DEG,
        a6 * RAD_PER_DEG,
    )
    if not isfinite(sum(values)):
        raise ProtocolError(f"EGM {name} has a joint that is not a finite number: {list(robax)}, {list(external)}.")
    return values


def _read_partial(robax: Sequence[float], external: Sequence[float]) -> PartialJoints | None:
    """Axes the sender left out are None, more than seven are ignored (reference/egm.md §10 item 18)."""
    if not robax and not external:
        return None
    known: list[float | None] = [value * RAD_PER_DEG for value in robax[:_AXES_1_TO_6]]
    a1, a2, a3, a4, a5, a6 = known + [None] * (_AXES_1_TO_6 - len(known))
    a7 = external[0] * RAD_PER_DEG if external else None
    return (a1, a2, a7, a3, a4, a5, a6)


def _read_pose(motion: _Motion) -> Pose | None:
    if not motion.HasField("cartesian"):
        return None
    pos, orient = motion.cartesian.pos, motion.cartesian.orient
    return Pose(
        position=(pos.x * M_PER_MM, pos.y * M_PER_MM, pos.z * M_PER_MM),
        orientation=(orient.u0, orient.u1, orient.u2, orient.u3),
    )


def _read_clock(motion: _Motion) -> float | None:
    if not motion.HasField("time"):
        return None
    return motion.time.sec + motion.time.usec * 1e-6


def _complete(values: PartialJoints) -> Joints:
    if None in values or not isfinite(sum(cast("Joints", values))):
        raise ValueError(f"a reference needs seven finite values, got {values}")
    return cast("Joints", values)


def _write_joints(part: pb.EgmPlanned | pb.EgmSpeedRef, chain: Joints) -> None:
    a1, a2, a7, a3, a4, a5, a6 = chain
    part.joints.joints[:] = (
        a1 * DEG_PER_RAD,
        a2 * DEG_PER_RAD,
        a3 * DEG_PER_RAD,
        a4 * DEG_PER_RAD,
        a5 * DEG_PER_RAD,
        a6 * DEG_PER_RAD,
    )
    part.externalJoints.joints[:] = (a7 * DEG_PER_RAD,)


def _write_motion(motion: _Motion, chain: Joints, pose: Pose | None, time: float | None) -> None:
    robax, eax_a = abb_from_chain(chain)
    motion.joints.joints[:] = [single(value * DEG_PER_RAD) for value in robax]
    motion.externalJoints.joints[:] = [single(eax_a * DEG_PER_RAD)]
    if pose is None:
        motion.ClearField("cartesian")
    else:
        _write_pose(motion.cartesian, pose)
    if time is None:
        motion.ClearField("time")
    else:
        motion.time.sec, motion.time.usec = clock_fields(time)


def _write_pose(cartesian: pb.EgmPose, pose: Pose) -> None:
    x, y, z = (single(value * MM_PER_M) for value in pose.position)
    cartesian.pos.x, cartesian.pos.y, cartesian.pos.z = x, y, z
    orient = cartesian.orient
    orient.u0, orient.u1, orient.u2, orient.u3 = (single(value) for value in pose.orientation)
    roll, pitch, yaw = euler_zyx((orient.u0, orient.u1, orient.u2, orient.u3))
    euler = cartesian.euler
    euler.x, euler.y, euler.z = roll * DEG_PER_RAD, pitch * DEG_PER_RAD, yaw * DEG_PER_RAD
