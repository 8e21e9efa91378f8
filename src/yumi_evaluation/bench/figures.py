"""What the benchmark measured, run by run, and what follows from it: spreads over rounds and ratios within a round.

A picture of the benchmark: the distribution of reply latencies, one line a contender, latencies on a log scale.

Figures of the benchmark: quantiles of reply latencies, and how a figure spreads over the rounds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, isfinite, log10, nan
from pathlib import Path
from typing import Any

from yumi.errors import MissingPrerequisite
from yumi_evaluation.bench.build import Case, Mode

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


LATENCIES = ("p50_us", "p99_us", "p999_us", "max_us")


COUNTERS = ("missed", "stale", "bad", "recovering", "unparsed", "duplicates")
"""What is counted of each arm."""


@dataclass(frozen=True, slots=True)
class ArmRun:
    """One arm of a run.

    Attributes:
        latency: quantiles of send to reply.
        missed: cycles without a reply in time: one period when paced, 0.1 s in ping-pong.
        stale: replies that came after their cycle.
        bad: replies with a wrong value.
        recovering: replies of a guard that still caught up after an unanswered cycle.
        unparsed: replies that are no EGM.
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
        case: who and how.
        cycles: counted cycles.
        duration: of these [s].
        cpu_percent: of one core, used by the process that answers.
        cpu_all_percent: of one core, used by the server with all processes that belong to it.
        generator_late_max_us: how late the load generator itself was at worst [µs].
        arms: one or two.
        heard: messages that the subscriber process received, by topic; empty without ROS.
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

    @property
    def cycles_per_second(self) -> float:
        return ratio(float(self.cycles), self.duration)

    def latency(self, figure: str) -> float:
        """A latency figure [µs], of the slower arm where there are two."""
        return max((float(getattr(arm.latency, figure)) for arm in self.arms), default=nan)

    def count(self, counter: str) -> int:
        """A counter, of all arms."""
        return sum(int(getattr(arm, counter)) for arm in self.arms)


@dataclass(frozen=True, slots=True)
class Figures:
    """All runs of a benchmark.

    Attributes:
        runs: in the order they were made.
    """

    runs: tuple[Run, ...]

    @property
    def cases(self) -> list[Case]:
        """The cases that were run, ours after those they are measured against."""
        return sorted({run.case for run in self.runs}, key=_place)

    def of(self, name: str) -> list[Run]:
        """The runs of a case by its name."""
        return [run for run in self.runs if run.case.name == name]

    def spread(self, case: Case, value: Callable[[Run], float]) -> Spread | None:
        """A value of ``case`` over the rounds."""
        return spread_of(value(run) for run in self.of(case.name))

    def ratio_to_peers(self, case: Case, figure: str) -> Spread | None:
        """A latency figure by that of the better PyPI peer with one arm in the same round and mode."""
        return spread_of(
            ratio(run.latency(figure), self._better_peer(run.round, case.mode, figure)) for run in self.of(case.name)
        )

    def ratio_to_case(self, name: str, reference: str, figure: str) -> Spread | None:
        """A latency figure of the case ``name`` by that of the case ``reference`` in the same round."""
        return spread_of(
            ratio(run.latency(figure), other.latency(figure)) for run, other in self._pairs(name, reference)
        )

    def excess_over(self, name: str, reference: str, figure: str) -> Spread | None:
        """A latency figure of the case ``name`` less that of the case ``reference`` in the same round [µs]."""
        return spread_of(run.latency(figure) - other.latency(figure) for run, other in self._pairs(name, reference))

    def _pairs(self, name: str, reference: str) -> Iterable[tuple[Run, Run]]:
        others = {run.round: run for run in self.of(reference)}
        return ((run, others[run.round]) for run in self.of(name) if run.round in others)

    def _better_peer(self, number: int, mode: Mode, figure: str) -> float:
        return min((run.latency(figure) for run in self._peers(number, mode)), default=nan)

    def _peers(self, number: int, mode: Mode) -> Sequence[Run]:
        return [
            run for run in self.runs if run.round == number and run.case.mode is mode and run.case.contender.is_peer
        ]


def _place(case: Case) -> tuple[str, int, bool, str]:
    contender = case.contender
    return case.mode.value, case.arms, not (contender.gain == 0.0 or contender.is_peer), contender.name


BINS_PER_DECADE = 40
LOWEST_US, HIGHEST_US = 1.0, 100_000.0

# Matplotlib's palette "tab20": its ten strong colours, then the ten pale ones.
_COLOURS = (
    "#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b", "#e377c2", "#7f7f7f", "#bcbd22", "#17becf",
    "#aec7e8", "#ffbb78", "#98df8a", "#ff9896", "#c5b0d5", "#c49c94", "#f7b6d2", "#c7c7c7", "#dbdb8d", "#9edae5",
)  # fmt: skip


def histogram(latencies_us: Sequence[float]) -> tuple[list[float], list[float]]:
    """Edges [µs] of bins of equal width on a log scale, and the share of the latencies in each bin.

    What lies outside of 1 µs to 0.1 s is counted in the outermost bins.
    """
    count = round(BINS_PER_DECADE * log10(HIGHEST_US / LOWEST_US))
    edges = [LOWEST_US * 10.0 ** (index / BINS_PER_DECADE) for index in range(count + 1)]
    shares = [0.0] * count
    for latency in latencies_us:
        position = BINS_PER_DECADE * log10(max(latency, LOWEST_US) / LOWEST_US)
        shares[min(int(position), count - 1)] += 1.0 / len(latencies_us)
    return edges, shares


def draw_histograms(panels: Mapping[str, Mapping[str, Sequence[float]]], file: Path) -> None:
    """Draw one panel per title with the latencies [µs] of each contender, and save the picture as ``file``.

    Raises:
        MissingPrerequisite: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415 - an extra; nothing else needs it
    except ImportError as error:
        raise MissingPrerequisite("Pictures need matplotlib; install yumi-ros2[plot].") from error
    figure = Figure(figsize=(10.0, 3.2 * len(panels)), layout="constrained")
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    names = dict.fromkeys(name for contenders in panels.values() for name in contenders)
    styles = dict(zip(names, line_styles(len(names)), strict=True))  # a contender looks the same in all panels
    for panel, (title, contenders) in zip(axes, panels.items(), strict=True):
        _draw_panel(panel, title, contenders, styles)
    axes[-1].set_xlabel("send to reply [µs]")
    figure.savefig(file, dpi=150)


def line_styles(count: int) -> list[dict[str, Any]]:
    """As many looks of a line, no two alike: the strong colours first, then the pale ones, then both dashed."""
    return [
        {"color": _COLOURS[index % len(_COLOURS)], "linestyle": ("-", "--", ":")[index // len(_COLOURS) % 3]}
        for index in range(count)
    ]


def _draw_panel(
    panel: Any, title: str, contenders: Mapping[str, Sequence[float]], styles: Mapping[str, Mapping[str, Any]]
) -> None:
    for name, latencies in contenders.items():
        edges, shares = histogram(latencies)
        panel.stairs(shares, edges, label=f"{name} ({len(latencies)} replies)", linewidth=1.4, **styles[name])
    panel.set(title=title, xscale="log", yscale="log", ylabel="share of replies", xlim=(5.0, 20_000.0))
    panel.grid(alpha=0.3, which="both")
    panel.legend(loc="upper right", fontsize="small", frameon=False)
