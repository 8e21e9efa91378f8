"""Recordings as tables, and what other programs find in the file."""

from __future__ import annotations

import csv
import math
import sys
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from mcap.reader import make_reader

import yumi
from flight import LOST, flown
from refusals import refused
from yumi.cli.main import main
from yumi.clock import ManualClock
from yumi.driver.readiness import RobotState
from yumi.errors import CommandRefused, MissingPrerequisite
from yumi.recording.mcap import FullRecorder, RecordingWriter, joint_state_message, recorded_event
from yumi.recording.tables import export, rows
from yumi.robot.gripper import GripperState, ServoState
from yumi.robot.joints import Side, joint_names
from yumi.rws.types import OperatingMode

EPOCH = 1_800_000_000.0
GRIPPER = GripperState(ServoState.KEEP_OBJECT, 0, True, 0.01, 0.0, 20.0)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    with RecordingWriter(tmp_path / "session.mcap", EPOCH) as writer:
        for side in Side:
            for frame in flown(5).frames():
                writer.add_frame(side, frame)
        writer.add_event(recorded_event(LOST, 0.1))
        writer.add_value("l/gripper", 0.05, GRIPPER)
        writer.add_value("state", 0.06, RobotState(is_connected=True, operating_mode=OperatingMode.AUTO))
    return tmp_path / "session.mcap"


def test_cycles_have_a_column_for_each_axis_with_what_was_recorded(file: Path) -> None:
    found = list(rows(file))
    assert [(row["arm"], row["number"]) for row in found[:1] + found[-1:]] == [("right", 1), ("left", 5)]
    frame = flown(5).frames()[3]
    assert found[3]["position_7"] == frame.position[2]
    assert found[3]["time"] == pytest.approx(frame.time - flown(5).frames()[0].time, abs=1e-6)
    assert math.isnan(found[0]["desired_1"])  # the first cycle of the fixture holds


def test_events_grippers_and_state_are_tables_too(file: Path) -> None:
    (event,), (gripper,), (state,) = (list(rows(file, what)) for what in ("events", "grippers", "state"))
    assert (event["arm"], event["kind"], event["is_fault"]) == ("right", "SessionLost", True)
    assert (gripper["arm"], gripper["state"], gripper["position"]) == ("left", "KEEP_OBJECT", 0.01)
    assert (state["operating_mode"], state["is_connected"], state["egm.r"]) == ("AUTO", True, "off")


def test_unknown_table_is_refused(file: Path) -> None:
    known = ("cycles", "events", "grippers", "state")
    with refused(CommandRefused, "recording_without_table", table="faults", known=known):
        list(rows(file, "faults"))  # type: ignore[arg-type]


@pytest.mark.parametrize(("table", "count"), [("cycles", 10), ("events", 1), ("grippers", 1), ("state", 1)])
def test_export_writes_every_row_as_csv(file: Path, tmp_path: Path, table: str, count: int) -> None:
    output = tmp_path / "out" / "table.csv"
    result = CliRunner().invoke(main, ["record", "export", str(file), str(output), "--table", table])
    assert result.output == f"{count} rows: {output}\n"
    with output.open() as stream:
        assert len(list(csv.DictReader(stream))) == count


def test_export_refuses_other_endings_and_empty_tables(tmp_path: Path, file: Path) -> None:
    with refused(CommandRefused, "table_format_unknown"):
        export(file, tmp_path / "table.xlsx")
    with RecordingWriter(tmp_path / "cycles.mcap", EPOCH) as writer:
        writer.add_frame(Side.LEFT, flown(1).frames()[0])
    with refused(CommandRefused, "recording_without_rows", table="grippers"):
        export(tmp_path / "cycles.mcap", tmp_path / "table.csv", "grippers")
    assert not (tmp_path / "table.csv").exists()


def test_missing_pandas_is_reported_with_the_extra(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with refused(MissingPrerequisite, "extra_missing", extra="data"):
        yumi.read_recording(file)


def test_data_frame_is_indexed_by_time_of_day(file: Path) -> None:
    pytest.importorskip("pandas", reason="needs yumi-ros2[data]")
    cycles = yumi.read_recording(str(file))
    assert len(cycles[cycles.arm == "right"]) == 5
    assert cycles.index[0].timestamp() == pytest.approx(EPOCH + flown(5).frames()[0].time)
    assert cycles.position_7.dtype == "float64"


def test_parquet_gives_back_the_data_frame(file: Path, tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas", reason="needs yumi-ros2[data]")
    pytest.importorskip("pyarrow", reason="needs yumi-ros2[data]")
    for table in ("cycles", "grippers"):
        output = tmp_path / f"{table}.parquet"
        export(file, output, table)  # type: ignore[arg-type]
        pandas.testing.assert_frame_equal(pandas.read_parquet(output), yumi.read_recording(file, table))


def read_joint_state(data: bytes) -> tuple[int, list[str], list[list[float]]]:
    """A sensor_msgs/msg/JointState, decoded by the rules of CDR: time [ns], names, position, velocity, effort."""
    assert data[:4] == b"\x00\x01\x00\x00"
    body, place = data[4:], 0

    def number(size: int) -> int:
        nonlocal place
        place += -place % size
        place += size
        return int.from_bytes(body[place - size : place], "little")

    def text() -> str:
        nonlocal place
        length = number(4)
        place += length
        assert body[place - 1] == 0
        return body[place - length : place - 1].decode()

    time = number(4) * 10**9 + number(4)
    assert text() == ""
    names = [text() for _ in range(number(4))]
    arrays: list[list[float]] = []
    for _ in range(3):
        values = [number(8) for _ in range(number(4))]
        arrays.append([memoryview(each.to_bytes(8, "little")).cast("d")[0] for each in values])
    assert place == len(body)
    return time, names, arrays


def test_joint_states_are_the_ros_message_that_foxglove_plots(file: Path) -> None:
    with file.open("rb") as stream:
        found = list(make_reader(stream).iter_messages(topics=["l/joint_states"]))
    schema, channel, message = found[1]
    assert schema is not None
    assert (schema.name, schema.encoding, channel.message_encoding) == ("sensor_msgs/msg/JointState", "ros2msg", "cdr")
    frame = flown(5).frames()[1]
    time, names, (position, velocity, effort) = read_joint_state(message.data)
    assert time == message.log_time
    assert names == list(joint_names(Side.LEFT))
    assert (tuple(position), tuple(velocity), effort) == (frame.position, frame.velocity, [])


def test_joint_state_can_be_read_by_rclpy() -> None:
    serialization: Any = pytest.importorskip("rclpy.serialization", reason="needs ROS 2")
    from sensor_msgs.msg import JointState

    from yumi.recording.mcap import _cdr_start

    frame = flown(2).frames()[1]
    data = joint_state_message(_cdr_start(Side.RIGHT), 1_500_000_000, frame.position, frame.velocity)
    message = serialization.deserialize_message(data, JointState)
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (1, 500_000_000)
    assert message.name == list(joint_names(Side.RIGHT))
    assert tuple(message.position) == frame.position


def test_events_are_foxglove_logs_and_the_urdf_is_at_the_start(file: Path) -> None:
    with file.open("rb") as stream:
        messages = {channel.topic: (schema, each) for schema, channel, each in make_reader(stream).iter_messages()}
    assert messages["events"][0].name == "foxglove.Log"  # type: ignore[union-attr]
    schema, description = messages["robot_description"]
    assert schema is not None
    assert schema.name == "std_msgs/msg/String"
    assert b'<robot name="yumi">' in description.data
    assert description.log_time == round((EPOCH + flown(5).frames()[0].time) * 1e9)


def test_full_recording_holds_what_changed_of_grippers_and_state(tmp_path: Path) -> None:
    clock, shown = ManualClock(), [GRIPPER, None]
    recorder = FullRecorder(
        tmp_path / "session.mcap", EPOCH, {}, lambda sentence: None, clock, {"r/gripper": lambda: shown[0]}
    )
    recorder._follow()
    recorder._follow()  # the same, and too soon
    clock.advance(0.2)
    shown[0] = GripperState(ServoState.READY, 0, True, 0.02, 0.0, 0.0)
    recorder._follow()
    recorder.start()
    recorder.close()
    assert [row["position"] for row in rows(tmp_path / "session.mcap", "grippers")] == [0.01, 0.02]
