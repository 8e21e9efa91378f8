"""The task: a RAPID program with its data, its program pointer and its own time."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Collection, Generator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, TypeVar

from abb_protocols.errors import RobotNotReady
from virtual_irc5.rapid import ast as s
from virtual_irc5.rapid.call import Call
from virtual_irc5.rapid.compiler import compile_program, faults_of, initialise_variables
from virtual_irc5.rapid.devices import Host
from virtual_irc5.rapid.frame import RoutineFrame
from virtual_irc5.rapid.interrupts import Interrupts
from virtual_irc5.rapid.loaded_modules import LoadedModule, UserRoutine
from virtual_irc5.rapid.loading import Prepared, free_code, prepared, removed_by
from virtual_irc5.rapid.machine import Machine
from virtual_irc5.rapid.parser import parse_module
from virtual_irc5.rapid.pauses import Pauses, StackEntry, StepKind
from virtual_irc5.rapid.program import Program
from virtual_irc5.rapid.rapid_library import Library
from virtual_irc5.rapid.states import EventKind, Execution, Severity, SystemEvent, TaskEvent
from virtual_irc5.rapid.task_data import TaskData
from virtual_irc5.rapid.timers import TimerQueue
from virtual_irc5.rapid.types import ModuleNameTaken, RapidReferenceError, RapidRuntimeError, Reference, Variable

_T = TypeVar("_T")
STEPS_PER_ADVANCE = 2000  # so that an endless loop without a wait cannot hang the controller
_STEPS_PER_SECOND = 500_000  # and as many more as a long advance may need
TIME_PER_ADVANCE = 0.5e-3  # [s] of the task's clock, so that two tasks leave three quarters of a cycle to the rest
_STEPS_OF_UNDO = 10_000  # of all UNDO clauses at PP to main
MOST_RETRIES = 4  # ABB's default of the system parameter NoOfRetry
_ROUNDING = 1e-9  # [s], of the sums that times are
_OP_AUTO = 1


_log = logging.getLogger(__name__)


def _at_once(work: Callable[[], _T]) -> Future[_T]:
    """Work that is done before anything else happens."""
    result: Future[_T] = Future()
    try:
        result.set_result(work())
    except Exception as error:
        result.set_exception(error)
    return result


@dataclass(slots=True)
class CyclicBool:
    """A flag that follows a condition.

    Attributes:
        flag: the persistent.
        condition: its value now.
        has_failed: whether the condition could not be computed the last time.
    """

    flag: Reference
    condition: Callable[[], bool]
    has_failed: bool = False


class Task(TaskData):
    r"""One RAPID task.

    Args:
        name: such as "T_ROB_R".
        host: the controller it runs on.
        library: instructions, functions, types and data beside the program's own.
        entry: the procedure the program begins with.

    Attributes:
        execution: its state.
        now: the task's time, which stands still while the program is stopped; event routines that run alone have
            their own [s].
        elapsed: the time that goes on then, of clocks, pulses and delayed outputs [s].
        timers: what the program has started and left to be done later, in elapsed time.
        in_position: whether the mechanical units stand still in a fine point; what \InPos waits for.
        operating_mode: what OpMode() gives: OP_AUTO 1, OP_MAN_PROG 2, OP_MAN_TEST 3.
        stop_event: where the program pointer was moved to before the last start: "main", "routine", or "" for nowhere.
        pp_moved_in_manual: whether the program pointer was moved in manual mode, until a program resets it.
        clock: what bounds the time one advance computes [s]; where it stands still, the number of steps alone does.
        background: does what may take longer than a cycle (parsing, linking, compiling), at once or in another thread.
        planning: the same for moves, which must not wait for a long module.
        program: its modules and their code; another one after a module was loaded or unloaded.
        linked_program: the last one whose data have all been given their values.
        event_routines: the names of the procedures that run on each system event, in their order.
        most_retries: how often RETRY begins a statement again (system parameter NoOfRetry).
        repeats: whether the program begins again when it has come to its end (run mode "forever"), or ends.
        cyclic_bools: the flags that follow conditions (SetupCyclicBool), by their names in lower case.
        has_flag_timer: whether one of the timers computes them.
        pauses: where the task pauses: steps and breakpoints.
    """

    def __init__(self, name: str, host: Host, library: Library, entry: str = "main") -> None:
        self.name = name
        self.host = host
        self.library = library
        self.entry = entry
        self.event_routines: Mapping[SystemEvent, Sequence[str]] = {}
        self.most_retries = MOST_RETRIES
        self.repeats = False
        self.cyclic_bools: dict[str, CyclicBool] = {}
        self.has_flag_timer = False
        self.now = self.elapsed = 0.0
        self.timers = TimerQueue()
        self.in_position: Callable[[], bool] = lambda: True
        self.operating_mode: Callable[[], int] = lambda: _OP_AUTO
        self.clock: Callable[[], float] = lambda: 0.0
        self.background: Callable[[Callable[[], Any]], Future[Any]] = _at_once
        self.planning: Callable[[Callable[[], Any]], Future[Any]] = _at_once
        self.is_running = False
        system_data = {
            name.lower(): Variable(name, library.type(type_name), 0.0, s.Storage.CONST, is_local=False)
            for name, type_name in (("ERRNO", "errnum"), ("INTNO", "intnum"))
        }
        self.program = Program(library, host, system_data)
        self.program.current = lambda: self.program
        self._ended_at = -1.0
        self._program_time: float | None = None  # of the program beneath event routines that run alone [s]
        self._leaves_event = False  # once the instruction has been executed
        self._pp_moved = self.stop_event = ""
        self.pp_moved_in_manual = False
        self.machine = Machine(self)
        self.pauses = Pauses(self.machine)
        self.execution = Execution.UNINITIALIZED
        self._prepared: Prepared | None = None
        self.linked_program: Program | None = None
        self._failures: list[Exception] = []  # of what happened outside of the task's time

    @property
    def interrupts(self) -> Interrupts:
        return self.machine.interrupts

    @property
    def frame(self) -> RoutineFrame:
        """The routine that is executed now."""
        return self.machine.frames[-1]

    # Modules ------------------------------------------------------------------------------------------------------

    @property
    def modules(self) -> tuple[s.Module, ...]:
        """The modules in the task's memory, as written."""
        return tuple(module.syntax for module in self.program.modules.values())

    @property
    def has_program_pointer(self) -> bool:
        """Whether there is a statement that a start would go on with."""
        return bool(self.machine.program)

    @property
    def is_linked(self) -> bool:
        """Whether all data have their values: event routines need them, also those of a program just loaded."""
        return self.linked_program is self.program

    @property
    def is_empty(self) -> bool:
        """Whether no module is loaded."""
        return not self.program.modules

    def load(self, text: str, filename: str, *, replace: bool = False) -> str:
        """Load a module, in the place of one of the same name if it may; returns its name.

        Raises:
            RapidSyntaxError: the text is not RAPID.
            RapidReferenceError: a name is declared twice, or what is declared does not fit.
            ModuleNameTaken: there is a module of the name already.
            ProgramTooLarge: there is no memory for it.
            RobotNotReady: the module it would replace is executing; in a stopped task the program pointer is lost.
        """
        (module,) = self._load({filename: text}, replace=replace)
        return module.name

    def load_program(self, texts: Mapping[str, str], *, replace: bool) -> None:
        """Load modules together, by their files, in the place of all program modules or beside them.

        Raises as `load`, and nothing is loaded then.
        """
        self._load(texts, replace=replace, replaces_program=replace)

    def _load(self, texts: Mapping[str, str], *, replace: bool, replaces_program: bool = False) -> tuple[s.Module, ...]:
        modules = tuple(parse_module(text, filename) for filename, text in texts.items())
        names: set[str] = set()
        for module in modules:
            if module.name.lower() in names:
                raise ModuleNameTaken(f"{module.filename}: the program has two modules '{module.name}'.")
            names.add(module.name.lower())
        removed = removed_by(modules, self.program, replaces_program=replaces_program)
        for module in modules if not replaces_program else ():
            self._check_loadable(module, replace=replace)
        for old in removed:
            self._check_not_executing(old)
        found, self._prepared = self._prepared, None
        if found is None or not self._fits(found, modules, replaces_program=replaces_program):
            found = self._prepare(modules, replaces_program=replaces_program)
        self._adopt(found.program, *removed, is_linked=found.is_linked)
        return modules

    def prepare(self, *modules: s.Module, replaces_program: bool = False) -> None:
        """Link and compile modules so that loading them finds it done, in any thread; raises as `load`."""
        self._prepared = self._prepare(modules, replaces_program=replaces_program)

    def compile(self) -> None:
        """Link and compile the program as far as it fits, in any thread; PP to main then finds it done."""
        with suppress(RapidReferenceError):
            compile_program(self.program)

    def faults(self) -> list[RapidReferenceError]:
        """All that does not fit in the program, each with file, line and column; PP to main raises the first."""
        return faults_of(self.program)

    def loading(self, text: str, filename: str) -> Generator[None, None, None]:
        """Load a module in the background, waiting for it; raises as `load`."""
        prepared = None
        while prepared is None or not self._fits(prepared, [each.syntax for each in prepared.modules]):
            work = self.background(lambda: self._prepare([parse_module(text, filename)]))
            while not work.done():
                yield
            prepared = work.result()
            self._check_loadable(prepared.modules[0].syntax, replace=False)
        self._adopt(prepared.program, is_linked=prepared.is_linked)

    def _prepare(self, modules: Sequence[s.Module], *, replaces_program: bool = False) -> Prepared:
        """The program with other modules; the program that is executed stays as it is."""
        base = self.program
        has_pp = self._has_pp(base, modules, replaces_program=replaces_program)
        return prepared(base, modules, replaces_program=replaces_program, has_pp=has_pp, task=self.name)

    def _has_pp(self, base: Program, modules: Sequence[s.Module], *, replaces_program: bool) -> bool:
        """Whether there is a program pointer that a program in the place of `base` does not take along."""
        removed = removed_by(modules, base, replaces_program=True) if replaces_program else ()
        frames = self.machine.frames
        return bool(frames) and not any(frame.routine.module in removed for frame in frames)

    def _fits(self, found: Prepared, modules: Sequence[s.Module], *, replaces_program: bool = False) -> bool:
        """Whether modules were prepared for the program as it is now."""
        has_pp = self._has_pp(self.program, modules, replaces_program=replaces_program)
        return found.is_for(self.program, modules, replaces_program=replaces_program, has_pp=has_pp)

    def _check_loadable(self, module: s.Module, *, replace: bool) -> None:
        old = self.program.modules.get(module.name.lower())
        if old is not None and not replace:
            raise ModuleNameTaken(f"{module.filename}: the task {self.name} already has a module '{module.name}'.")
        if old is not None:
            self._check_not_executing(old)

    def _adopt(self, program: Program, *removed: LoadedModule, is_linked: bool) -> None:
        """Go on with another program; `is_linked` says whether its data have their values."""
        executed = {id(frame.code) for frame in self.machine.frames}
        codes = self.program.codes.items()
        discarded = [code for routine, code in codes if routine not in program.codes and id(code) not in executed]
        self.program = program
        if is_linked:
            self.linked_program = program
        if any(frame.routine.module in removed for frame in self.machine.frames):
            self.lose_pp()
        for module in removed:
            module.clear()
        self.background(lambda: free_code(discarded))

    def unload(self, module: str) -> None:
        """Remove a module; the program pointer is lost when it is in it.

        Raises:
            UnknownSymbol: there is no such module.
            RobotNotReady: the task is started and one of the module's routines is executing.
        """
        found = self._module(module)
        self._check_not_executing(found)
        self._adopt(self.program.unloaded(module), found, is_linked=self.is_linked)

    def _check_not_executing(self, module: LoadedModule) -> None:
        is_started = self.execution is Execution.STARTED
        if is_started and any(frame.routine.module is module for frame in self.machine.frames):
            raise RobotNotReady(f"The module '{module.name}' is executing; stop the task before it is unloaded.")

    # Execution ----------------------------------------------------------------------------------------------------

    def move_pp_to_main(self) -> None:
        """Put the program pointer on `main` and give all VARs their first value; PERS keep theirs.

        Procedures that are left execute their UNDO clauses; event routines that do not belong to a start go on.

        Raises:
            RobotNotReady: the task is started.
            RapidReferenceError: something in a module does not fit, or there is no procedure `main`.
        """
        self.check()
        self._begin(self._main())
        self._note_moved_pointer("main")

    def move_pp_to_routine(self, name: str, module: str = "") -> None:
        """Put the program pointer on a procedure without parameters, otherwise as `move_pp_to_main`.

        Raises:
            RobotNotReady: the task is started.
            RapidReferenceError: something in a module does not fit, or there is no such procedure.
            UnknownSymbol: there is no such module.
        """
        self.check()
        self._begin(self._routine_to_start(name, self._module(module) if module else None))
        self._note_moved_pointer("routine")

    def _routine_to_start(self, name: str, where: LoadedModule | None) -> UserRoutine:
        """A procedure without parameters, of one module or of the whole task."""
        found = self.program.find(name, where)
        if (
            not isinstance(found, UserRoutine)
            or found.syntax.kind is not s.RoutineKind.PROC
            or found.syntax.parameters
            or (where is not None and found.module is not where)
        ):
            raise RapidReferenceError(f"The task {self.name} has no procedure {name}() without parameters.")
        return found

    def _note_moved_pointer(self, where: str) -> None:
        self._pp_moved = where
        self.pp_moved_in_manual = self.pp_moved_in_manual or self.operating_mode() != _OP_AUTO

    def check(self) -> None:
        """Link and compile the program; raises as `move_pp_to_main`, and changes nothing."""
        if self.execution is Execution.STARTED:
            raise RobotNotReady(f"The task {self.name} is running; stop it before PP is moved to main.")
        compile_program(self.program)
        self.linked_program = self.program
        self._main()

    def _begin(self, routine: UserRoutine) -> None:
        time = self.now
        with self.machine.beneath_events():
            self.machine.undo_all(_STEPS_OF_UNDO)
            self.machine.interrupts.clear()
            self._failures.clear()
            self.machine.booked.clear()
            self.cyclic_bools.clear()
            self.pauses.spy = None
            initialise_variables(self.program)
            self.machine.enter(routine, (), None)
            self.execution = Execution.READY
        if self.is_event_alone:
            self.now = time  # theirs

    def lose_pp(self) -> None:
        """Take the program pointer away, as a change of the program under way does."""
        self.stop()
        self.machine.abandon()
        self.machine.interrupts.clear()
        self.execution = Execution.UNINITIALIZED

    def _main(self) -> UserRoutine:
        main = self.program.find(self.entry, None)
        if not isinstance(main, UserRoutine) or main.syntax.kind is not s.RoutineKind.PROC or main.syntax.parameters:
            raise RapidReferenceError(f"No module of the task {self.name} has a procedure {self.entry}().")
        return main

    def start(self, step: StepKind | None = None, *, stop_at_breakpoints: bool = False) -> None:
        """Go on where the program pointer is, after the event routines, to the end of one step when one is given.

        Raises:
            RobotNotReady: the program pointer is nowhere.
        """
        if not (program := self.machine.program):
            raise RobotNotReady(f"The task {self.name} has no program pointer; move PP to main before the start.")
        program[-1].is_interrupted = False  # by a step or a breakpoint
        self.pauses.begin(step, stop_at_breakpoints=stop_at_breakpoints)
        self.stop_event, self._pp_moved = self._pp_moved, ""
        from_beginning = self.execution is Execution.READY
        self.execution = Execution.STARTED
        self.is_running = True
        self.begin_event(SystemEvent.STEP if step else SystemEvent.START if from_beginning else SystemEvent.RESTART)

    @property
    def breakpoints(self) -> Collection[tuple[str, int]]:
        """Module in lower case and line of each; they count when `start` says so."""
        return tuple(sorted(self.pauses.breakpoints))

    def set_breakpoint(self, module: str, line: int) -> None:
        """Stop before the statements of a line, also while the task runs.

        Raises:
            UnknownSymbol: there is no such module.
            RapidReferenceError: no statement begins on the line.
        """
        found = self._module(module)
        routines = (each.syntax for each in found.routines)
        if not any(line == each.line for routine in routines for each in s.statements(routine)):
            raise RapidReferenceError(f"No statement of the module '{found.name}' begins on line {line}.")
        self.pauses.breakpoints.add((found.name.lower(), line))
        self.pauses.watch()

    def clear_breakpoints(self, module: str, lines: Collection[int]) -> None:
        """Remove those of some lines of a module."""
        self.pauses.breakpoints -= {(module.lower(), line) for line in lines}
        self.pauses.watch()

    @property
    def call_stack(self) -> tuple[StackEntry, ...]:
        """The routines under way, the innermost first; its line is where the program pointer stands."""
        frames = reversed(self.machine.frames)
        return tuple(StackEntry(each.routine.module.name, each.routine.name, each.line) for each in frames)

    def stop(self) -> None:
        """Stop where the program is; `start` resumes it. Nothing happens when it is not running."""
        self.is_running = False
        if self.execution is Execution.STARTED:
            self.execution = Execution.STOPPED

    @property
    def event(self) -> SystemEvent | None:
        """The system event whose event routines are being executed, or None."""
        return self.machine.event

    def begin_event(self, event: SystemEvent) -> None:
        """Execute the event routines of a system event before anything else, in a stopped task them alone.

        One that does not exist leaves a warning in the event log.
        """
        routines = []
        for name in self.event_routines.get(event, ()):
            try:
                routines.append(self._routine_to_start(name, None))
            except RapidReferenceError as error:
                self._skip_event(event, name, error)
        try:
            self.machine.begin_event(event, routines)
        except RapidRuntimeError as error:
            self._skip_event(event, ", ".join(each.name for each in routines), error)

    def _skip_event(self, event: SystemEvent, names: str, error: Exception) -> None:
        text = f"The routine {names} of the system event {event.name} is not executed: {error}"
        self.host.write_event(self.name, "Event routine", text, Severity.WARNING, ())

    @property
    def is_event_alone(self) -> bool:
        """Whether the event routines that are being executed do not belong to a start: no robot may move."""
        return self.event is not None and not self.event.is_of_start

    def event_changed(self) -> None:
        """Event routines have begun or ended: a task that is not started runs while they do, in a time of theirs."""
        is_alone = self.is_event_alone
        if is_alone and self._program_time is None:
            self._program_time = self.now
        elif not is_alone and self._program_time is not None:
            self.now, self._program_time = self._program_time, None
        self.is_running = is_alone or (self.is_running and self.execution is Execution.STARTED)

    def abandon_event(self) -> None:
        """Leave the event routines that are being executed, but for those of a start, which goes on with them."""
        while self.is_event_alone:
            self.machine.abandon_event()

    @property
    def is_waiting(self) -> bool:
        """Whether an instruction waits, or nothing is executed at all."""
        frames = self.machine.frames
        return not (self.is_running and frames) or frames[-1].waiting is not None

    @property
    def is_busy(self) -> bool:
        """Whether it would have executed more than one advance allows, so that tasks behind it have to wait."""
        return self.is_running and self.machine.budget <= 0

    def pass_time(self, dt: float) -> None:
        """Let `dt` [s] pass without executing anything, as while a task in its foreground has more to execute."""
        self.now += dt
        self.stand(dt)
        if self.is_running and not self.is_event_alone:
            self.machine.interrupts.time_passed(self.now)

    def stand(self, dt: float) -> None:
        """Let `dt` [s] pass while the task is stopped: pulses end and clocks go on."""
        self.elapsed += dt
        self.attempt(self._perform_timers)

    def _perform_timers(self) -> None:
        self.timers.perform(self.elapsed + _ROUNDING)

    def later(self, delay: float, action: Callable[[], None]) -> None:
        """Do something after a delay [s], also when the task is stopped by then."""
        self.timers.add(self.elapsed + delay, action)

    def advance(self, dt: float) -> None:
        """Let `dt` [s] pass and execute until everything waits; 0.0 settles what can happen without time passing."""
        machine, end = self.machine, self.now + dt
        machine.budget = max(STEPS_PER_ADVANCE, int(dt * _STEPS_PER_SECOND))
        machine.deadline = self.clock() + TIME_PER_ADVANCE
        while True:
            of_timers = self.now + self.timers.next_time - self.elapsed
            due = min(machine.next_due() if self.is_running else math.inf, of_timers)
            if due >= end or machine.is_exhausted():
                break
            due = max(due, self.now)
            self._pass_to(due)
            end += self.now - due  # the program's time is back where it was: event routines that ran alone have ended
        self._pass_to(end)

    def _pass_to(self, time: float) -> None:
        self.elapsed += time - self.now
        self.now = time
        try:
            if self._failures:
                raise self._failures.pop(0)
            self._perform_timers()
            if self.is_running:
                if not self.is_event_alone:
                    self.machine.interrupts.time_passed(time)
                self.machine.run()
            if self._leaves_event:
                self._leaves_event = False
                self.abandon_event()
        except Exception as error:  # outside of a statement: whatever a program does, the controller goes on
            frame = self.machine.frames[-1] if self.machine.frames else None
            if isinstance(error, RapidRuntimeError) and frame is not None:
                self.machine.note_error(error)
                self.failed(error, frame)
                return
            where = "no routine" if frame is None else self._where(frame)
            what = f"{type(error).__name__}: {error}"
            sentence = f"{self.name} stopped in {where}, with a system error, which is the virtual controller's: {what}"
            _log.error("%s", sentence, exc_info=error)
            self.stop()
            if frame is None:
                self.host.report(self.name, TaskEvent(EventKind.ERROR, sentence))
            else:
                self._halt(EventKind.ERROR, sentence, frame)
                frame.rewind()

    def attempt(self, action: Callable[[], None]) -> None:
        """Do what the program has ordered for later, at a place on the path; an error stops the task when it goes on.

        Not at once, since the arm is on its way meanwhile.
        """
        try:
            action()
        except Exception as error:  # what the task makes of it, `_pass_to` says
            self._failures.append(error)

    def signal_changed(self, name: str, old: float, new: float) -> None:
        """Latch the interrupts that an I/O signal's change orders; lost while the task is not started."""
        if self.is_running:
            self.machine.interrupts.signal_changed(name, old, new)

    def instruction_used(self) -> None:
        """Some instructions and functions take as long as a hundred steps."""
        self.machine.until_clock_read = 0

    def call_procedure(self, name: str) -> None:
        """Let a procedure without arguments run next, as an instruction such as CallByVar does."""
        self.machine.enter(self._procedure(name), (), None)

    def interrupt_of(self, procedure: str) -> int:
        """The number of an interrupt that calls a procedure without arguments, as MoveLSync does."""
        found, interrupts = self._procedure(procedure), self.machine.interrupts
        numbers = (number for number, connection in interrupts.connections.items() if connection.trap is found)
        return next(numbers, None) or interrupts.connect(0, found)

    def _procedure(self, name: str) -> UserRoutine:
        found = self.program.find(name, self.frame.routine.module)
        if not isinstance(found, UserRoutine) or found.syntax.kind is not s.RoutineKind.PROC:
            raise RapidRuntimeError("ERR_REFUNKPRC", f"There is no procedure '{name}' to call.")
        return found

    # Stops ---------------------------------------------------------------------------------------

    def failed(self, error: RapidRuntimeError, frame: RoutineFrame) -> None:
        """No handler took an error: stop at the statement that failed."""
        where, name = self._where(frame), error.name or f"error {error.number:g}"
        sentence = f"{self.name} stopped in {where}, with {name}: {error}"
        self._halt(EventKind.ERROR, sentence, frame, error)
        frame.rewind()
        self.machine.abandon_event()

    def stopped_by_program(self, kind: EventKind) -> None:
        """The instructions Stop and SystemStopAction."""
        frame = self.frame
        self._leaves_event = self.is_event_alone
        if self._leaves_event and kind is EventKind.STOP and self.execution is not Execution.STARTED:
            self.stop()  # the program stands already: only the routine ends
            return
        self._halt(kind, f"{self.name} was stopped by the program in {self._where(frame)}.", frame)

    def exited(self, frame: RoutineFrame) -> None:
        self._halt(EventKind.EXIT, f"{self.name} was ended by EXIT in {self._where(frame)}.", frame)

    def paused(self, kind: EventKind, frame: RoutineFrame) -> None:
        """A step has been executed, or a breakpoint is reached."""
        why = "at the breakpoint in" if kind is EventKind.BREAKPOINT else "after one step, in"
        frame.is_interrupted = True  # it stands before the statement
        self._halt(kind, f"{self.name} has stopped {why} {self._where(frame)}.", frame)

    def finished(self) -> None:
        """The procedure main has returned; the program pointer stands on main again.

        RAPID overview, initialization: data and interrupts stay as they are when main begins again.
        """
        frame = self.machine.enter(self._main(), (), None)
        if self.repeats:
            if self._ended_at == self.now and frame.waiting is None:  # a program without waits leaves time to others
                frame.begin_wait(self._until_next_advance(), None, None)
            self._ended_at = self.now
            return
        self._halt(EventKind.FINISHED, f"{self.name} has finished main.", frame)
        self.execution = Execution.READY

    def _until_next_advance(self) -> Generator[float | None, None, None]:
        yield None

    def _halt(
        self, kind: EventKind, sentence: str, frame: RoutineFrame, error: RapidRuntimeError | None = None
    ) -> None:
        self.stop()
        name, number = (error.name, int(error.number or 0)) if error else ("", 0)
        routine = frame.routine
        event = TaskEvent(kind, sentence, name, number, routine.module.name, routine.name, frame.line)
        self.host.report(self.name, event)

    @staticmethod
    def _where(frame: RoutineFrame) -> str:
        return f"{frame.routine.module.name}/{frame.routine.name}, line {frame.line}"

    # Signals ------------------------------------------------------------------------------------------------------

    def read_signal(self, name: str) -> float:
        """The value of a signal; raises ERR_SIG_NOT_VALID."""
        try:
            return self.host.read_signal(name)
        except KeyError as error:
            raise RapidRuntimeError("ERR_SIG_NOT_VALID", f"There is no I/O signal '{name}'.") from error

    def write_signal(self, name: str, value: float) -> None:
        """Set a signal; raises ERR_SIG_NOT_VALID."""
        try:
            self.host.write_signal(name, value)
        except KeyError as error:
            raise RapidRuntimeError("ERR_SIG_NOT_VALID", f"There is no I/O signal '{name}'.") from error

    def is_settled(self, call: Call) -> bool:
        r"""Whether the robot stands as the call's \InPos demands."""
        return not call.present("InPos") or self.in_position()


def task_of(call: Call) -> Task:
    """The whole of the task that executes a call, for routines about the task itself."""
    assert isinstance(call.task, Task)
    return call.task


def tasks_of(call: Call) -> Mapping[str, Task]:
    """All tasks of the controller by name."""
    return {name: task for name, task in call.task.host.devices.tasks().items() if isinstance(task, Task)}


def task_named(call: Call, name: str) -> Task:
    """A task of the controller by its name; raises ERR_TASKNAME."""
    tasks = tasks_of(call)
    for key, task in tasks.items():
        if key.lower() == name.lower():
            return task
    raise call.error("ERR_TASKNAME", f"there is no task '{name}'; there is: {', '.join(tasks)}.")


def task_of_argument(call: Call) -> Task:
    r"""The task that \TaskRef or \TaskName names, the caller's without them; raises ERR_TASKNAME."""
    name = call["TaskRef"].taskname if call.present("TaskRef") else call.get("TaskName", call.task.name)
    return task_of(call) if name.lower() == call.task.name.lower() else task_named(call, name)
