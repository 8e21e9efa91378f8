"""RAPID's predefined types and data (positions, speeds, zones, tool0), and its functions of numbers and arrays."""

from __future__ import annotations

import math

from yumi.rapid.errors import RapidRuntimeError
from yumi.rapid.library import Call, Library, core_library
from yumi.rapid.types import ArrayType, resolved

JOINTS = tuple(f"rax_{n}" for n in range(1, 7))
EXTERNAL_AXES = tuple(f"eax_{axis}" for axis in "abcdef")
NUMS = ("dionum", "intnum", "byte", "symnum", "tpnum", "opnum", "stoppointnum")

RECORDS: dict[str, dict[str, str]] = {
    "pos": dict.fromkeys(("x", "y", "z"), "num"),
    "orient": dict.fromkeys(("q1", "q2", "q3", "q4"), "num"),
    "pose": {"trans": "pos", "rot": "orient"},
    "confdata": dict.fromkeys(("cf1", "cf4", "cf6", "cfx"), "num"),
    "robjoint": dict.fromkeys(JOINTS, "num"),
    "extjoint": dict.fromkeys(EXTERNAL_AXES, "num"),
    "robtarget": {"trans": "pos", "rot": "orient", "robconf": "confdata", "extax": "extjoint"},
    "jointtarget": {"robax": "robjoint", "extax": "extjoint"},
    "speeddata": dict.fromkeys(("v_tcp", "v_ori", "v_leax", "v_reax"), "num"),
    "zonedata": {
        "finep": "bool",
        **dict.fromkeys(("pzone_tcp", "pzone_ori", "pzone_eax", "zone_ori", "zone_leax", "zone_reax"), "num"),
    },
    "loaddata": {"mass": "num", "cog": "pos", "aom": "orient", "ix": "num", "iy": "num", "iz": "num"},
    "tooldata": {"robhold": "bool", "tframe": "pose", "tload": "loaddata"},
    "wobjdata": {"robhold": "bool", "ufprog": "bool", "ufmec": "string", "uframe": "pose", "oframe": "pose"},
}

SPEEDS_MM_S = (
    *(5, 10, 20, 30, 40, 50, 60, 80, 100, 150, 200, 300, 400, 500, 600, 800, 1000, 1500, 2000, 2500, 3000),
    *(4000, 5000, 6000, 7000),
)
REORIENTATION_DEG_S, LINEAR_AXIS_MM_S, ROTATING_AXIS_DEG_S = 500, 5000, 1000

# Radius around the point for path [mm], reorientation [mm] and [deg].
ZONES_MM = {
    0: (0.3, 0.3, 0.03),
    1: (1, 1, 0.1),
    5: (5, 8, 0.8),
    10: (10, 15, 1.5),
    15: (15, 23, 2.3),
    20: (20, 30, 3),
    30: (30, 45, 4.5),
    40: (40, 60, 6),
    50: (50, 75, 7.5),
    60: (60, 90, 9),
    80: (80, 120, 12),
    100: (100, 150, 15),
    150: (150, 225, 23),
    200: (200, 300, 30),
}
NO_POSE = ((0, 0, 0), (1, 0, 0, 0))
LOAD0 = (0.001, (0, 0, 0.001), (1, 0, 0, 0), 0, 0, 0)


DATA = Library(core_library())
for _name in NUMS:
    DATA.alias(_name, "num")
for _name, _components in RECORDS.items():
    DATA.record(_name, _components)
DATA.record("taskid", {"taskname": "string"})
DATA.data("pi", "num", math.pi)
DATA.data("stEmpty", "string", "")
for _value, _name in enumerate(("low", "high", "edge")):
    DATA.data(_name, "dionum", _value)
for _value, _name in enumerate(("OP_UNDEF", "OP_AUTO", "OP_MAN_PROG", "OP_MAN_TEST")):
    DATA.data(_name, "symnum", _value)
DATA.data("load0", "loaddata", LOAD0)
DATA.data("tool0", "tooldata", (True, NO_POSE, LOAD0))
DATA.data("wobj0", "wobjdata", (False, True, "", NO_POSE, NO_POSE))
for _name, _speed in (*((f"v{each}", each) for each in SPEEDS_MM_S), ("vmax", SPEEDS_MM_S[-1])):
    DATA.data(_name, "speeddata", (_speed, REORIENTATION_DEG_S, LINEAR_AXIS_MM_S, ROTATING_AXIS_DEG_S))
DATA.data("fine", "zonedata", (True, 0, 0, 0, 0, 0, 0))
for _radius, (_path, _reorientation, _angle) in ZONES_MM.items():
    _zone = (False, _path, _reorientation, _reorientation, _angle, _reorientation, _angle)
    DATA.data(f"z{_radius}", "zonedata", _zone)


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
    if _name not in ("Exp", "Max", "Min", "Distance"):
        MATHS.formula(f"{_name}Dnum", _signature.replace("num ", "dnum "), "dnum", _compute)
MATHS.formula("NumToDnum", "num Value", "dnum", float)


@MATHS.function("Round", r"num Val, \num Dec", "num")
@MATHS.function("RoundDnum", r"dnum Val, \num Dec", "dnum")
def rounded(call: Call) -> float:
    scale = 10.0 ** _decimals(call)
    nearest = math.floor(abs(call["Val"]) * scale + 0.5)
    return math.copysign(nearest, call["Val"]) / float(scale)


@MATHS.function("Trunc", r"num Val, \num Dec", "num")
@MATHS.function("TruncDnum", r"dnum Val, \num Dec", "dnum")
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
