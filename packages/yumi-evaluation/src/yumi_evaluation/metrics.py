"""What an experiment measured, as numbers: settling, overshoot, control lag, jitter, quantiles.

Pure functions. A series is an array of rows (time [s], value) in the order of time, or what numpy makes one of; the
unit of values is the caller's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import nan

import numpy as np
from numpy.typing import ArrayLike, NDArray

Series = NDArray[np.float64]
"""Shape (n, 2): time [s], value."""

_FINEST = 1e-5  # [s]
_LONGEST = 0.6  # [s] no longer delay, and no lead longer than a tenth of it, is looked for


def series(rows: ArrayLike) -> Series:
    """``rows`` of (time, value) as an array, also when there are none."""
    return np.asarray(rows, dtype=np.float64).reshape(-1, 2)


@dataclass(frozen=True, slots=True)
class Distribution:
    """How values are distributed; nan where there are none.

    Attributes:
        count: how many there are.
        mean: their mean.
        jitter: mean absolute deviation from the mean.
        lowest, p50, p90, p99, p999, highest: quantiles, each one of the values.
    """

    count: int
    mean: float
    jitter: float
    lowest: float
    p50: float
    p90: float
    p99: float
    p999: float
    highest: float


@dataclass(frozen=True, slots=True)
class Matches:
    """Control lags found by matching.

    Attributes:
        lags: of every reference sample that found a match, with the time of the sample [s].
        sought: how many samples looked for one.
    """

    lags: Series
    sought: int

    @property
    def fraction(self) -> float:
        """Of the samples that found a match."""
        return len(self.lags) / self.sought if self.sought else nan

    @property
    def distribution(self) -> Distribution:
        """Of the lags [s]."""
        return distribution(self.lags[:, 1])


def quantiles(values: ArrayLike, shares: Sequence[float]) -> list[float]:
    """For each share the smallest value that at least this share of ``values`` does not exceed; nan of none."""
    array = np.asarray(values, dtype=np.float64)
    if not array.size:
        return [nan] * len(shares)
    return [float(each) for each in np.quantile(array, shares, method="inverted_cdf")]


def distribution(values: ArrayLike) -> Distribution:
    """Mean, jitter and quantiles of ``values``."""
    array = np.asarray(values, dtype=np.float64)
    mean = float(array.mean()) if array.size else nan
    jitter = float(np.abs(array - mean).mean()) if array.size else nan
    return Distribution(array.size, mean, jitter, *quantiles(array, (0.0, 0.5, 0.9, 0.99, 0.999, 1.0)))


def settling_time(measured: ArrayLike, goal: float, band: float) -> float | None:
    """When the values came within ``band`` of ``goal`` to stay [s]; None when they are outside at the end.

    Straight between two samples, so that the result does not jump by whole periods.
    """
    times, values = series(measured).T
    distance = np.abs(values - goal)
    outside = np.flatnonzero(distance > band)
    if not outside.size:
        return float(times[0]) if times.size else None
    last = outside[-1]
    if last == len(times) - 1:
        return None
    fraction = (distance[last] - band) / (distance[last] - distance[last + 1])
    return float(times[last] + (times[last + 1] - times[last]) * fraction)


def overshoot(measured: ArrayLike, goal: float) -> float:
    """How far the values went past ``goal``, seen from the first one; 0 when they did not."""
    values = series(measured)[:, 1]
    direction = 1.0 if goal >= values[0] else -1.0
    return max(0.0, float((direction * (values - goal)).max()))


def oscillations(measured: ArrayLike, goal: float, band: float) -> int:
    """How often the values crossed from one side of ``goal``, further than ``band``, to the other."""
    values = series(measured)[:, 1]
    sides = values[np.abs(values - goal) > band] > goal
    return int(np.count_nonzero(sides[1:] != sides[:-1]))


def final_error(measured: ArrayLike, goal: float, seconds: float) -> float:
    """Largest distance from ``goal`` in the last ``seconds``: the steady-state error."""
    times, values = series(measured).T
    return float(np.abs(values[times > times[-1] - seconds] - goal).max())


def largest_error(reference: ArrayLike, measured: ArrayLike) -> float:
    """Largest distance of a measured value from the reference of its time, which is straight between its samples."""
    times, values = series(measured).T
    return float(np.abs(values - np.interp(times, *series(reference).T)).max())


def best_delay(reference: ArrayLike, measured: ArrayLike) -> float:
    """The delay of the reference with which it comes closest to the measured values, by least squares [s].

    Negative when the motion leads. The whole motion counts, where a match is about single samples.

    Args:
        reference: dense enough to be straight between its samples; constant before and after them.
        measured: every fourth value is used.
    """
    goals, wanted = series(reference).T
    times, values = series(measured)[::4].T
    return minimum(
        lambda late: float(((values - np.interp(times - late, goals, wanted)) ** 2).sum()), -0.1 * _LONGEST, _LONGEST
    )


def minimum(cost: Callable[[float], float], lowest: float, highest: float) -> float:
    """Where ``cost`` is least between two bounds, by ever finer grids; it may be flat or noisy at the finest."""
    best, width = 0.5 * (lowest + highest), 0.5 * (highest - lowest)
    while width > _FINEST:
        best = min((float(each) for each in np.linspace(best - width, best + width, 11)), key=cost)
        width /= 4.0
    return best


def match_lags(reference: ArrayLike, measured: ArrayLike, tolerance: float) -> Matches:
    """The control lag of every reference sample: the time until a measured value comes within ``tolerance`` of it.

    A match lies on the same branch: before the reference turns, and moving the same way. Without that a sample near a
    turning point would be matched with the way back, or before the way there.
    """
    goals, wanted = series(reference).T
    times, values = series(measured).T
    branches, ways = directions(wanted), directions(values)
    # A branch ends where the reference turns, the last one with the reference.
    turns = np.flatnonzero(branches[1:] != branches[:-1]) + 1
    ends = np.append(goals[turns], goals[-1:])[np.searchsorted(turns, np.arange(len(goals)), side="right")]
    first, last = np.searchsorted(times, goals), np.searchsorted(times, ends, side="right")
    lags = []
    for index, (time, value) in enumerate(zip(goals, wanted, strict=True)):
        window = slice(first[index], last[index])
        is_match = (ways[window] == branches[index]) & (np.abs(values[window] - value) <= tolerance)
        if is_match.any():
            lags.append((time, times[window][is_match.argmax()] - time))
    return Matches(series(lags), len(goals))


def directions(values: ArrayLike) -> NDArray[np.float64]:
    """Which way each value moves: 1 up, -1 down; where it stands, as before."""
    array = np.asarray(values, dtype=np.float64)
    ways = np.sign(np.diff(array))
    ways = np.append(ways, ways[-1:] if ways.size else np.zeros(array.size))
    moving = np.maximum.accumulate(np.where(ways != 0.0, np.arange(ways.size), 0))
    return ways[moving] if ways.size else ways
