"""A routine under way: its code, small steps with spans and targets, local names, and how far it has come in them."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from virtual_irc5.rapid.call import RunningTask
from virtual_irc5.rapid.loaded_modules import UserRoutine
from virtual_irc5.rapid.states import SystemEvent
from virtual_irc5.rapid.types import (
    ABSENT_DATA,
    ALL_ERRORS,
    Propagated,
    RapidRuntimeError,
    RapidValueError,
    Reference,
    execution_error,
)

Step = Callable[["Stack", "RoutineFrame"], None]
Evaluate = Callable[["RoutineFrame"], Any]


@dataclass(eq=False, slots=True)
class Span:
    """The steps of one statement: RETRY goes back to `start`, TRYNEXT on to `end`."""

    line: int
    start: int
    end: int = 0


@dataclass(eq=False, slots=True)
class Target:
    """A step to jump to; -1 until it is compiled."""

    step: int = -1


@dataclass(eq=False, slots=True)
class LocalName:
    """A parameter, datum or loop variable of a routine, for those who look at a routine under way.

    Attributes:
        name: as it is declared.
        kind: "par", "var", "con", or "for" of a loop variable; the words are RWS'.
        slot: of its `Variable` in the frame, which has none before the declaration is executed.
        begin, end: the steps between which the name means it; `end` is None for the rest of the routine.
    """

    name: str
    kind: str
    slot: int
    begin: int = 0
    end: int | None = None


@dataclass(eq=False, slots=True)
class HandlerCode:
    """The ERROR clause: where it starts and which error numbers it lists (none: all)."""

    start: int
    numbers: tuple[Evaluate, ...]


@dataclass(eq=False, slots=True)
class Code:
    """A compiled routine.

    Attributes:
        spans: for each step, the statement it belongs to.
        slots: how many slots a frame needs for parameters, data and intermediate results.
        value_count: how many values the routine's data hold.
        undo: the step its UNDO clause starts with, None without one.
        locals: its parameters, data and loop variables, an inner loop's after those around it.
        names: what it looked up outside of itself, in lower case; it is compiled anew when one of them is new or gone.
    """

    steps: list[Step] = field(default_factory=list)
    spans: list[Span] = field(default_factory=list)
    slots: int = 0
    value_count: int = 0
    handler: HandlerCode | None = None
    undo: int | None = None
    locals: list[LocalName] = field(default_factory=list)
    names: set[str] = field(default_factory=set)


class Stack(Protocol):
    """The call stack that a step changes."""

    def enter(self, routine: UserRoutine, arguments: Sequence[Reference], result_slot: int | None) -> RoutineFrame: ...

    def leave(self, value: Any) -> None: ...

    def exit(self) -> None: ...

    def raise_number(self, frame: RoutineFrame, number: float) -> None: ...

    def raise_again(self, frame: RoutineFrame) -> None: ...

    def connect(self, reference: Reference, trap: UserRoutine) -> None: ...


@dataclass(eq=False, repr=False, slots=True)
class RoutineFrame:
    """A routine under way.

    Attributes:
        slots: its parameters, data and intermediate results.
        result_slot: of the frame beneath, which its value goes into.
        event: what it is an event routine of, None for other routines.
        step: the step that comes next.
        waiting: the instruction that is not done yet, or None.
        due: task time at which it must be polled even between two advances [s], or None.
        is_undoing: whether it is abandoned and executes its UNDO clause.
        is_interrupted: whether a trap, a step or a breakpoint has come between two of its statements.
        error: the error its ERROR clause is working on, or None outside of it.
    """

    task: RunningTask
    routine: UserRoutine
    slots: list[Any]
    result_slot: int | None
    event: SystemEvent | None
    code: Code = field(init=False)
    step: int = 0
    waiting: Generator[float | None, None, Any] | None = None
    due: float | None = None
    polled_at: int = -1
    is_trap: bool = False
    is_undoing: bool = False
    is_interrupted: bool = False
    error: RapidRuntimeError | None = None
    retry_step: int = 0
    next_step: int = 0
    _retries: int = 0
    _retried: int = -1
    _wait_slot: int | None = None
    _convert: Callable[[Any], Any] | None = None

    def __post_init__(self) -> None:
        self.code = Code(spans=[Span(self.routine.syntax.line, 0)])  # until it is compiled

    def begin(self, code: Code) -> None:
        """Let the routine be executed."""
        self.code = code
        self.slots += [None] * (code.slots - len(self.slots))

    @property
    def place(self) -> int:
        """A step of the statement that is being executed, or comes next."""
        begun = self.step > 0 and not self.is_interrupted
        return self.step - 1 if begun else self.step

    @property
    def line(self) -> int:
        """The line of the statement that is being executed, or comes next."""
        return self.code.spans[self.place].line

    @property
    def locals(self) -> dict[str, tuple[LocalName, Reference]]:
        """Parameters, data and loop variables that have a value where the routine is, by lower-case name."""
        found = {}
        for each in self.code.locals:  # an inner loop's variable hides one of the same name
            is_visible = each.begin <= self.place and (each.end is None or self.place < each.end)
            datum = self.slots[each.slot] if is_visible else None
            if datum is not None and datum is not ABSENT_DATA:
                found[each.name.lower()] = each, datum
        return found

    @property
    def next_line(self) -> int:
        """The line of the statement that comes next."""
        return self.code.spans[self.step].line

    def is_between_statements(self) -> bool:
        return self.waiting is None and self.code.spans[self.step].start == self.step

    # Waiting ------------------------------------------------------------------------------------------------------

    def begin_wait(
        self, waiting: Generator[float | None, None, Any], slot: int | None, convert: Callable[[Any], Any] | None
    ) -> None:
        """Let an instruction go on until its generator ends; its value goes into `slot`."""
        self.waiting = waiting
        self._wait_slot, self._convert = slot, convert
        self.due = None

    def poll(self) -> None:
        """Let the waiting instruction go on."""
        assert self.waiting is not None
        try:
            self.due = next(self.waiting)
        except StopIteration as end:
            self.waiting = None
            if self._wait_slot is not None and self._convert is not None:
                self.slots[self._wait_slot] = self._convert(end.value)
        except RapidRuntimeError:
            self.waiting = None
            raise
        except (RapidValueError, ArithmeticError) as error:
            self.waiting = None
            raise execution_error(error) from error

    def abandon(self) -> None:
        """Close the instruction under way, if there is one."""
        if self.waiting is not None:
            self.waiting.close()
            self.waiting = None

    # Error handling -----------------------------------------------------------------------------------------------

    def takes(self, number: float, *, is_long_jump: bool, from_above: bool) -> bool:
        """Whether the frame's ERROR clause handles an error.

        A handler at work takes no error of its own level; a long jump from a trap above starts it again.
        """
        handler = self.code.handler
        if handler is None or (self.error is not None and not from_above):
            return False
        if handler.numbers:
            listed = (number, self.task.library.error_number(ALL_ERRORS))
            return any(evaluate(self) in listed for evaluate in handler.numbers)
        return not is_long_jump

    def enter_handler(self, error: RapidRuntimeError) -> None:
        assert self.code.handler is not None
        if self.error is None:  # where RETRY and TRYNEXT go on
            if self.is_interrupted and self.waiting is None:
                self.retry_step = self.next_step = self.step
            else:
                span = self.code.spans[self.step - 1]
                self.retry_step, self.next_step = span.start, span.end
        self.abandon()
        self.is_interrupted = False
        self.error = error
        self.step = self.code.handler.start

    def retry(self) -> None:
        """Begin the statement that failed again; raises when that was tried too often."""
        error = self.error
        assert error is not None
        self._retries = self._retries + 1 if self._retried == self.retry_step else 1
        self._retried = self.retry_step
        if self._retries > self.task.most_retries:
            sentence = f"RETRY was tried {self.task.most_retries} times in vain; the error was: {error}"
            raise Propagated(RapidRuntimeError("ERR_EXCRTYMAX", sentence), is_long_jump=False)
        self.step, self.error = self.retry_step, None

    @property
    def clause(self) -> str:
        """The clause that is being executed: "ERR", "UNDO", or "NONE" for the statements."""
        return "UNDO" if self.is_undoing else "NONE" if self.error is None else "ERR"

    @property
    def remaining_retries(self) -> float:
        """How often RETRY is still possible for the statement that failed."""
        return self.task.most_retries - (self._retries if self._retried == self.retry_step else 0)

    def reset_retries(self) -> None:
        self._retried = -1

    def try_next(self) -> None:
        self.step, self.error = self.next_step, None
        self._retried = -1

    def rewind(self) -> None:
        """Put the program pointer back on the statement that is under way."""
        self.abandon()
        if self.step > 0 and not self.is_interrupted:
            self.step = self.code.spans[self.step - 1].start
