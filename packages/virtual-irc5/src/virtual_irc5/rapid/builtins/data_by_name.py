"""RAPID's access to data by name: searches (SetDataSearch, GetNextSym), reading and writing (GetDataVal, SetDataVal).

A search takes names by a pattern of ABB's: `.` any character, `[a-z]` and `[^a-z]` sets, `*`, `+` and `?` after what
may come again, `|` between alternatives, and parentheses. The time it takes grows with pattern and name only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from abb_protocols.errors import RapidError
from virtual_irc5.rapid.ast import Storage
from virtual_irc5.rapid.builtins.data import DATA
from virtual_irc5.rapid.builtins.information import OF_TASK
from virtual_irc5.rapid.call import Call
from virtual_irc5.rapid.compiler import CONSTANT_FRAME
from virtual_irc5.rapid.expressions import Expressions, Scope
from virtual_irc5.rapid.loaded_modules import LoadedModule
from virtual_irc5.rapid.parser import parse_reference
from virtual_irc5.rapid.rapid_library import Library
from virtual_irc5.rapid.task import task_of, task_of_argument
from virtual_irc5.rapid.types import (
    UNSET_DATA,
    ArrayType,
    RapidRuntimeError,
    Reference,
    Type,
    Variable,
    is_assignable,
    raised_as,
    resolved_type,
)

SYMBOLS = Library(DATA)
_LONGEST_PATTERN = 80


@dataclass(eq=False, slots=True)
class DataPosition:
    """What a datapos stands for: the module of a symbol that a search has found."""

    module: str = ""


SYMBOLS.object_type("datapos", DataPosition)

# Patterns: each part of one is a function from the places where it may begin to those where it may end ---------------

_Ends = frozenset[int]
_Matcher = Callable[[str, _Ends], _Ends]


def _matches(pattern: str, name: str) -> bool:
    """Whether a pattern takes all of a name, without regard to case; raises ERR_ARGVALERR for one that is none."""
    if len(pattern) > _LONGEST_PATTERN:
        raise RapidRuntimeError("ERR_ARGVALERR", f"A pattern has up to {_LONGEST_PATTERN} characters.")
    text = pattern.lower().removeprefix("^").removesuffix("$")
    matcher, rest = _pattern_alternatives(text, 0)
    if rest != len(text):
        raise RapidRuntimeError("ERR_ARGVALERR", f"'{pattern}' is not a pattern: see position {rest + 1}.")
    return len(name) in matcher(name.lower(), frozenset([0]))


def _pattern_alternatives(text: str, at: int) -> tuple[_Matcher, int]:
    first, at = _pattern_sequence(text, at)
    if at >= len(text) or text[at] != "|":
        return first, at
    other, at = _pattern_alternatives(text, at + 1)
    return lambda name, starts: first(name, starts) | other(name, starts), at


def _pattern_sequence(text: str, at: int) -> tuple[_Matcher, int]:
    parts: list[_Matcher] = []
    while at < len(text) and text[at] not in "|)":
        part, at = _pattern_part(text, at)
        while at < len(text) and text[at] in "*+?":
            part, at = _repeated_part(part, text[at]), at + 1
        parts.append(part)

    def sequence(name: str, starts: _Ends) -> _Ends:
        for part in parts:
            starts = part(name, starts)
        return starts

    return sequence, at


def _repeated_part(part: _Matcher, sign: str) -> _Matcher:
    def repeated(name: str, starts: _Ends) -> _Ends:
        found = new = part(name, starts)
        while new and sign != "?":
            new = part(name, new) - found
            found |= new
        return found if sign == "+" else found | starts

    return repeated


def _pattern_part(text: str, at: int) -> tuple[_Matcher, int]:
    if text[at] == "(":
        group, end = _pattern_alternatives(text, at + 1)
        if end >= len(text):
            raise RapidRuntimeError("ERR_ARGVALERR", f"'{text}' is not a pattern: a parenthesis is open.")
        return group, end + 1
    if text[at] == "[":
        end = text.find("]", at + 1)
        if end < 0:
            raise RapidRuntimeError("ERR_ARGVALERR", f"'{text}' is not a pattern: a bracket is open.")
        inside = text[at + 1 : end]
        is_excluding, inside = inside.startswith("^"), inside.removeprefix("^")
        ranges = [(inside[i], inside[i + 2]) for i in range(len(inside) - 2) if inside[i + 1] == "-"]
        return _one_character(
            lambda c: (c in inside or any(low <= c <= high for low, high in ranges)) is not is_excluding
        ), end + 1
    wanted = text[at]
    return _one_character(lambda c: wanted in (".", c)), at + 1


def _one_character(takes: Callable[[str], bool]) -> _Matcher:
    return lambda name, starts: frozenset(i + 1 for i in starts if i < len(name) and takes(name[i]))


# The search -------------------------------------------------------------------------------------------------------

_SCOPE = (
    r"\switch PersSym, \switch VarSym, \switch ConstSym, \string InTask | \string InMod, \string InRout, "
    r"\switch GlobalSym | \switch LocalSym"
)


_STORAGES = {"PersSym": Storage.PERS, "VarSym": Storage.VAR, "ConstSym": Storage.CONST}


@SYMBOLS.instruction("SetDataSearch", rf"string Type, \string TypeMod, \string Object, {_SCOPE}")
def _set_data_search(call: Call) -> None:
    storages = {storage for name, storage in _STORAGES.items() if call.present(name)} or set(Storage)
    pattern, module = call.get("Object", ".*"), call.get("InMod", "")
    _matches(pattern, "")  # a pattern that is none is an error of this instruction
    if module and module.lower() not in task_of(call).program.modules:
        raise call.error("ERR_MODULE", f"there is no module '{module}'.")
    found = [
        (owner.name, variable.name)
        for owner, variable in _data_of_type(call, call["Type"])
        if variable.storage in storages
        and (not module or owner.name.lower() == module.lower())
        and (not call.present("GlobalSym") or not variable.is_local)
        and (not call.present("LocalSym") or variable.is_local)
        and _matches(pattern, variable.name)
    ]
    call.task.host.devices.searches[call.task.name] = iter(found)


@SYMBOLS.function("GetNextSym", r"VAR string Object, VAR datapos Block, \switch Recursive", "bool")
def _next_symbol(call: Call) -> bool:
    search = call.task.host.devices.searches.get(call.task.name, iter(()))
    module, name = next(search, ("", ""))
    if not name:
        return False
    call["Object"] = name
    call["Block"].module = module
    return True


def _data_of_type(call: Call, type_name: str) -> Iterator[tuple[LoadedModule, Variable]]:
    """All data of a type in the task's modules."""
    for module in tuple(task_of(call).program.modules.values()):
        for variable in tuple(module.data):
            if variable.value is not UNSET_DATA and type_name.lower() in ("", variable.type.name.lower()):
                yield module, variable


# Reading and writing ----------------------------------------------------------------------------------------------

_OBJECT = rf"string Object, \VAR datapos Block | {OF_TASK}"


def _named_datum(call: Call) -> Reference:
    """The datum that Object names, which may be an element or component; raises ERR_SYM_ACCESS."""
    task, name = task_of_argument(call), call["Object"]
    program = task.program
    owner = program.modules.get(call["Block"].module.lower()) if call.present("Block") else None
    if owner is None and task is call.task:
        owner = task_of(call).frame.routine.module
    root = name.partition("{")[0].partition(".")[0]
    found = program.find(root, owner)
    if not isinstance(found, Variable) or found.value is UNSET_DATA:
        raise call.error("ERR_SYM_ACCESS", f"there is no datum '{name}'.")
    if task is not call.task and found.storage is Storage.VAR:
        raise call.error("ERR_SYM_ACCESS", f"'{name}' of {task.name} is a variable, which is its own.")
    if root == name:
        return found
    owner = owner or next(iter(program.modules.values()))
    with raised_as("ERR_SYM_ACCESS", RapidError, before=f"{call.name}: there is no datum '{name}': "):
        return Expressions(Scope(program, owner)).reference(parse_reference(name))[0](CONSTANT_FRAME)


def _check_type(call: Call, wanted: Type, given: Type) -> None:
    if not is_assignable(wanted, given):
        if is_assignable(_element(wanted), _element(given)):
            raise call.error("ERR_INVDIM", f"'{call['Object']}' and Value have different dimensions.")
        sentence = f"'{call['Object']}' is not of the type {call.reference('Value').type.name}."
        raise call.error("ERR_SYMBOL_TYPE", sentence)


def _element(type_: Type) -> Type:
    array = resolved_type(type_)
    return array.element if isinstance(array, ArrayType) else array


@SYMBOLS.instruction("GetDataVal", rf"{_OBJECT}, INOUT anytype Value")
def _get_value(call: Call) -> None:
    datum = _named_datum(call)
    _check_type(call, call.reference("Value").type, datum.type)
    call["Value"] = datum.value


@SYMBOLS.instruction("SetDataVal", rf"{_OBJECT}, anytype Value")
def _set_value(call: Call) -> None:
    datum = _named_datum(call)
    root = task_of(call).program.find(datum.name, None)
    if (isinstance(datum, Variable) and datum.is_constant) or (isinstance(root, Variable) and root.is_constant):
        raise call.error("ERR_SYM_ACCESS", f"'{call['Object']}' is a constant.")
    _check_type(call, datum.type, call.reference("Value").type)
    datum.value = datum.type.convert(call["Value"])


@SYMBOLS.instruction("SetAllDataVal", r"string Type, \string TypeMod, \string Object, \switch Hidden, anytype Value")
def _set_all_values(call: Call) -> None:
    """Give all variables and persistents of a type a value, those whose name the pattern takes."""
    value, type_ = call["Value"], call.reference("Value").type
    for _, variable in _data_of_type(call, call["Type"]):
        is_meant = not variable.is_constant and _matches(call.get("Object", ".*"), variable.name)
        if is_meant and is_assignable(variable.type, type_):  # arrays of the type are not
            variable.value = variable.type.convert(value)
