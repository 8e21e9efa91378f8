"""Datagrams of other implementations and of protobuf's own compiler, read and written by our codecs."""

from __future__ import annotations

import json
from math import degrees, radians
from pathlib import Path
from typing import Any

import pytest

from abb_protocols.egm.codec import (
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
from abb_protocols.robot.joints import chain_from_abb, joints
from yumi.egm.joint_codec import JointCodec

GOLDEN = Path(__file__).parent / "golden"
INDEX: list[dict[str, Any]] = json.loads((GOLDEN / "index.json").read_text())
ROBOT = [entry for entry in INDEX if entry["role"] == "robot" and "joints_deg" in entry]
REPLIES = [entry for entry in INDEX if "parsed" in entry]
MEASURED = joints([radians(value) for value in (10, -20, -70, 30, -40, 50, -60)])
PLANNED = joints([radians(value) for value in (11, -21, -71, 31, -41, 51, -61)])


def golden(name: str) -> bytes:
    return (GOLDEN / name).read_bytes()


def test_index_names_every_datagram_with_its_origin() -> None:
    assert {path.name for path in GOLDEN.glob("*.bin")} == {entry["file"] for entry in INDEX}
    assert all(len(golden(entry["file"])) == entry["bytes"] and entry["made_by"] for entry in INDEX)


@pytest.mark.parametrize("entry", ROBOT, ids=lambda entry: entry["file"])
def test_robot_datagram_is_read_in_chain_order(entry: dict[str, Any]) -> None:
    message = SensorCodec().decode(golden(entry["file"]))
    expected = chain_from_abb(entry["joints_deg"], entry["external_joints_deg"][0])
    assert [degrees(value) for value in message.measured] == pytest.approx(expected)


@pytest.mark.parametrize("entry", ROBOT, ids=lambda entry: entry["file"])
def test_fast_line_reads_the_same_joints(entry: dict[str, Any]) -> None:
    datagram = golden(entry["file"])
    assert JointCodec().decode(datagram).measured == SensorCodec().decode(datagram).measured


def test_robot_datagram_of_robotware_7_is_read_with_every_field() -> None:
    message = SensorCodec().decode(golden("robot_running_rw7.bin"))
    assert [degrees(value) for value in message.measured] == pytest.approx([10, 11, 12, 13, 14, 15])
    assert (message.utilization, message.move_index, message.test_signals) == (0.625, 7, (1.5, 2.5))
    assert (message.force, message.force_control) == ((1.0, 2.0, 3.0, 0.1, 0.2, 0.3), True)
    assert message.collision == EgmCollision(is_triggered=True, quotas=(0.25, 0.5))
    assert message.rapid_data == RapidData(flag=True, numbers=(1.0, -2.0))
    assert message.torque == (5.0, 6.0, 7.0, 8.0, 9.0, 10.0)
    assert (message.measured_time, message.measured_stamp_ns) == (123.456789, 1_700_000_000_123_456_789)


def test_robot_side_writes_every_field_of_robotware_7() -> None:
    message = SensorCodec().decode(golden("robot_running_rw7.bin"))
    assert RobotCodec(axes=6).encode(message) == golden("robot_running_rw7.bin")


def test_our_side_writes_a_pose_as_another_implementation_does() -> None:
    message = RobotCodec(axes=6).decode(golden("sensor_pose_rw7.bin"))
    assert message.rapid_data == RapidData(flag=False, numbers=(3.0, 4.0))
    assert message.twist == (0.5, 0.0, -0.25, 0.0, 0.0, radians(180.0))
    assert SensorCodec().encode(message) == golden("sensor_pose_rw7.bin")


def test_our_side_writes_a_path_correction_as_another_implementation_does() -> None:
    datagram = golden("sensor_path_correction.bin")
    assert RobotCodec().decode_correction(datagram) == PathCorrection(5, (0.0, 0.0015, -0.0025), age_ms=12)
    assert SensorCodec().encode_correction(PathCorrection(5, (0.0, 0.0015, -0.0025), age_ms=12)) == datagram


def test_robot_datagram_of_610_has_a_utilization_and_of_609_has_none() -> None:
    codec = SensorCodec()
    assert codec.decode(golden("robot_running_rw610.bin")).utilization == pytest.approx(0.125)
    assert codec.decode(golden("robot_first_rw609.bin")).utilization is None


def test_stream_datagram_says_that_correction_is_stopped() -> None:
    assert SensorCodec().decode(golden("robot_stream_stopped.bin")).mci is MciState.STOPPED


@pytest.mark.parametrize("entry", REPLIES, ids=lambda entry: entry["file"])
def test_reply_of_another_implementation_is_read_by_the_robot_side(entry: dict[str, Any]) -> None:
    message = RobotCodec().decode(golden(entry["file"]))
    parsed = entry["parsed"]
    assert message.seqno == parsed["seqno"]
    assert message.position is not None
    expected = chain_from_abb(parsed["joints"], parsed["external_joints"][0])
    assert [degrees(value or 0.0) for value in message.position] == pytest.approx(expected)
    assert message.velocity is None


def test_header_only_reply_has_no_reference() -> None:
    message = RobotCodec().decode(golden("sensor_header_only.bin"))
    assert (message.position, message.velocity) == (None, None)


def test_robot_side_writes_what_protobufs_compiler_writes() -> None:
    message = RobotMessage(
        seqno=7,
        sent_ms=123456,
        measured=MEASURED,
        planned=PLANNED,
        measured_pose=Pose((0.1005, -0.20025, 0.300125), (1.0, 0.0, 0.0, 0.0)),
        planned_pose=Pose((0.1015, -0.20125, 0.301125), (1.0, 0.0, 0.0, 0.0)),
        measured_time=123.4515,
        planned_time=123.46,
        motors=MotorState.ON,
        mci=MciState.RUNNING,
        rapid=RapidState.RUNNING,
        is_converged=True,
    )
    assert RobotCodec().encode(message) == golden("robot_running_rw609.bin")


@pytest.mark.parametrize("velocity", [None, joints([radians(value) for value in (1, -2, -7, 3, -4, 5, -6)])])
def test_our_side_says_what_protobufs_compiler_says(velocity: Any) -> None:
    name = "sensor_joints.bin" if velocity is None else "sensor_joints_and_speeds.bin"
    expected = RobotCodec().decode(golden(name))
    assert expected.seqno is not None
    written = SensorCodec().encode(SensorMessage(expected.seqno, MEASURED, velocity))
    read = RobotCodec().decode(written)
    assert len(written) == len(golden(name))
    assert read.position == pytest.approx(expected.position)
    assert read.velocity == (None if velocity is None else pytest.approx(expected.velocity))
