"""The virtual controller's answers on ``/rw/rapid/modules``, ``/rw/rapid/symbol``: modules, texts, data (rws.md §6)."""

from __future__ import annotations

import functools
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TypeVar

from abb_protocols.errors import ProtocolError
from abb_protocols.rws.documents import Form, Page, RwsLink, RwsState
from abb_protocols.rws.operations import modules as table
from abb_protocols.rws.operations.rapid import Range
from abb_protocols.rws.values import RapidValue, RwsCode, decode
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.rapid import ast as s
from virtual_irc5.rapid.literals import format_value, parse_value
from virtual_irc5.rapid.loaded_modules import LoadedModule, UserRoutine
from virtual_irc5.rapid.parser import parse_expression
from virtual_irc5.rapid.task import Task
from virtual_irc5.rapid.types import RapidReferenceError, RapidSyntaxError, RapidValueError, UnknownSymbol, Variable
from virtual_irc5.rws.files import path_of_file
from virtual_irc5.rws.http import HttpReply
from virtual_irc5.rws.rapid import find_task, prepare_modules
from virtual_irc5.rws.render import resource
from virtual_irc5.rws.router import Routes
from virtual_irc5.rws.rws_call import CallFailure, RwsCall, Shown, invalid
from virtual_irc5.rws.users import refuse_in_manual_mode

T = TypeVar("T")

_BASE = "/rw/rapid/"
_SYMBOL_TYPES = {
    "con": "rap-sympropconstant",
    "var": "rap-sympropvar",
    "per": "rap-symproppers",
    "par": "rap-sympropparam",
    "for": "rap-sympropfor",  # how ABB calls it is not known
}
_OWNERS: Mapping[str, Mapping[str, str]] = {
    "con": {},
    "var": {"taskvar": "true"},
    "per": {"taskpers": "true"},
}
_KINDS = {s.RoutineKind.PROC: "prc", s.RoutineKind.FUNC: "fun", s.RoutineKind.TRAP: "trp"}
_ROUTINE_TYPES = {"prc": "rap-sympropproc", "fun": "rap-sympropfunc", "trp": "rap-symproptrap"}
_LONGEST_PATTERN = 60
_MOST_REPEATS = 3
_LONG_VALUE = 180  # characters that take milliseconds to parse


ROUTES = Routes()


# Modules


def _module(controller: Irc5, call: RwsCall) -> tuple[Task, LoadedModule]:
    task = find_task(controller, call.option("task") or call.parameter("task", "") or call.names.get("task", ""))
    name = call.names["module"]
    module = task.program.modules.get(name.lower())
    if module is None:
        raise CallFailure(404, RwsCode.FAIL, f"the task {task.name} has no module {name[:50]!r}")
    return task, module


def _module_page(task: Task, module: LoadedModule, state: RwsState) -> Page:
    """A page of a module; its address names the task, without which there is no such module."""
    return resource("rapid", f"{_BASE}modules/", f"{module.name}?task={task.name}", state)


@ROUTES.answer(table.MODULES)
def get_modules(controller: Irc5, call: RwsCall) -> Page:
    task = find_task(controller, call.option("task") or "")
    states = (
        table.MODULES.answered.state(
            module.name,
            table.ModuleInfoAnswer(module.name, "SysMod" if module.is_system else "ProgMod"),
            RwsLink("self", f"modules/{module.name}?task={task.name}"),
        )
        for module in task.modules
    )
    return resource("rapid", _BASE, f"modules?task={task.name}", *states)


@ROUTES.answer(table.MODULE)
def get_module(controller: Irc5, call: RwsCall) -> Page:
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
        return _module_page(task, module, _object(task, module, call))
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
        raise invalid(f"{name} is a whole number, not {text[:20]!r}")
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


def _object(task: Task, module: LoadedModule, call: RwsCall) -> RwsState:
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
        **table.TEXT_OBJECT.write(Range(node.line, node.column, node.line, -1)),
        "type": _DECLARED[type(node)],
        "list-num": str(declared.index(node) + 1),
        "list-len": str(len(declared)),
        "data-type-id": node.name,
        "data-type-instance": "0",
        "expression-type": getattr(node, "type_name", ""),
    }
    return RwsState("rap-object", module.name, fields)


@ROUTES.answer(table.MODULE_TEXT)
def get_module_text(controller: Irc5, call: RwsCall) -> Page:
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
def get_module_changes(controller: Irc5, call: RwsCall) -> Page:
    task, module = _module(controller, call)
    count = controller.program_changes(task.name)
    return _module_page(task, module, table.MODULE_CHANGES.answered.state(module.name, count))


@ROUTES.answer(table.EXTENSION)
def get_extension(controller: Irc5, call: RwsCall) -> Page:
    task, module = _module(controller, call)
    lines = module.syntax.text.splitlines()
    fields = {
        **table.EXTENSION.answered.write((len(lines), max(map(len, lines), default=0))),
        "count": str(controller.program_changes(task.name)),
    }
    return _module_page(task, module, RwsState("rap-module-extension", module.name, fields))


@ROUTES.answer(table.SYNC_STATUS)
def get_sync_status(controller: Irc5, call: RwsCall) -> Page:
    """Whether the text has the present values of its persistents."""
    task, module = _module(controller, call)
    return _module_page(task, module, table.SYNC_STATUS.answered.state(module.name, 0))


@ROUTES.answer(table.SAVE_MODULE)
def save_module(controller: Irc5, call: RwsCall) -> None:
    _, module = _module(controller, call)
    name, folder = call.required("name"), path_of_file(call.required("path"))
    if not re.fullmatch(r"\w{1,80}", name):
        raise invalid(f"name is a name, not {name[:50]!r}")
    controller.files.write(f"{folder}/{name}.mod", module.syntax.text.encode("latin-1", "replace"))


def prepare_module_text(controller: Irc5, call: RwsCall) -> Callable[[], None]:
    task, module = _module(controller, call)
    return functools.partial(prepare_modules, task, {module.syntax.filename: call.required("text")})


@ROUTES.answer(table.SET_MODULE_TEXT, prepare=prepare_module_text)
def set_module_text(controller: Irc5, call: RwsCall) -> None:
    _replace_text(controller, *_module(controller, call), call.required("text"))


def _replace_text(controller: Irc5, task: Task, module: LoadedModule, text: str) -> None:
    if not re.search(rf"\bMODULE\s+{re.escape(module.name)}\b", text, re.IGNORECASE):
        raise CallFailure(400, RwsCode.SYNTAX, f"the text is not that of the module {module.name}")
    controller.execution.load_module(task.name, text, module.syntax.filename, replace=True)


def prepare_text_range(controller: Irc5, call: RwsCall) -> Callable[[], None]:
    task, module = _module(controller, call)
    return functools.partial(prepare_modules, task, {module.syntax.filename: _changed_text(module, call)})


@ROUTES.answer(table.SET_TEXT_RANGE, prepare=prepare_text_range)
def set_text_range(controller: Irc5, call: RwsCall) -> None:
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
        raise invalid(f"replace-mode is {' or '.join(modes)}, not {mode[:50]!r}")
    begin, end = modes[mode]
    return text[:begin] + new + text[end:]


@ROUTES.answer(table.ROUTINES)
def get_routines(controller: Irc5, call: RwsCall) -> Page:
    task, module = _module(controller, call)
    states = (_routine_state(task, each, "-li") for each in module.routines)
    return resource("rapid", f"{_BASE}modules/{task.name}/{module.name}/", "routines", *states)


def _routine_state(task: Task, routine: UserRoutine, suffix: str = "") -> RwsState:
    kind = _KINDS[routine.syntax.kind]
    url = f"RAPID/{task.name}/{routine.module.name}/{routine.name}"
    fields = {
        "symburl": url,
        "name": routine.name,
        "symtyp": kind,
        "named": "true",
        "dattyp": routine.syntax.return_type or "",
        "local": str(routine.syntax.is_local).lower(),
        "npar": str(len(routine.syntax.parameters)),
    }
    return RwsState(f"{_ROUTINE_TYPES[kind]}{suffix}", url, fields)


@ROUTES.answer(table.ROUTINE_AT)
def get_routine_at(controller: Irc5, call: RwsCall) -> Page:
    """The routine that a row is in."""
    task, module = _module(controller, call)
    row = _position(call, "row")
    before = [each for each in module.routines if each.syntax.line <= row]
    if not before:
        raise CallFailure(400, RwsCode.SOURCEPOS, f"there is no routine at row {row} of {module.name}")
    found = max(before, key=lambda each: each.syntax.line)
    state = _routine_state(task, found)
    names = ("name", "symtyp", "named", "local", "npar")
    fields = {name: state.fields[name] for name in names}
    return resource(
        "rapid",
        f"{_BASE}modules/{module.name}/",
        f"routine?task={task.name}&row={row}",
        RwsState("rap-routine-prop", found.name, fields),
    )


@ROUTES.answer(table.SYMBOL_AT)
def get_symbol_at(controller: Irc5, call: RwsCall) -> Page:
    """The symbol whose name stands at a row and column."""
    task, module = _module(controller, call)
    lines = module.syntax.text.splitlines()
    row, column = _position(call, "row"), _position(call, "col")
    line = lines[row - 1] if 1 <= row <= len(lines) else ""
    word = next((each[0] for each in re.finditer(r"\w+", line) if each.start() < column <= each.end()), "")
    found = module.symbols.get(word.lower())
    if not isinstance(found, Variable):
        raise CallFailure(400, RwsCode.NO_SUCH_SYMBOL, f"there is no datum at row {row}, column {column}")
    state = _symbol_state(task, module.name, found.name)
    fields = {
        "symbolname": found.name,
        "block_url": f"RAPID/{task.name}/{module.name}",
        "symbol_type": state.fields["symtyp"],
    }
    fields |= {name: state.fields[name] for name in ("linked", "local", "typurl", "dattyp", "ndim")}
    state = RwsState("rap-module-symbol", found.name, {"version": "1", **fields, "heap": "false", "refcount": "1"})
    return _module_page(task, module, state)


@ROUTES.answer(table.MOD_POSSIBLE_ALL, table.MODIFY_ALL_POSITION, table.MOD_POSSIBLE, table.MODIFY_POSITION)
def refuse_positions(controller: Irc5, call: RwsCall) -> Page:
    raise CallFailure(400, RwsCode.SERVICE_NOT_SUPPORTED, "positions are modified on the FlexPendant")


# Data


@ROUTES.answer(table.SYMBOL)
def get_symbol(controller: Irc5, call: RwsCall) -> Shown:
    url = call.names["symbol"]
    value = _at(controller, url, _read, missing=400)
    if call.option("value") == "raw" and call.option("json") == "1":  # a value of JSON, not its text
        document = {
            "_links": {"base": {"href": f"http://{call.host}{_BASE}"}},
            "_embedded": {"_state": [{"_type": "rap-data", "_title": f"RAPID/{url}", "value": _plain(value)}]},
        }
        return HttpReply(200, (("Content-Type", Form.JSON.value),), json.dumps(document).encode())
    state = table.SYMBOL.answered.state(f"RAPID/{url}", value)
    return resource("rapid", _BASE, f"symbol/data/RAPID/{url}", state)


def _read(task: Task, block: str, name: str) -> str:
    """A datum of a module or a routine under way, or one that RobotWare has in every task, such as tool0."""
    try:
        return task.read(block, name)
    except UnknownSymbol:
        found = task.library.datum(name)
        if found is None or _is_routine(block):
            raise
        return format_value(found.type, found.value)


def _plain(text: str) -> RapidValue:
    try:
        return decode(text)
    except ProtocolError:
        return text


def prepare_value(controller: Irc5, call: RwsCall) -> Callable[[], None] | None:
    literal = call.required("value")
    return functools.partial(_parse, literal) if len(literal) > _LONG_VALUE else None


@ROUTES.answer(table.SET_SYMBOL, prepare=prepare_value)
def set_symbol(controller: Irc5, call: RwsCall) -> None:
    refuse_in_manual_mode(controller, call, "writing RAPID data")
    literal = call.required("value")
    try:
        _at(controller, call.names["symbol"], lambda task, module, name: task.write(module, name, literal), 404)
    except RapidValueError as error:
        raise CallFailure(400, RwsCode.SYNTAX, str(error)) from error
    controller.settle()


def _parse(literal: str) -> None:
    """Parse a value, so that the parser has it when it is set; that raises the same errors."""
    with suppress(RapidSyntaxError):
        parse_expression(literal)


@ROUTES.answer(table.SET_INITIAL_VALUE)
def set_initial_value(controller: Irc5, call: RwsCall) -> None:
    """The value a datum begins with: that of a persistent is its value at all times."""
    kind = _at(controller, call.names["symbol"], lambda task, module, name: task.kind_of(module, name), 404)
    if kind != "per":
        raise CallFailure(
            400, RwsCode.SYMBOL_NOT_PERSISTENT, "the initial value of a VAR or CONST is changed in its module's text"
        )
    set_symbol(controller, call)


@ROUTES.answer(table.VALIDATE)
def validate(controller: Irc5, call: RwsCall) -> None:
    """Whether a literal is a value of a type."""
    task, name = find_task(controller, call.required("task")), call.required("datatype")
    node = s.Name(name)
    try:
        modules = task.program.modules.values()
        module = next((each for each in modules if name.lower() in each.symbols), next(iter(modules), None))
        type_ = task.library.type(name) if module is None else task.program.type_named(name, module, node)
        parse_value(type_, call.required("value"))
    except (RapidValueError, RapidReferenceError) as error:
        raise CallFailure(400, RwsCode.SEMANTIC, str(error)) from error


@ROUTES.answer(table.SYMBOL_PROPERTIES)
def get_symbol_properties(controller: Irc5, call: RwsCall) -> Page:
    url = call.names["symbol"]
    state = _at(controller, url, _symbol_state, missing=400)
    return resource("rapid", _BASE, f"symbol/properties/{state.title}", state)


def _is_routine(block: str) -> bool:
    """Whether a block is a routine under way, as module/routine or %1, and no module."""
    return "/" in block or block.startswith("%")


def _symbol_state(task: Task, block: str, name: str) -> RwsState:
    kind, sizes = task.kind_of(block, name), task.dimensions_of(block, name)
    url = f"RAPID/{task.name}/{block}/{name}"
    type_name = task.type_of(block, name)
    fields = {
        "symburl": url,
        "name": name,
        "symtyp": kind,
        "named": "true",
        "dattyp": type_name,
        "ndim": str(len(sizes)),
        "dim": ",".join(map(str, sizes)),
        "heap": "false",
        "linked": "true",
        "local": "false",
        "rdonly": "true" if kind in ("con", "for") else "false",
        **_OWNERS.get(kind, {}),
        "storage": kind,
        "typurl": f"RAPID/{type_name}" if _is_routine(block) else f"RAPID/{task.name}/{block}/{type_name}",
    }
    return RwsState(_SYMBOL_TYPES[kind], url, fields)


def _at(controller: Irc5, url: str, act: Callable[[Task, str, str], T], missing: int) -> T:
    """What ``act`` finds at ``task/block/symbol`` or ``task/symbol``; status ``missing`` when there is nothing.

    A block is a module, or a routine under way: ``module/routine``, its innermost call, or a stack frame ``%1``.
    """
    task_name, *block, name = url.split("/") if url.count("/") in (1, 2, 3) else ("", "")
    task = controller.tasks.get(task_name.upper())
    if task is not None:
        for place in ["/".join(block)] if block else [each.name for each in task.modules]:
            try:
                return act(task, place, name)
            except UnknownSymbol:
                continue
    code = RwsCode.FAIL if missing == 400 else RwsCode.NO_SUCH_SYMBOL
    raise CallFailure(missing, code, f"Symbol not found: RAPID/{url}")


@ROUTES.answer(table.SYMBOLS)
def get_symbols(controller: Irc5, call: RwsCall) -> Page:
    """Nothing: symbols are searched, since a robot has thousands."""
    return resource("rapid", _BASE, "symbols")


@ROUTES.answer(table.SEARCH)
def search(controller: Irc5, call: RwsCall) -> Page:
    """The symbols of a block that fit; at least one parameter has to say which."""
    if not call.form:
        raise invalid("a search needs a parameter, such as blockurl=RAPID/T_ROB_L")
    parts = [part for part in call.parameter("blockurl", "RAPID").split("/") if part]
    if not parts or parts[0].upper() != "RAPID":
        raise invalid("blockurl begins with RAPID")
    tasks = [find_task(controller, parts[1])] if len(parts) > 1 else list(controller.tasks.values())
    if call.parameter("view", "block") == "stack":
        found = _symbols_of_frame(tasks[0], call) if len(parts) > 1 else []
    else:
        found = _symbols_of_block(tasks, parts, call)
    wanted = {kind.strip() for kind in call.parameter("symtyp", "any").lower().split(",")}
    pattern = _pattern(call.parameter("regexp", ""))
    type_name, variables = call.parameter("dattyp", "").lower(), call.parameter("vartyp", "any")
    used = set(re.findall(r"\w+", " ".join(module.text for task in tasks for module in task.modules).lower()))
    fitting = [
        state
        for state in found
        if ("any" in wanted or state.fields["symtyp"] in wanted)
        and (not type_name or state.fields.get("dattyp", "").lower() == type_name)
        and (variables in ("any", "udef") or (state.fields.get("rdonly") == "true") is (variables in ("ro", "loop")))
        and pattern.search(state.fields["name"])
        and (call.parameter("onlyused", "FALSE").upper() != "TRUE" or state.fields["name"].lower() in used)
    ]
    # A search names the symbol before its address, its properties after it (reference/rws.md §6.6-6.7).
    named = (replace(state, fields={"name": state.fields["name"], **state.fields}) for state in fitting)
    return resource("rapid", _BASE, "symbols", *named)


def _symbols_of_frame(task: Task, call: RwsCall) -> list[RwsState]:
    """What has a value in a routine under way: parameters, data and loop variables of a stack frame."""
    number = call.parameter("stack", "1")
    block = f"%{max(int(number), 1) if number.isdecimal() else 1}"  # 0, which means none elsewhere, is the first, too
    try:
        return [_in_list(_symbol_state(task, block, name)) for name in task.symbols(block)]
    except UnknownSymbol as error:
        raise CallFailure(400, RwsCode.NO_PP, str(error)) from error


def _symbols_of_block(tasks: Sequence[Task], parts: Sequence[str], call: RwsCall) -> list[RwsState]:
    """The symbols of a module, a task or all."""
    is_recursive = call.parameter("recursive", "TRUE").upper() == "TRUE"
    found: list[RwsState] = []
    for task in tasks:
        modules = [
            each for each in task.program.modules.values() if len(parts) < 3 or each.name.lower() == parts[2].lower()
        ]
        if len(parts) > 2 and not modules:
            raise CallFailure(400, RwsCode.NO_SUCH_SYMBOL, f"the task {task.name} has no module {parts[2][:50]!r}")
        if len(parts) == 1:
            found.append(
                RwsState("rap-symproptask-li", f"RAPID/{task.name}", _plain_fields(f"RAPID/{task.name}", "tsk"))
            )
        for module in modules if len(parts) > 1 or is_recursive else ():
            url = f"RAPID/{task.name}/{module.name}"
            if len(parts) < 3:
                found.append(RwsState("rap-sympropmodule-li", url, _plain_fields(url, "mod")))
            if len(parts) > 2 or is_recursive:
                found += _symbols(task, module)
    return found


def _in_list(state: RwsState) -> RwsState:
    """A symbol as a search lists it, which has not all of its properties."""
    fields = {name: text for name, text in state.fields.items() if name not in ("heap", "linked", "storage")}
    return RwsState(f"{state.type}-li", state.title, fields)


def _plain_fields(url: str, kind: str) -> dict[str, str]:
    return {"symburl": url, "name": url.rpartition("/")[2], "symtyp": kind, "named": "true"}


def _symbols(task: Task, module: LoadedModule) -> Iterator[RwsState]:
    for symbol in tuple(module.symbols.values()):
        if isinstance(symbol, Variable):
            try:
                yield _in_list(_symbol_state(task, module.name, symbol.name))
            except (UnknownSymbol, RapidReferenceError):
                continue  # of a type that is missing
        elif isinstance(symbol, UserRoutine):
            yield _routine_state(task, symbol, "-li")
        else:
            kind = "rec" if isinstance(symbol.syntax, s.Record) else "ali"
            url = f"RAPID/{task.name}/{module.name}/{symbol.syntax.name}"
            yield RwsState(f"rap-symprop{'record' if kind == 'rec' else 'alias'}-li", url, _plain_fields(url, kind))


def _pattern(text: str) -> re.Pattern[str]:
    """A regular expression of a client, without what may take for ever."""
    repeats = len(re.findall(r"[*+?{]", text))
    if len(text) > _LONGEST_PATTERN or repeats > _MOST_REPEATS or "(" in text:
        raise invalid(f"regexp has up to {_LONGEST_PATTERN} characters and {_MOST_REPEATS} repeats, and no groups")
    try:
        return re.compile(text, re.IGNORECASE)
    except re.error as error:
        raise invalid(f"regexp is not a regular expression: {error}") from error
