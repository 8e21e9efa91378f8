"""The virtual arm's free parameters, delay and servo lag, from the published step times alone.

Of the two only their sum matters to a step, and little: the gain makes most of its duration. So the parameters are
looked for where the EGM manual says they are: a control lag of 10 to 20 ms from reference to position.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from yumi.evaluation.experiment import Experiment, System
from yumi.evaluation.experiments import published_experiments
from yumi.evaluation.tracking_figures import compared, figures_of
from yumi.evaluation.virtual_experiment import run_virtually
from yumi.virtual.arm_model import ArmModel

SHORTEST, LONGEST = 0.010, 0.020
"""Of the control lag, by the EGM manual [s]."""

GRID = tuple(
    (delay, total - delay)
    for total in (SHORTEST, 0.015, LONGEST)
    for delay in (0.0, 0.005, 0.010, 0.015, 0.020)
    if delay <= total
)
"""Delays and lags that are tried [s]."""


@dataclass(frozen=True, slots=True)
class Trial:
    """How an arm with some delay and lag does the published steps.

    Attributes:
        delay, lag: of the arm [s].
        ratios: of our step times to the published ones.
        cost: mean square of what the ratios are off.
    """

    delay: float
    lag: float
    ratios: tuple[float, ...]
    cost: float


def timed_steps() -> tuple[Experiment, ...]:
    """The steps of which a time is published."""
    return tuple(each for each in published_experiments() if each.published.settling is not None)


def fit(
    grid: Sequence[tuple[float, float]] = GRID, on_trial: Callable[[Trial], None] = lambda _: None
) -> tuple[Trial, ...]:
    """Every (delay, lag) of the ``grid`` [s], the best first; of equals the one with less lag."""
    trials = []
    for delay, lag in grid:
        trials.append(_try(delay, lag))
        on_trial(trials[-1])
    return tuple(sorted(trials, key=lambda trial: (round(trial.cost, 6), trial.lag)))


def _try(delay: float, lag: float) -> Trial:
    model = ArmModel(delay=delay, lag=lag)
    ratios = tuple(_ratio(experiment, model) for experiment in timed_steps())
    return Trial(delay, lag, ratios, sum([(ratio - 1.0) ** 2 for ratio in ratios]) / len(ratios))


def _ratio(experiment: Experiment, model: ArmModel) -> float:
    trace = run_virtually(experiment, System.BARE, model)
    return compared(trace, figures_of(trace))["settling_s"][2]
