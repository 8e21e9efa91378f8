"""Recordings: cycles, grippers, state and events as an MCAP file, for our own table and picture and for Foxglove.

================================ ======================================================================================
topic                            messages
================================ ======================================================================================
``r/cycle``, ``l/cycle``         every cycle of an arm: JSON, its schema with units is in the file
``r/joint_states``, ``l/…``      its positions and velocities as sensor_msgs/msg/JointState (CDR), for ROS's tools
``joint_states``                 both arms and the fingers as sensor_msgs/msg/JointState (CDR), 50 Hz
``/tf``, ``/tf_static``          the frames that joints move, 50 Hz, and the fixed ones, as tf2_msgs/msg/TFMessage (CDR)
``tracking_error``               how far both arms are from what was sent to them, 50 Hz (JSON)
``robot_description``            the URDF as std_msgs/msg/String (CDR), once: Foxglove shows the robot with it
``events``                       what happened, as foxglove.Log (JSON) with fields of ours, for Foxglove's Log panel
``r/gripper``, ``l/gripper``     a gripper, when something of it changed (JSON)
``state``                        the robot's mode, motors, RAPID, EGM, cause of a stop, when it changed (JSON)
================================ ======================================================================================

A message's log time is the time of day; ``time`` inside is the machine's monotonic clock, by which cycles and events
compare.

What the driver writes down: a flight record when something stops a motion, and every cycle when that was requested.

The control loop only reports events; this end reads the memory it shares (ten seconds of each arm) and writes the
files, on threads of its own, so that neither a cycle nor a reply waits for a disk.
"""

from __future__ import annotations

import json
import struct
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field, fields, is_dataclass, replace
from datetime import datetime
from enum import Enum, IntEnum
from heapq import merge
from io import BytesIO
from math import inf, isfinite, nan
from pathlib import Path
from threading import Event as Flag
from threading import Thread
from types import TracebackType
from typing import Any, NamedTuple

import msgspec

from yumi import __version__
from yumi.catalogue import Message, message
from yumi.clock import Clock
from yumi.control.flight_recorder import FlightRecorder, Frame
from yumi.control.loop_events import Event, is_fault
from yumi.control.shared_state import JointStates
from yumi.control.stage_times import StageTimes
from yumi.errors import ProtocolError, SettingsError, YumiError, missing_extra
from yumi.process.supervision import Failures
from yumi.recording.ros_messages import (
    DEFINITIONS,
    JOINT_STATE,
    STRING,
    TF,
    Transform,
    frames_message,
    joint_names_part,
    joint_state_message,
    text_message,
)
from yumi.robot.description import read_frames, robot_description
from yumi.robot.gripper import GripperState
from yumi.robot.joints import JOINT_COUNT, Joints, Pose, Side, finger_names, joint_names, joints, prefixed


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

_ERROR, _INFO = 4, 2  # levels of foxglove.Log

EVENT_SCHEMA: Mapping[str, object] = {
    "title": "foxglove.Log",
    "type": "object",
    "properties": {
        "timestamp": {
            "type": "object",
            "title": "time",
            "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
        },
        "level": {"type": "integer", "description": f"{_ERROR}: a fault, {_INFO}: anything else"},
        "message": {"type": "string"},
        "name": {"type": "string", "description": "which arm"},
        "file": {"type": "string", "description": "empty; foxglove.Log has it"},
        "line": {"type": "integer", "description": "0; foxglove.Log has it"},
        "time": _number("monotonic clock [s]"),
        "side": {"enum": [*(side.value for side in Side), None], "description": "which arm, null: both"},
        "kind": {"type": "string"},
        "is_fault": {"type": "boolean", "description": "whether it was a fault, and not requested"},
    },
}
"""JSON schema of an event: Foxglove's log message with what is known beside it."""

ERROR_SCHEMA: Mapping[str, object] = {
    "title": "yumi.TrackingError",
    "type": "object",
    "properties": {
        "time": _number("monotonic clock [s]"),
        **{
            side.word: {**_vector("sent minus measured position [rad], null: no cycle"), "type": ["array", "null"]}
            for side in Side
        },
    },
}
"""JSON schema of how far the arms are from what was sent to them."""

_VECTORS = ("position", "velocity", "planned", "desired", "sent", "sent_velocity", "reference")


def frame_message(frame: Frame) -> dict[str, object]:
    """The object of a cycle; what is not a finite number becomes null, which JSON has."""
    message: dict[str, object] = {name: getattr(frame, name) for name in CYCLE_SCHEMA["properties"]}
    for name in _VECTORS:
        values = getattr(frame, name)
        message[name] = None if values is None else [value if isfinite(value) else None for value in values]
    message["stages"] = {name: getattr(frame.stages, name) for name in STAGES}
    return message


_Vector = tuple[float | None, float | None, float | None, float | None, float | None, float | None, float | None]
_Flat = bool | int | float | str | list[bool | int | float | str | None] | None
_Object = dict[str, _Flat | dict[str, _Flat | dict[str, _Flat]]]
"""What was seen of a gripper or the robot; so deep and no deeper, because it is read recursively."""


class _CycleMessage(msgspec.Struct):
    """A cycle as a recording has it."""

    number: int
    time: float
    dt: float
    session: int
    is_running: bool
    position: _Vector
    velocity: _Vector
    planned: _Vector
    desired: _Vector | None
    sent: _Vector
    sent_velocity: _Vector
    reference: _Vector | None
    stages: StageTimes


class _EventMessage(msgspec.Struct):
    """An event as a recording has it."""

    time: float
    side: Side | None
    kind: str
    message: str
    is_fault: bool


class _Timed(msgspec.Struct):
    time: float


_cycle_decoder, _event_decoder = msgspec.json.Decoder(_CycleMessage), msgspec.json.Decoder(_EventMessage)
_time_decoder, _object_decoder = msgspec.json.Decoder(_Timed), msgspec.json.Decoder(_Object)


def decode_cycle(data: bytes) -> Frame:
    """The cycle of a message of a recording.

    Raises:
        ValueError: it is not JSON, or not such a message.
        RecursionError: it is nested deeper than anything that is recorded.
    """

    def vector(values: _Vector) -> Joints:
        return joints([nan if value is None else value for value in values])

    message = _cycle_decoder.decode(data)
    return Frame(
        number=message.number,
        time=message.time,
        dt=message.dt,
        session=message.session,
        is_running=message.is_running,
        position=vector(message.position),
        velocity=vector(message.velocity),
        planned=vector(message.planned),
        desired=None if message.desired is None else vector(message.desired),
        sent=vector(message.sent),
        sent_velocity=vector(message.sent_velocity),
        reference=None if message.reference is None else vector(message.reference),
        stages=message.stages,
    )


def _decode_event(data: bytes) -> RecordedEvent:
    message = _event_decoder.decode(data)
    return RecordedEvent(message.time, message.side, message.kind, message.message, message.is_fault)


def _decode_object(data: bytes) -> Mapping[str, Any]:
    return {**_object_decoder.decode(data), "time": _time_decoder.decode(data).time}


def plain(value: object) -> Any:
    """``value`` as JSON has it: a message becomes its sentence, a value class an object, an enum its name or text."""
    if isinstance(value, Message):
        return str(value)
    if is_dataclass(value):
        value = {each.name: getattr(value, each.name) for each in fields(value)}
    if isinstance(value, Mapping):
        return {str(plain(key)): plain(item) for key, item in value.items()}
    if isinstance(value, Enum):
        return value.name if isinstance(value, IntEnum) else value.value
    if isinstance(value, tuple | list):
        return [plain(item) for item in value]
    return None if isinstance(value, float) and not isfinite(value) else value


def _schema_of(value: object) -> dict[str, object]:
    """A JSON schema that fits ``value``, so that Foxglove offers its fields; null may turn into anything."""
    if isinstance(value, Mapping):
        return {"type": "object", "properties": {key: _schema_of(item) for key, item in value.items()}}
    if isinstance(value, list):
        return {"type": "array"}
    kinds = {bool: "boolean", int: "number", float: "number", str: "string"}
    return {"type": kinds[type(value)]} if type(value) in kinds else {}


EVENTS = "events"
"""The topic of events."""

JOINT_STATES, FRAMES, FIXED_FRAMES, ERRORS = "joint_states", "/tf", "/tf_static", "tracking_error"
"""The topics of the whole robot; frames have the names of the description, without a prefix of ``/tf``."""

DESCRIPTION = "robot_description"
"""The topic of the URDF."""

WHOLE_PERIOD = 0.02
"""The whole robot is recorded so often [s]: as often as the driver publishes ``/tf``."""

STALE = 1.0
"""An arm that was not measured for so long is left out of the whole robot [s], as in the driver's ``joint_states``."""

STATE = "state"
"""The topic of the robot's state."""

BEFORE = 11.0
"""A flight record as a whole: its ten seconds end a little before the event [s]."""

AFTER = 2.0
"""A flight record goes on for so long after its event: what the robot did once it was to hold [s]."""

CHUNK = 2**16
"""A recording is written in pieces of this size [bytes]: a process that is killed loses the last second at most."""

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


def _described(event: RecordedEvent, sentence: Future[Message]) -> RecordedEvent:
    """``event`` with what is said of it, as far as that is known by now."""
    return replace(event, sentence=str(sentence.result())) if sentence.done() else event


class RecordingWriter:
    """A recording that is being written; a context manager.

    Args:
        file: where to; its folder is made, a file of that name is replaced.
        epoch: time of day when the monotonic clock was 0 [s since 1970].
        description: the robot's URDF; by default that of a YuMi with the usual grippers.

    Raises:
        MissingPrerequisite: the library is not installed.
        OSError: the file cannot be written; so do the methods.
    """

    def __init__(self, file: Path, epoch: float, description: str | None = None) -> None:
        try:
            from mcap.writer import Writer  # noqa: PLC0415 - an extra; nothing else needs it
        except ImportError as error:
            raise missing_extra(message("recordings_need_mcap"), "record") from error
        file.parent.mkdir(parents=True, exist_ok=True)
        self._stream = file.open("wb")
        self._epoch = epoch
        self._writer = Writer(self._stream, chunk_size=CHUNK)
        self._writer.start(profile="", library=f"yumi-ros2 {__version__}")
        cycle, event, errors = (
            self._writer.register_schema(str(schema["title"]), "jsonschema", json.dumps(schema).encode())
            for schema in (CYCLE_SCHEMA, EVENT_SCHEMA, ERROR_SCHEMA)
        )
        joint_state, frames, text = (
            self._writer.register_schema(name, "ros2msg", DEFINITIONS[name].encode())
            for name in (JOINT_STATE, TF, STRING)
        )
        self._names = {side: joint_names_part(joint_names(side)) for side in Side}
        self._channels = {
            EVENTS: self._writer.register_channel(EVENTS, "json", event),
            JOINT_STATES: self._writer.register_channel(JOINT_STATES, "cdr", joint_state),
            FRAMES: self._writer.register_channel(FRAMES, "cdr", frames),
            FIXED_FRAMES: self._writer.register_channel(FIXED_FRAMES, "cdr", frames),
            ERRORS: self._writer.register_channel(ERRORS, "json", errors),
            DESCRIPTION: self._writer.register_channel(DESCRIPTION, "cdr", text),
        }
        for side in Side:
            names = {"joints": " ".join(joint_names(side))}
            self._channels[_topic(side)] = self._writer.register_channel(_topic(side), "json", cycle, names)
            topic = f"{side.value}/joint_states"
            self._channels[topic] = self._writer.register_channel(topic, "cdr", joint_state)
        self._description = description or robot_description()
        self._frames = read_frames(self._description)
        self._is_begun = False
        self._arms: dict[Side, JointStates] = {}
        self._fingers: dict[Side, tuple[float, float]] = {}  # position [m] and speed [m/s]
        self._errors: dict[Side, tuple[float, Joints]] = {}  # of a cycle, with its time
        self._whole_at = -inf

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def add_frame(self, side: Side, frame: Frame) -> None:
        """Append a cycle of one arm."""
        self._add(_topic(side), frame.time, frame.number, frame_message(frame))
        nanoseconds = self._nanoseconds(frame.time)
        data = joint_state_message(self._names[side], nanoseconds, frame.position, frame.velocity)
        self._write(f"{side.value}/joint_states", nanoseconds, data, frame.number)
        self._errors[side] = frame.time, joints([a - b for a, b in zip(frame.sent, frame.position, strict=True)])
        self.add_joints(side, JointStates(frame.time, frame.position, frame.velocity))

    def add_joints(self, side: Side, state: JointStates) -> None:
        """Have the topics of the whole robot show an arm where it was measured; a cycle does that, too."""
        self._arms[side] = state
        self._add_whole(state.time)

    def add_tools(self, time: float, tools: Mapping[Side, Pose]) -> None:
        """Append the fixed frames, now with the tools that are in use from ``time`` on, monotonic clock [s]."""
        nanoseconds = self._nanoseconds(time)
        self._write(FIXED_FRAMES, nanoseconds, self._fixed_frames(nanoseconds, tools))

    def add_event(self, event: RecordedEvent) -> None:
        """Append an event."""
        seconds, nanoseconds = divmod(self._nanoseconds(event.time), 10**9)
        log = {
            "timestamp": {"sec": seconds, "nsec": nanoseconds},
            "level": _ERROR if event.is_fault else _INFO,
            "message": event.sentence,
            "name": event.side.word if event.side else "",
            "file": "",
            "line": 0,
        }
        side = event.side.value if event.side else None
        own = {"time": event.time, "side": side, "kind": event.kind, "is_fault": event.is_fault}
        self._add(EVENTS, event.time, 0, {**log, **own})

    def add_value(self, topic: str, time: float, value: object) -> None:
        """Append what was seen of a gripper or the robot at ``time`` on the monotonic clock [s], as an object."""
        message = {"time": time, **plain(value)}
        if topic not in self._channels:
            schema = {"title": f"yumi.{type(value).__name__}", **_schema_of(message)}
            number = self._writer.register_schema(str(schema["title"]), "jsonschema", json.dumps(schema).encode())
            self._channels[topic] = self._writer.register_channel(topic, "json", number)
        self._add(topic, time, 0, message)
        if isinstance(value, GripperState):
            self._fingers[Side(topic[0])] = value.position, value.speed
            self._add_whole(time)

    def close(self) -> None:
        """Write the index; without it the file is readable, but slowly."""
        try:
            self._writer.finish()
        finally:
            self._stream.close()

    def abandon(self) -> None:
        """Close the file as it is, after writing to it has failed."""
        with suppress(OSError):  # what is still buffered finds no room either
            self._stream.close()

    def _add_whole(self, time: float) -> None:
        """Append the whole robot as far as it is known at ``time`` [s], unless that was done just before."""
        if 0.0 <= time - self._whole_at < WHOLE_PERIOD - 1e-4:  # what is looked at may be ahead of the cycles
            return
        self._whole_at = time
        position: dict[str, float] = {}
        velocity: list[float] = []
        for side in Side:
            state = self._arms.get(side)
            if state is not None and time - state.time < STALE:
                position.update(zip(joint_names(side), state.position, strict=True))
                velocity += state.velocity
        for side, (place, speed) in self._fingers.items():
            position.update(dict.fromkeys(finger_names(side), place))
            velocity += (speed, speed)
        nanoseconds = self._nanoseconds(time)
        names = joint_names_part(tuple(position))
        data = joint_state_message(names, nanoseconds, tuple(position.values()), velocity)
        self._write(JOINT_STATES, nanoseconds, data)
        moved = [
            Transform(nanoseconds, each.parent, each.name, each.to_parent(position[each.joint]))
            for each in self._frames
            if each.joint in position
        ]
        self._write(FRAMES, nanoseconds, frames_message(moved))
        errors = {
            side.word: [round(each, 6) for each in error]  # what is not a number becomes null
            for side, (since, error) in self._errors.items()
            if time - since < STALE
        }
        if errors:
            self._add(ERRORS, time, 0, {"time": time, **dict.fromkeys(side.word for side in Side), **errors})

    def _fixed_frames(self, nanoseconds: int, tools: Mapping[Side, Pose]) -> bytes:
        """The frames that no joint moves; ``tools`` are in tool0."""
        fixed = [Transform(nanoseconds, each.parent, each.name, each.origin) for each in self._frames if not each.joint]
        for side, tool in tools.items():
            names = prefixed(f"yumi_tool0_{side.value}"), prefixed(f"yumi_tcp_{side.value}")
            fixed.append(Transform(nanoseconds, *names, tool))
        return frames_message(fixed)

    def _add(self, topic: str, time: float, sequence: int, message: Mapping[str, object]) -> None:
        self._write(topic, self._nanoseconds(time), msgspec.json.encode(message), sequence)

    def _write(self, topic: str, nanoseconds: int, data: bytes, sequence: int = 0) -> None:
        if not self._is_begun:  # at the time of the first message, or the recording would begin in 1970
            self._is_begun = True
            self._write(DESCRIPTION, nanoseconds, text_message(self._description))
            self._write(FIXED_FRAMES, nanoseconds, self._fixed_frames(nanoseconds, {}))
        self._writer.add_message(self._channels[topic], nanoseconds, data, nanoseconds, sequence)

    def _nanoseconds(self, time: float) -> int:
        """The time of day of a moment of the monotonic clock [ns since 1970]."""
        return round((self._epoch + time) * 1e9)


def read_recording(file: Path, *, before: float = BEFORE, after: float = AFTER) -> Recording:
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
    sides = {_topic(side): side for side in Side}
    for topic, _, value in recorded_messages(file):
        if topic is None:
            is_complete = True
        elif topic == EVENTS:
            events.append(value)
        elif topic in sides:
            last = max(last, value.time)
    stop = next((event for event in reversed(events) if event.is_fault), None)
    middle = stop.time if stop else last

    # A second pass, so that of a long recording only the cycles that are shown are kept in memory.
    frames: dict[Side, list[Frame]] = {side: [] for side in Side}
    for topic, _, value in recorded_messages(file):
        if topic in sides and middle - before <= value.time <= middle + after:
            frames[sides[topic]].append(value)
    recorded = {side: tuple(each) for side, each in frames.items() if each}
    return Recording(tuple(events), stop, recorded, is_complete)


def recorded_messages(file: Path) -> Iterator[tuple[str | None, int, Any]]:
    """Topic, time of day [ns since 1970] and value of every message of ours in JSON, in the order of the file.

    The value is a Frame, a RecordedEvent, or of grippers and the robot's state a mapping with ``time``. At last (None,
    0, None) where the file was closed.

    Raises:
        ProtocolError: the file is not such a recording, or nothing is recorded in it.
        MissingPrerequisite: the library is not installed.
    """
    decoders: dict[str, Callable[[bytes], Any]] = {EVENTS: _decode_event, STATE: _decode_object}
    decoders |= {f"{side.value}/gripper": _decode_object for side in Side}
    decoders |= {_topic(side): decode_cycle for side in Side}
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
        if encoding != "cdr" or schema not in (JOINT_STATE, _ARRAY):
            continue
        try:
            reader = _CdrReader(data)
            if schema == JOINT_STATE:
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
        raise missing_extra(message("recordings_need_mcap"), "record") from error
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


def _topic(side: Side) -> str:
    return f"{side.value}/cycle"


CYCLES_PERIOD = 0.02
"""How often a full recording reads the memories [s]: the less there is to write at once, the less others wait."""

SOURCE_PERIOD = 0.1
"""How often a full recording looks at grippers and the robot's state [s]."""

Source = Callable[[], object | None]
"""What is known now: a value class; None, or a YumiError, while nothing is."""


@dataclass(frozen=True, slots=True)
class Sources:
    """What a full recording looks at beside the cycles, ten times a second.

    Attributes:
        values: by topic: a value class, or None while nothing is known; recorded when it changes.
        joints: an arm as it was read from the controller last, for while EGM does not report it.
        tcp: the tool in use of an arm, in tool0.
    """

    values: Mapping[str, Source] = field(default_factory=dict)
    joints: Callable[[Side], JointStates | None] = lambda side: None
    tcp: Callable[[Side], Pose] | None = None


Describe = Callable[[Event, Callable[[Message], None]], None]
"""Calls back with what is said of an event: at once, or on another thread when its cause is known."""


def _say_at_once(event: Event, then: Callable[[Message], None]) -> None:
    then(event.said)


_NAME = "flight_"


class Recorder:
    """Writes the files that an event, or a recording of the whole session, asks for.

    Args:
        folder: where flight records go; made when the first one is written.
        keep: how many of them stay; the oldest ones are deleted.
        recorders: the memory of each arm.
        report: called with one sentence for each file; on another thread.
        clock: of the events.
        describe: what is said of an event; where its cause is known only later, that is recorded then.
    """

    def __init__(
        self,
        folder: Path,
        keep: int,
        recorders: Mapping[Side, FlightRecorder],
        report: Callable[[str], None],
        clock: Clock,
        describe: Describe = _say_at_once,
    ) -> None:
        self._describe = describe
        self._folder = folder
        self._keep = keep
        self._recorders = recorders
        self._report = report
        self._clock = clock
        self._failures = Failures()
        self._is_over = Flag()
        # What led to a stop is on the disk at once, whatever the records before are still waiting for.
        self._begins = ThreadPoolExecutor(1, thread_name_prefix="flight-records")
        self._follows = ThreadPoolExecutor(1, thread_name_prefix="flight-records-after")
        self._full: FullRecorder | None = None

    def record_all(self, file: Path, epoch: float, sources: Sources | None = None) -> None:
        """Write every cycle from now on to ``file``, and what ``sources`` show.

        Args:
            file: a new one, or one to be replaced.
            epoch: time of day when the monotonic clock was 0 [s since 1970].
            sources: what to look at beside the cycles.

        Raises:
            SettingsError: the file cannot be written.
            MissingPrerequisite: the library is not installed.
        """
        try:
            self._full = FullRecorder(file, epoch, self._recorders, self._report, self._clock, sources)
        except OSError as error:
            raise SettingsError(message("recording_not_writable", file=str(file), reason=error.strerror)) from error
        self._full.start()

    def on_event(self, event: Event, now: float, time_of_day: float) -> None:
        """Write down what happened, and what follows for :data:`AFTER`; does not wait for a disk.

        Args:
            event: of the control loop.
            now: monotonic clock [s].
            time_of_day: at the same moment [s since 1970].
        """
        sentence: Future[Message] = Future()
        if is_fault(event):
            memory = self._recorders[event.side].copy()
            try:
                self._begins.submit(self._write, recorded_event(event, now), sentence, event.side, memory, time_of_day)
            except RuntimeError as error:  # the operating system permits no thread
                self._report(f"The flight record of the {event.side.word} arm could not be begun: {error}.")
        if self._full:
            self._full.on_event(event, now, sentence)
        self._describe(event, sentence.set_result)

    def close(self) -> None:
        """Wait until everything is written; a record that is not at its end yet ends now."""
        self._is_over.set()
        self._begins.shutdown()  # each begun record has asked for its rest by then
        self._follows.shutdown()
        if self._full:
            self._full.close()

    def _write(
        self, event: RecordedEvent, sentence: Future[Message], side: Side, memory: FlightRecorder, time_of_day: float
    ) -> None:
        """Write what led to the event; this process may end meanwhile."""
        moment = datetime.fromtimestamp(time_of_day)
        name = f"{_NAME}{moment:%Y-%m-%d_%H-%M-%S}-{moment.microsecond // 1000:03}_{side.word}.mcap"
        file = self._folder / name

        def write(target: Path, frames: Sequence[Frame], event: RecordedEvent) -> None:
            with RecordingWriter(target, time_of_day - event.time) as writer:
                for frame in frames:
                    writer.add_frame(side, frame)
                writer.add_event(event)

        try:
            # The cycles that led to the event; not those of an earlier session.
            frames = [frame for frame in memory.frames() if frame.time >= event.time - BEFORE]
            write(file, frames, event)
            self._make_room()
        except (YumiError, OSError) as error:
            self._report(f"The flight record could not be written to {file}: {error}")
            return
        except Exception as error:  # the thread pool would keep it to itself
            self._failures.note(f"Writing the flight record {file}", error)
            return
        try:
            self._follows.submit(self._go_on, event, sentence, side, memory.newest, file, frames, write)
        except RuntimeError as error:  # the operating system permits no thread
            self._report_without_rest(file, error)

    def _go_on(
        self,
        event: RecordedEvent,
        sentence: Future[Message],
        side: Side,
        newest: int,
        file: Path,
        frames: Sequence[Frame],
        write: Callable[[Path, Sequence[Frame], RecordedEvent], None],
    ) -> None:
        """Replace a record by one that also has what followed its event, and what has become known of its cause."""
        whole = file.with_suffix(".part")
        after: list[Frame] = []
        try:
            self._is_over.wait(event.time + AFTER - self._clock.now())
            after += (each for each in self._recorders[side].since(newest) if each.time <= event.time + AFTER)
            described = _described(event, sentence)
            if after or described != event:
                write(whole, [*frames, *after], described)
                whole.replace(file)
            self._make_room()
        except Exception as error:
            with suppress(OSError):  # its folder may be gone
                whole.unlink(missing_ok=True)
            if not isinstance(error, YumiError | OSError):  # the thread pool would keep it to itself
                self._failures.note(f"Writing the flight record {file}", error)
            self._report_without_rest(file, error)
            return
        seconds = frames[-1].time - frames[0].time if frames else 0.0
        follows = f", and {max(0.0, after[-1].time - event.time):.1f} s after the stop," if after else ""
        self._report(f"The last {seconds:.1f} s of the {side.word} arm{follows} are in {file}: yumi record show {file}")

    def _report_without_rest(self, file: Path, error: Exception) -> None:
        self._report(f"What followed the stop could not be written: {error}. What led to it is in {file}.")

    def _make_room(self) -> None:
        for oldest in sorted(self._folder.glob(f"{_NAME}*.mcap"))[: -self._keep]:
            oldest.unlink(missing_ok=True)


class FullRecorder:
    """Writes every cycle of both arms to one file, on a thread of its own, between start and close.

    It follows the memories, which hold ten seconds: a disk that hesitates loses nothing, and what is lost all the same
    is counted.

    Args:
        file: where to.
        epoch: time of day when the monotonic clock was 0 [s since 1970].
        recorders: the memory of each arm.
        report: called with one sentence when it ends.
        clock: gives the monotonic time; needed with sources.
        sources: as in :meth:`Recorder.record_all`.

    Raises:
        MissingPrerequisite: the library is not installed.
        OSError: the file cannot be written.
    """

    def __init__(
        self,
        file: Path,
        epoch: float,
        recorders: Mapping[Side, FlightRecorder],
        report: Callable[[str], None],
        clock: Clock | None = None,
        sources: Sources | None = None,
    ) -> None:
        self._file = file
        self._clock = clock
        self._sources = sources or Sources()
        self._seen: dict[str, object] = {}
        self._arms_seen: dict[Side, float] = {}  # when each arm was measured last, on the monotonic clock [s]
        self._tools: Mapping[Side, Pose] = {}
        self._looked_at = -inf
        self._writer = RecordingWriter(file, epoch)
        self._recorders = recorders
        self._report = report
        self._last = {side: recorder.newest for side, recorder in recorders.items()}
        self._written = self._lost = 0
        self._events: deque[tuple[RecordedEvent, Future[Message]]] = deque()
        self._failures = Failures()
        self._is_over = Flag()
        self._thread = Thread(target=self._run, name="full-recorder", daemon=True)

    def start(self) -> None:
        """Begin; without a call of close the thread ends with the process."""
        self._thread.start()

    def on_event(self, event: Event, now: float, sentence: Future[Message]) -> None:
        """Record ``event``, which happened at ``now`` on the monotonic clock [s], once its sentence is known."""
        self._events.append((recorded_event(event, now), sentence))

    def close(self) -> None:
        """Write what is left and close the file."""
        self._is_over.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            while not self._is_over.wait(CYCLES_PERIOD):
                self._follow()
            self._follow()
            self._writer.close()
        except Exception as error:  # not begun again: what the file holds after that is not known
            self._writer.abandon()
            self._failures.note(f"Recording to {self._file}", error)
            self._report(f"The recording to {self._file} ended early: {type(error).__name__}: {error}.")
            return
        lost = f"; {self._lost} were lost, the disk is too slow" if self._lost else ""
        self._report(f"{self._written} cycles are in {self._file}{lost}.")

    def _follow(self) -> None:
        # Both arms in the order of their cycles: the whole robot is recorded as it was at one time.
        for side, frame in merge(*map(self._new_cycles, self._recorders), key=lambda each: each[1].time):
            self._writer.add_frame(side, frame)
            self._arms_seen[side] = frame.time
            self._written += 1
        while self._events and (self._events[0][1].done() or self._is_over.is_set()):  # in the order they happened
            self._writer.add_event(_described(*self._events.popleft()))
        if self._clock is None or self._clock.now() - self._looked_at < SOURCE_PERIOD:
            return
        self._looked_at = now = self._clock.now()
        for topic, source in self._sources.values.items():
            try:
                value = source()
            except YumiError:
                continue  # nothing is known: the controller does not answer, or has no gripper there
            if value is not None and value != self._seen.get(topic):
                self._writer.add_value(topic, now, value)
                self._seen[topic] = value
        for side in Side:
            state = self._sources.joints(side)
            if state is not None and state.time > self._arms_seen.get(side, -inf):
                self._writer.add_joints(side, state)
                self._arms_seen[side] = state.time
        tools = {side: self._sources.tcp(side) for side in Side} if self._sources.tcp else {}
        if tools != self._tools:
            self._writer.add_tools(now, tools)
            self._tools = tools

    def _new_cycles(self, side: Side) -> Iterator[tuple[Side, Frame]]:
        for frame in self._recorders[side].since(self._last[side]):
            self._lost += frame.number - self._last[side] - 1
            self._last[side] = frame.number
            yield side, frame
