"""Lines in joint space whose corners are rounded, so that they can be passed at speed."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_Number = TypeVar("_Number", float, Array)


class RoundedPath:
    """Straight lines from corner to corner in joint space, with the corners rounded: its curvature does not jump.

    Args:
        corners: (n, k) [rad], at least two, none twice in a row.
        unit: what a joint's way is counted in, (k,) [rad]: with the joints' speeds, the path's parameter is a time.
        deviation: how far a rounded corner may lie from the sharp one [rad].

    Attributes:
        length: of the path in its parameter.
    """

    def __init__(self, corners: Array, unit: Array, deviation: float) -> None:
        ways = np.diff(corners, axis=0)
        lengths = np.linalg.norm(ways / unit, axis=1)
        self._corners, self._slopes = corners, ways / lengths[:, None]
        self._lengths, self._begins = lengths, np.concatenate([[0.0], np.cumsum(lengths)])
        self.length = float(self._begins[-1])
        self._zones = np.zeros(len(corners))
        change = np.max(np.abs(np.diff(self._slopes, axis=0)), axis=1, initial=1e-9)
        halfway = rounding(0.5, 1.0)[1]
        self._zones[1:-1] = np.minimum(0.5 * np.minimum(lengths[:-1], lengths[1:]), deviation / (halfway * change))

    def sharpen(self, places: Array) -> bool:
        """Round the corners nearest to these parameters half as much; whether there is one that was rounded."""
        distance = np.abs(places[:, None] - self._begins)
        corners = np.unique(np.argmin(distance, 1)[np.min(distance / np.maximum(self._zones, 1e-12), 1) < 1.0])
        self._zones[corners] *= 0.5
        return bool(np.any(self._zones[corners] > 1e-4))

    def at(self, parameters: Array) -> tuple[Array, Array, Array]:
        """Positions, and their first and second derivatives, (n, k) each."""
        last = len(self._lengths) - 1
        line = np.clip(np.searchsorted(self._begins, parameters, side="right") - 1, 0, last)
        past = parameters - self._begins[line]
        slope = self._slopes[line]
        position, curvature = self._corners[line] + past[:, None] * slope, np.zeros_like(slope)
        corner = np.where(past < 0.5 * self._lengths[line], line, line + 1)
        near = np.abs(parameters - self._begins[corner]) < self._zones[corner]
        corner, zone = corner[near], self._zones[corner[near]]
        past = parameters[near] - self._begins[corner]
        share = (past + zone) / (2.0 * zone)
        weight, gone = (each[:, None] for each in rounding(share, zone))
        before, after = self._slopes[corner - 1], self._slopes[np.minimum(corner, last)]
        position[near] = self._corners[corner] + (past[:, None] - gone) * before + gone * after
        slope[near] = (1.0 - weight) * before + weight * after
        curvature[near] = (15.0 * share**2 * (1.0 - share) ** 2 / zone)[:, None] * (after - before)
        return position, slope, curvature


def rounding(share: _Number, zone: float | Array) -> tuple[_Number, _Number]:
    """How a corner is rounded: how much of the next line's direction is taken, and how far one has come along it.

    Args:
        share: of the way through the corner, 0 to 1.
        zone: half the length of this way.
    """
    weight = share**3 * (10.0 - 15.0 * share + 6.0 * share * share)
    return weight, 2.0 * zone * share**4 * (2.5 - 3.0 * share + share * share)  # type: ignore[return-value]
