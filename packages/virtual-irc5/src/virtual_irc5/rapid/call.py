"""One call of an instruction or function: its arguments, and the task that executes it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

from virtual_irc5.rapid.devices import Host
from virtual_irc5.rapid.interrupts import Interrupts
from virtual_irc5.rapid.rapid_library import Library
from virtual_irc5.rapid.states import EventKind, SystemEvent
from virtual_irc5.rapid.types import ABSENT_DATA, RapidRuntimeError, Reference

Wait = Iterator["float | None"]


class RunningTask(Protocol):
    """The task that executes a routine, as the routine sees it.

    Attributes:
        host: the controller it runs on.
        library: instructions, functions, types and data beside the program's own.
        now: the task's time, which stands still while the program is stopped [s].
        elapsed: the time that goes on then [s].
        most_retries: how often RETRY begins a statement again.
        is_running: whether it executes anything now.
        is_event_alone: whether it executes event routines that do not belong to a start: no robot may move.
        event: the system event whose event routines it executes, or None.
        planning: does what may take longer than a cycle, at once or in another thread; `background` is for modules.
    """

    name: str
    host: Host
    library: Library
    now: float
    elapsed: float
    most_retries: int
    is_running: bool
    planning: Callable[[Callable[[], Any]], Future[Any]]
    background: Callable[[Callable[[], Any]], Future[Any]]

    @property
    def is_event_alone(self) -> bool: ...

    @property
    def event(self) -> SystemEvent | None: ...

    @property
    def interrupts(self) -> Interrupts: ...

    def read_signal(self, name: str) -> float: ...

    def write_signal(self, name: str, value: float) -> None: ...

    def is_settled(self, call: Call) -> bool: ...

    def later(self, delay: float, action: Callable[[], None]) -> None: ...

    def attempt(self, action: Callable[[], None]) -> None: ...

    def instruction_used(self) -> None: ...

    def stopped_by_program(self, kind: EventKind) -> None: ...

    def interrupt_of(self, procedure: str) -> int: ...


class Call:
    """One call of an instruction or function: its arguments by name, without regard to case.

    Attributes:
        task: the task that executes it.
        name: the name it was called by.
    """

    __slots__ = ("_arguments", "name", "task")

    def __init__(self, task: RunningTask, name: str, arguments: dict[str, Reference]) -> None:
        self.task = task
        self.name = name
        self._arguments = arguments

    def present(self, name: str) -> bool:
        return self._arguments.get(name.lower(), ABSENT_DATA) is not ABSENT_DATA

    def __getitem__(self, name: str) -> Any:
        return self._arguments[name.lower()].value

    def __setitem__(self, name: str, value: Any) -> None:
        """Write to the datum passed for a VAR, PERS or INOUT parameter."""
        reference = self._arguments[name.lower()]
        reference.value = reference.type.convert(value)

    def give(self, name: str, value: Any) -> None:
        """Write to the datum passed for an optional parameter, where one is passed."""
        if self.present(name):
            self[name] = value

    def get(self, name: str, default: Any = None) -> Any:
        """The value of an argument, the default where it is not passed or the instruction has no such parameter."""
        reference = self._arguments.get(name.lower(), ABSENT_DATA)
        return default if reference is ABSENT_DATA else reference.value

    def reference(self, name: str) -> Reference:
        """The datum itself, with its name, type and value."""
        return self._arguments[name.lower()]

    def error(self, name: str, sentence: str) -> RapidRuntimeError:
        """An execution error whose sentence begins with the name the call was made by."""
        return RapidRuntimeError(name, f"{self.name}: {sentence}")


def whole_argument(call: Call, name: str, lowest: int, highest: int, default: int | None = None) -> int:
    """An argument that is a whole number within limits; raises ERR_ARGVALERR."""
    value: float = call.get(name, default) if default is not None else call[name]
    if value != int(value) or not lowest <= value <= highest:
        raise call.error("ERR_ARGVALERR", f"{name} is a whole number from {lowest} to {highest}, not {value:g}.")
    return int(value)


VISUALIZE = (
    r"\switch Visualize, \string Header, \string Message | \string MsgArray{*}, \switch Wrap, \icondata Icon, "
    r"\string Image, \num VisualizeTime, \VAR signaldo UIActiveSignal, \num ErrorNumber"
)
"""What the instructions that wait take, to show the operator what they wait for."""


@dataclass(frozen=True, slots=True)
class CallDeadline:
    r"""The end of a wait with \MaxTime and \TimeFlag.

    Attributes:
        time: task time [s], infinite without \MaxTime.
    """

    call: Call
    time: float

    @staticmethod
    def of(call: Call) -> CallDeadline:
        return CallDeadline(call, call.task.now + call.get("MaxTime", math.inf))

    def expire(self) -> bool:
        r"""Whether the time is up; sets \TimeFlag, or raises ERR_WAIT_MAXTIME without one."""
        if self.call.task.now < self.time:
            return False
        if not self.call.present("TimeFlag"):
            sentence = f"{self.call.name} has waited for {self.call['MaxTime']:g} s in vain."
            raise RapidRuntimeError("ERR_WAIT_MAXTIME", sentence)
        self.call["TimeFlag"] = True
        return True

    def met(self) -> None:
        r"""What was waited for has come: clears \TimeFlag."""
        self.call.give("TimeFlag", False)

    @contextmanager
    def visualized(self, what: str) -> Iterator[None]:
        r"""Meanwhile \Visualize shows the operator what is waited for, `what` without \Message."""
        if not self.call.present("Visualize"):
            yield
            return
        messages, task = self.call.task.host.devices.pendant.messages, self.call.task.name
        lines = self.call.get("MsgArray") or (self.call.get("Message", f"Waiting for {what}"),)
        messages[task] = (self.call.get("Header", self.call.name), *lines)
        try:
            yield
        finally:
            messages.pop(task, None)

    @property
    def due(self) -> float | None:
        """What to yield while waiting."""
        return None if math.isinf(self.time) else self.time
