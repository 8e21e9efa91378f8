"""The program of a task: its modules, what names mean in them, and the code of its routines.

A `Program` never changes: to load or unload a module makes another one, which may be linked and compiled in a
background thread before the task goes on with it. Only the values of data change, and the codes that are added. First
come the host, the controller as a task sees it, and the events that a task reports to it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

from yumi.rapid import ast as s
from yumi.rapid.devices import Devices
from yumi.rapid.library import FormalParameter, Library, LibraryRoutine
from yumi.rapid.types import (
    UNSET,
    AliasType,
    ArrayType,
    RapidReferenceError,
    RecordType,
    Signal,
    Type,
    Unresolved,
    Variable,
)

if TYPE_CHECKING:
    from yumi.rapid.machine import Frame, Machine


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
    """How serious a message for the event log is."""

    INFORMATION = "information"
    WARNING = "warning"
    ERROR = "error"


class Host(Protocol):
    """The controller as a RAPID task sees it.

    Attributes:
        devices: its disk, network, FlexPendant and so on.
    """

    devices: Devices

    def write_text(self, task: str, text: str) -> None:
        """Show one line on the operator's display (TPWrite)."""

    def write_event(self, task: str, title: str, text: str, severity: Severity, arguments: tuple[str, ...]) -> None:
        """Put a message into the event log (ErrWrite); the arguments are what of it the program has given."""

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


Step = Callable[["Machine", "Frame"], None]
Evaluate = Callable[["Frame"], Any]


# The code of a routine: a list of small steps, each under its statement ---------------------------------------------


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


class CodeBuilder:
    """Puts steps one after another, each under the statement that is being compiled."""

    def __init__(self, line: int) -> None:
        self.code = Code()
        self._span = Span(line, 0)

    @contextmanager
    def statement(self, line: int) -> Iterator[Span]:
        """Everything added inside belongs to a statement that begins here."""
        outer, self._span = self._span, Span(line, len(self.code.steps))
        yield self._span
        self._span.end = len(self.code.steps)
        self._span = outer

    def replace(self, span: Span, step: Step) -> None:
        """A step in the place of all that a statement has got so far."""
        del self.code.steps[span.start :], self.code.spans[span.start :]
        self.add(step)

    def add(self, step: Step) -> None:
        self.code.steps.append(step)
        self.code.spans.append(self._span)

    def new_slot(self) -> int:
        self.code.slots += 1
        return self.code.slots - 1

    def mark(self, target: Target) -> None:
        """Let `target` be the next step."""
        target.step = len(self.code.steps)

    def here(self) -> Target:
        return Target(len(self.code.steps))

    def jump(self, target: Target) -> None:
        def jump(machine: Machine, frame: Frame) -> None:
            frame.step = target.step

        self.add(jump)

    def jump_if(self, condition: Evaluate, target: Target) -> None:
        def jump_if(machine: Machine, frame: Frame) -> None:
            if condition(frame):
                frame.step = target.step

        self.add(jump_if)

    def jump_unless(self, condition: Evaluate, target: Target) -> None:
        def jump_unless(machine: Machine, frame: Frame) -> None:
            if not condition(frame):
                frame.step = target.step

        self.add(jump_unless)

    def store(self, evaluate: Evaluate, slot: int | None = None) -> int:
        """Keep an intermediate result in a slot of its own; returns the slot."""
        index = self.new_slot() if slot is None else slot

        def store(machine: Machine, frame: Frame) -> None:
            frame.slots[index] = evaluate(frame)

        self.add(store)
        return index


# Symbols ----------------------------------------------------------------------------------------------------------


@dataclass(eq=False, slots=True, frozen=True)
class UserRoutine:
    """A routine of a loaded module."""

    module: LoadedModule
    syntax: s.Routine

    @property
    def name(self) -> str:
        return self.syntax.name


@dataclass(eq=False, slots=True, frozen=True)
class UserType:
    """A RECORD or ALIAS of a loaded module."""

    module: LoadedModule
    syntax: s.Record | s.Alias


@dataclass(frozen=True, slots=True)
class Local:
    """A parameter, routine datum or loop variable: the slot of its `Variable` in the frame.

    Attributes:
        mode: how it was passed, None when it is not a parameter.
        is_optional: whether the parameter may be absent.
    """

    slot: int
    type: Type
    is_constant: bool = False
    mode: s.Mode | None = None
    is_optional: bool = False


Symbol = Variable | UserRoutine | UserType
Found = Local | Variable | UserRoutine | LibraryRoutine | UserType | Signal


@dataclass(eq=False, slots=True)
class LoadedModule:
    """A module with its names declared; its data have no type and value before they are linked.

    Attributes:
        symbols: its types, data and routines by lower-case name.
        data: declarations by their variables, in order.
        value_count: how many values its data hold, as far as they are linked.
    """

    syntax: s.Module
    symbols: dict[str, Symbol] = field(default_factory=dict)
    data: dict[Variable, s.Data] = field(default_factory=dict)
    value_count: int = 0

    @staticmethod
    def of(syntax: s.Module) -> LoadedModule:
        """Declare the names of a module; raises RapidReferenceError for a name used twice."""
        module = LoadedModule(syntax)
        declared: tuple[s.Record | s.Alias | s.Data | s.Routine, ...]
        declared = (*syntax.records, *syntax.aliases, *syntax.data, *syntax.routines)
        for node in declared:
            symbol: Symbol
            if isinstance(node, s.Data):
                symbol = Variable(node.name, UNSET, storage=node.storage, is_local=node.is_local, is_task=node.is_task)
                module.data[symbol] = node
            else:
                symbol = UserRoutine(module, node) if isinstance(node, s.Routine) else UserType(module, node)
            if node.name.lower() in module.symbols:
                raise misfit(module, node, f"'{node.name}' is declared twice")
            module.symbols[node.name.lower()] = symbol
            for datum in node.locals if isinstance(node, s.Routine) else ():
                if datum.storage is s.Storage.PERS:
                    raise misfit(module, datum, f"'{datum.name}' is persistent, which data of routines cannot be")
        return module

    @property
    def name(self) -> str:
        return self.syntax.name

    @property
    def routines(self) -> Iterator[UserRoutine]:
        return (symbol for symbol in tuple(self.symbols.values()) if isinstance(symbol, UserRoutine))

    def exports(self, name: str) -> Symbol | None:
        """The symbol `name` as other modules see it."""
        found = self.symbols.get(name)
        owner = found if found is None or isinstance(found, Variable) else found.syntax
        return None if owner is None or owner.is_local else found

    def clear(self) -> None:
        """Let go of everything: modules and routines refer to each other, which only the collector would free."""
        self.symbols.clear()
        self.data.clear()


def misfit(
    module: LoadedModule, node: s.Node, sentence: str, kind: type[RapidReferenceError] = RapidReferenceError
) -> RapidReferenceError:
    """The error of something in a module that does not fit."""
    return kind(
        f"{module.name}, line {node.line}: {sentence}.",
        sentence=f"{sentence}.",
        filename=module.syntax.filename,
        line=node.line,
        column=node.column,
    )


@dataclass(frozen=True, slots=True)
class Signature:
    """Parameters and return type of a routine."""

    parameters: tuple[FormalParameter, ...]
    returns: Type | None


class Program:
    """All modules of a task, and the names outside of them.

    Attributes:
        modules: by lower-case name.
        codes: the routines that are compiled.
        system_data: ERRNO and INTNO.
        shared: finds the persistent of a name that other tasks have; all tasks share its value.
    """

    def __init__(
        self,
        library: Library,
        host: Host,
        system_data: Mapping[str, Variable],
        modules: Mapping[str, LoadedModule] | None = None,
    ) -> None:
        self.library = library
        self.host = host
        self.system_data = system_data
        self.modules: Mapping[str, LoadedModule] = modules or {}
        self.shared: Callable[[str], Variable | None] = lambda name: None
        self.codes: dict[UserRoutine, Code] = {}
        self._types: dict[UserType, Type] = {}
        self._signatures: dict[UserRoutine, Signature] = {}

    @property
    def routines(self) -> Iterator[UserRoutine]:
        return (routine for module in self.modules.values() for routine in module.routines)

    def loaded(self, module: LoadedModule) -> Program:
        """The program with a module more, or in the place of the one of the same name.

        Raises:
            RapidReferenceError: another module has a global symbol of the same name.
        """
        for name, other in self.modules.items():
            for key, symbol in tuple(module.symbols.items()) if name != module.name.lower() else ():
                if module.exports(key) is not None and other.exports(key) is not None:
                    declared = module.data[symbol] if isinstance(symbol, Variable) else symbol.syntax
                    sentence = f"'{declared.name}' is global in the module '{other.name}', too: make one of them LOCAL"
                    raise misfit(module, declared, sentence)
        return self._changed({**self.modules, module.name.lower(): module}, module)

    def unloaded(self, name: str) -> Program:
        """The program without the module `name`."""
        return self._changed({key: each for key, each in self.modules.items() if key != name.lower()}, None)

    def _changed(self, modules: Mapping[str, LoadedModule], new: LoadedModule | None) -> Program:
        """The program with other modules; it keeps the code in which no name can have come to mean something else."""
        program = Program(self.library, self.host, self.system_data, modules)
        program.shared = self.shared
        gone = {key: module for key, module in self.modules.items() if modules.get(key) is not module}
        changed = [*gone.values(), *([new] if new else [])]
        symbols = {name: symbol for module in changed for name, symbol in tuple(module.symbols.items())}
        has_types = any(isinstance(symbol, UserType) for symbol in symbols.values())  # they reach through many names
        if not has_types and not any(variable.fault for module in modules.values() for variable in module.data):
            for routine, code in tuple(self.codes.items()):
                if routine.module not in changed and code.names.isdisjoint(symbols):
                    program.codes[routine] = code
        return program

    # Names --------------------------------------------------------------------------------------------------------

    def find(self, name: str, module: LoadedModule | None) -> Found | None:
        """What `name` means in `module`; None stands for outside of all modules."""
        key = name.lower()
        if module is not None and (own := module.symbols.get(key)) is not None:
            return own
        if (exported := self.exported(key)) is not None:
            return exported
        return self.system_data.get(key) or self.library.datum(key) or self.library.routine(key)

    def exported(self, name: str) -> Symbol | None:
        """What the modules themselves have under a name that all of them see."""
        key = name.lower()
        for module in self._modules_of_names.get(key, ()):
            if (found := module.exports(key)) is not None:
                return found
        return None

    @cached_property
    def _modules_of_names(self) -> Mapping[str, Sequence[LoadedModule]]:
        """The modules that declare a name, in their order: the compiler looks up each name of a program."""
        found: dict[str, list[LoadedModule]] = {}
        for module in self.modules.values():
            for name in tuple(module.symbols):
                found.setdefault(name, []).append(module)
        return found

    def find_late(self, name: str, module: LoadedModule) -> Found | None:
        """What a late-binding call names: `routine`, or `module:routine`, which may be LOCAL."""
        owner, colon, routine = name.rpartition(":")
        if not colon:
            return self.find(name, module)
        named = self.modules.get(owner.lower())
        return None if named is None else named.symbols.get(routine.lower())

    def find_signal(self, name: str) -> Signal | None:
        try:
            self.host.read_signal(name)
        except KeyError:
            return None
        return Signal(name)

    def type_named(self, name: str, module: LoadedModule, node: s.Node, users: tuple[UserType, ...] = ()) -> Type:
        """The type called `name` in `module`, which the types `users` are made of; raises RapidReferenceError."""
        found = self.find(name, module)
        if not isinstance(found, UserType):
            library_type = self.library.find_type(name)
            if library_type is None:
                raise misfit(module, node, f"there is no data type '{name}'", Unresolved)
            return library_type
        known = self._types.get(found)
        if known is not None:
            return known
        declared, owner = found.syntax, found.module
        if found in users:
            raise misfit(owner, declared, f"the type '{declared.name}' contains itself")
        users = (*users, found)
        type_: Type
        if isinstance(declared, s.Alias):
            type_ = AliasType(declared.name, self.type_named(declared.type_name, owner, declared, users))
        else:
            components = [(n, self.type_named(t, owner, declared, users)) for t, n in declared.components]
            type_ = RecordType.named(declared.name, tuple(components))
        return self._types.setdefault(found, type_)

    def signature(self, routine: UserRoutine) -> Signature:
        """The parameters of a routine with their types; raises RapidReferenceError."""
        known = self._signatures.get(routine)
        if known is not None:
            return known
        module, syntax = routine.module, routine.syntax
        returns = None if syntax.return_type is None else self.type_named(syntax.return_type, module, syntax)
        parameters = []
        for parameter in syntax.parameters:
            type_ = self.type_named(parameter.type_name, module, parameter)
            type_ = ArrayType(type_, (0,) * parameter.rank) if parameter.rank else type_
            parameters.append(FormalParameter(parameter.name, type_, parameter.mode, parameter.group))
        return self._signatures.setdefault(routine, Signature(tuple(parameters), returns))
