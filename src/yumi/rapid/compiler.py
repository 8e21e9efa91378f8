"""Expressions: compiled to closures that give a value from a frame, with their type known beforehand.

Statements: compiled to the steps of a routine.

Calls: arguments matched to parameters, and the steps that enter a routine or run an instruction.

Scopes: where RAPID looks a name up: the routine, its module, the other modules, the library, the I/O signals.

The linker: gives the data of loaded modules their types and first values, and checks all references.

Late binding: `%"name"% arguments;`, the procedure looked up each time the statement runs.

WaitUntil: the one instruction whose argument is looked at again and again.

Code: a routine as the machine executes it, a list of small steps that know their statement.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NoReturn

from yumi.errors import RapidError
from yumi.rapid import ast as s
from yumi.rapid.errors import ProgramTooLarge, RapidReferenceError, RapidRuntimeError
from yumi.rapid.host import Host
from yumi.rapid.library import Call, FormalParameter, Library, LibraryRoutine
from yumi.rapid.types import (
    ABSENT,
    BOOL,
    DNUM,
    LARGEST_ARRAY,
    MOST_OBJECTS,
    NUM,
    STRING,
    SWITCH,
    UNSET,
    AliasType,
    ArrayType,
    ObjectType,
    OpenType,
    Part,
    Place,
    RecordType,
    Signal,
    SignalType,
    Type,
    Variable,
    binary_operation,
    described,
    holds_objects,
    is_assignable,
    is_numeric,
    one,
    resolved,
    unary_operation,
    value_count,
)

if TYPE_CHECKING:
    from yumi.rapid.machine import Frame, Machine

Step = Callable[["Machine", "Frame"], None]
Evaluate = Callable[["Frame"], Any]


@dataclass(eq=False, slots=True)
class Span:
    """The steps of one statement: RETRY goes back to `start`, TRYNEXT on to `end`."""

    line: int
    start: int
    end: int = 0


@dataclass(eq=False, slots=True)
class Target:
    """A place in the code that steps jump to, known once the code has got there."""

    step: int = -1


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
        slots: how many places a frame needs for parameters, data and intermediate results.
        value_count: how many values the routine's data hold.
    """

    steps: list[Step] = field(default_factory=list)
    spans: list[Span] = field(default_factory=list)
    slots: int = 0
    value_count: int = 0
    handler: HandlerCode | None = None


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

    def jump_unless(self, condition: Evaluate, target: Target) -> None:
        def jump_unless(machine: Machine, frame: Frame) -> None:
            if not condition(frame):
                frame.step = target.step

        self.add(jump_unless)

    def jump_if(self, condition: Evaluate, target: Target) -> None:
        def jump_if(machine: Machine, frame: Frame) -> None:
            if condition(frame):
                frame.step = target.step

        self.add(jump_if)

    def store(self, evaluate: Evaluate, slot: int | None = None) -> int:
        """Keep an intermediate result in a slot of its own."""
        place = self.new_slot() if slot is None else slot

        def store(machine: Machine, frame: Frame) -> None:
            frame.slots[place] = evaluate(frame)

        self.add(store)
        return place


@dataclass(eq=False, slots=True)
class UserRoutine:
    """A routine of a loaded module; `code` is None until it is called for the first time."""

    module: LoadedModule
    syntax: s.Routine
    parameters: tuple[FormalParameter, ...] | None = None
    returns: Type | None = None
    code: Code | None = None

    @property
    def name(self) -> str:
        return self.syntax.name


@dataclass(eq=False, slots=True)
class LoadedModule:
    """A module in the task's memory.

    Attributes:
        symbols: its types, data and routines by lower-case name.
        data: declarations and their variables, in order.
        value_count: how many values its data hold, as far as they are linked.
    """

    syntax: s.Module
    symbols: dict[str, Symbol] = field(default_factory=dict)
    data: dict[Variable, s.Data] = field(default_factory=dict)
    value_count: int = 0

    @property
    def name(self) -> str:
        return self.syntax.name

    def exports(self, name: str) -> Symbol | None:
        """The symbol `name` as other modules see it."""
        found = self.symbols.get(name)
        if found is None:
            return None
        if isinstance(found, Variable):
            return None if found.is_local else found
        return None if found.syntax.is_local else found


@dataclass(eq=False, slots=True)
class UserType:
    """A RECORD or ALIAS of a loaded module; `type` is None until something needs it."""

    module: LoadedModule
    syntax: s.Record | s.Alias
    type: Type | None = None
    is_being_linked: bool = False


@dataclass(frozen=True, slots=True)
class Local:
    """A parameter, routine datum or loop variable: the place of its `Variable` in the frame.

    Attributes:
        mode: how it was passed, None when it is no parameter.
        is_optional: whether the parameter may be absent.
    """

    slot: int
    type: Type
    is_constant: bool = False
    mode: s.Mode | None = None
    is_optional: bool = False


Symbol = Variable | UserRoutine | UserType
Found = Local | Variable | UserRoutine | LibraryRoutine | UserType | Signal


class Program:
    """All modules of a task, and the names outside of them.

    Attributes:
        version: changes whenever names may have come to mean something else.
    """

    def __init__(self, library: Library, host: Host) -> None:
        self.library = library
        self.host = host
        self.modules: dict[str, LoadedModule] = {}
        self.version = 0
        self.system_data: dict[str, Variable] = {}

    def routines(self) -> Iterator[UserRoutine]:
        for module in self.modules.values():
            yield from (symbol for symbol in module.symbols.values() if isinstance(symbol, UserRoutine))

    def find(self, name: str, module: LoadedModule | None) -> Found | None:
        """What `name` means in `module`; None stands for outside of all modules."""
        key = name.lower()
        found = module.symbols.get(key) if module else None
        return found or self._exported(key, module) or self._predefined(key)

    def _exported(self, key: str, asking: LoadedModule | None) -> Symbol | None:
        """What other modules export; the one in whose place a module is about to be loaded does not count."""
        own = asking.name.lower() if asking else None
        exports = (module.exports(key) for name, module in self.modules.items() if name != own)
        return next((symbol for symbol in exports if symbol is not None), None)

    def _predefined(self, key: str) -> Found | None:
        return self.system_data.get(key) or self.library.datum(key) or self.library.routine(key)

    def find_signal(self, name: str) -> Signal | None:
        try:
            self.host.read_signal(name)
        except KeyError:
            return None
        return Signal(name)

    # Types --------------------------------------------------------------------------------------------------------

    def type_named(self, name: str, module: LoadedModule, line: int) -> Type:
        """The type called `name` in `module`; raises RapidReferenceError."""
        found = self.find(name, module)
        if isinstance(found, UserType):
            return self._linked_type(found)
        library_type = self.library.find_type(name)
        if library_type is None:
            raise blamed(module, line, f"there is no data type '{name}'")
        return library_type

    def _linked_type(self, user_type: UserType) -> Type:
        if user_type.type is None:
            declared, module = user_type.syntax, user_type.module
            if user_type.is_being_linked:
                raise blamed(module, declared.line, f"the type '{declared.name}' contains itself")
            user_type.is_being_linked = True
            user_type.type = self._declared_type(declared, module)
        return user_type.type

    def _declared_type(self, declared: s.Record | s.Alias, module: LoadedModule) -> Type:
        if isinstance(declared, s.Alias):
            return AliasType(declared.name, self.type_named(declared.type_name, module, declared.line))
        components = ((c.name, self.type_named(c.type_name, module, declared.line)) for c in declared.components)
        return RecordType.named(declared.name, tuple(components))

    def link_routine(self, routine: UserRoutine) -> tuple[FormalParameter, ...]:
        """The parameters of a routine with their types."""
        if routine.parameters is None:
            line, module = routine.syntax.line, routine.module
            if routine.syntax.return_type is not None:
                routine.returns = self.type_named(routine.syntax.return_type, module, line)
            routine.parameters = tuple(
                FormalParameter(p.name, self._parameter_type(p, module, line), p.mode, p.group)
                for p in routine.syntax.parameters
            )
        return routine.parameters

    def _parameter_type(self, parameter: s.Parameter, module: LoadedModule, line: int) -> Type:
        type_ = self.type_named(parameter.type_name, module, line)
        return ArrayType(type_, (0,) * parameter.rank) if parameter.rank else type_


def blamed(module: LoadedModule, line: int, sentence: str) -> RapidReferenceError:
    return RapidReferenceError(f"{module.name}, line {line}: {sentence}.")


@dataclass(frozen=True, slots=True)
class Compiled:
    """An expression ready to evaluate; a `is_literal` number may stand for a num or a dnum."""

    evaluate: Evaluate
    type: Type
    is_literal: bool = False


class Scope:
    """The names a piece of code sees.

    Attributes:
        builder: where its steps go, None for the data of a module.
        is_declaration: whether the expression must be constant, as the first value of a datum is.
    """

    def __init__(self, program: Program, module: LoadedModule, builder: CodeBuilder | None = None) -> None:
        self.program = program
        self.module = module
        self.builder = builder
        self.locals: dict[str, Local] = {}
        self.is_declaration = builder is None

    def find(self, name: str, line: int) -> Found:
        found = self.locals.get(name.lower()) or self.program.find(name, self.module)
        found = found or self.program.find_signal(name)
        if found is None:
            self.blame(line, f"'{name}' is not declared, and no signal has that name")
        return found

    def blame(self, line: int, sentence: str) -> NoReturn:
        raise blamed(self.module, line, sentence)


MOST_IN_STATEMENT = 2000  # names, numbers and operators: they are compiled, and executed, without a pause


class Expressions:
    """Compiles the expressions of one scope.

    Attributes:
        count: names, numbers and operators compiled since the statement began.
    """

    def __init__(self, scope: Scope) -> None:
        self.scope = scope
        self.count = 0

    # What a place asks for ----------------------------------------------------------------------------------------

    def value(self, node: s.Expression, wanted: Type) -> Compiled:
        """The expression as a value of the type `wanted`; raises RapidReferenceError when it has another."""
        return self.fitted(self.any(node, wanted), wanted, node.line)

    def fitted(self, given: Compiled, wanted: Type, line: int) -> Compiled:
        if is_assignable(wanted, given.type):
            return given
        if isinstance(resolved(given.type), SignalType) and (wanted_value := _level_type(wanted)):
            return _level(given.evaluate, wanted_value)
        if given.is_literal and resolved(wanted) == DNUM:
            return replace(given, type=DNUM)
        self.scope.blame(line, f"{one(given.type)} is found where {one(wanted)} is needed")

    def condition(self, node: s.Expression) -> Evaluate:
        return self.value(node, BOOL).evaluate

    def operand(self, node: s.Expression) -> Compiled:
        """A value of whatever type, where no particular one is wanted."""
        return self._without_signal(self.any(node))

    def any(self, node: s.Expression, wanted: Type | None = None) -> Compiled:
        """The expression with whatever type it has; aggregates take theirs from `wanted`."""
        self.count += 1
        if self.count > MOST_IN_STATEMENT and self.scope.builder is not None:
            sentence = f"a statement has up to {MOST_IN_STATEMENT} names, numbers and operators"
            self.scope.blame(node.line, f"{sentence}: divide it, or declare its values as a constant of the module")
        compiled: Compiled = _COMPILERS[type(node)](self, node, wanted)
        return compiled

    def in_order(self, nodes: Sequence[tuple[s.Expression, Type]]) -> list[Compiled]:
        """Several expressions, evaluated from left to right even where a later one calls a routine."""
        last = -1
        if not self.scope.is_declaration:  # which calls no routines
            last = max((i for i, (node, _) in enumerate(nodes) if self.runs_routine(node)), default=-1)
        compiled = []
        for index, (node, wanted) in enumerate(nodes):
            item = self.value(node, wanted)
            compiled.append(self._kept(item) if index < last else item)
        return compiled

    # Leaves -------------------------------------------------------------------------------------------------------

    def _literal(self, node: s.Literal, wanted: Type | None) -> Compiled:
        value = node.value
        if isinstance(value, bool):
            return Compiled(lambda frame: value, BOOL)
        if isinstance(value, str):
            return Compiled(lambda frame: value, STRING)
        return Compiled(lambda frame: value, NUM, is_literal=True)

    def reference(self, node: s.Reference, wanted: Type | None) -> Compiled:
        if isinstance(node, s.Field):
            return self._field(node)
        if isinstance(node, s.Element):
            return self._element(node)
        return self._name(node)

    def _name(self, node: s.Name) -> Compiled:
        found = self.scope.find(node.name, node.line)
        if self.scope.is_declaration and not (isinstance(found, (Variable, Local)) and found.is_constant):
            self.scope.blame(node.line, f"'{node.name}' is not a constant, which a declaration needs")
        if isinstance(found, Local):
            slot = found.slot
            return Compiled(lambda frame: frame.slots[slot].value, found.type)
        if isinstance(found, Variable):
            return Compiled(lambda frame: found.value, found.type)
        if isinstance(found, Signal):
            return Compiled(lambda frame: found, SignalType("signal"))
        self.scope.blame(node.line, f"'{node.name}' is a routine or type and has no value")

    def _field(self, node: s.Field) -> Compiled:
        base = self.reference(node.base, None)
        index, type_ = self.component(base.type, node)
        evaluate = base.evaluate
        return Compiled(lambda frame: evaluate(frame)[index], type_)

    def component(self, record: Type, node: s.Field) -> tuple[int, Type]:
        """The place of a component in its record, and its type."""
        record = resolved(record)
        index = record.index(node.name) if isinstance(record, RecordType) else None
        if index is None or not isinstance(record, RecordType):
            self.scope.blame(node.line, f"{one(record)} has no component '{node.name}'")
        return index, record.components[index][1]

    def _element(self, node: s.Element) -> Compiled:
        base = self.reference(node.base, None)
        path, type_ = self.index(base.type, node)
        evaluate = base.evaluate

        def element(frame: Frame) -> Any:
            value = evaluate(frame)
            for place in path(frame, value):
                value = value[place]
            return value

        return Compiled(element, type_)

    def index(self, array: Type, node: s.Element) -> tuple[Callable[[Frame, Any], tuple[int, ...]], Type]:
        """How to compute the path to an element, counted from 0 and checked, and the element's type."""
        array = resolved(array)
        if not isinstance(array, ArrayType) or len(array.sizes) != len(node.indices):
            self.scope.blame(node.line, f"{one(array)} has no {len(node.indices)}-dimensional elements")
        evaluates = [compiled.evaluate for compiled in self.in_order([(n, NUM) for n in node.indices])]

        def path(frame: Frame, value: Any) -> tuple[int, ...]:
            places = []
            for evaluate in evaluates:
                places.append(_checked_index(evaluate(frame), len(value)))
                value = value[places[-1]]
            return tuple(places)

        return path, array.element

    # Operators ----------------------------------------------------------------------------------------------------

    def _unary(self, node: s.Unary, wanted: Type | None) -> Compiled:
        operand = self._without_signal(self.any(node.operand, wanted))
        operation = unary_operation(node.operator, operand.type)
        if operation is None:
            self.scope.blame(node.line, f"'{node.operator}' cannot be applied to {one(operand.type)}")
        evaluate = operand.evaluate
        return Compiled(lambda frame: operation(evaluate(frame)), operand.type, operand.is_literal)

    def _binary(self, node: s.Binary, wanted: Type | None) -> Compiled:
        if node.operator in {"AND", "OR"}:
            return self._logical(node)
        left, right = self._operands(node)
        found = binary_operation(node.operator, left.type, right.type)
        if found is None:
            types = f"{described(left.type)} and {described(right.type)}"
            self.scope.blame(node.line, f"'{node.operator}' cannot be applied to {types}")
        operation, type_ = found
        first, second = left.evaluate, right.evaluate
        is_literal = left.is_literal and right.is_literal
        return Compiled(lambda frame: operation(first(frame), second(frame)), type_, is_literal)

    def _operands(self, node: s.Binary) -> tuple[Compiled, Compiled]:
        """Both sides; an aggregate takes the type of the other side, a literal becomes a dnum beside one."""
        if isinstance(node.left, s.Aggregate):
            right = self.any(node.right)
            return self.value(node.left, right.type), right
        left = self.operand(node.left)
        left = self._kept(left) if self.runs_routine(node.right) else left
        right = self._without_signal(self.any(node.right, left.type))
        if left.is_literal and resolved(right.type) == DNUM:
            left = replace(left, type=DNUM)
        elif right.is_literal and resolved(left.type) == DNUM:
            right = replace(right, type=DNUM)
        return left, right

    def _logical(self, node: s.Binary) -> Compiled:
        if self.runs_routine(node.right):
            return self._logical_in_steps(node)
        left, right = self.condition(node.left), self.condition(node.right)
        if node.operator == "AND":
            return Compiled(lambda frame: left(frame) and right(frame), BOOL)
        return Compiled(lambda frame: left(frame) or right(frame), BOOL)

    def _logical_in_steps(self, node: s.Binary) -> Compiled:
        builder, end = self.builder(node.line), Target()
        slot = builder.store(self.condition(node.left))
        jump = builder.jump_unless if node.operator == "AND" else builder.jump_if
        jump(lambda frame: frame.slots[slot], end)
        builder.store(self.condition(node.right), slot)
        builder.mark(end)
        return Compiled(lambda frame: frame.slots[slot], BOOL)

    def _aggregate(self, node: s.Aggregate, wanted: Type | None) -> Compiled:
        whole, parts = self.parts(node, wanted)
        items = self.in_order(list(zip(node.items, parts, strict=True)))
        evaluates, convert = [item.evaluate for item in items], whole.convert
        return Compiled(lambda frame: convert([evaluate(frame) for evaluate in evaluates]), whole)

    def parts(self, node: s.Aggregate, wanted: Type | None) -> tuple[RecordType | ArrayType, Sequence[Type]]:
        """What an aggregate is where `wanted` is needed, and the type of each of its items."""
        record = resolved(wanted) if wanted is not None else None
        if isinstance(record, RecordType) and len(record.components) == len(node.items):
            return record, [type_ for _, type_ in record.components]
        if isinstance(record, ArrayType) and record.sizes[0] in (0, len(node.items)):
            row = ArrayType(record.element, record.sizes[1:]) if len(record.sizes) > 1 else record.element
            return ArrayType(record.element, (len(node.items), *record.sizes[1:])), [row] * len(node.items)
        is_unknown = record is None or isinstance(record, OpenType)
        what = "nothing tells its type" if record is None or is_unknown else f"{one(record)} is needed"
        self.scope.blame(node.line, f"an aggregate of {len(node.items)} is found where {what}")

    # Calls --------------------------------------------------------------------------------------------------------

    def _function_call(self, node: s.FunctionCall, wanted: Type | None) -> Compiled:
        if self.scope.is_declaration:
            self.scope.blame(node.line, "a declaration cannot call a function")
        if node.name.lower() == "present":
            return self._present(node)
        found = self.scope.find(node.name, node.line)
        if not isinstance(found, (UserRoutine, LibraryRoutine)):
            self.scope.blame(node.line, f"'{node.name}' is not a function")
        from yumi.rapid.compiler import Calls  # noqa: PLC0415 - arguments are expressions, expressions contain calls

        return Calls(self).function(found, node)

    def _present(self, node: s.FunctionCall) -> Compiled:
        argument = node.arguments[0].value if len(node.arguments) == 1 else None
        local = self.scope.locals.get(argument.name.lower()) if isinstance(argument, s.Name) else None
        if local is None or local.mode is None:
            self.scope.blame(node.line, "Present takes the name of a parameter of this routine")
        slot = local.slot
        return Compiled(lambda frame: frame.slots[slot] is not ABSENT, BOOL)

    # Order of evaluation ------------------------------------------------------------------------------------------

    def builder(self, line: int) -> CodeBuilder:
        """Where the steps of a call go; a declaration has no such place."""
        if self.scope.builder is None:
            self.scope.blame(line, "a declaration cannot call a routine")
        return self.scope.builder

    def _kept(self, compiled: Compiled) -> Compiled:
        """The value taken now, for use after a later operand has run a routine."""
        if self.scope.builder is None:
            return compiled
        slot = self.scope.builder.store(compiled.evaluate)
        return replace(compiled, evaluate=lambda frame: frame.slots[slot])

    def runs_routine(self, node: s.Expression) -> bool:
        """Whether evaluating `node` runs a routine that may take steps of its own."""
        if isinstance(node, s.FunctionCall):
            found = self.scope.program.find(node.name, self.scope.module)
            waits = isinstance(found, LibraryRoutine) and found.may_wait
            arguments = [argument.value for argument in node.arguments if argument.value is not None]
            return waits or isinstance(found, UserRoutine) or any(self.runs_routine(n) for n in arguments)
        return any(self.runs_routine(child) for child in _children(node))

    def _without_signal(self, compiled: Compiled) -> Compiled:
        """A signal beside an operator stands for its level."""
        if not isinstance(resolved(compiled.type), SignalType):
            return compiled
        return _level(compiled.evaluate, NUM)


def _children(node: s.Expression) -> tuple[s.Expression, ...]:
    if isinstance(node, s.Unary):
        return (node.operand,)
    if isinstance(node, s.Binary):
        return (node.left, node.right)
    if isinstance(node, s.Aggregate):
        return node.items
    if isinstance(node, s.Element):
        return (node.base, *node.indices)
    return (node.base,) if isinstance(node, s.Field) else ()


def _checked_index(value: float, size: int) -> int:
    if value != int(value) or not 1 <= value <= size:
        raise RapidRuntimeError("ERR_OUTOFBND", f"The index {value:g} is outside of the array, which has 1 to {size}.")
    return int(value) - 1


def _level_type(wanted: Type) -> Type | None:
    """The type a signal's level takes where `wanted` is needed."""
    wanted = resolved(wanted)
    if isinstance(wanted, OpenType):
        return NUM
    return wanted if is_numeric(wanted) else None


def _level(signal: Evaluate, type_: Type) -> Compiled:
    def level(frame: Frame) -> Any:
        return type_.convert(frame.task.read_signal(signal(frame).name))

    return Compiled(level, type_)


_COMPILERS: dict[type, Callable[[Expressions, Any, Type | None], Compiled]] = {
    s.Literal: Expressions._literal,
    s.Name: Expressions.reference,
    s.Field: Expressions.reference,
    s.Element: Expressions.reference,
    s.Unary: Expressions._unary,
    s.Binary: Expressions._binary,
    s.Aggregate: Expressions._aggregate,
    s.FunctionCall: Expressions._function_call,
}


GetPlace = Callable[["Frame"], Place]
Routine = UserRoutine | LibraryRoutine


class Places:
    """Compiles references to data that are written to."""

    def __init__(self, expressions: Expressions) -> None:
        self.expressions = expressions
        self.scope = expressions.scope

    def writable(self, node: s.Reference, storage: Sequence[s.Storage]) -> tuple[GetPlace, Type]:
        """Where the reference leads; raises RapidReferenceError when it may not be written to."""
        root = node
        while not isinstance(root, s.Name):
            root = root.base
        found = self.scope.find(root.name, root.line)
        if isinstance(found, Local):
            is_writable = not found.is_constant
        else:
            is_writable = isinstance(found, Variable) and found.storage in storage
        if not is_writable:
            self.scope.blame(root.line, f"'{root.name}' cannot be changed here")
        return self.place(node)

    def place(self, node: s.Reference) -> tuple[GetPlace, Type]:
        """Where the reference leads, and its type."""
        if isinstance(node, s.Name):
            return self._entire(node)
        get_whole, type_ = self.place(node.base)
        if isinstance(node, s.Field):
            index, component = self.expressions.component(type_, node)
            return lambda frame: Part(get_whole(frame), (index,), component), component
        path, element = self.expressions.index(type_, node)

        def element_place(frame: Frame) -> Place:
            whole = get_whole(frame)
            return Part(whole, path(frame, whole.value), element)

        return element_place, element

    def _entire(self, node: s.Name) -> tuple[GetPlace, Type]:
        found = self.scope.find(node.name, node.line)
        if isinstance(found, Local):
            slot = found.slot
            return lambda frame: frame.slots[slot], found.type
        if isinstance(found, Variable):
            return lambda frame: found, found.type
        self.scope.blame(node.line, f"'{node.name}' is not a variable")


WRITABLE = {
    s.Mode.VAR: (s.Storage.VAR,),
    s.Mode.PERS: (s.Storage.PERS,),
    s.Mode.INOUT: (s.Storage.VAR, s.Storage.PERS),
}


class Calls:
    """Compiles the calls of one scope."""

    def __init__(self, expressions: Expressions) -> None:
        self.expressions = expressions
        self.scope = expressions.scope
        self.places = Places(expressions)

    def function(self, routine: Routine, node: s.FunctionCall) -> Compiled:
        """The value of a function call; what takes steps of its own runs before the statement goes on."""
        arguments = self.arguments(routine, node.arguments, node.line)
        returns = routine.returns
        if returns is None:
            self.scope.blame(node.line, f"'{node.name}' is a procedure and gives no value")
        if isinstance(routine, LibraryRoutine) and not routine.may_wait:
            return Compiled(_immediate(routine, arguments), returns)
        builder = self.expressions.builder(node.line)
        slot = builder.new_slot()
        builder.add(entering(routine, arguments, slot))
        return Compiled(lambda frame: frame.slots[slot], returns)

    def procedure(self, routine: Routine, arguments: Sequence[s.Argument], line: int) -> None:
        """Add the steps of a procedure call or instruction."""
        places = self.arguments(routine, arguments, line)
        if routine.returns is not None or _is_trap(routine):
            self.scope.blame(line, f"'{routine.name}' cannot be called as a procedure")
        self.expressions.builder(line).add(entering(routine, places, None))

    @staticmethod
    def caller(routine: LibraryRoutine, arguments: Sequence[GetPlace]) -> Callable[[Frame], Call]:
        """How to make the `Call` that an instruction receives."""
        named = [(p.key, get_place) for p, get_place in zip(routine.parameters, arguments, strict=True)]
        name = routine.name

        def call(frame: Frame) -> Call:
            frame.task.instruction_used()
            return Call(frame.task, name, {key: get_place(frame) for key, get_place in named})

        return call

    # Arguments ----------------------------------------------------------------------------------------------------

    def arguments(self, routine: Routine, given: Sequence[s.Argument], line: int) -> list[GetPlace]:
        """For each parameter, how to get what is passed for it."""
        parameters = self._parameters(routine)
        matched = self._matched(routine.name, parameters, given, line)
        last_step = max((i for i, p in enumerate(parameters) if self._runs(matched.get(p.key))), default=-1)
        places = []
        for index, parameter in enumerate(parameters):
            place = self._argument(parameter, matched.get(parameter.key), line)
            places.append(self._kept(place) if index < last_step else place)
        return places

    def _parameters(self, routine: Routine) -> tuple[FormalParameter, ...]:
        if isinstance(routine, UserRoutine):
            return self.scope.program.link_routine(routine)
        return routine.parameters

    def _runs(self, argument: s.Argument | None) -> bool:
        return argument is not None and argument.value is not None and self.expressions.runs_routine(argument.value)

    def _kept(self, get_place: GetPlace) -> GetPlace:
        """The argument taken now, for use after a later one has run a routine."""
        assert self.scope.builder is not None
        slot = self.scope.builder.store(get_place)
        return lambda frame: frame.slots[slot]

    def _matched(
        self, name: str, parameters: Sequence[FormalParameter], given: Sequence[s.Argument], line: int
    ) -> dict[str, s.Argument]:
        """Arguments by parameter: positions for required ones, names for optional ones, alternatives once."""
        required = [p for p in parameters if p.group is None]
        matched: dict[str, s.Argument] = {}
        for argument in given:
            parameter = self._parameter_for(name, argument, required, parameters)
            if parameter.key in matched:
                self.scope.blame(line, f"'{parameter.name}' is given twice to '{name}'")
            matched[parameter.key] = argument
        if required:
            self.scope.blame(line, f"'{name}' lacks the argument '{required[0].name}'")
        self._check_alternatives(name, parameters, matched, line)
        return matched

    def _parameter_for(
        self, name: str, argument: s.Argument, required: list[FormalParameter], parameters: Sequence[FormalParameter]
    ) -> FormalParameter:
        if not argument.is_optional:
            if not required:
                self.scope.blame(argument.line, f"'{name}' has too many arguments")
            parameter = required.pop(0)
            if argument.name is not None and argument.name.lower() != parameter.key:
                self.scope.blame(argument.line, f"'{name}' needs '{parameter.name}' before '{argument.name}'")
            return parameter
        key = (argument.name or "").lower()
        found = next((p for p in parameters if p.group is not None and p.key == key), None)
        if found is None:
            self.scope.blame(argument.line, f"'{name}' has no optional argument '\\{argument.name}'")
        return found

    def _check_alternatives(
        self, name: str, parameters: Sequence[FormalParameter], matched: dict[str, s.Argument], line: int
    ) -> None:
        groups = [p.group for p in parameters if p.group is not None and self._is_certain(matched.get(p.key))]
        if len(groups) != len(set(groups)):
            self.scope.blame(line, f"'{name}' is given two arguments that exclude each other")

    @staticmethod
    def _is_certain(argument: s.Argument | None) -> bool:
        return argument is not None and argument.condition is None

    def _argument(self, parameter: FormalParameter, argument: s.Argument | None, line: int) -> GetPlace:
        if argument is None:
            return lambda frame: ABSENT
        if argument.condition is not None:
            return self._conditional(parameter, argument)
        if parameter.type == SWITCH:
            return self._switch(parameter, argument)
        if argument.value is None:
            self.scope.blame(argument.line, f"'\\{parameter.name}' needs a value: '\\{parameter.name}:=...'")
        if parameter.mode is s.Mode.VALUE:
            return self._by_value(parameter, argument.value)
        return self._by_reference(parameter, argument.value, line)

    def _switch(self, parameter: FormalParameter, argument: s.Argument) -> GetPlace:
        if argument.value is not None:
            self.scope.blame(argument.line, f"the switch '\\{parameter.name}' takes no value")
        present = Variable(parameter.name, SWITCH, True)
        return lambda frame: present

    def _conditional(self, parameter: FormalParameter, argument: s.Argument) -> GetPlace:
        name = argument.condition or ""
        local = self.scope.locals.get(name.lower())
        if local is None or not local.is_optional:
            self.scope.blame(argument.line, f"'{name}' is not an optional parameter of this routine")
        if not is_assignable(parameter.type, local.type):
            self.scope.blame(argument.line, f"'{name}' is not {one(parameter.type)}")
        slot, is_copy = local.slot, parameter.mode is s.Mode.VALUE

        def conditional(frame: Frame) -> Place:
            place: Place = frame.slots[slot]
            return Variable(place.name, place.type, place.value) if is_copy and place is not ABSENT else place

        return conditional

    def _by_value(self, parameter: FormalParameter, node: s.Expression) -> GetPlace:
        compiled = self.expressions.value(node, parameter.type)
        name, type_, evaluate = parameter.name, compiled.type, compiled.evaluate
        convert = parameter.type.convert
        return lambda frame: Variable(name, type_, convert(evaluate(frame)))

    def _by_reference(self, parameter: FormalParameter, node: s.Expression, line: int) -> GetPlace:
        if not isinstance(node, (s.Name, s.Element, s.Field)):
            self.scope.blame(line, f"'{parameter.name}' needs a datum, not an expression")
        if isinstance(resolved(parameter.type), (SignalType, ObjectType)):
            return self._handle(parameter, node)
        get_place, type_ = self.places.writable(node, WRITABLE[parameter.mode])
        if not is_assignable(parameter.type, type_):
            self.scope.blame(line, f"'{parameter.name}' needs {one(parameter.type)}, not {one(type_)}")
        return get_place

    def _handle(self, parameter: FormalParameter, node: s.Reference) -> GetPlace:
        """A signal or an object such as a mechanical unit; predefined ones count as variables."""
        compiled = self.expressions.value(node, parameter.type)
        if isinstance(node, s.Name) and isinstance(self.scope.find(node.name, node.line), Signal):
            name, type_, evaluate = parameter.name, compiled.type, compiled.evaluate
            return lambda frame: Variable(name, type_, evaluate(frame))
        return self.places.place(node)[0]


def _is_trap(routine: Routine) -> bool:
    return isinstance(routine, UserRoutine) and routine.syntax.kind is s.RoutineKind.TRAP


def _immediate(routine: LibraryRoutine, arguments: Sequence[GetPlace]) -> Evaluate:
    """A function of the library that gives its value at once."""
    assert routine.returns is not None
    call, implementation = Calls.caller(routine, arguments), routine.implementation
    convert = routine.returns.convert
    return lambda frame: convert(implementation(call(frame)))


def entering(routine: Routine, arguments: Sequence[GetPlace], slot: int | None) -> Step:
    """The step that calls a routine; a function's value goes into `slot`."""
    if isinstance(routine, UserRoutine):
        return _entering_user_routine(routine, arguments, slot)
    call, implementation = Calls.caller(routine, arguments), routine.implementation
    convert = routine.returns.convert if routine.returns is not None else None

    def execute(machine: Machine, frame: Frame) -> None:
        outcome = implementation(call(frame))
        if isinstance(outcome, Generator):
            frame.begin_wait(outcome, slot, convert)

    return execute


def _entering_user_routine(routine: UserRoutine, arguments: Sequence[GetPlace], slot: int | None) -> Step:
    def enter(machine: Machine, frame: Frame) -> None:
        machine.enter(routine, [get_place(frame) for get_place in arguments], slot)

    return enter


def late_call(calls: Calls, name: Evaluate, node: s.LateCall) -> Step:
    """The step that calls whatever procedure `name` gives."""
    scope = calls.scope
    if any(a.value is not None and calls.expressions.runs_routine(a.value) for a in node.arguments):
        scope.blame(node.line, "the arguments of a late-binding call cannot call routines; use a variable")
    known = dict(scope.locals)

    def call(machine: Machine, frame: Frame) -> None:
        called = name(frame)
        found = scope.program.find(called, scope.module)
        if not isinstance(found, (UserRoutine, LibraryRoutine)):
            raise RapidRuntimeError("ERR_REFUNKPRC", f"There is no procedure '{called}' to call.")
        scope.locals, calls.expressions.count = known, 0
        try:
            arguments = calls.arguments(found, node.arguments, node.line)
        except RapidReferenceError as error:
            raise RapidRuntimeError("ERR_CALLPROC", str(error)) from error
        entering(found, arguments, None)(machine, frame)

    return call


SIGNATURE = r"\switch InPos, bool Cond, \num MaxTime, \VAR bool TimeFlag, \num PollRate"
CONDITION = 1  # the place of Cond among the parameters


@dataclass(frozen=True, slots=True)
class Deadline:
    r"""The end of a wait with \MaxTime and \TimeFlag.

    Attributes:
        time: task time [s], infinite without \MaxTime.
    """

    call: Call
    time: float

    @staticmethod
    def of(call: Call) -> Deadline:
        return Deadline(call, call.task.now + call.get("MaxTime", math.inf))

    def is_over(self) -> bool:
        r"""Whether the time is up; sets \TimeFlag, or raises ERR_WAIT_MAXTIME without one."""
        if self.call.task.now < self.time:
            return False
        if not self.call.present("TimeFlag"):
            sentence = f"{self.call.name} has waited for {self.call['MaxTime']:g} s in vain."
            raise RapidRuntimeError("ERR_WAIT_MAXTIME", sentence)
        self.call["TimeFlag"] = True
        return True

    def met(self) -> None:
        """Note that what was waited for has come."""
        if self.call.present("TimeFlag"):
            self.call["TimeFlag"] = False

    @property
    def wake(self) -> float | None:
        return None if math.isinf(self.time) else self.time


def wait_until(calls: Calls, node: s.ProcedureCall) -> None:
    """Add the steps of WaitUntil: the condition, whatever it calls, is computed anew at each advance."""
    builder = calls.expressions.builder(node.line)
    library = calls.scope.program.library
    instruction = LibraryRoutine("WaitUntil", library.formal(SIGNATURE), None, lambda call: None, may_wait=False)
    conditions = [a for a in node.arguments if not a.is_optional and a.value is not None]
    if len(conditions) != 1 or conditions[0].value is None:
        calls.scope.blame(node.line, "WaitUntil needs one condition")
    placeholder = s.Argument(None, s.Literal(True, node.line), False, node.line)
    given = [placeholder if a is conditions[0] else a for a in node.arguments]
    call = calls.caller(instruction, calls.arguments(instruction, given, node.line))
    slot = builder.store(lambda frame: Deadline.of(call(frame)))
    again = builder.here()
    condition = calls.expressions.condition(conditions[0].value)
    builder.add(_deciding(condition, slot, again))


def _deciding(condition: Evaluate, slot: int, again: Target) -> Step:
    def decide(machine: Machine, frame: Frame) -> None:
        deadline: Deadline = frame.slots[slot]
        if deadline.call.task.is_settled(deadline.call) and condition(frame):
            deadline.met()
        elif not deadline.is_over():
            frame.begin_wait(_until_next_look(deadline), None, None)
            frame.step = again.step

    return decide


def _until_next_look(deadline: Deadline) -> Generator[float | None, None, None]:
    yield deadline.wake


Compilation = Generator[None, None, Code]
"""A routine on its way to its code, with pauses."""


def compile_routine(program: Program, routine: UserRoutine) -> Code:
    """The steps of a routine; raises RapidReferenceError for what does not fit."""
    compilation = compiling(program, routine)
    while (code := advanced(compilation)) is None:
        pass
    return code


def advanced(compilation: Compilation) -> Code | None:
    """Compile until the next pause; the code once it is complete."""
    try:
        next(compilation)
    except StopIteration as end:
        code: Code = end.value
        return code
    return None


def compiling(program: Program, routine: UserRoutine) -> Compilation:
    """Compile a routine bit by bit: a pause after each statement, since long ones take seconds.

    Raises:
        RapidReferenceError: something does not fit.
    """
    statements = Statements(program, routine)
    try:
        return (yield from statements.compiled())
    except RecursionError:
        statements.scope.blame(routine.syntax.line, f"the statements of '{routine.name}' are nested too deeply")


class Statements:
    """Compiles the statements of one routine."""

    def __init__(self, program: Program, routine: UserRoutine) -> None:
        self.routine = routine
        self.builder = CodeBuilder(routine.syntax.line)
        self.scope = Scope(program, routine.module, self.builder)
        self.expressions = Expressions(self.scope)
        self.places = Places(self.expressions)
        self.calls = Calls(self.expressions)
        self.labels: dict[str, Target] = {}
        self.in_handler = False

    def compiled(self) -> Compilation:
        declared = self.routine.syntax
        self._declare_parameters()
        for datum in declared.locals:
            self._declare(datum)
            yield
        yield from self._block(declared.body)
        self._end()
        if declared.handler is not None:
            yield from self._handler(declared.handler)
        return self.builder.code

    # Declarations -------------------------------------------------------------------------------------------------

    def _declare_parameters(self) -> None:
        for parameter in self.scope.program.link_routine(self.routine):
            local = Local(
                self.builder.new_slot(), parameter.type, mode=parameter.mode, is_optional=parameter.group is not None
            )
            self._add_local(parameter.name, local, self.routine.syntax.line)

    def _add_local(self, name: str, local: Local, line: int) -> None:
        if name.lower() in self.scope.locals:
            self.scope.blame(line, f"'{name}' is declared twice in '{self.routine.name}'")
        self.scope.locals[name.lower()] = local

    def _declare(self, datum: s.Data) -> None:
        self.expressions.count = 0
        self.scope.is_declaration = True
        type_, initial = declared_value(self.expressions, datum)
        self.scope.is_declaration = False
        slot, name = self.builder.new_slot(), datum.name
        self.builder.code.value_count += value_count(type_)

        def declare(machine: Machine, frame: Frame) -> None:
            frame.slots[slot] = Variable(name, type_, initial(frame))

        with self.builder.statement(datum.line):
            self.builder.add(declare)
        self._add_local(name, Local(slot, type_, is_constant=datum.storage is s.Storage.CONST), datum.line)

    # Structure ----------------------------------------------------------------------------------------------------

    def _block(self, block: s.Block) -> Generator[None, None, None]:
        """A statement list; its labels can be reached from inside of it and of its statements."""
        outer = self.labels
        found = {n.name.lower(): Target() for n in block if isinstance(n, s.Label)}
        self.labels = {**outer, **found}
        for statement in block:
            self.expressions.count = 0
            with self.builder.statement(statement.line):
                inner = _STATEMENTS_COMPILERS[type(statement)](self, statement)
                if inner is not None:
                    yield from inner
            yield
        self.labels = outer

    def _end(self) -> None:
        """What happens when the last statement is done."""
        name, is_function = self.routine.name, self.routine.syntax.kind is s.RoutineKind.FUNC

        def end(machine: Machine, frame: Frame) -> None:
            if is_function:
                raise RapidRuntimeError("ERR_FNCNORET", f"The function '{name}' ended without a RETURN.")
            machine.leave(None)

        with self.builder.statement(self.routine.syntax.line):
            self.builder.add(end)

    def _handler(self, handler: s.Handler) -> Generator[None, None, None]:
        numbers = tuple(self.expressions.value(n, NUM).evaluate for n in handler.numbers)
        self.builder.code.handler = HandlerCode(self.builder.here().step, numbers)
        self.in_handler = True
        yield from self._block(handler.body)
        self._end()

    # Simple statements --------------------------------------------------------------------------------------------

    def _assignment(self, node: s.Assignment) -> None:
        get_place, type_ = self.places.writable(node.target, (s.Storage.VAR, s.Storage.PERS))
        evaluate = self.expressions.value(node.value, type_).evaluate
        self.builder.add(_assigning(get_place, type_.convert, evaluate))

    def _call(self, node: s.ProcedureCall) -> None:
        if node.name.lower() == "waituntil":
            wait_until(self.calls, node)
            return
        found = self.scope.find(node.name, node.line)
        if not isinstance(found, (UserRoutine, LibraryRoutine)):
            self.scope.blame(node.line, f"'{node.name}' is not a procedure or instruction")
        self.calls.procedure(found, node.arguments, node.line)

    def _late_call(self, node: s.LateCall) -> None:
        name = self.expressions.value(node.name, STRING).evaluate
        self.builder.add(late_call(self.calls, name, node))

    def _goto(self, node: s.Goto) -> None:
        target = self.labels.get(node.label.lower())
        if target is None:
            self.scope.blame(node.line, f"there is no label '{node.label}' that this GOTO could reach")
        self.builder.jump(target)

    def _label(self, node: s.Label) -> None:
        self.builder.mark(self.labels[node.name.lower()])

    def _return(self, node: s.Return) -> None:
        returns = self.routine.returns
        if (node.value is None) != (returns is None):
            what = "takes no value" if returns is None else f"needs a value of type {described(returns)}"
            self.scope.blame(node.line, f"RETURN {what} in '{self.routine.name}'")
        if node.value is None or returns is None:
            self.builder.add(lambda machine, frame: machine.leave(None))
            return
        evaluate, convert = self.expressions.value(node.value, returns).evaluate, returns.convert
        self.builder.add(lambda machine, frame: machine.leave(convert(evaluate(frame))))

    def _raise(self, node: s.Raise) -> None:
        if node.number is not None:
            evaluate = self.expressions.value(node.number, NUM).evaluate
            self.builder.add(lambda machine, frame: machine.raise_number(frame, evaluate(frame)))
            return
        self._only_in_handler("RAISE without a number", node.line)
        self.builder.add(lambda machine, frame: machine.raise_again(frame))

    def _exit(self, node: s.Exit) -> None:
        self.builder.add(lambda machine, frame: machine.exit())

    def _retry(self, node: s.Retry) -> None:
        self._only_in_handler("RETRY", node.line)
        self.builder.add(lambda machine, frame: frame.retry())

    def _trynext(self, node: s.TryNext) -> None:
        self._only_in_handler("TRYNEXT", node.line)
        self.builder.add(lambda machine, frame: frame.try_next())

    def _only_in_handler(self, what: str, line: int) -> None:
        if not self.in_handler:
            self.scope.blame(line, f"{what} may only stand in an error handler")

    def _connect(self, node: s.Connect) -> None:
        get_place, type_ = self.places.writable(node.target, (s.Storage.VAR,))
        trap = self.scope.find(node.trap, node.line)
        if type_.name != "intnum" or not isinstance(trap, UserRoutine) or trap.syntax.kind is not s.RoutineKind.TRAP:
            self.scope.blame(node.line, "CONNECT takes a VAR intnum and the name of a TRAP")
        self.builder.add(lambda machine, frame: machine.connect(get_place(frame), trap))

    # Compound statements ------------------------------------------------------------------------------------------

    def _if(self, node: s.If) -> Generator[None, None, None]:
        end = Target()
        for condition, block in node.branches:
            following = Target()
            self.builder.jump_unless(self.expressions.condition(condition), following)
            yield from self._block(block)
            self.builder.jump(end)
            self.builder.mark(following)
        yield from self._block(node.otherwise)
        self.builder.mark(end)

    def _while(self, node: s.While) -> Generator[None, None, None]:
        start, end = self.builder.here(), Target()
        self.builder.jump_unless(self.expressions.condition(node.condition), end)
        yield from self._block(node.body)
        self.builder.jump(start)
        self.builder.mark(end)

    def _for(self, node: s.For) -> Generator[None, None, None]:
        bounds = [(node.first, NUM), (node.last, NUM), *([(node.step, NUM)] if node.step else [])]
        kept = [self.builder.store(c.evaluate) for c in self.expressions.in_order(bounds)]
        if node.step is None:
            kept.append(self.builder.store(_default_step(kept[0], kept[1])))
        outer, slot = self.scope.locals, self.builder.new_slot()
        self.scope.locals = {**outer, node.variable.lower(): Local(slot, NUM, is_constant=True)}
        start, end = self.builder.here(), Target()
        with self.builder.statement(node.line):
            self.builder.jump_unless(_loop_test(kept[0], kept[1], kept[2], slot, node.variable), end)
        yield from self._block(node.body)
        self.builder.add(_loop_advance(kept[0], kept[2]))
        self.builder.jump(start)
        self.builder.mark(end)
        self.scope.locals = outer

    def _test(self, node: s.Test) -> Generator[None, None, None]:
        value = self.expressions.operand(node.value)
        slot, end = self.builder.store(value.evaluate), Target()
        for values, block in node.cases:
            matched, following = Target(), Target()
            for case in values:
                self.builder.jump_if(self._is_case(slot, value.type, case), matched)
            self.builder.jump(following)
            self.builder.mark(matched)
            yield from self._block(block)
            self.builder.jump(end)
            self.builder.mark(following)
        yield from self._block(node.otherwise)
        self.builder.mark(end)

    def _is_case(self, slot: int, type_: Type, node: s.Expression) -> Evaluate:
        case = self.expressions.value(node, type_)
        if binary_operation("=", type_, case.type) is None:
            self.scope.blame(node.line, f"{one(type_)} cannot be compared with {one(case.type)}")
        evaluate = case.evaluate
        return lambda frame: frame.slots[slot] == evaluate(frame)


def _assigning(get_place: GetPlace, convert: Callable[[Any], Any], evaluate: Evaluate) -> Step:
    def assign(machine: Machine, frame: Frame) -> None:
        get_place(frame).value = convert(evaluate(frame))

    return assign


def _default_step(first: int, last: int) -> Evaluate:
    return lambda frame: 1.0 if frame.slots[first] <= frame.slots[last] else -1.0


def _loop_test(counter: int, last: int, step: int, slot: int, name: str) -> Evaluate:
    def goes_on(frame: Frame) -> bool:
        value = frame.slots[counter]
        frame.slots[slot] = Variable(name, NUM, value)
        is_rising: bool = frame.slots[step] >= 0.0
        return bool(value <= frame.slots[last] if is_rising else value >= frame.slots[last])

    return goes_on


def _loop_advance(counter: int, step: int) -> Step:
    def advance(machine: Machine, frame: Frame) -> None:
        frame.slots[counter] += frame.slots[step]

    return advance


def declared_type(expressions: Expressions, datum: s.Data) -> Type:
    """The type of a declared datum."""
    scope = expressions.scope
    type_ = scope.program.type_named(datum.type_name, scope.module, datum.line)
    if datum.dimensions:
        type_ = ArrayType(type_, _sizes(expressions, datum))
        if holds_objects(type_) and value_count(type_) > MOST_OBJECTS:
            sentence = f"the array '{datum.name}' of {type_.name} would hold {value_count(type_)} values"
            scope.blame(datum.line, f"{sentence}, there is memory for {MOST_OBJECTS}")
    if datum.initial is None and datum.storage is s.Storage.CONST:
        scope.blame(datum.line, f"the constant '{datum.name}' needs a value")
    return type_


def declared_value(expressions: Expressions, datum: s.Data) -> tuple[Type, Evaluate]:
    """The type of a declared datum and how its first value is computed."""
    type_ = declared_type(expressions, datum)
    if datum.initial is None:
        return type_, lambda frame: type_.default()
    evaluate, convert = expressions.value(datum.initial, type_).evaluate, type_.convert
    return type_, lambda frame: convert(evaluate(frame))


def _sizes(expressions: Expressions, datum: s.Data) -> tuple[int, ...]:
    try:
        sizes = tuple(expressions.value(n, NUM).evaluate(CONSTANT_FRAME) for n in datum.dimensions)
    except (RapidRuntimeError, ArithmeticError) as error:
        expressions.scope.blame(datum.line, f"the sizes of '{datum.name}' cannot be computed: {error}")
    if not 1 <= len(sizes) <= 3 or not all(1 <= size == size // 1 for size in sizes):
        expressions.scope.blame(datum.line, f"the array '{datum.name}' needs one to three sizes of at least 1")
    if math.prod(sizes) > LARGEST_ARRAY:
        sentence = f"the array '{datum.name}' would have {math.prod(sizes):.0f} elements, there is memory for"
        expressions.scope.blame(datum.line, f"{sentence} {LARGEST_ARRAY}")
    return tuple(int(size) for size in sizes)


CONSTANT_FRAME: Any = None  # constant expressions do not look at the frame

_STATEMENTS_COMPILERS: dict[type, Callable[[Statements, Any], Generator[None, None, None] | None]] = {
    s.Assignment: Statements._assignment,
    s.ProcedureCall: Statements._call,
    s.LateCall: Statements._late_call,
    s.Goto: Statements._goto,
    s.Label: Statements._label,
    s.Return: Statements._return,
    s.Raise: Statements._raise,
    s.Exit: Statements._exit,
    s.Retry: Statements._retry,
    s.TryNext: Statements._trynext,
    s.Connect: Statements._connect,
    s.If: Statements._if,
    s.While: Statements._while,
    s.For: Statements._for,
    s.Test: Statements._test,
}


MOST_VALUES = 500_000  # of a task's data: 2 MB of num, less than a controller has
LINKED_AT_ONCE = 200  # values, of a task whose clock stands still


def loaded(module: s.Module) -> LoadedModule:
    """A module with its names declared but nothing looked up; raises RapidReferenceError for a name used twice."""
    result = LoadedModule(module)
    types: tuple[s.Record | s.Alias, ...] = (*module.records, *module.aliases)
    for declared in types:
        _declare(result, declared.name, UserType(result, declared), declared.line)
    for datum in module.data:
        variable = Variable(datum.name, UNSET, storage=datum.storage, is_local=datum.is_local, is_task=datum.is_task)
        _declare(result, datum.name, variable, datum.line)
        result.data[variable] = datum
    for routine in module.routines:
        _declare(result, routine.name, UserRoutine(result, routine), routine.line)
    return result


def _declare(module: LoadedModule, name: str, symbol: Variable | UserRoutine | UserType, line: int) -> None:
    if name.lower() in module.symbols:
        raise blamed(module, line, f"'{name}' is declared twice")
    module.symbols[name.lower()] = symbol


class Linker:
    """Gives values to the data of a program, each after those it refers to."""

    def __init__(self, program: Program) -> None:
        self.program = program

    def link_data(self) -> None:
        for module in self.program.modules.values():
            for variable in module.data:
                self.link(variable, module)

    def linking(self, module: LoadedModule) -> Iterator[None]:
        """Link the data of a module that is not part of the program yet, with pauses; raises RapidReferenceError."""
        for variable in tuple(module.data):
            yield from self._linking(variable, module, frozenset())
            yield

    def check_routines(self) -> None:
        """Compile every routine; raises RapidReferenceError for the first thing that does not fit."""
        for routine in self.program.routines():
            if routine.code is None:
                routine.code = compile_routine(self.program, routine)

    def link(self, variable: Variable, module: LoadedModule) -> None:
        """Type and first value of a datum, and before that of the constants it is made from."""
        for _ in self._linking(variable, module, frozenset()):
            pass

    def _linking(
        self, variable: Variable, module: LoadedModule, users: frozenset[Variable]
    ) -> Generator[None, None, None]:
        """Link a datum that `users` are made from, with a pause after each value."""
        datum = module.data.get(variable)  # none of a module that was unloaded in a pause
        if variable.value is not UNSET or datum is None:
            return
        if variable in users:
            raise blamed(module, datum.line, f"the value of '{datum.name}' depends on itself")
        users |= {variable}
        expressions = Expressions(Scope(self.program, module))
        try:
            for dimension in datum.dimensions:
                yield from self._linking_named(dimension, module, users)
            type_ = declared_type(expressions, datum)
            self._check_memory(type_, datum, module)
            if datum.initial is None:
                value = type_.default()
            else:
                value = yield from self._value(expressions, datum, datum.initial, type_, users)
        except RecursionError:
            raise blamed(module, datum.line, f"the value of '{datum.name}' is nested too deeply") from None
        if variable.value is UNSET:  # nobody needed it in a pause
            variable.type, variable.value = type_, value
            variable.initial = UNSET if holds_objects(type_) else value
            module.value_count += value_count(type_)

    def _value(
        self, expressions: Expressions, datum: s.Data, node: s.Expression, type_: Type, users: frozenset[Variable]
    ) -> Generator[None, None, Any]:
        """The value of a constant expression, with a pause after each item of an aggregate."""
        if isinstance(node, s.Aggregate):
            whole, parts = expressions.parts(node, type_)
            items = []
            for item, part in zip(node.items, parts, strict=True):
                items.append((yield from self._value(expressions, datum, item, part, users)))
                yield
            return whole.value_class._make(items) if isinstance(whole, RecordType) else tuple(items)
        module = expressions.scope.module
        yield from self._linking_named(node, module, users)
        evaluate = expressions.value(node, type_).evaluate
        try:
            return type_.convert(evaluate(CONSTANT_FRAME))
        except (RapidError, ArithmeticError) as error:
            raise blamed(module, datum.line, f"the value of '{datum.name}' cannot be computed: {error}") from error

    def _check_memory(self, type_: Type, datum: s.Data, module: LoadedModule) -> None:
        others = (m for name, m in self.program.modules.items() if name != module.name.lower())
        wanted = sum(m.value_count for m in others) + module.value_count + value_count(type_)
        if wanted > MOST_VALUES:
            raise ProgramTooLarge(
                f"{module.name}, line {datum.line}: with '{datum.name}' the data of the task would hold {wanted} "
                f"values, there is memory for {MOST_VALUES}."
            )

    def _linking_named(
        self, node: s.Expression, module: LoadedModule, users: frozenset[Variable]
    ) -> Generator[None, None, None]:
        """Link the data that a constant expression refers to."""
        for name in _names(node):
            found = self.program.find(name, module)
            if isinstance(found, Variable) and found.value is UNSET:
                owner = next(m for m in (module, *self.program.modules.values()) if found in m.data)
                yield from self._linking(found, owner, users)

    def initialise_variables(self) -> None:
        """Give each VAR its first value again, as PP to main does."""
        for module in self.program.modules.values():
            for variable in module.data:
                if variable.storage is s.Storage.VAR:
                    variable.value = variable.type.default() if variable.initial is UNSET else variable.initial


def _names(node: s.Expression) -> Iterator[str]:
    """The data an expression of a declaration refers to."""
    if isinstance(node, s.Name):
        yield node.name
    elif isinstance(node, (s.Element, s.Field)):
        yield from _names(node.base)
    if isinstance(node, s.Unary):
        children: tuple[s.Expression, ...] = (node.operand,)
    elif isinstance(node, s.Binary):
        children = (node.left, node.right)
    elif isinstance(node, s.Aggregate):
        children = node.items
    elif isinstance(node, s.FunctionCall):
        children = tuple(a.value for a in node.arguments if a.value is not None)
    else:
        children = node.indices if isinstance(node, s.Element) else ()
    for child in children:
        yield from _names(child)
