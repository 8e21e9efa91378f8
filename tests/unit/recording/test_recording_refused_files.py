"""Files that are damaged, cut off or not ours: each gets one sentence, whatever reads it."""

from __future__ import annotations

import json
import struct
import tracemalloc
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
import zstandard
from click.testing import CliRunner
from lz4 import frame as lz4
from mcap.writer import CompressionType, Writer

from abb_protocols.catalogue import clause, message, remedy_of
from abb_protocols.errors import ProtocolError
from abb_protocols.robot.joints import Side
from flight import LOST, flown, write_flight_record
from refusals import codes_in, refused
from yumi.cli.main import main
from yumi.recording.message_types import frame_message, recorded_event
from yumi.recording.reader import read_recording, recorded_messages
from yumi.recording.writer import RecordingWriter

CYCLE = frame_message(flown(1).frames()[0])
EVENT = {"time": 1.0, "side": "r", "kind": "SessionLost", "message": "Lost.", "is_fault": True}
PLAIN = CompressionType.NONE
MAGIC = b"\x89MCAP0\r\n"


def written(
    *messages: tuple[str, bytes],
    encoding: str = "json",
    time: int = 10**18,
    compression: CompressionType = CompressionType.ZSTD,
) -> Callable[[Path], None]:
    """Writes an MCAP file with ``messages`` of topic and content, as any program may."""

    def write(file: Path) -> None:
        with file.open("wb") as stream:
            writer = Writer(stream, chunk_size=2**21, compression=compression)
            writer.start()
            schema = writer.register_schema("any", "jsonschema", b"{}")
            for topic, data in messages:
                channel = writer.register_channel(topic, encoding, schema)
                writer.add_message(channel, time, data, time)
            writer.finish()

    return write


def cycle(**changed: Any) -> tuple[str, bytes]:
    return "r/cycle", json.dumps({**CYCLE, **changed}).encode()


def without(message: Mapping[str, Any], name: str) -> bytes:
    return json.dumps({key: value for key, value in message.items() if key != name}).encode()


def closed_at_once(file: Path) -> None:
    with RecordingWriter(file, 0.0):
        pass


def cut_in_the_first_chunk(file: Path) -> None:
    write_flight_record(file, 0.0, recorded_event(LOST, 0.1), {Side.RIGHT: flown(20).frames()})
    file.write_bytes(file.read_bytes()[:900])


def content(data: bytes) -> Callable[[Path], None]:
    return lambda file: file.write_bytes(data) and None


def with_chunk(compression: str, data: bytes, size: int) -> Callable[[Path], None]:
    """Writes a file that consists of one chunk, which says that it has ``size`` bytes when decompressed."""

    def write(file: Path) -> None:
        name = compression.encode()
        chunk = struct.pack("<QQQII", 0, 0, size, 0, len(name)) + name + struct.pack("<Q", len(data)) + data
        header = b"\x01" + struct.pack("<Q", 8) + bytes(8)
        file.write_bytes(MAGIC + header + b"\x06" + struct.pack("<Q", len(chunk)) + chunk)

    return write


LARGE = bytes(2**25)
REFUSED = {
    "cycle without position": (written(("r/cycle", without(CYCLE, "position"))), "missing required field `position`"),
    "cycle with six joints": (written(cycle(position=[0.0] * 6)), "array` of length 7"),
    "cycle with a text": (written(cycle(time="now")), "got `str`"),
    "cycle with a list of times": (written(cycle(time=[1.0])), "got `array`"),
    "cycle at no time": (written(("r/cycle", b'{"time": NaN}')), "malformed"),
    "list": (written(("r/cycle", b"[1, 2]")), "Expected `object`, got `array`"),
    "number": (written(("state", b"7")), "Expected `object`, got `int`"),
    "nested list": (
        written(("r/cycle", b'{"other": ' + b"[" * 100_000), compression=PLAIN),
        "recorded_message_nested_too_deeply",
    ),
    "nested state": (
        written(("state", b'{"time": 1, "a":' + b'{"a":' * 100_000), compression=PLAIN),
        "recorded_message_unreadable",
    ),
    "state nested twice too deep": (written(("state", b'{"time":1,"a":{"b":{"c":{"d":1}}}}')), "got `object`"),
    "state without time": (written(("state", b'{"mode": "auto"}')), "missing required field `time`"),
    "gripper of another kind": (written(("l/gripper", b'"READY"')), "Expected `object`"),
    "event without a sentence": (written(("events", without(EVENT, "message"))), "missing required field `message`"),
    "event of a third arm": (written(("events", json.dumps({**EVENT, "side": "m"}).encode())), "enum value"),
    "not UTF-8": (written(("state", b'{"time": 1, "reason": "\xff\xfe"}')), "decode byte 0xff"),
    "half a surrogate": (written(("state", b'{"time": 1, "reason": "\\ud800"}')), "recorded_message_unreadable"),
    "number of 5000 digits": (written(("state", b'{"time": ' + b"9" * 5000 + b"}")), "out of range"),
    "time that no program has": (written(cycle(), time=2**64 - 1), "recorded_after_2262"),
    "other topics": (
        written(("/tf", b"{}"), ("/odom", b"{}")),
        "recording_of_another_program",
    ),
    "other encoding": (written(cycle(), encoding="cdr"), "recording_of_another_program"),
    "0 bytes": (content(b""), "recording_cut_off_empty"),
    "only the magic": (content(MAGIC), "recording_cut_off_empty"),
    "cut in the first chunk": (cut_in_the_first_chunk, "recording_cut_off_empty"),
    "closed at once": (closed_at_once, "recording_closed_empty"),
    "text": (content(b"time,position\n0.0,1.0\n"), "not_mcap"),
    "zstd bomb": (with_chunk("zstd", zstandard.compress(LARGE), len(LARGE)), "chunk_too_large"),
    "zstd bomb that lies": (with_chunk("zstd", zstandard.compress(LARGE), 100), "chunk_too_large"),
    "lz4 bomb": (with_chunk("lz4", lz4.compress(LARGE), len(LARGE)), "chunk_too_large"),
    "chunk that is not lz4": (with_chunk("lz4", b"0123456789", 10), "chunk_not_decompressed"),
    "chunk of unknown compression": (with_chunk("rar", b"0123456789", 10), "chunk_compression_unknown"),
}


@pytest.mark.parametrize("kind", REFUSED)
@pytest.mark.parametrize(
    "command", [("view", "--port", "0"), ("record", "show"), ("record", "export"), ("record", "list")], ids=" ".join
)
def test_file_that_cannot_be_read_is_refused_with_one_sentence(
    tmp_path: Path, kind: str, command: tuple[str, ...]
) -> None:
    write, reason = REFUSED[kind]
    file = tmp_path / "x.mcap"
    write(file)
    given = {
        "list": ["--folder", str(tmp_path)],
        "export": [str(file), str(tmp_path / "x.csv"), "--table", "state"],
    }.get(command[1], [str(file)])
    with pytest.raises(ProtocolError) as refusal:
        list(recorded_messages(file))
    said = refusal.value.said
    assert reason in codes_in(said) or reason in clause(said)  # the words are those of the decoder of JSON
    assert (said.values["file"], bool(remedy_of(said))) == (str(file), True)
    result = CliRunner().invoke(main, [*command, *given])
    assert (result.exit_code, type(result.exception)) == (1, SystemExit), result.output
    assert str(said) in result.output
    assert "Traceback" not in result.output
    assert not (tmp_path / "x.csv").exists()


def test_topics_of_another_program_are_named(tmp_path: Path) -> None:
    written(("/tf", b"{}"), ("/odom", b"{}"))(tmp_path / "x.mcap")
    with refused(ProtocolError, "recording_of_another_program", count=2, topics=("/tf", "/odom")) as refusal:
        read_recording(tmp_path / "x.mcap")
    assert "events" in refusal.value.said.values["needed"]


def test_file_that_expands_to_a_gigabyte_is_refused_before_it_is_decompressed(tmp_path: Path) -> None:
    file = tmp_path / "bomb.mcap"
    with_chunk("zstd", zstandard.compress(bytes(2**24)), 2**24)(file)
    data = file.read_bytes()
    file.write_bytes(data + 63 * data[len(MAGIC) + 17 :])
    assert file.stat().st_size < 50_000
    tracemalloc.start()
    try:
        with pytest.raises(ProtocolError) as refusal:
            read_recording(file)
        assert tracemalloc.get_traced_memory()[1] < 2**21
        assert "chunk_too_large" in codes_in(refusal.value.said)
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("compression", CompressionType)
def test_recording_that_another_program_compressed_anew_is_read(tmp_path: Path, compression: CompressionType) -> None:
    written(*(cycle(number=number, time=0.004 * number) for number in range(1, 1001)), compression=compression)(
        tmp_path / "x.mcap"
    )
    assert len(read_recording(tmp_path / "x.mcap").frames[Side.RIGHT]) == 1000


def test_topics_of_other_programs_in_a_recording_are_left_out(tmp_path: Path) -> None:
    written(("/tf", b"[" * 100_000), cycle(number=3))(tmp_path / "x.mcap")
    assert [frame.number for frame in read_recording(tmp_path / "x.mcap").frames[Side.RIGHT]] == [3]


def test_list_shows_the_other_records_beside_one_that_was_cut_off(tmp_path: Path) -> None:
    recorded = recorded_event(LOST, 0.1)
    write_flight_record(tmp_path / "b.mcap", 0.0, recorded, {Side.RIGHT: flown(20).frames()})
    (tmp_path / "a.mcap").write_bytes(b"")
    result = CliRunner().invoke(main, ["record", "list", "--folder", str(tmp_path)])
    assert result.exit_code == 1
    assert f"{tmp_path / 'b.mcap'}  {recorded.sentence}" in result.output
    assert str(message("records_unreadable", damaged=1, count=2, folder=str(tmp_path))) in result.output
