"""Steps with one gain after another, in virtual time: where oscillation begins, and which gain to recommend."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from virtual_irc5.mechanics.arm_motion import ArmModel
from yumi_evaluation.experiments import TOLERANCE_DEG, Mode, StepFigures, System, proportional, step, step_figures_of
from yumi_evaluation.virtual_time import run_virtually

GAINS = tuple(round(0.2 * number, 1) for number in range(5, 17))
"""1.0 to 3.2: from sluggish to far beyond what is allowed."""

SLOWER = 0.020
"""A gain must also work when the robot answers so much later than the model [s]: real ones are reported to."""

SAME = 0.05
"""Gains nearer to each other than this do not differ visibly."""

HIGHEST = 2.0
"""The joint position controller accepts no higher gain."""

_DURATION = 2.0  # [s]


@dataclass(frozen=True, slots=True)
class GainPoint:
    """What a gain makes of a step.

    Attributes:
        gain: P.
        figures: of the step.
    """

    gain: float
    figures: StepFigures

    @property
    def oscillates(self) -> bool:
        """Whether the joint goes past the goal by more than the tolerance."""
        return self.figures.overshoot_deg > TOLERANCE_DEG


@dataclass(frozen=True, slots=True)
class Task:
    """What gains are tuned for.

    Attributes:
        size_deg: height of the step [°].
        mode: settings of EGM.
    """

    size_deg: float = 10.0
    mode: Mode = Mode.FULLSPEED

    @property
    def duration(self) -> float:
        """How long a step is looked at [s]."""
        return max(_DURATION if self.mode is Mode.FULLSPEED else 2.0 * _DURATION, 0.2 * self.size_deg)


@dataclass(frozen=True, slots=True)
class Recommendation:
    """Which gain to take.

    Attributes:
        gain: the one; None when every gain oscillates or none settles.
        settling_s: how long the step takes with it, at worst [s].
        onset: the lowest gain with which oscillation was seen; None when it was not.
        points: the sweep with the model as it is.
        slower: the sweep with a robot that answers later.
    """

    gain: float | None
    settling_s: float | None
    onset: float | None
    points: tuple[GainPoint, ...]
    slower: tuple[GainPoint, ...]

    @property
    def headline(self) -> str:
        """The gain in a few words."""
        return "no gain can be recommended" if self.gain is None else f"P = {self.gain:g} is recommended"

    def beside(self, shipped: float) -> str:
        """Why the gain that is delivered is another one; empty when it is the same."""
        if self.gain is None or abs(self.gain - shipped) < SAME:
            return ""
        if shipped > self.gain:
            return f"The delivered P = {shipped:g} is higher: for this task lower it."
        return (
            f"The delivered P = {shipped:g} is lower on purpose: no real robot has been measured yet, and a robot that "
            f"answers more than {1e3 * SLOWER:g} ms later than the model oscillates sooner. {shipped:g} is a gain of "
            "the thesis's experiments on a real robot; raise it when you have seen yours."
        )

    def __str__(self) -> str:
        onset = "not seen" if self.onset is None else f"seen from P = {self.onset:g}"
        if self.gain is None:
            return f"No gain up to {HIGHEST:g} settles without overshoot; oscillation is {onset}."
        return (
            f"Recommended: P = {self.gain:g}; the step is within 0.1° after {self.settling_s:.2f} s at worst, without "
            f"overshoot. Oscillation is {onset}; P = {HIGHEST:g} is the highest the controller accepts. Streams are "
            "followed far better with tracking.feed_forward than with any gain."
        )


def sweep(
    gains: Iterable[float],
    system: System = System.SHIPPED,
    task: Task | None = None,
    model: ArmModel | None = None,
    on_point: Callable[[], None] = lambda: None,
) -> tuple[GainPoint, ...]:
    """A step with each of the ``gains``; ``on_point`` is called after each, and may raise to end it."""
    task = task or Task()
    points = []
    for gain in gains:
        trace = run_virtually(step(proportional(gain), task.mode, task.duration, task.size_deg), system, model)
        points.append(GainPoint(gain, step_figures_of(trace)))
        on_point()
    return tuple(points)


def onset_of(points: Sequence[GainPoint]) -> float | None:
    """The lowest gain from which on every one oscillates; None when the highest does not."""
    onset = None
    for point in sorted(points, key=lambda each: -each.gain):
        if not point.oscillates:
            break
        onset = point.gain
    return onset


def recommend(gains: Sequence[float], task: Task, on_point: Callable[[], None] = lambda: None) -> Recommendation:
    """The gain with the quickest step that does not oscillate, with the model and with a robot that answers later."""
    model = ArmModel()
    points = sweep(gains, task=task, on_point=on_point)
    slower = sweep(gains, task=task, model=replace(model, delay=model.delay + SLOWER), on_point=on_point)
    choices = []
    for one, other in zip(points, slower, strict=True):
        times = (one.figures.settling_s, other.figures.settling_s)
        if one.gain <= HIGHEST and not one.oscillates and not other.oscillates and None not in times:
            choices.append((max(time for time in times if time is not None), one.gain))
    settling, gain = min(choices, default=(None, None))
    onsets = [onset for onset in (onset_of(points), onset_of(slower)) if onset is not None]
    return Recommendation(gain, settling, min(onsets, default=None), points, slower)
