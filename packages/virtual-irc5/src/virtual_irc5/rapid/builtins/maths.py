"""RAPID's functions of numbers, arrays and matrices."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_irc5.rapid.builtins.data import DATA
from virtual_irc5.rapid.call import Call
from virtual_irc5.rapid.rapid_library import Library
from virtual_irc5.rapid.types import ArrayType, RapidRuntimeError, Reference, resolved_type

_Array = NDArray[np.float64]

MATHS = Library(DATA)
_MOST_DECIMALS = 15  # what a dnum has


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
def _rounded(call: Call) -> float:
    scale = 10.0 ** decimals(call, _MOST_DECIMALS)
    nearest = math.floor(abs(call["Val"]) * scale + 0.5)
    return math.copysign(nearest, call["Val"]) / float(scale)


@MATHS.function("Trunc", r"num Val, \num Dec", "num")
@MATHS.function("TruncDnum", r"dnum Val, \num Dec", "dnum")
def _truncated(call: Call) -> float:
    scale = 10.0 ** decimals(call, _MOST_DECIMALS)
    value: float = math.trunc(call["Val"] * scale) / scale
    return value


def decimals(call: Call, most: int) -> int:
    decimals: float = call.get("Dec", 0.0)
    if not 0 <= decimals == decimals // 1 <= most:
        sentence = f"{call.name} takes a whole number of decimals, 0 to {most}, not {decimals:g}."
        raise RapidRuntimeError("ERR_ARGVALERR", sentence)
    return int(decimals)


@MATHS.function("DnumToNum", r"dnum Value, \switch Integer", "num")
def _as_num(call: Call) -> float:
    value: float = call["Value"]
    if call.present("Integer") and value != int(value):
        raise RapidRuntimeError("ERR_INT_NOTVAL", f"{value:g} is not an integer.")
    return value


@MATHS.function("Dim", "anytype ArrPar, num DimNo", "num")
def _dimension(call: Call) -> float:
    type_ = resolved_type(call.reference("ArrPar").type)
    if not isinstance(type_, ArrayType):
        raise RapidRuntimeError("ERR_NOTARR", "Dim takes an array.")
    if call["DimNo"] not in range(1, len(type_.sizes) + 1):
        raise RapidRuntimeError("ERR_ILLDIM", f"The array has no dimension {call['DimNo']:g}.")
    array = call["ArrPar"]
    for _ in range(int(call["DimNo"]) - 1):
        array = array[0]
    return len(array)


@MATHS.instruction("Incr", "INOUT anynum Name")
@MATHS.instruction("Decr", "INOUT anynum Name")
def count(call: Call) -> None:
    call["Name"] = call["Name"] + (1.0 if call.name == "Incr" else -1.0)


@MATHS.instruction("Add", "INOUT anynum Name, anynum AddValue")
def _add_number(call: Call) -> None:
    call["Name"] = call["Name"] + call["AddValue"]


@MATHS.instruction("Clear", "INOUT anynum Name")
def _clear_number(call: Call) -> None:
    call["Name"] = 0.0


# Linear algebra -----------------------------------------------------------------------------------------------------

_LARGEST_MATRIX = 100  # rows and columns: more takes longer than the cycle of a robot
_FEWEST_POINTS = 3  # of a circle


def _read_array(call: Call, name: str) -> _Array:
    array = np.array(call[name], dtype=float)
    if max(array.shape) > _LARGEST_MATRIX:
        raise RapidRuntimeError("ERR_ARRAY_SIZE", f"{call.name} takes up to {_LARGEST_MATRIX} rows and columns.")
    return array


def _write_array(call: Call, name: str, values: _Array) -> None:
    """Write an array of the size that is needed; raises ERR_ARRAY_SIZE for a datum of another size."""
    reference: Reference = call.reference(name)
    if np.shape(reference.value) != values.shape:
        wanted = "x".join(map(str, values.shape))
        raise call.error("ERR_ARRAY_SIZE", f"{reference.name} has to be {wanted}.")
    call[name] = values.tolist() if values.ndim == 1 else [tuple(row) for row in values.tolist()]


@MATHS.instruction("MatrixSolve", "dnum A{*,*}, dnum b{*}, INOUT dnum x{*}")
@MATHS.instruction("MatrixSolveQR", "dnum A{*,*}, dnum b{*}, INOUT dnum x{*}")
def _solve_equations(call: Call) -> None:
    """A x = b; MatrixSolveQR gives the least squares where there are more equations than unknowns."""
    matrix, right = _read_array(call, "A"), _read_array(call, "b")
    is_square = matrix.shape[0] == matrix.shape[1]
    if matrix.shape[0] != right.shape[0] or (call.name == "MatrixSolve" and not is_square):
        raise call.error("ERR_ARRAY_SIZE", "A and b do not fit together.")
    if np.linalg.matrix_rank(matrix) < matrix.shape[1]:
        raise call.error("ERR_ARGVALERR", "the equations have no single solution.")
    _write_array(call, "x", np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0], dtype=np.float64))


@MATHS.instruction("MatrixSVD", r"dnum A{*,*}, INOUT dnum U{*,*}, INOUT dnum S{*}, INOUT dnum V{*,*}, \switch Econ")
def _singular_values(call: Call) -> None:
    r"""A = U S V'; with \Econ U has as many columns as A."""
    left, values, right = np.linalg.svd(_read_array(call, "A"), full_matrices=not call.present("Econ"))
    for name, result in (("U", left), ("S", values), ("V", right.T)):
        _write_array(call, name, result)


def fitted_circle(points: _Array, tolerance: float | None = None) -> tuple[_Array, float, _Array, _Array] | None:
    """Centre, radius, normal and errors of the circle that fits points best, (n, 3); None where they lie on a line.

    Its plane is found by singular values, then the circle in it by least squares. Below ``tolerance``, in the unit of
    the points, a singular value counts as none.
    """
    middle = points.mean(axis=0)
    axes = np.linalg.svd(points - middle)[2]
    flat = (points - middle) @ axes[:2].T
    equations = np.column_stack([2.0 * flat, np.ones(len(points))])
    if np.linalg.matrix_rank(equations, tol=tolerance) < _FEWEST_POINTS:
        return None
    x, y, rest = np.linalg.lstsq(equations, (flat**2).sum(axis=1), rcond=None)[0]
    radius = float(np.sqrt(rest + x * x + y * y))
    errors = np.hypot(np.hypot(flat[:, 0] - x, flat[:, 1] - y) - radius, (points - middle) @ axes[2])
    return middle + x * axes[0] + y * axes[1], radius, axes[2], errors


@MATHS.instruction(
    "FitCircle",
    r"pos Points{*}, \num NumPoints, INOUT pos Center, INOUT num Radius, INOUT pos Normal, \VAR num RMS, "
    r"\VAR num MaxErr, \VAR num IndexWorst",
)
def _fit_circle(call: Call) -> None:
    points: Sequence[Any] = call["Points"]
    count = int(call.get("NumPoints", len(points)))
    if not _FEWEST_POINTS <= count <= min(len(points), _LARGEST_MATRIX):
        raise RapidRuntimeError("ERR_ARGVALERR", f"FitCircle needs {_FEWEST_POINTS} to {len(points)} points.")
    circle = fitted_circle(np.array(points[:count], dtype=float))
    if circle is None:
        raise call.error("ERR_ARGVALERR", "the points lie on a line.")
    center, radius, normal, errors = circle
    call["Center"], call["Radius"], call["Normal"] = center.tolist(), radius, normal.tolist()
    for name, value in (
        ("RMS", float(np.sqrt((errors**2).mean()))),
        ("MaxErr", float(errors.max())),
        ("IndexWorst", float(errors.argmax() + 1)),
    ):
        call.give(name, value)
