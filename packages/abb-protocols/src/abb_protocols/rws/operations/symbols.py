"""Operations on symbols of RAPID: their values, their properties and the search for them, and their calls."""

from __future__ import annotations

from dataclasses import dataclass

from abb_protocols.catalogue import message
from abb_protocols.errors import ProtocolError
from abb_protocols.rws.documents import Page, RwsState, whole_number
from abb_protocols.rws.operations.operation import UPPER_TRUTH_VALUES, get, post
from abb_protocols.rws.operations.operation_answer import TEXT, single
from abb_protocols.rws.operations.service import Service
from abb_protocols.rws.rapid_values import RapidValue, decode, encode
from abb_protocols.rws.values import Grant, SymbolKind

_SYMBOL = "/rw/rapid/symbol"
_SYMBOLS = "/rw/rapid/symbols"
_DATUM = f"{_SYMBOL}/data/RAPID/{{symbol:.+}}"


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


SYMBOLS = get(_SYMBOLS)
SEARCH = post(
    _SYMBOLS,
    "search-symbols",
    f"view=block|scope|stack, vartyp=udef|rw|ro|loop|any, blockurl, recursive={UPPER_TRUTH_VALUES}, posl, posc, "
    f"stack, onlyused={UPPER_TRUTH_VALUES}, skipshared={UPPER_TRUTH_VALUES}, regexp, symtyp, dattyp",
    status=200,
)
SYMBOL = get(_DATUM, "value=raw").shows(single("rap-data", "value", TEXT))
SET_SYMBOL = post(_DATUM, "set", "value", respects="rapid", grant=Grant.RAPID_CURRVALUE)
SET_INITIAL_VALUE = post(_DATUM, "setInitValue", "value", respects="rapid", grant=Grant.RAPID_EDIT)
VALIDATE_SYMBOL = post(f"{_SYMBOL}/data", "validate", "task, value, datatype")
SYMBOL_PROPERTIES = get(f"{_SYMBOL}/properties/RAPID/{{symbol:.+}}")


def read_symbol_type(page: Page) -> str:
    """``/rw/rapid/symbol/properties``: the name of the RAPID type."""
    for state in page.states:
        if state.type.startswith("rap-symprop"):
            return state.text("dattyp")
    raise ProtocolError(message("answer_without_properties"))


class SymbolsService(Service):
    """``/rw/rapid/symbol`` and ``/rw/rapid/symbols``.

    Where a module is asked for, data of a routine under way are found with ``Hello/wave``, module and routine.
    """

    def symbol(self, task: str, module: str, name: str) -> str:
        """Value of a RAPID symbol as its literal; ``abb_protocols.rws.rapid_values`` decodes it."""
        what = f"reading {module}/{name} of {task}"
        return self._answer(what, SYMBOL, f"{task}/{module}/{name}")

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
        return read_symbol_type(self._shown(what, SYMBOL_PROPERTIES, f"{task}/{module}/{name}"))

    def set_symbol(self, task: str, module: str, name: str, literal: str) -> None:
        """Write a RAPID symbol; ``abb_protocols.rws.rapid_values`` encodes a literal."""
        place = f"{task}/{module}/{name}"
        self._call(f"writing {module}/{name} of {task}", SET_SYMBOL, place, value=literal)

    def symbol_properties(self, task: str, module: str, name: str) -> SymbolInfo:
        """What a symbol is, and of which type."""
        what = f"reading the properties of {module}/{name} of {task}"
        return _symbol_info(self._shown(what, SYMBOL_PROPERTIES, f"{task}/{module}/{name}").first)

    def set_initial_value(self, task: str, module: str, name: str, value: RapidValue) -> None:
        """Write the value that a symbol has in the text of its module."""
        what, place = f"writing the initial value of {module}/{name} of {task}", f"{task}/{module}/{name}"
        self._call(what, SET_INITIAL_VALUE, place, value=encode(value))

    def is_value_of(self, task: str, literal: str, type: str) -> bool:
        """Whether a literal is a value of a RAPID type that is known in a task."""
        return self._is_valid(f"checking a value of {type}", VALIDATE_SYMBOL, task=task, value=literal, datatype=type)

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
        stack: int | None = None,
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
            view: ``block``, ``scope`` for all that is seen from there, or ``stack`` for a routine under way.
            stack: number of the routine under way, 1 for the innermost, as ``stack_frame`` has it.
        """
        page = self._shown(
            f"searching {block}",
            SEARCH,
            view=view,
            vartyp="any",
            blockurl=block,
            recursive=recursive,
            onlyused=only_used,
            skipshared=skips_shared,
            symtyp=kind,
            regexp=pattern or None,
            dattyp=type or None,
            stack=stack,
        )
        return tuple(map(_symbol_info, page.states))


def _symbol_info(state: RwsState) -> SymbolInfo:
    dimensions = tuple(whole_number("dim", part) for part in state.fields.get("dim", "").replace(",", " ").split())
    return SymbolInfo(
        address=state.fields.get("symburl") or state.title,
        name=state.text("name"),
        kind=state.member(SymbolKind, "symtyp"),
        type=state.fields.get("dattyp", ""),
        dimensions=dimensions,
        is_local=state.flag("local"),
        is_read_only=state.flag("rdonly"),
    )
