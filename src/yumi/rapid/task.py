"""The task: a RAPID program with its data, its program pointer and its own time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from yumi.errors import RobotNotReady
from yumi.rapid import syntax as s
from yumi.rapid.agenda import Agenda
from yumi.rapid.calls import Places
from yumi.rapid.data import UNSET, Place, Variable
from yumi.rapid.error_numbers import FIRST_BOOKED_NUMBER
from yumi.rapid.errors import (
    ModuleNameTaken,
    RapidReferenceError,
    RapidRuntimeError,
    RapidSyntaxError,
    RapidValueError,
    UnknownSymbol,
)
from yumi.rapid.expressions import Expressions, Scope
from yumi.rapid.frame import Frame
from yumi.rapid.host import EventKind, Execution, Host, TaskEvent
from yumi.rapid.interrupts import Interrupts
from yumi.rapid.library import Call, Library
from yumi.rapid.linker import Linker, loaded
from yumi.rapid.literals import format_value, parse_value
from yumi.rapid.machine import Machine
from yumi.rapid.parser import parse_module, parse_reference
from yumi.rapid.scope import LoadedModule, Program, UserRoutine
from yumi.rapid.statements import CONSTANT_FRAME
from yumi.rapid.types import resolved

STEPS_PER_ADVANCE = 2000  # so that an endless loop without a wait cannot hang the controller
STEPS_PER_SECOND = 500_000  # and as many more as a long advance may need
OP_AUTO = 1
FATAL = 0.0  # the number of an error that no handler may take


@dataclass(frozen=True, slots=True)
class ModuleInfo:
    """A module in the task's memory."""

    name: str
    is_system: bool
    filename: str
    text: str = field(default="", repr=False, compare=False)


class Task:
    r"""One RAPID task.

    Args:
        name: such as "T_ROB_R".
        host: the controller it runs on.
        library: instructions, functions, types and data beside the program's own.

    Attributes:
        now: the task's time, which passes in `advance` only [s].
        agenda: what the program has started and left to be done later.
        in_position: whether the mechanical units stand still in a fine point; what \InPos waits for.
        operating_mode: what OpMode() gives: OP_AUTO 1, OP_MAN_PROG 2, OP_MAN_TEST 3.
    """

    def __init__(self, name: str, host: Host, library: Library) -> None:
        self.name = name
        self.host = host
        self.library = library
        self.now = 0.0
        self.agenda = Agenda()
        self.in_position: Callable[[], bool] = lambda: True
        self.operating_mode: Callable[[], int] = lambda: OP_AUTO
        self.is_running = False
        self.program = Program(library, host)
        self._linker = Linker(self.program)
        self._machine = Machine(self)
        self._execution = Execution.UNINITIALIZED
        self._booked: dict[float, str] = {}
        for system_name, type_name in (("ERRNO", "errnum"), ("INTNO", "intnum")):
            variable = Variable(system_name, library.type(type_name), 0.0, s.Storage.CONST, is_local=False)
            self.program.system_data[system_name.lower()] = variable

    @property
    def execution(self) -> Execution:
        return self._execution

    @property
    def interrupts(self) -> Interrupts:
        return self._machine.interrupts

    # Modules ------------------------------------------------------------------------------------------------------

    @property
    def modules(self) -> tuple[ModuleInfo, ...]:
        syntaxes = ((module.name, module.syntax) for module in self.program.modules.values())
        return tuple(ModuleInfo(name, each.is_system, each.filename, each.text) for name, each in syntaxes)

    def load(self, text: str, filename: str, *, replace: bool = False) -> str:
        """Load a module, in the place of one of the same name if it may; returns its name.

        Raises:
            RapidSyntaxError: the text is not RAPID.
            RapidReferenceError: a name is declared twice, or what is declared does not fit.
            ModuleNameTaken: there is a module of the name already.
            RobotNotReady: the module it would replace is executing.
        """
        module = parse_module(text, filename)
        new, old = loaded(module), self.program.modules.get(module.name.lower())
        if old is not None and not replace:
            raise ModuleNameTaken(f"{filename}: the task {self.name} already has a module '{module.name}'.")
        if old is not None:
            self.unload(module.name)
        self._take_in(new, old)
        return module.name

    def _take_in(self, new: LoadedModule, old: LoadedModule | None) -> None:
        """Make a module part of the program; one that does not fit leaves it as it was."""
        key = new.name.lower()
        self.program.modules[key] = new
        self._forget_code()
        try:
            if self._machine.frames:
                self._linker.link_data()
        except RapidReferenceError:
            del self.program.modules[key]
            if old is not None:
                self.program.modules[key] = old
            self._forget_code()
            raise

    def unload(self, module: str) -> None:
        """Remove a module; raises UnknownSymbol, or RobotNotReady while one of its routines is executing."""
        found = self._module(module)
        if any(frame.routine.module is found for frame in self._machine.frames):
            raise RobotNotReady(f"The module '{found.name}' is executing; move PP to main before it is unloaded.")
        del self.program.modules[module.lower()]
        self._forget_code()

    def _forget_code(self) -> None:
        """What a name means may have changed, so routines are compiled anew when they are called."""
        for routine in self.program.routines():
            routine.code = routine.parameters = routine.returns = None

    # Execution ----------------------------------------------------------------------------------------------------

    def move_pp_to_main(self) -> None:
        """Put the program pointer on `main` and give all VARs their first value; PERS keep theirs.

        Raises:
            RobotNotReady: the task is started.
            RapidReferenceError: something in a module does not fit, or there is no procedure `main`.
        """
        if self._execution is Execution.STARTED:
            raise RobotNotReady(f"The task {self.name} is running; stop it before PP is moved to main.")
        self._linker.link_data()
        self._linker.check_routines()
        main = self._main()
        self._machine.abandon()
        self._machine.interrupts.clear()
        self._booked.clear()
        self._linker.initialise_variables()
        self._machine.enter(main, (), None)
        self._execution = Execution.READY

    def lose_pp(self) -> None:
        """Take the program pointer away, as a change of the program under way does."""
        self.stop()
        self._machine.abandon()
        self._machine.interrupts.clear()
        self._execution = Execution.UNINITIALIZED

    def _main(self) -> UserRoutine:
        main = self.program.find("main", None)
        if not isinstance(main, UserRoutine) or main.syntax.kind is not s.RoutineKind.PROC or main.syntax.parameters:
            raise RapidReferenceError(f"No module of the task {self.name} has a procedure main().")
        return main

    def start(self) -> None:
        """Go on where the program pointer is; raises RobotNotReady when it is nowhere."""
        if not self._machine.frames:
            raise RobotNotReady(f"The task {self.name} has no program pointer; move PP to main before the start.")
        self._execution = Execution.STARTED
        self.is_running = True

    def stop(self) -> None:
        """Stop where the program is; `start` resumes it. Nothing happens when it is not running."""
        self.is_running = False
        if self._execution is Execution.STARTED:
            self._execution = Execution.STOPPED

    def advance(self, dt: float) -> None:
        """Let `dt` [s] pass and execute until everything waits; 0.0 settles what can happen without time passing."""
        machine, end = self._machine, self.now + dt
        machine.budget = max(STEPS_PER_ADVANCE, int(dt * STEPS_PER_SECOND))
        while (wake := self._next_wake()) < end and machine.budget > 0:
            self._pass_to(max(wake, self.now))
        self._pass_to(end)

    def _next_wake(self) -> float:
        wake = self._machine.next_wake() if self.is_running else math.inf
        return min(wake, self.agenda.next_time)

    def _pass_to(self, time: float) -> None:
        self.now = time
        self.agenda.perform(time)
        if self.is_running:
            self._machine.interrupts.time_passed(time)
            self._machine.run()

    def signal_changed(self, name: str, old: float, new: float) -> None:
        """Latch the interrupts that an I/O signal's change orders; lost while the task is not started."""
        if self.is_running:
            self._machine.interrupts.signal_changed(name, old, new)

    def call_procedure(self, name: str) -> None:
        """Let a procedure without arguments run next, as an instruction such as CallByVar does."""
        found = self.program.find(name, self._machine.frames[-1].routine.module)
        if not isinstance(found, UserRoutine) or found.syntax.kind is not s.RoutineKind.PROC:
            raise RapidRuntimeError("ERR_REFUNKPRC", f"There is no procedure '{name}' to call.")
        self._machine.enter(found, (), None)

    # What the machine tells ---------------------------------------------------------------------------------------

    def failed(self, error: RapidRuntimeError, frame: Frame) -> None:
        """No handler took an error: stop at the statement that failed."""
        where, name = self._where(frame), error.name or f"error {error.number:g}"
        sentence = f"{self.name} stopped in {where} with {name}: {error}"
        self._halt(EventKind.ERROR, sentence, frame, error)
        frame.rewind()

    def stopped_by_program(self) -> None:
        """The instruction Stop."""
        frame = self._machine.frames[-1]
        self._halt(EventKind.STOP, f"{self.name} was stopped by the program in {self._where(frame)}.", frame)

    def exited(self, frame: Frame) -> None:
        self._halt(EventKind.EXIT, f"{self.name} was ended by EXIT in {self._where(frame)}.", frame)

    def finished(self) -> None:
        """The procedure main has returned; the program pointer stands on main again."""
        main = self._main()
        frame = self._machine.enter(main, (), None)
        self._halt(EventKind.FINISHED, f"{self.name} has finished main.", frame)
        self._execution = Execution.READY

    def _halt(self, kind: EventKind, sentence: str, frame: Frame, error: RapidRuntimeError | None = None) -> None:
        self.stop()
        name, number = (error.name, int(error.number or 0)) if error else ("", 0)
        routine = frame.routine
        event = TaskEvent(kind, sentence, name, number, routine.module.name, routine.name, frame.line)
        self.host.report(self.name, event)

    @staticmethod
    def _where(frame: Frame) -> str:
        return f"{frame.routine.module.name}/{frame.routine.name}, line {frame.line},"

    # Errors -------------------------------------------------------------------------------------------------------

    def note_error(self, error: RapidRuntimeError) -> float:
        """The number of an error, which ERRNO has from now on; FATAL for a name the library does not know."""
        if error.number is None:
            error.number = self.library.error_number(error.name) or FATAL
        self.set_system("errno", error.number)
        return error.number

    def book_error(self, name: str) -> float:
        """A new error number for the program (BookErrNo)."""
        number = float(FIRST_BOOKED_NUMBER + len(self._booked))
        self._booked[number] = name
        return number

    def error_name(self, number: float) -> str:
        """The name of a booked or known error, "" when it has none."""
        return self._booked.get(number) or self.library.error_name(number) or ""

    def set_system(self, name: str, value: float) -> None:
        self.program.system_data[name].value = value

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

    # Symbols ------------------------------------------------------------------------------------------------------

    def read(self, module: str, symbol: str) -> str:
        """The value of a datum, or of an array element `a{1}`, as a RAPID literal; raises UnknownSymbol."""
        place = self._place(module, symbol)
        return format_value(place.type, place.value)

    def write(self, module: str, symbol: str, literal: str) -> None:
        """Give a VAR or PERS the value of a literal.

        Raises:
            UnknownSymbol: there is no such datum.
            RapidValueError: the literal does not fit, or the datum is a constant.
        """
        if self.kind_of(module, symbol) == s.Storage.CONST.value:
            raise RapidValueError(f"'{symbol}' is a constant and cannot be written.")
        place = self._place(module, symbol)
        place.value = parse_value(place.type, literal)

    def type_of(self, module: str, symbol: str) -> str:
        """The type as declared, such as "num", "EGMSettings" or "errnum"."""
        return self._place(module, symbol).type.name

    def dimensions_of(self, module: str, symbol: str) -> tuple[int, ...]:
        """The sizes of an array, empty for a single value."""
        return getattr(resolved(self._place(module, symbol).type), "sizes", ())

    def kind_of(self, module: str, symbol: str) -> str:
        """How the datum is stored: "var", "per" or "con"."""
        return self._datum(module, symbol).storage.value

    def symbols(self, module: str) -> tuple[str, ...]:
        """The names of a module's data, LOCAL ones too."""
        return tuple(variable.name for variable in self._module(module).data)

    def _module(self, name: str) -> LoadedModule:
        found = self.program.modules.get(name.lower())
        if found is None:
            names = ", ".join(m.name for m in self.program.modules.values()) or "none"
            raise UnknownSymbol(f"The task {self.name} has no module '{name}'; it has {names}.")
        return found

    def _place(self, module: str, symbol: str) -> Place:
        datum = self._datum(module, symbol)
        if "{" not in symbol:
            return datum
        scope = Scope(self.program, self._module(module))
        try:
            place = Places(Expressions(scope)).place(parse_reference(symbol))[0](CONSTANT_FRAME)
        except (RapidSyntaxError, RapidReferenceError, RapidRuntimeError) as error:
            raise UnknownSymbol(f"The module '{module}' has no datum '{symbol}': {error}") from error
        return place

    def _datum(self, module: str, symbol: str) -> Variable:
        """The variable itself, of an element the array it belongs to."""
        owner = self._module(module)
        found = owner.symbols.get(symbol.partition("{")[0].lower())
        if not isinstance(found, Variable):
            raise UnknownSymbol(f"The module '{owner.name}' has no datum '{symbol}'.")
        if found.value is UNSET:
            self._linker.link(found, owner)
        return found
