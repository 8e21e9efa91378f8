"""The pauses of a task: steps and breakpoints, and the record of statements; asked before each statement."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from virtual_irc5.rapid.frame import RoutineFrame
from virtual_irc5.rapid.machine import Machine
from virtual_irc5.rapid.states import EventKind


class StepKind(Enum):
    """How far a step goes; the values are RWS' words."""

    IN = "stepin"
    OVER = "stepover"
    OUT = "stepout"


@dataclass(frozen=True, slots=True)
class StackEntry:
    """A routine of the call stack and the line it is at, counted from 1 in the module's file."""

    module: str
    routine: str
    line: int


class Pauses:
    """Lets the machine ask before each statement what is needed, and nothing where nothing is.

    Attributes:
        breakpoints: module in lower case, and line; they count where `begin` says so.
        spy, end_of_spy: called before each statement while execution is recorded, and then (SpyStart, SpyStop).
    """

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self.breakpoints: set[tuple[str, int]] = set()
        self.spy: Callable[[StackEntry], None] | None = None
        self.end_of_spy: Callable[[], None] = lambda: None
        self._step: StepKind | None = None
        self._stops_at_breakpoints = False
        self._started_at = 0  # the machine's instant
        self._reason: Callable[[RoutineFrame], EventKind | None] | None = None

    def begin(self, step: StepKind | None, *, stop_at_breakpoints: bool) -> None:
        """The task starts, to the end of one step when one is given."""
        self._step, self._stops_at_breakpoints = step, stop_at_breakpoints
        self._started_at, self._reason = self._machine.instant, None
        self.watch()

    def watch(self) -> None:
        """Follow a change of breakpoints or of the spy; without any the machine executes as fast as ever."""
        are_some = self._stops_at_breakpoints and bool(self.breakpoints)
        if self._step is None and not are_some:
            self._reason = None
        elif self._reason is None and self._machine.program:
            self._reason = self._reason_of(self._step, has_begun=self._machine.instant != self._started_at)
        reason = self._reason

        def spied(frame: RoutineFrame) -> EventKind | None:
            if self.spy is not None:
                self.spy(StackEntry(frame.routine.module.name, frame.routine.name, frame.next_line))
            return None if reason is None else reason(frame)

        self._machine.pause = reason if self.spy is None else spied

    def _reason_of(self, step: StepKind | None, *, has_begun: bool) -> Callable[[RoutineFrame], EventKind | None]:
        """Why the task pauses before a statement; not before the one it starts with."""
        frames, program = self._machine.frames, self._machine.program
        depth, top = len(program), program[-1]
        begun = has_begun or not top.is_between_statements()
        depths = {StepKind.IN: math.inf, StepKind.OVER: depth, StepKind.OUT: depth - 1, None: -1}

        def reason(frame: RoutineFrame) -> EventKind | None:
            nonlocal begun
            if not begun and frame is top:
                begun = True
                return None
            begun = True
            module = frame.routine.module
            may_enter = step is not StepKind.IN or frame is top or "NOSTEPIN" not in module.syntax.attributes
            if may_enter and len(frames) <= depths[step]:
                return EventKind.STEPPED
            if self._stops_at_breakpoints and (module.name.lower(), frame.next_line) in self.breakpoints:
                return EventKind.BREAKPOINT
            return None

        return reason
