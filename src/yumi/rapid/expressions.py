"""Expressions: compiled to closures that give a value from a frame, with their type known beforehand."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NoReturn

from yumi.rapid import syntax as s
from yumi.rapid.code import CodeBuilder, Evaluate, Target
from yumi.rapid.data import ABSENT, Variable
from yumi.rapid.errors import RapidRuntimeError
from yumi.rapid.library import LibraryRoutine
from yumi.rapid.operators import binary_operation, unary_operation
from yumi.rapid.scope import Found, LoadedModule, Local, Program, UserRoutine, blamed
from yumi.rapid.types import (
    BOOL,
    DNUM,
    NUM,
    STRING,
    ArrayType,
    OpenType,
    RecordType,
    Signal,
    SignalType,
    Type,
    described,
    is_assignable,
    is_numeric,
    one,
    resolved,
)

if TYPE_CHECKING:
    from yumi.rapid.frame import Frame


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
        from yumi.rapid.calls import Calls  # noqa: PLC0415 - arguments are expressions, expressions contain calls

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
