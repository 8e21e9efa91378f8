"""Which of the things the publication leaves open can explain its control lags.

It does not print the frequency of its sines, nor how samples near the turning points were matched, and nobody knows the
robot's own control lag. Each is varied over all that is conceivable, the others kept, and every published lag is
predicted anew, by superposition of steps (:mod:`yumi_evaluation.lag_study`).

The virtual arm's free parameters, delay and servo lag, from the published step times alone.

Of the two only their sum matters to a step: one number, the control lag, is fitted, and shared as in the virtual robot
that is shipped. The published times are rounded to tenths of a second, each alike, so that what counts are seconds and
not ratios. Nothing bounds the lag but zero; that it comes out within the 10 to 20 ms of the EGM manual is a finding.

What a linear loop makes of any reference, from what it makes of a step.

Without a guard nothing between goal and joint is limited, so that the law of superposition holds: a reference that
changes with every cycle is a sum of steps. Many sines cost less so than one that is run; that they are the same is
checked against one that is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import floor, nan, sqrt
from operator import mul

from yumi.robot.joints import CYCLE
from yumi.settings import number
from yumi.virtual.mechanics.arm import ArmModel
from yumi_evaluation.experiment import (
    FREQUENCY,
    GOAL_RATE,
    TOLERANCE_DEG,
    Experiment,
    Mode,
    System,
    Trace,
    proportional,
    sine,
    step,
)
from yumi_evaluation.experiments import published_experiments
from yumi_evaluation.metrics import Matches, Rule, Series
from yumi_evaluation.tracking_figures import StepFigures, figures_of, matches_of
from yumi_evaluation.virtual_machine import CONTROL_LAG, arm_with, run_virtually

_SETTLED = 1e-4  # share of a step that is left
_SAME = 1e-9  # [s]


def superpose(step: Trace, experiment: Experiment) -> Trace:
    """What the loop that did ``step`` makes of the reference of ``experiment``, with goals at the usual rate."""
    joint, count = experiment.moved[0], int(experiment.duration / CYCLE)
    response = _response(step)
    taken = [experiment.reference(_newest(number)) for number in range(count)]
    angles = _follow(taken, response)
    measured = [(CYCLE * (number + 1), angle) for number, angle in enumerate(angles)]
    times = [number / GOAL_RATE for number in range(int(experiment.duration * GOAL_RATE))]
    return Trace(experiment, [(time, experiment.reference(time)) for time in times], {joint: measured})


def largest_difference(one: Series, other: Series) -> float:
    """Between the values of two series of the same samples, in their unit."""
    return max(abs(mine - theirs) for (_, mine), (_, theirs) in zip(one, other, strict=False))


def _newest(cycle: int) -> float:
    """When the goal was sent that is the newest one in a cycle [s]."""
    return floor((cycle + 1) * CYCLE * GOAL_RATE + _SAME) / GOAL_RATE


def _response(step: Trace) -> list[float]:
    """Share of the step that is done, cycle by cycle, until as good as nothing is left."""
    values = [value / step.sent[0][1] for _, value in step.measured[step.experiment.moved[0]]]
    left = [index for index, value in enumerate(values) if abs(value - 1.0) > _SETTLED]
    return values[: left[-1] + 2]


def _follow(taken: Sequence[float], response: Sequence[float]) -> list[float]:
    """The sum of all steps so far; those longer ago than the response are done."""
    changes = [new - old for old, new in zip((0.0, *taken), taken, strict=False)]
    angles = []
    for index in range(len(taken)):
        begin = max(0, index + 1 - len(response))
        done = taken[begin - 1] if begin else 0.0
        angles.append(done + sum(map(mul, changes[begin : index + 1], response[index - begin :: -1])))
    return angles


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
