"""What the benchmark measured, run by run: spreads over rounds, ratios within a round, and the targets."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from math import isfinite, nan

import numpy as np
from numpy.typing import ArrayLike, NDArray

from yumi_evaluation.bench.contenders import Case, Mode
from yumi_evaluation.metrics import quantiles

LATENCIES = ("p50_us", "p99_us", "p999_us", "max_us")
COUNTERS = ("missed", "stale", "bad", "recovering", "unparsed", "duplicates")
"""What is counted of each arm."""

BOUNDS_TO_PEERS = {
    "control_loop_blocking": {"p50_us": 0.75, "p99_us": 0.85},
    "control_loop_auto": {"p50_us": 0.40, "p99_us": 0.60},
    "ros_graph_auto": {"p50_us": 0.55, "p99_us": 0.85},
}
"""Highest ratios to the better PyPI peer running alone, paced, one arm."""

BOUNDS_TO_ECHO = {"control_loop_blocking": {"p50_us": 1.5, "p99_us": 1.5}}
"""Highest ratios to the C echo, paced, one arm."""

LATER_TO_ECHO = 1.3
"""The later reply of two arms, 99.9 % of the cycles, against the C echo's."""

LATER_REPLY_US = 2000.0
"""Half a period: the later reply of two arms, 99.9 % of the cycles [µs]."""

BUSY_CALLBACK = 1.2
"""The 99th percentile with a busy Python callback in the ROS process against the same without."""

OVER_ECHO_US = 1000.0
"""The latest reply against the C echo's latest [µs]."""

MISSED_OVER_ECHO = 1
"""In a soak: cycles that we miss more than the C echo."""

CPU_PER_ARM_PERCENT = 15.0
"""Of one core, with ``auto``."""


@dataclass(frozen=True, slots=True)
class LatencyFigures:
    """Quantiles of one run's reply latencies [µs]; nan where nothing was answered."""

    p50_us: float
    p99_us: float
    p999_us: float
    max_us: float


@dataclass(frozen=True, slots=True)
class Spread:
    """A figure over the rounds."""

    median: float
    lowest: float
    highest: float
    rounds: int


def latency_figures(latencies_ns: ArrayLike) -> LatencyFigures:
    """Quantiles of the latencies [ns] of all cycles; 0 stands for a cycle without a reply and is left out."""
    latencies = np.asarray(latencies_ns)
    return LatencyFigures(*quantiles(latencies[latencies > 0] / 1000.0, (0.5, 0.99, 0.999, 1.0)))


def spread_of(values: Iterable[float]) -> Spread | None:
    """Median and range of the finite ``values``, one a round; None when there are none."""
    found = [value for value in values if isfinite(value)]
    return Spread(float(np.median(found)), min(found), max(found), len(found)) if found else None


def ratio(value: float, reference: float) -> float:
    """``value`` / ``reference``; nan where there is no reference."""
    return value / reference if reference > 0.0 else nan


@dataclass(frozen=True, slots=True)
class ArmRun:
    """One arm of a run.

    Attributes:
        latency: quantiles of send to reply.
        missed: cycles without any reply in time: one period when paced, 0.1 s in ping-pong.
        stale: replies that came after their cycle.
        bad: replies with a wrong value.
        recovering: replies of a limiter that was still catching up after an unanswered cycle.
        unparsed: replies that are not EGM.
        duplicates: second replies to a cycle.
    """

    latency: LatencyFigures
    missed: int
    stale: int
    bad: int
    recovering: int
    unparsed: int
    duplicates: int


@dataclass(frozen=True, slots=True)
class Run:
    """One fresh server under load.

    Attributes:
        round: from 1.
        case: what was run.
        cycles: counted cycles.
        duration: of these [s].
        cpu_percent: of one core, used by the process that answers.
        cpu_all_percent: of one core, used by the server with all its processes.
        generator_late_max_us: how late the load generator itself was at worst [µs].
        arms: one or two.
        heard: messages that the subscriber process received, by topic; empty without ROS.
        stages: medians of the control loop's last ten seconds, by the name of the stage [µs]; empty for others.
        unanswered: datagrams that the core answered for a late controller, by arm; without those that have none.
        latencies: of each arm and cycle [ns], 0 without a right reply; shape (arms, cycles).
    """

    round: int
    case: Case
    cycles: int
    duration: float
    cpu_percent: float
    cpu_all_percent: float
    generator_late_max_us: float
    arms: tuple[ArmRun, ...]
    heard: dict[str, int]
    stages: dict[str, float] = field(default_factory=dict)
    unanswered: dict[str, int] = field(default_factory=dict)
    latencies: NDArray[np.int64] = field(default_factory=lambda: np.empty((0, 0), np.int64), compare=False, repr=False)

    @property
    def cycles_per_second(self) -> float:
        return ratio(float(self.cycles), self.duration)

    def latency(self, figure: str) -> float:
        """A latency figure [µs], of the slower arm where there are two."""
        return max((float(getattr(arm.latency, figure)) for arm in self.arms), default=nan)

    @property
    def later_reply_p999_us(self) -> float:
        """In 99.9 % of the cycles that were answered all arms had their reply by then [µs]; nan without latencies."""
        answered = self.latencies[:, (self.latencies > 0).all(axis=0)]
        return latency_figures(answered.max(axis=0)).p999_us if answered.size else nan

    def count(self, counter: str) -> int:
        """A counter, of all arms."""
        return sum(int(getattr(arm, counter)) for arm in self.arms)


@dataclass(frozen=True, slots=True)
class Figures:
    """All runs of a benchmark, in their order."""

    runs: tuple[Run, ...]

    @property
    def cases(self) -> list[Case]:
        """The cases that were run, ours after those they are compared with."""

        def place(case: Case) -> tuple[bool, str, int, bool, str]:
            is_reference = case.contender.gain == 0.0 or case.contender.is_peer
            return case.is_machine_busy, case.mode.value, case.arms, not is_reference, case.contender.name

        return sorted({run.case for run in self.runs}, key=place)

    def of(self, name: str) -> list[Run]:
        """The runs of a case by its name."""
        return [run for run in self.runs if run.case.name == name]

    def spread(self, case: Case, value: Callable[[Run], float]) -> Spread | None:
        """A value of ``case`` over the rounds."""
        return spread_of(value(run) for run in self.of(case.name))

    def ratio_to_peers(self, case: Case, figure: str) -> Spread | None:
        """A latency figure by that of the better PyPI peer with one arm of the same round, mode and load."""

        def better_peer(number: int) -> float:
            conditions = number, case.mode, case.is_machine_busy
            runs = [run for run in self.runs if (run.round, run.case.mode, run.case.is_machine_busy) == conditions]
            return min((run.latency(figure) for run in runs if run.case.contender.is_peer), default=nan)

        return spread_of(ratio(run.latency(figure), better_peer(run.round)) for run in self.of(case.name))

    def ratio_to_case(self, name: str, reference: str, figure: str) -> Spread | None:
        """A latency figure of the case ``name`` by that of the case ``reference`` in the same round."""
        return self.ratio_of(name, reference, lambda run: run.latency(figure))

    def ratio_of(self, name: str, reference: str, value: Callable[[Run], float]) -> Spread | None:
        """A value of the case ``name`` by that of the case ``reference`` in the same round."""
        return spread_of(ratio(value(run), value(other)) for run, other in self._pairs(name, reference))

    def excess_over(self, name: str, reference: str, figure: str) -> Spread | None:
        """A latency figure of the case ``name`` less that of the case ``reference`` in the same round [µs]."""
        return spread_of(run.latency(figure) - other.latency(figure) for run, other in self._pairs(name, reference))

    def _pairs(self, name: str, reference: str) -> Sequence[tuple[Run, Run]]:
        others = {run.round: run for run in self.of(reference)}
        return [(run, others[run.round]) for run in self.of(name) if run.round in others]


@dataclass(frozen=True, slots=True)
class Target:
    """A bound and what was measured over the rounds, whose median must not exceed it."""

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
    # The formula of the load generator does not know a command by which the core brakes for a late controller.
    wrong = (max(0, run.count("bad") - sum(run.unanswered.values())) + run.count("unparsed") for run in figures.runs)
    yield "bad_replies", 0.0, spread_of([float(sum(wrong))])
    for case in figures.cases:
        name = case.contender.name
        if case.mode is not Mode.PACED or case.is_machine_busy:
            continue
        if case.arms == 1:
            for figure, bound in BOUNDS_TO_PEERS.get(name, {}).items():
                yield f"{name}/{figure}_to_peer", bound, figures.ratio_to_peers(case, figure)
            for figure, bound in BOUNDS_TO_ECHO.get(name, {}).items():
                yield f"{name}/{figure}_to_echo", bound, figures.ratio_to_case(case.name, "c_echo/paced/1", figure)
        if name.startswith("control_loop_"):
            if case.arms == 1:
                yield (
                    f"{name}/max_us_over_echo",
                    OVER_ECHO_US,
                    figures.excess_over(case.name, "c_echo/paced/1", "max_us"),
                )
            else:
                later = figures.spread(case, lambda run: run.later_reply_p999_us)
                yield f"{name}/later_reply_p999_us_of_{case.arms}", LATER_REPLY_US, later
                later = figures.ratio_of(case.name, "c_echo/paced/2", lambda run: run.later_reply_p999_us)
                yield f"{name}/later_reply_p999_us_of_{case.arms}_to_echo", LATER_TO_ECHO, later
            if name.endswith("_auto"):
                used = spread_of(run.cpu_percent / case.arms for run in figures.of(case.name))
                yield f"{name}/cpu_percent_per_arm_of_{case.arms}", CPU_PER_ARM_PERCENT, used
        if name.startswith("ros_graph_busy_"):
            calm = case.name.replace("_busy", "")
            yield f"{name}/p99_us_to_calm", BUSY_CALLBACK, figures.ratio_to_case(case.name, calm, "p99_us")
