"""The figures of a trace: how long a step took, how far behind a sine was followed, beside what is published."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import inf, isnan

from yumi_evaluation.experiment import HOLD, TAIL, TOLERANCE_DEG, Trace
from yumi_evaluation.metrics import (
    Matches,
    Rule,
    Series,
    best_delay,
    final_error,
    largest_error,
    match_lags,
    overshoot,
    settling_time,
    swings,
)

START = 1.5
"""A sine that begins at full speed cannot be followed from its first moment; errors count from here on [s]."""


@dataclass(frozen=True, slots=True)
class StepFigures:
    """A step.

    Attributes:
        settling_s: time until the goal is reached within 0.1° to stay; None when it was not.
        overshoot_deg: how far the joint went past it.
        swings: how often it crossed the goal by more than 0.1°.
        final_error_deg: largest distance from the goal in the last half second: the steady-state error.
    """

    settling_s: float | None
    overshoot_deg: float
    swings: int
    final_error_deg: float


@dataclass(frozen=True, slots=True)
class SineFigures:
    """A sine.

    Attributes:
        mean_lag_s, max_lag_s: control lag by matching, as published.
        p99_lag_s: 99 % of the matches are not later.
        jitter_s: mean deviation of the lags from their mean.
        matched_share: share of the goals that found a match.
        delay_s: by how much the whole motion is late, by least squares; negative when it is early.
        max_error_deg: largest distance from the reference of the same moment, once the start is over.
        max_error_with_start_deg: the same from the first moment on.
    """

    mean_lag_s: float
    max_lag_s: float
    p99_lag_s: float
    jitter_s: float
    matched_share: float
    delay_s: float
    max_error_deg: float
    max_error_with_start_deg: float


Figures = StepFigures | SineFigures


def figures_of(trace: Trace) -> Figures:
    """The figures of the joint that moved; of the one that followed worst when several did."""
    found = [figures_of_joint(trace, joint) for joint in trace.experiment.moved]
    return max(found, key=_badness)


def figures_of_joint(trace: Trace, joint: int) -> Figures:
    """The figures of one joint."""
    measured = trace.measured_deg(joint)
    return _step_figures(trace, measured) if trace.experiment.is_step else _sine_figures(trace, measured)


def matches_of(
    trace: Trace, tolerance: float = TOLERANCE_DEG, rule: Rule = Rule.BRANCH, longest: float = inf
) -> Matches:
    """The control lags of the first joint that moved; as the evaluation matches them, unless told otherwise.

    Args:
        trace: of a sine.
        tolerance: how close is a match [°].
        rule: which samples may match.
        longest: no longer lag is looked for [s].
    """
    return _matches(trace, trace.measured_deg(trace.experiment.moved[0]), tolerance, rule, longest)


def compared(trace: Trace, figures: Figures) -> Mapping[str, tuple[float, float, float]]:
    """For every figure that is published: what is published, what is ours, and the ratio of ours to it."""
    published = trace.experiment.published
    pairs = {
        "settling_s": (published.settling, getattr(figures, "settling_s", None)),
        "mean_lag_s": (published.mean_lag, getattr(figures, "mean_lag_s", None)),
        "max_lag_s": (published.max_lag, getattr(figures, "max_lag_s", None)),
    }
    return {name: (one, own, own / one) for name, (one, own) in pairs.items() if one and own and not isnan(own)}


def figures_document(figures: Figures) -> dict[str, object]:
    """For JSON, where there is no nan."""
    return {
        name: None if isinstance(value, float) and isnan(value) else value for name, value in asdict(figures).items()
    }


def _step_figures(trace: Trace, measured: Series) -> StepFigures:
    goal = trace.experiment.size_deg
    return StepFigures(
        settling_s=settling_time(measured, goal, TOLERANCE_DEG),
        overshoot_deg=overshoot(measured, goal),
        swings=swings(_since_first_reached(measured, goal), goal, TOLERANCE_DEG),
        final_error_deg=final_error(measured, goal, HOLD),
    )


def _since_first_reached(measured: Series, goal: float) -> Series:
    """From the first crossing of the goal on; nothing when there was none."""
    over = [index for index, (_, value) in enumerate(measured) if value > goal]
    return measured[max(0, over[0] - 1) :] if over else ()


def _sine_figures(trace: Trace, measured: Series) -> SineFigures:
    sent = trace.sent_deg
    matches = _matches(trace, measured)
    lags, end = matches.distribution, sent[-1][0]
    within = [(time, value) for time, value in measured if time <= end]
    later = [(time, value) for time, value in within if time >= START]
    return SineFigures(
        mean_lag_s=lags.mean,
        max_lag_s=lags.highest,
        p99_lag_s=lags.p99,
        jitter_s=lags.jitter,
        matched_share=matches.share,
        delay_s=best_delay(sent, later),
        max_error_deg=largest_error(sent, later),
        max_error_with_start_deg=largest_error(sent, within),
    )


def _matches(
    trace: Trace,
    measured: Series,
    tolerance: float = TOLERANCE_DEG,
    rule: Rule = Rule.BRANCH,
    longest: float = inf,
) -> Matches:
    """Of goals that may be matched before the trace ends."""
    found = match_lags(trace.sent_deg, measured, tolerance, rule, longest)
    end = trace.experiment.duration - TAIL
    sought = sum(time < end for time, _ in trace.sent)
    return Matches(tuple(each for each in found.lags if each[0] < end), sought)


def _badness(figures: Figures) -> float:
    if isinstance(figures, SineFigures):
        return figures.max_error_deg
    return figures.settling_s if figures.settling_s is not None else float("inf")
