"""What a RAPID task of the virtual controller runs on: screen, signals, files."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

from yumi.rapid.errors import RapidRuntimeError
from yumi.rapid.host import Severity, TaskEvent
from yumi.virtual.events import EventLog, EventType
from yumi.virtual.refusal import Refusal, Refused
from yumi.virtual.signals import Signals

_SCREEN_LINES = 200
_NUMBERS: Mapping[Severity, tuple[int, EventType]] = {
    Severity.ERROR: (80001, EventType.ERROR),
    Severity.WARNING: (80002, EventType.WARNING),
    Severity.INFORMATION: (80003, EventType.INFORMATION),
}  # of messages that programs write


class TaskHost:
    """The host of one task.

    Attributes:
        lines: what the task wrote to the FlexPendant, oldest first; it remembers the last few.
        events: why the task stopped by itself, until somebody takes note.
    """

    def __init__(self, signals: Signals, files: Mapping[str, str], log: EventLog, *, is_virtual: bool) -> None:
        self.lines: deque[str] = deque(maxlen=_SCREEN_LINES)
        self.events: deque[TaskEvent] = deque()
        self._signals = signals
        self._files = files
        self._log = log
        self._is_virtual = is_virtual

    def write_text(self, task: str, text: str) -> None:
        self.lines.append(text)

    def write_event(self, task: str, title: str, text: str, severity: Severity) -> None:
        code, type = _NUMBERS[severity]
        self._log.append(code, title, text, type)

    def read_signal(self, name: str) -> float:
        try:
            return self._signals.get(name).value
        except Refused as refused:
            raise KeyError(name) from refused

    def write_signal(self, name: str, value: float) -> None:
        try:
            self._signals.drive(name, value)
        except Refused as refused:
            if refused.reason is Refusal.UNKNOWN:
                raise KeyError(name) from refused
            raise RapidRuntimeError("ERR_ARGVALERR", str(refused)) from refused

    def read_file(self, path: str) -> str:
        try:
            return self._files[path]
        except KeyError as error:
            raise FileNotFoundError(f"there is no file {path}.") from error

    def report(self, task: str, event: TaskEvent) -> None:
        self.events.append(event)

    def is_virtual(self) -> bool:
        return self._is_virtual
