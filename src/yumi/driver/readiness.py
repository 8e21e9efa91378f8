"""May the robot move, and if not, why not and what to do: the one table of conditions.

Everybody who refuses motion takes condition, reason and remedy from here: robot manager, controller panel, Python API,
ROS and log. ``docs/reference/readiness.md`` is written from the tables below: ``python -m yumi.driver.readiness``.

The robot's state as the robot manager knows it, and the modes it can bring the robot to.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum

from yumi.control.shared_state import CAUSES, Problem, Snapshot
from yumi.driver.state_machine import MachineState
from yumi.errors import RobotNotReady
from yumi.robot.joints import Side
from yumi.rws.replies import Event
from yumi.rws.types import ControllerState, ExecutionState, OperatingMode

Report = Callable[[str], None]
"""Takes one short sentence a step: what is done next."""


class Mode(Enum):
    """Named states the robot can be brought to."""

    MOTORS_OFF = "motors_off"
    READY = "ready"
    EGM_LEFT = "egm_left"
    EGM_RIGHT = "egm_right"
    EGM_BOTH = "egm_both"

    @property
    def arms(self) -> tuple[Side, ...]:
        """The arms on which EGM runs in this mode."""
        return _ARMS.get(self, ())


_ARMS: Mapping[Mode, tuple[Side, ...]] = {
    Mode.EGM_LEFT: (Side.LEFT,),
    Mode.EGM_RIGHT: (Side.RIGHT,),
    Mode.EGM_BOTH: tuple(Side),
}

EGM_OFF = "off"
EGM_STREAMING = "streaming"
EGM_RUNNING = "running"


def arms_in_words(arms: tuple[Side, ...]) -> str:
    """``both arms``, or ``the right arm``."""
    return "both arms" if len(arms) > 1 else f"the {arms[0].word} arm"


@dataclass(frozen=True, slots=True)
class RobotState:
    """The robot at one moment; what is unknown is None.

    Attributes:
        is_connected: whether the controller answers.
        operating_mode: position of the mode switch.
        controller_state: motors, or the stop that keeps them off.
        execution: whether RAPID runs.
        machines: the state machine of each arm.
        egm: ``off``, ``streaming`` (datagrams arrive) or ``running`` (the robot follows references), of each arm.
        speed_ratio: override of the speeds of RAPID motions [%].
        last_event: the newest message of the event log.
        speed_scale: the factor in force on the speed of every controller, above 0 up to 1; a tenth at most while parts
            may touch.
        reason: why EGM can neither be started nor runs (:mod:`yumi.driver.readiness`); empty when it can or does.
        cause: what stopped the robot, with what to do, while it is stopped; empty while it works.
        stop: id of the stop that a person must confirm before anything moves; empty where there is none.
        allowed_collisions: pairs of parts that may touch now, such as ``left gripper - right gripper``.
        limited_by: the pairs of parts, with their distances, that keep an arm from getting nearer now.
    """

    is_connected: bool = False
    operating_mode: OperatingMode | None = None
    controller_state: ControllerState | None = None
    execution: ExecutionState | None = None
    machines: Mapping[Side, MachineState | None] = field(default_factory=lambda: dict.fromkeys(Side))
    egm: Mapping[Side, str] = field(default_factory=lambda: dict.fromkeys(Side, EGM_OFF))
    speed_ratio: int | None = None
    last_event: Event | None = None
    speed_scale: float = 1.0
    reason: str = "the controller does not answer"
    cause: str = ""
    stop: str = ""
    allowed_collisions: tuple[str, ...] = ()
    limited_by: tuple[str, ...] = ()

    def __str__(self) -> str:
        """In one line."""
        arms = "; ".join(f"{side.word} arm {machine_name(self, side)}, EGM {self.egm[side]}" for side in Side)
        if not self.is_connected:
            return f"{self.reason}; {arms}"
        mode, controller, rapid = (
            "unknown" if value is None else value.value
            for value in (self.operating_mode, self.controller_state, self.execution)
        )
        cause = f"; cause: {self.cause}" if self.cause else ""
        stop = f"; waits for a person to confirm the stop {self.stop}" if self.stop else ""
        allowed = f"; may touch: {', '.join(self.allowed_collisions)}" if self.allowed_collisions else ""
        return f"operating mode {mode}; controller {controller}; RAPID {rapid}; {arms}{cause}{stop}{allowed}"

    @property
    def is_stopped(self) -> bool:
        """Whether something keeps the program of the robot from running."""
        return (
            not self.is_connected
            or self.operating_mode is not OperatingMode.AUTO
            or self.controller_state is not ControllerState.MOTORS_ON
            or self.execution is not ExecutionState.RUNNING
        )


def machine_name(state: RobotState, side: Side) -> str:
    """The state of an arm's state machine in a word."""
    machine = state.machines[side]
    return "no state machine" if machine is None else machine.name


BOTH = tuple(Side)
Arms = tuple[Side, ...]


@dataclass(frozen=True, slots=True)
class Condition:
    """One thing that must be so before something moves.

    Attributes:
        name: what must be so.
        is_met: whether it is, for these arms; an unknown value is not.
        reason: what is not so, in words that can follow "not ready:"; fields in braces as :func:`reason_of` fills them.
        remedy: what to do.
    """

    name: str
    is_met: Callable[[RobotState, Arms], bool]
    reason: str
    remedy: str


def _is_idle(state: RobotState, arms: Arms) -> bool:
    return all(state.machines[side] is MachineState.IDLE for side in arms)


def _is_idle_or_in_egm(state: RobotState, arms: Arms) -> bool:
    return all(state.machines[side] is MachineState.IDLE or state.egm[side] == EGM_RUNNING for side in arms)


def _controller_is_not(stop: ControllerState) -> Callable[[RobotState, Arms], bool]:
    return lambda state, _: state.controller_state is not stop


CONNECTED = Condition(
    "the controller answers",
    lambda state, _: state.is_connected,
    "the controller does not answer",
    "check its power and the network cable",
)
AUTOMATIC = Condition(
    "the controller is in AUTO",
    lambda state, _: state.operating_mode is OperatingMode.AUTO,
    "the controller is in {mode}",
    "turn it to AUTO on the FlexPendant, nothing else can",
)
NO_EMERGENCY_STOP = Condition(
    "no emergency stop is pressed",
    _controller_is_not(ControllerState.EMERGENCY_STOP),
    "the emergency stop is pressed",
    "release it where it was pressed",
)
NO_GUARD_STOP = Condition(
    "no guard stop is active",
    _controller_is_not(ControllerState.GUARD_STOP),
    "a guard stop keeps the motors off",
    "close the guard, or press motors on at the controller",
)
NO_SYSTEM_FAILURE = Condition(
    "the controller is not in system failure",
    _controller_is_not(ControllerState.SYSTEM_FAILURE),
    "the controller is in system failure",
    "restart the controller",
)
MOTORS_ON = Condition(
    "the motors are on",
    lambda state, _: state.controller_state is ControllerState.MOTORS_ON,
    "the motors are off{after_stop}",
    "switch the motors on",
)
PROGRAM_RUNS = Condition(
    "the RAPID program runs",
    lambda state, _: state.execution is ExecutionState.RUNNING,
    "the RAPID program is stopped",
    "start it first",
)
PROGRAM_STANDS = Condition(
    "the RAPID program is stopped",
    lambda state, _: state.execution is ExecutionState.STOPPED,
    "the RAPID program runs",
    "stop it first",
)
IDLE = Condition(
    "the state machine is idle",
    _is_idle,
    "a state machine is not idle ({machines})",
    "end EGM, or wait for the end of the RAPID routine",
)
IDLE_OR_IN_EGM = Condition(
    "the state machines are idle, or EGM runs",
    _is_idle_or_in_egm,
    "the state machines are not idle ({machines})",
    "wait for the end of the RAPID routine, or recover",
)
CONFIRMED = Condition(
    "no stop waits for a person",
    lambda state, _: not state.stop,
    "a person must confirm the stop {stop}",
    "look at the robot, then recover with the id of the stop",
)

NO_STOP = (NO_EMERGENCY_STOP, NO_GUARD_STOP, NO_SYSTEM_FAILURE)
"""Stops that no request ends."""


class Request(Enum):
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


NEEDED: Mapping[Request, tuple[Condition, ...]] = {
    Request.BRING_UP: (AUTOMATIC, *NO_STOP, CONFIRMED),
    Request.START_RAPID: (AUTOMATIC, MOTORS_ON, CONFIRMED),
    Request.RUN_ROUTINE: (AUTOMATIC, PROGRAM_RUNS, IDLE, CONFIRMED),
    Request.LOAD_MODULE: (AUTOMATIC, PROGRAM_RUNS, IDLE),
    Request.MOVE_PP: (AUTOMATIC, PROGRAM_STANDS),
    Request.WRITE: (AUTOMATIC,),
    Request.MOVE_GRIPPER: (CONFIRMED,),
    Request.CALIBRATE: (IDLE, CONFIRMED),
    Request.READY: (CONNECTED, AUTOMATIC, *NO_STOP, MOTORS_ON, PROGRAM_RUNS, IDLE_OR_IN_EGM, CONFIRMED),
}
"""What each request needs, in the order in which it is checked. A request that can bring a condition about itself does
not need it. That a stop is confirmed is checked by :class:`yumi.driver.stops.StopLog`, which reads the event log."""


def unmet(conditions: Iterable[Condition], state: RobotState, arms: Arms = BOTH) -> Condition | None:
    """The first condition that is not met."""
    return next((condition for condition in conditions if not condition.is_met(state, arms)), None)


def reason_of(condition: Condition, state: RobotState, arms: Arms = BOTH) -> str:
    """Why a condition is not met."""
    after = " after an emergency stop" if state.controller_state is ControllerState.EMERGENCY_STOP_RESET else ""
    return condition.reason.format(
        mode=state.operating_mode.value if state.operating_mode else "an unknown mode",
        after_stop=after,
        machines=", ".join(
            f"{side.word} arm: {machine_name(state, side)}" for side in arms if not condition.is_met(state, (side,))
        ),
        stop=state.stop,
    )


def sentence_of(condition: Condition, state: RobotState, arms: Arms = BOTH, intro: str = "") -> str:
    """Why a condition is not met, and what to do; ``intro`` says what is refused for it."""
    text = f"{intro}{reason_of(condition, state, arms)}; {condition.remedy}."
    return text[0].upper() + text[1:]


def check(request: Request, state: RobotState, arms: Arms = BOTH, intro: str = "") -> None:
    """Refuse a request that a condition forbids; that a stop is confirmed is left to the log of stops.

    Args:
        request: what is asked for.
        state: what of the robot has been read for it.
        arms: which it is about.
        intro: what is refused, in front of the reason.

    Raises:
        RobotNotReady: a condition is not met; the message says which and what to do.
    """
    needed = [condition for condition in NEEDED[request] if condition is not CONFIRMED]
    missing = unmet(needed, state, arms)
    if missing is not None:
        raise RobotNotReady(sentence_of(missing, state, arms, intro))


def why_not_ready(state: RobotState) -> str:
    """What keeps the robot from starting EGM, in words that follow "not ready:"; empty when nothing does.

    An open stop comes after what else there is: both must be dealt with.
    """
    *others, confirmed = NEEDED[Request.READY]
    found = (unmet(others, state), unmet([confirmed], state))
    return "; ".join(reason_of(condition, state) for condition in found if condition is not None)


NOT_RUNNING = "EGM is not running on the {arm} arm"
"""Why an arm does not follow references; the other reasons are those of :data:`yumi.control.shared_state.CAUSES`."""


def why_arm_does_not_follow(side: Side, snapshot: Snapshot) -> str:
    """Why an arm takes no goals; empty when it does."""
    if snapshot.problem is not Problem.NONE:
        return f"{side.word} arm: {CAUSES[snapshot.problem]}"
    return "" if snapshot.is_running else NOT_RUNNING.format(arm=side.word)


_SYMBOLS = {"{mode}": "MANR", "{after_stop}": "", "{machines}": "right arm: RUN_RAPID_ROUTINE", "{stop}": "50204-…"}


def reference_page() -> str:
    """The page of the documentation, in Markdown."""
    every = [*NEEDED[Request.READY], *(condition for needed in NEEDED.values() for condition in needed)]
    conditions = list(dict.fromkeys(every))
    numbers = {condition: number for number, condition in enumerate(conditions, 1)}
    lines = [
        "# When may the robot move?",
        "",
        "<!-- Written by `python -m yumi.driver.readiness` from src/yumi/driver/readiness.py; do not edit. -->",
        "",
        "One table answers this for the robot manager, the Python API, ROS and the log.",
        "The reason is in the exception, in the service's reply and in the topic `yumi_robot_manager/state` alike.",
        "",
        "| | condition | reason where it is not met | what to do |",
        "|---|---|---|---|",
    ]
    for condition, number in numbers.items():
        reason = condition.reason
        for symbol, example in _SYMBOLS.items():
            reason = reason.replace(symbol, example)
        lines.append(f"| {number} | {condition.name} | {reason} | {condition.remedy} |")
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
    lines += ["", "An arm takes goals when EGM runs on it and nothing makes it hold:", "", "| reason |", "|---|"]
    lines.append(f"| {NOT_RUNNING.format(arm='right')} |")
    lines += [f"| right arm: {cause} |" for problem, cause in CAUSES.items() if problem is not Problem.NONE]
    lines += [
        "",
        "How the conditions follow each other when the robot is brought up:",
        "",
        "```mermaid",
        "flowchart TD",
    ]
    ready = NEEDED[Request.READY]
    for here, after in zip(ready, [*ready[1:], None], strict=True):
        target = f"c{numbers[after]}" if after else "ready([EGM can start])"
        lines.append(f'    c{numbers[here]}{{"{here.name}?"}} -- yes --> {target}')
        lines.append(f'    c{numbers[here]} -- no --> r{numbers[here]}["{here.remedy}"]')
    return "\n".join([*lines, "```", ""])


if __name__ == "__main__":
    sys.stdout.write(reference_page())
