"""The monitor: keeps the state of the robot up to date, and logs each change once, with its cause.

The controller reports changes of mode, motors, program, speed ratio and event log over a subscription, and the edges of
the state machines' signals. The states of the state machines are variables without subscription: they are read after
each change, and often while one of them is about to change. A controller that grants no subscription is polled for the
newest number of its event log instead, which every change of mode, motors and program raises.
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
from typing import Any

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import ControllerRefused, ProtocolError, YumiError
from abb_protocols.robot.joints import ZERO_JOINTS, Side, joints
from abb_protocols.rws.operations.event_log import RwsEvent
from abb_protocols.rws.values import ControllerState, EventType, ExecutionState, OperatingMode
from abb_runtime.clock import Clock
from abb_runtime.process.supervision import SupervisedThread, ThreadFailures
from abb_runtime.rws.client import (
    CONTROLLER_STATE,
    EXECUTION,
    OPERATING_MODE,
    SPEED_RATIO,
    Change,
    RwsClient,
    Subscription,
    event_log,
    signal_state,
)
from yumi.control.loop_events import Event as ArmEvent
from yumi.control.loop_events import RobotStoppedFollowing, SessionLost, SessionStarted, is_fault
from yumi.control.shared_state import JointStates, Snapshots
from yumi.driver.readiness import why_not_ready
from yumi.driver.robot_state import EGM_OFF, EGM_RUNNING, EGM_STREAMING, RobotState
from yumi.driver.speed_setting import SpeedSetting
from yumi.driver.state_machine import (
    RUN_RAPID_SIGNAL,
    START_JOINT_SIGNAL,
    STOP_EGM_SIGNAL,
    MachineState,
    read_machine_state,
)
from yumi.driver.stops import Cause, Stop, StopLog, explain, explained, has_ended_egm

_GROUP = 0.25
"""Changes that come within this time are one line of the log [s]."""

_UNEXPLAINED = 0.75
"""A stop that no event has explained after this time is logged without one [s]."""

_NOTICED = 0.5
"""A change that a request has made is seen so long after it at the latest [s]."""

MOTORS_OFF_CHANGE, PROGRAM_STOPPED_CHANGE = "motors off", "RAPID program stopped"
"""Changes that a request may make."""


class StateLog:
    """Logs changes of the robot's state and new events.

    A stop comes as several changes, and the event that explains it a little later: they are one line.

    Args:
        stops: what stopped the robot.
        clock: gives the time.

    Attributes:
        report: takes the level of :mod:`logging` and what each line says.
    """

    def __init__(self, stops: StopLog, clock: Clock) -> None:
        self.report: Callable[[int, Message | str], None] = lambda level, said: None
        self._stops = stops
        self._clock = clock
        self._requested: frozenset[str] = frozenset()
        self._requested_until = -inf
        self._is_requested = True
        self._is_first = True
        self._stopped: list[str] = []  # changes that are not logged yet
        self._since = inf
        self._events: list[RwsEvent] = []
        self._logged_stop = ""

    @contextmanager
    def requested(self, changes: frozenset[str]) -> Iterator[None]:
        """These changes within the block are what a client of ours has asked for; one block at a time."""
        self._requested, self._requested_until = changes, inf
        try:
            yield
        finally:
            self._requested_until = self._clock.now() + _NOTICED

    @property
    def is_requesting(self) -> bool:
        """Whether such a block is open."""
        return self._requested_until == inf

    def request(self, changes: frozenset[str]) -> None:
        """These are asked for, too, within the present block."""
        self._requested |= changes

    def note(self, before: RobotState, after: RobotState) -> None:
        """Take a change from ``before``, noted last, to ``after``; logs what is due."""
        now = self._clock.now()
        better, worse = ([], []) if self._is_first else _changes(before, after)  # what is found at first is no change
        self._is_first = self._is_first and not after.is_connected
        if worse:
            self._is_requested &= now < self._requested_until and self._requested.issuperset(worse)
            self._stopped += worse
            self._since = min(self._since, now)
        if better:
            if self._stopped and not before.is_connected:
                self._log(before)  # first what is over now
            self.report(logging.INFO, message("robot_changed", changes=tuple(better)))
        self._events += [event for event in self._stops.take_news() if event.type is EventType.ERROR]
        if self._events or (after.stop and after.stop != self._logged_stop):
            self._since = min(self._since, now)
        waited = now - self._since
        if waited >= _UNEXPLAINED or (waited >= _GROUP and (self._stops.is_certain or not self._stopped)):
            self._log(after)

    def next_due(self, delay: float) -> float:
        """``delay`` [s], or less where something has to be logged before."""
        return min(delay, max(self._since + _GROUP - self._clock.now(), _GROUP / 5)) if self._since < inf else delay

    def _log(self, state: RobotState) -> None:
        parts, events, cause = self._stopped, self._events, self._stops.cause
        self._stopped, self._events, self._since = [], [], inf
        is_new_stop = bool(state.stop) and state.stop != self._logged_stop
        if state.stop:
            self._logged_stop = state.stop
        if parts or is_new_stop:
            what = tuple(dict.fromkeys(parts)) or message("robot_was_stopped")
            if state.stop:
                said = message("changed_by_stop", changes=what, causes=state.causes, stop=state.stop)
            elif state.causes and not state.is_connected:  # its cause is what has changed
                said = message("controller_lost", changes=what, causes=state.causes)
            elif state.causes:
                said = message("changed_by", changes=what, causes=state.causes)
            else:
                said = message("robot_changed", changes=what)
            if state.stop or not state.is_connected or (cause is not None and cause.type is EventType.ERROR):
                self.report(logging.ERROR, said)
            elif self._is_requested:
                self.report(logging.INFO, message("robot_changed_as_requested", changes=what))
            else:
                self.report(logging.WARNING, said)
            self._is_requested = True
            stop = self._stops.stop
            logged = {*(stop.event_codes if stop else ()), cause.code if cause else 0}
            events = [event for event in events if event.code not in logged]
        for event in events:
            self.report(logging.ERROR, message("controller_reports_event", event=explain(event)))


def _changes(before: RobotState, after: RobotState) -> tuple[list[str], list[str]]:
    """What has changed for the better, and what for the worse."""
    if before.is_connected != after.is_connected:
        if not after.is_connected:
            return [], ["the controller does not answer"]
        return ["the controller answers"], _changes(_WORKING, after)[1]
    better: list[str] = []
    worse: list[str] = []
    if after.operating_mode is not before.operating_mode and after.operating_mode is not None:
        (better if after.operating_mode is OperatingMode.AUTO else worse).append(
            f"operating mode {after.operating_mode.value}"
        )
    if after.controller_state is not before.controller_state and after.controller_state is not None:
        if after.controller_state is ControllerState.MOTORS_ON:
            better.append("motors on")
        else:
            worse.append(_MOTORS.get(after.controller_state, f"controller {after.controller_state.value}"))
    if after.execution is not before.execution and after.execution is not None:
        is_running = after.execution is ExecutionState.RUNNING
        (better if is_running else worse).append(f"RAPID program {after.execution.value}")
    return better, worse


_WORKING = RobotState(True, OperatingMode.AUTO, ControllerState.MOTORS_ON, ExecutionState.RUNNING)
_MOTORS = {
    ControllerState.MOTORS_OFF: MOTORS_OFF_CHANGE,
    ControllerState.GUARD_STOP: "motors off by a guard stop",
    ControllerState.EMERGENCY_STOP: "motors off by an emergency stop",
    ControllerState.EMERGENCY_STOP_RESET: "emergency stop released, motors off",
    ControllerState.SYSTEM_FAILURE: "system failure",
    ControllerState.INIT: "controller starting",
}


_EVENT_LOG = event_log()
_SIGNALS = tuple(map(signal_state, (START_JOINT_SIGNAL, STOP_EGM_SIGNAL, RUN_RAPID_SIGNAL)))
_RESOURCES = (OPERATING_MODE, CONTROLLER_STATE, EXECUTION, SPEED_RATIO, _EVENT_LOG, *_SIGNALS)
"""What is subscribed to."""

_POLL = 0.15
"""Time between two polls of the event log of a controller that grants no subscription [s]."""

_BUSY_POLL = 0.2
"""Time between two polls of state machines that are about to change [s]."""

_OWN_POLL = 1.0
"""The same while a request of ours is carried out, which reads itself what it waits for [s].

Together they would have less of the 20 requests a second that ABB permits, and the request would take longer.
"""

WHOLE_POLL = 5.0
"""Everything is read again after this time, should the controller have lost a report [s]."""

STALE_STATE = 2.0 * WHOLE_POLL
"""What was read longer ago than this is unknown [s]."""

_RECONNECT = 1.0
"""Time between two attempts to reach a controller that does not answer [s]."""

_EXPLAINED = 0.5
"""The event log explains a stop within this time [s]: EGM's end arrives before the event that says why."""

_EXPLAIN_POLL = 0.1
"""Time between two polls while an explanation is awaited [s]."""

JOINTS_POLL = 0.4
"""Time between two readings of the joints of arms without EGM [s]: 5 of the 20 requests a second that ABB permits."""

_JOINTS_SPEED = 1.0
"""The speed of the joints is what they moved between two readings, if those are not further apart than this [s]."""

_STOPPING = {_EVENT_LOG.path, CONTROLLER_STATE.path, EXECUTION.path, OPERATING_MODE.path}
_STARTING = 503
_JOURNAL = 256  # changes that are remembered while something is read
_FIXED = {MachineState.IDLE, MachineState.RUN_EGM_ROUTINE}


class RobotMonitor:
    """What is known of one robot.

    Args:
        client: a connected client.
        loop: where the arms' datagrams arrive.
        clock: gives the time.
        stops: what stopped the robot.
        speed: the factor on all speeds, a part of the state.

    Attributes:
        on_change: called with the state after each change, on the monitor's thread.
        on_stop: called when a stop has come that a person must confirm, on the monitor's thread.
        on_joints: called with an arm and its joints when they were read, on the monitor's thread.
        log: logs the changes.
        reads_joints: whether the joints of an arm are read from the controller, too, while EGM does not report them.
        keeps_apart: whether that is so at least while EGM reports the joints of the other arm, which keeps clear of
            it, and once before that.
        allowed_collisions: pairs of parts that may touch now, a part of the state.
    """

    def __init__(self, client: RwsClient, loop: Snapshots, clock: Clock, stops: StopLog, speed: SpeedSetting) -> None:
        self.on_change: Callable[[RobotState], None] = lambda _: None
        self.on_stop: Callable[[], None] = lambda: None
        self.on_joints: Callable[[Side, JointStates], None] = lambda side, states: None
        self.log = StateLog(stops, clock)
        self.reads_joints = self.keeps_apart = False
        self.allowed_collisions: tuple[str, ...] = ()
        self._joints: dict[Side, JointStates] = {}
        self._joints_refused: set[Side] = set()
        self._stops = stops
        self._speed = speed
        self._seen_stop: Stop | None = None
        self._failures = ThreadFailures()
        self._unexplained: list[tuple[float, Callable[[Cause], None]]] = []  # and when they are answered at the latest
        self._client = client
        self._loop = loop
        self._clock = clock
        self._lock = Lock()
        self._state = RobotState()
        self._noted = RobotState()
        self._subscription: Subscription | None = None
        self._is_following = self._is_lost = self._is_poll_requested = False
        self._journal: deque[Change] = deque(maxlen=_JOURNAL)
        self._reported_count = self._handled_count = 0  # changes that the controller reported, that the thread handled
        self._polled_at = self._machines_polled_at = self._joints_polled_at = -_RECONNECT
        self._read_at = -inf  # when all of it was read last
        self._wake, self._is_over = Flag(), Flag()
        self._thread: SupervisedThread | None = None

    # From any thread

    @property
    def is_running(self) -> bool:
        """Whether it keeps itself fresh."""
        return self._thread is not None

    def state(self) -> RobotState:
        """What was known last, with EGM as it is now; what was read too long ago is unknown."""
        with self._lock:
            age = self._clock.now() - self._read_at
            if self._state.is_connected and age > STALE_STATE:
                unknown = self._completed(RobotState())
                return replace(unknown, reasons=(message("state_is_old", age=age),))
            return self._completed(self._state)

    def read(self) -> RobotState:
        """Read all of it now; a controller that does not answer is a state, too."""
        try:
            self._read_whole()
        except YumiError:
            self._update(RobotState())
            if self.is_running:  # it connects anew at once: this may have been one request that failed
                self._is_lost = True
                self._wake.set()
        return self.state()

    def refresh(self) -> None:
        """Read what a step of our own has changed, so that the next call of :meth:`state` has it."""
        if self.is_running:
            self.read()

    def request_poll(self) -> None:
        """Something has happened to an arm: poll soon."""
        self._is_poll_requested = True
        self._wake.set()

    def joints(self, side: Side) -> JointStates | None:
        """The joints of an arm as they were read last, with the time of that; None where they never were."""
        return self._joints.get(side)

    def read_joints(self) -> None:
        """Read the joints of arms, too, from now on, while EGM does not report them."""
        self.reads_joints = True

    def explain(self, then: Callable[[Cause], None]) -> None:
        """Have ``then`` called, on the monitor's thread, once it is known what stopped the robot.

        That is after :data:`_EXPLAINED` at the latest, and one reply of the controller; at once where no thread runs.
        """
        if not self.is_running:
            then(self.cause())
            return
        with self._lock:
            self._unexplained.append((self._clock.now() + _EXPLAINED, then))
        self._wake.set()

    def describe(self, event: ArmEvent, then: Callable[[Message], None]) -> None:
        """Have ``then`` called with what happened to an arm: with the cause, once it is known, where EGM has ended."""
        if is_fault(event) and isinstance(event, SessionLost | SessionStarted | RobotStoppedFollowing):
            self.explain(lambda cause: then(explained(event, cause)))
        elif self._unexplained:  # in the order in which it happened
            self.explain(lambda cause: then(event.said))
        else:
            then(event.said)

    def wait_for_cause(self) -> Cause:
        """What stopped the robot, waiting until it is known as :meth:`explain` does; empty while it works."""
        answer: Future[Cause] = Future()
        self.explain(answer.set_result)
        try:
            return answer.result(2.0 * _EXPLAINED)
        except NotInTime:  # the controller does not answer either
            return self.cause()

    def cause(self) -> Cause:
        """What stopped the robot, as far as it is known now; empty while it works.

        Where the program goes on after an error that has ended EGM, that error is the cause.
        """
        state, event = self.state(), self._stops.cause
        if not state.causes and event is not None and has_ended_egm(event):
            return Cause((explain(event),))
        return Cause(state.causes, state.stop)

    # The thread

    def start(self) -> None:
        """Keep it fresh from now on; what is known at first is read here."""
        self._is_over.clear()
        try:
            self._connect(self._clock.now())
        except YumiError:  # a controller that does not answer is a state, too
            self._lose()
        self._seen_stop = self._stops.stop  # one that was there before we did anything
        thread = SupervisedThread("robot-monitor", self._run, self._is_over, self._fail)
        thread.start()
        self._thread = thread

    def stop(self) -> None:
        """End the thread; nothing is known any more."""
        self._is_over.set()
        self._wake.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self._answer_unexplained(is_over=True)
        self._lose()

    def step(self) -> float:
        """Take what was reported, read what is due, report what has changed; how soon the next step is due [s]."""
        now = self._clock.now()
        try:
            delay = self._follow(now) if self._is_following else self._connect(now)
        except YumiError:  # a controller that is starting refuses everything
            delay = _RECONNECT
            self._lose(since=now)
        self._report()
        self._answer_unexplained()
        stop, self._seen_stop = self._seen_stop, self._stops.stop
        if self._seen_stop is not None and self._seen_stop != stop:
            self.on_stop()
        return self.log.next_due(min(delay, _EXPLAIN_POLL) if self._unexplained else delay)

    def take_wake(self) -> bool:
        """Whether the next step is due at once; what comes from now on is for the step after it."""
        is_due = self._wake.is_set()
        self._wake.clear()
        return is_due

    def _run(self) -> None:
        while not self._is_over.is_set():
            self.take_wake()
            self._wake.wait(self.step())

    def _fail(self) -> None:
        """What was known may be wrong; the next step begins anew."""
        self._lose()
        self._report()

    def _connect(self, now: float) -> float:
        self._is_lost = False
        try:
            self._subscription = self._client.subscribe(_RESOURCES, self._on_change, self._on_lost)
        except (ControllerRefused, ProtocolError):  # it is polled
            self._client.system()  # raises unless it answers
            self._subscription = None
        self._read_whole()
        self._polled_at = self._machines_polled_at = now
        self._is_following = True
        return self._read_joints(self._next_poll())

    def _follow(self, now: float) -> float:
        is_whole = now >= self._whole_due
        if self._is_lost or (is_whole and self._subscription is None):
            self._unsubscribe()
            return self._connect(now)
        is_requested, self._is_poll_requested = self._is_poll_requested, False
        has_news = False
        if not is_whole and self._subscription is None:
            newest, known = self._client.events(count=1), self._state.last_event
            has_news = (newest[0].number if newest else 0) != (known.number if known else 0)
        if is_whole or has_news:
            self._read_whole()
            self._polled_at = self._machines_polled_at = now
            return self._read_joints(self._next_poll())
        with self._lock:  # of several events only the newest is read
            paths = {change.path for change in self._changes_since(self._handled_count)}
            self._handled_count = self._reported_count
        if self._unexplained or paths & _STOPPING:
            self._update(last_event=self._stops.read(self._client)[1])
        if paths or is_requested or (self._is_busy and now - self._machines_polled_at >= self._busy_poll):
            self._update(machines=self._machines())
            self._machines_polled_at = now
        return self._read_joints(self._next_poll())

    def _next_poll(self) -> float:
        if self._subscription is None:
            return _POLL
        due = max(0.01, self._whole_due - self._clock.now())
        return min(_BUSY_POLL, due) if self._is_busy else due  # a request of ours may end before its next poll is due

    @property
    def _whole_due(self) -> float:
        """When everything is to be read again; a request of ours may have read it since the last poll [s]."""
        return max(self._polled_at, self._read_at) + WHOLE_POLL

    @property
    def _busy_poll(self) -> float:
        return _OWN_POLL if self.log.is_requesting else _BUSY_POLL

    @property
    def _is_busy(self) -> bool:
        """Whether a state machine is about to change, or its arm's datagrams show another state."""
        egm = _egm_states(self._loop)
        return any(
            machine not in _FIXED or (machine is MachineState.RUN_EGM_ROUTINE) != (egm[side] == EGM_RUNNING)
            for side, machine in self._state.machines.items()
            if machine is not None
        )

    def _lose(self, since: float = inf) -> None:
        """Nothing is known any more, but what a request of ours has read ``since`` [s]: a step may fail long after."""
        self._is_following = False
        self._unsubscribe()
        if self._read_at < since:
            self._update(RobotState())

    def _unsubscribe(self) -> None:
        subscription, self._subscription = self._subscription, None
        if subscription is not None:
            subscription.close()

    # What the controller reports

    def _on_change(self, change: Change) -> None:
        """Known at once: the thread may be waiting for the turn of a request."""
        with self._lock:
            self._journal.append(change)
            self._reported_count += 1
            if self._state.is_connected:
                self._state = _changed(self._state, change)
        self._wake.set()

    def _on_lost(self, sentence: str) -> None:
        self._is_lost = True
        self._wake.set()

    def _changes_since(self, number: int) -> list[Change]:
        count = self._reported_count - number
        return list(self._journal)[-count:] if count else []

    # What is read

    def _machines(self) -> Mapping[Side, MachineState | None]:
        machines: dict[Side, MachineState | None] = dict.fromkeys(Side)
        for side in Side:
            try:
                machines[side] = read_machine_state(self._client, side)
            except ProtocolError:
                continue
            except ControllerRefused as error:
                if error.status == _STARTING:
                    raise
        return machines

    def _read_joints(self, delay: float) -> float:
        """Read the joints of arms that EGM does not report, if that is due; ``delay`` [s], or less until then."""
        streaming = [side for side in Side if self._loop.snapshot(side).is_streaming]
        silent = [side for side in Side if side not in streaming]
        if not self.reads_joints:
            silent = [side for side in silent if self.keeps_apart and (streaming or side not in self._joints)]
        if silent and self._clock.now() - self._joints_polled_at >= JOINTS_POLL:
            self._joints_polled_at = self._clock.now()
            for side in silent:
                asked = self._clock.now()
                try:
                    position = self._client.joint_target(side.unit)
                except (ControllerRefused, ProtocolError) as error:
                    if side not in self._joints_refused:  # once; the controller may not know them while it starts
                        self._joints_refused.add(side)
                        self.log.report(logging.WARNING, f"The {side.word} arm's joints cannot be read: {error}")
                    continue
                self._joints_refused.discard(side)
                time, last = 0.5 * (asked + self._clock.now()), self._joints.get(side)
                dt = time - last.time if last is not None else inf
                velocity = ZERO_JOINTS
                if last is not None and 0.0 < dt <= _JOINTS_SPEED:
                    velocity = joints([(b - a) / dt for a, b in zip(last.position, position, strict=True)])
                self._joints[side] = JointStates(time, position, velocity)
                self.on_joints(side, self._joints[side])
        # While nothing is to be read, the beginning and the end of EGM are events that ask for a poll.
        return min(delay, max(0.01, self._joints_polled_at + JOINTS_POLL - self._clock.now())) if silent else delay

    def _read_whole(self) -> None:
        """Read all; what is reported meanwhile may be newer than what was read, also if it has been handled since."""
        client, begin = self._client, self._reported_count
        mode, execution, machines = client.operating_mode(), client.execution(), self._machines()
        ratio = client.speed_ratio()
        controller_state, newest = self._stops.read(client)
        state = RobotState(
            True, mode, controller_state, execution, machines=machines, speed_ratio=ratio, last_event=newest
        )
        with self._lock:
            for change in self._changes_since(begin):
                state = _changed(state, change)
            self._state, self._read_at = state, self._clock.now()
            if self._reported_count > begin:  # changes do not contain events and state machines: read those again
                self._handled_count = min(self._handled_count, begin)
                self._wake.set()

    # What is kept

    def _update(self, state: RobotState | None = None, **fields: Any) -> None:
        with self._lock:
            self._state = replace(self._state if state is None else state, **fields)

    def _completed(self, state: RobotState) -> RobotState:
        arms = [self._loop.snapshot(side) for side in Side]
        live = replace(
            state,
            egm=_egm_states(self._loop),
            speed_scale=min([self._speed.in_force, *(arm.speed_cap for arm in arms if arm.is_streaming)]),
            allowed_collisions=self.allowed_collisions,
            limited_by=tuple(arm.limited_by for arm in arms if arm.limited_by),
        )
        stop, event = self._stops.stop, self._stops.cause
        if stop is not None:
            live = replace(live, causes=stop.causes, stop=stop.id)
            return replace(live, reasons=why_not_ready(live))
        reasons = why_not_ready(live)
        if not live.is_stopped:
            causes: tuple[Message, ...] = ()
        elif event is None or not live.is_connected:
            causes = reasons
        else:
            causes = (explain(event),)
        return replace(live, reasons=reasons, causes=causes)

    def _report(self) -> None:
        state = self.state()
        if state.is_connected and not state.is_stopped:
            self._stops.settle()
        self.log.note(self._noted, state)
        if state != self._noted:
            self._noted = state
            self.on_change(state)

    def _answer_unexplained(self, *, is_over: bool = False) -> None:
        now, state = self._clock.now(), self.state()
        is_known = state.is_connected and state.is_stopped and self._stops.is_certain
        with self._lock:
            due = [each for each in self._unexplained if is_over or is_known or each[0] <= now]
            self._unexplained = [each for each in self._unexplained if each not in due]
        cause = self.cause() if due else Cause()
        for _, then in due:
            self._failures.attempt("Reporting what stopped the robot", then, cause)


def _changed(state: RobotState, change: Change) -> RobotState:
    """``state`` after a reported change; an unknown word changes nothing."""
    for name, text in change.fields.items():
        try:
            if name == "opmode":
                state = replace(state, operating_mode=OperatingMode(text))
            elif name == "ctrlstate":
                state = replace(state, controller_state=ControllerState(text))
            elif name == "ctrlexecstate":
                state = replace(state, execution=ExecutionState(text))
            elif name == "speedratio":
                state = replace(state, speed_ratio=int(text))
        except ValueError:
            continue
    return state


def _egm_states(loop: Snapshots) -> Mapping[Side, str]:
    """EGM of each arm in a word."""
    snapshots = {side: loop.snapshot(side) for side in Side}
    return {
        side: EGM_RUNNING if each.is_running else EGM_STREAMING if each.is_streaming else EGM_OFF
        for side, each in snapshots.items()
    }
