from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from threading import Event as Flag

import pytest

from abb_protocols.errors import ProtocolError, SettingsError
from abb_protocols.robot.joints import Side
from abb_runtime.clock import ManualClock, SystemClock, comes_true
from flight import CYCLE, LOST, flown, record_motion
from refusals import refused
from yumi.control.flight_recorder import RECORDED_CYCLES, FlightRecorder
from yumi.control.loop_events import (
    ControllerFailed,
    ControlProcessEnded,
    CycleFailed,
    Event,
    RobotFollows,
    RobotStoppedFollowing,
    SessionLost,
    SessionStarted,
)
from yumi.recording.message_types import RecordedEvent
from yumi.recording.reader import FLIGHT_RECORD_AFTER, read_recording
from yumi.recording.recorder import FullRecorder, Recorder
from yumi.recording.writer import RecordingWriter

RIGHT, LEFT = Side.RIGHT, Side.LEFT
EPOCH = 1_800_000_000.0


@pytest.fixture
def recorders() -> dict[Side, FlightRecorder]:
    return {RIGHT: flown(50), LEFT: flown(7)}


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def records(tmp_path: Path, recorders: dict[Side, FlightRecorder], said: list[str]) -> Recorder:
    return Recorder(tmp_path / "flights", 3, recorders, said.append, SystemClock())


def files(folder: Path) -> list[Path]:
    return sorted((folder / "flights").glob("*"))


@pytest.mark.parametrize(
    "event",
    [
        LOST,
        RobotStoppedFollowing(RIGHT, ("joint_position_controller",)),
        ControllerFailed(RIGHT, "Controller 'x' failed."),
        CycleFailed(RIGHT, "OSError: no route"),
        ControlProcessEnded(RIGHT, -9),
    ],
)
def test_whatever_stops_a_motion_leaves_a_record(
    records: Recorder, recorders: dict[Side, FlightRecorder], said: list[str], tmp_path: Path, event: Event
) -> None:
    records.on_event(event, 0.25, EPOCH)
    records.close()
    (file,) = files(tmp_path)
    assert said == [f"The last 0.2 s of the right arm are in {file}: yumi record show {file}"]
    recording = read_recording(file)
    assert recording.frames == {RIGHT: recorders[RIGHT].frames()}
    assert recording.stop is not None
    assert (recording.stop.sentence, recording.stop.time) == (str(event), 0.25)


@pytest.mark.parametrize(
    "event",
    [SessionStarted(RIGHT, 1), RobotFollows(RIGHT), SessionLost(RIGHT, 0.05, ()), RobotStoppedFollowing(RIGHT, ())],
)
def test_what_was_ordered_leaves_no_record(records: Recorder, tmp_path: Path, event: Event) -> None:
    records.on_event(event, 0.25, EPOCH)
    records.close()
    assert files(tmp_path) == []


def test_record_goes_on_after_the_event_until_it_is_in_the_middle_of_the_picture(
    recorders: dict[Side, FlightRecorder], said: list[str], tmp_path: Path
) -> None:
    stop = 1.2
    records = Recorder(tmp_path / "flights", 3, recorders, said.append, ManualClock(stop))
    records.on_event(LOST, stop, EPOCH)
    record_motion(recorders[RIGHT], 1000)  # until 4.2 s
    records.close()
    frames = read_recording(files(tmp_path)[0]).frames[RIGHT]
    assert [frame.number for frame in frames] == list(range(1, len(frames) + 1))
    assert frames[-1].time == pytest.approx(stop + FLIGHT_RECORD_AFTER, abs=CYCLE)
    assert said[0].startswith("The last 0.2 s of the right arm, and 2.0 s after the stop, are in ")


CAUSE = f"{LOST} Cause: motion supervision of the right arm (50204)."


def test_record_and_recording_say_what_became_known_of_the_cause(
    recorders: dict[Side, FlightRecorder], said: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[Event, Callable[[str], None]]] = []
    records = Recorder(
        tmp_path / "flights", 3, recorders, said.append, SystemClock(), lambda event, then: asked.append((event, then))
    )
    records.record_all(tmp_path / "session.mcap", EPOCH)
    begun = []

    def explain(seconds: float) -> None:
        begun.append(read_recording(*files(tmp_path)).stop)
        ((event, then),) = asked
        assert event is LOST
        then(CAUSE)

    monkeypatch.setattr(records._is_over, "wait", explain)
    records.on_event(LOST, 0.25, EPOCH)
    records.close()
    assert [stop and stop.sentence for stop in begun] == [str(LOST)]
    for file in (*files(tmp_path), tmp_path / "session.mcap"):
        stop = read_recording(file).stop
        assert stop == RecordedEvent(0.25, RIGHT, "SessionLost", CAUSE, is_fault=True)
    assert len(read_recording(files(tmp_path)[0]).frames[RIGHT]) == 50


def test_record_whose_cause_stays_unknown_says_what_is_known(
    recorders: dict[Side, FlightRecorder], said: list[str], tmp_path: Path
) -> None:
    clock = ManualClock(0.25)
    records = Recorder(tmp_path / "flights", 3, recorders, said.append, clock, lambda event, then: None)
    records.record_all(tmp_path / "session.mcap", EPOCH)
    records.on_event(LOST, 0.25, EPOCH)
    records.close()
    for file in (*files(tmp_path), tmp_path / "session.mcap"):
        stop = read_recording(file).stop
        assert stop is not None
        assert stop.sentence == str(LOST)


def test_record_is_complete_on_the_disk_before_it_goes_on(
    recorders: dict[Side, FlightRecorder], said: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    records = Recorder(tmp_path / "flights", 3, recorders, said.append, SystemClock())
    seen = []
    monkeypatch.setattr(records._is_over, "wait", lambda seconds: seen.append(read_recording(*files(tmp_path))))
    records.on_event(LOST, 0.25, EPOCH)
    records.close()
    assert seen[0].is_complete
    assert seen[0].stop is not None
    assert [frame.number for frame in seen[0].frames[RIGHT]] == list(range(1, 51))
    assert len(files(tmp_path)) == 1


def test_every_record_is_begun_while_others_wait_for_what_follows(
    records: Recorder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A driver may be killed after the third fault as well as after the first."""
    go_on = Flag()
    monkeypatch.setattr(records._is_over, "wait", lambda seconds: go_on.wait(30.0))
    for second in range(3):
        records.on_event(LOST, 0.25, EPOCH + second)
    try:
        assert comes_true(SystemClock(), lambda: len(files(tmp_path)) == 3 and is_whole(files(tmp_path)[2]), 5.0)
    finally:
        go_on.set()
        records.close()


def is_whole(file: Path) -> bool:
    try:
        recording = read_recording(file)
    except ProtocolError:  # nothing is in it yet
        return False
    return recording.is_complete and recording.stop is not None


def test_record_whose_rest_cannot_be_written_keeps_what_led_to_the_stop(
    recorders: dict[Side, FlightRecorder], said: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    records = Recorder(tmp_path / "flights", 3, recorders, said.append, ManualClock(0.25))
    add_event = RecordingWriter.add_event

    def fail_on_a_full_disk(writer: RecordingWriter, event: RecordedEvent) -> None:
        if len(files(tmp_path)) > 1:
            raise OSError(28, "No space left on device")
        add_event(writer, event)

    monkeypatch.setattr(RecordingWriter, "add_event", fail_on_a_full_disk)
    monkeypatch.setattr(records._is_over, "wait", lambda seconds: record_motion(recorders[RIGHT], 20))
    records.on_event(LOST, 0.25, EPOCH)
    records.close()
    (file,) = files(tmp_path)
    assert is_whole(file)
    assert said == [
        f"What followed the stop could not be written: [Errno 28] No space left on device. What led to it is in {file}."
    ]


def test_record_leaves_out_what_was_long_before(
    records: Recorder, recorders: dict[Side, FlightRecorder], tmp_path: Path
) -> None:
    records.on_event(LOST, 0.101 + 11.0, EPOCH)
    records.close()
    assert read_recording(files(tmp_path)[0]).frames[RIGHT] == recorders[RIGHT].frames()[25:]


def test_oldest_records_make_room(records: Recorder, tmp_path: Path) -> None:
    for second in range(5):
        records.on_event(LOST, 0.25, EPOCH + second)
    records.close()
    assert len(files(tmp_path)) == 3
    assert read_recording(files(tmp_path)[0]).stop is not None


def test_record_that_cannot_be_written_is_told(records: Recorder, said: list[str], tmp_path: Path) -> None:
    (tmp_path / "flights").write_text("a file where the folder should be")
    records.on_event(LOST, 0.25, EPOCH)
    records.close()
    assert len(said) == 1
    assert said[0].startswith("The flight record could not be written to ")


def test_recording_has_every_cycle_and_event_of_both_arms(
    recorders: dict[Side, FlightRecorder], said: list[str], tmp_path: Path
) -> None:
    file = tmp_path / "session.mcap"
    full = FullRecorder(file, EPOCH, recorders, said.append)
    full.start()
    record_motion(recorders[RIGHT], 20)
    record_motion(recorders[LEFT], 30)
    full.on_event(LOST, 0.3, Future())
    full.close()
    recording = read_recording(file)
    assert [frame.number for frame in recording.frames[RIGHT]] == list(range(51, 71))
    assert [frame.number for frame in recording.frames[LEFT]] == list(range(8, 38))
    assert [event.sentence for event in recording.events] == [str(LOST)]
    assert said == [f"50 cycles are in {file}."]


def test_recording_says_how_many_cycles_it_lost(
    recorders: dict[Side, FlightRecorder], said: list[str], tmp_path: Path
) -> None:
    full = FullRecorder(tmp_path / "session.mcap", EPOCH, recorders, said.append)
    record_motion(recorders[RIGHT], RECORDED_CYCLES + 5)
    full.start()
    full.close()
    assert said[0].endswith("session.mcap; 5 were lost, the disk is too slow.")


def test_recording_on_a_full_disk_says_that_it_ended_early_and_why(
    recorders: dict[Side, FlightRecorder], said: list[str], caplog: pytest.LogCaptureFixture
) -> None:
    """/dev/full is a disk that is always full."""
    full = FullRecorder(Path("/dev/full"), EPOCH, recorders, said.append)
    full.start()
    record_motion(recorders[RIGHT], RECORDED_CYCLES)
    full.close()
    assert said == ["The recording to /dev/full ended early: OSError: [Errno 28] No space left on device."]
    (record,) = caplog.records
    assert record.getMessage().startswith("Recording to /dev/full failed with OSError: ")
    full.on_event(LOST, 0.3, Future())  # what happens afterwards is not waited for
    record_motion(recorders[RIGHT], 10)
    full.close()
    assert len(said) == 1


def test_recording_is_asked_for_once_the_driver_runs(records: Recorder, said: list[str], tmp_path: Path) -> None:
    records.record_all(tmp_path / "session.mcap", EPOCH)
    records.on_event(RobotFollows(LEFT), 1.0, EPOCH)
    records.close()
    assert [event.kind for event in read_recording(tmp_path / "session.mcap").events] == ["RobotFollows"]


def test_recording_to_a_folder_is_refused(records: Recorder, tmp_path: Path) -> None:
    with refused(SettingsError, "recording_not_writable", file=str(tmp_path), reason="Is a directory"):
        records.record_all(tmp_path, EPOCH)
