"""The operators of RAPID: which types each takes, what type it gives, and how it computes."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

from yumi.rapid.errors import RapidRuntimeError
from yumi.rapid.types import BOOL, DNUM, NUM, STRING, Type, is_assignable, is_numeric, resolved

Operation = Callable[[Any, Any], Any]


def _divided(left: float, right: float) -> float:
    if right == 0.0:
        raise RapidRuntimeError("ERR_DIVZERO", f"{left:g} is divided by zero.")
    return left / right


def _whole(left: float, right: float) -> tuple[int, int]:
    if right == 0.0:
        raise RapidRuntimeError("ERR_DIVZERO", f"{left:g} is divided by zero.")
    if left != int(left) or right != int(right):
        raise RapidRuntimeError("ERR_INT_NOTVAL", f"DIV and MOD take integers, not {left:g} and {right:g}.")
    return int(left), int(right)


def _integer_quotient(left: float, right: float) -> float:
    dividend, divisor = _whole(left, right)
    quotient = abs(dividend) // abs(divisor)
    return float(quotient if (dividend < 0) == (divisor < 0) else -quotient)


def _remainder(left: float, right: float) -> float:
    return math.fmod(*_whole(left, right))


def _sum(left: Any, right: Any) -> Any:
    return type(left)._make(map(operator.add, left, right))


def _difference(left: Any, right: Any) -> Any:
    return type(left)._make(map(operator.sub, left, right))


def _scaled(position: Any, factor: float) -> Any:
    return type(position)._make(component * factor for component in position)


def _cross(left: Any, right: Any) -> Any:
    (ax, ay, az), (bx, by, bz) = left, right
    return type(left)(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)


def _rotation_product(left: Any, right: Any) -> Any:
    (a, b, c, d), (e, f, g, h) = left, right
    return type(left)(
        a * e - b * f - c * g - d * h,
        a * f + b * e + c * h - d * g,
        a * g - b * h + c * e + d * f,
        a * h + b * g - c * f + d * e,
    )


NUMERIC: dict[str, tuple[Operation, bool]] = {
    "+": (operator.add, False),
    "-": (operator.sub, False),
    "*": (operator.mul, False),
    "/": (_divided, False),
    "DIV": (_integer_quotient, False),
    "MOD": (_remainder, False),
    "<": (operator.lt, True),
    "<=": (operator.le, True),
    ">": (operator.gt, True),
    ">=": (operator.ge, True),
}
RECORDS: dict[tuple[str, str, str], Operation] = {
    ("+", "pos", "pos"): _sum,
    ("-", "pos", "pos"): _difference,
    ("*", "pos", "num"): _scaled,
    ("*", "num", "pos"): lambda factor, position: _scaled(position, factor),
    ("*", "pos", "pos"): _cross,
    ("*", "orient", "orient"): _rotation_product,
}


def binary_operation(symbol: str, left: Type, right: Type) -> tuple[Operation, Type] | None:
    """The operation and the type of its result; None when the types do not go with the operator.

    AND and OR are not here: their right side is evaluated only when the left one has not decided.
    """
    if symbol in {"=", "<>"}:
        operation = operator.eq if symbol == "=" else operator.ne
        return (operation, BOOL) if is_assignable(left, right) else None
    left, right = resolved(left), resolved(right)
    if is_numeric(left) and left == right and symbol in NUMERIC:
        operation, is_comparison = NUMERIC[symbol]
        return operation, BOOL if is_comparison else left
    if symbol == "+" and left == right == STRING:
        return operator.add, STRING
    if symbol == "XOR" and left == right == BOOL:
        return operator.ne, BOOL
    record = RECORDS.get((symbol, left.name, right.name))
    return None if record is None else (record, right if left == NUM else left)


def unary_operation(symbol: str, operand: Type) -> Callable[[Any], Any] | None:
    """The operation, which gives the operand's type; None when the type does not go with the operator."""
    operand = resolved(operand)
    if symbol == "NOT":
        return operator.not_ if operand == BOOL else None
    if operand in (NUM, DNUM):
        return operator.neg if symbol == "-" else operator.pos
    return (lambda position: _scaled(position, -1.0)) if symbol == "-" and operand.name == "pos" else None
