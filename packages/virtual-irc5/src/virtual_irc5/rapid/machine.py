"""The machine: executes compiled routines step by step, and can pause between any two of them.

The call stack is explicit: a frame for each routine that is under way. A trap is a frame on top of the routine it
interrupts, one execution level higher. An error looks down the stack for a handler; what lies above the one found
is abandoned, from the top down, each procedure after its UNDO clause.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Protocol

from virtual_irc5.rapid.call import RunningTask
from virtual_irc5.rapid.compiler import MOST_VALUES, compile_routine, link_module
from virtual_irc5.rapid.frame import Code, RoutineFrame
from virtual_irc5.rapid.interrupts import Interrupts
from virtual_irc5.rapid.loaded_modules import UserRoutine
from virtual_irc5.rapid.program import Program
from virtual_irc5.rapid.states import EventKind, SystemEvent
from virtual_irc5.rapid.types import (
    FIRST_BOOKED_NUMBER,
    LARGEST_OWN_NUMBER,
    Propagated,
    RapidReferenceError,
    RapidRuntimeError,
    RapidValueError,
    Reference,
    execution_error,
    raised_as,
)

_DEEPEST_STACK = 250
_MOST_BOOKED = 500  # error numbers
_FATAL = 0.0  # the number of an error that no handler may take
_STEPS_BETWEEN_CLOCK_READS = 8  # reading it takes as long as a step; after an instruction it is read at once


class MachineTask(RunningTask, Protocol):
    """The task as its machine sees it."""

    clock: Callable[[], float]
    program: Program
    linked_program: Program | None

    @property
    def is_linked(self) -> bool: ...

    def event_changed(self) -> None: ...

    def paused(self, kind: EventKind, frame: RoutineFrame) -> None: ...

    def failed(self, error: RapidRuntimeError, frame: RoutineFrame) -> None: ...

    def exited(self, frame: RoutineFrame) -> None: ...

    def finished(self) -> None: ...


class Machine:
    """The execution of one task: its call stack and its interrupts.

    Attributes:
        booked: names of the program's own error numbers (BookErrNo).
        event: whose event routines are being executed, on top of the program, None without any.
        pause: where steps and breakpoints stop: asked before each statement, it says why; None without any.
    """

    def __init__(self, task: MachineTask) -> None:
        self.task = task
        self.frames: list[RoutineFrame] = []
        self.interrupts = Interrupts()
        self.booked: dict[float, str] = {}
        self.in_trap = False
        self.event: SystemEvent | None = None
        self.instant = 0
        self.budget = 0
        self.deadline = math.inf
        self.until_clock_read = 0
        self.pause: Callable[[RoutineFrame], EventKind | None] | None = None
        self._unwinding: tuple[int, Callable[[], None]] | None = None

    # Running ------------------------------------------------------------------------------------------------------

    def run(self) -> None:
        """Execute until the task waits or stops, or the budget of steps or time is used up."""
        self.instant += 1
        while self.task.is_running:
            frame = self.frames[-1]
            is_open = not (self.in_trap or self.event or self.interrupts.is_disabled or self._unwinding)
            if self.interrupts.queue and is_open and (frame.waiting is not None or frame.is_between_statements()):
                self._begin_trap(frame)
            elif frame.waiting is not None:
                if frame.polled_at == self.instant:  # once in an instant
                    return
                frame.polled_at = self.instant
                try:
                    frame.poll()
                except RapidRuntimeError as error:
                    self._recover(error)
                else:
                    if frame.waiting is not None:
                        return
            elif self.is_exhausted():
                return
            elif (
                self.pause is not None
                and self.event is None
                and frame.is_between_statements()
                and (kind := self.pause(frame)) is not None
            ):
                self.task.paused(kind, frame)
                return
            else:
                self._execute(frame)

    def is_exhausted(self) -> bool:
        """Whether this advance has computed enough; the budget is used up then."""
        self.until_clock_read -= 1
        if self.until_clock_read < 0:
            self.until_clock_read = _STEPS_BETWEEN_CLOCK_READS - 1
            if self.task.clock() > self.deadline:
                self.budget = 0
        return self.budget <= 0

    def _execute(self, frame: RoutineFrame) -> None:
        self.budget -= 1
        step = frame.code.steps[frame.step]
        frame.step += 1
        frame.polled_at = -1
        try:
            step(self, frame)
        except RapidRuntimeError as error:
            self._recover(error)
        except Propagated as passed:
            self._recover(passed.error, is_long_jump=passed.is_long_jump, skip=1)
        except (RapidValueError, ArithmeticError) as error:
            self._recover(execution_error(error))

    def next_due(self) -> float:
        """Task time at which something is due [s]; infinite when nothing is."""
        timer = math.inf if self.task.is_event_alone else self.interrupts.next_timer()
        due = self.frames[-1].due if self.frames and self.frames[-1].waiting is not None else None
        return timer if due is None else min(due, timer)

    # Entering and leaving routines --------------------------------------------------------------------------------

    def enter(
        self,
        routine: UserRoutine,
        arguments: Sequence[Reference],
        result_slot: int | None,
        event: SystemEvent | None = None,
    ) -> RoutineFrame:
        if len(self.frames) >= _DEEPEST_STACK:
            raise RapidRuntimeError("ERR_EXECPHR", f"More than {_DEEPEST_STACK} routines call each other.")
        frame = RoutineFrame(self.task, routine, list(arguments), result_slot, event)
        code = self.task.program.codes.get(routine)
        if code is None or (event is not None and not self.task.is_linked):
            frame.begin_wait(self._compiling(frame), None, None)
        else:
            self._begin(frame, code)
        self.frames.append(frame)
        return frame

    def _compiling(self, frame: RoutineFrame) -> Generator[float | None, None, None]:
        """Compile the frame's routine in the background, and begin it then."""
        program, routine = self.task.program, frame.routine

        def compiled() -> Code:
            if frame.event is not None:  # of a program that has just been loaded, whose data may have no values yet
                for module in program.modules.values():
                    link_module(program, module)
            found = program.codes.get(routine)
            return compile_routine(program, routine) if found is None else found

        work = self.task.background(compiled)
        while not work.done():
            yield None
        with raised_as("ERR_LINKREF", RapidReferenceError):
            program.codes[routine] = work.result()
        if frame.event is not None:
            self.task.linked_program = program
        self._begin(frame, program.codes[routine])

    def _begin(self, frame: RoutineFrame, code: Code) -> None:
        """Let a routine be executed; raises ERR_PRGMEMFULL where there is no memory for its data beside all others."""
        if code.value_count:
            wanted = code.value_count + sum(each.value_count for each in self.task.program.modules.values())
            wanted += sum(each.code.value_count for each in self.frames)
            if wanted > MOST_VALUES:
                sentence = f"the data of the task would hold {wanted} values, there is memory for {MOST_VALUES}."
                raise RapidRuntimeError("ERR_PRGMEMFULL", f"With those of the routine {sentence}")
        frame.begin(code)

    def leave(self, value: Any) -> None:
        frame = self.frames.pop()
        if frame.is_undoing:
            self.in_trap = self.in_trap and not frame.is_trap
            self._go_on_unwinding()
            return
        if frame.event is not None:
            self._find_event()
            return
        if not self.frames:
            self.task.finished()
            return
        below = self.frames[-1]
        if frame.is_trap:
            self.in_trap = below.is_interrupted = False
        elif frame.result_slot is not None:
            below.slots[frame.result_slot] = value

    def abandon(self, depth: int = 0) -> None:
        """Leave all routines above `depth` without finishing them, the topmost first."""
        while len(self.frames) > depth:
            frame = self.frames.pop()
            if frame.is_trap:
                self.in_trap = False
            frame.abandon()
        self._find_event()
        if not self.frames:
            self._unwinding = None

    def unwind(self, depth: int, then: Callable[[], None]) -> None:
        """Abandon all routines above `depth`, each after its UNDO clause, which are executed as steps; then go on.

        RAPID overview, UNDO: a routine that an UNDO clause calls is abandoned without its own.
        """
        if self._unwinding is None:
            self._unwinding = depth, then
            self._go_on_unwinding()
        else:
            self.abandon(depth)
            then()

    def _go_on_unwinding(self) -> None:
        assert self._unwinding is not None
        depth, then = self._unwinding
        while len(self.frames) > depth:
            frame = self.frames[-1]
            if frame.code.undo is not None:
                frame.abandon()
                frame.is_undoing, frame.is_interrupted, frame.error = True, False, None
                frame.step = frame.code.undo
                return
            frame.abandon()
            self.frames.pop()
            self.in_trap = self.in_trap and not frame.is_trap
        self._unwinding = None
        self._find_event()
        then()

    def undo_all(self, most_steps: int) -> None:
        """Leave all routines, as PP to main does: UNDO clauses are executed at once, as far as they do not wait."""
        self.task.is_running = True  # until an UNDO clause fails
        self.unwind(0, lambda: None)
        while self.task.is_running and self._unwinding is not None and most_steps > 0:
            most_steps -= 1
            if self.frames[-1].waiting is not None:
                break
            self._execute(self.frames[-1])
        self.task.is_running = False
        self.abandon()

    def exit(self) -> None:
        where = self.frames[-1]
        self.abandon()
        self.task.exited(where)

    # Event routines -----------------------------------------------------------------------------------------------

    def begin_event(self, event: SystemEvent, routines: Sequence[UserRoutine]) -> None:
        """Execute procedures one after the other before the program goes on; those of a start come after others.

        Raises:
            RapidRuntimeError: the stack is too deep for them; none is executed.
        """
        depth = self._depth_of_program() if event.is_of_start else len(self.frames)
        above = self.frames[depth:]
        del self.frames[depth:]
        try:
            for routine in reversed(routines):
                self.enter(routine, (), None, event)
        except RapidRuntimeError:
            del self.frames[depth:]
            raise
        finally:
            self.frames += above
            self._find_event()

    def _depth_of_program(self) -> int:
        """How many frames are beneath those of event routines that do not belong to a start."""
        alone = (n for n, each in enumerate(self.frames) if each.event is not None and not each.event.is_of_start)
        return next(alone, len(self.frames))

    @contextmanager
    def beneath_events(self) -> Iterator[None]:
        """What is done to the program meanwhile leaves those event routines as they are; they go on then."""
        depth = self._depth_of_program()
        above = self.frames[depth:]
        del self.frames[depth:]
        self._find_event()
        try:
            yield
        finally:
            self.frames += above
            self._find_event()

    @property
    def program(self) -> Sequence[RoutineFrame]:
        """The routines of the program, without the event routines that are executed before it goes on."""
        return list(itertools.takewhile(lambda frame: frame.event is None, self.frames))

    def abandon_event(self) -> None:
        """Leave the event routines under way, as an error in one does; nothing happens without any."""
        if self.event is not None:
            self.abandon(next(n for n, frame in enumerate(self.frames) if frame.event is self.event))

    def _find_event(self) -> None:
        event = next((frame.event for frame in reversed(self.frames) if frame.event is not None), None)
        if event is not self.event:
            self.event = event
            self.task.event_changed()

    # Interrupts ---------------------------------------------------------------------------------------------------

    def _begin_trap(self, below: RoutineFrame) -> None:
        number, trap = self.interrupts.take()
        self.set_system("intno", float(number))
        below.is_interrupted = below.waiting is None
        try:
            self.enter(trap, (), None).is_trap = True
        except RapidRuntimeError as error:
            self._recover(error)
        else:
            self.in_trap = True

    def connect(self, reference: Reference, trap: UserRoutine) -> None:
        reference.value = float(self.interrupts.connect(int(reference.value), trap))

    # Errors -------------------------------------------------------------------------------------------------------

    def note_error(self, error: RapidRuntimeError) -> float:
        """The number of an error, which ERRNO has from now on; FATAL for a name the library does not know."""
        if error.number is None:
            error.number = self.task.library.error_number(error.name) or _FATAL
        self.set_system("errno", error.number)
        return error.number

    def book_error(self, name: str) -> float:
        """A new error number for the program (BookErrNo)."""
        if len(self.booked) >= _MOST_BOOKED:
            raise RapidRuntimeError("ERR_EXECPHR", f"A program may book {_MOST_BOOKED} error numbers.")
        number = float(FIRST_BOOKED_NUMBER + len(self.booked))
        self.booked[number] = name
        return number

    def error_name(self, number: float) -> str:
        """The name of a booked or known error, "" when it has none."""
        return self.booked.get(number) or self.task.library.error_name(number) or ""

    def set_system(self, name: str, value: float) -> None:
        self.task.program.system_data[name].value = value

    def raise_number(self, frame: RoutineFrame, number: float) -> None:
        """RAISE with a number; in an error handler that lists numbers it is a long jump."""
        error = RapidRuntimeError(self.error_name(number), f"The program raised the error {number:g}.")
        error.number = number
        if frame.error is not None and frame.code.handler is not None:
            raise Propagated(error, is_long_jump=bool(frame.code.handler.numbers))
        if not 1 <= number <= LARGEST_OWN_NUMBER and not error.name:
            sentence = f"RAISE takes 1 to {LARGEST_OWN_NUMBER}, a booked number or a known error, not {number:g}."
            raise RapidRuntimeError("ERR_ILLRAISE", sentence)
        raise error

    def raise_again(self, frame: RoutineFrame) -> None:
        assert frame.error is not None
        assert frame.code.handler is not None
        raise Propagated(frame.error, is_long_jump=bool(frame.code.handler.numbers))

    def _recover(self, error: RapidRuntimeError, *, is_long_jump: bool = False, skip: int = 0) -> None:
        """Find the handler of an error, from the top of the stack down; stop the task when there is none.

        Below a trap only handlers that list the number count, and an error inside of a handler has none at all.
        """
        number = self.note_error(error)
        depth = self._handler_depth(number, is_long_jump, skip) if number else 0
        if depth == 0:
            self.task.failed(error, self.frames[-1])
            return
        handling = self.frames[depth - 1]

        def handle() -> None:
            self.note_error(error)  # an UNDO clause may have met others
            handling.enter_handler(error)

        self.unwind(depth, handle)

    def _handler_depth(self, number: float, is_long_jump: bool, skip: int) -> int:
        """How deep the stack is up to the frame that handles an error, 0 when none does."""
        from_above = False
        for depth in range(len(self.frames), 0, -1):
            frame = self.frames[depth - 1]
            if frame.is_undoing:
                return 0
            if depth <= len(self.frames) - skip:
                if frame.takes(number, is_long_jump=is_long_jump, from_above=from_above):
                    return depth
                if frame.error is not None and not is_long_jump:
                    return 0
            if frame.event is not None:  # the program beneath is not its caller
                return 0
            if frame.is_trap:
                is_long_jump = from_above = True
        return 0
