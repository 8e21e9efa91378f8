"""Messages of a recording: what each topic contains (cycles, events), levels and schemas, and their text in JSON.

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
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum, IntEnum
from math import isfinite, nan
from typing import Any, get_type_hints

import msgspec

from abb_protocols.catalogue import Message
from abb_protocols.robot.joints import JOINT_COUNT, Joints, Side, joints
from yumi.control.flight_recorder import RecordedCycle
from yumi.control.loop_events import Event, is_fault
from yumi.control.stage_times import StageTimes


class RecordedEvent(msgspec.Struct, frozen=True, rename={"sentence": "message"}):
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


CYCLE_STAGES = tuple(item.name for item in fields(StageTimes))
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
            "properties": {name: {"type": "number"} for name in CYCLE_STAGES},
        },
    },
}
"""JSON schema of a cycle."""

ERROR_LEVEL, INFO_LEVEL = 4, 2  # levels of foxglove.Log

EVENT_SCHEMA: Mapping[str, object] = {
    "title": "foxglove.Log",
    "type": "object",
    "properties": {
        "timestamp": {
            "type": "object",
            "title": "time",
            "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
        },
        "level": {"type": "integer", "description": f"{ERROR_LEVEL}: a fault, {INFO_LEVEL}: anything else"},
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

_FIELDS = get_type_hints(RecordedCycle)
_Vector = tuple[float | None, float | None, float | None, float | None, float | None, float | None, float | None]
_VECTORS: Mapping[Any, Any] = {Joints: _Vector, Joints | None: _Vector | None}
CYCLE_VECTORS = tuple(name for name, kind in _FIELDS.items() if kind in _VECTORS)
"""Fields of a cycle with a value for each joint."""

_CycleMessage = msgspec.defstruct("_CycleMessage", [(name, _VECTORS.get(kind, kind)) for name, kind in _FIELDS.items()])


def frame_message(frame: RecordedCycle) -> dict[str, object]:
    """The object of a cycle; what is not a finite number becomes null, which JSON has."""
    message: dict[str, object] = {name: getattr(frame, name) for name in _FIELDS}
    for name in CYCLE_VECTORS:
        values = getattr(frame, name)
        message[name] = None if values is None else [value if isfinite(value) else None for value in values]
    message["stages"] = {name: getattr(frame.stages, name) for name in CYCLE_STAGES}
    return message


_Flat = bool | int | float | str | list[bool | int | float | str | None] | None
_Object = dict[str, _Flat | dict[str, _Flat | dict[str, _Flat]]]
"""What was seen of a gripper or the robot; so deep and no deeper, because it is read recursively."""


class _Timed(msgspec.Struct):
    time: float


_cycle_decoder, _event_decoder = msgspec.json.Decoder(_CycleMessage), msgspec.json.Decoder(RecordedEvent)
_time_decoder, _object_decoder = msgspec.json.Decoder(_Timed), msgspec.json.Decoder(_Object)


def decode_cycle(data: bytes) -> RecordedCycle:
    """The cycle of a message of a recording.

    Raises:
        ValueError: it is not JSON, or not such a message.
        RecursionError: it is nested deeper than anything that is recorded.
    """
    message = _cycle_decoder.decode(data)
    values = {name: getattr(message, name) for name in _FIELDS}
    for name in CYCLE_VECTORS:
        if values[name] is not None:
            values[name] = joints([nan if value is None else value for value in values[name]])
    return RecordedCycle(**values)


def decode_event(data: bytes) -> RecordedEvent:
    return _event_decoder.decode(data)


def decode_object(data: bytes) -> Mapping[str, Any]:
    return {**_object_decoder.decode(data), "time": _time_decoder.decode(data).time}


def plain_json(value: object) -> Any:
    """``value`` as JSON has it: a message becomes its sentence, a value class an object, an enum its name or text."""
    if isinstance(value, Message):
        return str(value)
    if is_dataclass(value):
        value = {each.name: getattr(value, each.name) for each in fields(value)}
    if isinstance(value, Mapping):
        return {str(plain_json(key)): plain_json(item) for key, item in value.items()}
    if isinstance(value, Enum):
        return value.name if isinstance(value, IntEnum) else value.value
    if isinstance(value, tuple | list):
        return [plain_json(item) for item in value]
    return None if isinstance(value, float) and not isfinite(value) else value


def schema_of(value: object) -> dict[str, object]:
    """A JSON schema that fits ``value``, so that Foxglove offers its fields; null may turn into anything."""
    if isinstance(value, Mapping):
        return {"type": "object", "properties": {key: schema_of(item) for key, item in value.items()}}
    if isinstance(value, list):
        return {"type": "array"}
    kinds = {bool: "boolean", int: "number", float: "number", str: "string"}
    return {"type": kinds[type(value)]} if type(value) in kinds else {}


EVENTS_TOPIC = "events"
"""The topic of events."""

JOINT_STATES_TOPIC, FRAMES_TOPIC, FIXED_FRAMES_TOPIC, TRACKING_ERROR_TOPIC = (
    "joint_states",
    "/tf",
    "/tf_static",
    "tracking_error",
)
"""The topics of the whole robot; frames have the names of the description, without a prefix of ``/tf``."""

DESCRIPTION_TOPIC = "robot_description"
"""The topic of the URDF."""

STATE_TOPIC = "state"
"""The topic of the robot's state."""


def recorded_event(event: Event, time: float) -> RecordedEvent:
    """``event`` as it is recorded, having happened at ``time`` on the monotonic clock [s]."""
    return RecordedEvent(time, event.side, type(event).__name__, str(event), is_fault(event))


def cycle_topic(side: Side) -> str:
    return f"{side.value}/cycle"
