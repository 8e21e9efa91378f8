"""Which of the things the publication leaves open can explain its control lags.

It does not print the frequency of its sines, nor how samples near the turning points were matched, and nobody knows the
robot's own control lag. Each is varied over all that is conceivable, the others kept, and every published lag is
predicted anew, by superposition of steps (:mod:`yumi.evaluation.superposition`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from yumi.control.parameter import number
from yumi.evaluation.experiment import (
    FREQUENCY,
    TOLERANCE_DEG,
    Experiment,
    Mode,
    System,
    Trace,
    proportional,
    sine,
    step,
)
from yumi.evaluation.experiments import published_experiments
from yumi.evaluation.fitted_model import CONTROL_LAG, arm_with
from yumi.evaluation.metrics import Matches, Rule, Series
from yumi.evaluation.superposition import largest_difference, superpose
from yumi.evaluation.tracking_figures import StepFigures, figures_of, matches_of
from yumi.evaluation.virtual_experiment import run_virtually
from yumi.robot.cycle import CYCLE

FREQUENCIES = (0.02, 0.05, 0.075, 0.1, 0.125, 0.15, 0.175, 0.2, 0.25, 0.3, 0.4, 0.5)
"""From a sine of a minute to one that has the joint at its top speed [Hz]."""

CONTROL_LAGS = (0.0, CONTROL_LAG, 0.026, 0.040, 0.060)
"""Of the robot: none, the fitted one, that of the virtual robot, and what users report [s]."""

NEAR = 0.1
"""By what share a figure may differ from the published one and count as reproduced."""

TIMED_GAINS = (1.2, 1.6)
"""With which a step time is published at full speed."""

PARTS = 3
"""How often ``on_part`` is called."""

_LONGEST = 1.0  # [s] of a lag that is looked for
_STEPS = {1.2: 1.8, 1.6: 1.4, 2.0: 1.4}  # gain: [s] until as good as nothing is left


@dataclass(frozen=True, slots=True)
class Lags:
    """What is predicted for one of the published sines.

    Attributes:
        mean, longest: control lag by matching [s].
        share: of the goals that found a match.
    """

    mean: float
    longest: float
    share: float

    def are_near(self, experiment: Experiment) -> tuple[bool, bool]:
        """Whether mean and longest are within a tenth of what is published of ``experiment``."""
        published = experiment.published
        return is_near(self.mean, published.mean_lag), is_near(self.longest, published.max_lag)


@dataclass(frozen=True, slots=True)
class Robot:
    """What a robot with some control lag would have shown.

    Attributes:
        step_times: with P = 1.2 and 1.6 at full speed [s]; None where it does not settle.
        lags: of the published sines.
    """

    step_times: tuple[float | None, ...]
    lags: tuple[Lags, ...]


@dataclass(frozen=True, slots=True)
class LagStudy:
    """All predictions; everything in the order of :func:`studied_sines`.

    Attributes:
        frequencies: by frequency [Hz].
        robots: by the robot's control lag [s].
        matchings: by how goals are matched, in words.
        deviation_deg: largest difference of superposed from run sines [°].
    """

    frequencies: Mapping[float, tuple[Lags, ...]]
    robots: Mapping[float, Robot]
    matchings: Mapping[str, tuple[Lags, ...]]
    deviation_deg: float


def is_near(value: float | None, published: float | None) -> bool:
    """Whether ``value`` is within a tenth of what is published."""
    return value is not None and published is not None and abs(value / published - 1.0) <= NEAR


def studied_sines() -> tuple[Experiment, ...]:
    """The sines of which lags are published."""
    return tuple(each for each in published_experiments() if each.published.mean_lag is not None)


def study_lags(bare: Mapping[str, Trace], on_part: Callable[[], None] = lambda: None) -> LagStudy:
    """Vary everything.

    Args:
        bare: experiments by name, run without a guard: the steps that are superposed, and sines against which
            superposition is checked.
        on_part: called before each of :data:`PARTS` parts; may raise to end it.
    """
    on_part()
    steps = {gain: bare[step(proportional(gain)).name] for gain in _STEPS}
    frequencies = {frequency: _lags_at(steps, frequency) for frequency in FREQUENCIES}
    on_part()
    robots = {lag: _robot(steps if lag == CONTROL_LAG else _steps(lag)) for lag in CONTROL_LAGS}
    on_part()
    return LagStudy(frequencies, robots, _matchings(_traces(steps, FREQUENCY)), _deviation(steps, bare))


def _steps(control_lag: float) -> Mapping[float, Trace]:
    """By gain."""
    model = arm_with(control_lag)
    return {
        gain: run_virtually(step(proportional(gain), duration=seconds), System.BARE, model)
        for gain, seconds in _STEPS.items()
    }


def _deviation(steps: Mapping[float, Trace], bare: Mapping[str, Trace]) -> float:
    """Of all sines at full speed that were run."""
    sines = [each for each in bare.values() if not each.experiment.is_step and each.experiment.mode is Mode.FULLSPEED]
    return max(
        largest_difference(
            superpose(steps[gain_of(each.experiment)], each.experiment).measured_deg(joint), each.measured_deg(joint)
        )
        for each in sines
        for joint in each.experiment.moved
    )


def _robot(steps: Mapping[float, Trace]) -> Robot:
    figures = [figures_of(steps[gain]) for gain in TIMED_GAINS]
    times = tuple(each.settling_s for each in figures if isinstance(each, StepFigures))
    return Robot(times, _lags_at(steps, FREQUENCY))


def _lags_at(steps: Mapping[float, Trace], frequency: float) -> tuple[Lags, ...]:
    return tuple(_lags(matches_of(trace, longest=_LONGEST)) for trace in _traces(steps, frequency))


def _traces(steps: Mapping[float, Trace], frequency: float) -> tuple[Trace, ...]:
    """Of all that are studied; those that differ in size alone are superposed once."""
    asked = [sine(each.law, each.mode, each.size_deg, frequency) for each in studied_sines()]
    first = {gain_of(each): each for each in reversed(asked)}
    found = {gain: superpose(steps[gain], each) for gain, each in first.items()}
    return tuple(_resized(found[gain_of(each)], each) for each in asked)


def _resized(trace: Trace, experiment: Experiment) -> Trace:
    """What a linear loop makes of the same reference in another size."""
    share = experiment.size_deg / trace.experiment.size_deg
    sent = [(time, share * value) for time, value in trace.sent]
    measured = {joint: [(time, share * value) for time, value in series] for joint, series in trace.measured.items()}
    return Trace(experiment, sent, measured)


def gain_of(experiment: Experiment) -> float:
    """P of a proportional law."""
    return number(experiment.law.values, "p")


def _lags(found: Matches) -> Lags:
    lags = found.distribution
    return Lags(lags.mean, lags.highest, found.share)


def _matchings(traces: Sequence[Trace]) -> Mapping[str, tuple[Lags, ...]]:
    """The same motions, matched in other ways."""

    def match(words: str, tolerance: float = TOLERANCE_DEG, rule: Rule = Rule.BRANCH, shown: Shown = _same) -> None:
        found = [matches_of(shown(trace), tolerance, rule, _LONGEST) for trace in traces]
        matchings[words] = tuple(map(_lags, found))

    matchings: dict[str, tuple[Lags, ...]] = {}
    match("within 0.1°, the same way, before the goal turns (ours)")
    match("the same way, also after the goal turned", rule=Rule.WAY)
    match("either way, any time within a second", rule=Rule.ANY)
    match("within 0.05°", tolerance=0.05)
    match("within 0.2°", tolerance=0.2)
    match("joint states a cycle earlier", shown=_earlier)
    match("joint states straight between samples", shown=_dense)
    return matchings


Shown = Callable[[Trace], Trace]


def _same(trace: Trace) -> Trace:
    return trace


def _earlier(trace: Trace) -> Trace:
    """Each recording beginning with its own first sample, as the authors' test program writes them, at most so far."""
    return _with_measured(trace, lambda series: [(time - CYCLE, value) for time, value in series])


def _dense(trace: Trace) -> Trace:
    """Measured four times as often."""
    return _with_measured(trace, lambda series: [*_between(series), series[-1]])


def _between(series: Series) -> Iterator[tuple[float, float]]:
    for (time, value), (later, next_value) in pairwise(series):
        for quarter in (0.0, 0.25, 0.5, 0.75):
            yield time + quarter * (later - time), value + quarter * (next_value - value)


def _with_measured(trace: Trace, change: Callable[[Series], Series]) -> Trace:
    return replace(trace, measured={joint: change(series) for joint, series in trace.measured.items()})
