"""Polynomials over a stretch of time: whether they stay within a range, and where they leave it farthest.

A polynomial is the sequence of its coefficients, the constant one first.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import comb, isfinite, nan
from typing import NamedTuple

_HALVINGS = 50


class Excess(NamedTuple):
    """Where a polynomial is farthest outside of a range.

    Attributes:
        time: from the begin of its stretch.
        value: its value there.
    """

    time: float
    value: float


def value_at(polynomial: Sequence[float], time: float) -> float:
    """Its value, by Horner's rule."""
    value = 0.0
    for coefficient in reversed(polynomial):
        value = value * time + coefficient
    return value


def derivative(polynomial: Sequence[float]) -> tuple[float, ...]:
    """Its rate of change."""
    return tuple([power * coefficient for power, coefficient in enumerate(polynomial)][1:])


def excess(polynomial: Sequence[float], length: float, lowest: float, highest: float) -> Excess | None:
    """Where it is farthest outside of ``lowest`` to ``highest`` for times from 0 to ``length``; None if nowhere.

    Its Bernstein coefficients bound it from both sides, which is enough for most. A polynomial whose numbers are too
    large to be calculated with is nowhere inside: its value is NaN.
    """
    hull = _bernstein(polynomial, length)
    if not all(map(isfinite, hull)):
        return Excess(0.0, nan)
    if lowest <= min(hull) and max(hull) <= highest:
        return None
    times = (0.0, *roots(derivative(polynomial), length), length)
    worst = max(
        (Excess(time, value_at(polynomial, time)) for time in times), key=lambda each: _outside(each, lowest, highest)
    )
    return None if _outside(worst, lowest, highest) <= 0.0 else worst


def roots(polynomial: Sequence[float], length: float) -> list[float]:
    """Where it changes its sign between 0 and ``length``, in order: by halving between the points where it turns."""
    if len(polynomial) < 2:
        return []
    turns = (0.0, *roots(derivative(polynomial), length), length)
    values = [value_at(polynomial, turn) for turn in turns]
    stretches = zip(pairwise(turns), pairwise(values), strict=True)
    return [_root(polynomial, *stretch, before) for stretch, (before, after) in stretches if before * after <= 0.0]


def _outside(point: Excess, lowest: float, highest: float) -> float:
    return max(lowest - point.value, point.value - highest)


def _root(polynomial: Sequence[float], low: float, high: float, value_low: float) -> float:
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if value_at(polynomial, middle) * value_low > 0.0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def _bernstein(polynomial: Sequence[float], length: float) -> list[float]:
    shares = _SHARES[len(polynomial)]
    scaled, power = [], 1.0
    for coefficient in polynomial:
        scaled.append(coefficient * power)
        power *= length
    return [sum([share * term for share, term in zip(row, scaled, strict=False)]) for row in shares]


_SHARES = {
    count: [[comb(i, k) / comb(count - 1, k) for k in range(i + 1)] for i in range(count)] for count in range(1, 7)
}
"""How much of each scaled coefficient is in each Bernstein coefficient, for polynomials of so many coefficients."""
