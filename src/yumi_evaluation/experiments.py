"""Which experiments there are: the publication's, those of the better control laws, and those of all joints.

Steps with one gain after another, in virtual time: where oscillation begins, and which gain to take.

Where the robot of an evaluation is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from yumi.driver.settings import PASSWORD_VARIABLE
from yumi.robot.joints import JOINT_COUNT, Side
from yumi.rws.client import DEFAULT_PASSWORD, DEFAULT_USER
from yumi.virtual.mechanics.arm import ArmModel
from yumi_evaluation.experiment import (
    FEED_FORWARD_ONLY,
    LOOK_AHEAD,
    PREDICTION,
    TOLERANCE_DEG,
    Experiment,
    Mode,
    Published,
    System,
    Trace,
    proportional,
    sine,
    step,
)
from yumi_evaluation.tracking_figures import StepFigures, figures_of
from yumi_evaluation.virtual_machine import run_virtually

PUBLISHED_OSCILLATION = 2.0
"""The gain around which the publication saw oscillation begin."""

OTHER_FREQUENCIES = (0.1, 0.15)
"""At which the lags are predicted too, to show what the unknown frequency does to them [Hz]."""

_REDUCED = Mode.REDUCED


def published_experiments() -> tuple[Experiment, ...]:
    """Chapter 5 of the publication, with the numbers of its figures and what it says."""
    return (
        _as(step(proportional(1.2)), "5.1a", Published(settling=0.8)),
        _as(step(proportional(1.6)), "5.1b", Published(settling=0.6)),
        _as(step(proportional(2.0)), "", Published()),
        _as(step(proportional(0.35), _REDUCED, 4.5), "5.2a", Published()),
        _as(step(proportional(0.6), _REDUCED, 3.5), "5.2b", Published()),
        _as(step(proportional(1.2), _REDUCED), "5.2c", Published(settling=1.4)),
        _as(sine(proportional(1.2)), "5.3", Published(mean_lag=0.156, max_lag=0.184)),
        _as(sine(proportional(2.0)), "5.4", Published(mean_lag=0.092, max_lag=0.106)),
        _as(sine(proportional(0.35), _REDUCED), "5.5a", Published()),
        _as(sine(proportional(0.6), _REDUCED), "5.5b", Published()),
        _as(sine(proportional(1.2), _REDUCED), "5.5c, 5.6", Published()),
        _as(sine(proportional(1.2), size_deg=60.0), "5.7", Published(mean_lag=0.141, max_lag=0.189)),
    )


def better_experiments() -> tuple[Experiment, ...]:
    """The same references with what the publication did not have."""
    return (
        step(PREDICTION),
        sine(FEED_FORWARD_ONLY),
        sine(PREDICTION),
        sine(PREDICTION, size_deg=60.0),
        sine(LOOK_AHEAD),
        sine(LOOK_AHEAD, size_deg=60.0),
    )


def joint_experiments() -> tuple[Experiment, ...]:
    """Both arms, all joints at once."""
    everything = tuple(range(JOINT_COUNT))
    return tuple(replace(sine(PREDICTION), moved=everything).on(side) for side in Side)


def other_frequencies() -> tuple[Experiment, ...]:
    """The publication's two sines, slower."""
    return tuple(
        sine(proportional(gain), frequency=frequency) for frequency in OTHER_FREQUENCIES for gain in (1.2, 2.0)
    )


def _as(experiment: Experiment, figure: str, published: Published) -> Experiment:
    return replace(experiment, figure=figure, published=published)


GAINS = tuple(round(0.2 * number, 1) for number in range(5, 17))
"""1.0 to 3.2: from sluggish to far beyond what is allowed."""

SLOWER = 0.020
"""A gain has to do, too, when the robot answers so much later than the model [s]: real ones are said to."""

HIGHEST = 2.0
"""The joint position controller takes no higher gain."""

_DURATION = 2.0  # [s]


@dataclass(frozen=True, slots=True)
class GainPoint:
    """What a gain makes of a step.

    Attributes:
        gain: P.
        figures: of the step.
        trace: of it.
    """

    gain: float
    figures: StepFigures
    trace: Trace

    @property
    def oscillates(self) -> bool:
        """Whether the joint goes past the goal by more than what counts as there."""
        return self.figures.overshoot_deg > TOLERANCE_DEG


@dataclass(frozen=True, slots=True)
class Task:
    """What gains are tuned for.

    Attributes:
        size_deg: height of the step [°].
        mode: settings of EGM.
        side: the arm.
        joint: which one, by its place in the chain.
    """

    size_deg: float = 10.0
    mode: Mode = Mode.FULLSPEED
    side: Side = Side.RIGHT
    joint: int = 6


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


def sweep(
    gains: Iterable[float],
    system: System = System.SHIPPED,
    task: Task | None = None,
    model: ArmModel | None = None,
    on_point: Callable[[], None] = lambda: None,
) -> tuple[GainPoint, ...]:
    """A step with each of the ``gains``; ``on_point`` is called after each, and may raise to end it."""
    points = []
    for gain in gains:
        points.append(_point(gain, system, task or Task(), model))
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
    choices = [
        (max(one.figures.settling_s, other.figures.settling_s), one.gain)
        for one, other in zip(points, slower, strict=True)
        if one.gain <= HIGHEST
        and not one.oscillates
        and not other.oscillates
        and one.figures.settling_s is not None
        and other.figures.settling_s is not None
    ]
    settling, gain = min(choices, default=(None, None))
    onsets = [onset for onset in (onset_of(points), onset_of(slower)) if onset is not None]
    return Recommendation(gain, settling, min(onsets, default=None), points, slower)


def _point(gain: float, system: System, task: Task, model: ArmModel | None) -> GainPoint:
    longest = _DURATION if task.mode is Mode.FULLSPEED else 2.0 * _DURATION
    experiment = step(proportional(gain), task.mode, max(longest, 0.2 * task.size_deg), task.size_deg)
    trace = run_virtually(replace(experiment, side=task.side, moved=(task.joint,)), system, model)
    figures = figures_of(trace)
    assert isinstance(figures, StepFigures)
    return GainPoint(gain, figures, trace)


__all__ = ["DEFAULT_PASSWORD", "DEFAULT_USER", "RobotPlace"]


@dataclass(frozen=True, slots=True)
class RobotPlace:
    """A controller.

    Attributes:
        robot: address of a real one; None starts a virtual one.
        rws_port: of a real one.
        user, password: on it.
    """

    robot: str | None
    rws_port: int
    user: str = DEFAULT_USER
    password: str = field(default=DEFAULT_PASSWORD, repr=False)

    @property
    def secrets(self) -> Mapping[str, str]:
        """Environment variables that tell our commands the password: every user can read their arguments."""
        return {PASSWORD_VARIABLE: self.password}
