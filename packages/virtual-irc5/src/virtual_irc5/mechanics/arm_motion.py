"""The motions of one arm that the controller plans itself: its dynamics, standstill, travel, stop and brakes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Protocol

from ruckig import ControlInterface, InputParameter, Result, Ruckig, Synchronization, Trajectory

from abb_protocols.errors import CommandRefused
from abb_protocols.robot.description import HAND, Mass
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, ZERO_JOINTS, JointLimits, Joints


@dataclass(frozen=True, slots=True)
class ArmModel:
    """The dynamics of one arm, those of a YuMi by default.

    Its times under EGM are those measured on another robot, see :data:`_IRB_6640`, rounded: with them and
    a limit of acceleration the published step times of a YuMi come out (:mod:`yumi_evaluation.virtual_time`). See
    reference/egm.md §6.5 for what is documented and what is a model.

    Attributes:
        limits: positions and speeds the joints can have; accelerations and jerks of RAPID motions.
        reference_delay: from when EGM takes a reference until it uses it [s].
        delay: pure delay from the planned to the measured position [s]; larger means a later answer.
        lag: time constant of the servo behind the delay [s]; larger means corners are rounded more.
        filtering_delay: what EGM's level 1 (filtering) adds to the delay [s].
        egm_acceleration: highest accelerations that EGM plans [rad/s²], (7,), for all joints with one factor on how the
            speed changes; None where EGM plans any.
        brake_deceleration: deceleration of every joint by the brakes [rad/s²].
        step: longest time the arm moves at one planned speed, EGM's own cycle [s].
        supervises_load: whether EGM references that need too much torque stop the robot (50375).
        torque: what the drives can give at the joints [N m], (7,).
        torque_time: how long they may be overloaded: the time constant of the mean that is supervised [s].
        payload: what hangs on tool0, seen from tool0; None is a bare flange.
    """

    limits: JointLimits = YUMI_LIMITS
    reference_delay: float = CYCLE
    delay: float = 0.010
    lag: float = 0.006
    filtering_delay: float = 0.016
    egm_acceleration: Joints | None = None
    brake_deceleration: float = 60.0
    step: float = CYCLE
    supervises_load: bool = True
    # ABB publishes no torques. These are of the order of strain-wave gears of the joints' sizes: a tenth more than any
    # motion within the limits can need, all joints at once in the worst pose with 0.5 kg in the gripper; and less than
    # what a step of several joints needs at full-speed settings.
    torque: Joints = (72.0, 72.0, 36.0, 36.0, 6.0, 6.0, 6.0)
    torque_time: float = 0.010
    payload: Mass | None = HAND

    def egm_delay(self, level: int) -> float:
        """Delay from the planned to the measured position at a level of EGM, 0 raw or 1 filtering [s]."""
        return self.delay + (self.filtering_delay if level > 0 else 0.0)


_IRB_6640 = ArmModel(JointLimits.unlimited(6), reference_delay=0.00375, delay=0.010, lag=0.006, supervises_load=False)
"""How an IRB 6640 on an IRC5 follows, fitted to records of one: four starts and two turns under EGM at 250 Hz.

The starts are met within 0.009° rms, the turns within 0.072° (docs/explanation/virtual-robot.md). Only the sum of delay
and lag is in the records. Its limits are not: replace them by those of the arm.
"""

_ROBOTSTUDIO = ArmModel(JointLimits.unlimited(6), reference_delay=0.002, delay=0.0165, lag=0.006, supervises_load=False)
"""How ABB's virtual controller follows, fitted to a record of one run of an IRB 6640: start and end of it.

The start is met within 0.002° rms, the end within 0.023°. Its cycle is 4 ms.
"""

ARM_MODELS: Mapping[str, ArmModel] = {"YuMi": ArmModel(), "IRB 6640": _IRB_6640, "RobotStudio": _ROBOTSTUDIO}
"""The sets of parameters by the robot they stand for."""


@dataclass(frozen=True, slots=True)
class MotionState:
    """Planned positions [rad], speeds [rad/s] and accelerations [rad/s²] of the joints, each (7,)."""

    position: Joints
    velocity: Joints = ZERO_JOINTS
    acceleration: Joints = ZERO_JOINTS

    @classmethod
    def standing(cls, position: Joints) -> MotionState:
        """At standstill."""
        still = (0.0,) * len(position)
        return cls(position, still, still)


class ArmMotion(Protocol):
    """A motion that the arm plans."""

    @property
    def state(self) -> MotionState: ...

    @property
    def is_finished(self) -> bool:
        """Whether the motion is at its end, at standstill."""

    def advance(self, dt: float) -> None:
        """Go on by ``dt`` [s] > 0."""


class Standstill:
    """The arm stays where it is."""

    is_finished = True

    def __init__(self, position: Joints) -> None:
        self.state = MotionState.standing(position)

    def advance(self, dt: float) -> None: ...


class _JerkLimitedMotion:
    """A trajectory that is planned at its start."""

    def __init__(self, trajectory: Trajectory, target: Joints | None = None) -> None:
        self._trajectory = trajectory
        self._target = target
        self._time = 0.0
        self.state = self._state_now()

    @property
    def is_finished(self) -> bool:
        return bool(self._time >= self._trajectory.duration)

    def advance(self, dt: float) -> None:
        self._time = min(self._time + dt, self._trajectory.duration)
        self.state = self._state_now()

    def _state_now(self) -> MotionState:
        position, velocity, acceleration = self._trajectory.at_time(self._time)
        if self.is_finished:
            return MotionState.standing(self._target or tuple(position))
        return MotionState(tuple(position), tuple(velocity), tuple(acceleration))


def travel(start: MotionState, target: Joints, model: ArmModel, duration: float = 0.0) -> _JerkLimitedMotion:
    """A straight motion in joint space to ``target`` [rad], all joints arriving together.

    Args:
        start: where the motion begins, standing or moving.
        target: where it ends, standing [rad], (7,).
        model: the limits it keeps.
        duration: shortest time it may take [s]; it takes longer where the limits ask for it.
    """
    plan = _plan(start, model)
    plan.target_position = target
    plan.max_velocity = model.limits.velocity
    plan.max_acceleration, plan.max_jerk = model.limits.acceleration, model.limits.jerk
    plan.synchronization = Synchronization.Phase
    return _JerkLimitedMotion(_trajectory(plan, duration), target)


def stopping(start: MotionState, model: ArmModel, duration: float = 0.0) -> _JerkLimitedMotion:
    """From the present speed to standstill, as fast as the drives allow or over ``duration`` [s]."""
    plan = _plan(start, model)
    plan.control_interface = ControlInterface.Velocity
    plan.max_acceleration, plan.max_jerk = model.limits.acceleration, model.limits.jerk
    return _JerkLimitedMotion(_trajectory(plan, duration))


def braking(start: MotionState, model: ArmModel) -> _JerkLimitedMotion:
    """From the present speed to standstill by the brakes alone."""
    plan = _plan(replace(start, acceleration=MotionState.standing(start.position).acceleration), model)
    plan.control_interface = ControlInterface.Velocity
    count = len(start.position)
    plan.max_acceleration = [model.brake_deceleration] * count
    plan.max_jerk = [model.brake_deceleration / 1e-3] * count  # brakes bite within a millisecond
    return _JerkLimitedMotion(_trajectory(plan))


def _plan(start: MotionState, model: ArmModel) -> InputParameter:
    plan = InputParameter(len(start.position))
    plan.current_position, plan.current_velocity = start.position, start.velocity
    plan.current_acceleration = [
        max(-most, min(most, value)) for value, most in zip(start.acceleration, model.limits.acceleration, strict=True)
    ]
    return plan


def _trajectory(plan: InputParameter, duration: float = 0.0) -> Trajectory:
    if duration > 0.0:
        plan.minimum_duration = duration
    trajectory = Trajectory(plan.degrees_of_freedom)
    result = Ruckig(plan.degrees_of_freedom).calculate(plan, trajectory)
    if result not in (Result.Working, Result.Finished):
        raise CommandRefused(f"No motion leads from {plan.current_position} to standstill within the limits: {result}.")
    return trajectory
