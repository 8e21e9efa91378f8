"""Experiments as values: what is asked of an arm, with which control law and settings, and the trace that comes back.

The same experiment runs in virtual time (:mod:`yumi_evaluation.virtual_machine`) and over ROS 2 and the wire.

How closely the virtual arm follows a reference that is streamed to it, of which the future is not known.

Everything is as in the thesis's test: one joint, goals at 500 Hz, each the reference at the time it was sent, and what
is judged is the measured position. Time is virtual; the arm has its default dynamics and the full-speed settings.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from itertools import pairwise
from math import degrees, inf, pi, radians, sin
from random import Random

from yumi.control.commands import MemoryBuffer, SessionGoal, write_goal
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.limiter import Guard
from yumi.driver.state_machine import EgmMotionSettings
from yumi.robot.joints import CYCLE, YUMI_LIMITS, Joints, Side, joint_names, joints
from yumi.settings import Values
from yumi_evaluation.guided_arm import FULL_SPEED, GuidedArm
from yumi_evaluation.metrics import Series

CONTROLLER = "joint_position_controller"
SIDE = Side.LEFT
JOINT = 6
"""Axis 6, in the order of the chain."""

LIMITS = YUMI_LIMITS.slowed_to(radians(FULL_SPEED.max_speed_deviation))
"""What the robot lets the joints do at full-speed settings."""

FEED_FORWARD: Values = {"tracking.feed_forward": True}

_LONGEST_LAG = 0.4  # [s]

Reference = Callable[[float], float]
"""How far the joint shall be from where it began [rad], at a time since then [s]."""


@dataclass(frozen=True, slots=True)
class Sine:
    """A sine that is streamed from one moment to the next, as in the thesis: it begins at full speed.

    Attributes:
        amplitude: [rad].
        frequency: [Hz].
    """

    amplitude: float
    frequency: float = 0.2

    def __call__(self, time: float) -> float:
        return self.amplitude * sin(2.0 * pi * self.frequency * time)


@dataclass(frozen=True, slots=True)
class Step:
    """A reference that stands, jumps and stands.

    Attributes:
        size: [rad].
        time: when it jumps [s].
    """

    size: float
    time: float = 0.1

    def __call__(self, time: float) -> float:
        return self.size if time >= self.time else 0.0


@dataclass(frozen=True, slots=True)
class Stream:
    """How goals are sent.

    Attributes:
        rate: how many a second [Hz].
        lateness: mean of the time by which they arrive late, exponentially distributed, in order [s].
        until: no goal is sent after that [s].
    """

    rate: float = 500.0
    lateness: float = 0.0
    until: float = inf

    def arrivals(self) -> Iterator[tuple[float, float]]:
        """When a goal arrives and when it was sent [s], the first at 0; the same every time."""
        chance, last, number = Random(1), 0.0, 0
        while (sent := number / self.rate) <= self.until:
            late = chance.expovariate(1.0 / self.lateness) if self.lateness > 0.0 else 0.0
            last = max(last, sent + late)
            yield last, sent
            number += 1


@dataclass(frozen=True, slots=True)
class Sample:
    """One cycle of the joint, relative to where it began.

    Attributes:
        time: since the first goal [s].
        reference: of that moment [rad].
        measured: [rad].
        planned_velocity: the speed the robot has given itself [rad/s].
    """

    time: float
    reference: float
    measured: float
    planned_velocity: float


@dataclass(frozen=True, slots=True)
class Run:
    """An arm that followed a reference.

    Attributes:
        reference: what it was to follow.
        samples: what it did.
        slowed: cycles in which the guard changed the command.
    """

    reference: Reference
    samples: tuple[Sample, ...]
    slowed: int

    def after(self, begin: float) -> Run:
        """The part of it from ``begin`` [s] on."""
        return Run(self.reference, tuple(each for each in self.samples if each.time >= begin), self.slowed)

    @property
    def max_error_deg(self) -> float:
        """Largest difference of the measured position from the reference of the same moment [°]."""
        return degrees(max(abs(each.measured - each.reference) for each in self.samples))

    @property
    def overshoot_deg(self) -> float:
        """By how much the measured position went past the end of the reference, at most [°]."""
        end = self.samples[-1].reference
        return degrees(max((each.measured - end) * (1.0 if end >= 0.0 else -1.0) for each in self.samples))

    @property
    def max_acceleration(self) -> float:
        """Largest acceleration the robot gave itself [rad/s²]."""
        speeds = [each.planned_velocity for each in self.samples]
        return max(abs(new - old) for old, new in pairwise(speeds)) / CYCLE

    @property
    def largest_gap(self) -> float:
        """Longest time between two samples [s]."""
        return max(new.time - old.time for old, new in pairwise(self.samples))

    @property
    def lag(self) -> float:
        """Mean lag: the delay of the reference with which it comes closest to the measured positions [s]."""
        best, width = _LONGEST_LAG / 2.0 - 0.02, _LONGEST_LAG / 2.0
        while width > 1e-5:
            choices = [best + width * share / 5.0 for share in range(-5, 6)]
            best = min(choices, key=self._distance)
            width /= 5.0
        return best

    def settling_time(self, band_deg: float) -> float:
        """Since when the measured position has been as close as that to the reference [s]."""
        outside = [each.time for each in self.samples if degrees(abs(each.measured - each.reference)) > band_deg]
        return outside[-1] + CYCLE if outside else 0.0

    def _distance(self, delay: float) -> float:
        """Squared; every fourth sample tells enough."""
        return sum([(each.measured - self.reference(each.time - delay)) ** 2 for each in self.samples[::4]])


def follow(reference: Reference, duration: float, values: Values | None = None, stream: Stream | None = None) -> Run:
    """Have the virtual arm follow ``reference`` on one joint for ``duration`` [s].

    Args:
        reference: what is streamed.
        duration: how long [s].
        values: parameters of the joint position controller.
        stream: how it is streamed.
    """
    goals = MemoryBuffer[SessionGoal]()
    controller = JointPositionController(goals, LIMITS)
    arm = GuidedArm({CONTROLLER: controller}, side=SIDE, guard=Guard(LIMITS))
    arm.manager.set_parameters(CONTROLLER, values or {})
    arm.start()
    arm.run(0.2)
    arm.switch_to(CONTROLLER)
    start, begin, slowed = arm.robot.arm.planned, arm.clock.now(), arm.snapshot.slowed
    arrivals = (stream or Stream()).arrivals()
    coming, samples = next(arrivals, None), []
    while arm.clock.now() - begin < duration:
        while coming is not None and begin + coming[0] <= arm.clock.now() + CYCLE:
            write_goal(goals, arm.snapshot.session, _moved(start, reference(coming[1])), time=begin + coming[0])
            coming = next(arrivals, None)
        arm.cycle()
        now, velocity = arm.clock.now() - begin, arm.robot.arm.velocity[JOINT]
        measured = arm.cycles[-1].state.position[JOINT] - start[JOINT]
        samples.append(Sample(now, reference(now), measured, velocity))
    return Run(reference, tuple(samples), arm.snapshot.slowed - slowed)


def acceleration_limit() -> float:
    """What the guard allows the joint [rad/s²]."""
    return LIMITS.acceleration[JOINT]


def _moved(start: Joints, way: float) -> Joints:
    return joints([*start[:JOINT], start[JOINT] + way])


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
