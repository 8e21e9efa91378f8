"""May the robot move, and if not, why not and what to do: its state, the one table of conditions, and its stops.

Everybody who refuses motion takes condition, reason and remedy from here, and everybody who reports a stop its cause:
robot manager, controller panel, Python API, ROS and log. ``docs/reference/readiness.md`` is written from the tables
below: ``python -m yumi.driver.readiness``.

What stopped the robot is computed from the event log and the controller's state together. After an emergency stop, a
guard stop or a collision a reset must not itself start motion (IEC 60204-1 section 9.2, ISO 10218-1 section 5.5): such
a stop stays open until a person confirms it by its id. The id has a random part, made when this program first saw the
stop, so that no program can know it beforehand.
"""

from __future__ import annotations

import secrets
import sys
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from html import escape
from itertools import takewhile
from math import inf
from threading import RLock
from typing import Protocol

from yumi.clock import Clock
from yumi.control.shared_state import CAUSES, Problem, RobotStoppedFollowing, Snapshot
from yumi.control.shared_state import Event as ArmEvent
from yumi.driver.state_machine import MachineState
from yumi.errors import RobotNotReady, StopNotConfirmed
from yumi.robot.joints import Side
from yumi.rws.documents import Event
from yumi.rws.types import ControllerState, EventType, ExecutionState, OperatingMode

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
        reason: why EGM can neither be started nor runs, see :func:`why_not_ready`; empty when it can or does.
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

    def __repr__(self) -> str:
        """In lines, as ``yumi state`` prints what it knows."""
        mode, motors, program = (
            None if value is None else value.value
            for value in (self.operating_mode, self.controller_state, self.execution)
        )
        lines = robot_lines(
            is_connected=self.is_connected,
            operating_mode=mode,
            motors=motors,
            program=program,
            speed_scale=self.speed_scale,
            speed_ratio=self.speed_ratio,
            allowed_collisions=self.allowed_collisions,
            reason=self.reason,
            cause=self.cause,
            stop=self.stop,
            confirm="robot.recover(confirm=robot.stop_to_confirm)",
        )
        lines += [f"{side.word} arm: EGM {self.egm[side]}, {machine_name(self, side)}" for side in Side]
        return "\n".join([*lines, *(f"motion limited by {pair}" for pair in self.limited_by)])

    def _repr_html_(self) -> str:
        """For a notebook."""
        return f"<pre>{escape(repr(self))}</pre>"

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


def robot_lines(
    *,
    is_connected: bool,
    operating_mode: str | None,
    motors: str | None,
    program: str | None,
    speed_scale: float,
    speed_ratio: int | None,
    allowed_collisions: Sequence[str],
    reason: str,
    cause: str,
    stop: str,
    confirm: str,
) -> list[str]:
    """What a robot does, why it does not move and what stopped it, for a person who reads how to ``confirm`` a stop."""
    lines = []
    if is_connected:
        lines.append(
            f"operating mode {operating_mode}, {motors}, RAPID {program}, speed_scale {speed_scale:g}, "
            f"speed ratio {speed_ratio} %"
        )
    if allowed_collisions:
        lines.append(f"may touch, slowly: {', '.join(allowed_collisions)}")
    lines.append(f"cannot move: {reason}" if reason else "can move")
    if cause and cause not in reason:
        lines.append(f"stopped by: {cause}")
    if stop:
        lines.append(f"waits for a person to confirm the stop {stop}: {confirm}")
    return lines


def machine_name(state: RobotState, side: Side) -> str:
    """The state of an arm's state machine in a word."""
    machine = state.machines[side]
    return "no state machine" if machine is None else machine.name


_BOTH_ARMS = tuple(Side)
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
    lambda state, arms: all(state.machines[side] is MachineState.IDLE for side in arms),
    "a state machine is not idle ({machines})",
    "end EGM, or wait for the end of the RAPID routine",
)
IDLE_OR_IN_EGM = Condition(
    "the state machines are idle, or EGM runs",
    lambda state, arms: all(
        state.machines[side] is MachineState.IDLE or state.egm[side] == EGM_RUNNING for side in arms
    ),
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
not need it. That a stop is confirmed is checked by :class:`StopLog`, which reads the event log."""


def unmet(conditions: Iterable[Condition], state: RobotState, arms: Arms = _BOTH_ARMS) -> Condition | None:
    """The first condition that is not met."""
    return next((condition for condition in conditions if not condition.is_met(state, arms)), None)


def reason_of(condition: Condition, state: RobotState, arms: Arms = _BOTH_ARMS) -> str:
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


def sentence_of(condition: Condition, state: RobotState, arms: Arms = _BOTH_ARMS, intro: str = "") -> str:
    """Why a condition is not met, and what to do; ``intro`` says what is refused for it."""
    text = f"{intro}{reason_of(condition, state, arms)}; {condition.remedy}."
    return text[0].upper() + text[1:]


def check_request(request: Request, state: RobotState, arms: Arms = _BOTH_ARMS, intro: str = "") -> None:
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


@dataclass(frozen=True, slots=True)
class EventText:
    """One event number explained, in our own words (reference/egm.md §7, yumi.md §4.6): cause, and what to do."""

    cause: str
    remedy: str


def _gripper_event(cause: str, remedy: str = "look at the gripper, then calibrate it again") -> EventText:
    return EventText(f"a Smart Gripper {cause}", remedy)


EVENT_TEXTS: Mapping[int, EventText] = {
    10010: EventText("the motors were switched off", "recover switches them on"),
    10012: EventText("a guard stop switched the motors off", "close the guard, then recover"),
    10013: EventText("an emergency stop was pressed", "release the button where it was pressed, then recover"),
    10014: EventText("the controller went into system failure", "restart the controller, then recover"),
    10015: EventText("the mode switch was turned to manual", "turn it to AUTO on the FlexPendant, then recover"),
    10016: EventText("AUTO was chosen and waits to be confirmed", "confirm AUTO on the FlexPendant, then recover"),
    10045: EventText("the controller was restarted", "recover starts it again"),
    10125: EventText("the RAPID program was stopped, on the FlexPendant or by another client", "recover starts it"),
    20192: EventText("the controller got an EGM reference that is not a number", "restart the controller"),
    20193: EventText("the controller got an EGM reference that is not a number", "restart the controller"),
    40160: EventText("a RAPID instruction got an argument it does not know", "load the modules of this version"),
    40228: EventText("a RAPID error was not handled and stopped the program", "see the event before it"),
    41438: EventText("the tool's load is undefined", "define mass and centre of gravity of the tool in use"),
    41822: EventText(
        "no EGM answer reached the robot in time",
        "check the network, the firewall and the UDPUC device's remote address; the driver must answer each cycle",
    ),
    41826: EventText(
        "EGM was set up for joints and run for poses", "use joints: RobotWare 6 moves a YuMi by them only"
    ),
    41828: EventText(
        "a task holds all of its EGM identities, after stops in the middle of EGM",
        "restart the controller; nothing else frees them",
    ),
    41830: EventText(
        "the robot cannot send its EGM datagrams",
        "check the UDPUC device's remote address and the cable, and restart the controller after a change",
    ),
    50027: EventText("a joint left its range", "bring the arm back into range, jogging if need be, then recover"),
    50056: EventText(
        "a joint met a resistance, as in a collision", "see what the arm touched and free it, then recover"
    ),
    50204: EventText("an arm has collided, or moves against a force", "see what it touched and free it, then recover"),
    50375: EventText(
        "the references asked for more torque than an arm has",
        "lower acceleration, or set the tool's load, then recover",
    ),
    50376: EventText("the references asked for more speed than a joint has", "lower the speed, then recover"),
    50446: EventText("the end of EGM took longer than ordered", "nothing is to be done"),
    50452: EventText("EGM met an error in a motion cycle", "recover; if it comes again, see the EGM configuration"),
    50453: EventText("a move or a jog was ordered while EGM moves the arm", "end EGM first"),
    80001: EventText("the robot's program reported an error", "read its text, then recover"),
    80002: EventText("the robot's program gave a warning", "read its text"),
    112751: _gripper_event("was in the wrong state for a command"),
    112752: _gripper_event("has a fault", "switch its supply off and on, then calibrate it again"),
    112753: _gripper_event("did not reach its position"),
    112754: _gripper_event("could not grip inwards"),
    112755: _gripper_event("is not calibrated", "calibrate it"),
    112756: _gripper_event("lost its vacuum", "check suction cup and air supply"),
    112757: _gripper_event("got a value out of range", "give positions of 0 to 25 mm and forces of 0 to 20 N"),
    112758: _gripper_event("could not move to a position"),
    112759: _gripper_event("could not grip at a position"),
    112760: _gripper_event("could not grip outwards"),
}

# So many events are read, the next number where these were not enough; a controller remembers the last one.
_PAGES = (10, 50, 1000)

# Numbers of events.
_MOTORS_OFF, _GUARD_STOP, _EMERGENCY_STOP, _SYSTEM_FAILURE = 10010, 10012, 10013, 10014
_MANUAL, _AUTO_CHOSEN, _AUTO_CONFIRMED = 10015, 10016, 10017  # with the mode switch
_RESTARTED, _PROGRAM_STOPPED, _PROGRAM_ERROR, _EGM_TIMEOUT = 10045, 10125, 80001, 41822
_PROGRAM_STARTED = (10150, 10151)  # what is older is history
_COLLISIONS = (50056, 50204)
_SAFETY_CHAIN = range(90200, 90300)  # the safety chain was opened: emergency, automatic, general or superior stop
_UNHANDLED = 40228  # it follows the event of the error that the program does not handle, EGM's time-out too

# These accompany every other stop, and may come before the event that says more.
_ACCOMPANYING = (_MOTORS_OFF, _PROGRAM_STOPPED)

# What stops the robot and is no error, the one that says most first.
_STOPS = (_EMERGENCY_STOP, _GUARD_STOP, _MANUAL, _AUTO_CHOSEN, _RESTARTED, *_ACCOMPANYING)

# Mode switch, and system failure, which a person has to look at.
_BY_PERSON = {_SYSTEM_FAILURE, _MANUAL, _AUTO_CHOSEN, _AUTO_CONFIRMED}

# States that are a stop, also where the event log was cleared; and the number of the event they come with.
_STOP_STATES: Mapping[ControllerState, int] = {
    ControllerState.EMERGENCY_STOP: _EMERGENCY_STOP,
    ControllerState.EMERGENCY_STOP_RESET: _EMERGENCY_STOP,
    ControllerState.GUARD_STOP: _GUARD_STOP,
}
_STOP_TITLES = {_EMERGENCY_STOP: "Emergency stop state", _GUARD_STOP: "Guard stop state"}

HISTORY = 2.0
"""An event that came so long before the robot was last seen to work has not stopped it [s]."""


def needs_person(code: int) -> bool:
    """Whether nothing may move after an event of this number before a person has confirmed it.

    Emergency stop, guard stop (a guard that closes must not start motion) and collision, however they are reported.
    """
    return code in {_EMERGENCY_STOP, _GUARD_STOP, *_COLLISIONS} or code in _SAFETY_CHAIN


def _is_guard_stop(code: int) -> bool:
    """Whether an event of this number is a guard stop, which also comes when the mode switch leaves AUTO."""
    return code == _GUARD_STOP or code in _SAFETY_CHAIN


def is_without_person(event: Event) -> bool:
    """Whether an event is the cause of a stop in which no person was involved.

    EGM's time-out, a restart of the controller, and the watchdog of our own program (see ``TRobWatchdog.mod``). Not a
    program stop alone, which may have been the stop button of the FlexPendant.
    """
    is_watchdog = event.code == _PROGRAM_ERROR and "watchdog" in event.title.lower()
    return is_watchdog or event.code in {_EGM_TIMEOUT, _RESTARTED}


def _are_without_person(events: Iterable[Event]) -> bool:
    """Whether none of the events since the program was started shows a person at the robot, or another fault.

    Args:
        events: newest first, as the controller lists them.
    """
    recent = _since_start(events)
    codes = {event.code for event in recent}
    if codes & _BY_PERSON or any(map(needs_person, codes)) or (_MOTORS_OFF in codes and _RESTARTED not in codes):
        return False
    errors = [event for event in recent if event.type is EventType.ERROR and event.code != _UNHANDLED]
    return all(map(is_without_person, errors)) and (bool(errors) or _UNHANDLED not in codes)


def explain(event: Event) -> str:
    """An event in a sentence, without its full stop: number, cause and remedy; ABB's words where we have none."""
    text = EVENT_TEXTS.get(event.code)
    own = event.description or event.title
    if text is None:
        return f"{event.code} {event.title}: {own.rstrip('.')}"
    detail = f" ({own.rstrip('.')})" if event.type is EventType.ERROR else ""
    return f"{event.code} {event.title}: {text.cause}{detail}; {text.remedy}"


def cause_among(events: Iterable[Event]) -> Event | None:
    """What stopped the robot: the first error since the program was started, or the stop that says most.

    Args:
        events: newest first, as the controller lists them.
    """
    recent = _since_start(events)
    errors = [event for event in recent if event.type is EventType.ERROR]
    if errors:
        return errors[-1]
    stops = [event for event in recent if event.code in _STOPS]
    return min(stops, key=lambda event: _STOPS.index(event.code), default=None)


def _since_start(events: Iterable[Event]) -> list[Event]:
    """Those after the program was last started, newest first: who started it took note of what was before."""
    return list(takewhile(lambda event: event.code not in _PROGRAM_STARTED, events))


class EventSource(Protocol):
    """What is needed of a client: state of the motors, and the event log, newest first."""

    def controller_state(self) -> ControllerState: ...

    def events(self, domain: int = 0, count: int = 50) -> tuple[Event, ...]: ...


@dataclass(frozen=True, slots=True)
class Stop:
    """A stop that a person must confirm.

    Attributes:
        id: what the confirmation names.
        cause: in a sentence without its full stop, with what to do.
        codes: numbers of its events, oldest first.
    """

    id: str
    cause: str
    codes: tuple[int, ...]

    @classmethod
    def of(cls, events: tuple[Event, ...], code: int = 0) -> Stop:
        """The stop of ``events``, oldest first; where there are none, of a state that comes with event ``code``."""
        number = events[-1].number if events else 0
        first: dict[int, Event] = {}
        for event in events:
            first.setdefault(event.code, event)
        texts = [explain(event) for event in first.values()] or [
            explain(Event(0, EventType.INFORMATION, code, "", _STOP_TITLES[code], _STOP_TITLES[code]))
        ]
        identity = f"{events[-1].code if events else code}-{number}-{secrets.token_hex(3)}"
        return cls(identity, "; then ".join(texts), tuple(first) or (code,))


@dataclass(frozen=True, slots=True)
class Cause:
    """Why an arm or the robot was stopped.

    Attributes:
        text: a sentence without its full stop; empty where the controller reports no stop.
        stop: id of the stop that a person must confirm; empty where there is none.
    """

    text: str = ""
    stop: str = ""

    def __str__(self) -> str:
        """A sentence to append to another one, with a blank before it; empty where there is nothing to say."""
        return f" Cause: {self.text}.{demand_confirmation(self.stop)}" if self.text else ""


@dataclass(frozen=True, slots=True)
class _KnownStop:
    """Replaced as a whole, so that it can be read from any thread at any time."""

    stop: Stop | None = None
    cause: Event | None = None


class StopLog:
    """Knows the open stop and the cause of any other; safe from any thread.

    Args:
        clock: where its times come from.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._lock = RLock()  # reading and judging belong together: an older page must not be judged after a newer one
        self._known = _KnownStop()
        self._newest = -1  # number of the newest event that was read; -1 before the first reading
        self._stop_events: tuple[Event, ...] = ()
        self._awaits_event_until = -inf  # the event of a stop that is known by the state alone comes by then [s]
        self._recent: deque[tuple[Event, float]] = deque(maxlen=_PAGES[-1])  # newest first, and when it was seen
        self._news: deque[Event] = deque(maxlen=_PAGES[-1])
        self.is_complete = True
        """Whether every event since the last confirmed or working state was seen."""

    @property
    def stop(self) -> Stop | None:
        """The stop that waits for a person's confirmation; as of the last reading."""
        return self._known.stop

    @property
    def cause(self) -> Event | None:
        """The event that explains why the robot stands, if one does; as of the last reading."""
        return self._known.cause

    def check_none_open(self) -> None:
        """Refuse motion while a stop is open, from what is known already.

        Raises:
            RobotNotReady: one is.
        """
        stop = self.stop
        if stop is not None:
            raise RobotNotReady(f"The robot was stopped by {stop.cause}.{demand_confirmation(stop.id)}", stop.id)

    @property
    def is_certain(self) -> bool:
        """Whether a better explanation is not to be expected: motors off and program stopped accompany every stop."""
        stop, cause = self._known.stop, self._known.cause
        return stop is not None or (cause is not None and cause.code not in _ACCOMPANYING)

    @property
    def is_without_person(self) -> bool:
        """Whether it is certain that no person was involved in what stopped the robot, nor in any event since."""
        with self._lock:
            known = self._known
            if known.stop is not None or not self.is_complete:
                return False
            if not _are_without_person(event for event, _ in self._recent):
                return False
            return known.cause is None or is_without_person(known.cause)

    def read(self, client: EventSource) -> tuple[ControllerState, Event | None]:
        """Read state and event log; returns the state and the newest event.

        Raises:
            YumiError: the controller does not answer.
        """
        with self._lock:
            state = client.controller_state()
            for count in _PAGES:
                events = client.events(count=count)
                if len(events) < count or self._is_enough(events):
                    break
            self._take(events)
            if state in _STOP_STATES and self._known.stop is None:
                self._known = replace(self._known, stop=Stop.of((), _STOP_STATES[state]))
                self._awaits_event_until = self._clock.now() + HISTORY
            return state, events[0] if events else None

    def check_confirmed(self, client: EventSource, confirmed: str) -> None:
        """See that nothing keeps the robot from being started again.

        Args:
            client: of the controller.
            confirmed: id of the stop that a person has confirmed; empty where none has.

        Raises:
            StopNotConfirmed: a stop is open, and it is another one, or what caused it is still there.
            YumiError: the controller does not answer.
        """
        with self._lock:
            if self.stop is not None and confirmed == self.stop.id:
                self._awaits_event_until = -inf  # what comes from now on is another stop than the confirmed one
            state, _ = self.read(client)
            stop = self.stop
            if stop is None:
                return
            if not confirmed:
                raise StopNotConfirmed(_refusal(stop, state), stop.id)
            if confirmed != stop.id:
                raise StopNotConfirmed(
                    f"{confirmed!r} is not the stop that is open now. {_refusal(stop, state)}", stop.id
                )
            if active := _active_stop(state):
                raise StopNotConfirmed(
                    f"The stop {stop.id} cannot be confirmed yet: {active}, then confirm it again. "
                    f"The robot was stopped by {stop.cause}.",
                    stop.id,
                )

    def check_unchanged(self, client: EventSource, confirmed: str) -> None:
        """The same between two steps: only the newest event is read while there is nothing new."""
        with self._lock:
            newest, stop = client.events(count=1), self.stop
            is_new = (newest[0].number if newest else 0) != max(self._newest, 0)
            if is_new or (stop.id if stop else "") != confirmed:  # another thread may have looked at the new event
                self.check_confirmed(client, confirmed)

    def close(self, confirmed: str) -> None:
        """The robot has been brought back: what stopped it is history, unless another stop has come since.

        Args:
            confirmed: id of the stop that was confirmed; empty where there was none.
        """
        with self._lock:
            stop = self._known.stop
            if stop is None or stop.id == confirmed:
                self._stop_events = ()
                self._recent.clear()
                self.is_complete = True
                self._known = _KnownStop()

    def settle(self) -> None:
        """The robot works: what came a while ago has not stopped it."""
        with self._lock:
            limit = self._clock.now() - HISTORY
            while self._recent and self._recent[-1][1] <= limit:
                self._recent.pop()
            self.is_complete = True
            self._known = replace(self._known, cause=cause_among(event for event, _ in self._recent))

    def settle_egm(self, client: EventSource) -> None:
        """EGM runs again: what ended it before has not stopped the robot. Where a person was involved, it may yet have.

        Raises:
            YumiError: the controller does not answer.
        """
        with self._lock:
            self.read(client)  # the event of a time-out may come after the request to start again
            kept = [each for each in self._recent if not is_without_person(each[0])]
            self._recent = deque(kept, self._recent.maxlen)
            self._known = replace(self._known, cause=cause_among(event for event, _ in kept))

    def take_news(self) -> tuple[Event, ...]:
        """Events that came since the first reading and were not taken yet, oldest first."""
        with self._lock:
            news = tuple(self._news)
            self._news.clear()
            return news

    def _is_enough(self, events: tuple[Event, ...]) -> bool:
        """Whether older events are known, or history."""
        if self._newest < 0 or events[0].number < self._newest:
            return any(event.code in _PROGRAM_STARTED for event in events)
        return events[-1].number <= self._newest + 1

    def _take(self, events: tuple[Event, ...]) -> None:
        newest = events[0].number if events else self._newest
        is_first = self._newest < 0 or newest < self._newest  # a lower number: another controller, or they wrapped
        if is_first:
            self._recent.clear()
            fresh = tuple(_since_start(events))
        else:
            fresh = tuple(event for event in events if event.number > self._newest)
            if fresh and len(fresh) == len(events) and fresh[-1].number > self._newest + 1:
                self.is_complete = False  # it was cleared, or more has come than it holds
            self._news.extend(reversed(fresh))
        self._newest = newest
        if not fresh:
            return
        now = self._clock.now()
        self._recent.extendleft((event, now) for event in reversed(fresh))
        stop = self._known.stop
        confirmed = next((index for index, event in enumerate(fresh) if event.code == _AUTO_CONFIRMED), len(fresh))
        if confirmed < len(fresh) and stop is not None and all(map(_is_guard_stop, stop.codes)):
            # Leaving AUTO is a guard stop, too; who has confirmed AUTO at the FlexPendant has looked at the robot.
            self._stop_events, stop = (), None
        stops = tuple(
            event
            for index, event in reversed(list(enumerate(fresh)))
            if needs_person(event.code) and (index < confirmed or not _is_guard_stop(event.code))
        )
        is_awaited = not self._stop_events and now <= self._awaits_event_until
        if stops and stop is not None and is_awaited and stop.codes == (stops[-1].code,):
            # The event of a stop that was known by the state alone; a person may know its id already.
            self._stop_events = stops
            stop = replace(Stop.of(stops), id=stop.id)
        elif stops:
            self._stop_events += stops
            stop = Stop.of(self._stop_events)
        self._known = _KnownStop(stop, cause_among(event for event, _ in self._recent))


def explained(event: ArmEvent, cause: Cause) -> str:
    """What happened to an arm, with its cause and what a person must do."""
    if not cause.text:
        if isinstance(event, RobotStoppedFollowing):
            return f"{event} The controller reports no stop: its program has ended EGM, or another client has."
        return str(event)
    return f"{event}{cause}"


def demand_confirmation(stop: str) -> str:
    """A sentence, with a blank before it, that says what a stop waits for; nothing where there is no stop."""
    return f" Nothing moves until a person confirms the stop {stop} (recover)." if stop else ""


def _active_stop(state: ControllerState) -> str:
    """The stop that no request ends, and what does; empty where there is none."""
    robot = RobotState(controller_state=state)
    stop = unmet(NO_STOP, robot)
    return f"{reason_of(stop, robot)}; {stop.remedy}" if stop else ""


def _refusal(stop: Stop, state: ControllerState) -> str:
    active = _active_stop(state)
    now = f"Now {active}. " if active else ""
    return (
        f"The robot was stopped by {stop.cause}. {now}Nothing moves until a person has looked at the robot and "
        f"confirmed this stop: call recover with the id {stop.id}."
    )


_EXAMPLES = {"{mode}": "MANR", "{after_stop}": "", "{machines}": "right arm: RUN_RAPID_ROUTINE", "{stop}": "50204-…"}


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
        for symbol, example in _EXAMPLES.items():
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
