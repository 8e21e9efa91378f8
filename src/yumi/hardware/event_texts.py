"""What the controller's event numbers mean and what to do, in words of our own (reference/egm.md §7, yumi.md §4.6)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import takewhile

from yumi.rws.replies import Event
from yumi.rws.states import EventType


@dataclass(frozen=True, slots=True)
class EventText:
    """One event number explained.

    Attributes:
        cause: why it comes.
        remedy: what to do, as an order.
    """

    cause: str
    remedy: str


def _gripper(cause: str, remedy: str = "look at the hand, then calibrate it again") -> EventText:
    return EventText(f"a Smart Gripper {cause}", remedy)


EVENT_TEXTS: Mapping[int, EventText] = {
    10010: EventText("the motors were switched off", "recover switches them on"),
    10012: EventText("a guard stop switched the motors off", "close the guard, then recover"),
    10013: EventText("an emergency stop was pressed", "release the button where it was pressed, then recover"),
    10014: EventText("the controller went into system failure", "restart the controller, then recover"),
    10015: EventText("the mode switch was turned to manual", "turn it to AUTO on the pendant, then recover"),
    10016: EventText("AUTO was chosen and waits to be confirmed", "confirm AUTO on the pendant, then recover"),
    10045: EventText("the controller was restarted", "recover starts it again"),
    10125: EventText("the RAPID program was stopped, on the pendant or by another client", "recover starts it"),
    20192: EventText("the controller got an EGM reference that is no number", "restart the controller"),
    20193: EventText("the controller got an EGM reference that is no number", "restart the controller"),
    40160: EventText("a RAPID instruction got an argument it does not know", "load the modules of this version"),
    40228: EventText("a RAPID error was not handled and stopped the program", "see the event before it"),
    41438: EventText("the tool's load is undefined", "define mass and centre of gravity of the tool in use"),
    41822: EventText(
        "no EGM answer reached the robot in time",
        "check the network, the firewall and the UDPUC device's remote address; the driver must answer each cycle",
    ),
    41826: EventText(
        "EGM was set up for joints and run for poses", "use joints: RobotWare 6 guides a YuMi by them only"
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
    50453: EventText("a move or a jog was ordered while EGM guides the arm", "end EGM first"),
    80001: EventText("the robot's program reported an error", "read its text, then recover"),
    80002: EventText("the robot's program gave a warning", "read its text"),
    112751: _gripper("was in the wrong state for a command"),
    112752: _gripper("has a fault", "switch its supply off and on, then calibrate it again"),
    112753: _gripper("did not reach its position"),
    112754: _gripper("could not grip inwards"),
    112755: _gripper("is not calibrated", "calibrate it"),
    112756: _gripper("lost its vacuum", "check suction cup and air supply"),
    112757: _gripper("got a value out of range", "give positions of 0 to 25 mm and forces of 0 to 20 N"),
    112758: _gripper("could not move to a position"),
    112759: _gripper("could not grip at a position"),
    112760: _gripper("could not grip outwards"),
}

STARTED = (10150, 10151)
"""The program was started: what is older is history."""

_LESS_AND_LESS_TELLING = (10013, 10012, 10015, 10016, 10045, 10010, 10125)

NOT_TELLING = (10010, 10125)
"""Motors off, program stopped: they come with every other stop, and may come before what says more."""

AUTO_CONFIRMED = 10017
"""Somebody has confirmed AUTO at the FlexPendant."""

MOTORS_OFF, RESTARTED = 10010, 10045

UNHANDLED = 40228
"""An error that the program does not handle: it follows the event of that error, EGM's time-out too."""

_PERSONS_DEEDS = {10014, 10015, 10016, AUTO_CONFIRMED}
"""Mode switch, and system failure, which somebody has to look at."""

_COLLISIONS = (50056, 50204)
_SAFETY_CHAIN = range(90200, 90300)  # the safety chain was opened: emergency, automatic, general or superior stop
_PERSONS_STOPS = (10012, 10013, *_COLLISIONS)


def needs_person(code: int) -> bool:
    """Whether nothing may move after an event of this number before a person has confirmed it.

    Emergency stop, guard stop (a guard that closes must not start motion) and collision, however they are reported.
    """
    return code in _PERSONS_STOPS or code in _SAFETY_CHAIN


def is_guard_stop(code: int) -> bool:
    """Whether an event of this number is a guard stop, which also comes when the mode switch leaves AUTO."""
    return code in {10012, *_SAFETY_CHAIN}


def is_without_person(event: Event) -> bool:
    """Whether an event is the cause of a stop in which no person was involved.

    EGM's time-out, a restart of the controller, and the watchdog of our own program (see ``TRobWatchdog.mod``). Not a
    program stop alone, which may have been the stop button of the FlexPendant.
    """
    return event.code in {41822, 10045} or (event.code == 80001 and "watchdog" in event.title.lower())


def are_without_person(events: Iterable[Event]) -> bool:
    """Whether none of the events since the program was started tells of a person at the robot, or of another fault.

    Args:
        events: newest first, as the controller lists them.
    """
    recent = _since_start(events)
    codes = {event.code for event in recent}
    if codes & _PERSONS_DEEDS or any(map(needs_person, codes)) or (MOTORS_OFF in codes and RESTARTED not in codes):
        return False
    errors = [event for event in recent if event.type is EventType.ERROR and event.code != UNHANDLED]
    return all(map(is_without_person, errors)) and (bool(errors) or UNHANDLED not in codes)


def explain(event: Event) -> str:
    """An event in a sentence, without its full stop: number, cause and remedy; ABB's words where we have none."""
    text = EVENT_TEXTS.get(event.code)
    own = event.description or event.title
    if text is None:
        return f"{event.code} {event.title}: {own.rstrip('.')}"
    detail = f" ({own.rstrip('.')})" if event.type is EventType.ERROR else ""
    return f"{event.code} {event.title}: {text.cause}{detail}; {text.remedy}"


def cause_among(events: Iterable[Event]) -> Event | None:
    """What stopped the robot: the first error since the program was started, or the stop that tells most.

    Args:
        events: newest first, as the controller lists them.
    """
    recent = _since_start(events)
    errors = [event for event in recent if event.type is EventType.ERROR]
    if errors:
        return errors[-1]
    stops = [event for event in recent if event.code in _LESS_AND_LESS_TELLING]
    return min(stops, key=lambda event: _LESS_AND_LESS_TELLING.index(event.code), default=None)


def _since_start(events: Iterable[Event]) -> list[Event]:
    """Those after the program was last started; ``events`` are newest first."""
    return list(takewhile(lambda event: event.code not in STARTED, events))
