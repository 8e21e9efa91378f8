"""RAPID's numbers: rounding, roots, angles in degrees, counters, and the size of arrays."""

from __future__ import annotations

import math

from yumi.rapid.builtins.data import DATA
from yumi.rapid.errors import RapidRuntimeError
from yumi.rapid.library import Call, Library
from yumi.rapid.types import ArrayType, resolved

MATHS = Library(DATA)
MOST_DECIMALS = 15  # what a dnum has


def _ratio(name: str, value: float) -> float:
    if not -1.0 <= value <= 1.0:
        raise RapidRuntimeError("ERR_ARGVALERR", f"{name} takes -1 to 1, not {value:g}.")
    return value


def _power(base: float, exponent: float) -> float:
    try:
        return math.pow(base, exponent)
    except OverflowError as error:
        raise RapidRuntimeError("ERR_OVERFLOW", f"{base:g} to the power of {exponent:g} is too large.") from error
    except ValueError as error:
        raise RapidRuntimeError("ERR_ARGVALERR", f"{base:g} has no power of {exponent:g}.") from error


def _square_root(value: float) -> float:
    if value < 0.0:
        raise RapidRuntimeError("ERR_NEGARG", f"Sqrt takes no negative number, not {value:g}.")
    return math.sqrt(value)


for _name, _signature, _compute in (
    ("Abs", "num Value", abs),
    ("Sqrt", "num Value", _square_root),
    ("Exp", "num Exponent", lambda exponent: _power(math.e, exponent)),
    ("Pow", "num Base, num Exponent", _power),
    ("Sin", "num Angle", lambda angle: math.sin(math.radians(angle))),
    ("Cos", "num Angle", lambda angle: math.cos(math.radians(angle))),
    ("Tan", "num Angle", lambda angle: math.tan(math.radians(angle))),
    ("ASin", "num Value", lambda value: math.degrees(math.asin(_ratio("ASin", value)))),
    ("ACos", "num Value", lambda value: math.degrees(math.acos(_ratio("ACos", value)))),
    ("ATan", "num Value", lambda value: math.degrees(math.atan(value))),
    ("ATan2", "num Y, num X", lambda y, x: math.degrees(math.atan2(y, x))),
    ("Max", "num X, num Y", max),
    ("Min", "num X, num Y", min),
    ("Distance", "pos Point1, pos Point2", math.dist),
):
    MATHS.formula(_name, _signature, "num", _compute)
MATHS.formula("AbsDnum", "dnum Value", "dnum", abs)
MATHS.formula("NumToDnum", "num Value", "dnum", float)


@MATHS.function("Round", r"num Val, \num Dec", "num")
def rounded(call: Call) -> float:
    scale = 10.0 ** _decimals(call)
    nearest = math.floor(abs(call["Val"]) * scale + 0.5)
    return math.copysign(nearest, call["Val"]) / float(scale)


@MATHS.function("Trunc", r"num Val, \num Dec", "num")
def truncated(call: Call) -> float:
    scale = 10.0 ** _decimals(call)
    value: float = math.trunc(call["Val"] * scale) / scale
    return value


def _decimals(call: Call) -> float:
    decimals: float = call.get("Dec", 0.0)
    if not 0 <= decimals == decimals // 1 <= MOST_DECIMALS:
        sentence = f"{call.name} takes a whole number of decimals, 0 to {MOST_DECIMALS}, not {decimals:g}."
        raise RapidRuntimeError("ERR_ARGVALERR", sentence)
    return decimals


@MATHS.function("DnumToNum", r"dnum Value, \switch Integer", "num")
def as_num(call: Call) -> float:
    value: float = call["Value"]
    if call.present("Integer") and value != int(value):
        raise RapidRuntimeError("ERR_INT_NOTVAL", f"{value:g} is not an integer.")
    return value


@MATHS.function("Dim", "anytype ArrPar, num DimNo", "num")
def dimension(call: Call) -> float:
    type_ = resolved(call.reference("ArrPar").type)
    if not isinstance(type_, ArrayType):
        raise RapidRuntimeError("ERR_NOTARR", "Dim takes an array.")
    if call["DimNo"] not in range(1, len(type_.sizes) + 1):
        raise RapidRuntimeError("ERR_ILLDIM", f"The array has no dimension {call['DimNo']:g}.")
    array = call["ArrPar"]
    for _ in range(int(call["DimNo"]) - 1):
        array = array[0]
    return len(array)


@MATHS.instruction("Incr", "INOUT anynum Name")
def increment(call: Call) -> None:
    call["Name"] = call["Name"] + 1.0


@MATHS.instruction("Decr", "INOUT anynum Name")
def decrement(call: Call) -> None:
    call["Name"] = call["Name"] - 1.0


@MATHS.instruction("Add", "INOUT anynum Name, anynum AddValue")
def add(call: Call) -> None:
    call["Name"] = call["Name"] + call["AddValue"]


@MATHS.instruction("Clear", "INOUT anynum Name")
def clear(call: Call) -> None:
    call["Name"] = 0.0
