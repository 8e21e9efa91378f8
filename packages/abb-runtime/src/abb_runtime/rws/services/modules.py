"""The client's service for RAPID modules: loading, texts, breakpoints, routines, and what is at a place of a text."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from abb_protocols.rws.documents import RwsState
from abb_protocols.rws.operations import modules as table
from abb_protocols.rws.operations import rapid
from abb_protocols.rws.operations.modules import ModuleDetails, ModuleInfoAnswer
from abb_protocols.rws.operations.operation import Operation
from abb_protocols.rws.operations.rapid import Range
from abb_runtime.rws.services.service import Service, request
from abb_runtime.rws.session import RwsRequest


@dataclass(frozen=True, slots=True)
class RoutineInfo:
    """A routine; type is ``prc``, ``fun`` or ``trp``."""

    name: str
    type: str
    is_local: bool
    parameters: int


class ModulesService(Service):
    """``/rw/rapid/modules``; RAPID must be stopped while they are changed.

    While it runs, a RAPID program loads modules itself (``runModuleLoad`` of the state machine).
    """

    def modules(self, task: str) -> tuple[ModuleInfoAnswer, ...]:
        """The RAPID modules loaded in ``task``."""
        states = self._listed(f"reading the modules of {task}", table.MODULES, task=task)
        read = table.MODULES.answered
        return tuple(read.read(state) for state in states if state.type in read.types)

    def load_module(self, task: str, path: str, replace: bool = True) -> None:
        """Load a file of the controller, such as ``HOME:/pick.mod``, as a module of ``task``.

        Args:
            task: such as ``T_ROB_R``.
            path: the file as RAPID names it.
            replace: whether it may take the place of a module of the same name.
        """
        self._call(f"loading {path} into {task}", rapid.LOAD_MODULE, task, modulepath=path, replace=replace)

    def unload_module(self, task: str, name: str) -> None:
        """Remove a module from ``task``."""
        self._call(f"unloading {name} from {task}", rapid.UNLOAD_MODULE, task, module=name)

    def module(self, task: str, module: str) -> ModuleDetails:
        """File and attributes of a module that is loaded."""
        return self._answer(f"reading {module} of {task}", table.MODULE, module, task=task)

    def module_text(self, task: str, module: str) -> str:
        """The text of a module that is loaded, as the controller writes it: PERS data have their present values."""
        return self._answer(f"reading the module {module} of {task}", table.MODULE_TEXT, module, task=task)

    def module_part(self, task: str, module: str, part: Range) -> str:
        """A part of a module's text; -1 as last column is the end of the row."""
        what = f"reading {module} of {task}"
        return table.TEXT_PART.of(self._shown(what, table.MODULE, module, task=task, **_rows_and_columns(part)))

    def find_text(self, task: str, module: str, text: str, row: int = 1, column: int = 1) -> tuple[int, int]:
        """Row and column at which ``text`` is found from a place on."""
        place = {"startrow": row, "startcol": column}
        page = self._shown(f"searching {module}", table.MODULE, module, task=task, **place, text=text)
        return table.TEXT_POSITION.of(page)

    def module_object(self, task: str, module: str, row: int, column: int, destination: str = "Inner") -> Range:
        """Place of the statement or declaration at a place of the text, or of one beside it.

        Args:
            task: such as ``T_ROB_R``.
            module: its name.
            row: of the text, from 1.
            column: of the text, from 1.
            destination: ``Inner``, ``Outer``, ``First``, ``Last``, ``Next``, ``Previous`` …
        """
        place = {"startrow": row, "startcol": column, "destination": destination}
        return table.TEXT_OBJECT.of(self._shown(f"reading {module}", table.MODULE, module, task=task, **place))

    def module_change_count(self, task: str, module: str) -> int:
        """Rises with every change of the module's text."""
        return self._answer(f"reading {module}", table.MODULE_CHANGES, module, task=task)

    def module_size(self, task: str, module: str) -> tuple[int, int]:
        """Number of rows, and of columns of the longest."""
        return self._answer(f"reading {module}", table.EXTENSION, module, task=task)

    def are_initial_values_current(self, task: str, module: str) -> bool:
        """Whether the initial values in the text are the present values of its PERS data."""
        return self._answer(f"reading {module}", table.SYNC_STATUS, module, task=task) == 0

    def symbol_at(self, task: str, module: str, row: int, column: int) -> str:
        """Name of the symbol at a place of the text."""
        page = self._shown(f"reading {module}", table.SYMBOL_AT, module, task=task, row=row, col=column)
        return page.one("rap-module-symbol").text("symbolname")

    def routine_at(self, task: str, module: str, row: int, column: int = 1) -> RoutineInfo:
        """The routine at a place of the text."""
        page = self._shown(f"reading {module}", table.ROUTINE_AT, module, task=task, row=row, column=column)
        return _routine(page.one("rap-routine-prop"))

    def routines(self, task: str, module: str) -> tuple[RoutineInfo, ...]:
        """The routines of a module."""
        return tuple(map(_routine, self._listed(f"reading the routines of {module}", table.ROUTINES, task, module)))

    def save_module(self, task: str, module: str, folder: str, name: str = "") -> None:
        """Write a module into a directory of the controller such as ``HOME:/``; ``.mod`` is appended to its name."""
        asked = _task_first(table.SAVE_MODULE, module, task=task, name=name or module, path=folder)
        self._sent(f"saving {module} of {task}", table.SAVE_MODULE, asked)

    def set_module_text(self, task: str, module: str, text: str) -> None:
        """Replace the whole text of a module that is loaded."""
        asked = _task_first(table.SET_MODULE_TEXT, module, task=task, text=text)
        self._sent(f"writing {module} of {task}", table.SET_MODULE_TEXT, asked)

    def replace_text(self, task: str, module: str, part: Range, text: str) -> None:
        """Replace a part of a module's text."""
        how = {"task": task, "replace_mode": "Replace", "query_mode": "Force", **_rows_and_columns(part)}
        self._call(f"writing {module} of {task}", table.SET_TEXT_RANGE, module, **how, text=text)

    # Breakpoints

    def breakpoints(self, task: str) -> tuple[tuple[str, Range], ...]:
        """Module and place of each breakpoint."""
        found = self._answers(f"reading the breakpoints of {task}", rapid.BREAKPOINTS, task)
        return tuple((each.module, each.range) for each in found)

    def set_breakpoint(self, task: str, module: str, row: int, column: int = 1) -> None:
        """Let execution stop at a place of the text, if it is started with ``stop_at_breakpoints``."""
        self._call("setting a breakpoint", rapid.SET_BREAKPOINT, task, module=module, row=row, column=column)

    def clear_breakpoint(self, task: str, module: str, place: Range) -> None:
        """Remove a breakpoint at a place of ``breakpoints``.

        Its text is replaced by itself, as RobotWare 6 has no request for it. A program pointer in that text is lost.
        """
        self.replace_text(task, module, place, self.module_part(task, module, place))


def _task_first(operation: Operation[Any], module: str, **arguments: object) -> RwsRequest:
    """A request whose URL has the task before the action."""
    found = request(operation, module, **arguments)
    return replace(found, query=tuple(sorted(found.query, key=lambda pair: pair[0] == "action")))


def _rows_and_columns(part: Range) -> dict[str, int]:
    return {"startrow": part.row, "startcol": part.column, "endrow": part.end_row, "endcol": part.end_column}


def _routine(state: RwsState) -> RoutineInfo:
    return RoutineInfo(state.text("name"), state.text("symtyp"), state.flag("local"), state.whole("npar"))
