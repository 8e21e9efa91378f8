"""RAPID data: values, types, properties, search."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from yumi.errors import ControllerRefused
from yumi.rws import replies
from yumi.rws.documents import State
from yumi.rws.session import Request, Requests, get, given, post
from yumi.rws.types import RapidValue, decode, encode

_SYMBOLS = "/rw/rapid/symbol"
_INVALID = 400


class SymbolKind(Enum):
    """What a RAPID symbol is."""

    ATOMIC = "atm"
    RECORD = "rec"
    ALIAS = "ali"
    COMPONENT = "rcp"
    CONSTANT = "con"
    VARIABLE = "var"
    PERSISTENT = "per"
    PARAMETER = "par"
    LABEL = "lab"
    FOR = "for"
    FUNCTION = "fun"
    PROCEDURE = "prc"
    TRAP = "trp"
    MODULE = "mod"
    TASK = "tsk"
    ANY = "any"


@dataclass(frozen=True, slots=True)
class SymbolInfo:
    """A RAPID symbol.

    Attributes:
        address: such as ``RAPID/T_ROB_R/TRobMain/current_state``.
        name: as it is declared.
        kind: what it is.
        type: of its value, "" where it has none.
        dimensions: of an array, () otherwise.
        is_local: whether other modules do not see it.
        is_read_only: whether it cannot be written.
    """

    address: str
    name: str
    kind: SymbolKind
    type: str
    dimensions: tuple[int, ...]
    is_local: bool
    is_read_only: bool


class Symbols(Requests):
    """``/rw/rapid/symbol`` and ``/rw/rapid/symbols``."""

    def symbol(self, task: str, module: str, name: str) -> str:
        """Value of a RAPID symbol as its literal; ``yumi.rws.types`` decodes it."""
        what = f"reading {module}/{name} of {task}"
        return self._read(get(f"{_SYMBOLS}/data/RAPID/{task}/{module}/{name}"), replies.symbol, what)

    def value(self, task: str, module: str, name: str) -> RapidValue:
        """Value of a RAPID symbol: a number, bool, string, or a tuple for a record or an array."""
        return decode(self.symbol(task, module, name))

    def set_value(self, task: str, module: str, name: str, value: RapidValue) -> None:
        """Write a RAPID symbol; a record or an array is a tuple.

        Raises:
            CommandRefused: the value has a number that is not finite.
        """
        self.set_symbol(task, module, name, encode(value))

    def symbol_type(self, task: str, module: str, name: str) -> str:
        """Name of a RAPID symbol's type."""
        what = f"reading the type of {module}/{name} of {task}"
        return self._read(get(f"{_SYMBOLS}/properties/RAPID/{task}/{module}/{name}"), replies.symbol_type, what)

    def set_symbol(self, task: str, module: str, name: str, literal: str) -> None:
        """Write a RAPID symbol; ``yumi.rws.types`` encodes a literal."""
        self._do(
            post(f"{_SYMBOLS}/data/RAPID/{task}/{module}/{name}", "set", ("value", literal)),
            f"writing {module}/{name} of {task}",
        )

    def symbol_properties(self, task: str, module: str, name: str) -> SymbolInfo:
        """What a symbol is, and of which type."""
        what = f"reading the properties of {module}/{name} of {task}"
        request = get(f"{_SYMBOLS}/properties/RAPID/{task}/{module}/{name}")
        return self._read(request, lambda page: _info(page.states[0]), what)

    def set_initial_value(self, task: str, module: str, name: str, value: RapidValue) -> None:
        """Write the value that a symbol has in the text of its module."""
        request = post(f"{_SYMBOLS}/data/RAPID/{task}/{module}/{name}", "setInitValue", ("value", encode(value)))
        self._do(request, f"writing the initial value of {module}/{name} of {task}")

    def is_value_of(self, task: str, literal: str, type: str) -> bool:
        """Whether a literal is a value of a RAPID type that is known in a task."""
        try:
            form = given(task=task, value=literal, datatype=type)
            self._do(post(f"{_SYMBOLS}/data", "validate", *form), f"checking a value of {type}")
        except ControllerRefused as error:
            if error.status != _INVALID:
                raise
            return False
        return True

    def find_symbols(
        self,
        block: str,
        *,
        kind: SymbolKind = SymbolKind.ANY,
        type: str = "",
        pattern: str = "",
        recursive: bool = True,
        only_used: bool = False,
        skips_shared: bool = False,
        view: str = "block",
    ) -> tuple[SymbolInfo, ...]:
        """Search for symbols.

        Args:
            block: where, such as ``RAPID/T_ROB_R`` or ``RAPID/T_ROB_R/TRobMain``.
            kind: only those of this kind.
            type: only data of this type.
            pattern: only those whose name it describes, a regular expression.
            recursive: in blocks within the block, too.
            only_used: only what is used.
            skips_shared: without what is loaded in all tasks.
            view: ``block``, ``scope`` for all that is seen from there, or ``stack``.
        """
        form = given(
            view=view,
            vartyp="any",
            blockurl=block,
            recursive=recursive,
            onlyused=only_used,
            skipshared=skips_shared,
            symtyp=kind.value,
            regexp=pattern or None,
            dattyp=type or None,
        )
        request = Request("POST", "/rw/rapid/symbols", (("action", "search-symbols"),), form)
        return self._read(request, lambda page: tuple(map(_info, page.states)), f"searching {block}")


def _info(state: State) -> SymbolInfo:
    dimensions = tuple(int(part) for part in state.fields.get("dim", "").replace(",", " ").split())
    return SymbolInfo(
        address=state.fields.get("symburl") or state.title,
        name=state.text("name"),
        kind=state.member(SymbolKind, "symtyp"),
        type=state.fields.get("dattyp", ""),
        dimensions=dimensions,
        is_local=state.flag("local"),
        is_read_only=state.flag("rdonly"),
    )
