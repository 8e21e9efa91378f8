from __future__ import annotations

from dataclasses import replace
from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from yumi.egm import egm_pb2 as pb
from yumi.egm.codec import LARGEST_DATAGRAM, RobotCodec, SensorCodec
from yumi.egm.messages import MciState, MotorState, RapidState, RobotMessage, SensorMessage
from yumi.errors import ProtocolError
from yumi.robot.joints import Joints

ANGLES = st.floats(-6.0, 6.0)
JOINTS = st.tuples(*[ANGLES] * 7)
HOME: Joints = (0.0, -2.0, 1.0, 0.5, 0.0, 0.7, 0.0)
MESSAGE = RobotMessage(
    seqno=0,
    sent_ms=1000,
    measured=HOME,
    planned=HOME,
    measured_pose=None,
    planned_pose=None,
    measured_time=1.0,
    planned_time=1.02,
    motors=MotorState.ON,
    mci=MciState.RUNNING,
    rapid=RapidState.RUNNING,
    is_converged=False,
)


def robot_datagram() -> pb.EgmRobot:
    return pb.EgmRobot.FromString(RobotCodec().encode(MESSAGE))


@given(measured=JOINTS, planned=JOINTS, seqno=st.integers(0, 2**32 - 1))
def test_robot_message_survives_the_wire_in_single_precision(measured: Joints, planned: Joints, seqno: int) -> None:
    message = SensorCodec().decode(
        RobotCodec().encode(replace(MESSAGE, measured=measured, planned=planned, seqno=seqno))
    )
    assert message.seqno == seqno
    assert message.measured == pytest.approx(measured, abs=1e-6)
    assert message.planned == pytest.approx(planned, abs=1e-6)


@given(position=JOINTS, velocity=st.none() | JOINTS)
def test_sensor_message_survives_the_wire(position: Joints, velocity: Joints | None) -> None:
    message = RobotCodec().decode(SensorCodec().encode(SensorMessage(1, position, velocity)))
    assert message.position == pytest.approx(position, abs=1e-12)
    assert message.velocity == (None if velocity is None else pytest.approx(velocity, abs=1e-12))


@given(st.binary(max_size=2000))
def test_codecs_raise_nothing_but_protocol_errors(datagram: bytes) -> None:
    for decode in (SensorCodec().decode, RobotCodec().decode):
        try:
            decode(datagram)
        except ProtocolError:
            continue


@pytest.mark.parametrize("value", [nan, inf, -inf])
def test_sensor_codec_never_writes_what_is_not_finite(value: float) -> None:
    with pytest.raises(ValueError, match="seven finite values"):
        SensorCodec().encode(SensorMessage(0, (0.0,) * 6 + (value,)))


def test_sensor_codec_forgets_the_reference_before_when_there_is_none_now() -> None:
    codec = SensorCodec()
    codec.encode(SensorMessage(0, HOME, HOME))
    message = RobotCodec().decode(codec.encode(SensorMessage(1)))
    assert (message.position, message.velocity) == (None, None)


def test_sensor_codec_refuses_a_robot_with_six_axes() -> None:
    robot = robot_datagram()
    robot.feedBack.ClearField("externalJoints")
    with pytest.raises(ProtocolError, match="feedBack has 6 joints and 0 external joints: a YuMi arm sends 6 and 1"):
        SensorCodec().decode(robot.SerializeToString())


def test_sensor_codec_refuses_a_measured_position_that_is_not_a_number() -> None:
    robot = robot_datagram()
    robot.feedBack.joints.joints[2] = nan
    with pytest.raises(ProtocolError, match="not a finite number"):
        SensorCodec().decode(robot.SerializeToString())


def test_sensor_codec_refuses_a_message_of_another_type() -> None:
    robot = robot_datagram()
    robot.header.mtype = pb.EgmHeader.MSGTYPE_CORRECTION
    with pytest.raises(ProtocolError, match="a robot sends type 2 with a sequence number"):
        SensorCodec().decode(robot.SerializeToString())


def test_codec_refuses_a_datagram_that_is_too_long() -> None:
    with pytest.raises(ProtocolError, match=f"at most {LARGEST_DATAGRAM}"):
        SensorCodec().decode(bytes(LARGEST_DATAGRAM + 1))


def test_sensor_codec_skips_fields_it_does_not_know() -> None:
    move_index = bytes([11 << 3, 5])  # field 11 as a RobotWare 7 controller sends it
    assert SensorCodec().decode(RobotCodec().encode(MESSAGE) + move_index).seqno == 0


@pytest.mark.parametrize(("count", "external"), [(6, 0), (4, 1), (9, 3)])
def test_robot_codec_keeps_the_axes_that_came_and_leaves_out_the_others(count: int, external: int) -> None:
    sensor = pb.EgmSensor()
    sensor.planned.joints.joints[:] = [1.0] * count
    sensor.planned.externalJoints.joints[:] = [2.0] * external
    position = RobotCodec().decode(sensor.SerializeToString()).position
    assert position is not None
    assert sum(value is not None for value in position) == min(count, 6) + min(external, 1)


def test_robot_codec_takes_empty_parts_as_absent() -> None:
    sensor = pb.EgmSensor()
    sensor.planned.joints.SetInParent()
    sensor.speedRef.SetInParent()
    message = RobotCodec().decode(sensor.SerializeToString())
    assert (message.seqno, message.position, message.velocity) == (None, None, None)


def test_robot_datagram_fits_what_servers_read() -> None:
    assert len(RobotCodec().encode(MESSAGE)) < LARGEST_DATAGRAM
