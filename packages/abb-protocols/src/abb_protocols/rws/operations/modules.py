"""Operations on modules of RAPID and their texts (``/rw/rapid/modules``), and their calls."""

from __future__ import annotations

from dataclasses import astuple, dataclass, replace
from functools import lru_cache
from typing import Annotated, Any
from urllib.parse import quote, unquote, unquote_plus

from abb_protocols.rws.documents import RwsState
from abb_protocols.rws.operations.operation import UPPER_TRUTH_VALUES, Operation, get, post
from abb_protocols.rws.operations.operation_answer import TEXT, WHOLE, Spelling, pair, record, single
from abb_protocols.rws.operations.service import Service
from abb_protocols.rws.request import RwsRequest
from abb_protocols.rws.values import Grant

_MODULE = "/rw/rapid/modules/{module}"
_MODULES = "/rw/rapid/modules"
_RANGE = "startrow, startcol, endrow, endcol"
_POSITIONS = (
    f"{_RANGE}, checklimit={UPPER_TRUTH_VALUES}, checkdeactaxes={UPPER_TRUTH_VALUES}, allowdeact={UPPER_TRUTH_VALUES}"
)
_ATTRIBUTES: Spelling[tuple[str, ...]] = Spelling(
    lambda state, name: tuple(state.text(name).replace(",", " ").split()),
    lambda name, attributes: {name: " ".join(attributes)},
)


@dataclass(frozen=True, slots=True)
class TextRange:
    """A part of a module's text; rows and columns count from 1, the end included."""

    row: int
    column: int
    end_row: int
    end_column: int


def text_range_in(*names: str) -> Spelling[TextRange]:
    """A range in four fields."""
    return Spelling(
        lambda state, name: TextRange(*map(state.whole, names)),
        lambda name, value: dict(zip(names, map(str, astuple(value)), strict=True)),
    )


@dataclass(frozen=True, slots=True)
class RoutineInfo:
    """A routine; type is ``prc``, ``fun`` or ``trp``."""

    name: str
    type: Annotated[str, "symtyp"]
    is_local: Annotated[bool, "local"]
    parameters: Annotated[int, "npar"]


@dataclass(frozen=True, slots=True)
class ModuleInfo:
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


MODULES = get(_MODULES, "task").shows(record("rap-module-info-li", ModuleInfo))
MODULES_MOD_POSSIBLE = get(_MODULES, resource="mod-possible-all", status=400)
MODIFY_ALL_POSITION = post(_MODULES, "modify-all-position", _POSITIONS, grant=Grant.RAPID_MODPOS, status=400)
MODULE = get(
    _MODULE, "task, startrow, startcol, endrow, endcol, text, attribute, destination, continue-on-err=0|1"
).shows(record("rap-module", ModuleDetails))
TEXT_POSITION = pair("rap-text-position", "Row", "Column")
"""Answer of ``MODULE`` with ``text``: where that is, row and column 0 where it is not found."""

TEXT_PART = single("rap-mod-text", "text", TEXT)
"""Answer of ``MODULE`` with ``endrow``."""

TEXT_OBJECT = single("rap-object", "", text_range_in("start-row", "start-column", "end-row", "end-column"))
"""Answer of ``MODULE`` with ``startrow`` alone: where the declaration is."""

MODULE_TEXT = get(_MODULE, "task", resource="module-text").shows(
    single("rap-module-text", "module-text", Spelling(_read_text, lambda name, text: {name: quoted_module_text(text)}))
)
MODULE_CHANGES = get(_MODULE, "task", resource="change-count").shows(single("rap-module-changecount", "count", WHOLE))
MODULE_EXTENSION = get(_MODULE, "task", resource="module-extension").shows(
    pair("rap-module-extension", "num-of-lines", "max-num-of-col")
)
MODULE_SYNC_STATUS = get(_MODULE, "task", resource="syncper-status").shows(
    single("rap-syncper-status", "syncperstatus", WHOLE)
)
MODULE_SYMBOL_AT = get(_MODULE, "task, row, col", resource="module-symbol")
MODULE_MOD_POSSIBLE = get(_MODULE, _RANGE, resource="mod-possible", status=400)
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
_ROUTINE = record("rap-routine-prop", RoutineInfo)  # in a list the states are of other types
MODULE_ROUTINE_AT = get(f"{_MODULE}/routine", "task, row, column").shows(_ROUTINE)
MODULE_ROUTINES = get(f"{_MODULES}/{{task}}/{{module}}/routines")


class ModulesService(Service):
    """``/rw/rapid/modules``; RAPID must be stopped while they are changed."""

    def modules(self, task: str) -> tuple[ModuleInfo, ...]:
        """The RAPID modules loaded in ``task``."""
        states = self._listed(f"reading the modules of {task}", MODULES, task=task)
        read = MODULES.answered
        return tuple(read.read(state) for state in states if state.type in read.types)

    def module(self, task: str, module: str) -> ModuleDetails:
        """File and attributes of a module that is loaded."""
        return self._answer(f"reading {module} of {task}", MODULE, module, task=task)

    def module_text(self, task: str, module: str) -> str:
        """The text of a module that is loaded, as the controller writes it: PERS data have their present values."""
        return self._answer(f"reading the module {module} of {task}", MODULE_TEXT, module, task=task)

    def module_part(self, task: str, module: str, part: TextRange) -> str:
        """A part of a module's text; -1 as last column is the end of the row."""
        what = f"reading {module} of {task}"
        return TEXT_PART.of(self._shown(what, MODULE, module, task=task, **_rows_and_columns(part)))

    def find_text(self, task: str, module: str, text: str, row: int = 1, column: int = 1) -> tuple[int, int]:
        """Row and column at which ``text`` is found from a place on."""
        place = {"startrow": row, "startcol": column}
        page = self._shown(f"searching {module}", MODULE, module, task=task, **place, text=text)
        return TEXT_POSITION.of(page)

    def module_object(self, task: str, module: str, row: int, column: int, destination: str = "Inner") -> TextRange:
        """Place of the statement or declaration at a place of the text, or of one beside it.

        Args:
            task: such as ``T_ROB_R``.
            module: its name.
            row: of the text, from 1.
            column: of the text, from 1.
            destination: ``Inner``, ``Outer``, ``First``, ``Last``, ``Next``, ``Previous`` …
        """
        place = {"startrow": row, "startcol": column, "destination": destination}
        return TEXT_OBJECT.of(self._shown(f"reading {module}", MODULE, module, task=task, **place))

    def module_change_count(self, task: str, module: str) -> int:
        """Rises with every change of the module's text."""
        return self._answer(f"reading {module}", MODULE_CHANGES, module, task=task)

    def module_size(self, task: str, module: str) -> tuple[int, int]:
        """Number of rows, and of columns of the longest."""
        return self._answer(f"reading {module}", MODULE_EXTENSION, module, task=task)

    def are_initial_values_current(self, task: str, module: str) -> bool:
        """Whether the initial values in the text are the present values of its PERS data."""
        return self._answer(f"reading {module}", MODULE_SYNC_STATUS, module, task=task) == 0

    def symbol_at(self, task: str, module: str, row: int, column: int) -> str:
        """Name of the symbol at a place of the text."""
        page = self._shown(f"reading {module}", MODULE_SYMBOL_AT, module, task=task, row=row, col=column)
        return page.one("rap-module-symbol").text("symbolname")

    def routine_at(self, task: str, module: str, row: int, column: int = 1) -> RoutineInfo:
        """The routine at a place of the text."""
        return self._answer(f"reading {module}", MODULE_ROUTINE_AT, module, task=task, row=row, column=column)

    def routines(self, task: str, module: str) -> tuple[RoutineInfo, ...]:
        """The routines of a module."""
        states = self._listed(f"reading the routines of {module}", MODULE_ROUTINES, task, module)
        return tuple(map(_ROUTINE.read, states))

    def save_module(self, task: str, module: str, folder: str, name: str = "") -> None:
        """Write a module into a directory of the controller such as ``HOME:/``; ``.mod`` is appended to its name."""
        asked = _task_first(SAVE_MODULE, module, task=task, name=name or module, path=folder)
        self._sent(f"saving {module} of {task}", SAVE_MODULE, asked)

    def set_module_text(self, task: str, module: str, text: str) -> None:
        """Replace the whole text of a module that is loaded."""
        asked = _task_first(SET_MODULE_TEXT, module, task=task, text=text)
        self._sent(f"writing {module} of {task}", SET_MODULE_TEXT, asked)

    def replace_text(self, task: str, module: str, part: TextRange, text: str) -> None:
        """Replace a part of a module's text."""
        how = {"task": task, "replace_mode": "Replace", "query_mode": "Force", **_rows_and_columns(part)}
        self._call(f"writing {module} of {task}", SET_TEXT_RANGE, module, **how, text=text)

    def clear_breakpoint(self, task: str, module: str, place: TextRange) -> None:
        """Remove a breakpoint at a place of ``breakpoints``.

        Its text is replaced by itself, as RobotWare 6 has no request for it. A program pointer in that text is lost.
        """
        self.replace_text(task, module, place, self.module_part(task, module, place))


def _task_first(operation: Operation[Any], module: str, **arguments: object) -> RwsRequest:
    """A request whose URL has the task before the action."""
    found = operation.request(module, **arguments)
    return replace(found, query=tuple(sorted(found.query, key=lambda pair: pair[0] == "action")))


def _rows_and_columns(part: TextRange) -> dict[str, int]:
    return {"startrow": part.row, "startcol": part.column, "endrow": part.end_row, "endcol": part.end_column}
