"""Experiments in virtual time: a virtual arm, the wire's codecs, our control loop with its controllers; deterministic.

Bare, nothing but the gain's range and the limiter's limits differ from what is shipped: a gain may be as high as one
likes, and the limiter lets every step pass, as the thesis's system did.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import cos, inf, pi, radians, sin

from yumi.control.controller import MemoryBuffer, SessionGoal, write_goal
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.controllers.joint_trajectory import FollowTrajectory, JointTrajectoryController
from yumi.control.limiter import Limiter
from yumi.control.trajectory import JointTrajectory, TrajectoryPoint, plan_trajectory
from yumi.robot.joints import CYCLE, JOINT_COUNT, YUMI_LIMITS, JointLimits, Joints, Side, joint_names, joints
from yumi.settings import Parameter, Values
from yumi.virtual.mechanics.arm import ArmModel
from yumi_evaluation.experiments import AXIS_6, GOAL_RATE, Experiment, Mode, Sine, Step, System, Trace
from yumi_evaluation.metrics import Series, series
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
    rig = StreamedArm(
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


class StreamedArm:
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
