"""The program of a task: its modules, what names mean in them, and the code of its routines.

A `Program` never changes: to load or unload a module makes another one, which may be linked and compiled in a
background thread before the task goes on with it. Only the values of data change, and the codes that are added.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from virtual_irc5.rapid import ast as s
from virtual_irc5.rapid.devices import Host
from virtual_irc5.rapid.frame import Code
from virtual_irc5.rapid.loaded_modules import LoadedModule, Symbol, UserRoutine, UserType, fault_in_module
from virtual_irc5.rapid.rapid_library import FormalParameter, Library, LibraryRoutine
from virtual_irc5.rapid.types import AliasType, ArrayType, RecordType, Signal, Type, Unresolved, Variable


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
    mode: s.ParameterMode | None = None
    is_optional: bool = False


FoundName = Local | Variable | UserRoutine | LibraryRoutine | UserType | Signal


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
        current: the program that the task has by now: modules may have been loaded since this one was compiled.
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
        self.current: Callable[[], Program] = lambda: self
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
                    raise fault_in_module(module, declared, sentence)
        return self._changed({**self.modules, module.name.lower(): module}, module)

    def unloaded(self, name: str) -> Program:
        """The program without the module `name`."""
        return self._changed({key: each for key, each in self.modules.items() if key != name.lower()}, None)

    def _changed(self, modules: Mapping[str, LoadedModule], new: LoadedModule | None) -> Program:
        """The program with other modules; it keeps the code in which no name can have come to mean something else."""
        program = Program(self.library, self.host, self.system_data, modules)
        program.shared, program.current = self.shared, self.current
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

    def find(self, name: str, module: LoadedModule | None) -> FoundName | None:
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

    def find_late(self, name: str, module: LoadedModule) -> FoundName | None:
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
                raise fault_in_module(module, node, f"there is no data type '{name}'", Unresolved)
            return library_type
        known = self._types.get(found)
        if known is not None:
            return known
        declared, owner = found.syntax, found.module
        if found in users:
            raise fault_in_module(owner, declared, f"the type '{declared.name}' contains itself")
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
