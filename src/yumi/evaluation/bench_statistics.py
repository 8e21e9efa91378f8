"""Figures of the benchmark: quantiles of reply latencies, and how a figure spreads over the rounds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import ceil, isfinite, nan

NS_PER_US = 1000.0


@dataclass(frozen=True, slots=True)
class LatencyFigures:
    """Quantiles of one run's reply latencies [µs]; not a number where nothing was answered.

    Attributes:
        p50_us: half of the replies came sooner.
        p99_us: 99 % came sooner or at this time.
        p999_us: 99.9 % did.
        max_us: the latest.
    """

    p50_us: float
    p99_us: float
    p999_us: float
    max_us: float


@dataclass(frozen=True, slots=True)
class Spread:
    """A figure over the rounds.

    Attributes:
        median: the middle one, or the mean of the two in the middle.
        lowest: of all rounds.
        highest: of all rounds.
        rounds: how many there were.
    """

    median: float
    lowest: float
    highest: float
    rounds: int


def quantile(ordered: Sequence[float], share: float) -> float:
    """The smallest of the ``ordered`` values that at least ``share`` of them do not exceed; nan of nothing."""
    if not ordered:
        return nan
    return ordered[max(ceil(share * len(ordered) - 1e-9), 1) - 1]


def latency_figures(latencies_ns: Iterable[int]) -> LatencyFigures:
    """Quantiles of the latencies [ns] of all cycles; 0 stands for a cycle without a reply and is left out."""
    ordered = [value / NS_PER_US for value in sorted(latencies_ns) if value > 0]
    return LatencyFigures(
        p50_us=quantile(ordered, 0.5),
        p99_us=quantile(ordered, 0.99),
        p999_us=quantile(ordered, 0.999),
        max_us=quantile(ordered, 1.0),
    )


def spread_of(values: Iterable[float]) -> Spread | None:
    """Median and range of the finite ``values``, one a round; None when there are none."""
    ordered = sorted(value for value in values if isfinite(value))
    if not ordered:
        return None
    count = len(ordered)
    middle = (ordered[(count - 1) // 2] + ordered[count // 2]) / 2.0
    return Spread(middle, ordered[0], ordered[-1], count)


def ratio(value: float, reference: float) -> float:
    """``value`` / ``reference``; nan where there is no reference."""
    return value / reference if reference > 0.0 else nan
