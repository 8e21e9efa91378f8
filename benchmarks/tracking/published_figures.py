"""Prints the thesis's nine figures as other robots and other sines would give them, as tables of Markdown.

The experiments run in virtual time and without the limiter. A star marks what is within a tenth of what is published.
The tables are those of docs/explanation/evaluation.md::

    python benchmarks/tracking/published_figures.py
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import yumi_evaluation.virtual_time
from virtual_irc5.mechanics.arm_motion import ArmModel
from virtual_irc5.mechanics.egm_motion import ExternalMotionData
from yumi_evaluation.experiments import (
    TAIL,
    Experiment,
    Published,
    Sine,
    System,
    compared,
    figures_of,
    published_experiments,
)
from yumi_evaluation.report import NEAR
from yumi_evaluation.virtual_time import FITTED, FITTED_ACCELERATION, run_virtually

EXPERIMENTS = [each for each in published_experiments() if each.published != Published()]
SHIPPED = ArmModel()
ROBOTS = {
    f"**fitted: shipped, {FITTED_ACCELERATION:g} rad/s²**": FITTED,
    "as shipped": SHIPPED,
    "6 ms of delay and lag": replace(SHIPPED, delay=0.004, lag=0.002),
    "none": replace(SHIPPED, reference_delay=0.0, delay=0.0, lag=0.0),
    f"26 ms, {FITTED_ACCELERATION:g} rad/s²": replace(FITTED, delay=0.016, lag=0.010),
}
GAINS = (5.0, 5.3, 5.6, 5.9, 6.2)
"""Of the robot's loop [1/s]."""

FREQUENCIES = (0.05, 0.1, 0.125, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5)


def main() -> None:
    print("| | " + " | ".join(f"{each.figure}: {each.title}" for each in EXPERIMENTS) + " | within a tenth |")
    print("| published |", " | ".join("/".join(f"{value:g}" for value in numbers(each)) for each in EXPERIMENTS))
    for name, model in ROBOTS.items():
        print(row(name, EXPERIMENTS, model), flush=True)
    for gain in GAINS:
        with loop_gain(gain):
            print(row(f"k = {gain:g} s⁻¹", EXPERIMENTS, FITTED), flush=True)
    for frequency in FREQUENCIES:
        print(row(f"{frequency:g} Hz", [at(each, frequency) for each in EXPERIMENTS], FITTED), flush=True)


def numbers(experiment: Experiment) -> list[float]:
    published = experiment.published
    found = (published.settling_s, published.mean_lag_s, published.max_lag_s)
    return [1e3 * value for value in found if value is not None]


def at(experiment: Experiment, frequency: float) -> Experiment:
    """The same with a sine of another frequency [Hz]; a step stays."""
    reference = experiment.reference
    if not isinstance(reference, Sine):
        return experiment
    return replace(experiment, reference=replace(reference, frequency=frequency), duration=1.0 / frequency + TAIL)


@contextmanager
def loop_gain(gain: float) -> Iterator[None]:
    """Robots whose default position gain is another one [1/s]."""
    usual = yumi_evaluation.virtual_time.ExternalMotionData
    yumi_evaluation.virtual_time.ExternalMotionData = lambda **data: ExternalMotionData(position_gain=gain, **data)  # type: ignore[misc,assignment]
    try:
        yield
    finally:
        yumi_evaluation.virtual_time.ExternalMotionData = usual  # type: ignore[misc]


def row(name: str, experiments: list[Experiment], model: ArmModel) -> str:
    cells, near, count = [], 0, 0
    for experiment in experiments:
        trace = run_virtually(experiment, System.BARE, model)
        found = []
        for _, own, ratio in compared(trace, figures_of(trace)).values():
            is_near = abs(ratio - 1.0) <= NEAR
            near, count = near + is_near, count + 1
            found.append(f"{1e3 * own:.0f}{'*' if is_near else ''}")
        cells.append(" \\| ".join(found))
    return f"| {name} | {' | '.join(cells)} | {near} of {count} |"


if __name__ == "__main__":
    main()
