"""Recordings as tables."""

from __future__ import annotations

import csv
import math
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

import yumi
from abb_protocols.errors import CommandRefused, MissingPrerequisite
from abb_protocols.robot.gripper_values import GripperState, ServoState
from abb_protocols.robot.joints import Side
from abb_protocols.rws.values import OperatingMode
from abb_runtime.clock import ManualClock
from flight import LOST, flown
from refusals import refused
from yumi.cli.main import main
from yumi.driver.robot_state import RobotState
from yumi.recording.message_types import recorded_event
from yumi.recording.recorder import FullRecorder, Sources
from yumi.recording.tables import export, rows
from yumi.recording.writer import RecordingWriter

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


def test_full_recording_holds_what_changed_of_grippers_and_state(tmp_path: Path) -> None:
    clock, shown = ManualClock(), [GRIPPER, None]
    recorder = FullRecorder(
        tmp_path / "session.mcap", EPOCH, {}, lambda sentence: None, clock, Sources({"r/gripper": lambda: shown[0]})
    )
    recorder._follow()
    recorder._follow()  # the same, and too soon
    clock.advance(0.2)
    shown[0] = GripperState(ServoState.READY, 0, True, 0.02, 0.0, 0.0)
    recorder._follow()
    recorder.start()
    recorder.close()
    assert [row["position"] for row in rows(tmp_path / "session.mcap", "grippers")] == [0.01, 0.02]
