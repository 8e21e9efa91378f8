from __future__ import annotations

import json
from contextlib import suppress
from math import isnan
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from abb_protocols.errors import ProtocolError
from abb_protocols.robot.joints import Side
from flight import CYCLE, LOST, flown, write_flight_record
from refusals import refused
from yumi.control.flight_recorder import RecordedCycle
from yumi.control.loop_events import RobotFollows
from yumi.control.stage_times import StageTimes
from yumi.recording.message_types import CYCLE_SCHEMA, RecordedEvent, decode_cycle, frame_message, recorded_event
from yumi.recording.reader import read_recording
from yumi.recording.writer import RecordingWriter

EPOCH = 1_800_000_000.0
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
VECTORS = st.tuples(*[NUMBERS] * 7)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "folder" / "record.mcap"


@pytest.fixture
def frames() -> tuple[RecordedCycle, ...]:
    return flown(30).frames()


@pytest.fixture
def lost() -> RecordedEvent:
    return recorded_event(LOST, 0.17)


def test_flight_record_gives_back_cycles_and_event(
    file: Path, frames: tuple[RecordedCycle, ...], lost: RecordedEvent
) -> None:
    write_flight_record(file, EPOCH, lost, {Side.RIGHT: frames})
    recording = read_recording(file)
    assert recording.frames == {Side.RIGHT: frames}
    assert recording.events == (lost,)
    assert (recording.stop, recording.arm, recording.is_complete) == (lost, Side.RIGHT, True)


def test_flight_record_can_be_read_by_any_reader_of_mcap(
    file: Path, frames: tuple[RecordedCycle, ...], lost: RecordedEvent
) -> None:
    write_flight_record(file, EPOCH, lost, {Side.RIGHT: frames})
    with file.open("rb") as stream:
        messages = list(make_reader(stream, validate_crcs=True).iter_messages(topics="r/cycle"))
    schema, channel, message = messages[-1]
    assert schema is not None
    assert (len(messages), channel.message_encoding, schema.encoding) == (30, "json", "jsonschema")
    assert json.loads(schema.data) == CYCLE_SCHEMA
    assert message.log_time == pytest.approx((EPOCH + 30 * CYCLE) * 1e9, abs=1000)
    assert json.loads(message.data)["position"] == list(frames[-1].position)


def test_cycle_has_exactly_what_its_schema_says(frames: tuple[RecordedCycle, ...]) -> None:
    properties = CYCLE_SCHEMA["properties"]
    assert isinstance(properties, dict)
    assert list(frame_message(frames[0])) == list(properties)


@given(VECTORS, VECTORS, st.none() | VECTORS, st.integers(1, 2**53), st.booleans())
def test_cycle_survives_the_way_through_json(
    position: tuple[float, ...], velocity: tuple[float, ...], wanted: tuple[float, ...] | None, number: int, runs: bool
) -> None:
    stages = StageTimes(*position)
    frame = RecordedCycle(
        number, 1.5, 0.004, 2, runs, position, velocity, position, wanted, velocity, velocity, wanted, stages
    )
    assert decode_cycle(json.dumps(frame_message(frame), allow_nan=False).encode()) == frame


def test_number_that_is_none_becomes_null_and_back(frames: tuple[RecordedCycle, ...]) -> None:
    message = {**frame_message(frames[0]), "desired": [None, *frames[0].position[1:]]}
    frame = decode_cycle(json.dumps(message).encode())
    assert frame.desired is not None
    assert isnan(frame.desired[0])
    assert json.loads(json.dumps(frame_message(frame))) == json.loads(json.dumps(message))


def test_recording_shows_the_cycles_around_the_last_stop(file: Path, frames: tuple[RecordedCycle, ...]) -> None:
    with RecordingWriter(file, EPOCH) as writer:
        writer.add_event(recorded_event(RobotFollows(Side.LEFT), 0.004))
        for frame in frames:
            writer.add_frame(Side.LEFT, frame)
        writer.add_event(recorded_event(LOST, 0.06))
    recording = read_recording(file, before=0.021, after=0.009)
    assert [frame.number for frame in recording.frames[Side.LEFT]] == list(range(10, 18))
    assert [event.kind for event in recording.events] == ["RobotFollows", "SessionLost"]


def test_recording_without_a_stop_shows_its_end(file: Path, frames: tuple[RecordedCycle, ...]) -> None:
    with RecordingWriter(file, EPOCH) as writer:
        for frame in frames:
            writer.add_frame(Side.LEFT, frame)
    recording = read_recording(file, before=0.011)
    assert recording.stop is None
    assert recording.arm is Side.LEFT
    assert [frame.number for frame in recording.frames[Side.LEFT]] == [28, 29, 30]


def test_recording_that_was_cut_off_gives_what_is_whole(file: Path) -> None:
    frames = flown(2480).frames()
    write_flight_record(file, EPOCH, recorded_event(LOST, frames[-1].time), {Side.RIGHT: frames})
    content = file.read_bytes()
    file.write_bytes(content[: len(content) * 7 // 10])
    recording = read_recording(file)
    assert not recording.is_complete
    assert 0 < len(recording.frames[Side.RIGHT]) < 2480


def test_recording_may_be_cut_off_anywhere(file: Path) -> None:
    frames = flown(8).frames()
    write_flight_record(file, EPOCH, recorded_event(LOST, frames[-1].time), {Side.RIGHT: frames})
    content = file.read_bytes()
    for end in range(len(content) // 2, len(content) - 100, 9):
        file.write_bytes(content[:end])
        assert len(read_recording(file).frames.get(Side.RIGHT, ())) <= 8


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40)
@given(st.integers(8, 3000), st.integers(1, 255))
def test_damaged_recording_is_refused_or_read_but_nothing_else(file: Path, place: int, change: int) -> None:
    frames = flown(20).frames()
    write_flight_record(file, EPOCH, recorded_event(LOST, 0.1), {Side.RIGHT: frames})
    content = bytearray(file.read_bytes())
    content[place % len(content)] ^= change
    file.write_bytes(content)
    with suppress(ProtocolError):
        read_recording(file)


def test_file_of_another_kind_is_refused(file: Path) -> None:
    file.parent.mkdir()
    file.write_text("time,position\n0.0,1.0\n")
    with refused(ProtocolError, "recording_damaged"):
        read_recording(file)
