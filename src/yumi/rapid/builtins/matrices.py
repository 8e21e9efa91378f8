"""RAPID's linear algebra: linear systems, singular values, the circle through measured points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from yumi.rapid.builtins.data import DATA
from yumi.rapid.errors import RapidRuntimeError
from yumi.rapid.library import Call, Library
from yumi.rapid.types import Reference

MATRICES = Library(DATA)
LARGEST = 100  # rows and columns: more takes longer than the cycle of a robot
FEWEST_POINTS = 3  # of a circle

Array = NDArray[np.float64]


def _array(call: Call, name: str) -> Array:
    array = np.array(call[name], dtype=float)
    if max(array.shape) > LARGEST:
        raise RapidRuntimeError("ERR_ARRAY_SIZE", f"{call.name} takes up to {LARGEST} rows and columns.")
    return array


def _store(call: Call, name: str, values: Array) -> None:
    """Write an array of the size that is needed; raises ERR_ARRAY_SIZE for a datum of another size."""
    reference: Reference = call.reference(name)
    if np.shape(reference.value) != values.shape:
        wanted = "x".join(map(str, values.shape))
        raise RapidRuntimeError("ERR_ARRAY_SIZE", f"{call.name}: {reference.name} has to be {wanted}.")
    call[name] = values.tolist() if values.ndim == 1 else [tuple(row) for row in values.tolist()]


@MATRICES.instruction("MatrixSolve", "dnum A{*,*}, dnum b{*}, INOUT dnum x{*}")
@MATRICES.instruction("MatrixSolveQR", "dnum A{*,*}, dnum b{*}, INOUT dnum x{*}")
def solve(call: Call) -> None:
    """A x = b; MatrixSolveQR gives the least squares where there are more equations than unknowns."""
    matrix, right = _array(call, "A"), _array(call, "b")
    is_square = matrix.shape[0] == matrix.shape[1]
    if matrix.shape[0] != right.shape[0] or (call.name == "MatrixSolve" and not is_square):
        raise RapidRuntimeError("ERR_ARRAY_SIZE", f"{call.name}: A and b do not fit together.")
    if np.linalg.matrix_rank(matrix) < matrix.shape[1]:
        raise RapidRuntimeError("ERR_ARGVALERR", f"{call.name}: the equations have no single solution.")
    _store(call, "x", np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0], dtype=np.float64))


@MATRICES.instruction("MatrixSVD", r"dnum A{*,*}, INOUT dnum U{*,*}, INOUT dnum S{*}, INOUT dnum V{*,*}, \switch Econ")
def singular_values(call: Call) -> None:
    r"""A = U S V'; with \Econ U has as many columns as A."""
    left, values, right = np.linalg.svd(_array(call, "A"), full_matrices=not call.present("Econ"))
    for name, result in (("U", left), ("S", values), ("V", right.T)):
        _store(call, name, result)


@MATRICES.instruction(
    "FitCircle",
    r"pos Points{*}, \num NumPoints, INOUT pos Center, INOUT num Radius, INOUT pos Normal, \VAR num RMS, "
    r"\VAR num MaxErr, \VAR num IndexWorst",
)
def fit_circle(call: Call) -> None:
    """The circle that fits best: the plane by singular values, then the circle in it by least squares."""
    points: Sequence[Any] = call["Points"]
    count = int(call.get("NumPoints", len(points)))
    if not FEWEST_POINTS <= count <= min(len(points), LARGEST):
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
