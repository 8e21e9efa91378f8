"""The linker: gives the data of loaded modules their types and first values, and checks all references."""

from __future__ import annotations

from collections.abc import Iterator

from yumi.errors import RapidError
from yumi.rapid import syntax as s
from yumi.rapid.data import UNSET, Variable
from yumi.rapid.errors import ProgramTooLarge
from yumi.rapid.expressions import Expressions, Scope
from yumi.rapid.scope import LoadedModule, Program, UserRoutine, UserType, blamed
from yumi.rapid.statements import CONSTANT_FRAME, compile_routine, declared_value
from yumi.rapid.types import Type, value_count

MOST_VALUES = 500_000  # of a task's data: 2 MB of num, less than a controller has
LINKED_AT_ONCE = 20  # about a millisecond


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
        self._under_way: set[Variable] = set()

    def link_data(self) -> None:
        for module in self.program.modules.values():
            for variable in module.data:
                self.link(variable, module)

    def linking(self, module: LoadedModule) -> Iterator[None]:
        """Link the data of a module that is not part of the program yet, with pauses; raises RapidReferenceError."""
        for index, variable in enumerate(module.data):
            self.link(variable, module)
            if index % LINKED_AT_ONCE == LINKED_AT_ONCE - 1:
                yield

    def check_routines(self) -> None:
        """Compile every routine; raises RapidReferenceError for the first thing that does not fit."""
        for routine in self.program.routines():
            if routine.code is None:
                routine.code = compile_routine(self.program, routine)

    def link(self, variable: Variable, module: LoadedModule) -> None:
        """Type and first value of a datum, and before that of the constants it is made from."""
        if variable.value is not UNSET:
            return
        datum = module.data[variable]
        if variable in self._under_way:
            raise blamed(module, datum.line, f"the value of '{datum.name}' depends on itself")
        self._under_way.add(variable)
        try:
            self._link(variable, datum, module)
        except RecursionError:
            raise blamed(module, datum.line, f"the value of '{datum.name}' is nested too deeply") from None
        finally:
            self._under_way.discard(variable)

    def _link(self, variable: Variable, datum: s.Data, module: LoadedModule) -> None:
        for name in (n for e in (*datum.dimensions, datum.initial) if e is not None for n in _names(e)):
            self._link_named(name, module)
        type_, initial = declared_value(Expressions(Scope(self.program, module)), datum)
        self._check_memory(type_, datum, module)
        variable.type = type_
        try:
            variable.value = initial(CONSTANT_FRAME)
        except (RapidError, ArithmeticError) as error:
            raise blamed(module, datum.line, f"the value of '{datum.name}' cannot be computed: {error}") from error
        variable.initial = initial
        module.value_count += value_count(type_)

    def _check_memory(self, type_: Type, datum: s.Data, module: LoadedModule) -> None:
        others = (m for m in self.program.modules.values() if m is not module)
        wanted = sum(m.value_count for m in others) + module.value_count + value_count(type_)
        if wanted > MOST_VALUES:
            raise ProgramTooLarge(
                f"{module.name}, line {datum.line}: with '{datum.name}' the data of the task would hold {wanted} "
                f"values, there is memory for {MOST_VALUES}."
            )

    def _link_named(self, name: str, module: LoadedModule) -> None:
        found = self.program.find(name, module)
        if not isinstance(found, Variable) or found.value is not UNSET:
            return
        owner = next(m for m in (module, *self.program.modules.values()) if found in m.data)
        self.link(found, owner)

    def initialise_variables(self) -> None:
        """Give each VAR its first value again, as PP to main does."""
        for module in self.program.modules.values():
            for variable in module.data:
                if variable.storage is s.Storage.VAR:
                    variable.value = variable.initial(CONSTANT_FRAME)


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
