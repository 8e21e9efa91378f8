"""What the programs of others find in a recording: ROS's messages, the robot's description, Foxglove's log."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from abb_protocols.robot.gripper_values import GripperState, ServoState
from abb_protocols.robot.joints import Pose, Side, finger_names, home, joint_names
from abb_protocols.robot.kinematics import compose_poses, tool0_to_body
from abb_protocols.robot.urdf import read_frames, robot_description
from abb_runtime.clock import ManualClock
from flight import CYCLE, LOST, flown
from yumi.control.flight_recorder import FlightRecorder
from yumi.control.shared_state import JointStates
from yumi.recording.message_types import recorded_event
from yumi.recording.reader import read_recording
from yumi.recording.recorder import FullRecorder, Sources
from yumi.recording.writer import RecordingWriter

EPOCH = 1_800_000_000.0
GRIPPER = GripperState(ServoState.KEEP_OBJECT, 0, True, 0.01, -0.02, 20.0)
ARM_JOINTS = (*joint_names(Side.RIGHT), *joint_names(Side.LEFT))
FINGER_JOINTS = (*finger_names(Side.RIGHT), *finger_names(Side.LEFT))
COUNT = 500  # cycles


class Cdr:
    """Reads a message value by value, by the rules of XCDR1."""

    def __init__(self, data: bytes) -> None:
        assert data[:4] == b"\x00\x01\x00\x00"
        self.body, self.at = data[4:], 0

    def number(self, form: str) -> Any:
        size = struct.calcsize(f"<{form}")
        self.at += -self.at % size + size
        return struct.unpack(f"<{form}", self.body[self.at - size : self.at])[0]

    def text(self) -> str:
        length = self.number("I")
        self.at += length
        assert self.body[self.at - 1] == 0
        return self.body[self.at - length : self.at - 1].decode()

    def header(self) -> tuple[int, str]:
        """Time [ns] and frame."""
        return self.number("i") * 10**9 + self.number("I"), self.text()

    def end(self) -> None:
        assert self.at == len(self.body)


def joint_state(data: bytes) -> tuple[int, list[str], list[list[float]]]:
    """A sensor_msgs/msg/JointState: time [ns], names; position, velocity, effort."""
    cdr = Cdr(data)
    time, frame = cdr.header()
    assert frame == ""
    names = [cdr.text() for _ in range(cdr.number("I"))]
    arrays = [[cdr.number("d") for _ in range(cdr.number("I"))] for _ in range(3)]
    cdr.end()
    return time, names, arrays


def transforms(data: bytes) -> dict[str, tuple[int, str, Pose]]:
    """A tf2_msgs/msg/TFMessage: time [ns], parent and pose of each frame."""
    cdr, found = Cdr(data), {}
    for _ in range(cdr.number("I")):
        time, parent = cdr.header()
        name = cdr.text()
        a, b, c, x, y, z, w = (cdr.number("d") for _ in range(7))
        found[name] = time, parent, Pose((a, b, c), (w, x, y, z))
    cdr.end()
    return found


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Both arms in motion, cycle by cycle, and what the right gripper shows from the beginning."""
    with RecordingWriter(tmp_path / "session.mcap", EPOCH) as writer:
        for side in Side:
            writer.add_value(f"{side.value}/gripper", 0.0, GRIPPER)
        for both in zip(*(flown(COUNT).frames() for _ in Side), strict=True):
            for side, frame in zip(Side, both, strict=True):
                writer.add_frame(side, frame)
        writer.add_event(recorded_event(LOST, COUNT * CYCLE))
    return tmp_path / "session.mcap"


def messages(file: Path, topic: str) -> list[tuple[Any, Any, Any]]:
    """Schema, channel and message of all on a topic."""
    with file.open("rb") as stream:
        return list(make_reader(stream, validate_crcs=True).iter_messages(topics=[topic]))


def test_joint_states_of_an_arm_are_its_cycles(file: Path) -> None:
    found = messages(file, "l/joint_states")
    schema, channel, message = found[1]
    assert (len(found), schema.name, schema.encoding, channel.message_encoding) == (
        COUNT, "sensor_msgs/msg/JointState", "ros2msg", "cdr",
    )  # fmt: skip
    frame = flown(5).frames()[1]
    time, names, (position, velocity, effort) = joint_state(message.data)
    assert time == message.log_time
    assert names == list(joint_names(Side.LEFT))
    assert (tuple(position), tuple(velocity), effort) == (frame.position, frame.velocity, [])


def test_joint_states_of_the_robot_have_both_arms_and_all_fingers_50_times_a_second(file: Path) -> None:
    found = messages(file, "joint_states")
    assert len(found) == pytest.approx(50 * COUNT * CYCLE, abs=2)
    _, _, message = found[-1]
    time, names, (position, velocity, effort) = joint_state(message.data)
    assert tuple(names) == (*ARM_JOINTS, *FINGER_JOINTS)
    frame = min(flown(COUNT).frames(), key=lambda each: abs((EPOCH + each.time) * 1e9 - time))
    before = flown(COUNT).frames()[frame.number - 2]  # of the left arm, whose cycle comes after the right one's
    assert tuple(position) == (*frame.position, *before.position, *[0.01] * 4)
    assert tuple(velocity) == (*frame.velocity, *before.velocity, *[-0.02] * 4)
    assert effort == []


def test_frames_are_those_that_joints_move_and_lead_to_tool0(file: Path) -> None:
    (schema, channel, message), *_ = messages(file, "/tf")[-1:]
    assert (schema.name, schema.encoding, channel.message_encoding) == ("tf2_msgs/msg/TFMessage", "ros2msg", "cdr")
    moved = transforms(message.data)
    ((_, _, static),) = messages(file, "/tf_static")
    fixed = transforms(static.data)
    described = {each.name: each for each in read_frames(robot_description())}
    assert set(moved) == {name for name, each in described.items() if each.joint}
    assert set(fixed) == set(described) - set(moved)
    assert {time for time, _, _ in moved.values()} == {message.log_time}
    known, name, pose = {**fixed, **moved}, "yumi_tool0_r", Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    while name in known:
        _, name, to_parent = known[name]
        pose = compose_poses(to_parent, pose)
    frame = min(flown(COUNT).frames(), key=lambda each: abs((EPOCH + each.time) * 1e9 - message.log_time))
    assert pose.position == pytest.approx(tool0_to_body(Side.RIGHT, frame.position).position, abs=1e-9)


def test_tracking_error_is_how_far_the_arms_are_from_what_was_sent(file: Path) -> None:
    schema, _, message = messages(file, "tracking_error")[-1]
    error = json.loads(message.data)
    assert list(error) == list(json.loads(schema.data)["properties"])
    frame = min(flown(COUNT).frames(), key=lambda each: abs(each.time - error["time"]))
    assert error["right"] == pytest.approx([a - b for a, b in zip(frame.sent, frame.position, strict=True)], abs=1e-6)


def test_arm_that_is_not_measured_any_more_leaves_the_topics_of_the_robot(tmp_path: Path) -> None:
    with RecordingWriter(tmp_path / "one.mcap", EPOCH) as writer:
        writer.add_joints(Side.LEFT, JointStates(0.0, home(Side.LEFT), (0.0,) * 7))
        for frame in flown(COUNT).frames():
            writer.add_frame(Side.RIGHT, frame)
    counts = [len(joint_state(message.data)[1]) for _, _, message in messages(tmp_path / "one.mcap", "joint_states")]
    assert (counts[0], counts[1], counts[-1]) == (7, 14, 7)
    assert counts == [7, *[14] * counts.count(14), *[7] * (len(counts) - 1 - counts.count(14))]


def test_full_recording_shows_arms_without_egm_where_they_were_read_and_tools_as_they_change(tmp_path: Path) -> None:
    clock, time, tool = ManualClock(), [0.05], [Pose((0.0, 0.0, 0.1), (1.0, 0.0, 0.0, 0.0))]
    sources = Sources(
        {},
        lambda side: JointStates(time[0], home(side), (0.0,) * 7),
        lambda side: tool[0],
    )
    recorders: Mapping[Side, FlightRecorder] = {}
    recorder = FullRecorder(tmp_path / "session.mcap", EPOCH, recorders, lambda sentence: None, clock, sources)
    clock.advance(0.1)
    recorder._follow()
    clock.advance(0.5)
    recorder._follow()  # nothing is new
    clock.advance(0.5)
    time[0], tool[0] = 0.9, Pose((0.0, 0.0, 0.2), (1.0, 0.0, 0.0, 0.0))
    recorder._follow()
    recorder.start()
    recorder.close()
    found = [joint_state(each.data) for _, _, each in messages(tmp_path / "session.mcap", "joint_states")]
    assert [stamp - round(EPOCH * 1e9) for stamp, _, _ in found] == pytest.approx([5e7, 9e8], abs=1e3)
    assert found[-1][2][0] == [*home(Side.RIGHT), *home(Side.LEFT)]
    static = [transforms(each.data) for _, _, each in messages(tmp_path / "session.mcap", "/tf_static")]
    assert "yumi_tcp_l" not in static[0]
    assert [each["yumi_tcp_l"][1:] for each in static[1:]] == [
        ("yumi_tool0_l", Pose((0.0, 0.0, height), (1.0, 0.0, 0.0, 0.0))) for height in (0.1, 0.2)
    ]


def test_rclpy_reads_joint_states_and_frames(file: Path) -> None:
    serialization: Any = pytest.importorskip("rclpy.serialization", reason="needs ROS 2")
    from sensor_msgs.msg import JointState
    from tf2_msgs.msg import TFMessage

    read: Callable[[bytes, Any], Any] = serialization.deserialize_message
    _, _, found = messages(file, "joint_states")[-1]
    state = read(found.data, JointState)
    time, names, (position, velocity, _) = joint_state(found.data)
    assert state.header.stamp.sec * 10**9 + state.header.stamp.nanosec == time
    assert (list(state.name), list(state.position), list(state.velocity)) == (names, position, velocity)
    for topic in ("/tf", "/tf_static"):
        _, _, found = messages(file, topic)[-1]
        for each in read(found.data, TFMessage).transforms:
            time, parent, pose = transforms(found.data)[each.child_frame_id]
            assert (each.header.stamp.sec * 10**9 + each.header.stamp.nanosec, each.header.frame_id) == (time, parent)
            place, turn = each.transform.translation, each.transform.rotation
            assert Pose((place.x, place.y, place.z), (turn.w, turn.x, turn.y, turn.z)) == pose


def test_definitions_are_those_of_ros(file: Path) -> None:
    """Field by field, against the message packages: a reader without ROS decodes by the definition in the file."""
    pytest.importorskip("tf2_msgs.msg", reason="needs ROS 2")
    checked = set()
    for topic in ("joint_states", "/tf", "robot_description"):
        schema, _, _ = messages(file, topic)[0]
        name, *parts = schema.data.decode().split("\n" + 80 * "=" + "\nMSG: ")
        for part in (f"{schema.name}\n{name}", *parts):
            kind, *lines = part.split("\n")
            own = {words[1]: words[0] for words in map(str.split, lines)}
            package, *_, message = kind.split("/")
            known = getattr(import_module(f"{package}.msg"), message).get_fields_and_field_types()
            plain = {field: type_.replace("sequence<", "").replace(">", "") for field, type_ in known.items()}
            assert {
                field: type_.removesuffix("[]").replace("float64", "double") for field, type_ in own.items()
            } == plain, kind
            assert [type_.endswith("[]") for type_ in own.values()] == ["sequence" in type_ for type_ in known.values()]
            checked.add(kind)
    assert len(checked) == 9


def test_recording_from_before_these_topics_is_read_all_the_same(file: Path, tmp_path: Path) -> None:
    new = ("joint_states", "/tf", "/tf_static", "tracking_error")
    with file.open("rb") as source, (tmp_path / "old.mcap").open("wb") as target:
        writer, channels = Writer(target), {}
        writer.start()
        for schema, channel, message in make_reader(source).iter_messages():
            if channel.topic in new:
                continue
            assert schema is not None
            if channel.topic not in channels:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, channel.message_encoding, number)
            writer.add_message(channels[channel.topic], message.log_time, message.data, message.log_time)
        writer.finish()
    assert read_recording(tmp_path / "old.mcap") == read_recording(file)


def test_events_are_foxglove_logs_and_the_urdf_is_at_the_start(file: Path) -> None:
    ((schema, _, _),) = messages(file, "events")
    assert schema.name == "foxglove.Log"
    ((schema, _, description),) = messages(file, "robot_description")
    assert schema.name == "std_msgs/msg/String"
    assert b'<robot name="yumi">' in description.data
    assert description.log_time == round(EPOCH * 1e9)
