"""The machine: executes compiled routines step by step, and can pause between any two of them.

The call stack is explicit: a frame for each routine that is under way. A trap is a frame on top of the routine it
interrupts, one execution level higher. An error looks down the stack for a handler; what lies above the one found
is abandoned, from the top down, each procedure after its UNDO clause.

What comes between the steps is here too: a task's interrupts with their traps and queue, and its actions at a later
time, such as the end of a pulse.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any, Protocol

from yumi.rapid.compiler import compile_routine, link_module
from yumi.rapid.program import Code, EventKind, LocalName, Span, SystemEvent, UserRoutine
from yumi.rapid.types import (
    ABSENT,
    ALL_ERRORS,
    LARGEST_OWN_NUMBER,
    RapidReferenceError,
    RapidRuntimeError,
    RapidValueError,
    Reference,
)

if TYPE_CHECKING:
    from yumi.rapid.task import Task


DEEPEST_STACK = 250
STEPS_BETWEEN_CLOCK_READS = 8  # reading it takes as long as a step; after an instruction it is read at once


class Machine:
    """The execution of one task: its call stack and its interrupts.

    Attributes:
        event: whose event routines are being executed, on top of the program, None without any.
        pause: where steps and breakpoints stop: asked before each statement, it says why; None without any.
    """

    def __init__(self, task: Task) -> None:
        self.task = task
        self.frames: list[Frame] = []
        self.interrupts = Interrupts()
        self.in_trap = False
        self.event: SystemEvent | None = None
        self.instant = 0
        self.budget = 0
        self.deadline = math.inf
        self.until_clock_read = 0
        self.pause: Callable[[Frame], EventKind | None] | None = None
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
            self.until_clock_read = STEPS_BETWEEN_CLOCK_READS - 1
            if self.task.clock() > self.deadline:
                self.budget = 0
        return self.budget <= 0

    def _execute(self, frame: Frame) -> None:
        self.budget -= 1
        step = frame.code.steps[frame.step]
        frame.step += 1
        frame.polled_at = -1
        try:
            step(self, frame)
        except RapidRuntimeError as error:
            self._recover(error)
        except RapidValueError as error:  # data of a type without values, such as a socket, where their text is needed
            self._recover(RapidRuntimeError("ERR_ARGVALERR", str(error)))
        except Propagated as passed:
            self._recover(passed.error, is_long_jump=passed.is_long_jump, skip=1)
        except ArithmeticError as error:
            self._recover(_too_large(error))

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
    ) -> Frame:
        if len(self.frames) >= DEEPEST_STACK:
            raise RapidRuntimeError("ERR_EXECPHR", f"More than {DEEPEST_STACK} routines call each other.")
        frame = Frame(self.task, routine, arguments, result_slot)
        frame.event = event
        code = self.task.program.codes.get(routine)
        if code is None or (event is not None and not self.task.is_linked):
            frame.begin_wait(self._compiling(frame), None, None)
        else:
            frame.begin(code)
        self.frames.append(frame)
        return frame

    def _compiling(self, frame: Frame) -> Generator[float | None, None, None]:
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
        try:
            program.codes[routine] = work.result()
            if frame.event is not None:
                self.task.linked_program = program
        except RapidReferenceError as error:
            raise RapidRuntimeError("ERR_LINKREF", str(error)) from error
        frame.begin(program.codes[routine])

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
    def program(self) -> Sequence[Frame]:
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

    def _begin_trap(self, below: Frame) -> None:
        number, trap = self.interrupts.take()
        self.task.set_system("intno", float(number))
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

    def raise_number(self, frame: Frame, number: float) -> None:
        """RAISE with a number; in an error handler that lists numbers it is a long jump."""
        error = RapidRuntimeError(self.task.error_name(number), f"The program raised the error {number:g}.")
        error.number = number
        if frame.error is not None and frame.code.handler is not None:
            raise Propagated(error, is_long_jump=bool(frame.code.handler.numbers))
        if not 1 <= number <= LARGEST_OWN_NUMBER and not error.name:
            sentence = f"RAISE takes 1 to {LARGEST_OWN_NUMBER}, a booked number or a known error, not {number:g}."
            raise RapidRuntimeError("ERR_ILLRAISE", sentence)
        raise error

    def raise_again(self, frame: Frame) -> None:
        assert frame.error is not None
        assert frame.code.handler is not None
        raise Propagated(frame.error, is_long_jump=bool(frame.code.handler.numbers))

    def _recover(self, error: RapidRuntimeError, *, is_long_jump: bool = False, skip: int = 0) -> None:
        """Find the handler of an error, from the top of the stack down; stop the task when there is none.

        Below a trap only handlers that list the number count, and an error inside of a handler has none at all.
        """
        number = self.task.note_error(error)
        depth = self._handler_depth(number, is_long_jump, skip) if number else 0
        if depth == 0:
            self.task.failed(error, self.frames[-1])
            return
        handling = self.frames[depth - 1]

        def handle() -> None:
            self.task.note_error(error)  # an UNDO clause may have met others
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
        slots: its parameters, data and intermediate results.
        step: the step that comes next.
        waiting: the instruction that is not done yet, or None.
        due: task time at which it must be polled even between two advances [s], or None.
        is_interrupted: whether a trap, a step or a breakpoint has come between two of its statements.
        error: the error its ERROR clause is working on, or None outside of it.
        is_undoing: whether it is abandoned and executes its UNDO clause.
        event: what it is an event routine of, None for other routines.
    """

    __slots__ = (
        "_convert",
        "_retried",
        "_retries",
        "_wait_slot",
        "code",
        "due",
        "error",
        "event",
        "is_interrupted",
        "is_trap",
        "is_undoing",
        "next_step",
        "polled_at",
        "result_slot",
        "retry_step",
        "routine",
        "slots",
        "step",
        "task",
        "waiting",
    )

    def __init__(
        self, task: Task, routine: UserRoutine, arguments: Sequence[Reference], result_slot: int | None
    ) -> None:
        self.task = task
        self.routine = routine
        self.code = Code(spans=[Span(routine.syntax.line, 0)])  # until it is compiled
        self.slots: list[Any] = list(arguments)
        self.step = 0
        self.result_slot = result_slot
        self.waiting: Generator[float | None, None, Any] | None = None
        self.due: float | None = None
        self.polled_at = -1
        self.is_trap = self.is_undoing = False
        self.event: SystemEvent | None = None
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
            if datum is not None and datum is not ABSENT:
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
        except RapidValueError as error:
            self.waiting = None
            raise RapidRuntimeError("ERR_ARGVALERR", str(error)) from error
        except ArithmeticError as error:
            self.waiting = None
            raise _too_large(error) from error

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


def _too_large(error: ArithmeticError) -> RapidRuntimeError:
    return RapidRuntimeError("ERR_NUM_LIMIT", f"A number in the expression is too large: {error}.")


MOST_INTERRUPTS = 100
LONGEST_QUEUE = 1000  # interrupts; what comes while so many wait is lost


class Edge(Enum):
    """Which change of a signal orders the interrupt; the values are RAPID's LOW, HIGH and EDGE."""

    LOW = 0
    HIGH = 1
    BOTH = 2

    def is_in(self, old: float, new: float) -> bool:
        """Whether a change from `old` to `new` is such an edge."""
        if old == new:
            return False
        return self is Edge.BOTH or bool(new) == (self is Edge.HIGH)


class Change(Protocol):
    """Which change of a signal orders an interrupt."""

    def is_in(self, old: float, new: float) -> bool: ...


@dataclass(slots=True)
class SignalOrder:
    """ISignalDI, ISignalDO, ISignalGI, ISignalGO, ISignalAI, ISignalAO."""

    signal: str
    edge: Change
    is_single: bool


@dataclass(slots=True)
class TimerOrder:
    """ITimer: due at task time `due` [s], then every `period` [s]."""

    due: float
    period: float
    is_single: bool


@dataclass(slots=True)
class ChangeOrder:
    """IPers, and whatever else reports by itself that its interrupt has come: see `Interrupts.occurred`."""

    is_single: bool


Order = SignalOrder | TimerOrder | ChangeOrder


@dataclass(slots=True)
class Connection:
    """An interrupt number with its trap; asleep, what comes is dropped."""

    trap: UserRoutine
    order: Order | None = None
    is_asleep: bool = False


class Interrupts:
    """The interrupts of one task.

    While disabled, what comes is queued; while an interrupt is asleep, what comes for it is dropped.
    """

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Forget all connections and everything queued, as PP to main does."""
        self.connections: dict[int, Connection] = {}
        self.queue: deque[int] = deque()
        self.is_disabled = False
        self._next_number = 1

    def connect(self, number: int, trap: UserRoutine) -> int:
        """A new interrupt number for `trap`; `number` is what the intnum held before."""
        if number in self.connections:
            raise RapidRuntimeError("ERR_ALRDYCNT", f"The interrupt {number} already has a trap; IDelete it first.")
        if len(self.connections) >= MOST_INTERRUPTS:
            raise RapidRuntimeError("ERR_INOMAX", f"A task may have {MOST_INTERRUPTS} interrupts.")
        new = self._next_number
        self._next_number += 1
        self.connections[new] = Connection(trap)
        return new

    def order(self, number: int, order: Order) -> None:
        self._connection(number).order = order

    def is_ordered(self, number: int, order: Order) -> bool:
        """Whether the order still stands."""
        connection = self.connections.get(number)
        return connection is not None and connection.order is order

    def occurred(self, number: int) -> None:
        """The interrupt has come."""
        self._enqueue(number, self._connection(number))

    def delete(self, number: int) -> None:
        """Remove an interrupt and what is queued of it; unknown numbers are none."""
        self.connections.pop(number, None)
        self.queue = deque(n for n in self.queue if n != number)

    def sleep(self, number: int) -> None:
        self._connection(number).is_asleep = True

    def watch(self, number: int) -> None:
        self._connection(number).is_asleep = False

    def signal_changed(self, signal: str, old: float, new: float) -> None:
        for number, connection in list(self.connections.items()):
            order = connection.order
            if isinstance(order, SignalOrder) and order.signal.lower() == signal.lower() and order.edge.is_in(old, new):
                self._enqueue(number, connection)

    def occur(self, number: int) -> None:
        """Let an interrupt come that no order brings, such as TriggInt's; unknown numbers are none."""
        connection = self.connections.get(number)
        if connection is not None:
            self._enqueue(number, connection)

    def next_timer(self) -> float:
        """Task time at which the next timer is due [s], infinite when none runs."""
        timers = (c.order.due for c in self.connections.values() if isinstance(c.order, TimerOrder))
        return min(timers, default=math.inf)

    def time_passed(self, now: float) -> None:
        for number, connection in list(self.connections.items()):
            order = connection.order
            if isinstance(order, TimerOrder) and order.due <= now:
                order.due += order.period
                if order.due <= now:  # what came due while the task stood still is lost
                    order.due = now + order.period
                self._enqueue(number, connection)

    def take(self) -> tuple[int, UserRoutine]:
        """The next queued interrupt and its trap."""
        number = self.queue.popleft()
        return number, self.connections[number].trap

    def _enqueue(self, number: int, connection: Connection) -> None:
        if connection.order is not None and connection.order.is_single:
            connection.order = None
        if not connection.is_asleep and len(self.queue) < LONGEST_QUEUE:
            self.queue.append(number)

    def _connection(self, number: int) -> Connection:
        found = self.connections.get(number)
        if found is None:
            raise RapidRuntimeError("ERR_UNKINO", f"The interrupt {number} has no trap; CONNECT it first.")
        return found


Action = Callable[[], None]
MOST_ACTIONS = 1000


class TimerQueue:
    """Actions in the order of their task time [s]."""

    def __init__(self) -> None:
        self._entries: list[tuple[float, int, Action]] = []
        self._order = itertools.count()

    def add(self, time: float, action: Action) -> None:
        """Do something at a task time [s]; raises ERR_EXECPHR when too many wait already."""
        if len(self._entries) >= MOST_ACTIONS:
            raise RapidRuntimeError("ERR_EXECPHR", f"{MOST_ACTIONS} delayed outputs and pulses are under way already.")
        heapq.heappush(self._entries, (time, next(self._order), action))

    @property
    def next_time(self) -> float:
        """When the next action is due [s]; infinite when there is none."""
        return self._entries[0][0] if self._entries else math.inf

    def perform(self, now: float) -> None:
        """Do everything that is due."""
        while self._entries and self._entries[0][0] <= now:
            heapq.heappop(self._entries)[2]()
