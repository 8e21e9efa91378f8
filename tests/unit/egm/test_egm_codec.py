from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf, isfinite, nan, pi, sqrt
from pathlib import Path
from resource import getpagesize
from struct import pack

import pytest
from hypothesis import given
from hypothesis import strategies as st

from abb_protocols.egm import egm_pb2 as pb
from abb_protocols.egm.codec import (
    LARGEST_DATAGRAM,
    EgmCollision,
    MciState,
    MotorState,
    PathCorrection,
    Pose,
    RapidData,
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

ANGLES = st.floats(-6.0, 6.0)
JOINTS = st.tuples(*[ANGLES] * 7)
SIX = (0.0, -2.0, 0.5, 0.0, 0.7, 0.0)
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

EVERYTHING = replace(
    MESSAGE,
    measured=(0.0,) * 7,  # what is exact in single precision survives unchanged
    planned=(0.0,) * 7,
    measured_pose=Pose((0.5, 0.25, -0.125), (1.0, 0.0, 0.0, 0.0)),
    planned_pose=Pose((0.5, 0.25, -0.125), (0.0, 1.0, 0.0, 0.0)),
    measured_time=1.5,
    planned_time=1.75,
    utilization=0.5,
    measured_stamp_ns=1_700_000_000_123_456_789,
    planned_stamp_ns=1_700_000_000_123_456_790,
    force=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0),
    force_control=False,
    move_index=3,
    collision=EgmCollision(is_triggered=True, quotas=(0.25, 0.5)),
    rapid_data=RapidData(flag=True, numbers=(1.0, -2.0)),
    torque=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0),
    test_signals=(1.5,),
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
    robot = RobotCodec()
    for decode in (SensorCodec().decode, JointCodec().decode, robot.decode, robot.decode_correction):
        try:
            decode(datagram)
        except ProtocolError:
            continue


@pytest.mark.parametrize("value", [nan, inf, -inf])
def test_sensor_codec_never_writes_what_is_not_finite(value: float) -> None:
    with pytest.raises(ValueError, match="finite values for all axes"):
        SensorCodec().encode(SensorMessage(0, (0.0,) * 6 + (value,)))


def test_sensor_codec_forgets_the_reference_before_when_there_is_none_now() -> None:
    codec = SensorCodec()
    codec.encode(SensorMessage(0, HOME, HOME))
    message = RobotCodec().decode(codec.encode(SensorMessage(1)))
    assert (message.position, message.velocity) == (None, None)


def test_sensor_codec_for_seven_axes_refuses_a_robot_with_six() -> None:
    robot = robot_datagram()
    robot.feedBack.ClearField("externalJoints")
    with refused(ProtocolError, "datagram_axes_not_of_yumi", part="feedBack", joints=6, external=0, expected=6):
        SensorCodec(axes=7).decode(robot.SerializeToString())


def test_sensor_codec_refuses_a_robot_with_four_axes() -> None:
    robot = robot_datagram()
    robot.planned.joints.joints[:] = [1.0] * 4
    with refused(ProtocolError, "datagram_axes_not_of_robot", part="planned", joints=4, external=1):
        SensorCodec(axes=6).decode(robot.SerializeToString())


def test_sensor_codec_knows_robots_with_six_or_seven_axes_only() -> None:
    with pytest.raises(ValueError, match="a robot has 6 or 7 axes, not 4"):
        SensorCodec(axes=4)


@pytest.mark.parametrize(
    ("axes", "measured", "external"),
    [
        (None, SIX, ()),
        (6, SIX, ()),
        (6, SIX, (0.5, 1.5)),
        (None, HOME, ()),
        (7, HOME, ()),
        (7, HOME, (0.5, 1.5)),
    ],
)
def test_axes_survive_the_wire_both_ways(
    axes: int | None, measured: tuple[float, ...], external: tuple[float, ...]
) -> None:
    codec, robot = SensorCodec(axes=axes), RobotCodec(axes=len(measured))
    sent = replace(MESSAGE, measured=measured, planned=measured, measured_external=external, planned_external=external)
    message = codec.decode(robot.encode(sent))
    assert (message.measured, message.planned) == (pytest.approx(measured, abs=1e-6), pytest.approx(measured, abs=1e-6))
    assert message.measured_external == message.planned_external == pytest.approx(external, abs=1e-6)
    told = robot.decode(
        codec.encode(SensorMessage(1, measured, measured, external=external, external_velocity=external))
    )
    assert told.position == told.velocity == pytest.approx(measured)
    assert told.external == told.external_velocity == pytest.approx(external)


def test_robot_message_of_robotware_7_survives_the_wire() -> None:
    assert SensorCodec().decode(RobotCodec().encode(EVERYTHING)) == EVERYTHING


def test_sensor_message_with_every_field_survives_the_wire() -> None:
    message = SensorMessage(
        seqno=4,
        tool_position=(0.5, -0.25, 0.125),
        tool_orientation=(0.0, 1.0, 0.0, 0.0),
        twist=(0.5, 0.0, -0.25, 0.0, pi, 0.0),
        rapid_data=RapidData(flag=False, numbers=(1.0, -2.0)),
    )
    assert RobotCodec().decode(SensorCodec().encode(message)) == message


@pytest.mark.parametrize(
    ("layout", "force", "force_control"),
    [
        (b"\x09" + pack("<d", 2.5), (2.5,), None),  # RobotWare 6: field 1 is the force
        (b"\x0a\x08" + pack("<d", 2.5), (2.5,), None),  # the same, packed
        (b"\x08\x01\x11" + pack("<d", 2.5), (2.5,), True),  # RobotWare 7: field 1 is a flag, field 2 the force
        (b"\x08\x00\x12\x08" + pack("<d", 2.5), (2.5,), False),
        (b"\x08\x01", None, True),
        (b"", None, None),
    ],
)
def test_force_is_read_in_both_layouts(
    layout: bytes, force: tuple[float, ...] | None, force_control: bool | None
) -> None:
    robot = robot_datagram()
    robot.measuredForce = layout
    message = SensorCodec().decode(robot.SerializeToString())
    assert (message.force, message.force_control) == (force, force_control)


@pytest.mark.parametrize("force_control", [None, True])
def test_force_is_written_in_both_layouts(force_control: bool | None) -> None:
    sent = replace(MESSAGE, force=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0), force_control=force_control)
    message = SensorCodec().decode(RobotCodec().encode(sent))
    assert (message.force, message.force_control) == (sent.force, force_control)


def test_euler_angles_win_over_the_quaternion() -> None:
    sensor = pb.EgmSensor()
    sensor.planned.cartesian.orient.u0 = 1.0
    sensor.planned.cartesian.euler.z = 90.0
    message = RobotCodec(axes=6).decode(sensor.SerializeToString())
    assert message.tool_orientation == pytest.approx((sqrt(0.5), 0.0, 0.0, sqrt(0.5)))
    assert message.tool_position is None


@pytest.mark.parametrize(("u1", "expected"), [(2.0, (0.0, 1.0, 0.0, 0.0)), (0.0, (0.0, 0.0, 0.0, 0.0))])
def test_quaternion_of_a_sensor_is_normalised_where_it_can_be(u1: float, expected: tuple[float, ...]) -> None:
    sensor = pb.EgmSensor()
    sensor.planned.cartesian.orient.u1 = u1
    assert RobotCodec().decode(sensor.SerializeToString()).tool_orientation == expected


@pytest.mark.parametrize("angle", [nan, inf])
def test_euler_angles_that_are_not_finite_are_no_orientation(angle: float) -> None:
    sensor = pb.EgmSensor()
    sensor.planned.cartesian.euler.y = angle
    orientation = RobotCodec().decode(sensor.SerializeToString()).tool_orientation
    assert orientation is not None
    assert not all(map(isfinite, orientation))


def test_robot_pose_is_read_from_euler_angles_when_it_has_no_quaternion() -> None:
    robot = robot_datagram()
    robot.feedBack.cartesian.euler.x = 180.0
    pose = SensorCodec().decode(robot.SerializeToString()).measured_pose
    assert pose is not None
    assert pose.orientation == pytest.approx((0.0, 1.0, 0.0, 0.0), abs=1e-9)


def test_sensor_codec_refuses_a_pose_that_is_not_a_number() -> None:
    robot = robot_datagram()
    robot.planned.cartesian.pos.z = nan
    with refused(ProtocolError, "datagram_pose_not_finite"):
        SensorCodec().decode(robot.SerializeToString())


@pytest.mark.parametrize("count", [1, 3, 6])
def test_twist_lacks_what_the_sensor_left_out(count: int) -> None:
    sensor = pb.EgmSensor()
    sensor.speedRef.cartesians.value[:] = [1000.0] * count
    twist = RobotCodec().decode(sensor.SerializeToString()).twist
    assert twist is not None
    assert sum(value != 0.0 for value in twist) == count


def test_path_correction_survives_the_wire() -> None:
    correction = PathCorrection(7, (0.0, 0.0015, -0.25), age_ms=12)
    assert RobotCodec().decode_correction(SensorCodec().encode_correction(correction)) == correction


def test_references_are_not_read_as_a_path_correction_nor_a_path_correction_as_references() -> None:
    sensor, robot = SensorCodec(), RobotCodec()
    with refused(ProtocolError, "datagram_has_references", type=3):
        robot.decode_correction(sensor.encode(SensorMessage(1, (0.1,) * 7)))
    with refused(ProtocolError, "datagram_corrects_path", type=4):
        robot.decode(sensor.encode_correction(PathCorrection(1, (0.1, 0.2, 0.3))))


def test_path_correction_without_a_position_is_refused() -> None:
    with refused(ProtocolError, "correction_without_position"):
        RobotCodec().decode_correction(b"")


@pytest.mark.parametrize(
    "message",
    [
        SensorMessage(0, velocity=(0.0, nan, 0.0, 0.0, 0.0, 0.0)),
        SensorMessage(0, tool_position=(0.0, inf, 0.0)),
        SensorMessage(0, tool_orientation=(nan, 0.0, 0.0, 0.0)),
        SensorMessage(0, twist=(0.0, 0.0, 0.0, 0.0, 0.0, nan)),
        SensorMessage(0, position=(None, 0.0, 0.0, 0.0, 0.0, 0.0)),
        SensorMessage(0, external=(nan,)),
        SensorMessage(0, rapid_data=RapidData(numbers=(inf,))),
    ],
)
def test_sensor_codec_refuses_every_field_that_is_not_finite(message: SensorMessage) -> None:
    with pytest.raises(ValueError, match="finite values for all axes"):
        SensorCodec().encode(message)


def test_sensor_codec_refuses_more_numbers_than_rapid_takes() -> None:
    with pytest.raises(ValueError, match="at most 40 numbers, got 41"):
        SensorCodec().encode(SensorMessage(0, rapid_data=RapidData(numbers=(0.0,) * 41)))


@pytest.mark.parametrize("decode", [SensorCodec().decode, JointCodec().decode], ids=["sensor", "joint"])
def test_robot_before_607_is_refused(decode: Callable[[bytes], object]) -> None:
    robot = robot_datagram()
    robot.feedBack.ClearField("time")
    with refused(ProtocolError, "datagram_without_time"):
        decode(robot.SerializeToString())


@pytest.mark.parametrize("decode", [SensorCodec().decode, JointCodec().decode], ids=["sensor", "joint"])
def test_state_of_a_newer_robot_counts_as_undefined(decode: Callable[[bytes], RobotMessage]) -> None:
    datagram = robot_datagram().SerializeToString().replace(b"\x2a\x02\x08\x03", b"\x2a\x02\x08\x63")
    assert decode(datagram).mci is MciState.UNDEFINED


def test_sensor_codec_refuses_a_measured_position_that_is_not_a_number() -> None:
    robot = robot_datagram()
    robot.feedBack.joints.joints[2] = nan
    with refused(ProtocolError, "datagram_joint_not_finite"):
        SensorCodec().decode(robot.SerializeToString())


def test_sensor_codec_refuses_a_message_of_another_type() -> None:
    robot = robot_datagram()
    robot.header.mtype = pb.EgmHeader.MSGTYPE_CORRECTION
    with refused(ProtocolError, "datagram_of_wrong_type", expected=2):
        SensorCodec().decode(robot.SerializeToString())


def test_codec_refuses_a_datagram_that_is_too_long() -> None:
    with refused(ProtocolError, "datagram_too_long", most=LARGEST_DATAGRAM):
        SensorCodec().decode(bytes(LARGEST_DATAGRAM + 1))


@pytest.mark.parametrize("decode", [SensorCodec().decode, JointCodec().decode], ids=["sensor", "joint"])
def test_fields_of_the_future_are_skipped(decode: Callable[[bytes], RobotMessage]) -> None:
    future = bytes([100 << 3 & 0x7F | 0x80, 100 >> 4, 5])  # field 100, a number
    assert decode(RobotCodec().encode(MESSAGE) + future).seqno == 0


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


def memory() -> int:
    """What this process has now [KiB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * getpagesize() // 1024


def test_codecs_keep_no_memory_of_what_they_read_and_wrote() -> None:
    joint, sensor, robot = JointCodec(), SensorCodec(), RobotCodec()
    reply, datagram = SensorMessage(1, HOME, HOME), robot.encode(EVERYTHING)

    def exchange(count: int) -> None:
        for seqno in range(count):
            joint.decode(datagram)
            joint.encode_joints(seqno, HOME, HOME if seqno % 2 else None)
            robot.decode(sensor.encode(reply))
            sensor.decode(robot.encode(EVERYTHING))

    exchange(500)
    before = memory()
    exchange(10_000)
    assert memory() - before < 1000  # a reused message would keep about 900 bytes of each datagram
