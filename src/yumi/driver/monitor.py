"""The watch: keeps what is known of the robot fresh, whoever changes it.

The controller tells by itself when mode, motors, program, speed ratio or event log change, and when somebody raises a
signal of the state machines; their states are variables that it does not tell, so these are read after each hint, and
often while one of them is about to change. A controller that grants no subscription is asked for the newest number of
its event log instead, which every change of mode, motors and program raises.

What is logged of the robot's state: every change of mode, motors, program and connection, once, with its cause.

A stop comes as several changes, and the event that explains it a little later: they are one line.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from concurrent.futures import TimeoutError as NotInTime
from contextlib import contextmanager
from dataclasses import replace
from math import inf
from threading import Event as Flag
from threading import Lock
from typing import Any, Protocol

from yumi.clock import Clock
from yumi.control.shared_state import Snapshot
from yumi.driver.speed import SpeedSetting
from yumi.driver.state import EGM_OFF, EGM_RUNNING, EGM_STREAMING, RobotState, why_not_ready
from yumi.driver.state_machine import MAIN, RUN_RAPID, START_JOINT, STOP, MachineState, read_machine_state
from yumi.driver.stops import Cause, Stop, StopLog, demand_confirmation, explain
from yumi.errors import ControllerRefused, ProtocolError, YumiError
from yumi.process.supervision import SupervisedThread
from yumi.robot.joints import Side
from yumi.rws.client import RwsClient
from yumi.rws.events import CONTROLLER_STATE, EXECUTION, OPERATING_MODE, SPEED_RATIO, Change, event_log, signal_state
from yumi.rws.replies import Event
from yumi.rws.subscription import Subscription
from yumi.rws.types import ControllerState, EventType, ExecutionState, OperatingMode

GROUP = 0.25
"""Changes that come within this time are one line [s]."""

UNEXPLAINED = 0.75
"""A stop that no event has explained after this time is logged without one [s]."""

NOTICED = 0.5
"""A change that a request has made is noticed so long after it at the latest [s]."""

MOTORS_OFF, PROGRAM_STOPPED = "motors off", "RAPID program stopped"
"""Changes that a request may make."""

Report = Callable[[int, str], None]
"""Takes a level of :mod:`logging` and a sentence."""


class StateReports:
    """Turns changes of the robot's state and new events into log lines.

    Args:
        stops: what stopped the robot.
        clock: where its times come from.

    Attributes:
        report: takes the lines.
    """

    def __init__(self, stops: StopLog, clock: Clock) -> None:
        self.report: Report = lambda level, sentence: None
        self._stops = stops
        self._clock = clock
        self._requested: frozenset[str] = frozenset()
        self._requested_until = -inf
        self._is_requested = True
        self._is_first = True
        self._stopped: list[str] = []  # changes that are not logged yet
        self._since = inf
        self._events: list[Event] = []
        self._logged_stop = ""

    @contextmanager
    def requested(self, changes: frozenset[str]) -> Iterator[None]:
        """These changes within the block are what a client of ours has asked for; one block at a time."""
        self._requested, self._requested_until = changes, inf
        try:
            yield
        finally:
            self._requested_until = self._clock.now() + NOTICED

    def request(self, changes: frozenset[str]) -> None:
        """These are asked for, too, within the present block."""
        self._requested |= changes

    def note(self, before: RobotState, after: RobotState) -> None:
        """Take a change, and log what is due.

        Args:
            before: the state that was noted last.
            after: the state now.
        """
        now = self._clock.now()
        better, worse = ([], []) if self._is_first else _changes(before, after)  # what is found at first is no change
        self._is_first = self._is_first and not after.is_connected
        if worse:
            self._is_requested &= now < self._requested_until and self._requested.issuperset(worse)
            self._stopped += worse
            self._since = min(self._since, now)
        if better:
            self.report(logging.INFO, f"{_sentence(better)}.")
        news = self._stops.take_news()
        self._events += [event for event in news if event.type is EventType.ERROR]
        if self._events or (after.stop and after.stop != self._logged_stop):
            self._since = min(self._since, now)
        waited = now - self._since
        if waited >= UNEXPLAINED or (waited >= GROUP and (self._stops.is_certain or not self._stopped)):
            self._log(after)

    def next_due(self, delay: float) -> float:
        """``delay`` [s], or less where something has to be logged before."""
        return min(delay, max(self._since + GROUP - self._clock.now(), GROUP / 5)) if self._since < inf else delay

    def _log(self, state: RobotState) -> None:
        parts, events, cause = self._stopped, self._events, self._stops.cause
        self._stopped, self._events, self._since = [], [], inf
        is_new_stop = bool(state.stop) and state.stop != self._logged_stop
        if state.stop:
            self._logged_stop = state.stop
        if parts or is_new_stop:
            is_error = (
                bool(state.stop) or not state.is_connected or (cause is not None and cause.type is EventType.ERROR)
            )
            what = _sentence(parts) if parts else "The robot was stopped"
            why = f": {state.cause}" if state.cause else ""
            if is_error:
                self.report(logging.ERROR, f"{what}{why}.{demand_confirmation(state.stop)}")
            elif self._is_requested:
                self.report(logging.INFO, f"{what}, as requested.")
            else:
                self.report(logging.WARNING, f"{what}{why}.")
            self._is_requested = True
            stop = self._stops.stop
            told = {*(stop.codes if stop else ()), cause.code if cause else 0}
            events = [event for event in events if event.code not in told]
        for event in events:
            self.report(logging.ERROR, f"The controller reports {explain(event)}.")


def _changes(before: RobotState, after: RobotState) -> tuple[list[str], list[str]]:
    """What has changed for the better, and what for the worse."""
    if before.is_connected != after.is_connected:
        if not after.is_connected:
            return [], ["the controller does not answer"]
        return ["the controller answers"], _changes(_WORKING, after)[1]
    better: list[str] = []
    worse: list[str] = []
    if after.mode is not before.mode and after.mode is not None:
        (better if after.mode is OperatingMode.AUTO else worse).append(f"operating mode {after.mode.value}")
    if after.controller_state is not before.controller_state and after.controller_state is not None:
        if after.controller_state is ControllerState.MOTORS_ON:
            better.append("motors on")
        else:
            worse.append(_MOTORS.get(after.controller_state, f"controller {after.controller_state.value}"))
    if after.execution is not before.execution and after.execution is not None:
        is_running = after.execution is ExecutionState.RUNNING
        (better if is_running else worse).append(f"RAPID program {after.execution.value}")
    return better, worse


_WORKING = RobotState(
    is_connected=True,
    mode=OperatingMode.AUTO,
    controller_state=ControllerState.MOTORS_ON,
    execution=ExecutionState.RUNNING,
)
_MOTORS = {
    ControllerState.MOTORS_OFF: MOTORS_OFF,
    ControllerState.GUARD_STOP: "motors off by a guard stop",
    ControllerState.EMERGENCY_STOP: "motors off by an emergency stop",
    ControllerState.EMERGENCY_STOP_RESET: "emergency stop released, motors off",
    ControllerState.SYSTEM_FAILURE: "system failure",
    ControllerState.INIT: "controller starting",
}


def _sentence(parts: list[str]) -> str:
    text = ", ".join(dict.fromkeys(parts))
    return text[0].upper() + text[1:]


EVENT_LOG = event_log()
SIGNALS = tuple(map(signal_state, (START_JOINT, STOP, RUN_RAPID)))
RESOURCES = (OPERATING_MODE, CONTROLLER_STATE, EXECUTION, SPEED_RATIO, EVENT_LOG, *SIGNALS)
"""What the controller is asked to tell."""

POLL = 0.15
"""Time between two looks at the event log of a controller that tells nothing by itself [s]."""

BUSY_LOOK = 0.2
"""Time between two looks at state machines that are about to change [s]."""

WHOLE_LOOK = 5.0
"""Everything is read again after this time, should the controller have forgotten to tell something [s]."""

STALE = 2.0 * WHOLE_LOOK
"""What was read longer ago than this is not known any more [s]."""

RECONNECT = 1.0
"""Time between two attempts to reach a controller that does not answer [s]."""

EXPLAINED = 0.5
"""The event log explains a stop within this time [s]: EGM's end arrives before the event that tells why."""

EXPLAIN_LOOK = 0.1
"""Time between two looks while an explanation is awaited [s]."""

Listener = Callable[[RobotState], None]
"""Told the robot's state after a change, on the watch's thread."""

_STOPPING = {EVENT_LOG.path, CONTROLLER_STATE.path, EXECUTION.path, OPERATING_MODE.path}
_STARTING = 503
_JOURNAL = 256  # changes that are remembered while something is read
_FIXED = {MachineState.IDLE, MachineState.RUN_EGM_ROUTINE}


class Snapshots(Protocol):
    """What is needed of the fast lines."""

    def snapshot(self, side: Side) -> Snapshot:
        """What is known of an arm."""


class RobotWatch:
    """What is known of one robot.

    Args:
        client: a connected client.
        fast_lines: where the arms' datagrams arrive.
        clock: where its times come from.
        stops: what stopped the robot.

    Attributes:
        on_change: told each change.
        on_stop: called when a stop has come that a person must confirm, on the watch's thread.
        stops: as above.
        reports: what of it is logged.
        speed: the factor on all speeds, told with the rest.
    """

    def __init__(self, client: RwsClient, fast_lines: Snapshots, clock: Clock, stops: StopLog) -> None:
        self.on_change: Listener = lambda _: None
        self.on_stop: Callable[[], None] = lambda: None
        self._seen_stop: Stop | None = None
        self.stops = stops
        self.reports = StateReports(stops, clock)
        self._unexplained: list[tuple[float, Callable[[Cause], None]]] = []  # and when they are answered at the latest
        self.speed = SpeedSetting()
        self._client = client
        self._fast_lines = fast_lines
        self._clock = clock
        self._lock = Lock()
        self._state = RobotState()
        self._told = RobotState()
        self._subscription: Subscription | None = None
        self._is_following = self._is_lost = self._is_hinted = False
        self._journal: deque[Change] = deque(maxlen=_JOURNAL)
        self._told_changes = self._taken_changes = 0  # how many the controller told, the thread looked at
        self._looked_at = self._glanced_at = -RECONNECT
        self._read_at = -inf  # when all of it was read last
        self._bell, self._is_over = Flag(), Flag()
        self._thread: SupervisedThread | None = None

    # For everybody, from any thread

    @property
    def is_running(self) -> bool:
        """Whether it keeps itself fresh."""
        return self._thread is not None

    def state(self) -> RobotState:
        """What was known last, with EGM as it is now; nothing is known that was read too long ago."""
        with self._lock:
            age = self._clock.now() - self._read_at
            if self._state.is_connected and age > STALE:
                unknown = self._completed(RobotState())
                return replace(unknown, reason=f"the robot's state is unknown: it was read {age:.0f} s ago")
            return self._completed(self._state)

    def look(self) -> RobotState:
        """Read all of it now; a controller that does not answer is a state, too."""
        try:
            self._read_whole()
        except YumiError:
            self._forget()
            if self.is_running:  # it connects anew at once: this may have been one request that failed
                self._is_lost = True
                self._bell.set()
        return self.state()

    def refresh(self) -> None:
        """Read what a step of our own has changed, so that who asks next sees it."""
        if self.is_running:
            self.look()

    def hint(self) -> None:
        """Something has happened to an arm: have a look soon."""
        self._is_hinted = True
        self._bell.set()

    def explain(self, then: Callable[[Cause], None]) -> None:
        """Have ``then`` called, on the watch's thread, once it is known what stopped the robot.

        That is after :data:`EXPLAINED` at the latest, and one answer of the controller; at once where nothing watches.
        """
        if not self.is_running:
            then(self.cause())
            return
        with self._lock:
            self._unexplained.append((self._clock.now() + EXPLAINED, then))
        self._bell.set()

    def wait_for_cause(self) -> Cause:
        """What stopped the robot, waiting until it is known as :meth:`explain` does; empty while it works."""
        answer: Future[Cause] = Future()
        self.explain(answer.set_result)
        try:
            return answer.result(2.0 * EXPLAINED)
        except NotInTime:  # the controller does not answer either
            return self.cause()

    def cause(self) -> Cause:
        """What stopped the robot, as far as it is known now; empty while it works."""
        state = self.state()
        return Cause(state.cause, state.stop)

    # The thread

    def start(self) -> None:
        """Keep it fresh from now on; what is known at first is read here."""
        self._is_over.clear()
        self.look()
        self._seen_stop = self.stops.stop  # one that was there before we did anything
        thread = SupervisedThread("robot-watch", self._run, self._is_over, self._fail)
        thread.start()
        self._thread = thread

    def stop(self) -> None:
        """Know nothing any more."""
        self._is_over.set()
        self._bell.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self._answer_unexplained(is_over=True)
        self._lose()

    def step(self) -> float:
        """Take what was told, read what is due, tell what has changed; returns how soon the next step is due [s]."""
        now = self._clock.now()
        try:
            delay = self._follow(now) if self._is_following else self._connect(now)
        except YumiError:  # a controller that is starting refuses everything
            delay = RECONNECT
            self._lose()
        self._tell()
        self._answer_unexplained()
        stop, self._seen_stop = self._seen_stop, self.stops.stop
        if self._seen_stop is not None and self._seen_stop != stop:
            self.on_stop()
        return self.reports.next_due(min(delay, EXPLAIN_LOOK) if self._unexplained else delay)

    @property
    def is_rung(self) -> bool:
        """Whether the next step is due at once."""
        return self._bell.is_set()

    def take_ring(self) -> None:
        """Begin a step; what rings from now on is for the next one."""
        self._bell.clear()

    def _run(self) -> None:
        while not self._is_over.is_set():
            self.take_ring()
            self._bell.wait(self.step())

    def _fail(self) -> None:
        """What was known may be wrong; the next step begins anew."""
        self._forget()
        self._lose()
        self._tell()

    def _connect(self, now: float) -> float:
        self._subscribe()
        self._read_whole()
        self._looked_at = self._glanced_at = now
        self._is_following = True
        return self._next_look()

    def _follow(self, now: float) -> float:
        is_whole = now - self._looked_at >= WHOLE_LOOK
        if self._is_lost or (is_whole and self._subscription is None):
            self._unsubscribe()
            return self._connect(now)
        is_hinted, self._is_hinted = self._is_hinted, False
        if is_whole or (self._subscription is None and self._has_news()):
            self._read_whole()
            self._looked_at = self._glanced_at = now
        elif self._take_changes() or is_hinted or (self._is_busy and now - self._glanced_at >= BUSY_LOOK):
            self._update(machines=self._machines())
            self._glanced_at = now
        return self._next_look()

    def _next_look(self) -> float:
        if self._subscription is None:
            return POLL
        return BUSY_LOOK if self._is_busy else WHOLE_LOOK

    @property
    def _is_busy(self) -> bool:
        """Whether a state machine is about to change, or its arm's datagrams tell of another state."""
        egm = egm_states(self._fast_lines)
        return any(
            machine not in _FIXED or (machine is MachineState.RUN_EGM_ROUTINE) != (egm[side] == EGM_RUNNING)
            for side, machine in self._state.machines.items()
            if machine is not None
        )

    def _lose(self) -> None:
        self._is_following = False
        self._unsubscribe()
        self._forget()

    # What the controller tells

    def _subscribe(self) -> None:
        """A controller that refuses is polled."""
        self._is_lost = False
        try:
            self._subscription = self._client.subscribe(RESOURCES, self._note, self._note_loss)
        except (ControllerRefused, ProtocolError):
            self._client.system()  # raises unless it answers
            self._subscription = None

    def _unsubscribe(self) -> None:
        subscription, self._subscription = self._subscription, None
        if subscription is not None:
            subscription.close()

    def _note(self, change: Change) -> None:
        """Known at once: the thread may be waiting for the turn of a request."""
        with self._lock:
            self._journal.append(change)
            self._told_changes += 1
            if self._state.is_connected:
                self._state = changed(self._state, change)
        self._bell.set()

    def _note_loss(self, sentence: str) -> None:
        self._is_lost = True
        self._bell.set()

    def _take_changes(self) -> bool:
        """Whether anything was told; of several events only the newest is read."""
        with self._lock:
            paths = {change.path for change in self._changes_since(self._taken_changes)}
            self._taken_changes = self._told_changes
        if self._unexplained or paths & _STOPPING:
            self._update(last_event=self.stops.look(self._client)[1])
        return bool(paths)

    def _has_news(self) -> bool:
        newest, known = self._newest_event(), self._state.last_event
        return (newest.number if newest else 0) != (known.number if known else 0)

    # What is read

    def _read(self) -> RobotState:
        client = self._client
        mode, execution, machines, ratio = (
            client.operating_mode(),
            client.execution(),
            self._machines(),
            client.speed_ratio(),
        )
        controller_state, newest = self.stops.look(client)
        return RobotState(
            is_connected=True,
            mode=mode,
            controller_state=controller_state,
            execution=execution,
            machines=machines,
            speed_ratio=ratio,
            last_event=newest,
        )

    def _newest_event(self) -> Event | None:
        events = self._client.events(count=1)
        return events[0] if events else None

    def _machines(self) -> Mapping[Side, MachineState | None]:
        return {side: self._machine(side) for side in Side}

    def _machine(self, side: Side) -> MachineState | None:
        try:
            return read_machine_state(self._client.symbol(side.task, MAIN, "current_state"))
        except ProtocolError:
            return None
        except ControllerRefused as error:
            if error.status == _STARTING:
                raise
            return None

    # What is kept

    def _read_whole(self) -> None:
        """Read all; what is told meanwhile may be newer than what was read, whoever has looked at it since."""
        begin = self._told_changes
        state = self._read()
        with self._lock:
            for change in self._changes_since(begin):
                state = changed(state, change)
            self._state, self._read_at = state, self._clock.now()
            if self._told_changes > begin:  # events and state machines are not told, but have to be read again
                self._taken_changes = min(self._taken_changes, begin)
                self._bell.set()

    def _changes_since(self, number: int) -> list[Change]:
        count = self._told_changes - number
        return list(self._journal)[-count:] if count else []

    def _forget(self) -> None:
        with self._lock:
            self._state = RobotState()

    def _update(self, **fields: Any) -> None:
        with self._lock:
            self._state = replace(self._state, **fields)

    def _completed(self, state: RobotState) -> RobotState:
        live = replace(state, egm=egm_states(self._fast_lines), speed_scale=self.speed.in_force)
        reason, stop, event = why_not_ready(live), self.stops.stop, self.stops.cause
        if stop is not None:
            confirm = f"a person must confirm the stop {stop.id}"
            return replace(live, reason=f"{reason}; {confirm}" if reason else confirm, cause=stop.cause, stop=stop.id)
        cause = "" if not live.is_stopped else reason if event is None or not live.is_connected else explain(event)
        return replace(live, reason=reason, cause=cause)

    def _tell(self) -> None:
        state = self.state()
        if state.is_connected and not state.is_stopped:
            self.stops.settle()
        self.reports.note(self._told, state)
        if state != self._told:
            self._told = state
            self.on_change(state)

    def _answer_unexplained(self, *, is_over: bool = False) -> None:
        now, state = self._clock.now(), self.state()
        is_known = state.is_connected and state.is_stopped and self.stops.is_certain
        with self._lock:
            due = [each for each in self._unexplained if is_over or is_known or each[0] <= now]
            self._unexplained = [each for each in self._unexplained if each not in due]
        for _, then in due:
            then(Cause(state.cause, state.stop))


def changed(state: RobotState, change: Change) -> RobotState:
    """``state`` after what the controller has told; an unknown word changes nothing."""
    for name, text in change.fields.items():
        try:
            if name == "opmode":
                state = replace(state, mode=OperatingMode(text))
            elif name == "ctrlstate":
                state = replace(state, controller_state=ControllerState(text))
            elif name == "ctrlexecstate":
                state = replace(state, execution=ExecutionState(text))
            elif name == "speedratio":
                state = replace(state, speed_ratio=int(text))
        except ValueError:
            continue
    return state


def egm_states(fast_lines: Snapshots) -> Mapping[Side, str]:
    """EGM of each arm in a word."""
    return {side: _egm(fast_lines.snapshot(side)) for side in Side}


def _egm(snapshot: Snapshot) -> str:
    return EGM_RUNNING if snapshot.is_running else EGM_STREAMING if snapshot.is_streaming else EGM_OFF
