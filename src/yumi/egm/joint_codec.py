"""The fast line's codec: joints of a seven-axis arm in and out, as few microseconds as Python allows.

It reads the schema's ``JointRobot``, a view of ABB's message in which six joints are one run of bytes: each double
behind its tag. A sender may also pack them, so other bytes go through protobuf. A reference of seven joints always has
the same length, so it is written as such a run, too. Not thread-safe.
"""

from __future__ import annotations

from math import isfinite
from struct import Struct

from yumi.egm import egm_pb2 as pb
from yumi.egm.codec import DATA, check_states, parse
from yumi.egm.messages import JointReport
from yumi.egm.parts import MCI_STATES, MOTOR_STATES, RAPID_STATES
from yumi.egm.units import DEG_PER_RAD, RAD_PER_DEG, UINT32
from yumi.errors import ProtocolError
from yumi.robot.joints import Joints

_TAG = b"\x09"  # field 1, a double
_SIX_TAGS = _TAG * 6
_read_six, _read_one = Struct("<xdxdxdxdxdxd").unpack, Struct("<xd").unpack
_write_reference = Struct("<2B 2B BdBdBdBdBdBd 2B Bd").pack
_PLANNED, _SPEED_REF = 0x12, 0x1A  # tags of EgmSensor's fields 2 and 3
_HEADER, _JOINTS, _EXTERNAL = 0x0A, 0x0A, 0x1A  # and of fields 1, 1 and 3 of what holds them

_IMPLAUSIBLE = 7 * 400.0**2
"""Sum of squares no arm reaches whose joints turn by less than 400 degrees; not a number fails every comparison."""


class JointCodec:
    """Our end of a seven-axis arm in joint mode."""

    def __init__(self) -> None:
        self._header = pb.EgmHeader(mtype=pb.EgmHeader.MSGTYPE_CORRECTION)

    def decode(self, datagram: bytes) -> JointReport:
        """The joints and the state in the robot's message.

        Raises:
            ProtocolError: the datagram is not a complete message of a seven-axis robot.
        """
        robot = parse(pb.JointRobot, datagram)
        header, feedback = robot.header, robot.feedBack
        seqno = header.seqno
        if header.mtype != DATA or not (seqno or header.HasField("seqno")):
            raise ProtocolError(
                f"EGM datagram of type {header.mtype}: a robot sends type {DATA} with a sequence number."
            )
        motors, mci, rapid = robot.motorState.state, robot.mciState.state, robot.rapidExecState.state
        if not (motors and mci and rapid):  # undefined is a state, too, and a missing one looks the same
            check_states(robot)
        return JointReport(
            seqno,
            _read_joints(feedback, "feedBack"),
            _read_joints(robot.planned, "planned"),
            _read_time(feedback),
            MOTOR_STATES[motors],
            MCI_STATES[mci],
            RAPID_STATES[rapid],
        )

    def encode_joints(self, seqno: int, position: Joints, velocity: Joints | None) -> bytes:
        """The datagram that tells the arm its position [rad] and velocity [rad/s].

        Raises:
            ValueError: a value is not finite: a reference with NaN crashes the controller (reference/egm.md §4.5).
        """
        self._header.seqno = seqno % UINT32
        header = self._header.SerializeToString()
        start = b"%c%c%b%b" % (_HEADER, len(header), header, _reference(_PLANNED, position))
        return start if velocity is None else start + _reference(_SPEED_REF, velocity)


def _read_joints(motion: pb.JointMotion, name: str) -> Joints:
    robax, external = motion.joints, motion.externalJoints
    if robax[::9] == _SIX_TAGS and external[::9] == _TAG and len(robax) == 54 and len(external) == 9:
        a1, a2, a3, a4, a5, a6 = _read_six(robax)
        (a7,) = _read_one(external)
    else:
        a1, a2, a3, a4, a5, a6, a7 = _read_packed(robax, external, name)
    if not a1 * a1 + a2 * a2 + a3 * a3 + a4 * a4 + a5 * a5 + a6 * a6 + a7 * a7 < _IMPLAUSIBLE:
        raise ProtocolError(
            f"EGM {name} has a joint that no arm has: {[a1, a2, a3, a4, a5, a6]}, {[a7]} are to be finite degrees."
        )
    return (
        a1 * RAD_PER_DEG,
        a2 * RAD_PER_DEG,
        a7 * RAD_PER_DEG,
        a3 * RAD_PER_DEG,
        a4 * RAD_PER_DEG,
        a5 * RAD_PER_DEG,
        a6 * RAD_PER_DEG,
    )


def _read_packed(robax: bytes, external: bytes, name: str) -> list[float]:
    joints, extra = parse(pb.EgmJoints, robax).joints, parse(pb.EgmJoints, external).joints
    if len(joints) != 6 or not extra:
        raise ProtocolError(
            f"EGM {name} has {len(joints)} joints and {len(extra)} external joints: a YuMi arm sends 6 and 1."
        )
    return [*joints, extra[0]]


def _read_time(feedback: pb.JointMotion) -> float:
    time = feedback.time
    sec, usec = time.sec, time.usec
    if not sec and not feedback.HasField("time"):
        raise ProtocolError(
            "EGM feedBack has no time: RobotWare before 6.07, whose joints are radians; RobotWare 6.07 is needed."
        )
    return sec + usec * 1e-6


def _reference(tag: int, chain: Joints) -> bytes:
    """EgmPlanned or EgmSpeedRef with EgmJoints for axes 1 to 6 and for axis 7."""
    a1, a2, a7, a3, a4, a5, a6 = chain
    if not isfinite(a1 + a2 + a3 + a4 + a5 + a6 + a7):
        raise ValueError(f"a reference needs seven finite values, got {chain}")
    return _write_reference(
        tag,
        67,
        _JOINTS,
        54,
        9,
        a1 * DEG_PER_RAD,
        9,
        a2 * DEG_PER_RAD,
        9,
        a3 * DEG_PER_RAD,
        9,
        a4 * DEG_PER_RAD,
        9,
        a5 * DEG_PER_RAD,
        9,
        a6 * DEG_PER_RAD,
        _EXTERNAL,
        9,
        9,
        a7 * DEG_PER_RAD,
    )
