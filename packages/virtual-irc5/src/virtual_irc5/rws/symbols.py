"""The virtual controller's answers on ``/rw/rapid/symbol``, ``…/symbols``: values, properties, search (rws.md §6)."""

from __future__ import annotations

import functools
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TypeVar

from abb_protocols.errors import ProtocolError
from abb_protocols.rws.documents import Form, Page, RwsState
from abb_protocols.rws.operations import symbols as table
from abb_protocols.rws.rapid_values import RapidValue, decode
from abb_protocols.rws.values import RwsCode
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.rapid import ast as s
from virtual_irc5.rapid.literals import format_value, parse_value
from virtual_irc5.rapid.loaded_modules import LoadedModule, UserRoutine
from virtual_irc5.rapid.parser import parse_expression
from virtual_irc5.rapid.task import Task
from virtual_irc5.rapid.types import RapidReferenceError, RapidSyntaxError, RapidValueError, UnknownSymbol, Variable
from virtual_irc5.rws.http import HttpReply
from virtual_irc5.rws.rapid import rws_task
from virtual_irc5.rws.render import page_at
from virtual_irc5.rws.router import Routes
from virtual_irc5.rws.rws_call import CallFailure, RwsCall, Shown, bad_call
from virtual_irc5.rws.users import refuse_in_manual_mode

_T = TypeVar("_T")

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


@ROUTES.answer(table.SYMBOL)
def _get_symbol(controller: Irc5, call: RwsCall) -> Shown:
    url = call.names["symbol"]
    value = _at(controller, url, _read, missing=400)
    if call.option("value") == "raw" and call.option("json") == "1":  # a value of JSON, not its text
        document = {
            "_links": {"base": {"href": f"http://{call.host}{_BASE}"}},
            "_embedded": {"_state": [{"_type": "rap-data", "_title": f"RAPID/{url}", "value": _plain(value)}]},
        }
        return HttpReply(200, (("Content-Type", Form.JSON.value),), json.dumps(document).encode())
    state = table.SYMBOL.answered.state(f"RAPID/{url}", value)
    return page_at("rapid", _BASE, f"symbol/data/RAPID/{url}", state)


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


def _prepare_value(controller: Irc5, call: RwsCall) -> Callable[[], None] | None:
    literal = call.required("value")
    return functools.partial(_parse, literal) if len(literal) > _LONG_VALUE else None


@ROUTES.answer(table.SET_SYMBOL, prepare=_prepare_value)
def _set_symbol(controller: Irc5, call: RwsCall) -> None:
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
def _set_initial_value(controller: Irc5, call: RwsCall) -> None:
    """The value a datum begins with: that of a persistent is its value at all times."""
    kind = _at(controller, call.names["symbol"], lambda task, module, name: task.kind_of(module, name), 404)
    if kind != "per":
        raise CallFailure(
            400, RwsCode.SYMBOL_NOT_PERSISTENT, "the initial value of a VAR or CONST is changed in its module's text"
        )
    _set_symbol(controller, call)


@ROUTES.answer(table.VALIDATE_SYMBOL)
def _validate(controller: Irc5, call: RwsCall) -> None:
    """Whether a literal is a value of a type."""
    task, name = rws_task(controller, call.required("task")), call.required("datatype")
    node = s.Name(name)
    try:
        modules = task.program.modules.values()
        module = next((each for each in modules if name.lower() in each.symbols), next(iter(modules), None))
        type_ = task.library.type(name) if module is None else task.program.type_named(name, module, node)
        parse_value(type_, call.required("value"))
    except (RapidValueError, RapidReferenceError) as error:
        raise CallFailure(400, RwsCode.SEMANTIC, str(error)) from error


@ROUTES.answer(table.SYMBOL_PROPERTIES)
def _get_symbol_properties(controller: Irc5, call: RwsCall) -> Page:
    url = call.names["symbol"]
    state = _at(controller, url, symbol_state, missing=400)
    return page_at("rapid", _BASE, f"symbol/properties/{state.title}", state)


def _is_routine(block: str) -> bool:
    """Whether a block is a routine under way, as module/routine or %1, and no module."""
    return "/" in block or block.startswith("%")


def routine_state(task: Task, routine: UserRoutine, suffix: str = "") -> RwsState:
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


def symbol_state(task: Task, block: str, name: str) -> RwsState:
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


def _at(controller: Irc5, url: str, act: Callable[[Task, str, str], _T], missing: int) -> _T:
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
def _get_symbols(controller: Irc5, call: RwsCall) -> Page:
    """Nothing: symbols are searched, since a robot has thousands."""
    return page_at("rapid", _BASE, "symbols")


@ROUTES.answer(table.SEARCH)
def _search(controller: Irc5, call: RwsCall) -> Page:
    """The symbols of a block that fit; at least one parameter has to say which."""
    if not call.form:
        raise bad_call("a search needs a parameter, such as blockurl=RAPID/T_ROB_L")
    parts = [part for part in call.parameter("blockurl", "RAPID").split("/") if part]
    if not parts or parts[0].upper() != "RAPID":
        raise bad_call("blockurl begins with RAPID")
    tasks = [rws_task(controller, parts[1])] if len(parts) > 1 else list(controller.tasks.values())
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
    return page_at("rapid", _BASE, "symbols", *named)


def _symbols_of_frame(task: Task, call: RwsCall) -> list[RwsState]:
    """What has a value in a routine under way: parameters, data and loop variables of a stack frame."""
    number = call.parameter("stack", "1")
    block = f"%{max(int(number), 1) if number.isdecimal() else 1}"  # 0, which means none elsewhere, is the first, too
    try:
        return [_in_list(symbol_state(task, block, name)) for name in task.symbols(block)]
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
                yield _in_list(symbol_state(task, module.name, symbol.name))
            except (UnknownSymbol, RapidReferenceError):
                continue  # of a type that is missing
        elif isinstance(symbol, UserRoutine):
            yield routine_state(task, symbol, "-li")
        else:
            kind = "rec" if isinstance(symbol.syntax, s.Record) else "ali"
            url = f"RAPID/{task.name}/{module.name}/{symbol.syntax.name}"
            yield RwsState(f"rap-symprop{'record' if kind == 'rec' else 'alias'}-li", url, _plain_fields(url, kind))


def _pattern(text: str) -> re.Pattern[str]:
    """A regular expression of a client, without what may take for ever."""
    repeats = len(re.findall(r"[*+?{]", text))
    if len(text) > _LONGEST_PATTERN or repeats > _MOST_REPEATS or "(" in text:
        raise bad_call(f"regexp has up to {_LONGEST_PATTERN} characters and {_MOST_REPEATS} repeats, and no groups")
    try:
        return re.compile(text, re.IGNORECASE)
    except re.error as error:
        raise bad_call(f"regexp is not a regular expression: {error}") from error
