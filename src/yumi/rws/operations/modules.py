"""RAPID's modules, their texts, and symbols."""

from __future__ import annotations

from yumi.rws.operations.operation import get, post
from yumi.rws.types import Grant

_MODULE = "/rw/rapid/modules/{module}"
_SYMBOL = "/rw/rapid/symbol"
_MODULES = "/rw/rapid/modules"
_TRUTH = "TRUE|FALSE|true|false"
_RANGE = "startrow, startcol, endrow, endcol"
_POSITIONS = f"{_RANGE}, checklimit={_TRUTH}, checkdeactaxes={_TRUTH}, allowdeact={_TRUTH}"
_DATUM = f"{_SYMBOL}/data/RAPID/{{symbol:.+}}"

MODULES = get(_MODULES, "task")
MOD_POSSIBLE_ALL = get(_MODULES, resource="mod-possible-all", status=400)
MODIFY_ALL_POSITION = post(_MODULES, "modify-all-position", _POSITIONS, grant=Grant.RAPID_MODPOS, status=400)
MODULE = get(_MODULE, "task, startrow, startcol, endrow, endcol, text, attribute, destination, continue-on-err=0|1")
MODULE_TEXT = get(_MODULE, "task", resource="module-text")
MODULE_CHANGES = get(_MODULE, "task", resource="change-count")
EXTENSION = get(_MODULE, "task", resource="module-extension")
SYNC_STATUS = get(_MODULE, "task", resource="syncper-status")
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
SYMBOL = get(_DATUM, "value=raw")
SET_SYMBOL = post(_DATUM, "set", "value", respects="rapid", grant=Grant.RAPID_CURRVALUE)
SET_INITIAL_VALUE = post(_DATUM, "setInitValue", "value", respects="rapid", grant=Grant.RAPID_EDIT)
VALIDATE = post(f"{_SYMBOL}/data", "validate", "task, value, datatype")
SYMBOL_PROPERTIES = get(f"{_SYMBOL}/properties/RAPID/{{symbol:.+}}")
