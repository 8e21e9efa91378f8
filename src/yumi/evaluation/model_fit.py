"""The virtual arm's free parameters, delay and servo lag, from the published step times alone.

Of the two only their sum matters to a step: one number, the control lag, is fitted, and shared as in the virtual robot
that is shipped. The published times are rounded to tenths of a second, each alike, so that what counts are seconds and
not ratios. Nothing bounds the lag but zero; that it comes out within the 10 to 20 ms of the EGM manual is a finding.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import nan, sqrt

from yumi.evaluation.experiment import Experiment, System
from yumi.evaluation.experiments import published_experiments
from yumi.evaluation.fitted_model import arm_with
from yumi.evaluation.tracking_figures import StepFigures, figures_of
from yumi.evaluation.virtual_experiment import run_virtually
from yumi.virtual.arm_model import ArmModel

LONGEST = 0.060
"""No longer control lag is tried [s]: three times the manual's longest."""

RESOLUTION = 0.0005
"""How finely it is looked for [s]."""

_GOLDEN = (sqrt(5.0) - 1.0) / 2.0


@dataclass(frozen=True, slots=True)
class Trial:
    """How an arm does the published steps.

    Attributes:
        model: the arm.
        times: of the steps [s].
        error: root mean square of their differences to the published times [s].
    """

    model: ArmModel
    times: tuple[float, ...]
    error: float

    @property
    def control_lag(self) -> float:
        """[s]."""
        return self.model.delay + self.model.lag


def timed_steps() -> tuple[Experiment, ...]:
    """The steps of which a time is published."""
    return tuple(each for each in published_experiments() if each.published.settling is not None)


def fit(on_trial: Callable[[Trial], None] = lambda _: None) -> Trial:
    """The control lag between 0 and ``LONGEST`` with the least error, by golden sections."""
    low, high = 0.0, LONGEST
    left, right = (attempt(arm_with(lag), on_trial) for lag in (high - _GOLDEN * high, _GOLDEN * high))
    while high - low > RESOLUTION:
        if left.error <= right.error:
            high, right = right.control_lag, left
            left = attempt(arm_with(high - _GOLDEN * (high - low)), on_trial)
        else:
            low, left = left.control_lag, right
            right = attempt(arm_with(low + _GOLDEN * (high - low)), on_trial)
    return min(left, right, key=lambda trial: trial.error)


def attempt(model: ArmModel, on_trial: Callable[[Trial], None] = lambda _: None) -> Trial:
    """The published steps of one arm."""
    steps = timed_steps()
    times = tuple(_time(experiment, model) for experiment in steps)
    squares = [
        (time - (experiment.published.settling or nan)) ** 2 for time, experiment in zip(times, steps, strict=True)
    ]
    trial = Trial(model, times, sqrt(sum(squares) / len(squares)))
    on_trial(trial)
    return trial


def _time(experiment: Experiment, model: ArmModel) -> float:
    figures = figures_of(run_virtually(experiment, System.BARE, model))
    assert isinstance(figures, StepFigures)
    return nan if figures.settling_s is None else figures.settling_s
