"""Runs of the benchmark with latencies of our choice."""

from __future__ import annotations

from yumi_evaluation.bench.contenders import ECHO, PEERS, Case, Contender, Mode, busy_ros_graph, control_loop, ros_graph
from yumi_evaluation.bench.figures import ArmRun, Figures, LatencyFigures, Run

LOOP = control_loop("blocking")


def run(number: int, contender: Contender, *p50_us: float, mode: Mode = Mode.PACED, bad: int = 0) -> Run:
    """A run with one arm per median [µs]; p99 is twice that, p99.9 thrice, max four times."""
    arms = tuple(
        ArmRun(
            LatencyFigures(p50, 2 * p50, 3 * p50, 4 * p50),
            missed=1,
            stale=0,
            bad=bad,
            recovering=0,
            unparsed=0,
            duplicates=0,
        )
        for p50 in p50_us
    )
    return Run(number, Case(contender, mode, len(arms)), 1000, 4.0, 2.5, 3.5, 10.0, arms, {})


def figures() -> Figures:
    """Two rounds; in the first one peer is better, in the second the other."""
    first, second = PEERS
    return Figures(
        (
            run(1, ECHO, 50.0), run(1, first, 100.0), run(1, second, 200.0),
            run(1, LOOP, 80.0), run(1, LOOP, 85.0, 96.0),
            run(2, ECHO, 60.0), run(2, first, 400.0), run(2, second, 200.0),
            run(2, LOOP, 120.0), run(2, LOOP, 120.0, 60.0),
            run(2, ros_graph("blocking"), 100.0), run(2, busy_ros_graph("blocking"), 150.0),
        )
    )  # fmt: skip
