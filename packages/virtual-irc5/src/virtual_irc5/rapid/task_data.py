"""The data of a task by block and name, as clients read and write them.

A block is a module, or a routine under way: as `module/routine`, which is its innermost call, or as `%1`, which is the
call the program pointer stands in, `%2` what has called it, and so on.
"""

from __future__ import annotations

import re

from virtual_irc5.rapid import ast as s
from virtual_irc5.rapid.compiler import CONSTANT_FRAME, link
from virtual_irc5.rapid.expressions import Expressions, Scope
from virtual_irc5.rapid.frame import LocalName, RoutineFrame
from virtual_irc5.rapid.literals import format_value, parse_value
from virtual_irc5.rapid.loaded_modules import LoadedModule
from virtual_irc5.rapid.machine import Machine
from virtual_irc5.rapid.parser import parse_reference
from virtual_irc5.rapid.program import Local, Program
from virtual_irc5.rapid.types import (
    UNSET_DATA,
    RapidReferenceError,
    RapidRuntimeError,
    RapidSyntaxError,
    RapidValueError,
    Reference,
    UnknownSymbol,
    Unresolved,
    Variable,
    resolved_type,
    value_count,
)

_MOST_VALUES_READ = 5_000  # of a datum that is read as text, which takes a microsecond for each
_LONGEST_REFERENCE = 100  # characters of a name with its indices, as clients write it


class TaskData:
    """What a task has by name; the task says which program and which call stack it is found in."""

    name: str
    program: Program
    machine: Machine

    def read(self, block: str, symbol: str) -> str:
        """The value of a datum, or of an array element `a{1}`, as a RAPID literal; raises UnknownSymbol."""
        reference = self._reference(block, symbol)
        if value_count(reference.type) > _MOST_VALUES_READ:
            raise RapidValueError(
                f"'{symbol}' holds {value_count(reference.type)} values, at most {_MOST_VALUES_READ} are read at a "
                "time: read its elements."
            )
        return format_value(reference.type, reference.value)

    def write(self, block: str, symbol: str, literal: str) -> None:
        """Give a VAR, a PERS or a parameter the value of a literal.

        Raises:
            UnknownSymbol: there is no such datum.
            RapidValueError: the literal does not fit, or the datum is a constant or a loop variable.
        """
        kind = self.kind_of(block, symbol)
        if kind in (s.Storage.CONST.value, "for"):
            what = "a loop variable" if kind == "for" else "a constant"
            raise RapidValueError(f"'{symbol}' is {what} and cannot be written.")
        reference = self._reference(block, symbol)
        reference.value = parse_value(reference.type, literal)

    def type_of(self, block: str, symbol: str) -> str:
        """The type as declared, such as "num", "EGMSettings" or "errnum"."""
        return self._reference(block, symbol).type.name

    def dimensions_of(self, block: str, symbol: str) -> tuple[int, ...]:
        """The sizes of an array, empty for a single value."""
        return getattr(resolved_type(self._reference(block, symbol).type), "sizes", ())

    def kind_of(self, block: str, symbol: str) -> str:
        """What the datum is: "var", "per" or "con", of a routine also "par" (parameter) or "for" (loop variable)."""
        if (frame := self._frame(block)) is not None:
            return self._local(frame, symbol)[0].kind
        return self._datum(block, symbol).storage.value

    def symbols(self, block: str) -> tuple[str, ...]:
        """The names of a module's data, LOCAL ones too, or of what has a value in a routine under way."""
        if (frame := self._frame(block)) is not None:
            return tuple(name.name for name, _ in frame.locals.values())
        return tuple(variable.name for variable in self._module(block).data)

    def _frame(self, block: str) -> RoutineFrame | None:
        """The routine under way that a block is, None for a module; raises UnknownSymbol."""
        frames = self.machine.frames[::-1]
        if block.startswith("%"):
            number = int(block[1:]) if re.fullmatch(r"%\d{1,4}", block) else 0
            if not 1 <= number <= len(frames):
                raise UnknownSymbol(f"The task {self.name} has {len(frames)} stack frames, not {block}.")
            return frames[number - 1]
        module, slash, routine = block.lower().partition("/")
        if not slash:
            return None
        for frame in frames:
            if (frame.routine.module.name.lower(), frame.routine.name.lower()) == (module, routine):
                return frame
        raise UnknownSymbol(f"The task {self.name} does not execute the routine {block}.")

    def _local(self, frame: RoutineFrame, symbol: str) -> tuple[LocalName, Reference]:
        found = frame.locals.get(symbol.partition("{")[0].lower())
        if found is None:
            raise UnknownSymbol(f"The routine '{frame.routine.name}' has no datum '{symbol}' here.")
        return found

    def _module(self, name: str) -> LoadedModule:
        found = self.program.modules.get(name.lower())
        if found is None:
            names = ", ".join(m.name for m in self.program.modules.values()) or "none"
            raise UnknownSymbol(f"The task {self.name} has no module '{name}'; it has {names}.")
        return found

    def _reference(self, block: str, symbol: str) -> Reference:
        frame = self._frame(block)
        datum = self._datum(block, symbol) if frame is None else self._local(frame, symbol)[1]
        if "{" not in symbol:
            return datum
        scope = Scope(self.program, self._module(block) if frame is None else frame.routine.module)
        for name, reference in frame.locals.values() if frame is not None else ():
            scope.locals[name.name.lower()] = Local(name.slot, reference.type)
        if len(symbol) > _LONGEST_REFERENCE:
            raise UnknownSymbol(f"A reference to a datum has up to {_LONGEST_REFERENCE} characters, not {len(symbol)}.")
        try:
            get_reference, _ = Expressions(scope).reference(parse_reference(symbol))
            return get_reference(CONSTANT_FRAME if frame is None else frame)
        except (RapidSyntaxError, RapidReferenceError, RapidRuntimeError) as error:
            raise UnknownSymbol(f"{block} has no datum '{symbol}': {error}") from error

    def _datum(self, module: str, symbol: str) -> Variable:
        """The variable itself, of an element the array it belongs to."""
        owner = self._module(module)
        found = owner.symbols.get(symbol.partition("{")[0].lower())
        if not isinstance(found, Variable):
            raise UnknownSymbol(f"The module '{owner.name}' has no datum '{symbol}'.")
        if found.value is UNSET_DATA:
            try:
                link(self.program, owner, found)
            except Unresolved as error:
                raise UnknownSymbol(f"The module '{owner.name}' has no value for '{symbol}': {error}") from error
            found = owner.symbols[found.name.lower()]  # of another task, where they share it
            assert isinstance(found, Variable)
        return found
