"""The compiler and linker: statements to the steps of a routine, declarations to data with types and first values."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from threading import Lock
from typing import Any, TypeVar

from abb_protocols.errors import RapidError
from virtual_irc5.rapid import ast as s
from virtual_irc5.rapid.call import VISUALIZE, CallDeadline
from virtual_irc5.rapid.code_builder import CodeBuilder
from virtual_irc5.rapid.expressions import Expressions, Scope, caller
from virtual_irc5.rapid.frame import Code, Evaluate, HandlerCode, LocalName, RoutineFrame, Span, Stack, Step, Target
from virtual_irc5.rapid.loaded_modules import LoadedModule, UserRoutine, fault_in_module
from virtual_irc5.rapid.program import Local, Program
from virtual_irc5.rapid.rapid_library import LibraryRoutine, is_robotware_name
from virtual_irc5.rapid.types import (
    LARGEST_ARRAY,
    MOST_OBJECTS,
    NUM,
    STRING,
    UNSET_DATA,
    ArrayType,
    NotProvided,
    ProgramTooLarge,
    RapidReferenceError,
    RapidRuntimeError,
    RapidUnresolvedTrap,
    Type,
    Unresolved,
    UnresolvedProcedure,
    Variable,
    binary_operation,
    holds_objects,
    is_assignable,
    resolved_type,
    type_text,
    type_with_article,
    value_count,
)

_T = TypeVar("_T")
MOST_VALUES = 500_000  # of a task's data: 2 MB of num, less than a controller has
CONSTANT_FRAME: Any = None  # constant expressions do not look at the frame
_WAIT_UNTIL = r"\switch InPos, bool Cond, \num MaxTime, \VAR bool TimeFlag, \num PollRate, " + VISUALIZE


def compile_program(program: Program) -> None:
    """Link all data and compile all routines; raises RapidReferenceError for the first thing that does not fit.

    A name that nothing declares is none of them: the program runs up to where it is used.
    """
    for module in program.modules.values():
        link_module(program, module)
    for routine in program.routines:
        if routine not in program.codes:
            program.codes[routine] = compile_routine(program, routine)


def faults_of(program: Program) -> list[RapidReferenceError]:
    """All that does not fit in declarations and statements, in the order of the text."""
    faults: list[RapidReferenceError] = []
    for module in program.modules.values():
        for variable in tuple(module.data):
            with _collecting(faults):
                link(program, module, variable)
    for routine in program.routines:
        with _collecting(faults):
            Statements(program, routine, faults).compiled()
    modules = [module.syntax.filename for module in program.modules.values()]
    unique = {(modules.index(each.filename), each.line, each.column, str(each)): each for each in faults}
    return [unique[key] for key in sorted(unique)]


@contextmanager
def _collecting(faults: list[RapidReferenceError] | None) -> Iterator[None]:
    """Note a fault and go on; without a list it is raised."""
    try:
        yield
    except RapidReferenceError as fault:
        if faults is None:
            raise
        faults.append(fault)


@contextmanager
def _as_runtime_error(name: str) -> Iterator[None]:
    """Let what does not fit, where it is executed, be an error of RAPID; `name` where it has none of its own."""
    try:
        yield
    except Unresolved as error:
        raise RapidRuntimeError(error.error, str(error)) from error
    except RapidReferenceError as error:
        raise RapidRuntimeError(name, str(error)) from error


def compile_routine(program: Program, routine: UserRoutine) -> Code:
    """The steps of a routine; raises RapidReferenceError for what does not fit."""
    try:
        return Statements(program, routine).compiled()
    except Unresolved as error:  # in its parameters or its type
        builder = CodeBuilder(routine.syntax.line)
        builder.add(_failing(error))
        return builder.code
    except RecursionError:
        sentence = f"the statements of '{routine.name}' are nested too deeply"
        raise fault_in_module(routine.module, routine.syntax, sentence) from None


# Statements -------------------------------------------------------------------------------------------------------


class Statements:
    """Compiles the statements of one routine.

    Attributes:
        faults: where statements that do not fit are noted; None where the first one ends the compilation.
    """

    def __init__(self, program: Program, routine: UserRoutine, faults: list[RapidReferenceError] | None = None) -> None:
        self.routine = routine
        self.faults = faults
        self.builder = CodeBuilder(routine.syntax.line)
        self.scope = Scope(program, routine.module, self.builder)
        self.expressions = Expressions(self.scope)
        self.signature = program.signature(routine)
        self.labels: dict[str, Target] = {}
        self.in_handler = False

    def compiled(self) -> Code:
        declared = self.routine.syntax
        for parameter in self.signature.parameters:
            slot, is_optional = self.builder.new_slot(), parameter.group is not None
            local = Local(slot, parameter.type, mode=parameter.mode, is_optional=is_optional)
            self._add_local(parameter.name, local, declared, "par")
        for datum in declared.locals:
            with _collecting(self.faults):
                self._declare(datum)
        self._block(declared.body)
        self._end()
        if declared.handler is not None:
            numbers = tuple(map(self._error_number, declared.handler.numbers))
            self.builder.code.handler = HandlerCode(self.builder.here().step, numbers)
            self.in_handler = True
            self._block(declared.handler.body)
            self._end()
            self.in_handler = False
        for name, clause in (("UNDO", declared.undo), ("BACKWARD", declared.backward)):
            if clause is None:
                continue
            if declared.kind is not s.RoutineKind.PROC:
                self.scope.refuse(declared, f"'{declared.name}' has {name}, which procedures alone may have")
            if clause is declared.undo:
                self.builder.code.undo = self.builder.here().step
            self._block(clause)  # BACKWARD, too: nothing steps backwards, but it has to fit
            self._end()
        return self.builder.code

    def _error_number(self, node: s.Expression) -> Evaluate:
        try:
            return self.expressions.value(node, NUM).evaluate
        except Unresolved as error:  # the number of no error
            if self.faults is not None:
                self.faults.append(error)
            return lambda frame: math.nan

    def _add_local(self, name: str, local: Local, node: s.Node, kind: str) -> None:
        if name.lower() in self.scope.locals:
            self.scope.refuse(node, f"'{name}' is declared twice in '{self.routine.name}'")
        self.scope.locals[name.lower()] = local
        self.builder.code.locals.append(LocalName(name, kind, local.slot))

    def _declare(self, datum: s.Data) -> None:
        self.expressions.count = 0
        self.scope.is_declaration = True
        initial = None
        try:
            type_ = _declared_type(self.expressions, datum)
            convert = type_.convert
            if datum.initial is not None:
                initial = self.expressions.value(datum.initial, type_).evaluate
        except Unresolved as error:  # of the statements that use it
            self.scope.faults[datum.name.lower()] = error.sentence.rstrip(".")
            if self.faults is not None:
                self.faults.append(error)
            return
        finally:
            self.scope.is_declaration = False
        slot, name = self.builder.new_slot(), datum.name
        self.builder.code.value_count += value_count(type_)

        def declare(stack: Stack, frame: RoutineFrame) -> None:
            value = type_.default() if initial is None else convert(initial(frame))
            frame.slots[slot] = Variable(name, type_, value)

        with self.builder.statement(datum.line):
            self.builder.add(declare)
        local = Local(slot, type_, is_constant=datum.storage is s.Storage.CONST)
        self._add_local(name, local, datum, datum.storage.value)

    def _block(self, block: s.Block) -> None:
        """A statement list; its labels can be reached from inside of it and of its statements."""
        outer = self.labels
        self.labels = {**outer, **{n.name.lower(): Target() for n in block if isinstance(n, s.Label)}}
        for statement in block:
            self.expressions.count = 0
            with (
                self.builder.statement(statement.line) as span,
                self._noted(partial(self._late_step, span, statement)),
            ):
                self._statement(statement)
        self.labels = outer

    @contextmanager
    def _noted(self, late: Callable[[Unresolved], None]) -> Iterator[None]:
        """Note what does not fit; `late` compiles instead what names something that nothing declares."""
        try:
            yield
        except RapidReferenceError as error:
            if self.faults is not None:
                self.faults.append(error)
            elif isinstance(error, Unresolved):
                late(error)
            else:
                raise

    def _statement(self, node: s.Statement) -> None:
        _COMPILERS[type(node)](self, node)

    def _late(self, compile: Callable[[Statements], _T]) -> Callable[[], _T]:
        """What names something that nothing declares, compiled where it is executed: a module may be loaded by then."""
        base, routine = self.scope.program, self.routine
        known, faults, in_handler = self.scope.locals, self.scope.faults, self.in_handler
        compiled: tuple[Program, _T] | None = None

        def late() -> _T:
            nonlocal compiled
            program = base.current()
            if compiled is None or compiled[0] is not program:
                again = Statements(program, routine)
                again.scope.locals, again.scope.faults, again.in_handler = known, faults, in_handler
                with _as_runtime_error("ERR_LINKREF"):
                    compiled = program, compile(again)
            return compiled[1]

        return late

    def _late_step(self, span: Span, statement: s.Statement, error: Unresolved) -> None:
        """One step for a statement; one of several steps, such as a loop, raises the error in any case."""

        def only_step(again: Statements) -> Step | None:
            again._statement(statement)
            steps = again.builder.code.steps
            return steps[0] if len(steps) == 1 else None

        late = self._late(only_step)

        def execute(stack: Stack, frame: RoutineFrame) -> None:
            step = late()
            if step is None:
                raise RapidRuntimeError(error.error, str(error))
            step(stack, frame)

        self.builder.replace(span, execute)

    def _late_condition(self, node: s.Expression) -> Evaluate:
        def condition(again: Statements) -> Evaluate:
            again.scope.builder = None  # it takes no steps of its own
            return again.expressions.condition(node)

        late = self._late(condition)

        def evaluate(frame: RoutineFrame) -> bool:
            is_met: bool = late()(frame)
            return is_met

        return evaluate

    def _end(self) -> None:
        """What happens after the last statement."""
        name, is_function = self.routine.name, self.routine.syntax.kind is s.RoutineKind.FUNC

        def end(stack: Stack, frame: RoutineFrame) -> None:
            if is_function:
                raise RapidRuntimeError("ERR_FNCNORET", f"The function '{name}' ended without a RETURN.")
            stack.leave(None)

        with self.builder.statement(self.routine.syntax.line):
            self.builder.add(end)

    # Simple statements --------------------------------------------------------------------------------------------

    def assignment(self, node: s.Assignment) -> None:
        get_reference, type_ = self.expressions.writable(node.target, (s.Storage.VAR, s.Storage.PERS))
        evaluate, convert = self.expressions.value(node.value, type_).evaluate, type_.convert

        def assign(stack: Stack, frame: RoutineFrame) -> None:
            get_reference(frame).value = convert(evaluate(frame))

        def assign_to_open_array(stack: Stack, frame: RoutineFrame) -> None:
            datum = get_reference(frame)  # the caller's, which has a size
            datum.value = datum.type.convert(evaluate(frame))

        if isinstance(resolved_type(type_), ArrayType):
            self.builder.add(assign_to_open_array)
            return

        self.builder.add(assign)

    def procedure_call(self, node: s.ProcedureCall) -> None:
        if node.name.lower() == "waituntil":
            self._wait_until(node)
            return
        if node.name.lower() == "setupcyclicbool":
            self._setup_cyclic_bool(node)
            return
        found = self.scope.find(node.name, node, UnresolvedProcedure)
        if not isinstance(found, (UserRoutine, LibraryRoutine)):
            self.scope.refuse(node, f"'{node.name}' is not a procedure or instruction")
        self.builder.add(self.expressions.calls.procedure(found, node.arguments, node))

    def late_call(self, node: s.LateCall) -> None:
        """`%"name"% arguments;`: the procedure is looked up each time the statement runs."""
        name = self.expressions.value(node.name, STRING).evaluate
        if any(a.value is not None and self.expressions.runs_routine(a.value) for a in node.arguments):
            self.scope.refuse(node, "the arguments of a late-binding call cannot call routines; use a variable")
        compiled, module = self.scope.program, self.scope.module
        known, faults = dict(self.scope.locals), self.scope.faults

        def call(stack: Stack, frame: RoutineFrame) -> None:
            called, program = name(frame), compiled.current()
            found = program.find_late(called, module)
            if found is None and is_robotware_name(called):
                raise RapidRuntimeError(NotProvided.error, f"The instruction '{called}' is not provided here.")
            if not isinstance(found, (UserRoutine, LibraryRoutine)):
                raise RapidRuntimeError("ERR_REFUNKPRC", f"There is no procedure '{called}' to call.")
            scope = Scope(program, module, CodeBuilder(node.line))
            scope.locals, scope.faults = known, faults
            with _as_runtime_error("ERR_CALLPROC"):
                step = Expressions(scope).calls.procedure(found, node.arguments, node)
            step(stack, frame)

        self.builder.add(call)

    def _wait_until(self, node: s.ProcedureCall) -> None:
        """WaitUntil: the condition, whatever it calls, is computed anew at each advance."""
        library = self.scope.program.library
        instruction = LibraryRoutine("WaitUntil", library.formal(_WAIT_UNTIL), None, lambda call: None, may_wait=False)
        conditions = [a for a in node.arguments if not a.is_optional]
        if len(conditions) != 1 or conditions[0].value is None:
            self.scope.refuse(node, "WaitUntil needs one condition")
        placeholder = s.Argument(None, s.Literal(True), False)
        given = [placeholder if a is conditions[0] else a for a in node.arguments]
        call = caller(instruction, self.expressions.calls.arguments(instruction, given, node))
        slot = self.builder.store(lambda frame: CallDeadline.of(call(frame)))
        again = self.builder.here()
        condition = self.expressions.condition(conditions[0].value)

        def until_next_poll(deadline: CallDeadline) -> Generator[float | None, None, None]:
            with deadline.visualized("a condition"):
                yield deadline.due

        def decide(stack: Stack, frame: RoutineFrame) -> None:
            deadline: CallDeadline = frame.slots[slot]
            if deadline.call.task.is_settled(deadline.call) and condition(frame):
                deadline.met()
            elif not deadline.expire():
                frame.begin_wait(until_next_poll(deadline), None, None)
                frame.step = again.step

        self.builder.add(decide)

    def _setup_cyclic_bool(self, node: s.ProcedureCall) -> None:
        """SetupCyclicBool: the condition is computed anew every 12 ms, by the instruction's implementation."""
        found = self.scope.program.library.routine(node.name)
        assert found is not None, "EXECUTION registers it"
        given = [argument.value for argument in node.arguments if not argument.is_optional]
        if len(given) != len(node.arguments) or len(given) != len(found.parameters) or given[1] is None:
            self.scope.refuse(node, "SetupCyclicBool needs a persistent and a condition")
        if self.expressions.runs_routine(given[1]):
            self.scope.refuse(node, "the condition of SetupCyclicBool cannot call routines")
        evaluate = self.expressions.condition(given[1])
        placeholder = s.Argument(None, s.Literal(True), False)
        arguments = self.expressions.calls.arguments(found, [node.arguments[0], placeholder], node)
        implementation, call = found.implementation, caller(found, arguments)

        def setup(stack: Stack, frame: RoutineFrame) -> None:
            implementation(call(frame))(lambda: evaluate(frame))

        self.builder.add(setup)

    def goto(self, node: s.Goto) -> None:
        target = self.labels.get(node.label.lower())
        if target is None:
            self.scope.refuse(node, f"there is no label '{node.label}' that this GOTO could reach")
        self.builder.jump(target)

    def label(self, node: s.Label) -> None:
        self.builder.mark(self.labels[node.name.lower()])

    def return_(self, node: s.Return) -> None:
        returns = self.signature.returns
        if (node.value is None) != (returns is None):
            what = "takes no value" if returns is None else f"needs a value of type {type_text(returns)}"
            self.scope.refuse(node, f"RETURN {what} in '{self.routine.name}'")
        if node.value is None or returns is None:
            self.builder.add(lambda stack, frame: stack.leave(None))
            return
        evaluate, convert = self.expressions.value(node.value, returns).evaluate, returns.convert
        self.builder.add(lambda stack, frame: stack.leave(convert(evaluate(frame))))

    def raise_(self, node: s.Raise) -> None:
        if node.number is not None:
            evaluate = self.expressions.value(node.number, NUM).evaluate
            self.builder.add(lambda stack, frame: stack.raise_number(frame, evaluate(frame)))
            return
        self._only_in_handler("RAISE without a number", node)
        self.builder.add(lambda stack, frame: stack.raise_again(frame))

    def exit(self, node: s.Exit) -> None:
        self.builder.add(lambda stack, frame: stack.exit())

    def retry(self, node: s.Retry) -> None:
        self._only_in_handler("RETRY", node)
        self.builder.add(lambda stack, frame: frame.retry())

    def try_next(self, node: s.TryNext) -> None:
        self._only_in_handler("TRYNEXT", node)
        self.builder.add(lambda stack, frame: frame.try_next())

    def _only_in_handler(self, what: str, node: s.Node) -> None:
        if not self.in_handler:
            self.scope.refuse(node, f"{what} may only stand in an error handler")

    def connect(self, node: s.Connect) -> None:
        get_reference, type_ = self.expressions.writable(node.target, (s.Storage.VAR,))
        trap = self.scope.find(node.trap, node, RapidUnresolvedTrap)
        if type_.name != "intnum" or not isinstance(trap, UserRoutine) or trap.syntax.kind is not s.RoutineKind.TRAP:
            self.scope.refuse(node, "CONNECT takes a VAR intnum and the name of a TRAP")
        self.builder.add(lambda stack, frame: stack.connect(get_reference(frame), trap))

    # Compound statements ------------------------------------------------------------------------------------------

    def if_(self, node: s.If) -> None:
        end = Target()
        for condition, block in node.branches:
            following = Target()
            self._jump_unless(condition, following)
            self._block(block)
            self.builder.jump(end)
            self.builder.mark(following)
        self._block(node.otherwise)
        self.builder.mark(end)

    def _jump_unless(self, condition: s.Expression, target: Target) -> None:
        with self._noted(lambda error: self.builder.jump_unless(self._late_condition(condition), target)):
            self.builder.jump_unless(self.expressions.condition(condition), target)

    def while_(self, node: s.While) -> None:
        start, end = self.builder.here(), Target()
        self._jump_unless(node.condition, end)
        self._block(node.body)
        self.builder.jump(start)
        self.builder.mark(end)

    def for_(self, node: s.For) -> None:
        bounds = [(node.first, NUM), (node.last, NUM), *([(node.step, NUM)] if node.step else [])]
        counter, last, *given_step = (self.builder.store(c.evaluate) for c in self.expressions.in_order(bounds))
        step, name = given_step[0] if given_step else self.builder.new_slot(), node.variable
        if not given_step:
            self.builder.store(lambda frame: 1.0 if frame.slots[counter] <= frame.slots[last] else -1.0, step)
        outer, slot = self.scope.locals, self.builder.new_slot()
        self.scope.locals = {**outer, name.lower(): Local(slot, NUM, is_constant=True)}

        def goes_on(frame: RoutineFrame) -> bool:
            value = frame.slots[counter]
            frame.slots[slot] = Variable(name, NUM, value)
            is_rising: bool = frame.slots[step] >= 0.0
            return bool(value <= frame.slots[last] if is_rising else value >= frame.slots[last])

        def advance(stack: Stack, frame: RoutineFrame) -> None:
            frame.slots[counter] += frame.slots[step]

        start, end = self.builder.here(), Target()
        visible = LocalName(name, "for", slot, begin=start.step)
        self.builder.code.locals.append(visible)
        with self.builder.statement(node.line):
            self.builder.jump_unless(goes_on, end)
        self._block(node.body)
        self.builder.add(advance)
        self.builder.jump(start)
        self.builder.mark(end)
        visible.end = end.step
        self.scope.locals = outer

    def test(self, node: s.Test) -> None:
        value = self.expressions.operand(node.value)
        slot, end = self.builder.store(value.evaluate), Target()
        for values, block in node.cases:
            matched, following = Target(), Target()
            for case in values:
                with self._noted(lambda error: self.builder.add(_failing(error))):
                    self.builder.jump_if(self._is_case(slot, value.type, case), matched)
            self.builder.jump(following)
            self.builder.mark(matched)
            self._block(block)
            self.builder.jump(end)
            self.builder.mark(following)
        self._block(node.otherwise)
        self.builder.mark(end)

    def _is_case(self, slot: int, type_: Type, node: s.Expression) -> Evaluate:
        case = self.expressions.value(node, type_)
        if binary_operation("=", type_, case.type) is None:
            self.scope.refuse(
                node, f"{type_with_article(type_)} cannot be compared with {type_with_article(case.type)}"
            )
        evaluate = case.evaluate
        return lambda frame: frame.slots[slot] == evaluate(frame)


_COMPILERS: Mapping[type[s.Node], Callable[[Statements, Any], None]] = {
    s.Assignment: Statements.assignment,
    s.ProcedureCall: Statements.procedure_call,
    s.LateCall: Statements.late_call,
    s.Goto: Statements.goto,
    s.Label: Statements.label,
    s.Return: Statements.return_,
    s.Raise: Statements.raise_,
    s.Exit: Statements.exit,
    s.Retry: Statements.retry,
    s.TryNext: Statements.try_next,
    s.Connect: Statements.connect,
    s.If: Statements.if_,
    s.While: Statements.while_,
    s.For: Statements.for_,
    s.Test: Statements.test,
}


def _failing(error: Unresolved) -> Step:
    name, sentence = error.error, str(error)

    def fail(stack: Stack, frame: RoutineFrame) -> None:
        raise RapidRuntimeError(name, sentence)

    return fail


# Declarations -----------------------------------------------------------------------------------------------------


def _declared_type(expressions: Expressions, datum: s.Data) -> Type:
    """The type of a declared datum."""
    scope = expressions.scope
    type_ = scope.program.type_named(datum.type_name, scope.module, datum)
    if datum.dimensions:
        try:
            sizes = tuple(expressions.value(n, NUM).evaluate(CONSTANT_FRAME) for n in datum.dimensions)
        except (RapidRuntimeError, ArithmeticError) as error:
            scope.refuse(datum, f"the sizes of '{datum.name}' cannot be computed: {error}")
        if not 1 <= len(sizes) <= 3 or not all(1 <= size == size // 1 for size in sizes):
            scope.refuse(datum, f"the array '{datum.name}' needs one to three sizes of at least 1")
        if math.prod(sizes) > LARGEST_ARRAY:
            sentence = f"the array '{datum.name}' would have {math.prod(sizes):.0f} elements, there is memory for"
            scope.refuse(datum, f"{sentence} {LARGEST_ARRAY}")
        type_ = ArrayType(type_, tuple(int(size) for size in sizes))
        if holds_objects(type_) and value_count(type_) > MOST_OBJECTS:
            sentence = f"the array '{datum.name}' of {type_.name} would hold {value_count(type_)} values"
            scope.refuse(datum, f"{sentence}, there is memory for {MOST_OBJECTS}")
    if datum.initial is None and datum.storage is s.Storage.CONST:
        scope.refuse(datum, f"the constant '{datum.name}' needs a value")
    return type_


# Linking: types and first values of a module's data ---------------------------------------------------------------


_publishing = Lock()  # of a first value: two threads may compute the same, and it may be written to right after


def link_module(program: Program, module: LoadedModule) -> None:
    """Give the data of a module their types and first values, as far as their declarations name what is declared.

    Raises:
        RapidReferenceError: a declaration does not fit.
    """
    for variable in tuple(module.data):
        with suppress(Unresolved):  # an error of the statements that use it
            link(program, module, variable)


def link(program: Program, module: LoadedModule, variable: Variable, users: tuple[Variable, ...] = ()) -> None:
    """Type and first value of a datum, and before that of the constants it is made from; `users` are made from it."""
    datum = module.data.get(variable)  # none of a module that another thread has unloaded
    if variable.value is not UNSET_DATA or datum is None:
        return
    if variable in users:
        raise fault_in_module(module, datum, f"the value of '{datum.name}' depends on itself")
    try:
        for name in _names(datum):
            found = program.find(name, module)
            if isinstance(found, Variable) and found.value is UNSET_DATA:
                owner = next((m for m in (module, *program.modules.values()) if found in m.data), module)
                link(program, owner, found, (*users, variable))
        expressions = Expressions(Scope(program, module))
        type_ = _declared_type(expressions, datum)
        _check_memory(program, module, datum, type_)
        if datum.initial is None:
            value = type_.default()
        else:
            evaluate = expressions.value(datum.initial, type_).evaluate
            try:
                value = type_.convert(evaluate(CONSTANT_FRAME))
            except (RapidError, ArithmeticError) as error:
                expressions.scope.refuse(datum, f"the value of '{datum.name}' cannot be computed: {error}")
    except RecursionError:
        raise fault_in_module(module, datum, f"the value of '{datum.name}' is nested too deeply") from None
    except RapidReferenceError as error:
        variable.fault = error.sentence
        raise
    with _publishing:
        if variable.value is UNSET_DATA:
            _publish(program, module, variable, type_, value)


def _publish(program: Program, module: LoadedModule, variable: Variable, type_: Type, value: object) -> None:
    """Give a datum its type and first value.

    Data types manual, PERS: those of one name in several tasks share one value, except LOCAL and TASK ones. A first
    value is needed in one task only; of several, that of the first task counts.
    """
    datum = module.data[variable]
    is_shared = variable.storage is s.Storage.PERS and not variable.is_local and not variable.is_task
    other = program.shared(variable.name) if is_shared else None
    module.value_count += value_count(type_)
    variable.fault = ""
    if other is None:
        has_initial = not holds_objects(type_) and (datum.initial is not None or not is_shared)
        variable.type, variable.initial = type_, value if has_initial else UNSET_DATA
        variable.value = value
        return
    if not is_assignable(other.type, type_):
        here, there = type_with_article(type_), type_with_article(other.type)
        sentence = f"'{datum.name}' is {here}, in another task {there}: make one a TASK PERS"
        raise fault_in_module(module, datum, sentence)
    if other.initial is UNSET_DATA and datum.initial is not None:
        other.value = other.initial = value
    module.data = {other if key is variable else key: each for key, each in module.data.items()}
    module.symbols[datum.name.lower()] = other


def _names(datum: s.Data) -> Iterator[str]:
    """The data a declaration refers to."""
    nodes = [*datum.dimensions, *([datum.initial] if datum.initial is not None else [])]
    while nodes:
        node = nodes.pop()
        if isinstance(node, s.Name):
            yield node.name
        nodes += s.children(node)


def _check_memory(program: Program, module: LoadedModule, datum: s.Data, type_: Type) -> None:
    others = (each for name, each in program.modules.items() if name != module.name.lower())
    count = sum(each.value_count for each in others) + module.value_count + value_count(type_)
    if count > MOST_VALUES:
        raise ProgramTooLarge(
            f"{module.name}, line {datum.line}: with '{datum.name}' the data of the task would hold {count} values, "
            f"there is memory for {MOST_VALUES}.",
            filename=module.syntax.filename,
            line=datum.line,
            column=datum.column,
        )


def initialise_variables(program: Program) -> None:
    """Give each VAR its first value again, as PP to main does."""
    for module in program.modules.values():
        for variable in module.data:
            if variable.storage is s.Storage.VAR and not variable.fault:
                variable.value = variable.type.default() if variable.initial is UNSET_DATA else variable.initial
