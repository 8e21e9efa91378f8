"""The virtual controller's answers on ``/rw/rapid/modules``: modules of tasks and their texts (rws.md §6)."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable

from abb_protocols.rws.documents import Page, RwsLink, RwsState
from abb_protocols.rws.operations import modules as table
from abb_protocols.rws.operations.modules import TextRange
from abb_protocols.rws.values import RwsCode
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.rapid import ast as s
from virtual_irc5.rapid.loaded_modules import LoadedModule
from virtual_irc5.rapid.task import Task
from virtual_irc5.rapid.types import Variable
from virtual_irc5.rws.files import path_of_file
from virtual_irc5.rws.rapid import prepare_modules, rws_task
from virtual_irc5.rws.render import page_at
from virtual_irc5.rws.router import Routes
from virtual_irc5.rws.rws_call import CallFailure, RwsCall, bad_call
from virtual_irc5.rws.symbols import routine_state, symbol_state

_BASE = "/rw/rapid/"

ROUTES = Routes()


def _module(controller: Irc5, call: RwsCall) -> tuple[Task, LoadedModule]:
    task = rws_task(controller, call.option("task") or call.parameter("task", "") or call.names.get("task", ""))
    name = call.names["module"]
    module = task.program.modules.get(name.lower())
    if module is None:
        raise CallFailure(404, RwsCode.FAIL, f"the task {task.name} has no module {name[:50]!r}")
    return task, module


def _module_page(task: Task, module: LoadedModule, state: RwsState) -> Page:
    """A page of a module; its address names the task, without which there is no such module."""
    return page_at("rapid", f"{_BASE}modules/", f"{module.name}?task={task.name}", state)


@ROUTES.answer(table.MODULES)
def _get_modules(controller: Irc5, call: RwsCall) -> Page:
    task = rws_task(controller, call.option("task") or "")
    states = (
        table.MODULES.answered.state(
            module.name,
            table.ModuleInfo(module.name, "SysMod" if module.is_system else "ProgMod"),
            RwsLink("self", f"modules/{module.name}?task={task.name}"),
        )
        for module in task.modules
    )
    return page_at("rapid", _BASE, f"modules?task={task.name}", *states)


@ROUTES.answer(table.MODULE)
def _get_module(controller: Irc5, call: RwsCall) -> Page:
    """Attributes of a module, a range of its text, or where a text is."""
    task, module = _module(controller, call)
    name, text = module.name, module.syntax.text
    if call.option("text") is not None:
        found = _search(text, call.option("text") or "", call)
        return _module_page(task, module, table.TEXT_POSITION.state(name, found))
    if call.option("endrow") is not None:
        begin, end = _range(text, call)
        return _module_page(task, module, table.TEXT_PART.state(name, text[begin:end]))
    if call.option("startrow") is not None:
        return _module_page(task, module, _object(module, call))
    attributes = sorted(each.lower().removesuffix("ule") for each in module.syntax.attributes)
    details = table.ModuleDetails(name, module.syntax.filename.rpartition("/")[2], tuple(attributes))
    return _module_page(task, module, table.MODULE.answered.state(name, details))


def _offset(text: str, row: int, column: int) -> int:
    """The place of a row and column, both from 1; column -1 is the end of the row."""
    lines = text.splitlines(keepends=True)
    if not 1 <= row <= len(lines):
        raise CallFailure(400, RwsCode.SOURCEPOS, f"the module has rows 1 to {len(lines)}, not {row}")
    line = lines[row - 1].rstrip("\r\n")
    if column != -1 and not 1 <= column <= len(line) + 1:
        raise CallFailure(400, RwsCode.SOURCEPOS, f"row {row} has columns 1 to {len(line) + 1}, not {column}")
    return sum(map(len, lines[: row - 1])) + (len(line) if column == -1 else column - 1)


def _position(call: RwsCall, name: str) -> int:
    text = call.option(name) or call.parameter(name, "")
    if not re.fullmatch(r"-1|\d{1,7}", text):
        raise bad_call(f"{name} is a whole number, not {text[:20]!r}")
    return int(text)


def _range(text: str, call: RwsCall) -> tuple[int, int]:
    begin = _offset(text, _position(call, "startrow"), _position(call, "startcol"))
    end_row, end_column = _position(call, "endrow"), _position(call, "endcol")
    end = _offset(text, end_row, end_column)
    end = min(end + (end_column != -1), len(text))  # the last column belongs to the range
    if end < begin:
        raise CallFailure(400, RwsCode.SOURCEPOS, "the range ends before it begins")
    return begin, end


def _search(text: str, wanted: str, call: RwsCall) -> tuple[int, int]:
    """Row and column of a text from a position on; both are 0 where it is not found."""
    begin = _offset(text, _position(call, "startrow"), _position(call, "startcol"))
    found = text.lower().find(wanted.lower(), begin) if wanted else -1
    if found < 0:
        return 0, 0
    return text.count("\n", 0, found) + 1, found - text.rfind("\n", 0, found)


_DECLARED = {s.Record: "Record", s.Alias: "Alias", s.Data: "Data", s.Routine: "Routine"}


def _object(module: LoadedModule, call: RwsCall) -> RwsState:
    """What stands at a row: the declaration it is in."""
    row = _position(call, "startrow")
    _position(call, "startcol")
    declared: list[s.Record | s.Alias | s.Data | s.Routine]
    declared = [*module.syntax.records, *module.syntax.aliases, *module.syntax.data, *module.syntax.routines]
    before = [node for node in declared if node.line <= row]
    if not before:
        raise CallFailure(400, RwsCode.SOURCEPOS, f"nothing is declared at row {row}")
    node = max(before, key=lambda each: each.line)
    fields = {
        **table.TEXT_OBJECT.write(TextRange(node.line, node.column, node.line, -1)),
        "type": _DECLARED[type(node)],
        "list-num": str(declared.index(node) + 1),
        "list-len": str(len(declared)),
        "data-type-id": node.name,
        "data-type-instance": "0",
        "expression-type": getattr(node, "type_name", ""),
    }
    return RwsState("rap-object", module.name, fields)


@ROUTES.answer(table.MODULE_TEXT)
def _get_module_text(controller: Irc5, call: RwsCall) -> Page:
    """The text, URL-encoded."""
    task, module = _module(controller, call)
    fields = {
        "change-count": str(controller.program_changes(task.name)),
        **table.MODULE_TEXT.answered.write(module.syntax.text),
        "module-length": str(len(module.syntax.text)),
    }
    state = RwsState("rap-module-text", module.name, fields)
    return _module_page(task, module, state)


@ROUTES.answer(table.MODULE_CHANGES)
def _get_module_changes(controller: Irc5, call: RwsCall) -> Page:
    task, module = _module(controller, call)
    count = controller.program_changes(task.name)
    return _module_page(task, module, table.MODULE_CHANGES.answered.state(module.name, count))


@ROUTES.answer(table.MODULE_EXTENSION)
def _get_extension(controller: Irc5, call: RwsCall) -> Page:
    task, module = _module(controller, call)
    lines = module.syntax.text.splitlines()
    fields = {
        **table.MODULE_EXTENSION.answered.write((len(lines), max(map(len, lines), default=0))),
        "count": str(controller.program_changes(task.name)),
    }
    return _module_page(task, module, RwsState("rap-module-extension", module.name, fields))


@ROUTES.answer(table.MODULE_SYNC_STATUS)
def _get_sync_status(controller: Irc5, call: RwsCall) -> Page:
    """Whether the text has the present values of its persistents."""
    task, module = _module(controller, call)
    return _module_page(task, module, table.MODULE_SYNC_STATUS.answered.state(module.name, 0))


@ROUTES.answer(table.SAVE_MODULE)
def _save_module(controller: Irc5, call: RwsCall) -> None:
    _, module = _module(controller, call)
    name, folder = call.required("name"), path_of_file(call.required("path"))
    if not re.fullmatch(r"\w{1,80}", name):
        raise bad_call(f"name is a name, not {name[:50]!r}")
    controller.files.write(f"{folder}/{name}.mod", module.syntax.text.encode("latin-1", "replace"))


def _prepare_module_text(controller: Irc5, call: RwsCall) -> Callable[[], None]:
    task, module = _module(controller, call)
    return functools.partial(prepare_modules, task, {module.syntax.filename: call.required("text")})


@ROUTES.answer(table.SET_MODULE_TEXT, prepare=_prepare_module_text)
def _set_module_text(controller: Irc5, call: RwsCall) -> None:
    _replace_text(controller, *_module(controller, call), call.required("text"))


def _replace_text(controller: Irc5, task: Task, module: LoadedModule, text: str) -> None:
    if not re.search(rf"\bMODULE\s+{re.escape(module.name)}\b", text, re.IGNORECASE):
        raise CallFailure(400, RwsCode.SYNTAX, f"the text is not that of the module {module.name}")
    controller.execution.load_module(task.name, text, module.syntax.filename, replace=True)


def _prepare_text_range(controller: Irc5, call: RwsCall) -> Callable[[], None]:
    task, module = _module(controller, call)
    return functools.partial(prepare_modules, task, {module.syntax.filename: _changed_text(module, call)})


@ROUTES.answer(table.SET_TEXT_RANGE, prepare=_prepare_text_range)
def _set_text_range(controller: Irc5, call: RwsCall) -> None:
    """Replace a range of a module's text, or put a text before or after it."""
    task, module = _module(controller, call)
    text = _changed_text(module, call)
    if call.required("query-mode") == "Try" and not task.call_stack:
        raise CallFailure(
            400, RwsCode.NO_PP, f"{task.name} has no program pointer; Force changes the text all the same"
        )
    rows = range(_position(call, "startrow"), _position(call, "endrow") + 1)
    if text != module.syntax.text:
        _replace_text(controller, task, module, text)
    else:  # by itself, which removes breakpoints: RobotWare 6 has no other request that does
        controller.execution.check_stopped("modules are changed", task.name)
        if any(at.module == module.name and at.line in rows for at in task.call_stack):
            task.lose_pp()
    if call.required("replace-mode") == "Replace":
        task.clear_breakpoints(module.name, rows)


def _changed_text(module: LoadedModule, call: RwsCall) -> str:
    call.required("task")
    text, new = module.syntax.text, call.required("text")
    begin, end = _range(text, call)
    modes = {"Before": (begin, begin), "After": (end, end), "Replace": (begin, end)}
    mode = call.required("replace-mode")
    if mode not in modes:
        raise bad_call(f"replace-mode is {' or '.join(modes)}, not {mode[:50]!r}")
    begin, end = modes[mode]
    return text[:begin] + new + text[end:]


@ROUTES.answer(table.MODULE_ROUTINES)
def _get_routines(controller: Irc5, call: RwsCall) -> Page:
    task, module = _module(controller, call)
    states = (routine_state(task, each, "-li") for each in module.routines)
    return page_at("rapid", f"{_BASE}modules/{task.name}/{module.name}/", "routines", *states)


@ROUTES.answer(table.MODULE_ROUTINE_AT)
def _get_routine_at(controller: Irc5, call: RwsCall) -> Page:
    """The routine that a row is in."""
    task, module = _module(controller, call)
    row = _position(call, "row")
    before = [each for each in module.routines if each.syntax.line <= row]
    if not before:
        raise CallFailure(400, RwsCode.SOURCEPOS, f"there is no routine at row {row} of {module.name}")
    found = max(before, key=lambda each: each.syntax.line)
    state = routine_state(task, found)
    names = ("name", "symtyp", "named", "local", "npar")
    fields = {name: state.fields[name] for name in names}
    return page_at(
        "rapid",
        f"{_BASE}modules/{module.name}/",
        f"routine?task={task.name}&row={row}",
        RwsState("rap-routine-prop", found.name, fields),
    )


@ROUTES.answer(table.MODULE_SYMBOL_AT)
def _get_symbol_at(controller: Irc5, call: RwsCall) -> Page:
    """The symbol whose name stands at a row and column."""
    task, module = _module(controller, call)
    lines = module.syntax.text.splitlines()
    row, column = _position(call, "row"), _position(call, "col")
    line = lines[row - 1] if 1 <= row <= len(lines) else ""
    word = next((each[0] for each in re.finditer(r"\w+", line) if each.start() < column <= each.end()), "")
    found = module.symbols.get(word.lower())
    if not isinstance(found, Variable):
        raise CallFailure(400, RwsCode.NO_SUCH_SYMBOL, f"there is no datum at row {row}, column {column}")
    state = symbol_state(task, module.name, found.name)
    fields = {
        "symbolname": found.name,
        "block_url": f"RAPID/{task.name}/{module.name}",
        "symbol_type": state.fields["symtyp"],
    }
    fields |= {name: state.fields[name] for name in ("linked", "local", "typurl", "dattyp", "ndim")}
    state = RwsState("rap-module-symbol", found.name, {"version": "1", **fields, "heap": "false", "refcount": "1"})
    return _module_page(task, module, state)


@ROUTES.answer(table.MODULES_MOD_POSSIBLE, table.MODIFY_ALL_POSITION, table.MODULE_MOD_POSSIBLE, table.MODIFY_POSITION)
def _refuse_positions(controller: Irc5, call: RwsCall) -> Page:
    raise CallFailure(400, RwsCode.SERVICE_NOT_SUPPORTED, "positions are modified on the FlexPendant")
