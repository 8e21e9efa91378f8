"""Logs of every form give the same motion; what is none is refused in one sentence."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from virtual_logs import HOME

from abb_protocols.errors import CommandRefused, YumiError
from abb_protocols.robot.joints import CYCLE, Side, joint_names, joints
from refusals import refused
from yumi.control.flight_recorder import RecordedCycle
from yumi.control.stage_times import StageTimes
from yumi.recording.writer import RecordingWriter
from yumi_evaluation.logs import read_logs

COUNT = 120
NAMES = [f"joint_{number}" for number in range(1, 8)]
COMMANDS = HOME + 0.001 * np.arange(COUNT)[:, None] * np.arange(7)
MEASURED = HOME + 0.0009 * np.arange(COUNT)[:, None] * np.arange(7)


def frame(number: int, dt: float, session: int = 1, cycle: int | None = None) -> RecordedCycle:
    """What was recorded of a cycle; ``cycle`` is the number of its datagram where others were lost."""
    return RecordedCycle(
        number=(number if cycle is None else cycle) + 1, time=10.0 + number * CYCLE, dt=dt, session=session,
        is_running=True, position=joints(MEASURED[number]), velocity=joints([0.0] * 7),
        planned=joints(MEASURED[number]), desired=None, sent=joints(COMMANDS[number]),
        sent_velocity=joints([0.1] * 7), reference=None, stages=StageTimes(*(0.0,) * 7),
    )  # fmt: skip


def recorded(file: Path, lost: int | None = None, session: int = 1) -> None:
    """A recording of all cycles; the datagram of one of them did not arrive, and so was no cycle of the driver."""
    arrived = [number for number in range(COUNT) if number != lost]
    with RecordingWriter(file, 1.7e9) as writer:
        for cycle, number in enumerate(arrived):
            dt = 2.0 * CYCLE if lost is not None and number == lost + 1 else CYCLE
            writer.add_frame(Side.LEFT, frame(number, dt, session, cycle))


def test_recording_gives_positions_and_what_was_sent(tmp_path: Path) -> None:
    recorded(tmp_path / "session.mcap")
    (log,) = read_logs(tmp_path / "session.mcap").motions
    assert log.name == "left arm"
    assert np.allclose(log.measured, MEASURED)
    assert np.allclose(log.commands, COMMANDS)
    assert log.speeds is not None
    assert np.allclose(log.speeds, 0.1)
    assert log.cycle == pytest.approx(CYCLE)


def test_cycle_that_was_lost_is_a_row_less_and_no_command(tmp_path: Path) -> None:
    recorded(tmp_path / "session.mcap", lost=50)
    (log,) = read_logs(tmp_path / "session.mcap").motions
    assert list(log.rows[49:52]) == [49.0, 51.0, 52.0]
    assert np.isnan(log.commands[50]).all()
    assert np.allclose(log.commands[51], COMMANDS[51])


def test_cycles_that_were_not_recorded_divide_a_motion(tmp_path: Path) -> None:
    with RecordingWriter(tmp_path / "session.mcap", 1.7e9) as writer:
        for number in range(COUNT):
            if number != 50:
                writer.add_frame(Side.LEFT, frame(number, CYCLE))
    first, second = read_logs(tmp_path / "session.mcap").motions
    assert (len(first.rows), len(second.rows)) == (50, COUNT - 51)
    assert np.allclose(second.commands, COMMANDS[51:])


def test_folder_of_recordings_gives_the_motions_of_all(tmp_path: Path) -> None:
    recorded(tmp_path / "step.mcap")
    recorded(tmp_path / "ramp.mcap", session=2)
    motions = read_logs(tmp_path).motions
    assert [log.name for log in motions] == ["ramp, left arm", "step, left arm"]
    assert np.allclose(motions[1].measured, MEASURED)


def table(file: Path, values: np.ndarray, unit: str = "rad", times: np.ndarray | None = None) -> Path:
    rows = np.arange(len(values)) * CYCLE if times is None else times
    header = ",".join(["time_s", *(f"{name}_{unit}" for name in NAMES)])
    lines = [
        ",".join(f"{each!r}" for each in map(float, (5.0 + time, *row))) for time, row in zip(rows, values, strict=True)
    ]
    file.write_text("\n".join([header, *lines]) + "\n")
    return file


def test_table_in_degrees_and_commands_in_radians_give_radians(tmp_path: Path) -> None:
    joints_file = table(tmp_path / "joints.csv", np.degrees(MEASURED), "deg")
    (log,) = read_logs(joints_file, table(tmp_path / "commands.csv", COMMANDS)).motions
    assert np.allclose(log.measured, MEASURED)
    assert np.allclose(log.commands, COMMANDS)
    assert log.joints == tuple(NAMES)


def test_table_that_is_slower_than_the_robot_has_rows_between_cycles(tmp_path: Path) -> None:
    times = np.arange(COUNT) * 0.01
    joints_file = table(tmp_path / "joints.csv", MEASURED, times=times)
    (log,) = read_logs(joints_file, table(tmp_path / "commands.csv", COMMANDS, times=times)).motions
    assert log.rows[1] == pytest.approx(0.01 / CYCLE)
    assert np.allclose(log.commands[2], COMMANDS[1])  # sent at 10 ms, in the third cycle
    assert np.isnan(log.commands[1]).all()


def folder(where: Path, **changes: Any) -> Path:
    """A record of a straight curve, and a section of it."""
    knots = "\n".join(f"{500 * n}," + ",".join(f"{0.1 * n + j:.6f}" for j in range(7)) for n in range(11))
    where.mkdir(exist_ok=True)
    header = ",".join(f"{name}_rad" for name in NAMES)
    (where / "command_knots.csv").write_text(f"curve_index,{header}\n{knots}\n")
    start = np.arange(7.0) - 0.5
    table(where / "one.csv", np.tile(start, (60, 1)))
    table(where / "one_later.csv", np.tile(start + 1.0, (30, 1)))
    record = {"record": "one", "robot": "IRB X", "points_sent": 500, "run_up": True, "cycle_s": 0.004, "first_row": 0}
    later = {**record, "record": "one_later", "section_of": "one", "first_row": 300, **changes}
    (where / "records.json").write_text(json.dumps([record, later]))
    return where


def test_folder_gives_the_run_up_the_curve_and_sections(tmp_path: Path) -> None:
    one, later = read_logs(folder(tmp_path / "records")).motions
    assert one.robot == "IRB X"
    assert np.allclose(one.commands[0], one.start)
    assert np.allclose(one.commands[50], one.start + 0.25)  # half of the way to the curve
    assert len(later.commands) == 330
    assert list(later.rows[[0, -1]]) == [300.0, 329.0]
    assert np.allclose(later.start, one.start)
    index = int(np.linspace(0.0, 4999.0, 500)[200])
    assert np.allclose(later.commands[300], np.arange(7) + 0.1 * index / 500.0)


def test_section_without_a_first_row_is_placed_by_time(tmp_path: Path) -> None:
    where = folder(tmp_path / "records", first_row=None)
    table(where / "one_later.csv", np.zeros((30, 7)), times=1.2 + np.arange(30) * 0.004)
    assert read_logs(where).motions[1].rows[0] == 300.0


def test_record_whose_file_is_missing_is_left_out_with_a_sentence(tmp_path: Path) -> None:
    where = folder(tmp_path / "records")
    (where / "one_later.csv").unlink()
    logs = read_logs(where)
    assert [each.name for each in logs.motions] == ["one"]
    assert logs.left_out == ("one_later is left out: one_later.csv is not there.",)


def cdr_array(values: np.ndarray) -> bytes:
    """A std_msgs/Float64MultiArray without dimensions."""
    return b"\0\1\0\0" + struct.pack("<III", 0, 0, len(values)) + b"\0" * 4 + values.astype("<f8").tobytes()


def test_topics_of_ros_give_states_and_commands(tmp_path: Path) -> None:
    from mcap.writer import Writer

    from yumi.recording.ros_messages import joint_names_part, joint_state_message

    file = tmp_path / "bag.mcap"
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        state = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", b"")
        array = writer.register_schema("std_msgs/msg/Float64MultiArray", "ros2msg", b"")
        states = writer.register_channel("/r/joint_states", "cdr", state)
        commands = writer.register_channel("/r/forward_position_controller/commands", "cdr", array)
        names = joint_names_part(joint_names(Side.RIGHT))
        for number in range(COUNT):
            at = 1_000_000_000 + round(number * CYCLE * 1e9)
            message = joint_state_message(names, at, joints(MEASURED[number]), joints([0.0] * 7))
            writer.add_message(states, at, message, at)
            writer.add_message(commands, at + 1_000_000, cdr_array(COMMANDS[number]), at)
        writer.finish()
    (log,) = read_logs(file).motions
    assert log.joints[0] == "yumi_joint_1_r"
    assert np.allclose(log.measured, MEASURED)
    assert np.allclose(log.commands[:-1], COMMANDS[:-1])  # the last one came after the last state


def emptied(where: Path) -> Path:
    (where / "empty.mcap").touch()
    return where / "empty.mcap"


def cut(where: Path) -> Path:
    file = table(where / "cut.csv", MEASURED)
    file.write_text(file.read_text()[:-20])
    return file


def damaged(where: Path) -> Path:
    (where / "bad.mcap").write_bytes(b"\x89MCAP0\r\n" + b"\xff" * 300)
    return where / "bad.mcap"


def without_records(where: Path) -> Path:
    (where / "nothing").mkdir()
    return where / "nothing"


@pytest.mark.parametrize(
    ("made", "code", "values"),
    [
        (lambda where: where / "none.mcap", "log_missing", {}),
        (emptied, "log_empty", {}),
        (damaged, "recording_damaged", {}),
        (cut, "table_line_incomplete", {"line": 121, "count": 8}),
        (
            lambda where: table(where / "same.csv", MEASURED, times=np.zeros(COUNT)),
            "table_times_not_increasing",
            {"line": 3},
        ),
        (lambda where: table(where / "short.csv", MEASURED[:10]), "log_too_short", {"rows": 10, "least": 40}),
        (without_records, "no_folder_of_records", {"file": "records.json"}),
        (
            lambda where: folder(where / "records", points_sent=9000),
            "record_out_of_range",
            {"points": 9000, "most": 5000.0},
        ),
        (lambda where: Path(__file__), "no_log", {}),
    ],
)  # fmt: skip
def test_what_is_no_log_is_refused_with_one_sentence(
    tmp_path: Path, made: Any, code: str, values: dict[str, Any]
) -> None:
    path = made(tmp_path)
    commands = table(tmp_path / "commands.csv", COMMANDS) if path.suffix == ".csv" else None
    with refused(YumiError, code, **values) as refusal:
        read_logs(path, commands)
    assert "\n" not in str(refusal.value)


def test_table_without_commands_or_with_those_of_other_joints_is_refused(tmp_path: Path) -> None:
    file = table(tmp_path / "joints.csv", MEASURED)
    with refused(CommandRefused, "table_without_commands", file=str(file)):
        read_logs(file)
    other = tmp_path / "other.csv"
    other.write_text("time_s,elbow_rad\n0.0,1.0\n")
    with refused(CommandRefused, "commands_of_other_joints", file=str(other)):
        read_logs(file, other)
    bare = tmp_path / "bare.csv"
    bare.write_text("time_s,joint_1\n0.0,1.0\n")
    with refused(CommandRefused, "table_header_wrong", file=str(bare), header="time_s,joint_1", first="time_s"):
        read_logs(bare, file)
