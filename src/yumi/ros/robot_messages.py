"""The robot's state as messages: on ``yumi_robot_manager/state``, in results of its actions, in ``/diagnostics``."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime, timezone
from enum import Enum

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from std_msgs.msg import Header
from yumi_interfaces.msg import ControllerEvent
from yumi_interfaces.msg import RobotState as RobotStateMessage

from yumi.errors import CommandRefused
from yumi.hardware.event_texts import EVENT_TEXTS
from yumi.hardware.manager_state import Mode, RobotState
from yumi.hardware.state_machine import MachineState
from yumi.robot.joints import Side
from yumi.ros.conversions import stamp
from yumi.rws.replies import Event
from yumi.rws.states import EventType

_TIME = "%Y-%m-%d T %H:%M:%S"  # as the controller prints it
_TYPES = {EventType.INFORMATION: "information", EventType.WARNING: "warning", EventType.ERROR: "error"}
_SIDES = {side.word: side for side in Side}
_PERCENT = 100
_LAST_SECOND = 2**31 - 1
_LARGEST_CODE = 2**32 - 1


def robot_state(state: RobotState, time_ns: int) -> RobotStateMessage:
    """The state as a message; what is not known is empty."""
    return RobotStateMessage(
        header=Header(stamp=stamp(time_ns)),
        is_connected=state.is_connected,
        is_ready=not state.reason,
        reason=state.reason,
        cause=state.cause,
        stop=state.stop,
        speed_scale=state.speed_scale,
        operating_mode=_word(state.mode),
        controller_state=_word(state.controller_state),
        rapid_execution=_word(state.execution),
        right_state_machine=_machine(state, Side.RIGHT),
        left_state_machine=_machine(state, Side.LEFT),
        right_egm=state.egm[Side.RIGHT],
        left_egm=state.egm[Side.LEFT],
        speed_ratio=min(max(state.speed_ratio or 0, 0), _PERCENT),
        last_event=controller_event(state.last_event),
    )


def controller_event(event: Event | None) -> ControllerEvent:
    """A message of the event log with our words; the number 0 where there is none."""
    if event is None:
        return ControllerEvent()
    text = EVENT_TEXTS.get(event.code)
    return ControllerEvent(
        number=min(max(event.code, 0), _LARGEST_CODE),
        type=_TYPES[event.type],
        title=event.title,
        stamp=_stamp(event.time),
        cause="" if text is None else text.cause,
        remedy="" if text is None else text.remedy,
    )


def robot_status(state: RobotState) -> DiagnosticStatus:
    """The state for ``/diagnostics``: an error where nothing can be done before somebody acts, else a warning."""
    event = controller_event(state.last_event)
    values: Mapping[str, str] = {
        "mode": _word(state.mode),
        "motors": _word(state.controller_state),
        "rapid": _word(state.execution),
        **{f"state_machine_{side.word}": _machine(state, side) for side in Side},
        **{f"egm_{side.word}": state.egm[side] for side in Side},
        "speed_ratio": "" if state.speed_ratio is None else f"{state.speed_ratio} %",
        "cause": state.cause,
        "stop": state.stop,
        "speed_scale": f"{state.speed_scale:g}",
        "event": f"{event.number} {event.title}" if event.number else "",
        "event_cause": event.cause,
        "event_remedy": event.remedy,
    }
    return DiagnosticStatus(
        level=_level(state),
        name="yumi: robot",
        message=f"not ready: {state.reason}" if state.reason else "ready",
        hardware_id="IRC5",
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )


def side_of(arm: str) -> Side:
    """The arm that a request names.

    Raises:
        CommandRefused: it names none.
    """
    if arm not in _SIDES:
        raise CommandRefused(f"There is no arm {arm!r}; choose right or left.")
    return _SIDES[arm]


def mode_of(name: str) -> Mode:
    """The mode that a goal names.

    Raises:
        CommandRefused: it names none.
    """
    try:
        return Mode(name)
    except ValueError as error:
        raise CommandRefused(
            f"There is no mode {name!r}; choose one of {', '.join(mode.value for mode in Mode)}."
        ) from error


def _level(state: RobotState) -> bytes:
    if not state.reason:
        return bytes(DiagnosticStatus.OK)
    return bytes(DiagnosticStatus.WARN if state.is_connected else DiagnosticStatus.ERROR)


def _machine(state: RobotState, side: Side) -> str:
    machine: MachineState | None = state.machines[side]
    return "" if machine is None else machine.name


def _word(value: Enum | None) -> str:
    return "" if value is None else str(value.value)


def _stamp(text: str) -> Time:
    """The controller tells its local time without a zone."""
    try:
        seconds = int(datetime.strptime(text, _TIME).replace(tzinfo=timezone.utc).timestamp())
    except ValueError:
        return Time()
    return Time(sec=min(max(seconds, 0), _LAST_SECOND))
