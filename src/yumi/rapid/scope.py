"""Scopes: where RAPID looks a name up: the routine, its module, the other modules, the library, the I/O signals."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from yumi.rapid import syntax as s
from yumi.rapid.data import Variable
from yumi.rapid.errors import RapidReferenceError
from yumi.rapid.host import Host
from yumi.rapid.library import FormalParameter, Library, LibraryRoutine
from yumi.rapid.types import AliasType, ArrayType, RecordType, Signal, Type

if TYPE_CHECKING:
    from yumi.rapid.code import Code


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
