"""RAPID's predefined types, data and constants, and its functions of numbers, arrays, strings and matrices.

Constants whose values ABB's manuals print have these; where they print none, the constants of a type are numbered in
the order the manual lists them, since programs compare names only. Positions in strings count from 1.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from yumi.rapid.library import Call, Library, core_library
from yumi.rapid.parser import format_value, parse_value
from yumi.rapid.types import (
    LONGEST_STRING,
    STRING,
    ArrayType,
    RapidRuntimeError,
    RapidValueError,
    Reference,
    resolved,
    value_count,
)

Array = NDArray[np.float64]


# Types and data of motion -------------------------------------------------------------------------------------------

JOINTS = tuple(f"rax_{n}" for n in range(1, 7))
EXTERNAL_AXES = tuple(f"eax_{axis}" for axis in "abcdef")
NUM_TYPES = ("dionum", "intnum", "byte", "symnum", "tpnum", "opnum", "stoppointnum")

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
for _name in NUM_TYPES:
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
# Technical reference manual, RAPID: data types: persistents of the system module BASE, which no program changes.
DATA.persistent("load0", "loaddata", LOAD0)
DATA.persistent("tool0", "tooldata", (True, NO_POSE, LOAD0))
DATA.persistent("wobj0", "wobjdata", (False, True, "", NO_POSE, NO_POSE))
for _name, _speed in (*((f"v{each}", each) for each in SPEEDS_MM_S), ("vmax", SPEEDS_MM_S[-1])):
    DATA.data(_name, "speeddata", (_speed, REORIENTATION_DEG_S, LINEAR_AXIS_MM_S, ROTATING_AXIS_DEG_S))
DATA.data("fine", "zonedata", (True, 0, 0, 0, 0, 0, 0))
for _radius, (_path, _reorientation, _angle) in ZONES_MM.items():
    _zone = (False, _path, _reorientation, _reorientation, _angle, _reorientation, _angle)
    DATA.data(f"z{_radius}", "zonedata", _zone)


# Numbers and arrays -------------------------------------------------------------------------------------------------

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
        _signature = _signature.replace("num ", "dnum ").replace("dnum Exponent", "num Exponent")  # of PowDnum
        MATHS.formula(f"{_name}Dnum", _signature, "dnum", _compute)
MATHS.formula("NumToDnum", "num Value", "dnum", float)


@MATHS.function("Round", r"num Val, \num Dec", "num")
@MATHS.function("RoundDnum", r"dnum Val, \num Dec", "dnum")
def rounded(call: Call) -> float:
    scale = 10.0 ** _decimals(call, MOST_DECIMALS)
    nearest = math.floor(abs(call["Val"]) * scale + 0.5)
    return math.copysign(nearest, call["Val"]) / float(scale)


@MATHS.function("Trunc", r"num Val, \num Dec", "num")
@MATHS.function("TruncDnum", r"dnum Val, \num Dec", "dnum")
def truncated(call: Call) -> float:
    scale = 10.0 ** _decimals(call, MOST_DECIMALS)
    value: float = math.trunc(call["Val"] * scale) / scale
    return value


def _decimals(call: Call, most: int) -> int:
    decimals: float = call.get("Dec", 0.0)
    if not 0 <= decimals == decimals // 1 <= most:
        sentence = f"{call.name} takes a whole number of decimals, 0 to {most}, not {decimals:g}."
        raise RapidRuntimeError("ERR_ARGVALERR", sentence)
    return int(decimals)


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
def add_number(call: Call) -> None:
    call["Name"] = call["Name"] + call["AddValue"]


@MATHS.instruction("Clear", "INOUT anynum Name")
def clear_number(call: Call) -> None:
    call["Name"] = 0.0


# Constants that programs compare their values with, and types that are names for num or string ----------------------

CONSTANTS = Library(DATA)

for _name, _base in (
    *((name, "num") for name in ("opcalc", "errdomain", "errtype", "event_type", "handler_type", "exec_level")),
    *((name, "num") for name in ("tsp_status", "sensorstate", "loadidnum", "paridnum", "paridvalidnum", "aiotrigg")),
    *((name, "num") for name in ("supervtype", "triggmode", "tunegtype", "triggflag", "cnvcmd", "pathrecnum")),
    *((name, "num") for name in ("btnres", "buttondata", "icondata", "uishownum", "inttypes")),
    *(("stringdig", "string"), ("tasksatstart", "string")),
):
    CONSTANTS.alias(_name, _base)

# By type: names with the value of the first, the others count on; `NAME=7` sets another one.
CONSTANT_VALUES = {
    "opnum": "LT=1 LTEQ EQ NOTEQ GTEQ GT",
    "opcalc": "OpAdd=1 OpSub OpMult OpDiv OpMod",
    "symnum": "RUN_UNDEF=0 RUN_CONT_CYCLE RUN_INSTR_FWD RUN_INSTR_BWD RUN_SIM RUN_STEP_MOVE",
    "errtype": "TYPE_ALL=0 TYPE_STATE TYPE_WARN TYPE_ERR",
    "errdomain": (
        "COMMON_ERR=0 OP_STATE SYSTEM_ERR HARDWARE_ERR PROGRAM_ERR MOTION_ERR OPERATOR_ERR IO_COM_ERR USER_DEF_ERR "
        "SAFETY_ERR OPTION_PROD_ERR PROCESS_ERR CFG_ERR ARCWELD_ERR SPOTWELD_ERR PAINT_ERR PICKWARE_ERR"
    ),
    "event_type": (
        "EVENT_NONE=0 EVENT_POWERON EVENT_START EVENT_STOP EVENT_QSTOP EVENT_RESTART EVENT_RESET EVENT_STEP"
    ),
    "handler_type": "HANDLER_NONE=0 HANDLER_BWD HANDLER_ERR HANDLER_UNDO",
    "exec_level": "LEVEL_NORMAL=0 LEVEL_TRAP LEVEL_SERVICE",
    "tsp_status": (
        "TSP_STATUS_NOT_NORMAL_TASK=0 TSP_STATUS_DEACT TSP_STATUS_DEACT_SERV_ROUT TSP_STATUS_ACT "
        "TSP_UNCHECKED_RUN_SERV_ROUT=10 TSP_NORMAL_UNCHECKED TSP_STATIC_UNCHECKED TSP_SEMISTATIC_UNCHECKED "
        "TSP_NORMAL_CHECKED=20 TSP_STATIC_CHECKED TSP_SEMISTATIC_CHECKED"
    ),
    "sensorstate": "STATE_ERROR=-1 STATE_UNDEFINED STATE_CONNECTED STATE_OPERATING STATE_CLOSED",
    "num": (
        "AT_POINT=0 AT_ERRORPOINT AT_RESTARTPOINT "
        "CSS_X=1 CSS_Y CSS_Z CSS_XY CSS_XZ CSS_YZ CSS_XYZ CSS_XYRZ CSS_ARM_ANGLE "
        "CSS_POSX=1 CSS_NEGX CSS_POSY CSS_NEGY CSS_POSZ CSS_NEGZ CSS_REFFRAME_TOOL=0 CSS_REFFRAME_WOBJ "
        "CT_CONTINUOUS=1 CT_COUNT_CYCLES CT_COUNT_CYC_ACTION CT_PERIODICAL EGM_MAX_RAPID_DNUM=19 "
        "TRIGG_MODE1=1 TRIGG_MODE2 TRIGG_MODE3"
    ),
    "loadidnum": "MASS_KNOWN=1 MASS_WITH_AX3",
    "paridnum": ("TOOL_LOAD_ID=1 PAY_LOAD_ID IRBP_K IRBP_L IRBP_C IRBP_C_INDEX IRBP_T IRBP_R IRBP_A IRBP_B IRBP_D"),
    "paridvalidnum": "ROB_LOAD_VAL=10 ROB_NOT_LOAD_VAL ROB_LM1_LOAD_VAL",
    "aiotrigg": ("AIO_ABOVE_HIGH=1 AIO_BELOW_HIGH AIO_ABOVE_LOW AIO_BELOW_LOW AIO_BETWEEN AIO_OUTSIDE AIO_ALWAYS"),
}

# Speeds of external axes alone: rotating ones [deg/s], linear ones [mm/s].
for _speed in (1, 2, 5, 10, 20, 50, 100):
    CONSTANTS.data(f"vrot{_speed}", "speeddata", (0, 0, 0, _speed))
for _speed in (10, 20, 50, 100, 200, 500, 1000):
    CONSTANTS.data(f"vlin{_speed}", "speeddata", (0, 0, _speed, 0))

for _type, _names in CONSTANT_VALUES.items():
    _next = 0
    for _entry in _names.split():
        _constant, _, _given = _entry.partition("=")
        _next = int(_given) if _given else _next
        CONSTANTS.data(_constant, _type, float(_next))
        _next += 1


# Strings ------------------------------------------------------------------------------------------------------------

STRINGS = Library(CONSTANTS)
_ARGUMENT_PLACE = re.compile(r"\{([1-5])\}")  # of StrFormat


@STRINGS.function("NumToStr", r"num Val, num Dec, \switch Exp", "string")
@STRINGS.function("DnumToStr", r"dnum Val, num Dec, \switch Exp", "string")
def number_text(call: Call) -> str:
    return f"{call['Val']:.{_decimals(call, LONGEST_STRING)}{'E' if call.present('Exp') else 'f'}}"


@STRINGS.function("ValToStr", "anyvalue Val", "string")
def value_to_string(call: Call) -> str:
    type_, value = call.reference("Val").type, call["Val"]
    if value_count(type_) > LONGEST_STRING:
        sentence = f"{value_count(type_)} values do not fit into the {LONGEST_STRING} characters of a string."
        raise RapidRuntimeError("ERR_STRTOOLNG", sentence)
    return str(value) if resolved(type_) == STRING else format_value(type_, value)


@STRINGS.function("StrToVal", "string Str, INOUT anytype Val", "bool")
def string_to_value(call: Call) -> bool:
    type_ = call.reference("Val").type
    if resolved(type_) == STRING:
        call["Val"] = call["Str"]
        return True
    try:
        call["Val"] = parse_value(type_, call["Str"])
    except RapidValueError:
        return False
    return True


@STRINGS.function("StrLen", "string Str", "num")
def text_length(call: Call) -> float:
    return len(call["Str"])


@STRINGS.function("StrPart", "string Str, num ChPos, num Len", "string")
def part_of_text(call: Call) -> str:
    start = _character_index(call)
    text: str = call["Str"]
    if call["Len"] < 0 or start + call["Len"] > len(text):
        raise RapidRuntimeError("ERR_ARGVALERR", f"'{text}' has no {call['Len']:g} characters from {start + 1}.")
    return text[start : start + int(call["Len"])]


@STRINGS.function("StrFormat", "string Str, " + ", ".join(rf"\string Arg{number}" for number in range(1, 6)), "string")
def filled_text(call: Call) -> str:
    """A text with its places {1} to {5} filled; a place whose argument is left out stays as it is written."""
    return _ARGUMENT_PLACE.sub(lambda place: call.get(f"Arg{place[1]}", place[0]), call["Str"])


@STRINGS.function("StrFind", r"string Str, num ChPos, string Set, \switch NotInSet", "num")
def find_character(call: Call) -> float:
    text, wanted = call["Str"], not call.present("NotInSet")
    places = range(_character_index(call, past_end=True), len(text))
    return next((i + 1 for i in places if (text[i] in call["Set"]) == wanted), len(text) + 1)


@STRINGS.function("StrMatch", "string Str, num ChPos, string Pattern", "num")
def find_text(call: Call) -> float:
    found: int = call["Str"].find(call["Pattern"], _character_index(call, past_end=True))
    return found + 1 if found >= 0 else len(call["Str"]) + 1


@STRINGS.function("StrMemb", "string Str, num ChPos, string Set", "bool")
def is_in_set(call: Call) -> bool:
    return call["Str"][_character_index(call)] in call["Set"]


@STRINGS.function("StrMap", "string Str, string FromMap, string ToMap", "string")
def mapped_text(call: Call) -> str:
    source, target = call["FromMap"], call["ToMap"]
    if len(source) != len(target):
        raise RapidRuntimeError("ERR_ARGVALERR", f"StrMap needs maps of one length, not '{source}' and '{target}'.")
    return str(call["Str"]).translate(str.maketrans(source, target))


@STRINGS.function("StrOrder", "string Str1, string Str2, string Order", "bool")
def is_text_in_order(call: Call) -> bool:
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

LARGEST_HEX = 0x7FFF_FFFF_FFFF_FFFF
LARGEST_DIGITS = 4_294_967_295
_RELATIONS = {1: operator.lt, 2: operator.le, 3: operator.eq, 4: operator.ne, 5: operator.ge, 6: operator.gt}


@STRINGS.function("DecToHex", "string Str", "string")
@STRINGS.function("HexToDec", "string Str", "string")
def other_base(call: Call) -> str:
    base = 10 if call.name == "DecToHex" else 16
    try:
        value = int(call["Str"], base)
    except ValueError as error:
        raise RapidRuntimeError("ERR_ARGVALERR", f"{call.name}: '{call['Str']}' is no such number.") from error
    if not 0 <= value <= LARGEST_HEX:
        raise RapidRuntimeError("ERR_INT_MAXVAL", f"{call.name} takes 0 to {LARGEST_HEX}, not {call['Str']}.")
    return f"{value:X}" if base == 10 else str(value)


def _digits(call: Call, name: str) -> int:
    """A stringdig: a whole number from 0 to 4294967295, as DeviceNet and cfg files have them."""
    text: str = call[name]
    if not (text.isascii() and text.isdigit()):
        raise RapidRuntimeError("ERR_INT_NOTVAL", f"{call.name}: '{text}' is not a whole number in digits.")
    if int(text) > LARGEST_DIGITS:
        raise RapidRuntimeError("ERR_INT_MAXVAL", f"{call.name} takes up to {LARGEST_DIGITS}, not {text}.")
    return int(text)


@STRINGS.function("StrDigCmp", "stringdig StrDig1, opnum Relation, stringdig StrDig2", "bool")
def compare_digits(call: Call) -> bool:
    relation = _RELATIONS.get(int(call["Relation"]))
    if relation is None:
        raise RapidRuntimeError("ERR_ARGVALERR", "StrDigCmp takes LT, LTEQ, EQ, NOTEQ, GTEQ or GT.")
    return bool(relation(_digits(call, "StrDig1"), _digits(call, "StrDig2")))


@STRINGS.function("StrDigCalc", "stringdig StrDig1, opcalc Operation, stringdig StrDig2", "stringdig")
def calculate_digits(call: Call) -> str:
    """The sum, difference, product, quotient or rest of two whole numbers; raises ERR_CALC_... as ABB's does."""
    left, operation, right = _digits(call, "StrDig1"), int(call["Operation"]), _digits(call, "StrDig2")
    if operation in (4, 5) and right == 0:
        raise RapidRuntimeError("ERR_CALC_DIVZERO", f"StrDigCalc: {left} is divided by zero.")
    operations = {
        1: operator.add,
        2: operator.sub,
        3: operator.mul,
        4: operator.floordiv,
        5: operator.mod,
    }
    if operation not in operations:
        raise RapidRuntimeError("ERR_ARGVALERR", "StrDigCalc takes OpAdd, OpSub, OpMult, OpDiv or OpMod.")
    value: int = operations[operation](left, right)
    if value < 0:
        raise RapidRuntimeError("ERR_CALC_NEG", f"StrDigCalc: {left} - {right} is negative.")
    if value > LARGEST_DIGITS:
        raise RapidRuntimeError("ERR_CALC_OVERFLOW", f"StrDigCalc: {value} is above {LARGEST_DIGITS}.")
    return str(value)


# Linear algebra -----------------------------------------------------------------------------------------------------

MATRICES = Library(DATA)
LARGEST_MATRIX = 100  # rows and columns: more takes longer than the cycle of a robot
FEWEST_POINTS = 3  # of a circle


def _read_array(call: Call, name: str) -> Array:
    array = np.array(call[name], dtype=float)
    if max(array.shape) > LARGEST_MATRIX:
        raise RapidRuntimeError("ERR_ARRAY_SIZE", f"{call.name} takes up to {LARGEST_MATRIX} rows and columns.")
    return array


def _write_array(call: Call, name: str, values: Array) -> None:
    """Write an array of the size that is needed; raises ERR_ARRAY_SIZE for a datum of another size."""
    reference: Reference = call.reference(name)
    if np.shape(reference.value) != values.shape:
        wanted = "x".join(map(str, values.shape))
        raise RapidRuntimeError("ERR_ARRAY_SIZE", f"{call.name}: {reference.name} has to be {wanted}.")
    call[name] = values.tolist() if values.ndim == 1 else [tuple(row) for row in values.tolist()]


@MATRICES.instruction("MatrixSolve", "dnum A{*,*}, dnum b{*}, INOUT dnum x{*}")
@MATRICES.instruction("MatrixSolveQR", "dnum A{*,*}, dnum b{*}, INOUT dnum x{*}")
def solve_equations(call: Call) -> None:
    """A x = b; MatrixSolveQR gives the least squares where there are more equations than unknowns."""
    matrix, right = _read_array(call, "A"), _read_array(call, "b")
    is_square = matrix.shape[0] == matrix.shape[1]
    if matrix.shape[0] != right.shape[0] or (call.name == "MatrixSolve" and not is_square):
        raise RapidRuntimeError("ERR_ARRAY_SIZE", f"{call.name}: A and b do not fit together.")
    if np.linalg.matrix_rank(matrix) < matrix.shape[1]:
        raise RapidRuntimeError("ERR_ARGVALERR", f"{call.name}: the equations have no single solution.")
    _write_array(call, "x", np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0], dtype=np.float64))


@MATRICES.instruction("MatrixSVD", r"dnum A{*,*}, INOUT dnum U{*,*}, INOUT dnum S{*}, INOUT dnum V{*,*}, \switch Econ")
def singular_values(call: Call) -> None:
    r"""A = U S V'; with \Econ U has as many columns as A."""
    left, values, right = np.linalg.svd(_read_array(call, "A"), full_matrices=not call.present("Econ"))
    for name, result in (("U", left), ("S", values), ("V", right.T)):
        _write_array(call, name, result)


@MATRICES.instruction(
    "FitCircle",
    r"pos Points{*}, \num NumPoints, INOUT pos Center, INOUT num Radius, INOUT pos Normal, \VAR num RMS, "
    r"\VAR num MaxErr, \VAR num IndexWorst",
)
def fit_circle(call: Call) -> None:
    """The circle that fits best: the plane by singular values, then the circle in it by least squares."""
    points: Sequence[Any] = call["Points"]
    count = int(call.get("NumPoints", len(points)))
    if not FEWEST_POINTS <= count <= min(len(points), LARGEST_MATRIX):
        raise RapidRuntimeError("ERR_ARGVALERR", f"FitCircle needs {FEWEST_POINTS} to {len(points)} points.")
    measured = np.array(points[:count], dtype=float)
    middle = measured.mean(axis=0)
    axes = np.linalg.svd(measured - middle)[2]
    flat = (measured - middle) @ axes[:2].T
    equations = np.column_stack([2.0 * flat, np.ones(count)])
    if np.linalg.matrix_rank(equations) < FEWEST_POINTS:
        raise RapidRuntimeError("ERR_ARGVALERR", "FitCircle: the points lie on a line.")
    x, y, rest = np.linalg.lstsq(equations, (flat**2).sum(axis=1), rcond=None)[0]
    radius = float(np.sqrt(rest + x * x + y * y))
    center = middle + x * axes[0] + y * axes[1]
    errors = np.hypot(np.hypot(flat[:, 0] - x, flat[:, 1] - y) - radius, (measured - middle) @ axes[2])
    call["Center"], call["Radius"], call["Normal"] = center.tolist(), radius, axes[2].tolist()
    for name, value in (
        ("RMS", float(np.sqrt((errors**2).mean()))),
        ("MaxErr", float(errors.max())),
        ("IndexWorst", float(errors.argmax() + 1)),
    ):
        if call.present(name):
            call[name] = value
