"""The writer of recordings: an MCAP file for our own table and picture, for Foxglove and for ROS's tools."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from math import inf
from pathlib import Path

import msgspec

from abb_protocols.catalogue import message
from abb_protocols.errors import missing_extra
from abb_protocols.robot.gripper_values import GripperState
from abb_protocols.robot.joints import Joints, Pose, Side, finger_names, joint_names, joints, prefixed
from abb_protocols.robot.urdf import read_frames, robot_description
from yumi import __version__
from yumi.control.flight_recorder import RecordedCycle
from yumi.control.shared_state import JointStates
from yumi.recording.message_types import (
    CYCLE_SCHEMA,
    DESCRIPTION_TOPIC,
    ERROR_LEVEL,
    ERROR_SCHEMA,
    EVENT_SCHEMA,
    EVENTS_TOPIC,
    FIXED_FRAMES_TOPIC,
    FRAMES_TOPIC,
    INFO_LEVEL,
    JOINT_STATES_TOPIC,
    TRACKING_ERROR_TOPIC,
    RecordedEvent,
    cycle_topic,
    frame_message,
    plain_json,
    schema_of,
)
from yumi.recording.ros_messages import (
    JOINT_STATE_MESSAGE,
    MESSAGE_DEFINITIONS,
    STRING_MESSAGE,
    TF_MESSAGE,
    RecordedTransform,
    frames_message,
    joint_names_part,
    joint_state_message,
    text_message,
)

_WHOLE_PERIOD = 0.02
"""The whole robot is recorded so often [s]: as often as the driver publishes ``/tf``."""

_STALE = 1.0
"""An arm that was not measured for so long is left out of the whole robot [s], as in the driver's ``joint_states``."""

_CHUNK = 2**16
"""A recording is written in pieces of this size [bytes]: a process that is killed loses the last second at most."""


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
            raise missing_extra(message("recordings_need_mcap"), "yumi-ros2", "record") from error
        file.parent.mkdir(parents=True, exist_ok=True)
        self._stream = file.open("wb")
        self._epoch = epoch
        self._writer = Writer(self._stream, chunk_size=_CHUNK)
        self._writer.start(profile="", library=f"yumi-ros2 {__version__}")
        cycle, event, errors = (
            self._writer.register_schema(str(schema["title"]), "jsonschema", json.dumps(schema).encode())
            for schema in (CYCLE_SCHEMA, EVENT_SCHEMA, ERROR_SCHEMA)
        )
        joint_state, frames, text = (
            self._writer.register_schema(name, "ros2msg", MESSAGE_DEFINITIONS[name].encode())
            for name in (JOINT_STATE_MESSAGE, TF_MESSAGE, STRING_MESSAGE)
        )
        self._names = {side: joint_names_part(joint_names(side)) for side in Side}
        self._channels = {
            EVENTS_TOPIC: self._writer.register_channel(EVENTS_TOPIC, "json", event),
            JOINT_STATES_TOPIC: self._writer.register_channel(JOINT_STATES_TOPIC, "cdr", joint_state),
            FRAMES_TOPIC: self._writer.register_channel(FRAMES_TOPIC, "cdr", frames),
            FIXED_FRAMES_TOPIC: self._writer.register_channel(FIXED_FRAMES_TOPIC, "cdr", frames),
            TRACKING_ERROR_TOPIC: self._writer.register_channel(TRACKING_ERROR_TOPIC, "json", errors),
            DESCRIPTION_TOPIC: self._writer.register_channel(DESCRIPTION_TOPIC, "cdr", text),
        }
        for side in Side:
            names = {"joints": " ".join(joint_names(side))}
            self._channels[cycle_topic(side)] = self._writer.register_channel(cycle_topic(side), "json", cycle, names)
            topic = f"{side.value}/joint_states"
            self._channels[topic] = self._writer.register_channel(topic, "cdr", joint_state)
        self._description = robot_description()
        self._frames = read_frames(self._description)
        self._is_begun = False
        self._arms: dict[Side, JointStates] = {}
        self._fingers: dict[Side, tuple[float, float]] = {}  # position [m] and speed [m/s]
        self._errors: dict[Side, tuple[float, Joints]] = {}  # of a cycle, with its time
        self._whole_at = -inf

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def add_frame(self, side: Side, frame: RecordedCycle) -> None:
        """Append a cycle of one arm."""
        self._add(cycle_topic(side), frame.time, frame.number, frame_message(frame))
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
        self._write(FIXED_FRAMES_TOPIC, nanoseconds, self._fixed_frames(nanoseconds, tools))

    def add_event(self, event: RecordedEvent) -> None:
        """Append an event."""
        seconds, nanoseconds = divmod(self._nanoseconds(event.time), 10**9)
        log = {
            "timestamp": {"sec": seconds, "nsec": nanoseconds},
            "level": ERROR_LEVEL if event.is_fault else INFO_LEVEL,
            "message": event.sentence,
            "name": event.side.word if event.side else "",
            "file": "",
            "line": 0,
        }
        side = event.side.value if event.side else None
        own = {"time": event.time, "side": side, "kind": event.kind, "is_fault": event.is_fault}
        self._add(EVENTS_TOPIC, event.time, 0, {**log, **own})

    def add_value(self, topic: str, time: float, value: object) -> None:
        """Append what was seen of a gripper or the robot at ``time`` on the monotonic clock [s], as an object."""
        message = {"time": time, **plain_json(value)}
        if topic not in self._channels:
            schema = {"title": f"yumi.{type(value).__name__}", **schema_of(message)}
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
        if 0.0 <= time - self._whole_at < _WHOLE_PERIOD - 1e-4:  # what is looked at may be ahead of the cycles
            return
        self._whole_at = time
        position: dict[str, float] = {}
        velocity: list[float] = []
        for side in Side:
            state = self._arms.get(side)
            if state is not None and time - state.time < _STALE:
                position.update(zip(joint_names(side), state.position, strict=True))
                velocity += state.velocity
        for side, (place, speed) in self._fingers.items():
            position.update(dict.fromkeys(finger_names(side), place))
            velocity += (speed, speed)
        nanoseconds = self._nanoseconds(time)
        names = joint_names_part(tuple(position))
        data = joint_state_message(names, nanoseconds, tuple(position.values()), velocity)
        self._write(JOINT_STATES_TOPIC, nanoseconds, data)
        moved = [
            RecordedTransform(nanoseconds, each.parent, each.name, each.to_parent(position[each.joint]))
            for each in self._frames
            if each.joint in position
        ]
        self._write(FRAMES_TOPIC, nanoseconds, frames_message(moved))
        errors = {
            side.word: [round(each, 6) for each in error]  # what is not a number becomes null
            for side, (since, error) in self._errors.items()
            if time - since < _STALE
        }
        if errors:
            self._add(
                TRACKING_ERROR_TOPIC, time, 0, {"time": time, **dict.fromkeys(side.word for side in Side), **errors}
            )

    def _fixed_frames(self, nanoseconds: int, tools: Mapping[Side, Pose]) -> bytes:
        """The frames that no joint moves; ``tools`` are in tool0."""
        fixed = [
            RecordedTransform(nanoseconds, each.parent, each.name, each.origin)
            for each in self._frames
            if not each.joint
        ]
        for side, tool in tools.items():
            names = prefixed(f"yumi_tool0_{side.value}"), prefixed(f"yumi_tcp_{side.value}")
            fixed.append(RecordedTransform(nanoseconds, *names, tool))
        return frames_message(fixed)

    def _add(self, topic: str, time: float, sequence: int, message: Mapping[str, object]) -> None:
        self._write(topic, self._nanoseconds(time), msgspec.json.encode(message), sequence)

    def _write(self, topic: str, nanoseconds: int, data: bytes, sequence: int = 0) -> None:
        if not self._is_begun:  # at the time of the first message, or the recording would begin in 1970
            self._is_begun = True
            self._write(DESCRIPTION_TOPIC, nanoseconds, text_message(self._description))
            self._write(FIXED_FRAMES_TOPIC, nanoseconds, self._fixed_frames(nanoseconds, {}))
        self._writer.add_message(self._channels[topic], nanoseconds, data, nanoseconds, sequence)

    def _nanoseconds(self, time: float) -> int:
        """The time of day of a moment of the monotonic clock [ns since 1970]."""
        return round((self._epoch + time) * 1e9)
