"""Operations on modules of RAPID, their texts, and symbols (``/rw/rapid/modules``, ``/rw/rapid/symbol``)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated
from urllib.parse import quote, unquote, unquote_plus

from abb_protocols.rws.documents import RwsState
from abb_protocols.rws.operations.operation import get, post
from abb_protocols.rws.operations.operation_answer import TEXT, WHOLE, Spelling, pair, record, single
from abb_protocols.rws.operations.rapid import range_in
from abb_protocols.rws.values import Grant

_MODULE = "/rw/rapid/modules/{module}"
_SYMBOL = "/rw/rapid/symbol"
_MODULES = "/rw/rapid/modules"
_TRUTH = "TRUE|FALSE|true|false"
_RANGE = "startrow, startcol, endrow, endcol"
_POSITIONS = f"{_RANGE}, checklimit={_TRUTH}, checkdeactaxes={_TRUTH}, allowdeact={_TRUTH}"
_DATUM = f"{_SYMBOL}/data/RAPID/{{symbol:.+}}"
_ATTRIBUTES: Spelling[tuple[str, ...]] = Spelling(
    lambda state, name: tuple(state.text(name).replace(",", " ").split()),
    lambda name, attributes: {name: " ".join(attributes)},
)


@dataclass(frozen=True, slots=True)
class ModuleInfoAnswer:
    """One RAPID module; type is ``ProgMod`` or ``SysMod``."""

    name: str
    type: str


@dataclass(frozen=True, slots=True)
class ModuleDetails:
    """One module: its file, and its attributes such as SYSMODULE."""

    name: Annotated[str, "modname"]
    file: Annotated[str, "filename"]
    attributes: Annotated[tuple[str, ...], "attribute", _ATTRIBUTES] = ()


@lru_cache(maxsize=32)
def quoted_module_text(text: str) -> str:
    """A module's text, URL-encoded in Latin-1; a long one takes longer than a cycle the first time.

    What ISO 8859-1 does not have becomes a question mark, as in files that a program is saved in.
    """
    return quote(text, encoding="latin-1", errors="replace")


def _read_text(state: RwsState, name: str) -> str:
    text = state.text(name)
    decode = unquote if "%20" in text else unquote_plus  # which of the two encodings it is, ABB does not say
    return decode(text, encoding="latin-1")


MODULES = get(_MODULES, "task").shows(record("rap-module-info-li", ModuleInfoAnswer))
MOD_POSSIBLE_ALL = get(_MODULES, resource="mod-possible-all", status=400)
MODIFY_ALL_POSITION = post(_MODULES, "modify-all-position", _POSITIONS, grant=Grant.RAPID_MODPOS, status=400)
MODULE = get(
    _MODULE, "task, startrow, startcol, endrow, endcol, text, attribute, destination, continue-on-err=0|1"
).shows(record("rap-module", ModuleDetails))
TEXT_POSITION = pair("rap-text-position", "Row", "Column")
"""Answer of ``MODULE`` with ``text``: where that is, row and column 0 where it is not found."""

TEXT_PART = single("rap-mod-text", "text", TEXT)
"""Answer of ``MODULE`` with ``endrow``."""

TEXT_OBJECT = single("rap-object", "", range_in("start-row", "start-column", "end-row", "end-column"))
"""Answer of ``MODULE`` with ``startrow`` alone: where the declaration is."""

MODULE_TEXT = get(_MODULE, "task", resource="module-text").shows(
    single("rap-module-text", "module-text", Spelling(_read_text, lambda name, text: {name: quoted_module_text(text)}))
)
MODULE_CHANGES = get(_MODULE, "task", resource="change-count").shows(single("rap-module-changecount", "count", WHOLE))
EXTENSION = get(_MODULE, "task", resource="module-extension").shows(
    pair("rap-module-extension", "num-of-lines", "max-num-of-col")
)
SYNC_STATUS = get(_MODULE, "task", resource="syncper-status").shows(
    single("rap-syncper-status", "syncperstatus", WHOLE)
)
SYMBOL_AT = get(_MODULE, "task, row, col", resource="module-symbol")
MOD_POSSIBLE = get(_MODULE, _RANGE, resource="mod-possible", status=400)
SAVE_MODULE = post(_MODULE, "save", "name, path", query="task", grant=Grant.BACKUP)
SET_TEXT_RANGE = post(
    _MODULE,
    "set-text-range",
    "task, startrow, startcol, endrow, endcol, replace-mode=After|Before|Replace, query-mode=Force|Try, text",
    needs="rapid",
    grant=Grant.RAPID_EDIT,
)
SET_MODULE_TEXT = post(
    _MODULE, "set-module-text", "text", query="task", needs="rapid", grant=Grant.RAPID_EDIT, status=200
)
MODIFY_POSITION = post(_MODULE, "modify-position", _POSITIONS, query="task", grant=Grant.RAPID_MODPOS, status=400)
ROUTINE_AT = get(f"{_MODULE}/routine", "task, row, column")
ROUTINES = get(f"{_MODULES}/{{task}}/{{module}}/routines")
SYMBOLS = get("/rw/rapid/symbols")
SEARCH = post(
    "/rw/rapid/symbols",
    "search-symbols",
    f"view=block|scope|stack, vartyp=udef|rw|ro|loop|any, blockurl, recursive={_TRUTH}, posl, posc, "
    f"stack, onlyused={_TRUTH}, skipshared={_TRUTH}, regexp, symtyp, dattyp",
    status=200,
)
SYMBOL = get(_DATUM, "value=raw").shows(single("rap-data", "value", TEXT))
SET_SYMBOL = post(_DATUM, "set", "value", respects="rapid", grant=Grant.RAPID_CURRVALUE)
SET_INITIAL_VALUE = post(_DATUM, "setInitValue", "value", respects="rapid", grant=Grant.RAPID_EDIT)
VALIDATE = post(f"{_SYMBOL}/data", "validate", "task, value, datatype")
SYMBOL_PROPERTIES = get(f"{_SYMBOL}/properties/RAPID/{{symbol:.+}}")
