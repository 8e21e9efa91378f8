"""Experiments as values: a reference, a controller with its parameters, EGM settings; the trace and its figures.

The figures say how long a step took and how far behind a sine was followed, beside what is published.

The same experiment runs in virtual time (:mod:`yumi_evaluation.virtual_time`) and over ROS 2 and the network
(:mod:`yumi_evaluation.networked`). The master's thesis this system comes from published the first ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from enum import Enum
from math import degrees, inf, isnan, pi, radians, sin

import numpy as np

from abb_protocols.robot.joints import JOINT_COUNT, Side, joint_names
from abb_runtime.parameters import Values
from yumi.driver.state_machine import EgmMotionSettings
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

AXIS_6 = 6
"""ABB's axis 6, the last joint of the chain."""

FREQUENCY = 0.2
"""Of the sines [Hz]. The thesis does not state it; docs/explanation/evaluation.md says why this one."""

OTHER_FREQUENCIES = (0.1, 0.15)
"""The sines are run with these, too, to show what the unknown frequency does to their lags [Hz]."""

GOAL_RATE = 500.0
"""Goals of a sine per second, as published [Hz]."""

TOLERANCE_DEG = 0.1
"""How close counts as reached, as published [°]."""

START = 1.5
"""A sine that begins at full speed cannot be followed from its first moment; errors count from here on [s]."""

HOLD = 0.5
"""The steady-state error is that of so long a time at the end of a step [s]."""

TAIL = 0.6
"""Goals of so long a time at the end of a sine are not matched: their match may come after the end [s]."""

PUBLISHED_OSCILLATION = 2.0
"""The gain around which the thesis saw oscillation begin."""


@dataclass(frozen=True, slots=True)
class Sine:
    """A sine that begins at full speed, as in the thesis.

    Attributes:
        amplitude: [rad].
        frequency: [Hz].
    """

    amplitude: float
    frequency: float = FREQUENCY

    def __call__(self, time: float) -> float:
        return self.amplitude * sin(2.0 * pi * self.frequency * time)


@dataclass(frozen=True, slots=True)
class Step:
    """A reference that jumps once.

    Attributes:
        size: [rad].
        time: when it jumps [s].
    """

    size: float
    time: float = 0.1

    def __call__(self, time: float) -> float:
        return self.size if time >= self.time else 0.0


class Mode(Enum):
    """The EGM settings of the thesis, tables 4.3 and 4.4, which differ in MaxSpeedDeviation alone."""

    FULLSPEED = EgmMotionSettings(max_speed_deviation=180.0)
    REDUCED = EgmMotionSettings(max_speed_deviation=10.0)

    @property
    def word(self) -> str:
        return self.name.lower()


class System(Enum):
    """Between which parts an experiment runs.

    BARE is what the thesis measured: a robot and a proportional controller without a limiter. SHIPPED is what
    `yumi up` runs, in virtual time; NETWORKED is the same in real time, over ROS 2 and the network.
    """

    BARE = "bare"
    SHIPPED = "shipped"
    NETWORKED = "networked"

    @property
    def title(self) -> str:
        """In tables and pictures."""
        return {"bare": "without the limiter", "shipped": "as shipped"}.get(self.value, self.value)


@dataclass(frozen=True, slots=True)
class ControllerSetup:
    """A way to control the joints.

    Attributes:
        name: for JSON and file names.
        title: for tables and pictures.
        values: parameters of the joint position controller.
        is_planned: whether the whole motion is known in advance and runs as a trajectory.
    """

    name: str
    title: str
    values: Values = field(default_factory=dict)
    is_planned: bool = False


def proportional(gain: float) -> ControllerSetup:
    """The controller of the thesis."""
    return ControllerSetup(f"p{gain:g}", f"P = {gain:g}", {"p": gain})


FEED_FORWARD: Values = {"tracking.feed_forward": True}
FEED_FORWARD_ONLY = ControllerSetup("feed_forward", "feed-forward", {**FEED_FORWARD, "tracking.delay": 0.0})
PREDICTION = ControllerSetup("prediction", "feed-forward and prediction", FEED_FORWARD)
LOOK_AHEAD = ControllerSetup("look_ahead", "trajectory with look-ahead", {}, is_planned=True)


@dataclass(frozen=True, slots=True)
class Published:
    """What the thesis states of an experiment [s]; None where it states nothing.

    Attributes:
        settling_s: time until the joint stays within 0.1° of the goal.
        mean_lag_s, max_lag_s: control lag.
    """

    settling_s: float | None = None
    mean_lag_s: float | None = None
    max_lag_s: float | None = None


@dataclass(frozen=True, slots=True)
class Experiment:
    """One experiment.

    Attributes:
        reference: of the joints; a Step happens at its time, a Sine begins at once.
        controller: and its parameters.
        mode: settings of EGM.
        side: the arm.
        moved: the joints that move, by their index in the chain.
        duration: [s].
        figure: of the thesis, e.g. ``5.1a``; empty where it has none.
        published: what the thesis found.
    """

    reference: Step | Sine
    controller: ControllerSetup
    mode: Mode = Mode.FULLSPEED
    side: Side = Side.RIGHT
    moved: tuple[int, ...] = (AXIS_6,)
    duration: float = 3.0
    figure: str = ""
    published: Published = Published()

    @property
    def is_step(self) -> bool:
        return isinstance(self.reference, Step)

    @property
    def kind(self) -> str:
        return "step" if self.is_step else "sine"

    @property
    def size_deg(self) -> float:
        """Height of the step or amplitude of the sine [°]."""
        reference = self.reference
        return round(degrees(reference.size if isinstance(reference, Step) else reference.amplitude), 9)

    @property
    def name(self) -> str:
        """Stable, and good for a file name."""
        frequency = "" if self._unusual_frequency is None else f"_{self._unusual_frequency:g}hz"
        joints = "" if len(self.moved) == 1 else "_all"
        return (
            f"{self.kind}{self.size_deg:g}{frequency}_{self.mode.word}_{self.controller.name}_{self.side.word}{joints}"
        )

    @property
    def title(self) -> str:
        """In tables and pictures."""
        frequency = "" if self._unusual_frequency is None else f" at {self._unusual_frequency:g} Hz"
        speed = "" if self.mode is Mode.FULLSPEED else ", reduced speed"
        joints = "" if len(self.moved) == 1 else f", all joints of the {self.side.word} arm"
        return f"{self.kind.capitalize()} of {self.size_deg:g}°{frequency}, {self.controller.title}{speed}{joints}"

    @property
    def _unusual_frequency(self) -> float | None:
        """None where there is none, or it is the usual one."""
        reference = self.reference
        return None if isinstance(reference, Step) or reference.frequency == FREQUENCY else reference.frequency

    def on(self, side: Side) -> Experiment:
        """The same on an arm; the thesis measured the right one only."""
        return self if side is self.side else replace(self, side=side, figure="", published=Published())


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """What became of an experiment; angles relative to where each joint began.

    Attributes:
        experiment: the experiment.
        sent: goals as they were sent: time [s], angle [rad].
        measured: by joint: time [s], angle [rad].
        slowed: cycles in which the limiter changed the command; None where that was not counted.
    """

    experiment: Experiment
    sent: Series
    measured: Mapping[int, Series]
    slowed: int | None = None

    @property
    def sent_deg(self) -> Series:
        """[°]."""
        return in_degrees(self.sent)

    def measured_deg(self, joint: int) -> Series:
        """Of one joint [°]."""
        return in_degrees(self.measured[joint])

    def joint_name(self, joint: int) -> str:
        return joint_names(self.experiment.side)[joint]


def in_degrees(angles: Series) -> Series:
    """The same angles in degrees."""
    return np.column_stack((angles[:, 0], np.degrees(angles[:, 1])))


def step(
    controller: ControllerSetup, mode: Mode = Mode.FULLSPEED, duration: float = 2.5, size_deg: float = 10.0
) -> Experiment:
    """A step at once."""
    return Experiment(Step(radians(size_deg), 0.0), controller, mode, duration=duration)


def sine(
    controller: ControllerSetup, mode: Mode = Mode.FULLSPEED, size_deg: float = 10.0, frequency: float = FREQUENCY
) -> Experiment:
    """A whole period of a sine, and a little more until its last goals are matched."""
    return Experiment(Sine(radians(size_deg), frequency), controller, mode, duration=1.0 / frequency + TAIL)


def published_experiments() -> tuple[Experiment, ...]:
    """Chapter 5 of the thesis, with the numbers of its figures and what it states.

    Of figure 5.7 it prints 141 ms as the longest and 189 ms as the mean lag: taken to be exchanged.
    """

    def of(experiment: Experiment, figure: str, published: Published = Published()) -> Experiment:
        return replace(experiment, figure=figure, published=published)

    reduced = Mode.REDUCED
    return (
        of(step(proportional(1.2)), "5.1a", Published(settling_s=0.8)),
        of(step(proportional(1.6)), "5.1b", Published(settling_s=0.6)),
        of(step(proportional(2.0)), ""),
        of(step(proportional(0.35), reduced, 4.5), "5.2a"),
        of(step(proportional(0.6), reduced, 3.5), "5.2b"),
        of(step(proportional(1.2), reduced), "5.2c", Published(settling_s=1.4)),
        of(sine(proportional(1.2)), "5.3", Published(mean_lag_s=0.156, max_lag_s=0.184)),
        of(sine(proportional(2.0)), "5.4", Published(mean_lag_s=0.092, max_lag_s=0.106)),
        of(sine(proportional(0.35), reduced), "5.5a"),
        of(sine(proportional(0.6), reduced), "5.5b"),
        of(sine(proportional(1.2), reduced), "5.5c, 5.6"),
        of(sine(proportional(1.2), size_deg=60.0), "5.7", Published(mean_lag_s=0.141, max_lag_s=0.189)),
    )


def other_frequencies() -> tuple[Experiment, ...]:
    """The sines of 10° of the thesis, slower."""
    return tuple(
        sine(proportional(gain), frequency=frequency) for frequency in OTHER_FREQUENCIES for gain in (1.2, 2.0)
    )


def better_experiments() -> tuple[Experiment, ...]:
    """The same references with controllers that the thesis did not have."""
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
