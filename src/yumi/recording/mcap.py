"""Recordings: cycles and events of both arms as an MCAP file, for our own table and picture and for Foxglove.

A topic an arm (``r/cycle``, ``l/cycle``) and one for events (``events``), each message a JSON object whose schema, with
units, is in the file. A message's log time is the time of day; ``time`` inside is the machine's monotonic clock, by
which cycles and events compare.

What the driver writes down: a flight record when something stops a motion, and every cycle when that was requested.

The control loop only reports events; this end reads the memory it shares (ten seconds of each arm) and writes the
files, on threads of its own, so that neither a cycle nor a reply waits for a disk.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field, fields
from datetime import datetime
from math import isfinite, nan
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Event as Flag
from threading import Thread
from types import TracebackType
from typing import Any

from yumi import __version__
from yumi.control.events import Event, is_fault
from yumi.control.flight_recorder import FlightRecorder, Frame
from yumi.control.statistics import StageTimes
from yumi.errors import MissingPrerequisite, ProtocolError, SettingsError, YumiError
from yumi.process.supervision import Failures
from yumi.robot.joints import JOINT_COUNT, Joints, Side, joint_names, joints


@dataclass(frozen=True, slots=True)
class RecordedEvent:
    """Something that happened to an arm.

    Attributes:
        time: when, on the machine's monotonic clock [s].
        side: which arm; None when it concerns both.
        kind: the event's class, e.g. ``SessionLost``.
        sentence: what the log says of it.
        is_fault: whether it was a fault, and not requested.
    """

    time: float
    side: Side | None
    kind: str
    sentence: str
    is_fault: bool


def _number(description: str) -> dict[str, object]:
    return {"type": "number", "description": description}


def _vector(description: str) -> dict[str, object]:
    item = {"type": ["number", "null"]}
    return {
        "type": "array",
        "items": item,
        "minItems": JOINT_COUNT,
        "maxItems": JOINT_COUNT,
        "description": f"{description}; axes 1 2 7 3 4 5 6",
    }


STAGES = tuple(item.name for item in fields(StageTimes))
"""The stages of a cycle in their order."""

CYCLE_SCHEMA: Mapping[str, Any] = {
    "title": "yumi.Cycle",
    "type": "object",
    "properties": {
        "number": {"type": "integer", "description": "cycle of this arm, from 1"},
        "time": _number("arrival of the datagram, monotonic clock [s]"),
        "dt": _number("robot time since the datagram before [s]"),
        "session": {"type": "integer", "description": "EGM session, from 1"},
        "is_running": {"type": "boolean", "description": "whether the robot followed commands"},
        "position": _vector("measured positions [rad]"),
        "velocity": _vector("measured velocities [rad/s]"),
        "planned": _vector("positions the controller was heading for [rad]"),
        "desired": {**_vector("positions the controllers asked for [rad], null: hold"), "type": ["array", "null"]},
        "sent": _vector("positions that were sent to the arm [rad]"),
        "sent_velocity": _vector("velocities that were sent to the arm [rad/s]"),
        "reference": {**_vector("goal of the active controller [rad], null: none"), "type": ["array", "null"]},
        "stages": {
            "type": "object",
            "description": "how long each stage of the cycle took [s]",
            "properties": {name: {"type": "number"} for name in STAGES},
        },
    },
}
"""JSON schema of a cycle."""

EVENT_SCHEMA: Mapping[str, object] = {
    "title": "yumi.Event",
    "type": "object",
    "properties": {
        "time": _number("monotonic clock [s]"),
        "side": {"enum": [*(side.value for side in Side), None], "description": "which arm, null: both"},
        "kind": {"type": "string"},
        "sentence": {"type": "string"},
        "is_fault": {"type": "boolean", "description": "whether it was a fault, and not requested"},
    },
}
"""JSON schema of an event."""


_VECTORS = ("position", "velocity", "planned", "desired", "sent", "sent_velocity", "reference")


def frame_message(frame: Frame) -> dict[str, object]:
    """The object of a cycle; what is not a finite number becomes null, which JSON has."""
    message: dict[str, object] = {name: getattr(frame, name) for name in CYCLE_SCHEMA["properties"]}
    for name in _VECTORS:
        values = getattr(frame, name)
        message[name] = None if values is None else [value if isfinite(value) else None for value in values]
    message["stages"] = {name: getattr(frame.stages, name) for name in STAGES}
    return message


def frame_from_message(message: Mapping[str, Any]) -> Frame:
    """The cycle of an object.

    Raises:
        KeyError: a part is missing.
        TypeError: a part is of the wrong kind.
        ValueError: a vector has not seven numbers.
    """

    def vector(name: str) -> Joints:
        return joints([nan if value is None else value for value in message[name]])

    return Frame(
        number=int(message["number"]),
        time=float(message["time"]),
        dt=float(message["dt"]),
        session=int(message["session"]),
        is_running=bool(message["is_running"]),
        position=vector("position"),
        velocity=vector("velocity"),
        planned=vector("planned"),
        desired=None if message["desired"] is None else vector("desired"),
        sent=vector("sent"),
        sent_velocity=vector("sent_velocity"),
        reference=None if message["reference"] is None else vector("reference"),
        stages=StageTimes(*(float(message["stages"][name]) for name in STAGES)),
    )


EVENTS = "events"
"""The topic of events."""

BEFORE = 11.0
"""A flight record as a whole: its ten seconds end a little before the event [s]."""

AFTER = 1.0
"""What the robot did once it was to hold [s]."""

_MISSING = "Recordings need mcap; install yumi-ros2[record]."
_LARGEST_RECORD = 64 * 2**20  # [bytes]; ours are chunks of about one million


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
    frames: Mapping[Side, tuple[Frame, ...]] = field(default_factory=dict)
    is_complete: bool = True

    @property
    def arm(self) -> Side:
        """The arm to look at: the one that stopped, else the first that is recorded."""
        stopped = self.stop.side if self.stop else None
        return stopped or next(iter(self.frames), Side.RIGHT)


def recorded_event(event: Event, time: float) -> RecordedEvent:
    """``event`` as it is recorded, having happened at ``time`` on the monotonic clock [s]."""
    return RecordedEvent(time, event.side, type(event).__name__, str(event), is_fault(event))


class RecordingWriter:
    """A recording that is being written; a context manager.

    Args:
        file: where to; its folder is made, a file of that name is replaced.
        epoch: time of day when the monotonic clock was 0 [s since 1970].

    Raises:
        MissingPrerequisite: the library is not installed.
        OSError: the file cannot be written; so do the methods.
    """

    def __init__(self, file: Path, epoch: float) -> None:
        try:
            from mcap.writer import Writer  # noqa: PLC0415 - an extra; nothing else needs it
        except ImportError as error:
            raise MissingPrerequisite(_MISSING) from error
        file.parent.mkdir(parents=True, exist_ok=True)
        self._stream = file.open("wb")
        self._epoch = epoch
        self._writer = Writer(self._stream)
        self._writer.start(profile="", library=f"yumi-ros2 {__version__}")
        cycle, event = (
            self._writer.register_schema(name, "jsonschema", json.dumps(schema).encode())
            for name, schema in (("yumi.Cycle", CYCLE_SCHEMA), ("yumi.Event", EVENT_SCHEMA))
        )
        self._channels = {EVENTS: self._writer.register_channel(EVENTS, "json", event)}
        for side in Side:
            names = {"joints": " ".join(joint_names(side))}
            self._channels[_topic(side)] = self._writer.register_channel(_topic(side), "json", cycle, names)

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def add_frame(self, side: Side, frame: Frame) -> None:
        """Append a cycle of one arm."""
        self._add(_topic(side), frame.time, frame.number, frame_message(frame))

    def add_event(self, event: RecordedEvent) -> None:
        """Append an event."""
        self._add(EVENTS, event.time, 0, {**asdict(event), "side": event.side.value if event.side else None})

    def close(self) -> None:
        """Write the index; without it the file is readable, but slowly."""
        try:
            self._writer.finish()
        finally:
            self._stream.close()

    def _add(self, topic: str, time: float, sequence: int, message: Mapping[str, object]) -> None:
        data = json.dumps(message, allow_nan=False, separators=(",", ":")).encode()
        nanoseconds = round((self._epoch + time) * 1e9)
        self._writer.add_message(self._channels[topic], nanoseconds, data, nanoseconds, sequence)


def write_flight_record(file: Path, epoch: float, event: RecordedEvent, frames: Mapping[Side, Sequence[Frame]]) -> None:
    """The cycles that led to ``event``, and the event.

    Raises:
        MissingPrerequisite: the library is not installed.
        OSError: the file cannot be written.
    """
    with RecordingWriter(file, epoch) as writer:
        for side, each in frames.items():
            for frame in each:
                writer.add_frame(side, frame)
        writer.add_event(event)


def read_recording(file: Path, *, before: float = BEFORE, after: float = AFTER) -> Recording:
    """Events of a whole recording, and the cycles around the one that stopped a motion, by default its end.

    Args:
        file: what a RecordingWriter wrote; it may have been cut off.
        before: cycles from so long before the event [s].
        after: cycles until so long after it [s].

    Raises:
        ProtocolError: the file is not such a recording.
        MissingPrerequisite: the library is not installed.
    """
    events, last, is_complete = list[RecordedEvent](), 0.0, False
    for topic, message in _messages(file):
        if topic is None:
            is_complete = True
        elif topic == EVENTS:
            side = None if message["side"] is None else Side(message["side"])
            kind, sentence = str(message["kind"]), str(message["sentence"])
            events.append(RecordedEvent(float(message["time"]), side, kind, sentence, bool(message["is_fault"])))
        else:
            last = max(last, float(message["time"]))
    stop = next((event for event in reversed(events) if event.is_fault), None)
    middle = stop.time if stop else last

    # A second pass, so that of a long recording only the cycles that are shown are kept in memory.
    frames: dict[Side, list[Frame]] = {side: [] for side in Side}
    sides = {_topic(side): side for side in Side}
    for topic, message in _messages(file):
        if topic in sides and middle - before <= message["time"] <= middle + after:
            frames[sides[topic]].append(frame_from_message(message))
    recorded = {side: tuple(each) for side, each in frames.items() if each}
    return Recording(tuple(events), stop, recorded, is_complete)


def _messages(file: Path) -> Iterator[tuple[str | None, Any]]:
    """Topic and content of every message in the order of the file; at last (None, None) where it was closed."""
    try:
        from mcap.exceptions import EndOfFile, McapError  # noqa: PLC0415 - an extra; nothing else needs it
        from mcap.records import Channel, Footer, Message  # noqa: PLC0415
        from mcap.stream_reader import StreamReader  # noqa: PLC0415
        from zstandard import ZstdError  # noqa: PLC0415 - comes with mcap
    except ImportError as error:
        raise MissingPrerequisite(_MISSING) from error
    topics: dict[int, str] = {}
    try:
        with file.open("rb") as stream:
            for record in StreamReader(stream, validate_crcs=True, record_size_limit=_LARGEST_RECORD).records:
                if isinstance(record, Channel):
                    topics[record.id] = record.topic
                elif isinstance(record, Message):
                    yield topics[record.channel_id], json.loads(record.data)
                elif isinstance(record, Footer):
                    yield None, None
    except EndOfFile:
        return  # its writer was stopped; what is complete has been read
    except (McapError, ZstdError, struct.error, KeyError, TypeError, ValueError, OverflowError, MemoryError) as error:
        # The last two: a damaged length asks for more than there is.
        raise ProtocolError(f"{file} is not a recording of yumi, or it is damaged: {error!r}.") from error


def _topic(side: Side) -> str:
    return f"{side.value}/cycle"


PERIOD = 0.02
"""How often a full recording reads the memories [s]: the less there is to write at once, the less others wait."""

_NAME = "flight_"


class Recorder:
    """Writes the files that an event, or a recording of the whole session, asks for.

    Args:
        folder: where flight records go; made when the first one is written.
        keep: how many of them stay; the oldest ones are deleted.
        recorders: the memory of each arm.
        report: called with one sentence for each file; on another thread.
    """

    def __init__(
        self, folder: Path, keep: int, recorders: Mapping[Side, FlightRecorder], report: Callable[[str], None]
    ) -> None:
        self._folder = folder
        self._keep = keep
        self._recorders = recorders
        self._report = report
        self._failures = Failures()
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="flight-records")
        self._full: FullRecorder | None = None

    def record_all(self, file: Path, epoch: float) -> None:
        """Write every cycle from now on to ``file``.

        Args:
            file: a new one, or one to be replaced.
            epoch: time of day when the monotonic clock was 0 [s since 1970].

        Raises:
            SettingsError: the file cannot be written.
            MissingPrerequisite: the library is not installed.
        """
        try:
            self._full = FullRecorder(file, epoch, self._recorders, self._report)
        except OSError as error:
            raise SettingsError(f"Cannot record to {file}: {error.strerror}.") from error
        self._full.start()

    def on_event(self, event: Event, now: float, time_of_day: float) -> None:
        """Write down what happened; does not wait for a disk.

        Args:
            event: of the control loop.
            now: monotonic clock [s].
            time_of_day: at the same moment [s since 1970].
        """
        if is_fault(event):
            memory = self._recorders[event.side].copy()
            try:
                self._thread.submit(self._write, recorded_event(event, now), event.side, memory, time_of_day)
            except RuntimeError as error:  # the operating system permits no thread
                self._report(f"The flight record of the {event.side.word} arm could not be begun: {error}.")
        if self._full:
            self._full.on_event(event, now)

    def close(self) -> None:
        """Wait until everything is written."""
        self._thread.shutdown()
        if self._full:
            self._full.close()

    def _write(self, event: RecordedEvent, side: Side, memory: FlightRecorder, time_of_day: float) -> None:
        moment = datetime.fromtimestamp(time_of_day)
        name = f"{_NAME}{moment:%Y-%m-%d_%H-%M-%S}-{moment.microsecond // 1000:03}_{side.word}.mcap"
        file = self._folder / name
        # The cycles that led to the event; not those of an earlier session.
        frames = tuple(frame for frame in memory.frames() if frame.time >= event.time - BEFORE)
        try:
            write_flight_record(file, time_of_day - event.time, event, {side: frames})
            for oldest in sorted(self._folder.glob(f"{_NAME}*.mcap"))[: -self._keep]:
                oldest.unlink()
        except (YumiError, OSError) as error:
            self._report(f"The flight record could not be written to {file}: {error}")
            return
        except Exception as error:  # the thread pool would keep it to itself
            self._failures.note(f"Writing the flight record {file}", error)
            return
        seconds = frames[-1].time - frames[0].time if frames else 0.0
        self._report(f"The last {seconds:.1f} s of the {side.word} arm are in {file}: yumi record show {file}")


class FullRecorder:
    """Writes every cycle of both arms to one file, on a thread of its own, between start and close.

    It follows the memories, which hold ten seconds: a disk that hesitates loses nothing, and what is lost all the same
    is counted.

    Args:
        file: where to.
        epoch: time of day when the monotonic clock was 0 [s since 1970].
        recorders: the memory of each arm.
        report: called with one sentence when it ends.

    Raises:
        MissingPrerequisite: the library is not installed.
        OSError: the file cannot be written.
    """

    def __init__(
        self, file: Path, epoch: float, recorders: Mapping[Side, FlightRecorder], report: Callable[[str], None]
    ) -> None:
        self._file = file
        self._writer = RecordingWriter(file, epoch)
        self._recorders = recorders
        self._report = report
        self._last = {side: recorder.newest for side, recorder in recorders.items()}
        self._written = self._lost = 0
        self._events: SimpleQueue[RecordedEvent] = SimpleQueue()
        self._failures = Failures()
        self._is_over = Flag()
        self._thread = Thread(target=self._run, name="full-recorder", daemon=True)

    def start(self) -> None:
        """Begin; without a call of close the thread ends with the process."""
        self._thread.start()

    def on_event(self, event: Event, now: float) -> None:
        """Record ``event``, which happened at ``now`` on the monotonic clock [s]."""
        self._events.put(recorded_event(event, now))

    def close(self) -> None:
        """Write what is left and close the file."""
        self._is_over.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            while not self._is_over.wait(PERIOD):
                self._follow()
            self._follow()
            self._writer.close()
        except Exception as error:  # not begun again: what the file holds after that is not known
            self._failures.note(f"Recording to {self._file}", error)
            self._report(f"The recording to {self._file} ended early: {type(error).__name__}: {error}.")
            return
        lost = f"; {self._lost} were lost, the disk is too slow" if self._lost else ""
        self._report(f"{self._written} cycles are in {self._file}{lost}.")

    def _follow(self) -> None:
        for side, recorder in self._recorders.items():
            for frame in recorder.since(self._last[side]):
                self._writer.add_frame(side, frame)
                self._lost += frame.number - self._last[side] - 1
                self._written += 1
                self._last[side] = frame.number
        while True:
            try:
                self._writer.add_event(self._events.get_nowait())
            except Empty:
                return
