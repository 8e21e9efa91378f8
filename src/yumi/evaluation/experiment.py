"""Experiments as values: what is asked of an arm, with which control law and settings, and the trace that comes back.

The same experiment runs in virtual time (:mod:`yumi.evaluation.virtual_experiment`) and over ROS 2 and the wire.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from math import degrees, radians

from yumi.control.parameter import Values
from yumi.evaluation.metrics import Series
from yumi.evaluation.streamed_reference import FEED_FORWARD, Sine, Step
from yumi.hardware.state_machine import EgmMotionSettings
from yumi.robot.joints import Side, joint_names

FREQUENCY = 0.2
"""Of the sines. The publication does not say it; at this one the mean lags of both gains fit [Hz]."""

GOAL_RATE = 500.0
"""How many goals of a sine are sent a second, as published [Hz]."""

TOLERANCE_DEG = 0.1
"""How close counts as there, as published [°]."""

TAIL = 0.6
"""At the end of a sine no match is sought for the goals of so long a time, whose match may come later [s]."""

HOLD = 0.5
"""How long a goal has to be held at the end of a step [s]."""


class Mode(Enum):
    """The EGM settings of the publication, tables 4.3 and 4.4, which differ in MaxSpeedDeviation alone."""

    FULLSPEED = EgmMotionSettings(max_speed_deviation=180.0)
    REDUCED = EgmMotionSettings(max_speed_deviation=10.0)

    @property
    def word(self) -> str:
        return self.name.lower()


class System(Enum):
    """Between which parts an experiment runs.

    BARE is what the publication measured: a robot, and a proportional law without a guard behind it. SHIPPED is what
    `yumi up` runs, in virtual time; WIRE is the same in real time, over ROS 2 and the wire.
    """

    BARE = "bare"
    SHIPPED = "shipped"
    WIRE = "wire"

    @property
    def title(self) -> str:
        """What tables and pictures call it."""
        return {System.BARE: "without a guard", System.SHIPPED: "as shipped", System.WIRE: "over the wire"}[self]


@dataclass(frozen=True, slots=True)
class Law:
    """A way to control the joints.

    Attributes:
        name: for JSON and file names.
        title: for people.
        values: parameters of the joint position controller.
        is_planned: whether the whole motion is known in advance and runs as a trajectory.
    """

    name: str
    title: str
    values: Values = field(default_factory=dict)
    is_planned: bool = False


def proportional(gain: float) -> Law:
    """The publication's law."""
    return Law(f"p{gain:g}", f"P = {gain:g}", {"p": gain})


FEED_FORWARD_ONLY = Law("feed_forward", "feed-forward", {**FEED_FORWARD, "tracking.delay": 0.0})
PREDICTION = Law("prediction", "feed-forward and prediction", FEED_FORWARD)
LOOK_AHEAD = Law("look_ahead", "trajectory with look-ahead", {}, is_planned=True)


@dataclass(frozen=True, slots=True)
class Published:
    """What the publication says of an experiment; None where it says nothing.

    Attributes:
        settling: time until the goal is reached within 0.1° to stay [s].
        mean_lag, max_lag: control lag [s].
    """

    settling: float | None = None
    mean_lag: float | None = None
    max_lag: float | None = None


@dataclass(frozen=True, slots=True)
class Experiment:
    """One experiment.

    Attributes:
        reference: what the joints shall do; a Step happens at its time, a Sine begins at once.
        law: how they are controlled.
        mode: settings of EGM.
        side: the arm.
        moved: the joints that move, by their place in the chain.
        duration: how long it is watched [s].
        figure: of the publication, e.g. ``5.1a``; empty where it has none.
        published: what the publication found.
    """

    reference: Step | Sine
    law: Law
    mode: Mode = Mode.FULLSPEED
    side: Side = Side.RIGHT
    moved: tuple[int, ...] = (6,)
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
        joints = "" if len(self.moved) == 1 else "_all"
        return f"{self.kind}{self.size_deg:g}{self._pace}_{self.mode.word}_{self.law.name}_{self.side.word}{joints}"

    @property
    def title(self) -> str:
        """For people."""
        what = f"Step of {self.size_deg:g}°" if self.is_step else f"Sine of {self.size_deg:g}°"
        pace = self._pace.replace("_", " at ").replace("hz", " Hz")
        speed = "" if self.mode is Mode.FULLSPEED else ", reduced speed"
        joints = "" if len(self.moved) == 1 else f", all joints of the {self.side.word} arm"
        return f"{what}{pace}, {self.law.title}{speed}{joints}"

    @property
    def _pace(self) -> str:
        """Empty where the frequency is the usual one."""
        reference = self.reference
        if isinstance(reference, Step) or reference.frequency == FREQUENCY:
            return ""
        return f"_{reference.frequency:g}hz"

    def on(self, side: Side) -> Experiment:
        """The same on an arm; nothing is published of another one."""
        return self if side is self.side else replace(self, side=side, figure="", published=Published())


def step(law: Law, mode: Mode = Mode.FULLSPEED, duration: float = 2.5, size_deg: float = 10.0) -> Experiment:
    """A step at once."""
    return Experiment(Step(radians(size_deg), 0.0), law, mode, duration=duration)


def sine(law: Law, mode: Mode = Mode.FULLSPEED, size_deg: float = 10.0, frequency: float = FREQUENCY) -> Experiment:
    """A whole period of a sine, which begins at its full speed, and a little more until its last goals are matched."""
    return Experiment(Sine(radians(size_deg), frequency), law, mode, duration=1.0 / frequency + TAIL)


@dataclass(frozen=True, slots=True)
class Trace:
    """What became of an experiment; angles relative to where each joint began.

    Attributes:
        experiment: what was asked.
        sent: goals as they were sent: time [s], angle [rad].
        measured: by joint, what was measured: time [s], angle [rad].
        slowed: cycles in which the guard changed the command; None where nobody counted.
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


def in_degrees(series: Series) -> Series:
    """The same angles in degrees."""
    return [(time, degrees(value)) for time, value in series]
