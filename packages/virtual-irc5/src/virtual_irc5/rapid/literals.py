"""Literals: RAPID's values as text, as the controller prints and reads them (reference/rws.md §6.5)."""

from __future__ import annotations

import re
from typing import Any

from virtual_irc5.rapid.ast import Aggregate, Expression, Literal, Unary
from virtual_irc5.rapid.parser import parse_expression
from virtual_irc5.rapid.types import (
    BOOL,
    DNUM,
    NUM,
    STRING,
    ArrayType,
    AtomicType,
    RapidRuntimeError,
    RapidSyntaxError,
    RapidValueError,
    RecordType,
    Type,
    resolved_type,
    type_text,
)

_NUM_DIGITS = 6  # significant, of a num with decimals
_DNUM_DIGITS = 15
_LARGEST_EXACT = {"num": 8388608, "dnum": 4503599627370496}  # integers up to here are printed in full
_SPECIAL = re.compile(r'["\\\x00-\x1f]')


def format_value(type_: Type, value: Any) -> str:
    """The value as a RAPID literal, without blanks: `[[600,0,225.3],[1,0,0,0]]`, `9E+09`, `TRUE`, `"text"`."""
    type_ = resolved_type(type_)
    if isinstance(type_, RecordType):
        parts = (format_value(t, v) for (_, t), v in zip(type_.components, value, strict=True))
        return f"[{','.join(parts)}]"
    if isinstance(type_, ArrayType):
        return f"[{','.join(format_value(type_.row, item) for item in value)}]"
    if type_ == BOOL:
        return "TRUE" if value else "FALSE"
    if type_ == STRING:
        escaped = _SPECIAL.sub(lambda m: m[0] * 2 if m[0] in '"\\' else f"\\{ord(m[0]):02X}", value)
        return f'"{escaped}"'
    if type_ in (NUM, DNUM):
        return format_number(value, type_.name)
    raise RapidValueError(f"The type {type_.name} has no values that could be written down.")


def format_number(value: float, type_name: str = "num") -> str:
    if value == int(value) and abs(value) <= _LARGEST_EXACT[type_name]:
        return str(int(value))
    return f"{value:.{_NUM_DIGITS if type_name == 'num' else _DNUM_DIGITS}G}"


def parse_value(type_: Type, text: str) -> Any:
    """The value a literal stands for.

    Raises:
        RapidValueError: the text is no literal, or one of another type.
    """
    try:
        return _value(type_, parse_expression(text))
    except RapidSyntaxError as error:
        raise RapidValueError(f"'{text}' is not a value of type {type_text(type_)}: {error}") from error
    except (_WrongType, RapidRuntimeError) as error:
        raise RapidValueError(f"'{text}' is not a value of type {type_text(type_)}. {error}".rstrip()) from error


class _WrongType(Exception):
    """Some part of a literal does not have the type that is needed there."""


def _value(type_: Type, node: Expression) -> Any:
    type_ = resolved_type(type_)
    if isinstance(type_, RecordType):
        items = _items(node, len(type_.components))
        return type_.value_class._make(_value(t, item) for (_, t), item in zip(type_.components, items, strict=True))
    if isinstance(type_, ArrayType):
        return tuple(_value(type_.row, item) for item in _items(node, type_.sizes[0]))
    if isinstance(type_, AtomicType):
        return type_.convert(_atom(type_, node))
    raise _WrongType(f"The type {type_.name} has no values that could be written down.")


def _items(node: Expression, count: int) -> tuple[Expression, ...]:
    if not isinstance(node, Aggregate) or len(node.items) != count:
        raise _WrongType(f"An aggregate of {count} in brackets is expected.")
    return node.items


def _atom(type_: AtomicType, node: Expression) -> Any:
    if isinstance(node, Unary) and node.operator in "+-" and type_ in (NUM, DNUM):
        if isinstance(node.operand, Unary):  # "--5" is an expression
            raise _WrongType("A number has one sign.")
        value = _atom(type_, node.operand)
        return -value if node.operator == "-" else value
    wanted = {"bool": bool, "string": str}.get(type_.name, float)
    if not isinstance(node, Literal) or type(node.value) is not wanted:
        raise _WrongType(f"A {type_.name} is expected.")
    return node.value
