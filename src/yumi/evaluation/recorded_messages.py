"""Cycles and events as the JSON objects of a recording, and the schemas that describe them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import isfinite, nan
from typing import Any

from yumi.control.flight_recorder import Frame
from yumi.control.stations import StationTimes
from yumi.robot.joints import JOINT_COUNT, Joints, Side, joints


@dataclass(frozen=True, slots=True)
class RecordedEvent:
    """Something that happened to an arm.

    Attributes:
        time: when, on the machine's monotonic clock [s].
        side: which arm; None when it concerns both.
        kind: the event's class, e.g. ``SessionLost``.
        sentence: what the log says of it.
        is_fault: whether nobody asked for it.
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


STATIONS = tuple(item.name for item in fields(StationTimes))
"""The stations of a cycle in their order."""

CYCLE_SCHEMA: Mapping[str, object] = {
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
        "wanted": {**_vector("positions the controllers wanted [rad], null: hold"), "type": ["array", "null"]},
        "admitted": _vector("positions the arm was told [rad]"),
        "admitted_velocity": _vector("velocities the arm was told [rad/s]"),
        "reference": {**_vector("goal of the active controller [rad], null: none"), "type": ["array", "null"]},
        "stations": {
            "type": "object",
            "description": "how long each station of the cycle took [s]",
            "properties": {name: {"type": "number"} for name in STATIONS},
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
        "is_fault": {"type": "boolean", "description": "whether nobody asked for it"},
    },
}
"""JSON schema of an event."""


def frame_message(frame: Frame) -> dict[str, object]:
    """The object of a cycle; what is no finite number becomes null, which JSON has."""
    return {
        "number": frame.number,
        "time": frame.time,
        "dt": frame.dt,
        "session": frame.session,
        "is_running": frame.is_running,
        "position": _numbers(frame.position),
        "velocity": _numbers(frame.velocity),
        "planned": _numbers(frame.planned),
        "wanted": None if frame.wanted is None else _numbers(frame.wanted),
        "admitted": _numbers(frame.admitted),
        "admitted_velocity": _numbers(frame.admitted_velocity),
        "reference": None if frame.reference is None else _numbers(frame.reference),
        "stations": {name: getattr(frame.stations, name) for name in STATIONS},
    }


def frame_from_message(message: Mapping[str, Any]) -> Frame:
    """The cycle of an object.

    Raises:
        KeyError: a part is missing.
        TypeError: a part is of the wrong kind.
        ValueError: a vector has not seven numbers.
    """
    wanted, reference = message["wanted"], message["reference"]
    return Frame(
        number=int(message["number"]),
        time=float(message["time"]),
        dt=float(message["dt"]),
        session=int(message["session"]),
        is_running=bool(message["is_running"]),
        position=_joints(message["position"]),
        velocity=_joints(message["velocity"]),
        planned=_joints(message["planned"]),
        wanted=None if wanted is None else _joints(wanted),
        admitted=_joints(message["admitted"]),
        admitted_velocity=_joints(message["admitted_velocity"]),
        reference=None if reference is None else _joints(reference),
        stations=StationTimes(*(float(message["stations"][name]) for name in STATIONS)),
    )


def event_message(event: RecordedEvent) -> dict[str, object]:
    """The object of an event."""
    return {
        "time": event.time,
        "side": event.side.value if event.side else None,
        "kind": event.kind,
        "sentence": event.sentence,
        "is_fault": event.is_fault,
    }


def event_from_message(message: Mapping[str, Any]) -> RecordedEvent:
    """The event of an object.

    Raises:
        KeyError: a part is missing.
        ValueError: there is no such arm.
    """
    return RecordedEvent(
        time=float(message["time"]),
        side=None if message["side"] is None else Side(message["side"]),
        kind=str(message["kind"]),
        sentence=str(message["sentence"]),
        is_fault=bool(message["is_fault"]),
    )


def _numbers(values: Joints) -> list[float | None]:
    return [value if isfinite(value) else None for value in values]


def _joints(values: list[float | None]) -> Joints:
    return joints([nan if value is None else value for value in values])
