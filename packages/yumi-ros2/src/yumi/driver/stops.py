"""Stops of the robot: what caused one, explained in words, and which one waits for a person.

Computed from the event log and the controller's state together. After an emergency stop, a guard stop or a collision a
reset must not itself start motion (IEC 60204-1 section 9.2, ISO 10218-1 section 5.5): such a stop stays open until a
person confirms it by its id. The id has a random part, made when this program first saw the stop, so that no program
can know it beforehand.
"""

from __future__ import annotations

import secrets
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import takewhile
from math import inf
from threading import RLock
from typing import Protocol

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import RobotNotReady, StopNotConfirmed
from abb_protocols.robot.joints import Side
from abb_protocols.rws.operations.event_log import RwsEvent
from abb_protocols.rws.values import ControllerState, EventType
from abb_runtime.clock import Clock
from yumi.control.loop_events import Event as ArmEvent
from yumi.control.loop_events import RobotStoppedFollowing
from yumi.driver.readiness import NO_STOP, unmet
from yumi.driver.robot_state import RobotState
from yumi.texts.events import KNOWN_NUMBERS

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

_EGM_ERRORS = {_EGM_TIMEOUT, 41826, 41828, 41830, 50452}  # the program may go on after them

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

STOP_HISTORY = 2.0
"""An event that came so long before the robot was last seen to work has not stopped it [s]."""


def needs_person(code: int) -> bool:
    """Whether nothing may move after an event of this number before a person has confirmed it.

    Emergency stop, guard stop (a guard that closes must not start motion) and collision, however they are reported.
    """
    return code in {_EMERGENCY_STOP, _GUARD_STOP, *_COLLISIONS} or code in _SAFETY_CHAIN


def has_ended_egm(event: RwsEvent) -> bool:
    """Whether an event is an error that ends EGM, also where the program goes on."""
    return event.type is EventType.ERROR and event.code in _EGM_ERRORS


def _is_guard_stop(code: int) -> bool:
    """Whether an event of this number is a guard stop, which also comes when the mode switch leaves AUTO."""
    return code == _GUARD_STOP or code in _SAFETY_CHAIN


def is_without_person(event: RwsEvent) -> bool:
    """Whether an event is the cause of a stop in which no person was involved.

    EGM's time-out, a restart of the controller, and the watchdog of our own program (see ``TRobWatchdog.mod``). Not a
    program stop alone, which may have been the stop button of the FlexPendant.
    """
    is_watchdog = event.code == _PROGRAM_ERROR and "watchdog" in event.title.lower()
    return is_watchdog or event.code in {_EGM_TIMEOUT, _RESTARTED}


def _are_without_person(events: Iterable[RwsEvent]) -> bool:
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


def explain(event: RwsEvent) -> Message:
    """An event with its cause and remedy; ABB's words where we have none, and beside ours where an error's say more."""
    own = (event.description or event.title).strip().removesuffix(".")
    if event.code not in KNOWN_NUMBERS:
        return message("event", number=event.code, title=event.title, detail=own)
    if event.type is EventType.ERROR and event.code not in _STOPS:  # of those we say all that the controller does
        return Message(f"event_{event.code}_with_detail", {"number": event.code, "title": event.title, "detail": own})
    return Message(f"event_{event.code}", {"number": event.code, "title": event.title})


def cause_among(events: Iterable[RwsEvent]) -> RwsEvent | None:
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


def _since_start(events: Iterable[RwsEvent]) -> list[RwsEvent]:
    """Those after the program was last started, newest first: who started it took note of what was before."""
    return list(takewhile(lambda event: event.code not in _PROGRAM_STARTED, events))


class _EventSource(Protocol):
    """What is needed of a client: state of the motors, and the event log, newest first."""

    def controller_state(self) -> ControllerState: ...

    def events(self, domain: int = 0, count: int = 50) -> tuple[RwsEvent, ...]: ...


@dataclass(frozen=True, slots=True)
class Stop:
    """A stop that a person must confirm.

    Attributes:
        id: what the confirmation names.
        causes: its events with what to do, oldest first.
        event_codes: of its events, oldest first.
    """

    id: str
    causes: tuple[Message, ...]
    event_codes: tuple[int, ...]

    @classmethod
    def of(cls, events: tuple[RwsEvent, ...], code: int = 0) -> Stop:
        """The stop of ``events``, oldest first; where there are none, of a state that comes with event ``code``."""
        first: dict[int, RwsEvent] = {}
        for event in events:
            first.setdefault(event.code, event)
        causes = tuple(explain(event) for event in first.values()) or (
            explain(RwsEvent(0, EventType.INFORMATION, code, "", _STOP_TITLES[code], _STOP_TITLES[code])),
        )
        newest = events[-1].number if events else 0
        identity = f"{events[-1].code if events else code}-{newest}-{secrets.token_hex(3)}"
        return cls(identity, causes, tuple(first) or (code,))

    def refusal(self, state: ControllerState) -> Message:
        """Why nothing moves while it is open, the stop that is still active included."""
        active = _active_stop(state)
        if active is None:
            return message("stopped_by", causes=self.causes, stop=self.id)
        return message("stopped_by_and_active", causes=self.causes, stop=self.id, reason=active)


@dataclass(frozen=True, slots=True)
class Cause:
    """Why an arm or the robot was stopped.

    Attributes:
        causes: with what to do, oldest first; empty where the controller reports no stop.
        stop: id of the stop that a person must confirm; empty where there is none.
    """

    causes: tuple[Message, ...] = ()
    stop: str = ""


Explain = Callable[[Callable[[Cause], None]], None]
"""Calls back with what stopped the robot, once that is known."""


@dataclass(frozen=True, slots=True)
class _KnownStop:
    """Replaced as a whole, so that it can be read from any thread at any time."""

    stop: Stop | None = None
    cause: RwsEvent | None = None


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
        self._stop_events: tuple[RwsEvent, ...] = ()
        self._awaits_event_until = -inf  # the event of a stop that is known by the state alone comes by then [s]
        self._recent: deque[tuple[RwsEvent, float]] = deque(maxlen=_PAGES[-1])  # newest first, and when it was seen
        self._news: deque[RwsEvent] = deque(maxlen=_PAGES[-1])
        self.is_complete = True
        """Whether every event since the last confirmed or working state was seen."""

    @property
    def stop(self) -> Stop | None:
        """The stop that waits for a person's confirmation; as of the last reading."""
        return self._known.stop

    @property
    def cause(self) -> RwsEvent | None:
        """The event that explains why the robot stands, if one does; as of the last reading."""
        return self._known.cause

    def check_none_open(self) -> None:
        """Refuse motion while a stop is open, from what is known already.

        Raises:
            RobotNotReady: one is.
        """
        stop = self.stop
        if stop is not None:
            raise RobotNotReady(message("stopped_by", causes=stop.causes, stop=stop.id), stop.id)

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

    def read(self, client: _EventSource) -> tuple[ControllerState, RwsEvent | None]:
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
                self._awaits_event_until = self._clock.now() + STOP_HISTORY
            return state, events[0] if events else None

    def check_confirmed(self, client: _EventSource, confirmed: str) -> None:
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
                raise StopNotConfirmed(stop.refusal(state), stop.id)
            if confirmed != stop.id:
                raise StopNotConfirmed(message("another_stop_open", given=confirmed, open=stop.refusal(state)), stop.id)
            active = _active_stop(state)
            if active is not None:
                raise StopNotConfirmed(
                    message("still_stopped", stop=stop.id, reason=active, causes=stop.causes), stop.id
                )

    def check_unchanged(self, client: _EventSource, confirmed: str) -> None:
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
            limit = self._clock.now() - STOP_HISTORY
            while self._recent and self._recent[-1][1] <= limit:
                self._recent.pop()
            self.is_complete = True
            self._known = replace(self._known, cause=cause_among(event for event, _ in self._recent))

    def settle_egm(self, client: _EventSource) -> None:
        """EGM runs again: what ended it before has not stopped the robot. Where a person was involved, it may yet have.

        Raises:
            YumiError: the controller does not answer.
        """
        with self._lock:
            self.read(client)  # the event of a time-out may come after the request to start again
            kept = [each for each in self._recent if not is_without_person(each[0])]
            self._recent = deque(kept, self._recent.maxlen)
            self._known = replace(self._known, cause=cause_among(event for event, _ in kept))

    def take_news(self) -> tuple[RwsEvent, ...]:
        """Events that came since the first reading and were not taken yet, oldest first."""
        with self._lock:
            news = tuple(self._news)
            self._news.clear()
            return news

    def _is_enough(self, events: tuple[RwsEvent, ...]) -> bool:
        """Whether older events are known, or history."""
        if self._newest < 0 or events[0].number < self._newest:
            return any(event.code in _PROGRAM_STARTED for event in events)
        return events[-1].number <= self._newest + 1

    def _take(self, events: tuple[RwsEvent, ...]) -> None:
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
        if confirmed < len(fresh) and stop is not None and all(map(_is_guard_stop, stop.event_codes)):
            # Leaving AUTO is a guard stop, too; who has confirmed AUTO at the FlexPendant has looked at the robot.
            self._stop_events, stop = (), None
        stops = tuple(
            event
            for index, event in reversed(list(enumerate(fresh)))
            if needs_person(event.code) and (index < confirmed or not _is_guard_stop(event.code))
        )
        is_awaited = not self._stop_events and now <= self._awaits_event_until
        if stops and stop is not None and is_awaited and stop.event_codes == (stops[-1].code,):
            # The event of a stop that was known by the state alone; a person may know its id already.
            self._stop_events = stops
            stop = replace(Stop.of(stops), id=stop.id)
        elif stops:
            self._stop_events += stops
            stop = Stop.of(self._stop_events)
        self._known = _KnownStop(stop, cause_among(event for event, _ in self._recent))


def explained(event: ArmEvent, cause: Cause) -> Message:
    """What happened to an arm, with its cause and what a person must do."""
    if not cause.causes and isinstance(event, RobotStoppedFollowing):
        return message("ended_by_program", event=event.said)
    return because(event.said, cause)


def because(said: Message, cause: Cause) -> Message:
    """A message with what stopped the robot, where something did."""
    if cause.stop:
        return message("explained_stop", event=said, causes=cause.causes, stop=cause.stop)
    if not cause.causes:
        return said
    if any(each.actions for each in cause.causes):
        return message("explained", event=said, causes=cause.causes)
    return message("explained_to_go_on", event=said, causes=cause.causes)


def _active_stop(state: ControllerState) -> Message | None:
    """The stop that no request ends, and what does; None where there is none."""
    robot = RobotState(controller_state=state)
    stop = unmet(NO_STOP, robot)
    return None if stop is None else stop.reason(robot, tuple(Side))
