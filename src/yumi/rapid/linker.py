"""The linker: gives the data of loaded modules their types and first values, and checks all references."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from typing import Any

from yumi.errors import RapidError
from yumi.rapid import syntax as s
from yumi.rapid.data import UNSET, Variable
from yumi.rapid.errors import ProgramTooLarge
from yumi.rapid.expressions import Expressions, Scope
from yumi.rapid.scope import LoadedModule, Program, UserRoutine, UserType, blamed
from yumi.rapid.statements import CONSTANT_FRAME, compile_routine, declared_type
from yumi.rapid.types import RecordType, Type, holds_objects, value_count

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
