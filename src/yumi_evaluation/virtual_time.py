"""Experiments in virtual time: a virtual arm, the wire's codecs, our control loop with its controllers; deterministic.

Bare, nothing but the gain's range and the limiter's limits differ from what is shipped: a gain may be as high as one
likes, and the limiter lets every step pass, as the thesis's system did.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from math import cos, inf, pi, radians, sin
from random import Random

import numpy as np
from numpy.typing import NDArray

from yumi.control.controller import MemoryBuffer, SessionGoal, write_goal
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.controllers.joint_trajectory import FollowTrajectory, JointTrajectoryController
from yumi.control.limiter import Limiter
from yumi.control.trajectory import JointTrajectory, TrajectoryPoint, plan_trajectory
from yumi.robot.joints import CYCLE, JOINT_COUNT, YUMI_LIMITS, JointLimits, Joints, Side, joint_names, joints
from yumi.settings import Parameter, Values
from yumi.virtual.mechanics.arm import ArmModel
from yumi_evaluation.experiments import AXIS_6, GOAL_RATE, Experiment, Mode, Sine, Step, System, Trace
from yumi_evaluation.metrics import Series, minimum, series
from yumi_evaluation.virtual_rig import VirtualArmRig

CONTROLLER = "joint_position_controller"
TRAJECTORY_CONTROLLER = "joint_trajectory_controller"

CONTROL_LAG = 0.0167
"""From reference to position, where our step times are closest to the published ones [s].

Fitted to them and to nothing else: benchmarks/tracking/fit_model.py does it again.
"""

HIGHEST_GAIN = 10.0
"""To which a sweep may go; the shipped controller refuses more than 2."""

_TAKEOVER = 0.2  # [s] until the robot has taken over
_NO_LIMIT = joints([1e9] * JOINT_COUNT)
_REST = joints([0.0] * JOINT_COUNT)
_SPACING = 0.1  # [s] between two points of a trajectory


def arm_with(control_lag: float) -> ArmModel:
    """An arm with that control lag [s], shared between delay and servo lag as in the virtual robot that is shipped."""
    shipped = ArmModel()
    fraction = shipped.delay / (shipped.delay + shipped.lag)
    return ArmModel(delay=fraction * control_lag, lag=(1.0 - fraction) * control_lag)


FITTED = arm_with(CONTROL_LAG)


class AnyGainController(JointPositionController):
    """The joint position controller for which no gain is too high: to find where oscillation begins."""

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        own = super().parameters(joint_names)
        return tuple(replace(each, highest=HIGHEST_GAIN) if each.name == "p" else each for each in own)


def run_virtually(experiment: Experiment, system: System = System.SHIPPED, model: ArmModel | None = None) -> Trace:
    """Run ``experiment`` in virtual time.

    Args:
        experiment: what to run.
        system: BARE runs without the limiter, as published; others with it.
        model: of the arm; by default the fitted one when bare, else the shipped one.
    """
    reference, which = experiment.reference, experiment.moved
    if experiment.controller.is_planned:
        planned = planned_sine(reference)
        path = follow_planned(planned, side=experiment.side, joint=which[0])
        return Trace(experiment, planned.goals(), {which[0]: path.measured}, path.slowed)
    limits = YUMI_LIMITS.slowed_to(radians(experiment.mode.value.max_speed_deviation))
    is_bare = system is System.BARE
    rig = _Streaming(
        limits,
        experiment.controller.values,
        experiment.mode,
        experiment.side,
        Limiter(_unlimited(limits) if is_bare else limits),
        model or (FITTED if is_bare else ArmModel()),
    )
    times = goal_times(experiment)
    rig.stream(reference, which, [(time, time) for time in times], experiment.duration)
    measured = {joint: rig.measured(joint) for joint in which}
    return Trace(experiment, series([(time, reference(time)) for time in times]), measured, rig.slowed)


def goal_times(experiment: Experiment) -> list[float]:
    """When goals are sent, from the beginning [s]: once for a step, at 500 Hz for a sine."""
    return [number / GOAL_RATE for number in range(1 if experiment.is_step else int(experiment.duration * GOAL_RATE))]


def moved(start: Joints, distance: float, which: Sequence[int]) -> Joints:
    """``start`` with the joints ``which`` moved by ``distance`` [rad]."""
    return joints([value + distance * (index in which) for index, value in enumerate(start)])


class _Streaming:
    """An arm in virtual time whose joint position controller is active and is sent goals."""

    def __init__(
        self,
        limits: JointLimits,
        values: Values,
        mode: Mode,
        side: Side,
        limiter: Limiter,
        model: ArmModel | None = None,
    ) -> None:
        self._goals = MemoryBuffer[SessionGoal]()
        controller = AnyGainController(self._goals, limits)
        self.rig = VirtualArmRig({CONTROLLER: controller}, side=side, limiter=limiter, model=model)
        self.rig.manager.set_parameters(CONTROLLER, values)
        self.rig.start(mode.value)
        self.rig.run(_TAKEOVER)
        self.rig.switch_to(CONTROLLER)
        self._start, self._begin = self.rig.robot.arm.planned, self.rig.clock.now()
        self._first, self._slowed = len(self.rig.cycles), self.rig.snapshot.slowed
        self.speeds: list[Joints] = []

    def stream(
        self, reference: Step | Sine, which: Sequence[int], arrivals: Iterable[tuple[float, float]], duration: float
    ) -> None:
        """Send goals for ``duration`` [s]; ``arrivals``: when each arrives and when it was sent, from the begin [s]."""
        rig, coming = self.rig, iter(arrivals)
        arrival, sent = next(coming, (inf, inf))
        while rig.clock.now() - self._begin < duration:
            # What is sent before a datagram arrives is there when it is answered.
            while self._begin + arrival <= rig.clock.now() + CYCLE:
                goal = moved(self._start, reference(sent), which)
                write_goal(self._goals, rig.snapshot.session, goal, time=self._begin + arrival)
                arrival, sent = next(coming, (inf, inf))
            rig.cycle()
            self.speeds.append(rig.robot.arm.velocity)

    def measured(self, joint: int) -> Series:
        """Time since the begin [s] and angle from where the joint began [rad]."""
        states = [cycle.state for cycle in self.rig.cycles[self._first :]]
        return series([(each.time - self._begin, each.position[joint] - self._start[joint]) for each in states])

    @property
    def slowed(self) -> int:
        """Cycles in which the limiter changed the command."""
        return self.rig.snapshot.slowed - self._slowed


def _unlimited(limits: JointLimits) -> JointLimits:
    """Only the ranges remain."""
    return replace(limits, velocity=_NO_LIMIT, acceleration=_NO_LIMIT, jerk=_NO_LIMIT)


@dataclass(frozen=True, slots=True)
class PlannedSine:
    """A sine as a trajectory: it begins and ends where it turns, since a planned motion begins at rest.

    Attributes:
        amplitude: [rad].
        frequency: [Hz].
        periods: how many.
    """

    amplitude: float
    frequency: float = 0.2
    periods: int = 2

    @property
    def duration(self) -> float:
        """[s]."""
        return self.periods / self.frequency

    def at(self, time: float) -> tuple[float, float, float]:
        """Distance from its begin [rad], velocity [rad/s] and acceleration [rad/s²]."""
        turn = 2.0 * pi * self.frequency
        angle = turn * max(0.0, min(self.duration, time))
        size = self.amplitude
        return size * (1.0 - cos(angle)), size * turn * sin(angle), size * turn * turn * cos(angle)

    def points(self, start: Joints, joint: int) -> tuple[TrajectoryPoint, ...]:
        """Points with positions, velocities and accelerations of one joint, from ``start`` [rad]."""
        points, last = [], round(self.duration / _SPACING)
        for number in range(last + 1):
            distance, speed, acceleration = self.at(number * _SPACING)
            velocity = moved(_REST, speed if number < last else 0.0, (joint,))
            position = moved(start, distance, (joint,))
            points.append(TrajectoryPoint(number * _SPACING, position, velocity, moved(_REST, acceleration, (joint,))))
        return tuple(points)

    def goals(self) -> Series:
        """The reference at the rate of goals that are streamed: time [s], angle [rad]."""
        times = [number / GOAL_RATE for number in range(int(self.duration * GOAL_RATE))]
        return series([(time, self.at(time)[0]) for time in times])


def planned_sine(reference: Step | Sine) -> PlannedSine:
    """One period of the same sine as a trajectory."""
    assert isinstance(reference, Sine), "trajectories are measured with sines"
    return PlannedSine(reference.amplitude, reference.frequency, periods=1)


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """How an arm followed a trajectory.

    Attributes:
        measured: time since the trajectory began [s], angle from where it began [rad].
        slowed: cycles in which the limiter changed the command.
        outcome: how the motion ended.
    """

    measured: Series
    slowed: int
    outcome: str


def follow_planned(
    sine: PlannedSine, parameters: Values | None = None, *, side: Side = Side.LEFT, joint: int = AXIS_6
) -> Path:
    """Have one joint of a virtual arm follow ``sine`` at full-speed settings, with parameters of the controller."""
    controller = JointTrajectoryController(side, MemoryBuffer())
    rig = VirtualArmRig({TRAJECTORY_CONTROLLER: controller}, side=side)
    rig.manager.set_parameters(TRAJECTORY_CONTROLLER, parameters or {})
    rig.start()
    rig.switch_to(TRAJECTORY_CONTROLLER)
    rig.run(0.1)
    state = rig.line.state
    assert state is not None
    start, begin, slowed = state.planned, state.time + 0.1, rig.snapshot.slowed
    trajectory = JointTrajectory(joint_names(side), sine.points(start, joint), start=begin)
    plan = plan_trajectory(trajectory, (side,), YUMI_LIMITS)[side]
    rig.manager.receive(TRAJECTORY_CONTROLLER, FollowTrajectory(plan, goal=1), state)
    first = len(rig.cycles)
    rig.run(sine.duration + 0.5)
    states = [cycle.state for cycle in rig.cycles[first:]]
    measured = series([(each.time - begin, each.position[joint] - start[joint]) for each in states])
    return Path(measured, rig.snapshot.slowed - slowed, str(rig.events[-1]))


@dataclass(frozen=True, slots=True)
class Tracking:
    """How closely a known trajectory was followed.

    Attributes:
        max_error_deg: largest difference of the measured from the planned position [°].
        mean_lag: by how much it was late on average, in the sense of least squares [s].
        slowed: cycles in which the limiter changed the command.
    """

    max_error_deg: float
    mean_lag: float
    slowed: int


def follow_sine(sine: PlannedSine, parameters: Values | None = None) -> Tracking:
    """The figures of axis 6 following ``sine`` as a trajectory."""
    path = follow_planned(sine, parameters)
    planned = np.array([sine.at(time) for time in path.measured[:, 0]])
    errors, speeds = path.measured[:, 1] - planned[:, 0], planned[:, 1]
    return Tracking(float(np.degrees(np.abs(errors).max())), float(-(errors @ speeds) / (speeds @ speeds)), path.slowed)


@dataclass(frozen=True, slots=True)
class Stream:
    """How goals are sent.

    Attributes:
        rate: goals per second [Hz].
        lateness: mean of the time by which they arrive late, exponentially distributed, in order [s].
        until: no goal is sent after that [s].
    """

    rate: float = 500.0
    lateness: float = 0.0
    until: float = inf

    def arrivals(self, duration: float) -> list[tuple[float, float]]:
        """When a goal arrives and when it was sent [s], the first at 0; the same every time."""
        chance, last, found = Random(1), 0.0, list[tuple[float, float]]()
        while (sent := len(found) / self.rate) <= min(self.until, duration + CYCLE):
            late = chance.expovariate(1.0 / self.lateness) if self.lateness > 0.0 else 0.0
            last = max(last, sent + late)
            found.append((last, sent))
        return found


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """An arm that followed a streamed reference; arrays with a value for each cycle.

    Attributes:
        reference: what was streamed.
        times: since the first goal [s].
        measured: angle from where the joint began [rad].
        speeds: that the robot planned [rad/s].
        slowed: cycles in which the limiter changed the command.
    """

    reference: Step | Sine
    times: NDArray[np.float64]
    measured: NDArray[np.float64]
    speeds: NDArray[np.float64]
    slowed: int
    errors: NDArray[np.float64] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "errors", self.measured - self._reference(self.times))

    def after(self, begin: float) -> Run:
        """The part of it from ``begin`` [s] on."""
        is_later = self.times >= begin
        return replace(self, times=self.times[is_later], measured=self.measured[is_later], speeds=self.speeds[is_later])

    @property
    def max_error_deg(self) -> float:
        """Largest difference of the measured position from the reference of the same moment [°]."""
        return float(np.degrees(np.abs(self.errors).max()))

    @property
    def overshoot_deg(self) -> float:
        """By how much the measured position went past the end of the reference [°]."""
        end = self.reference(self.times[-1])
        return float(np.degrees((np.sign(end or 1.0) * (self.measured - end)).max()))

    @property
    def max_acceleration(self) -> float:
        """Largest acceleration the robot planned [rad/s²]."""
        return float(np.abs(np.diff(self.speeds)).max() / CYCLE)

    @property
    def lag(self) -> float:
        """The delay of the reference with which it comes closest to the measured positions [s]."""
        times, measured = self.times[::4], self.measured[::4]
        return minimum(lambda late: float(((measured - self._reference(times - late)) ** 2).sum()), -0.02, 0.38)

    def settling_time(self, band_deg: float) -> float:
        """Since when the measured position has been as close as that to the reference [s]."""
        outside = self.times[np.degrees(np.abs(self.errors)) > band_deg]
        return float(outside[-1]) + CYCLE if outside.size else 0.0

    def _reference(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array([self.reference(time) for time in times])


FULL_SPEED_LIMITS = YUMI_LIMITS.slowed_to(radians(Mode.FULLSPEED.value.max_speed_deviation))
"""What the robot lets the joints do at full-speed settings."""


def follow(reference: Step | Sine, duration: float, values: Values | None = None, stream: Stream | None = None) -> Run:
    """Have axis 6 of the virtual left arm follow a reference that is streamed, so that its future is unknown.

    Args:
        reference: what is streamed.
        duration: how long [s].
        values: parameters of the joint position controller.
        stream: how it is streamed.
    """
    rig = _Streaming(FULL_SPEED_LIMITS, values or {}, Mode.FULLSPEED, Side.LEFT, Limiter(FULL_SPEED_LIMITS))
    rig.stream(reference, (AXIS_6,), (stream or Stream()).arrivals(duration), duration)
    measured = rig.measured(AXIS_6)
    speeds = np.array([each[AXIS_6] for each in rig.speeds])
    return Run(reference, measured[:, 0], measured[:, 1], speeds, rig.slowed)
