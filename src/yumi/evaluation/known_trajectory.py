"""How closely the virtual arm follows a trajectory that is known in advance: a sine on one joint, in virtual time."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, degrees, pi, sin

from yumi.control.mailbox import MemoryMailbox
from yumi.control.parameter import Values
from yumi.control.spline import TrajectoryPoint
from yumi.control.trajectory import JointTrajectory, plan_trajectory
from yumi.controllers.joint_trajectory import JointTrajectoryController
from yumi.controllers.trajectory_orders import FollowTrajectory
from yumi.evaluation.guided_arm import GuidedArm
from yumi.robot.joints import JOINT_COUNT, Joints, Side, joint_names
from yumi.robot.limits import YUMI_LIMITS

CONTROLLER = "joint_trajectory_controller"
SIDE = Side.LEFT

_JOINT = 6  # of the chain: axis 6
_REST = (0.0,) * JOINT_COUNT
_SPACING = 0.1  # [s] between two points


@dataclass(frozen=True, slots=True)
class Sine:
    """A sine that begins, and ends, where it turns.

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
        """As points with positions, velocities and accelerations of one joint, from ``start`` [rad]."""
        times = [number * _SPACING for number in range(round(self.duration / _SPACING) + 1)]
        rows = [(time, self.at(time)) for time in times]
        moving = [
            TrajectoryPoint(
                time,
                _with(start, start[joint] + way, joint),
                _with(_REST, speed, joint),
                _with(_REST, gain, joint),
            )
            for time, (way, speed, gain) in rows
        ]
        return (*moving[:-1], moving[-1]._replace(velocity=_REST))


@dataclass(frozen=True, slots=True)
class Tracking:
    """How an arm followed.

    Attributes:
        max_error_deg: largest difference of the measured from the planned position [°].
        mean_lag: by how much it was late on average, in the sense of least squares [s].
        slowed: cycles in which the guard changed the command.
        sentence: how the motion ended.
    """

    max_error_deg: float
    mean_lag: float
    slowed: int
    sentence: str


@dataclass(frozen=True, slots=True)
class Way:
    """The way an arm went.

    Attributes:
        measured: time since the trajectory began [s], angle from where it began [rad].
        slowed: cycles in which the guard changed the command.
        sentence: how the motion ended.
    """

    measured: tuple[tuple[float, float], ...]
    slowed: int
    sentence: str


def follow_sine(sine: Sine, parameters: Values | None = None) -> Tracking:
    """Have the virtual arm follow ``sine`` on axis 6 at full-speed settings, with the controller's ``parameters``."""
    way = follow_planned(sine, parameters)
    errors = [angle - sine.at(time)[0] for time, angle in way.measured]
    speeds = [sine.at(time)[1] for time, _ in way.measured]
    lag = -sum(error * speed for error, speed in zip(errors, speeds, strict=True)) / sum(
        [speed * speed for speed in speeds]
    )
    return Tracking(degrees(max(map(abs, errors))), lag, way.slowed, way.sentence)


def follow_planned(sine: Sine, parameters: Values | None = None, *, side: Side = SIDE, joint: int = _JOINT) -> Way:
    """Have one joint of a virtual arm follow ``sine`` as a trajectory; see :func:`follow_sine`."""
    controller = JointTrajectoryController(side, MemoryMailbox())
    arm = GuidedArm({CONTROLLER: controller}, side=side)
    arm.manager.set_parameters(CONTROLLER, parameters or {})
    arm.start()
    arm.switch_to(CONTROLLER)
    arm.run(0.1)
    state = arm.line.state
    assert state is not None
    start, begin, slowed = state.planned, state.time + 0.1, arm.snapshot.slowed
    trajectory = JointTrajectory(joint_names(side), sine.points(start, joint), start=begin)
    plan = plan_trajectory(trajectory, (side,), YUMI_LIMITS)[side]
    arm.manager.receive(CONTROLLER, FollowTrajectory(plan, goal=1), state)
    first = len(arm.cycles)
    arm.run(sine.duration + 0.5)
    states = [cycle.state for cycle in arm.cycles[first:]]
    measured = tuple((each.time - begin, each.position[joint] - start[joint]) for each in states)
    return Way(measured, arm.snapshot.slowed - slowed, str(arm.events[-1]))


def _with(values: tuple[float, ...], value: float, joint: int) -> tuple[float, ...]:
    return (*values[:joint], value, *values[joint + 1 :])
