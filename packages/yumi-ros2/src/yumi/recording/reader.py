"""The reader of recordings: our own, and joint messages of other programs' MCAP files, which may be damaged."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import ProtocolError, missing_extra
from abb_protocols.robot.joints import Side
from yumi.control.flight_recorder import RecordedCycle
from yumi.recording.message_types import (
    EVENTS_TOPIC,
    STATE_TOPIC,
    RecordedEvent,
    cycle_topic,
    decode_cycle,
    decode_event,
    decode_object,
)
from yumi.recording.ros_messages import JOINT_STATE_MESSAGE

FLIGHT_RECORD_BEFORE = 11.0
"""A flight record as a whole: its ten seconds end a little before the event [s]."""

FLIGHT_RECORD_AFTER = 2.0
"""A flight record goes on for so long after its event: what the robot did once it was to hold [s]."""

_LARGEST_RECORD = 64 * 2**20  # [bytes]; ours are chunks of less than one million
_LARGEST_CHUNK = 16 * 2**20  # decompressed [bytes]; programs that rewrite recordings make chunks of up to 4 MB
_LARGEST_RATIO = 200  # of decompression; cycles of an arm at rest, all zeros, reach 38

_NEWEST = 2**63 - 1  # [ns since 1970]; pandas and numpy have no later time


@dataclass(frozen=True, slots=True)
class Recording:
    """What a file holds, or the part of it around the event that stopped a motion.

    Attributes:
        events: everything that happened, in order.
        stop: the event that stopped a motion, the last one if there were several; None when nothing did.
        frames: recorded cycles per arm, oldest first.
        is_complete: False when the file ends before it was closed.
    """

    events: tuple[RecordedEvent, ...] = ()
    stop: RecordedEvent | None = None
    frames: Mapping[Side, tuple[RecordedCycle, ...]] = field(default_factory=dict)
    is_complete: bool = True

    @property
    def arm(self) -> Side:
        """The arm to look at: the one that stopped, else the first that is recorded."""
        stopped = self.stop.side if self.stop else None
        return stopped or next(iter(self.frames), Side.RIGHT)


def read_recording(
    file: Path, *, before: float = FLIGHT_RECORD_BEFORE, after: float = FLIGHT_RECORD_AFTER
) -> Recording:
    """Events of a whole recording, and the cycles around the one that stopped a motion, by default its end.

    Args:
        file: what a RecordingWriter wrote; it may have been cut off.
        before: cycles from so long before the event [s].
        after: cycles until so long after it [s].

    Raises:
        ProtocolError: the file is not such a recording, or nothing is recorded in it.
        MissingPrerequisite: the library is not installed.
    """
    events, last, is_complete = list[RecordedEvent](), 0.0, False
    sides = {cycle_topic(side): side for side in Side}
    for topic, _, value in recorded_messages(file):
        if topic is None:
            is_complete = True
        elif topic == EVENTS_TOPIC:
            events.append(value)
        elif topic in sides:
            last = max(last, value.time)
    stop = next((event for event in reversed(events) if event.is_fault), None)
    middle = stop.time if stop else last

    # A second pass, so that of a long recording only the cycles that are shown are kept in memory.
    frames: dict[Side, list[RecordedCycle]] = {side: [] for side in Side}
    for topic, _, value in recorded_messages(file):
        if topic in sides and middle - before <= value.time <= middle + after:
            frames[sides[topic]].append(value)
    recorded = {side: tuple(each) for side, each in frames.items() if each}
    return Recording(tuple(events), stop, recorded, is_complete)


def recorded_messages(file: Path) -> Iterator[tuple[str | None, int, Any]]:
    """Topic, time of day [ns since 1970] and value of every message of ours in JSON, in the order of the file.

    The value is a RecordedCycle, a RecordedEvent, or of grippers and the robot's state a mapping with ``time``. At last
    (None, 0, None) where the file was closed.

    Raises:
        ProtocolError: the file is not such a recording, or nothing is recorded in it.
        MissingPrerequisite: the library is not installed.
    """
    decoders: dict[str, Callable[[bytes], Any]] = {EVENTS_TOPIC: decode_event, STATE_TOPIC: decode_object}
    decoders |= {f"{side.value}/gripper": decode_object for side in Side}
    decoders |= {cycle_topic(side): decode_cycle for side in Side}
    foreign: dict[str, None] = {}  # topics, in their order
    is_closed, ours = False, 0
    for record in _messages(file):
        if record is None:
            is_closed = True
            continue
        topic, encoding, _, nanoseconds, data = record
        if encoding != "json" or topic not in decoders:
            foreign[topic] = None
            continue
        try:
            if nanoseconds > _NEWEST:
                raise _Unreadable(message("recorded_after_2262"))
            value = decoders[topic](data)
        except RecursionError:
            raise _damaged(file, message("recorded_message_nested_too_deeply", topic=topic)) from None
        except ValueError as error:
            raise _damaged(file, message("recorded_message_unreadable", topic=topic, reason=_said(error))) from error
        ours += 1
        yield topic, nanoseconds, value
    if not ours and foreign:
        raise ProtocolError(
            message(
                "recording_of_another_program",
                file=str(file),
                count=len(foreign),
                topics=tuple(topic[:40] for topic in [*foreign][:3]),
                needed=tuple(decoders),
            )
        )
    if not ours:
        raise ProtocolError(
            message("recording_closed_empty" if is_closed else "recording_cut_off_empty", file=str(file))
        )
    if is_closed:
        yield None, 0, None


class _Unreadable(ValueError):
    """What makes a file, or a message in it, unreadable; a ValueError, as the decoders of others raise them."""

    def __init__(self, said: Message) -> None:
        super().__init__(said)
        self.said = said


def _said(error: Exception) -> Message:
    """What an error says of a file, which may quote it: of others' errors, 200 characters at most."""
    if isinstance(error, _Unreadable):
        return error.said
    return message("text", text=str(error)[:200] or type(error).__name__)


def _damaged(file: Path, reason: Message) -> ProtocolError:
    return ProtocolError(message("recording_damaged", file=str(file), reason=reason))


class JointMessage(NamedTuple):
    """Values of joints in a message of ROS 2.

    Attributes:
        topic: the topic's name.
        time: when the message was recorded, time of day [s since 1970].
        names: of the joints; empty in a message that names none.
        position: of the joints [rad].
    """

    topic: str
    time: float
    names: tuple[str, ...]
    position: tuple[float, ...]


_ARRAY = "std_msgs/msg/Float64MultiArray"


def joint_messages(file: Path) -> Iterator[JointMessage]:
    """Every sensor_msgs/JointState and std_msgs/Float64MultiArray of an MCAP file of any program, in its order.

    Raises:
        ProtocolError: the file is not an MCAP file, or a message in it is damaged.
        MissingPrerequisite: the library is not installed.
    """
    for record in _messages(file):
        if record is None:
            continue
        topic, encoding, schema, nanoseconds, data = record
        if encoding != "cdr" or schema not in (JOINT_STATE_MESSAGE, _ARRAY):
            continue
        try:
            reader = _CdrReader(data)
            if schema == JOINT_STATE_MESSAGE:
                reader.numbers("iI")  # its stamp may be of another clock than those of commands
                reader.text()
                names = tuple(reader.text() for _ in range(reader.count(4)))
            else:
                names = ()
                for _ in range(reader.count(12)):  # its dimensions
                    reader.text()
                    reader.numbers("II")
                reader.numbers("I")
            position = reader.numbers(f"{reader.count(8)}d")
        except (ValueError, struct.error) as error:
            reason = message("recorded_message_unreadable", topic=topic[:40], reason=_said(error))
            raise _damaged(file, reason) from error
        yield JointMessage(topic, nanoseconds / 1e9, names, position)


class _CdrReader:
    """Takes one value after another from a message in XCDR1.

    Raises:
        ValueError: it is in another encoding, or ends too early; as struct.error too.
    """

    def __init__(self, data: bytes) -> None:
        if data[:2] not in (b"\0\0", b"\0\1"):
            raise _Unreadable(message("not_in_xcdr1"))
        self._order, self._data, self._at = "<" if data[1] else ">", data[4:], 0

    def numbers(self, form: str) -> tuple[Any, ...]:
        size = struct.calcsize(f"={form[-1]}")
        self._at += -self._at % size if not form.startswith("0") else 0
        found = struct.unpack_from(self._order + form, self._data, self._at)
        self._at += struct.calcsize(self._order + form)
        return found

    def count(self, least: int) -> int:
        """How many elements of at least so many bytes follow."""
        (count,) = self.numbers("I")
        if count * least > len(self._data) - self._at:
            raise _Unreadable(message("elements_do_not_fit", count=count))
        return int(count)

    def text(self) -> str:
        length = self.count(1)
        found = self._data[self._at : self._at + length]
        self._at += length
        return found.rstrip(b"\0").decode(errors="replace")


def _messages(file: Path) -> Iterator[tuple[str, str, str, int, bytes] | None]:
    """Topic, encoding, schema, time [ns since 1970] and content of every message; None where the file was closed."""
    try:
        from mcap.exceptions import EndOfFile, InvalidMagic, McapError  # noqa: PLC0415 - an extra; only this needs it
        from mcap.stream_reader import MAGIC_SIZE, StreamReader  # noqa: PLC0415
        from zstandard import ZstdError  # noqa: PLC0415 - comes with mcap
    except ImportError as error:
        raise missing_extra(message("recordings_need_mcap"), "yumi-ros2", "record") from error
    try:
        with file.open("rb") as stream:
            reader = StreamReader(stream, emit_chunks=True, validate_crcs=True, record_size_limit=_LARGEST_RECORD)
            try:
                yield from _on_channels(_decompressed(reader.records))
            except struct.error:
                if stream.tell() < MAGIC_SIZE or stream.read(1):
                    raise
                return  # it ends within a number, which the library does not check
    except EndOfFile:
        return  # its writer was stopped; what is complete has been read
    except InvalidMagic as error:
        raise _damaged(file, message("not_mcap")) from error
    except (McapError, ZstdError, struct.error, TypeError, ValueError, OverflowError, MemoryError) as error:
        # The last two: a damaged length asks for more than there is.
        raise _damaged(file, _said(error)) from error


def _on_channels(records: Iterable[Any]) -> Iterator[tuple[str, str, str, int, bytes] | None]:
    """The messages among the records of an MCAP file, as in :func:`_messages`."""
    from mcap.records import Channel, Footer, Message, Schema  # noqa: PLC0415 - an extra

    channels: dict[int, Channel] = {}
    schemas: dict[int, str] = {}
    for record in records:
        if isinstance(record, Schema):
            schemas[record.id] = record.name
        elif isinstance(record, Channel):
            channels[record.id] = record
        elif isinstance(record, Message):
            channel = channels.get(record.channel_id)
            if channel is None:
                raise _Unreadable(message("channel_not_declared"))
            schema = schemas.get(channel.schema_id, "")
            yield channel.topic, channel.message_encoding, schema, record.log_time, record.data
        elif isinstance(record, Footer):
            yield None


def _decompressed(records: Iterable[Any]) -> Iterator[Any]:
    """The records of an MCAP file, of a chunk those in it.

    The library would make room for whatever size a chunk says it has: some kB may stand for GB.

    Raises:
        ValueError: a chunk is larger than any that is written.
    """
    from lz4.frame import LZ4FrameFile  # noqa: PLC0415 - comes with mcap
    from mcap.records import Chunk  # noqa: PLC0415 - an extra
    from mcap.stream_reader import breakup_chunk  # noqa: PLC0415
    from zstandard import ZstdDecompressor  # noqa: PLC0415 - comes with mcap

    for record in records:
        if not isinstance(record, Chunk):
            yield record
            continue
        packed, data = BytesIO(record.data), record.data
        most = min(_LARGEST_CHUNK, _LARGEST_RATIO * len(data))
        if record.compression == "zstd":
            data = ZstdDecompressor().stream_reader(packed).read(most + 1)
        elif record.compression == "lz4":
            try:
                data = LZ4FrameFile(packed).read(most + 1)
            except (EOFError, RuntimeError) as error:
                raise _Unreadable(message("chunk_not_decompressed", reason=_said(error))) from error
        elif record.compression:
            raise _Unreadable(message("chunk_compression_unknown", compression=record.compression[:40]))
        if len(data) > most:
            raise _Unreadable(message("chunk_too_large", size=len(record.data), limit=most))
        yield from breakup_chunk(replace(record, compression="", data=data), validate_crc=True)
