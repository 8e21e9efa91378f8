"""Expressions, references to data, and calls: compiled to closures that give a value, a datum or a step from a frame.

The type of each is known beforehand. What may take steps of its own (a function of the program, a function that
waits) is called before the statement goes on; operands to the left of it are kept in slots.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, NoReturn

from virtual_irc5.rapid import ast as s
from virtual_irc5.rapid.call import Call
from virtual_irc5.rapid.code_builder import CodeBuilder
from virtual_irc5.rapid.frame import Evaluate, RoutineFrame, Stack, Step, Target
from virtual_irc5.rapid.loaded_modules import LoadedModule, UserRoutine, fault_in_module
from virtual_irc5.rapid.program import FoundName, Local, Program, Signature
from virtual_irc5.rapid.rapid_library import FormalParameter, LibraryRoutine, is_robotware_name
from virtual_irc5.rapid.types import (
    ABSENT_DATA,
    ANY_NUM,
    ANY_VALUE,
    BOOL,
    DI_OR_BOOL,
    DNUM,
    NUM,
    STRING,
    SWITCH,
    UNSET_DATA,
    ArrayType,
    DatumPart,
    NotProvided,
    ObjectType,
    OpenType,
    ProtectedVariable,
    RapidReferenceError,
    RapidRuntimeError,
    RapidSignalType,
    RecordType,
    Reference,
    Signal,
    Type,
    Unresolved,
    UnresolvedFunction,
    Variable,
    binary_operation,
    is_assignable,
    is_numeric,
    resolved_type,
    single_precision,
    type_text,
    type_with_article,
    unary_operation,
)

_MOST_IN_STATEMENT = 2000  # names, numbers and operators: they are executed without a pause
_GetReference = Callable[[RoutineFrame], Reference]
_Routine = UserRoutine | LibraryRoutine
_WRITABLE = {
    s.ParameterMode.VAR: (s.Storage.VAR,),
    s.ParameterMode.PERS: (s.Storage.PERS,),
    s.ParameterMode.INOUT: (s.Storage.VAR, s.Storage.PERS),
}


@dataclass(frozen=True, slots=True)
class CompiledExpression:
    """An expression ready to evaluate; a `is_literal` number may stand for a num or a dnum."""

    evaluate: Evaluate
    type: Type
    is_literal: bool = False


class Scope:
    """The names a piece of code sees: those of its routine, its module, other modules, the library, I/O signals.

    Attributes:
        builder: where its steps go, None for the data of a module.
        is_declaration: whether the expression must be constant, as the first value of a datum is.
        faults: data of the routine whose declaration names what nothing declares, and why.
    """

    def __init__(self, program: Program, module: LoadedModule, builder: CodeBuilder | None = None) -> None:
        self.program = program
        self.module = module
        self.builder = builder
        self.locals: dict[str, Local] = {}
        self.faults: dict[str, str] = {}
        self.is_declaration = builder is None

    def find(self, name: str, node: s.Node, kind: type[Unresolved] = Unresolved) -> FoundName:
        """What a name means here; raises the kind of Unresolved where nothing declares it."""
        key = name.lower()
        local = self.locals.get(key)
        if local is not None:
            return local
        if self.builder is not None:
            self.builder.code.names.add(key)
        if key in self.faults:
            raise fault_in_module(self.module, node, f"'{name}' cannot be used: {self.faults[key]}", Unresolved)
        found = self.program.find(name, self.module) or self.program.find_signal(name)
        if found is None and (name.startswith("<") or is_robotware_name(name)):
            what = "an instruction or function of RobotWare that is not provided here"
            what = "a placeholder: complete the statement" if name.startswith("<") else what
            raise fault_in_module(self.module, node, f"'{name}' is {what}", NotProvided)
        if found is None:
            raise fault_in_module(self.module, node, f"'{name}' is not declared, and no signal has that name", kind)
        if isinstance(found, Variable) and found.value is UNSET_DATA:
            raise fault_in_module(self.module, node, f"'{name}' cannot be used: {found.fault.rstrip('.')}", Unresolved)
        return found

    def refuse(self, node: s.Node, sentence: str) -> NoReturn:
        raise fault_in_module(self.module, node, sentence)


_LEAVES = (s.Literal, s.Name)


class Expressions:
    """Compiles the expressions of one scope.

    Attributes:
        count: names, numbers and operators compiled since the statement began.
    """

    def __init__(self, scope: Scope) -> None:
        self.scope = scope
        self.calls = Calls(self)
        self.count = 0

    # Values of a given type ----------------------------------------------------------------------------------------

    def value(self, node: s.Expression, wanted: Type) -> CompiledExpression:
        """The expression as a value of the type `wanted`; raises RapidReferenceError when it has another."""
        return self.fitted(self.any(node, wanted), wanted, node)

    def fitted(self, given: CompiledExpression, wanted: Type, node: s.Node) -> CompiledExpression:
        if is_assignable(wanted, given.type):
            return given
        if isinstance(resolved_type(given.type), RapidSignalType):
            wanted_type = resolved_type(wanted)  # a signal stands for its level where a number is needed
            if isinstance(wanted_type, OpenType) or is_numeric(wanted_type):
                return _level(given.evaluate, NUM if isinstance(wanted_type, OpenType) else wanted_type)
        if given.is_literal and resolved_type(wanted) == DNUM:
            return replace(given, type=DNUM)
        self.scope.refuse(node, f"{type_with_article(given.type)} is found where {type_with_article(wanted)} is needed")

    def condition(self, node: s.Expression) -> Evaluate:
        return self.value(node, BOOL).evaluate

    def operand(self, node: s.Expression) -> CompiledExpression:
        """A value of whatever type, where no particular one is wanted."""
        return self._without_signal(self.any(node))

    def any(self, node: s.Expression, wanted: Type | None = None) -> CompiledExpression:
        """The expression with whatever type it has; aggregates take theirs from `wanted`."""
        self.count += 1
        if self.count > _MOST_IN_STATEMENT and self.scope.builder is not None:
            sentence = f"a statement has up to {_MOST_IN_STATEMENT} names, numbers and operators"
            self.scope.refuse(node, f"{sentence}: divide it, or declare its values as a constant of the module")
        return _COMPILERS[type(node)](self, node, wanted)

    def in_order(self, nodes: Sequence[tuple[s.Expression, Type]]) -> list[CompiledExpression]:
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

    def literal(self, node: s.Literal, wanted: Type | None) -> CompiledExpression:
        value = node.value
        if isinstance(value, bool):
            return CompiledExpression(lambda frame: value, BOOL)
        if isinstance(value, str):
            return CompiledExpression(lambda frame: value, STRING)
        if wanted in (ANY_NUM, ANY_VALUE) and not _fits_num(value):
            # The manual's ValToStr(1.234567890123456789) has 15 digits.
            return CompiledExpression(lambda frame: value, DNUM)
        return CompiledExpression(lambda frame: value, NUM, is_literal=True)

    def name(self, node: s.Name, wanted: Type | None) -> CompiledExpression:
        found = self.scope.find(node.name, node)
        if self.scope.is_declaration and not (isinstance(found, (Variable, Local)) and found.is_constant):
            self.scope.refuse(node, f"'{node.name}' is not a constant, which a declaration needs")
        if isinstance(found, Local):
            slot = found.slot
            return CompiledExpression(lambda frame: frame.slots[slot].value, found.type)
        if isinstance(found, Variable):
            return CompiledExpression(lambda frame: found.value, found.type)
        if isinstance(found, Signal):
            return CompiledExpression(lambda frame: found, RapidSignalType("signal"))
        self.scope.refuse(node, f"'{node.name}' is a routine or type and has no value")

    def field(self, node: s.Field, wanted: Type | None) -> CompiledExpression:
        base = self.any(node.base)
        index, type_ = self.component(base.type, node)
        evaluate = base.evaluate
        return CompiledExpression(lambda frame: evaluate(frame)[index], type_)

    def component(self, record: Type, node: s.Field) -> tuple[int, Type]:
        """The index of a component in its record, and its type."""
        record = resolved_type(record)
        index = record.index(node.name) if isinstance(record, RecordType) else None
        if index is None or not isinstance(record, RecordType):
            self.scope.refuse(node, f"{type_with_article(record)} has no component '{node.name}'")
        return index, record.components[index][1]

    def element(self, node: s.Element, wanted: Type | None) -> CompiledExpression:
        base = self.any(node.base)
        path, type_ = self.index(base.type, node)
        evaluate = base.evaluate

        def element(frame: RoutineFrame) -> Any:
            value = evaluate(frame)
            for index in path(frame, value):
                value = value[index]
            return value

        return CompiledExpression(element, type_)

    def index(self, array: Type, node: s.Element) -> tuple[Callable[[RoutineFrame, Any], tuple[int, ...]], Type]:
        """How to compute the path to an element, counted from 0 and checked, and the element's type."""
        array = resolved_type(array)
        if not isinstance(array, ArrayType) or len(array.sizes) != len(node.indices):
            self.scope.refuse(node, f"{type_with_article(array)} has no {len(node.indices)}-dimensional elements")
        evaluates = [compiled.evaluate for compiled in self.in_order([(n, NUM) for n in node.indices])]

        def path(frame: RoutineFrame, value: Any) -> tuple[int, ...]:
            found = []
            for evaluate in evaluates:
                position = evaluate(frame)
                if position != int(position) or not 1 <= position <= len(value):
                    sentence = f"The index {position:g} is outside of the array, which has 1 to {len(value)}."
                    raise RapidRuntimeError("ERR_OUTOFBND", sentence)
                found.append(int(position) - 1)
                value = value[found[-1]]
            return tuple(found)

        return path, array.element

    # Operators ----------------------------------------------------------------------------------------------------

    def unary(self, node: s.Unary, wanted: Type | None) -> CompiledExpression:
        operand = self._without_signal(self.any(node.operand, wanted))
        operation = unary_operation(node.operator, operand.type)
        if operation is None:
            self.scope.refuse(node, f"'{node.operator}' cannot be applied to {type_with_article(operand.type)}")
        evaluate = operand.evaluate
        return CompiledExpression(lambda frame: operation(evaluate(frame)), operand.type, operand.is_literal)

    def binary(self, node: s.Binary, wanted: Type | None) -> CompiledExpression:
        if node.operator in {"AND", "OR"}:
            return self._logical(node)
        if isinstance(node.left, s.Aggregate):  # it takes the type of the other side
            right = self.any(node.right)
            left = self.value(node.left, right.type)
        else:
            left = self.operand(node.left)
            left = self._kept(left) if self.runs_routine(node.right) else left
            right = self._without_signal(self.any(node.right, left.type))
        # A literal is a dnum beside one.
        if left.is_literal and resolved_type(right.type) == DNUM:
            left = replace(left, type=DNUM)
        elif right.is_literal and resolved_type(left.type) == DNUM:
            right = replace(right, type=DNUM)
        # Beside a num it is as exact as one.
        elif left.is_literal and not right.is_literal and resolved_type(right.type) == NUM:
            left = _rounded(left, node.left)
        elif right.is_literal and not left.is_literal and resolved_type(left.type) == NUM:
            right = _rounded(right, node.right)
        found = binary_operation(node.operator, left.type, right.type)
        if found is None:
            types = f"{type_text(left.type)} and {type_text(right.type)}"
            self.scope.refuse(node, f"'{node.operator}' cannot be applied to {types}")
        operation, type_ = found
        first, second = left.evaluate, right.evaluate
        is_literal = left.is_literal and right.is_literal
        return CompiledExpression(lambda frame: operation(first(frame), second(frame)), type_, is_literal)

    def _logical(self, node: s.Binary) -> CompiledExpression:
        """AND and OR: the right side is evaluated only when the left one has not decided."""
        if self.runs_routine(node.right):
            builder, end = self.builder(node), Target()
            slot = builder.store(self.condition(node.left))
            jump = builder.jump_unless if node.operator == "AND" else builder.jump_if
            jump(lambda frame: frame.slots[slot], end)
            builder.store(self.condition(node.right), slot)
            builder.mark(end)
            return CompiledExpression(lambda frame: frame.slots[slot], BOOL)
        left, right = self.condition(node.left), self.condition(node.right)
        if node.operator == "AND":
            return CompiledExpression(lambda frame: left(frame) and right(frame), BOOL)
        return CompiledExpression(lambda frame: left(frame) or right(frame), BOOL)

    def aggregate(self, node: s.Aggregate, wanted: Type | None) -> CompiledExpression:
        whole, parts = self.parts(node, wanted)
        items = self.in_order(list(zip(node.items, parts, strict=True)))
        evaluates, convert = [item.evaluate for item in items], whole.convert
        return CompiledExpression(lambda frame: convert([evaluate(frame) for evaluate in evaluates]), whole)

    def parts(self, node: s.Aggregate, wanted: Type | None) -> tuple[RecordType | ArrayType, Sequence[Type]]:
        """The type of an aggregate where `wanted` is needed, and that of each of its items."""
        record = resolved_type(wanted) if wanted is not None else None
        if isinstance(record, RecordType) and len(record.components) == len(node.items):
            return record, [type_ for _, type_ in record.components]
        if isinstance(record, ArrayType) and record.sizes[0] in (0, len(node.items)):
            return ArrayType(record.element, (len(node.items), *record.sizes[1:])), [record.row] * len(node.items)
        is_unknown = record is None or isinstance(record, OpenType)
        what = "its type is unknown" if record is None or is_unknown else f"{type_with_article(record)} is needed"
        self.scope.refuse(node, f"an aggregate of {len(node.items)} is found where {what}")

    # Calls --------------------------------------------------------------------------------------------------------

    def function_call(self, node: s.FunctionCall, wanted: Type | None) -> CompiledExpression:
        if self.scope.is_declaration:
            self.scope.refuse(node, "a declaration cannot call a function")
        if node.name.lower() == "present":
            argument = node.arguments[0].value if len(node.arguments) == 1 else None
            local = self.scope.locals.get(argument.name.lower()) if isinstance(argument, s.Name) else None
            if local is None or local.mode is None:
                self.scope.refuse(node, "Present takes the name of a parameter of this routine")
            slot = local.slot
            return CompiledExpression(lambda frame: frame.slots[slot] is not ABSENT_DATA, BOOL)
        found = self.scope.find(node.name, node, UnresolvedFunction)
        if not isinstance(found, (UserRoutine, LibraryRoutine)):
            self.scope.refuse(node, f"'{node.name}' is not a function")
        return self.calls.function(found, node)

    # References to data -------------------------------------------------------------------------------------------

    def writable(
        self, node: s.Reference, storage: Sequence[s.Storage], *, is_argument: bool = False
    ) -> tuple[_GetReference, Type]:
        """The datum that is written to, or passed to a parameter that may be written to.

        Raises:
            RapidReferenceError: it may not be; tool0 and the like are passed on all the same.
        """
        root = node
        while not isinstance(root, s.Name):
            root = root.base
        found = self.scope.find(root.name, root)
        if isinstance(found, Local):
            is_writable = not found.is_constant
        else:
            is_protected = isinstance(found, ProtectedVariable) and not is_argument
            is_writable = isinstance(found, Variable) and found.storage in storage and not is_protected
        if not is_writable:
            self.scope.refuse(root, f"'{root.name}' cannot be changed here")
        return self.reference(node)

    def reference(self, node: s.Reference) -> tuple[_GetReference, Type]:
        """The datum, or the part of one, and its type."""
        if isinstance(node, s.Name):
            found = self.scope.find(node.name, node)
            if isinstance(found, Local):
                slot = found.slot
                return lambda frame: frame.slots[slot], found.type
            if isinstance(found, Variable):
                return lambda frame: found, found.type
            self.scope.refuse(node, f"'{node.name}' is not a variable")
        get_whole, type_ = self.reference(node.base)
        if isinstance(node, s.Field):
            index, component = self.component(type_, node)
            return lambda frame: DatumPart(get_whole(frame), (index,), component), component
        path, element = self.index(type_, node)

        def get_element(frame: RoutineFrame) -> Reference:
            whole = get_whole(frame)
            return DatumPart(whole, path(frame, whole.value), element)

        return get_element, element

    # Order of evaluation ------------------------------------------------------------------------------------------

    def builder(self, node: s.Node) -> CodeBuilder:
        """Where the steps of a call go; a declaration has none."""
        if self.scope.builder is None:
            self.scope.refuse(node, "a declaration cannot call a routine")
        return self.scope.builder

    def _kept(self, compiled: CompiledExpression) -> CompiledExpression:
        """The value taken now, for use after a later operand has run a routine."""
        if self.scope.builder is None:
            return compiled
        slot = self.scope.builder.store(compiled.evaluate)
        return replace(compiled, evaluate=lambda frame: frame.slots[slot])

    def runs_routine(self, node: s.Expression) -> bool:
        """Whether evaluating `node` runs a routine that may take steps of its own."""
        if type(node) in _LEAVES:
            return False
        if isinstance(node, s.FunctionCall):
            found = self.scope.program.find(node.name, self.scope.module)
            if isinstance(found, UserRoutine) or (isinstance(found, LibraryRoutine) and found.may_wait):
                return True
        return any(self.runs_routine(child) for child in s.children(node))

    def _without_signal(self, compiled: CompiledExpression) -> CompiledExpression:
        """A signal beside an operator stands for its level."""
        if not isinstance(resolved_type(compiled.type), RapidSignalType):
            return compiled
        return _level(compiled.evaluate, NUM)


_COMPILERS: Mapping[type[s.Node], Callable[[Expressions, Any, Type | None], CompiledExpression]] = {
    s.Literal: Expressions.literal,
    s.Name: Expressions.name,
    s.Field: Expressions.field,
    s.Element: Expressions.element,
    s.Unary: Expressions.unary,
    s.Binary: Expressions.binary,
    s.Aggregate: Expressions.aggregate,
    s.FunctionCall: Expressions.function_call,
}


def _fits_num(value: float) -> bool:
    """Whether single precision has this very value."""
    try:
        return single_precision(value) == value
    except RapidRuntimeError:  # too large
        return False


def _rounded(literal: CompiledExpression, node: s.Expression) -> CompiledExpression:
    """A literal in the single precision of a num."""
    evaluate = literal.evaluate
    if isinstance(node, s.Literal) and not isinstance(node.value, str):
        with suppress(RapidRuntimeError):  # too large: an error where it is executed
            value = single_precision(node.value)
            return CompiledExpression(lambda frame: value, NUM)
    return CompiledExpression(lambda frame: single_precision(evaluate(frame)), NUM)


def _level(signal: Evaluate, type_: Type) -> CompiledExpression:
    return CompiledExpression(lambda frame: type_.convert(frame.task.read_signal(signal(frame).name)), type_)


def _absent(frame: RoutineFrame) -> Reference:
    """What is passed for an argument that is left out."""
    return ABSENT_DATA


class Calls:
    """Compiles the calls of one scope."""

    def __init__(self, expressions: Expressions) -> None:
        self.expressions = expressions
        self.scope = expressions.scope

    def function(self, routine: _Routine, node: s.FunctionCall) -> CompiledExpression:
        """The value of a function call; what takes steps of its own runs before the statement goes on."""
        returns = self.signature(routine).returns
        arguments = self.arguments(routine, node.arguments, node)
        if returns is None:
            self.scope.refuse(node, f"'{node.name}' is a procedure and gives no value")
        if isinstance(routine, LibraryRoutine) and not routine.may_wait:
            call, implementation, convert = caller(routine, arguments), routine.implementation, returns.convert
            return CompiledExpression(lambda frame: convert(implementation(call(frame))), returns)
        builder = self.expressions.builder(node)
        slot = builder.new_slot()
        builder.add(_entering(routine, arguments, slot))
        return CompiledExpression(lambda frame: frame.slots[slot], returns)

    def procedure(self, routine: _Routine, arguments: Sequence[s.Argument], node: s.Node) -> Step:
        """The step of a procedure call or instruction."""
        is_trap = isinstance(routine, UserRoutine) and routine.syntax.kind is s.RoutineKind.TRAP
        if is_trap or self.signature(routine).returns is not None:
            self.scope.refuse(node, f"'{routine.name}' cannot be called as a procedure")
        return _entering(routine, self.arguments(routine, arguments, node), None)

    def signature(self, routine: _Routine) -> Signature | LibraryRoutine:
        return self.scope.program.signature(routine) if isinstance(routine, UserRoutine) else routine

    # Arguments ----------------------------------------------------------------------------------------------------

    def arguments(self, routine: _Routine, given: Sequence[s.Argument], node: s.Node) -> list[_GetReference]:
        """For each parameter, how to get what is passed for it."""
        parameters = self.signature(routine).parameters
        matched = self._matched(routine, parameters, given, node)
        last = -1  # the last argument that runs a routine
        for index, parameter in enumerate(parameters):
            argument = matched.get(parameter.key)
            if argument is not None and argument.value is not None and self.expressions.runs_routine(argument.value):
                last = index
        references: list[_GetReference] = []
        for index, parameter in enumerate(parameters):
            argument = matched.get(parameter.key)
            if argument is None:
                references.append(_absent)
                continue
            reference = self._argument(parameter, argument, node)
            references.append(self._kept(reference) if index < last else reference)  # taken now, before it runs
        return references

    def _kept(self, get_reference: _GetReference) -> _GetReference:
        assert self.scope.builder is not None
        slot = self.scope.builder.store(get_reference)
        return lambda frame: frame.slots[slot]

    def _matched(
        self, routine: _Routine, parameters: Sequence[FormalParameter], given: Sequence[s.Argument], node: s.Node
    ) -> dict[str, s.Argument]:
        """Arguments by parameter: positions for required ones, names for optional ones, alternatives once."""
        name = routine.name
        required = [p for p in parameters if p.group is None]
        optional = {p.key: p for p in parameters if p.group is not None}
        matched: dict[str, s.Argument] = {}
        for argument in given:
            key = (argument.name or "").lower()
            if argument.is_optional:
                if key not in optional:
                    sentence = f"'{name}' has no optional argument '\\{argument.name}'"
                    # A later RobotWare may have it: an error only where it is executed.
                    kind = RapidReferenceError if isinstance(routine, UserRoutine) else NotProvided
                    raise fault_in_module(self.scope.module, argument, sentence, kind)
                parameter = optional[key]
            elif not required:
                self.scope.refuse(argument, f"'{name}' has too many arguments")
            else:
                parameter = required.pop(0)
                if key not in ("", parameter.key):
                    self.scope.refuse(argument, f"'{name}' needs '{parameter.name}' before '{argument.name}'")
            if parameter.key in matched:
                self.scope.refuse(node, f"'{parameter.name}' is given twice to '{name}'")
            matched[parameter.key] = argument
        if required:
            self.scope.refuse(node, f"'{name}' lacks the argument '{required[0].name}'")
        # Of alternatives one at most is given; whether a conditional argument (\x?y) is, only the caller knows.
        groups = [optional[key].group for key, given in matched.items() if key in optional and given.condition is None]
        if len(groups) != len(set(groups)):
            self.scope.refuse(node, f"'{name}' is given two arguments that exclude each other")
        return matched

    def _argument(self, parameter: FormalParameter, argument: s.Argument, node: s.Node) -> _GetReference:
        if argument.condition is not None:
            return self._conditional(parameter, argument, argument.condition)
        if parameter.type == SWITCH:
            if argument.value is not None:
                self.scope.refuse(argument, f"the switch '\\{parameter.name}' takes no value")
            present = Variable(parameter.name, SWITCH, True)
            return lambda frame: present
        if argument.value is None:
            self.scope.refuse(argument, f"'\\{parameter.name}' needs a value: '\\{parameter.name}:=...'")
        if parameter.mode is s.ParameterMode.VALUE:
            compiled = self.expressions.value(argument.value, parameter.type)
            name = argument.value.name if isinstance(argument.value, s.Name) else parameter.name  # for ArgName
            type_, evaluate, convert = compiled.type, compiled.evaluate, parameter.type.convert
            return lambda frame: Variable(name, type_, convert(evaluate(frame)))
        return self._by_reference(parameter, argument.value, node)

    def _conditional(self, parameter: FormalParameter, argument: s.Argument, name: str) -> _GetReference:
        local = self.scope.locals.get(name.lower())
        if local is None or not local.is_optional:
            self.scope.refuse(argument, f"'{name}' is not an optional parameter of this routine")
        if not is_assignable(parameter.type, local.type):
            self.scope.refuse(argument, f"'{name}' is not {type_with_article(parameter.type)}")
        slot, is_copy = local.slot, parameter.mode is s.ParameterMode.VALUE

        def conditional(frame: RoutineFrame) -> Reference:
            passed: Reference = frame.slots[slot]
            return Variable(passed.name, passed.type, passed.value) if is_copy and passed is not ABSENT_DATA else passed

        return conditional

    def _by_reference(self, parameter: FormalParameter, value: s.Expression, node: s.Node) -> _GetReference:
        if not isinstance(value, (s.Name, s.Element, s.Field)):
            self.scope.refuse(node, f"'{parameter.name}' needs a datum, not an expression")
        wanted = resolved_type(parameter.type)
        is_signal = wanted is DI_OR_BOOL and isinstance(
            resolved_type(self.expressions.any(value).type), RapidSignalType
        )
        if is_signal or isinstance(wanted, (RapidSignalType, ObjectType)):
            # A signal or an object such as a mechanical unit; predefined ones count as variables.
            compiled = self.expressions.value(value, parameter.type)
            if isinstance(value, s.Name) and isinstance(self.scope.find(value.name, value), Signal):
                name, type_, evaluate = value.name, compiled.type, compiled.evaluate
                return lambda frame: Variable(name, type_, evaluate(frame))
            return self.expressions.reference(value)[0]
        get_reference, type_ = self.expressions.writable(value, _WRITABLE[parameter.mode], is_argument=True)
        if not is_assignable(parameter.type, type_):
            self.scope.refuse(
                node, f"'{parameter.name}' needs {type_with_article(parameter.type)}, not {type_with_article(type_)}"
            )
        return get_reference


def caller(routine: LibraryRoutine, arguments: Sequence[_GetReference]) -> Callable[[RoutineFrame], Call]:
    """How to make the `Call` that an instruction or function receives."""
    named = [(p.key, get_reference) for p, get_reference in zip(routine.parameters, arguments, strict=True)]
    name = routine.name

    def call(frame: RoutineFrame) -> Call:
        frame.task.instruction_used()
        return Call(frame.task, name, {key: get_reference(frame) for key, get_reference in named})

    return call


def _entering(routine: _Routine, arguments: Sequence[_GetReference], slot: int | None) -> Step:
    """The step that calls a routine; a function's value goes into `slot`."""
    if isinstance(routine, UserRoutine):

        def enter(stack: Stack, frame: RoutineFrame) -> None:
            stack.enter(routine, [get_reference(frame) for get_reference in arguments], slot)

        return enter
    call, implementation = caller(routine, arguments), routine.implementation
    convert = routine.returns.convert if routine.returns is not None else None

    def execute(stack: Stack, frame: RoutineFrame) -> None:
        outcome = implementation(call(frame))
        if isinstance(outcome, Generator):
            frame.begin_wait(outcome, slot, convert)

    return execute
