"""RAPID's strings, and numbers that are written in digits; positions in strings count from 1."""

from __future__ import annotations

import operator
import re

from virtual_irc5.rapid.builtins.data import DATA
from virtual_irc5.rapid.builtins.maths import decimals
from virtual_irc5.rapid.call import Call
from virtual_irc5.rapid.literals import format_value, parse_value
from virtual_irc5.rapid.rapid_library import Library
from virtual_irc5.rapid.types import (
    LONGEST_STRING,
    STRING,
    RapidRuntimeError,
    RapidValueError,
    resolved_type,
    value_count,
)

STRINGS = Library(DATA)
_ARGUMENT_PLACE = re.compile(r"\{([1-5])\}")  # of StrFormat

PRINTED = r"string String, \num Num | \bool Bool | \pos Pos | \orient Orient | \dnum Dnum"
"""What TPWrite and Write take: a text, and a value behind it."""


def printed_text(call: Call) -> str:
    """The text of a call, with its value behind it."""
    text: str = call["String"]
    for name in ("Num", "Bool", "Pos", "Orient", "Dnum"):
        if call.present(name):
            text += format_value(call.reference(name).type, call[name])
    return text


@STRINGS.function("NumToStr", r"num Val, num Dec, \switch Exp", "string")
@STRINGS.function("DnumToStr", r"dnum Val, num Dec, \switch Exp", "string")
def _number_text(call: Call) -> str:
    return f"{call['Val']:.{decimals(call, LONGEST_STRING)}{'E' if call.present('Exp') else 'f'}}"


@STRINGS.function("ValToStr", "anyvalue Val", "string")
def _value_to_string(call: Call) -> str:
    type_, value = call.reference("Val").type, call["Val"]
    if value_count(type_) > LONGEST_STRING:
        sentence = f"{value_count(type_)} values do not fit into the {LONGEST_STRING} characters of a string."
        raise RapidRuntimeError("ERR_STRTOOLNG", sentence)
    return str(value) if resolved_type(type_) == STRING else format_value(type_, value)


@STRINGS.function("StrToVal", "string Str, INOUT anytype Val", "bool")
def _string_to_value(call: Call) -> bool:
    type_ = call.reference("Val").type
    if resolved_type(type_) == STRING:
        call["Val"] = call["Str"]
        return True
    try:
        call["Val"] = parse_value(type_, call["Str"])
    except RapidValueError:
        return False
    return True


@STRINGS.function("StrLen", "string Str", "num")
def _text_length(call: Call) -> float:
    return len(call["Str"])


@STRINGS.function("StrPart", "string Str, num ChPos, num Len", "string")
def _part_of_text(call: Call) -> str:
    start = _character_index(call)
    text: str = call["Str"]
    if call["Len"] < 0 or start + call["Len"] > len(text):
        raise RapidRuntimeError("ERR_ARGVALERR", f"'{text}' has no {call['Len']:g} characters from {start + 1}.")
    return text[start : start + int(call["Len"])]


@STRINGS.function("StrFormat", "string Str, " + ", ".join(rf"\string Arg{number}" for number in range(1, 6)), "string")
def _filled_text(call: Call) -> str:
    """A text with its places {1} to {5} filled; a place whose argument is left out stays as it is written."""
    return _ARGUMENT_PLACE.sub(lambda place: call.get(f"Arg{place[1]}", place[0]), call["Str"])


@STRINGS.function("StrFind", r"string Str, num ChPos, string Set, \switch NotInSet", "num")
def _find_character(call: Call) -> float:
    text, wanted = call["Str"], not call.present("NotInSet")
    places = range(_character_index(call, past_end=True), len(text))
    return next((i + 1 for i in places if (text[i] in call["Set"]) == wanted), len(text) + 1)


@STRINGS.function("StrMatch", "string Str, num ChPos, string Pattern", "num")
def _find_text(call: Call) -> float:
    found: int = call["Str"].find(call["Pattern"], _character_index(call, past_end=True))
    return found + 1 if found >= 0 else len(call["Str"]) + 1


@STRINGS.function("StrMemb", "string Str, num ChPos, string Set", "bool")
def _is_in_set(call: Call) -> bool:
    return call["Str"][_character_index(call)] in call["Set"]


@STRINGS.function("StrMap", "string Str, string FromMap, string ToMap", "string")
def _mapped_text(call: Call) -> str:
    source, target = call["FromMap"], call["ToMap"]
    if len(source) != len(target):
        raise RapidRuntimeError("ERR_ARGVALERR", f"StrMap needs maps of one length, not '{source}' and '{target}'.")
    return str(call["Str"]).translate(str.maketrans(source, target))


@STRINGS.function("StrOrder", "string Str1, string Str2, string Order", "bool")
def _is_text_in_order(call: Call) -> bool:
    """Whether Str1 <= Str2; characters that are not in Order follow those that are (RAPID reference manual)."""
    order: str = call["Order"]
    keys = [[order.find(c) if c in order else len(order) + ord(c) for c in call[name]] for name in ("Str1", "Str2")]
    return keys[0] <= keys[1]


def _character_index(call: Call, *, past_end: bool = False) -> int:
    """The argument ChPos counted from 0; just behind the last character only where a search may end."""
    position, text = call["ChPos"], call["Str"]
    if position != int(position) or not 1 <= position <= len(text) + past_end:
        raise RapidRuntimeError("ERR_ARGVALERR", f"'{text}' has no character {position:g}.")
    return int(position) - 1


STRINGS.data("STR_DIGIT", "string", "0123456789")
STRINGS.data("STR_WHITE", "string", " \t\r\n")
STRINGS.data("STR_UPPER", "string", "ABCDEFGHIJKLMNOPQRSTUVWXYZ")
STRINGS.data("STR_LOWER", "string", "abcdefghijklmnopqrstuvwxyz")


# Numbers written in digits ------------------------------------------------------------------------------------------

_LARGEST_HEX = 0x7FFF_FFFF_FFFF_FFFF
_LARGEST_DIGITS = 4_294_967_295
RELATIONS = {1: operator.lt, 2: operator.le, 3: operator.eq, 4: operator.gt, 5: operator.ge, 6: operator.ne}
_OPERATIONS = {1: operator.add, 2: operator.sub, 3: operator.mul, 4: operator.floordiv, 5: operator.mod}


@STRINGS.function("DecToHex", "string Str", "string")
@STRINGS.function("HexToDec", "string Str", "string")
def _other_base(call: Call) -> str:
    base = 10 if call.name == "DecToHex" else 16
    try:
        value = int(call["Str"], base)
    except ValueError as error:
        raise call.error("ERR_ARGVALERR", f"'{call['Str']}' is no such number.") from error
    if not 0 <= value <= _LARGEST_HEX:
        raise RapidRuntimeError("ERR_INT_MAXVAL", f"{call.name} takes 0 to {_LARGEST_HEX}, not {call['Str']}.")
    return f"{value:X}" if base == 10 else str(value)


def _digits(call: Call, name: str) -> int:
    """A stringdig: a whole number from 0 to 4294967295, as DeviceNet and cfg files have them."""
    text: str = call[name]
    if not (text.isascii() and text.isdigit()):
        raise call.error("ERR_INT_NOTVAL", f"'{text}' is not a whole number in digits.")
    if int(text) > _LARGEST_DIGITS:
        raise RapidRuntimeError("ERR_INT_MAXVAL", f"{call.name} takes up to {_LARGEST_DIGITS}, not {text}.")
    return int(text)


@STRINGS.function("StrDigCmp", "stringdig StrDig1, opnum Relation, stringdig StrDig2", "bool")
def _compare_digits(call: Call) -> bool:
    relation = RELATIONS.get(int(call["Relation"]))
    if relation is None:
        raise RapidRuntimeError("ERR_ARGVALERR", "StrDigCmp takes LT, LTEQ, EQ, NOTEQ, GTEQ or GT.")
    return bool(relation(_digits(call, "StrDig1"), _digits(call, "StrDig2")))


@STRINGS.function("StrDigCalc", "stringdig StrDig1, opcalc Operation, stringdig StrDig2", "stringdig")
def _calculate_digits(call: Call) -> str:
    """The sum, difference, product, quotient or rest of two whole numbers; raises ERR_CALC_... as ABB's does."""
    left, operation, right = _digits(call, "StrDig1"), int(call["Operation"]), _digits(call, "StrDig2")
    if operation in (4, 5) and right == 0:
        raise call.error("ERR_CALC_DIVZERO", f"{left} is divided by zero.")
    if operation not in _OPERATIONS:
        raise RapidRuntimeError("ERR_ARGVALERR", "StrDigCalc takes OpAdd, OpSub, OpMult, OpDiv or OpMod.")
    value: int = _OPERATIONS[operation](left, right)
    if value < 0:
        raise call.error("ERR_CALC_NEG", f"{left} - {right} is negative.")
    if value > _LARGEST_DIGITS:
        raise call.error("ERR_CALC_OVERFLOW", f"{value} is above {_LARGEST_DIGITS}.")
    return str(value)
