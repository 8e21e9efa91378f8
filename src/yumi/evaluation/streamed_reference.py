"""How closely the virtual arm follows a reference that is streamed to it, of which the future is not known.

Everything is as in the thesis's test: one joint, goals at 500 Hz, each the reference at the time it was sent, and what
is judged is the measured position. Time is virtual; the arm has its default dynamics and the full-speed settings.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import degrees, inf, pi, radians, sin
from random import Random

from yumi.control.goals import put_goal
from yumi.control.guard import Guard
from yumi.control.mailbox import MemoryMailbox
from yumi.control.parameter import Values
from yumi.controllers.joint_position import JointPositionController
from yumi.evaluation.guided_arm import FULL_SPEED, GuidedArm
from yumi.robot.cycle import CYCLE
from yumi.robot.joints import Joints, Side, joints
from yumi.robot.limits import YUMI_LIMITS

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
    goals = MemoryMailbox()
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
            put_goal(goals, arm.snapshot.session, _moved(start, reference(coming[1])), time=begin + coming[0])
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
