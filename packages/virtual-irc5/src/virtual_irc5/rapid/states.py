"""The states of a task, the system events that start its event routines, and the events it reports."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Execution(Enum):
    """The state of a task, with RWS' words (reference/statemachine.md §8.1)."""

    UNINITIALIZED = "unin"
    READY = "read"
    STOPPED = "stop"
    STARTED = "star"


class SystemEvent(Enum):
    """What event routines run on; the values are EventType()'s, the names those of the system parameters (-Shelf)."""

    POWER_ON = 1
    START = 2
    STOP = 3
    QSTOP = 4
    RESTART = 5
    RESET = 6
    STEP = 7

    @property
    def is_of_start(self) -> bool:
        """Whether its routines belong to a start of the program, which goes on after them."""
        return self in (SystemEvent.START, SystemEvent.RESTART, SystemEvent.STEP)


class EventKind(Enum):
    """Why a task has stopped by itself, and what stops with it (STOP: nothing else)."""

    ERROR = "error"
    STOP = "stop"
    BREAKPOINT = "breakpoint"
    STEPPED = "one step executed"
    STOP_ALL_TASKS = "stop all motion tasks"
    SYSTEM_STOP = "stop the system"
    SYSTEM_STOP_BLOCK = "stop the system, program pointers lost"
    SYSTEM_HALT = "stop the system, motors off"
    EXIT = "exit"
    FINISHED = "finished"


@dataclass(frozen=True, slots=True)
class TaskEvent:
    """A task has stopped by itself.

    Attributes:
        sentence: what happened and where, for a person.
        error: the error's name, "" when there is none.
        number: its ERRNO, 0 when there is none.
        line: counted from 1 in the module's file, 0 when no program was left.
    """

    kind: EventKind
    sentence: str
    error: str = ""
    number: int = 0
    module: str = ""
    routine: str = ""
    line: int = 0


class Severity(Enum):
    """How serious a message for the event log is; the values are those of RAPID's errtype, and RWS' msgtype."""

    INFORMATION = 1
    WARNING = 2
    ERROR = 3
