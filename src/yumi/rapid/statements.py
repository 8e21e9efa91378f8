"""Statements: compiled to the steps of a routine."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from typing import TYPE_CHECKING, Any

from yumi.rapid import syntax as s
from yumi.rapid.calls import Calls, GetPlace, Places
from yumi.rapid.code import Code, CodeBuilder, Evaluate, HandlerCode, Step, Target
from yumi.rapid.data import Variable
from yumi.rapid.errors import RapidRuntimeError
from yumi.rapid.expressions import Expressions, Scope
from yumi.rapid.late_calls import late_call
from yumi.rapid.library import LibraryRoutine
from yumi.rapid.operators import binary_operation
from yumi.rapid.scope import Local, Program, UserRoutine
from yumi.rapid.types import (
    LARGEST_ARRAY,
    MOST_OBJECTS,
    NUM,
    STRING,
    ArrayType,
    Type,
    described,
    holds_objects,
    one,
    value_count,
)
from yumi.rapid.waits import wait_until

if TYPE_CHECKING:
    from yumi.rapid.frame import Frame
    from yumi.rapid.machine import Machine


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
                inner = _COMPILERS[type(statement)](self, statement)
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

_COMPILERS: dict[type, Callable[[Statements, Any], Generator[None, None, None] | None]] = {
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
