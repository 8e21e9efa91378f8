"""The figures of a trace: how long a step took, how far behind a sine was followed, beside what is published."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import inf, isnan

import numpy as np

from yumi_evaluation.experiments import TAIL, TOLERANCE_DEG, Trace
from yumi_evaluation.metrics import (
    Matches,
    Series,
    best_delay,
    final_error,
    largest_error,
    match_lags,
    oscillations,
    overshoot,
    settling_time,
)

START = 1.5
"""A sine that begins at full speed cannot be followed from its first moment; errors count from here on [s]."""

HOLD = 0.5
"""The steady-state error is that of so long a time at the end of a step [s]."""


@dataclass(frozen=True, slots=True)
class StepFigures:
    """A step.

    Attributes:
        settling_s: time until the joint stays within 0.1° of the goal; None when it does not.
        overshoot_deg: how far it went past the goal.
        oscillations: how often it crossed the goal by more than 0.1°.
        final_error_deg: largest distance from the goal in the last half second: the steady-state error.
    """

    settling_s: float | None
    overshoot_deg: float
    oscillations: int
    final_error_deg: float


@dataclass(frozen=True, slots=True)
class SineFigures:
    """A sine.

    Attributes:
        mean_lag_s, max_lag_s: control lag by matching, as published.
        p99_lag_s: 99 % of the matches are not later.
        jitter_s: mean absolute deviation of the lags from their mean.
        matched_fraction: of the goals that found a match.
        delay_s: by how much the whole motion is late, by least squares; negative when it leads.
        max_error_deg: largest distance from the reference of the same moment, once the start is over.
        max_error_with_start_deg: the same from the first moment on.
    """

    mean_lag_s: float
    max_lag_s: float
    p99_lag_s: float
    jitter_s: float
    matched_fraction: float
    delay_s: float
    max_error_deg: float
    max_error_with_start_deg: float


Figures = StepFigures | SineFigures


def figures_of(trace: Trace) -> Figures:
    """The figures of the joint that moved; of the one that followed worst when several did."""
    found = [
        _step_figures(trace, joint) if trace.experiment.is_step else _sine_figures(trace, joint)
        for joint in trace.experiment.moved
    ]
    return max(found, key=_badness)


def step_figures_of(trace: Trace) -> StepFigures:
    """The figures of a step."""
    figures = figures_of(trace)
    assert isinstance(figures, StepFigures), f"{trace.experiment.name} is not a step"
    return figures


def main_figure(figures: Figures) -> float | None:
    """Step time or mean lag [s]."""
    return figures.settling_s if isinstance(figures, StepFigures) else figures.mean_lag_s


def matches_of(trace: Trace, joint: int) -> Matches:
    """The control lags of the goals of a sine that may be matched before the trace ends."""
    found = match_lags(trace.sent_deg, trace.measured_deg(joint), TOLERANCE_DEG)
    end = trace.experiment.duration - TAIL
    return Matches(found.lags[found.lags[:, 0] < end], int(np.count_nonzero(trace.sent[:, 0] < end)))


def compared(trace: Trace, figures: Figures) -> Mapping[str, tuple[float, float, float]]:
    """For every figure that is published: what is published, what is ours, and the ratio of ours to it."""
    published = trace.experiment.published
    names = [each.name for each in fields(published)]
    pairs = {name: (getattr(published, name), getattr(figures, name, None)) for name in names}
    return {name: (one, own, own / one) for name, (one, own) in pairs.items() if one and own and not isnan(own)}


def _step_figures(trace: Trace, joint: int) -> StepFigures:
    goal, measured = trace.experiment.size_deg, trace.measured_deg(joint)
    over = np.flatnonzero(measured[:, 1] > goal)  # oscillation begins with the first crossing
    since = measured[max(0, over[0] - 1) :] if over.size else measured[:0]
    return StepFigures(
        settling_s=settling_time(measured, goal, TOLERANCE_DEG),
        overshoot_deg=overshoot(measured, goal),
        oscillations=oscillations(since, goal, TOLERANCE_DEG),
        final_error_deg=final_error(measured, goal, HOLD),
    )


def _sine_figures(trace: Trace, joint: int) -> SineFigures:
    sent, measured = trace.sent_deg, trace.measured_deg(joint)
    within: Series = measured[measured[:, 0] <= sent[-1, 0]]
    later: Series = within[within[:, 0] >= START]
    matches = matches_of(trace, joint)
    lags = matches.distribution
    return SineFigures(
        mean_lag_s=lags.mean,
        max_lag_s=lags.highest,
        p99_lag_s=lags.p99,
        jitter_s=lags.jitter,
        matched_fraction=matches.fraction,
        delay_s=best_delay(sent, later),
        max_error_deg=largest_error(sent, later),
        max_error_with_start_deg=largest_error(sent, within),
    )


def _badness(figures: Figures) -> float:
    if isinstance(figures, SineFigures):
        return figures.max_error_deg
    return figures.settling_s if figures.settling_s is not None else inf
