"""A module of a task: the types, data and routines that it declares by their names."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from virtual_irc5.rapid import ast as s
from virtual_irc5.rapid.types import UNSET_DATA, RapidReferenceError, Variable


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


Symbol = Variable | UserRoutine | UserType


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
                symbol = Variable(
                    node.name, UNSET_DATA, storage=node.storage, is_local=node.is_local, is_task=node.is_task
                )
                module.data[symbol] = node
            else:
                symbol = UserRoutine(module, node) if isinstance(node, s.Routine) else UserType(module, node)
            if node.name.lower() in module.symbols:
                raise fault_in_module(module, node, f"'{node.name}' is declared twice")
            module.symbols[node.name.lower()] = symbol
            for datum in node.locals if isinstance(node, s.Routine) else ():
                if datum.storage is s.Storage.PERS:
                    sentence = f"'{datum.name}' is persistent, which data of routines cannot be"
                    raise fault_in_module(module, datum, sentence)
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


def fault_in_module(
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
