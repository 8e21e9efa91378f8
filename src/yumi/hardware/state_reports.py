"""What is logged of the robot's state: every change of mode, motors, program and connection, once, with its cause.

A stop comes as several changes, and the event that explains it a little later: they are one line.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf

from yumi.clock import Clock
from yumi.hardware.event_texts import explain
from yumi.hardware.manager_state import RobotState
from yumi.hardware.stops import StopLog, demand_confirmation
from yumi.rws.replies import Event
from yumi.rws.states import ControllerState, EventType, ExecutionState, OperatingMode

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
