"""What the benchmark is held to: each target is a figure over the rounds whose median must not exceed a bound."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from yumi_evaluation.bench.figures import Figures, Spread, spread_of

BOUNDS_TO_PEERS = {
    "fast_line_blocking": {"p50_us": 0.75, "p99_us": 0.9},
    "fast_line_auto": {"p50_us": 0.3, "p99_us": 0.5},
    "ros_graph_auto": {"p50_us": 0.5, "p99_us": 0.9},
}
"""Highest ratios to the better PyPI peer running alone, paced, one arm."""

TWO_ARMS = 1.2
"""Each of two arms against one arm alone."""

BUSY_CALLBACK = 1.2
"""The 99th percentile with a busy Python callback in the ROS process against the same without."""

OVER_ECHO_US = 1000.0
"""The latest reply against the C echo's latest [µs]."""

CPU_PER_ARM_PERCENT = 15.0
"""Of one core, with ``auto``."""


@dataclass(frozen=True, slots=True)
class Target:
    """A bound and what was measured.

    Attributes:
        name: in the figures.
        bound: the median must not be above.
        measured: over the rounds.
    """

    name: str
    bound: float
    measured: Spread

    @property
    def holds(self) -> bool:
        return self.measured.median <= self.bound


def targets(figures: Figures) -> list[Target]:
    """The targets for which there are figures."""
    return [Target(name, bound, spread) for name, bound, spread in _measured(figures) if spread is not None]


def _measured(figures: Figures) -> Iterator[tuple[str, float, Spread | None]]:
    yield "bad_replies", 0.0, spread_of([float(sum(run.count("bad") + run.count("unparsed") for run in figures.runs))])
    for case in figures.cases:
        if case.arms == 1 and case.mode.value == "paced":
            for figure, bound in BOUNDS_TO_PEERS.get(case.contender.name, {}).items():
                yield f"{case.contender.name}/{figure}_to_peer", bound, figures.ratio_to_peers(case, figure)
    for name in _names(figures, "fast_line_"):
        yield from _against_others(figures, name)
    for name in _names(figures, "ros_graph_busy_"):
        calm = name.replace("_busy", "")
        yield (
            f"{name}/p99_us_to_calm",
            BUSY_CALLBACK,
            figures.ratio_to_case(f"{name}/paced/1", f"{calm}/paced/1", "p99_us"),
        )


def _against_others(figures: Figures, name: str) -> Iterator[tuple[str, float, Spread | None]]:
    one, two = f"{name}/paced/1", f"{name}/paced/2"
    yield f"{name}/p50_us_two_arms_to_one", TWO_ARMS, figures.ratio_to_case(two, one, "p50_us")
    yield f"{name}/max_us_over_echo", OVER_ECHO_US, figures.excess_over(one, "c_echo/paced/1", "max_us")
    if name == "fast_line_auto":
        for case, arms in ((one, 1), (two, 2)):
            used = spread_of(run.cpu_percent / arms for run in figures.of(case))
            yield f"{name}/cpu_percent_per_arm_of_{arms}", CPU_PER_ARM_PERCENT, used


def _names(figures: Figures, beginning: str) -> Iterable[str]:
    return sorted({case.contender.name for case in figures.cases if case.contender.name.startswith(beginning)})
