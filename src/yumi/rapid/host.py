"""The host: what a task needs from the controller it runs on, and the events it reports to it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Protocol


class Execution(Enum):
    """The state of a task, with RWS' words (reference/statemachine.md §8.1)."""

    UNINITIALIZED = "unin"
    READY = "read"
    STOPPED = "stop"
    STARTED = "star"


class EventKind(Enum):
    """Why a task has stopped by itself, and what stops with it (STOP: nothing else)."""

    ERROR = "error"
    STOP = "stop"
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
    """How serious a message for the event log is."""

    INFORMATION = "information"
    WARNING = "warning"
    ERROR = "error"


class Host(Protocol):
    """The controller as a RAPID task sees it."""

    def write_text(self, task: str, text: str) -> None:
        """Show one line on the operator's display (TPWrite)."""

    def write_event(self, task: str, title: str, text: str, severity: Severity) -> None:
        """Put a message into the event log (ErrWrite)."""

    def read_signal(self, name: str) -> float:
        """The value of an I/O signal; raises KeyError when there is none of that name."""

    def write_signal(self, name: str, value: float) -> None:
        """Set an output; raises KeyError when there is none of that name."""

    def read_file(self, path: str) -> str:
        """The text of a file, by RAPID path ("HOME:/x.mod"); raises OSError."""

    def report(self, task: str, event: TaskEvent) -> None:
        """Called when the task has stopped by itself."""

    def is_virtual(self) -> bool:
        """Whether the controller is a simulation; RobOS() is the opposite."""
