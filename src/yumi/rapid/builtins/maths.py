"""RAPID's numbers: rounding, roots, angles in degrees, counters, and the size of arrays."""

from __future__ import annotations

import math

from yumi.rapid.builtins.data import DATA
from yumi.rapid.errors import RapidRuntimeError
from yumi.rapid.library import Call, Library
from yumi.rapid.types import ArrayType, resolved

MATHS = Library(DATA)
MOST_DECIMALS = 15  # what a dnum has


@MATHS.function("Abs", "num Value", "num")
def absolute(call: Call) -> float:
    return abs(float(call["Value"]))


@MATHS.function("AbsDnum", "dnum Value", "dnum")
def absolute_dnum(call: Call) -> float:
    return abs(float(call["Value"]))


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


@MATHS.function("Sqrt", "num Value", "num")
def square_root(call: Call) -> float:
    if call["Value"] < 0.0:
        raise RapidRuntimeError("ERR_NEGARG", f"Sqrt takes no negative number, not {call['Value']:g}.")
    return math.sqrt(call["Value"])


@MATHS.function("Exp", "num Exponent", "num")
def exponential(call: Call) -> float:
    return _power(math.e, call["Exponent"])


@MATHS.function("Pow", "num Base, num Exponent", "num")
def power(call: Call) -> float:
    return _power(call["Base"], call["Exponent"])


def _power(base: float, exponent: float) -> float:
    try:
        return math.pow(base, exponent)
    except OverflowError as error:
        raise RapidRuntimeError("ERR_OVERFLOW", f"{base:g} to the power of {exponent:g} is too large.") from error
    except ValueError as error:
        raise RapidRuntimeError("ERR_ARGVALERR", f"{base:g} has no power of {exponent:g}.") from error


@MATHS.function("Sin", "num Angle", "num")
def sine(call: Call) -> float:
    return math.sin(math.radians(call["Angle"]))


@MATHS.function("Cos", "num Angle", "num")
def cosine(call: Call) -> float:
    return math.cos(math.radians(call["Angle"]))


@MATHS.function("Tan", "num Angle", "num")
def tangent(call: Call) -> float:
    return math.tan(math.radians(call["Angle"]))


@MATHS.function("ASin", "num Value", "num")
def arc_sine(call: Call) -> float:
    return math.degrees(math.asin(_checked_ratio(call)))


@MATHS.function("ACos", "num Value", "num")
def arc_cosine(call: Call) -> float:
    return math.degrees(math.acos(_checked_ratio(call)))


def _checked_ratio(call: Call) -> float:
    value: float = call["Value"]
    if not -1.0 <= value <= 1.0:
        raise RapidRuntimeError("ERR_ARGVALERR", f"{call.name} takes -1 to 1, not {value:g}.")
    return value


@MATHS.function("ATan", "num Value", "num")
def arc_tangent(call: Call) -> float:
    return math.degrees(math.atan(call["Value"]))


@MATHS.function("ATan2", "num Y, num X", "num")
def arc_tangent_of_two(call: Call) -> float:
    return math.degrees(math.atan2(call["Y"], call["X"]))


@MATHS.function("Max", "num X, num Y", "num")
def larger(call: Call) -> float:
    return max(float(call["X"]), float(call["Y"]))


@MATHS.function("Min", "num X, num Y", "num")
def smaller(call: Call) -> float:
    return min(float(call["X"]), float(call["Y"]))


@MATHS.function("NumToDnum", "num Value", "dnum")
def as_dnum(call: Call) -> float:
    return float(call["Value"])


@MATHS.function("DnumToNum", r"dnum Value, \switch Integer", "num")
def as_num(call: Call) -> float:
    value: float = call["Value"]
    if call.present("Integer") and value != int(value):
        raise RapidRuntimeError("ERR_INT_NOTVAL", f"{value:g} is not an integer.")
    return value


@MATHS.function("Distance", "pos Point1, pos Point2", "num")
def distance(call: Call) -> float:
    return math.dist(call["Point1"], call["Point2"])


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
