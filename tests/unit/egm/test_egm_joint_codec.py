from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf, nan
from struct import pack

import pytest
from hypothesis import given
from hypothesis import strategies as st

from abb_protocols.egm import egm_pb2 as pb
from abb_protocols.egm.codec import (
    LARGEST_DATAGRAM,
    MciState,
    MotorState,
    RapidState,
    RobotCodec,
    RobotMessage,
    SensorCodec,
    SensorMessage,
)
from abb_protocols.errors import ProtocolError
from abb_protocols.robot.joints import Joints
from refusals import refused
from yumi.egm.joint_codec import JointCodec

JOINTS = st.tuples(*[st.floats(-6.0, 6.0)] * 7)
HOME: Joints = (0.0, -2.0, 1.0, 0.5, 0.0, 0.7, 0.0)
MESSAGE = RobotMessage(
    0, 0, HOME, HOME, None, None, 1.0, 1.02, MotorState.ON, MciState.RUNNING, RapidState.RUNNING, False
)


def robot_datagram() -> pb.EgmRobot:
    return pb.EgmRobot.FromString(RobotCodec().encode(MESSAGE))


def packed(values: Sequence[float]) -> bytes:
    """EgmJoints as a sender writes it that packs its numbers."""
    return b"\x0a" + bytes([8 * len(values)]) + pack(f"<{len(values)}d", *values)


@given(measured=JOINTS, planned=JOINTS, seqno=st.integers(0, 2**32 - 1), time=st.floats(0.0, 2e9))
def test_joint_codec_reads_what_the_sensor_codec_reads(
    measured: Joints, planned: Joints, seqno: int, time: float
) -> None:
    datagram = RobotCodec().encode(
        replace(MESSAGE, measured=measured, planned=planned, seqno=seqno, measured_time=time)
    )
    report, message = JointCodec().decode(datagram), SensorCodec(axes=7).decode(datagram)
    assert {name: getattr(message, name) for name in report._fields} == report._asdict()


@given(position=JOINTS, velocity=st.none() | JOINTS, seqno=st.integers(0, 2**40))
def test_joint_codec_writes_what_the_sensor_codec_writes(position: Joints, velocity: Joints | None, seqno: int) -> None:
    written = JointCodec().encode_joints(seqno, position, velocity)
    assert written == SensorCodec().encode(SensorMessage(seqno, position, velocity))


def test_joint_codec_forgets_the_velocity_before_when_there_is_none_now() -> None:
    codec = JointCodec()
    codec.encode_joints(0, HOME, HOME)
    assert RobotCodec().decode(codec.encode_joints(1, HOME, None)).velocity is None


@pytest.mark.parametrize("value", [nan, inf, -inf])
@pytest.mark.parametrize("index", [0, 2, 6])
def test_joint_codec_never_writes_what_is_not_finite(value: float, index: int) -> None:
    wrong: Joints = tuple(value if i == index else 0.0 for i in range(7))  # type: ignore[assignment]
    with pytest.raises(ValueError, match="seven finite values"):
        JointCodec().encode_joints(0, wrong, None)
    with pytest.raises(ValueError, match="seven finite values"):
        JointCodec().encode_joints(0, HOME, wrong)


def test_joint_codec_reads_packed_joints() -> None:
    robot = robot_datagram()
    robot.feedBack.ClearField("joints")
    robot.feedBack.ClearField("externalJoints")
    axes, axis = packed([10.0, 20.0, 30.0, 40.0, 50.0, 60.0]), packed([70.0])
    feedback = b"\x0a%c%b\x1a%c%b" % (len(axes), axes, len(axis), axis) + robot.feedBack.SerializeToString()
    robot.ClearField("feedBack")
    datagram = robot.SerializeToString() + b"\x12%c%b" % (len(feedback), feedback)
    report = JointCodec().decode(datagram)
    assert report.measured == pytest.approx([value * 0.017453292519943295 for value in (10, 20, 70, 30, 40, 50, 60)])


def test_joint_codec_leaves_axes_that_are_no_part_of_the_arm_aside() -> None:
    robot = robot_datagram()
    robot.feedBack.externalJoints.joints.append(5.0)
    assert JointCodec().decode(robot.SerializeToString()).measured == pytest.approx(HOME, abs=1e-6)


@pytest.mark.parametrize(("robax", "external"), [(6, 0), (5, 1), (7, 1), (0, 0)])
def test_joint_codec_refuses_a_robot_that_is_no_yumi(robax: int, external: int) -> None:
    robot = robot_datagram()
    robot.feedBack.joints.joints[:] = [1.0] * robax
    robot.feedBack.externalJoints.joints[:] = [1.0] * external
    axes = {"joints": robax, "external": external, "expected": 6}
    with refused(ProtocolError, "datagram_axes_not_of_yumi", part="feedBack", **axes):
        JointCodec().decode(robot.SerializeToString())


@pytest.mark.parametrize("angle_deg", [nan, inf, -inf, 1e300, 1100.0])
def test_joint_codec_refuses_a_position_that_no_arm_has(angle_deg: float) -> None:
    robot = robot_datagram()
    robot.planned.joints.joints[2] = angle_deg
    with refused(ProtocolError, "datagram_joint_implausible", part="planned"):
        JointCodec().decode(robot.SerializeToString())


def test_joint_codec_refuses_a_message_without_a_number() -> None:
    robot = robot_datagram()
    robot.header.ClearField("seqno")
    with refused(ProtocolError, "datagram_of_wrong_type", expected=2):
        JointCodec().decode(robot.SerializeToString())


def test_joint_codec_refuses_a_datagram_that_is_too_long() -> None:
    with refused(ProtocolError, "datagram_too_long", most=LARGEST_DATAGRAM):
        JointCodec().decode(bytes(LARGEST_DATAGRAM + 1))


@pytest.mark.parametrize("name", ["motorState", "mciState", "rapidExecState", "planned", "feedBack"])
@pytest.mark.parametrize("codec", [JointCodec(), SensorCodec()], ids=["joints", "sensor"])
def test_codec_refuses_a_message_from_which_a_part_was_cut(codec: JointCodec | SensorCodec, name: str) -> None:
    robot = robot_datagram()
    robot.ClearField(name)
    if name == "feedBack":  # the axes are known by it, and the time is in it
        code = "datagram_without_time" if isinstance(codec, JointCodec) else "datagram_axes_not_of_robot"
        with refused(ProtocolError, code):
            codec.decode(robot.SerializeToString())
        return
    code = "datagram_without_state" if name.endswith("State") else "datagram_axes_not_of_yumi"
    with refused(ProtocolError, code, part=name):
        codec.decode(robot.SerializeToString())


@pytest.mark.parametrize("codec", [JointCodec(), SensorCodec(axes=7)], ids=["joints", "sensor"])
def test_codec_reads_a_datagram_whole_or_refuses_it_wherever_it_is_cut(codec: JointCodec | SensorCodec) -> None:
    datagram = RobotCodec().encode(MESSAGE)
    states = []
    for end in range(len(datagram)):
        try:
            message = codec.decode(datagram[:end])
        except ProtocolError:
            continue
        states.append((message.motors, message.mci, message.rapid))
    assert set(states) <= {(MESSAGE.motors, MESSAGE.mci, MESSAGE.rapid)}


@pytest.mark.parametrize("codec", [JointCodec(), SensorCodec()], ids=["joints", "sensor"])
def test_codec_reads_a_state_that_is_undefined(codec: JointCodec | SensorCodec) -> None:
    datagram = RobotCodec().encode(replace(MESSAGE, rapid=RapidState.UNDEFINED))
    assert codec.decode(datagram).rapid is RapidState.UNDEFINED
