"""The frame: one routine under way, with its data, its place in the code and the error it is dealing with."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from typing import TYPE_CHECKING, Any

from yumi.rapid.code import Code, Span
from yumi.rapid.data import Place
from yumi.rapid.errors import RapidRuntimeError
from yumi.rapid.scope import UserRoutine

if TYPE_CHECKING:
    from yumi.rapid.task import Task

MOST_RETRIES = 4  # ABB's default of the system parameter NoOfRetry


class Propagated(Exception):
    """An error handler passes its error on to the caller (RAISE in an ERROR clause).

    Attributes:
        is_long_jump: whether only handlers that list the number may take it.
    """

    def __init__(self, error: RapidRuntimeError, *, is_long_jump: bool) -> None:
        super().__init__(str(error))
        self.error = error
        self.is_long_jump = is_long_jump


class Frame:
    """A routine under way.

    Attributes:
        slots: the places of its parameters, data and intermediate results.
        step: the step that comes next.
        waiting: the instruction that is not done yet, or None.
        wake: task time at which it must be looked at even between two advances [s], or None.
        is_interrupted: whether a trap has come between two of its statements.
        error: the error its ERROR clause is working on, or None outside of it.
    """

    __slots__ = (
        "_convert",
        "_retried",
        "_retries",
        "_wait_slot",
        "code",
        "error",
        "is_interrupted",
        "is_trap",
        "next_step",
        "polled_at",
        "result_slot",
        "retry_step",
        "routine",
        "slots",
        "step",
        "task",
        "waiting",
        "wake",
    )

    def __init__(self, task: Task, routine: UserRoutine, arguments: Sequence[Place], result_slot: int | None) -> None:
        self.task = task
        self.routine = routine
        self.code = Code(spans=[Span(routine.syntax.line, 0)])  # until it is compiled
        self.slots: list[Any] = list(arguments)
        self.step = 0
        self.result_slot = result_slot
        self.waiting: Generator[float | None, None, Any] | None = None
        self.wake: float | None = None
        self.polled_at = -1
        self.is_trap = False
        self.is_interrupted = False
        self.error: RapidRuntimeError | None = None
        self.retry_step = self.next_step = 0
        self._retries, self._retried = 0, -1
        self._wait_slot: int | None = None
        self._convert: Callable[[Any], Any] | None = None

    def begin(self, code: Code) -> None:
        """Let the routine be executed; raises ERR_PRGMEMFULL where there is no memory for its data."""
        if code.value_count:
            self.task.check_memory_for(code.value_count)
        self.code = code
        self.slots += [None] * (code.slots - len(self.slots))

    @property
    def line(self) -> int:
        """The line of the statement that is being executed, or comes next."""
        begun = self.step > 0 and not self.is_interrupted
        return self.code.spans[self.step - 1 if begun else self.step].line

    def is_between_statements(self) -> bool:
        return self.waiting is None and self.code.spans[self.step].start == self.step

    # Waiting ------------------------------------------------------------------------------------------------------

    def begin_wait(
        self, waiting: Generator[float | None, None, Any], slot: int | None, convert: Callable[[Any], Any] | None
    ) -> None:
        """Let an instruction go on until its generator ends; its value goes into `slot`."""
        self.waiting = waiting
        self._wait_slot, self._convert = slot, convert
        self.wake = None

    def look(self) -> bool:
        """Look at the waiting instruction; whether it is done."""
        assert self.waiting is not None
        try:
            self.wake = next(self.waiting)
        except StopIteration as end:
            self.waiting = None
            if self._wait_slot is not None and self._convert is not None:
                self.slots[self._wait_slot] = self._convert(end.value)
            return True
        except RapidRuntimeError:
            self.waiting = None
            raise
        return False

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
            return any(evaluate(self) == number for evaluate in handler.numbers)
        return not is_long_jump

    def enter_handler(self, error: RapidRuntimeError) -> None:
        assert self.code.handler is not None
        if self.error is None:
            self._remember_statement()
        self.abandon()
        self.is_interrupted = False
        self.error = error
        self.step = self.code.handler.start

    def _remember_statement(self) -> None:
        if self.is_interrupted and self.waiting is None:
            self.retry_step = self.next_step = self.step
        else:
            span = self.code.spans[self.step - 1]
            self.retry_step, self.next_step = span.start, span.end

    def retry(self) -> None:
        """Begin the statement that failed again; raises when that was tried too often."""
        error = self.error
        assert error is not None
        self._retries = self._retries + 1 if self._retried == self.retry_step else 1
        self._retried = self.retry_step
        if self._retries > MOST_RETRIES:
            sentence = f"RETRY was tried {MOST_RETRIES} times in vain; the error was: {error}"
            raise Propagated(RapidRuntimeError("ERR_EXCRTYMAX", sentence), is_long_jump=False)
        self.step, self.error = self.retry_step, None

    def try_next(self) -> None:
        self.step, self.error = self.next_step, None
        self._retried = -1

    def rewind(self) -> None:
        """Put the program pointer back on the statement that is under way."""
        self.abandon()
        if self.step > 0 and not self.is_interrupted:
            self.step = self.code.spans[self.step - 1].start
