"""Readiness: whether the robot may move, and if not, which needed condition is unmet; the one table of conditions.

Everybody who refuses motion takes the reason from here, as a message that the front end words: robot manager,
controller panel, Python API, ROS and log. What stopped the robot is in :mod:`yumi.driver.stops`.
``docs/reference/readiness.md`` is written from the tables below: ``python -m yumi.driver.readiness``.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import Enum

from abb_protocols.catalogue import Message, clause, message, remedy_of
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import RobotNotReady
from abb_protocols.robot.joints import Side
from abb_protocols.rws.values import ControllerState, ExecutionState, OperatingMode
from yumi.control.shared_state import ARM_PROBLEM_CODES, ArmProblem, Snapshot
from yumi.driver.robot_state import EGM_RUNNING, RobotState, machine_name
from yumi.driver.state_machine import MachineState

_BOTH_ARMS = tuple(Side)
_Arms = tuple[Side, ...]


@dataclass(frozen=True, slots=True)
class Condition:
    """One thing that must be so before something moves.

    Attributes:
        name: what must be so.
        is_met: whether it is, for these arms; an unknown value is not.
        reason: what is not so, and what to do.
    """

    name: str
    is_met: Callable[[RobotState, _Arms], bool]
    reason: Callable[[RobotState, _Arms], Message]


def _controller_is_not(stop: ControllerState) -> Callable[[RobotState, _Arms], bool]:
    return lambda state, _: state.controller_state is not stop


def _says(reason: Message) -> Callable[[RobotState, _Arms], Message]:
    return lambda state, arms: reason


def _mode(state: RobotState, arms: _Arms) -> Message:
    if state.operating_mode is None:
        return message("mode_unknown")
    return message("not_in_auto", mode=state.operating_mode.value)


def _motors_off(state: RobotState, arms: _Arms) -> Message:
    if state.controller_state is ControllerState.EMERGENCY_STOP_RESET:
        return message("motors_off_after_emergency_stop")
    return message("motors_off")


def _machines(state: RobotState, arms: _Arms) -> tuple[Message, ...]:
    return tuple(message("machine", arm=side.word, machine=machine_name(state, side)) for side in arms)


def _is_idle(state: RobotState, arms: _Arms) -> bool:
    return all(state.machines[side] is MachineState.IDLE for side in arms)


def _is_idle_or_in_egm(state: RobotState, arms: _Arms) -> bool:
    return all(state.machines[side] is MachineState.IDLE or state.egm[side] == EGM_RUNNING for side in arms)


_CONNECTED = Condition(
    "the controller answers",
    lambda state, _: state.is_connected,
    _says(message("controller_does_not_answer")),
)
_AUTOMATIC = Condition(
    "the controller is in AUTO",
    lambda state, _: state.operating_mode is OperatingMode.AUTO,
    _mode,
)
_NO_EMERGENCY_STOP = Condition(
    "no emergency stop is pressed",
    _controller_is_not(ControllerState.EMERGENCY_STOP),
    _says(message("emergency_stop_pressed")),
)
_NO_GUARD_STOP = Condition(
    "no guard stop is active",
    _controller_is_not(ControllerState.GUARD_STOP),
    _says(message("guard_stop_active")),
)
_NO_SYSTEM_FAILURE = Condition(
    "the controller is not in system failure",
    _controller_is_not(ControllerState.SYSTEM_FAILURE),
    _says(message("system_failure")),
)
_MOTORS_ON = Condition(
    "the motors are on",
    lambda state, _: state.controller_state is ControllerState.MOTORS_ON,
    _motors_off,
)
_PROGRAM_RUNS = Condition(
    "the RAPID program runs",
    lambda state, _: state.execution is ExecutionState.RUNNING,
    _says(message("program_stopped")),
)
_PROGRAM_STANDS = Condition(
    "the RAPID program is stopped",
    lambda state, _: state.execution is ExecutionState.STOPPED,
    _says(message("program_runs")),
)
_IDLE = Condition(
    "the state machine is idle",
    _is_idle,
    lambda state, arms: message(
        "not_idle", machines=_machines(state, tuple(side for side in arms if not _is_idle(state, (side,))))
    ),
)
_IDLE_OR_IN_EGM = Condition(
    "the state machines are idle, or EGM runs",
    _is_idle_or_in_egm,
    lambda state, arms: message(
        "neither_idle_nor_in_egm",
        machines=_machines(state, tuple(side for side in arms if not _is_idle_or_in_egm(state, (side,)))),
    ),
)
_CONFIRMED = Condition(
    "no stop waits for a person",
    lambda state, _: not state.stop,
    lambda state, _: message("stop_open", stop=state.stop),
)

NO_STOP = (_NO_EMERGENCY_STOP, _NO_GUARD_STOP, _NO_SYSTEM_FAILURE)
"""Stops that no request ends."""


class ConditionalRequest(Enum):
    """What is asked for; the value says it in the table of the documentation."""

    BRING_UP = "switch the motors on, make ready, start EGM, recover"
    START_RAPID = "start the RAPID program"
    RUN_ROUTINE = "run a RAPID routine"
    LOAD_MODULE = "load a RAPID module"
    MOVE_PP = "move the program pointers to main"
    WRITE = "set the speed ratio, write a RAPID variable"
    MOVE_GRIPPER = "move a gripper"
    CALIBRATE = "calibrate a gripper"
    READY = "be ready (`robot_is_ready`)"


_REFUSALS: Mapping[ConditionalRequest, str] = {
    ConditionalRequest.BRING_UP: "cannot_bring_up",
    ConditionalRequest.START_RAPID: "cannot_start_rapid",
    ConditionalRequest.RUN_ROUTINE: "cannot_run_routine",
    ConditionalRequest.LOAD_MODULE: "cannot_load_module",
    ConditionalRequest.MOVE_PP: "cannot_move_pp",
    ConditionalRequest.WRITE: "cannot_write",
    ConditionalRequest.MOVE_GRIPPER: "cannot_move_gripper",
    ConditionalRequest.CALIBRATE: "cannot_calibrate",
    ConditionalRequest.READY: "cannot_be_ready",
}

NEEDED: Mapping[ConditionalRequest, tuple[Condition, ...]] = {
    ConditionalRequest.BRING_UP: (_AUTOMATIC, *NO_STOP, _CONFIRMED),
    ConditionalRequest.START_RAPID: (_AUTOMATIC, _MOTORS_ON, _CONFIRMED),
    ConditionalRequest.RUN_ROUTINE: (_AUTOMATIC, _PROGRAM_RUNS, _IDLE, _CONFIRMED),
    ConditionalRequest.LOAD_MODULE: (_AUTOMATIC, _PROGRAM_RUNS, _IDLE),
    ConditionalRequest.MOVE_PP: (_AUTOMATIC, _PROGRAM_STANDS),
    ConditionalRequest.WRITE: (_AUTOMATIC,),
    ConditionalRequest.MOVE_GRIPPER: (_CONFIRMED,),
    ConditionalRequest.CALIBRATE: (_IDLE, _CONFIRMED),
    ConditionalRequest.READY: (
        _CONNECTED,
        _AUTOMATIC,
        *NO_STOP,
        _MOTORS_ON,
        _PROGRAM_RUNS,
        _IDLE_OR_IN_EGM,
        _CONFIRMED,
    ),
}
"""What each request needs, in the order in which it is checked. A request that can bring a condition about itself does
not need it. That a stop is confirmed is checked by :class:`StopLog`, which reads the event log."""


def unmet(conditions: Iterable[Condition], state: RobotState, arms: _Arms = _BOTH_ARMS) -> Condition | None:
    """The first condition that is not met."""
    return next((condition for condition in conditions if not condition.is_met(state, arms)), None)


def check_request(request: ConditionalRequest, state: RobotState, arms: _Arms = _BOTH_ARMS) -> None:
    """Refuse a request that a condition forbids; that a stop is confirmed is left to the log of stops.

    Args:
        request: what is asked for.
        state: what of the robot has been read for it.
        arms: which it is about.

    Raises:
        RobotNotReady: a condition is not met; the message says which and what to do.
    """
    needed = [condition for condition in NEEDED[request] if condition is not _CONFIRMED]
    missing = unmet(needed, state, arms)
    if missing is not None:
        raise RobotNotReady(Message(_REFUSALS[request], {"reason": missing.reason(state, arms)}))


_DONE_BY_RECOVER = (_MOTORS_ON, _PROGRAM_RUNS, _IDLE_OR_IN_EGM)


def why_not_ready(state: RobotState) -> tuple[Message, ...]:
    """What keeps the robot from starting EGM, the first thing to do first; empty when nothing does.

    An open stop comes after what else there is: both must be dealt with. What recovering does is not asked for beside
    the confirmation that recovering asks for.
    """
    *others, confirmed = NEEDED[ConditionalRequest.READY]
    found = (unmet(others, state), unmet([confirmed], state))
    is_open = found[1] is not None
    return tuple(
        condition.reason(state, _BOTH_ARMS)
        for condition in found
        if condition is not None and not (is_open and condition in _DONE_BY_RECOVER)
    )


def why_arm_does_not_follow(side: Side, snapshot: Snapshot) -> Message | None:
    """Why an arm takes no goals; None when it does."""
    if snapshot.problem is not ArmProblem.NONE:
        return message(ARM_PROBLEM_CODES[snapshot.problem], arm=side.word)
    return None if snapshot.is_running else message("arm_without_egm", arm=side.word)


_EXAMPLE = RobotState(
    operating_mode=OperatingMode.MANUAL_REDUCED,
    machines=dict.fromkeys(Side, MachineState.RUN_RAPID_ROUTINE),
    stop="50204-…",
)


def reference_page() -> str:
    """The page of the documentation, in Markdown."""
    every = [*NEEDED[ConditionalRequest.READY], *(condition for needed in NEEDED.values() for condition in needed)]
    conditions = list(dict.fromkeys(every))
    numbers = {condition: number for number, condition in enumerate(conditions, 1)}
    lines = [
        "# When may the robot move?",
        "",
        "<!-- Written by `python -m yumi.driver.readiness` from the table in that module; do not edit. -->",
        "",
        "One table answers this for the robot manager, the Python API, ROS, the page and the log.",
        "The reason is in the exception, in the service's reply and in the topic `yumi_robot_manager/state` alike:",
        "a code, which programs can rely on, and a sentence in the words of the front end (here those of ROS).",
        "",
        "| | condition | code | reason where it is not met | what to do |",
        "|---|---|---|---|---|",
    ]
    reasons = {condition: condition.reason(_EXAMPLE, (Side.RIGHT,)) for condition in conditions}
    remedies = {condition: remedy_of(reason, FrontEnd.ROS) for condition, reason in reasons.items()}
    for condition, number in numbers.items():
        code, reason = reasons[condition].code, clause(reasons[condition], FrontEnd.ROS)
        lines.append(f"| {number} | {condition.name} | `{code}` | {reason} | {remedies[condition]} |")
    lines += [
        "",
        "What each request needs, in the order in which it is checked.",
        "A request that can bring a condition about by itself does not need it: `start_egm` switches the motors on.",
        "",
        f"| request | {' | '.join(map(str, numbers.values()))} |",
        f"|---|{'---|' * len(numbers)}",
    ]
    for request, needed in NEEDED.items():
        marks = " | ".join("●" if condition in needed else " " for condition in conditions)
        lines.append(f"| {request.value} | {marks} |")
    lines += ["", "An arm takes goals when EGM runs on it and nothing makes it hold:", ""]
    lines += ["| code | reason | what to do |", "|---|---|---|"]
    for code in ("arm_without_egm", *ARM_PROBLEM_CODES.values()):
        said = Message(code, {"arm": "right"})
        lines.append(f"| `{code}` | {clause(said, FrontEnd.ROS)} | {remedy_of(said, FrontEnd.ROS)} |")
    lines += [
        "",
        "How the conditions follow each other when the robot is brought up:",
        "",
        "```mermaid",
        "flowchart TD",
    ]
    ready = NEEDED[ConditionalRequest.READY]
    for here, after in zip(ready, [*ready[1:], None], strict=True):
        target = f"c{numbers[after]}" if after else "ready([EGM can start])"
        lines.append(f'    c{numbers[here]}{{"{here.name}?"}} -- yes --> {target}')
        lines.append(f'    c{numbers[here]} -- no --> r{numbers[here]}["{remedies[here]}"]')
    return "\n".join([*lines, "```", ""])


if __name__ == "__main__":
    sys.stdout.write(reference_page())
