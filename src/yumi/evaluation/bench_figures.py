"""What the benchmark measured, run by run, and what follows from it: spreads over rounds and ratios within a round."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import nan

from yumi.evaluation.bench_contenders import Case, Mode
from yumi.evaluation.bench_statistics import LatencyFigures, Spread, ratio, spread_of

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
