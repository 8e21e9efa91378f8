"""What the page shows of a recording."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from time import localtime, strftime

import pytest

from abb_protocols.catalogue import message, sentence
from abb_protocols.errors import ProtocolError
from abb_protocols.robot.gripper_values import GripperState, ServoState
from abb_protocols.robot.joints import Side
from abb_protocols.rws.values import OperatingMode
from flight import CYCLE, LOST, SENTENCE, flown, write_flight_record
from refusals import refused
from yumi.driver.robot_state import RobotState
from yumi.recording.message_types import recorded_event
from yumi.recording.writer import RecordingWriter
from yumi.web import page_recording as recording_of_page
from yumi.web.page_recording import page_recording


def test_motion_and_event_of_a_flight_record_are_there(tmp_path: Path) -> None:
    file, frames = tmp_path / "stopped.mcap", flown(500).frames()
    write_flight_record(file, 1.8e9, recorded_event(LOST, frames[-1].time), {Side.RIGHT: tuple(frames)})
    shown = page_recording(file)
    right, (event,) = shown["arms"]["right"], shown["events"]
    assert shown["duration"] == pytest.approx(frames[-1].time - frames[0].time)
    assert shown["start"] == pytest.approx(1.8e9 + frames[0].time)
    assert shown["is_complete"]
    assert len(right["time"]) == len(right["position"]) == 100
    assert right["position"][0] == pytest.approx(frames[0].position, abs=1e-5)
    assert event["sentence"].startswith(SENTENCE)
    assert (event["side"], event["is_fault"]) == ("right", True)
    assert event["time"] == pytest.approx(shown["duration"])
    assert shown["arms"]["left"]["time"] == []


def test_long_recording_is_thinned_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording_of_page, "MAX_SAMPLES", 50)
    file, frames = tmp_path / "long.mcap", flown(2000).frames()
    write_flight_record(file, 0.0, recorded_event(LOST, frames[-1].time), {Side.LEFT: tuple(frames)})
    times = page_recording(file)["arms"]["left"]["time"]
    assert 25 <= len(times) <= 50
    assert times[-1] > 0.9 * (frames[-1].time - frames[0].time)


def test_grippers_have_times_from_the_beginning(tmp_path: Path) -> None:
    file = tmp_path / "grip.mcap"
    with RecordingWriter(file, 0.0) as writer:
        for time, position in ((10.0, 0.0), (12.5, 0.011)):
            state = GripperState(ServoState.KEEP_OBJECT, 0, True, position, 0.0, 10.0)
            writer.add_value("l/gripper", time, state)
    first, second = page_recording(file)["grippers"]["left"]
    assert (first["time"], second["time"]) == (0.0, 2.5)
    assert (second["position"], second["state"]) == (0.011, "KEEP_OBJECT")


def write_session(file: Path, *states: RobotState, every: float = 2.0) -> None:
    """The states of a session from 100 s on, ``every`` so many seconds; cycles of an arm with the last one."""
    with RecordingWriter(file, 1.8e9) as writer:
        for number, state in enumerate(states):
            writer.add_value("state", 100.0 + every * number, state)
        for frame in flown(10).frames():
            moved = replace(frame, time=frame.time + 100.0 + every * (len(states) - 1))
            writer.add_frame(Side.RIGHT, moved)


def test_recording_begins_where_the_robot_was_connected(tmp_path: Path) -> None:
    silent = RobotState(is_connected=False)
    connected = RobotState(is_connected=True, operating_mode=OperatingMode.AUTO)
    write_session(tmp_path / "session.mcap", silent, silent, connected, silent, connected)
    shown = page_recording(tmp_path / "session.mcap")
    assert [(each["time"], each["is_connected"]) for each in shown["states"]] == [
        (0.0, True),
        (2.0, False),
        (4.0, True),
    ]
    assert shown["start"] == pytest.approx(1.8e9 + 104.0)
    assert shown["duration"] == pytest.approx(4.0 + 10 * CYCLE)
    assert shown["arms"]["right"]["time"][0] == pytest.approx(4.0 + CYCLE)


def test_what_was_known_first_is_shown_from_the_first_cycle_on(tmp_path: Path) -> None:
    with RecordingWriter(tmp_path / "session.mcap", 1.8e9) as writer:
        for frame in flown(50).frames():
            writer.add_frame(Side.RIGHT, frame)
        writer.add_value("state", 0.1, RobotState(is_connected=True))
    shown = page_recording(tmp_path / "session.mcap")
    assert shown["states"][0]["time"] == shown["arms"]["right"]["time"][0] == 0.0


def test_gripper_that_was_read_after_the_robot_was_connected_is_shown_from_the_beginning(tmp_path: Path) -> None:
    with RecordingWriter(tmp_path / "session.mcap", 0.0) as writer:
        writer.add_value("state", 100.0, RobotState(is_connected=True))
        for time, position in ((101.2, 0.0), (104.0, 0.011)):
            writer.add_value("r/gripper", time, GripperState(ServoState.READY, 0, True, position, 0.0, 10.0))
    shown = page_recording(tmp_path / "session.mcap")["grippers"]["right"]
    assert [(each["time"], each["position"]) for each in shown] == [(0.0, 0.0), (4.0, 0.011)]


def test_recording_of_a_robot_that_never_answered_shows_that(tmp_path: Path) -> None:
    with RecordingWriter(tmp_path / "session.mcap", 1.8e9) as writer:
        writer.add_value("state", 100.0, RobotState(is_connected=False))
    shown = page_recording(tmp_path / "session.mcap")
    assert [(each["time"], each["is_connected"]) for each in shown["states"]] == [(0.0, False)]


def test_why_the_robot_did_not_move_and_what_stopped_it_are_sentences(tmp_path: Path) -> None:
    stop = message("event_10013", number=10013, title="Emergency stop")
    pressed = message("emergency_stop_pressed")
    write_session(tmp_path / "session.mcap", RobotState(is_connected=True, reasons=(pressed,), causes=(stop,)))
    (state,) = page_recording(tmp_path / "session.mcap")["states"]
    assert (state["reasons"], state["causes"]) == ([sentence(pressed)], [sentence(stop)])


def test_recording_has_its_name_and_its_date_on_this_machine_s_clock(tmp_path: Path) -> None:
    write_session(tmp_path / "session.mcap", RobotState(is_connected=True))
    shown = page_recording(tmp_path / "session.mcap")
    assert (shown["name"], shown["date"]) == ("session.mcap", strftime("%Y-%m-%d %H:%M", localtime(1.8e9 + 100.0)))


def test_file_that_is_no_recording_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.mcap").write_text("no")
    with refused(ProtocolError, "recording_damaged", file=str(tmp_path / "x.mcap")):
        page_recording(tmp_path / "x.mcap")
