"""The motions of one arm in time: its dynamics, travel, stop, and the motion under EGM.

EGM's controller makes the positions the arm plans from the sensor's references (reference/egm.md §6.1):
``speed = k·(pos_ref - pos) + speed_ref``, where ``pos`` is the position that the robot reports, late by the servo's
delay and lag, and the references are used some time after they were taken. The speed fades in, passes a low-pass filter
and is capped with one factor for all joints; the plan is the integral of that speed. Its parameters come from the
configuration and RAPID's EGM instructions, in SI units and chain order (reference/egm.md §5, §6.3).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from math import exp, inf, pi, radians
from typing import NamedTuple, Protocol, cast

import numpy as np
import numpy.ma  # np.unique imports it when called first, 80 ms in the middle of a motion
from numpy.typing import NDArray
from ruckig import ControlInterface, InputParameter, Result, Ruckig, Synchronization, Trajectory

from yumi.errors import CommandRefused
from yumi.robot.description import Mass
from yumi.robot.dynamics import HAND
from yumi.robot.joints import CYCLE, YUMI_LIMITS, ZERO, JointLimits, Joints, Pose

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ArmModel:
    """The dynamics of one arm, those of a YuMi by default.

    Its times under EGM are those measured on another robot, see :data:`IRB_6640`, rounded: with them and
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


def unlimited(count: int) -> JointLimits:
    """The limits of so many joints of which none are known."""
    most = cast("Joints", (inf,) * count)
    return JointLimits(cast("Joints", (-inf,) * count), most, most, most, most)


IRB_6640 = ArmModel(unlimited(6), reference_delay=0.00375, delay=0.010, lag=0.006, supervises_load=False)
"""How an IRB 6640 on an IRC5 follows, fitted to records of one: four starts and two turns under EGM at 250 Hz.

The starts are met within 0.009° rms, the turns within 0.072° (docs/explanation/virtual-robot.md). Only the sum of delay
and lag is in the records. Its limits are not: replace them by those of the arm.
"""

ROBOTSTUDIO = ArmModel(unlimited(6), reference_delay=0.002, delay=0.0165, lag=0.006, supervises_load=False)
"""How ABB's virtual controller follows, fitted to a record of one run of an IRB 6640: start and end of it.

The start is met within 0.002° rms, the end within 0.023°. Its cycle is 4 ms.
"""

MODELS: Mapping[str, ArmModel] = {"YuMi": ArmModel(), "IRB 6640": IRB_6640, "RobotStudio": ROBOTSTUDIO}
"""The sets of parameters by the robot they stand for."""


@dataclass(frozen=True, slots=True)
class MotionState:
    """Planned positions [rad], speeds [rad/s] and accelerations [rad/s²] of the joints, each (7,)."""

    position: Joints
    velocity: Joints = ZERO
    acceleration: Joints = ZERO

    @classmethod
    def standing(cls, position: Joints) -> MotionState:
        """At standstill."""
        still = cast("Joints", (0.0,) * len(position))
        return cls(position, still, still)


class Motion(Protocol):
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


class JerkLimitedMotion:
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
            return MotionState.standing(self._target or _fixed(position))
        return MotionState(_fixed(position), _fixed(velocity), _fixed(acceleration))


def travel(start: MotionState, target: Joints, model: ArmModel, duration: float = 0.0) -> JerkLimitedMotion:
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
    return JerkLimitedMotion(_trajectory(plan, duration), target)


def stopping(start: MotionState, model: ArmModel, duration: float = 0.0) -> JerkLimitedMotion:
    """From the present speed to standstill, as fast as the drives allow or over ``duration`` [s]."""
    plan = _plan(start, model)
    plan.control_interface = ControlInterface.Velocity
    plan.max_acceleration, plan.max_jerk = model.limits.acceleration, model.limits.jerk
    return JerkLimitedMotion(_trajectory(plan, duration))


def braking(start: MotionState, model: ArmModel) -> JerkLimitedMotion:
    """From the present speed to standstill by the brakes alone."""
    plan = _plan(replace(start, acceleration=MotionState.standing(start.position).acceleration), model)
    plan.control_interface = ControlInterface.Velocity
    count = len(start.position)
    plan.max_acceleration = [model.brake_deceleration] * count
    plan.max_jerk = [model.brake_deceleration / 1e-3] * count  # brakes bite within a millisecond
    return JerkLimitedMotion(_trajectory(plan))


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


def _fixed(values: Sequence[float]) -> Joints:
    return cast("Joints", tuple(values))


Band = tuple[float, float]
"""``egm_minmax``: lowest and highest difference from the reference that counts as converged [rad]."""

Bands = tuple[Band, ...]
Axes = tuple[bool, ...]
ALL_AXES: Axes = (True, True, True, True, True, True, True)


class StopMode(Enum):
    """``egmstopmode``: what the arm does when EGM ends."""

    HOLD = 0
    RAMP_DOWN = 1


def same_band(low: float, high: float, count: int = 7) -> Bands:
    """One convergence band [rad] for all joints."""
    return ((low, high),) * count


DEFAULT_BANDS = same_band(radians(-0.5), radians(0.5))


@dataclass(frozen=True, slots=True)
class ExternalMotionData:
    """The system parameters EXT_MOTION_DATA that EGMSetupUC names (reference/egm.md §6.3).

    Attributes:
        level: 0 raw; 1 filtering, which adds delay.
        position_gain: default proportional position gain [1/s], 0 to 20.
        bandwidth: default low-pass bandwidth [Hz], 0 to 100.
        ramp_time: time in which EGM's speed goes to zero when the program stops [s].
        restarts_after_motors_off: whether an interrupted run goes on when motors and program are on again.
    """

    level: int = 1
    position_gain: float = 5.0
    bandwidth: float = 20.0
    ramp_time: float = 0.5
    restarts_after_motors_off: bool = True


@dataclass(frozen=True, slots=True)
class EgmActivation:
    """The arguments of EGMActJoint; defaults are ABB's.

    Attributes:
        tool: tool frame in tool0, for the poses the robot sends; None is tool0.
        wobj: work object in the world, in which those poses are given; None is the world.
        cond_min_max: convergence band of each joint [rad], in chain order; where poses guide, of the tool's x, y,
            z [m] and its turns about them [rad].
        frame: where poses of the sensor are given, in the base; None where joints guide.
        lp_filter: low-pass bandwidth [Hz]; 0 switches it off, None takes the configured one.
        sample_rate_ms: period of the datagrams in multiples of 4 ms, which stand for cycles of 4.032 ms.
        max_pos_deviation: how far any joint may go from where EGM started [rad].
        max_speed_deviation: highest joint speed EGM may ask for [rad/s].
    """

    tool: Pose | None = None
    wobj: Pose | None = None
    frame: Pose | None = None
    cond_min_max: Bands = DEFAULT_BANDS
    lp_filter: float | None = None
    sample_rate_ms: int = 4
    max_pos_deviation: float = radians(1000.0)
    max_speed_deviation: float = radians(1.0)


@dataclass(frozen=True, slots=True)
class EgmRun:
    """The arguments of EGMRunJoint; defaults are ABB's, where published.

    Attributes:
        stop_mode: what the arm does after convergence.
        axes: joints that have to converge (switches J1 to J7), (7,) in chain order.
        cond_time: how long they have to stay in their bands [s].
        ramp_in_time: time in which EGM's contribution grows from nothing to all [s].
        ramp_out_time: time of the way back with RAMP_DOWN [s].
        pos_corr_gain: factor on the position gain; 0 is pure velocity control.
        is_waited: whether RAPID waits for the end; False with NoWaitCond, when a missing sensor stops the program.
    """

    stop_mode: StopMode = StopMode.HOLD
    axes: Axes = ALL_AXES
    cond_time: float = 1.0
    ramp_in_time: float = 0.0
    ramp_out_time: float = 1.0
    pos_corr_gain: float = 1.0
    is_waited: bool = True


@dataclass(frozen=True, slots=True)
class EgmSettings:
    """The parameters of the controller.

    Attributes:
        gain: k above, PosCorrGain times the default position gain [1/s].
        bandwidth: of the low-pass on the speed [Hz]; 0 is none.
        ramp_in_time: [s].
        max_speed: MaxSpeedDeviation [rad/s].
        max_deviation: MaxPosDeviation [rad].
        level: 0 raw, 1 filtering.
    """

    gain: float = 5.0
    bandwidth: float = 20.0
    ramp_in_time: float = 0.0
    max_speed: float = radians(1.0)
    max_deviation: float = radians(1000.0)
    level: int = 0

    @classmethod
    def of(cls, data: ExternalMotionData, activation: EgmActivation, run: EgmRun) -> EgmSettings:
        """From configuration, activation and run."""
        return cls(
            gain=run.pos_corr_gain * data.position_gain,
            bandwidth=data.bandwidth if activation.lp_filter is None else activation.lp_filter,
            ramp_in_time=run.ramp_in_time,
            max_speed=activation.max_speed_deviation,
            max_deviation=activation.max_pos_deviation,
            level=data.level,
        )


class EgmMotion:
    """The motion of an arm under EGM, in steps of EGM's cycle.

    Args:
        position: where the arm stands [rad], (7,); the reference until the sensor gives one.
        settings: of the controller.
        model: how late references are used, and which speeds and accelerations cap them beside MaxSpeedDeviation.

    Attributes:
        reference: last position reference [rad], (7,).
        reference_velocity: speed last fed forward [rad/s], (7,).
        reported: where the robot reports to be [rad], (7,); the arm sets it before each step.
        utilization: how much of what is allowed the references ask for; above 1 the motion is reduced.
    """

    is_finished = False

    def __init__(self, position: Joints, settings: EgmSettings, model: ArmModel) -> None:
        self._settings = settings
        self._model = model
        self._start = position
        self._caps = tuple(min(settings.max_speed, most) for most in model.limits.velocity)
        self.state = MotionState.standing(position)
        self._filtered: tuple[float, ...] = self.state.velocity
        self._time = 0.0
        self._taken = deque([_Taken(0.0, position, self.state.velocity)])
        self.reference = position
        self.reference_velocity = self.state.velocity
        self.reported = position
        self.utilization = 0.0

    @property
    def start(self) -> Joints:
        """Where EGM began [rad], (7,)."""
        return self._start

    def advance(self, dt: float) -> None:
        settings, before = self._settings, self.state
        reference, velocity = self._used(dt)
        # The mean of the linear ramp-in over the step; afterwards 1.
        begin, self._time, ramp, fade = self._time, self._time + dt, settings.ramp_in_time, 1.0
        if begin < ramp:
            faded_in = min(self._time, ramp)
            fade = (faded_in * faded_in - begin * begin) / (2.0 * ramp * dt) + (self._time - faded_in) / dt
        gain = settings.gain * fade
        speed = tuple(
            [
                gain * (there - here) + fade * ahead
                for there, here, ahead in zip(reference, self.reported, velocity, strict=True)
            ]
        )
        if settings.bandwidth > 0.0:  # the low-pass filter
            new = 1.0 - exp(-2.0 * pi * settings.bandwidth * dt)
            speed = tuple([f + (s - f) * new for f, s in zip(self._filtered, speed, strict=True)])
        self._filtered = speed
        # One scale for all joints, so that the direction stays: of the speed, and of how much it changes.
        self.utilization = max([abs(value) / cap for value, cap in zip(speed, self._caps, strict=True)])
        if self.utilization > 1.0:
            speed = tuple([value / self.utilization for value in speed])
        most = self._model.egm_acceleration
        if most is not None:
            changes = [to - now for to, now in zip(speed, before.velocity, strict=True)]
            needed = max([abs(change) / (cap * dt) for change, cap in zip(changes, most, strict=True)])
            if needed > 1.0:
                speed = tuple([now + change / needed for now, change in zip(before.velocity, changes, strict=True)])
            self.utilization = max(self.utilization, needed)
        reach = settings.max_deviation
        moved = tuple(
            [
                max(start - reach, min(start + reach, now + value * dt))
                for start, now, value in zip(self._start, before.position, speed, strict=True)
            ]
        )
        position = cast("Joints", moved)
        velocity = _mean_rate(before.position, position, dt)  # less than asked for where the deviation is bounded
        self.state = MotionState(position, velocity, _mean_rate(before.velocity, velocity, dt))

    def _used(self, dt: float) -> tuple[Joints, Joints]:
        """The references that count during the next step: the mean of what was held ``reference_delay`` before."""
        taken, held = self._taken, _Taken(self._time + dt, self.reference, self.reference_velocity)
        if taken[-1][1:] == held[1:]:
            taken.pop()
        taken.append(held)
        begin = self._time - self._model.reference_delay
        while len(taken) > 1 and taken[0].until <= begin + _ROUNDING:
            taken.popleft()
        first = taken[0]
        end = begin + dt - _ROUNDING
        if first.until >= end:
            return first.position, first.velocity
        position, velocity, done = [0.0] * len(first.position), [0.0] * len(first.position), begin
        for each in taken:
            share = (min(each.until, begin + dt) - done) / dt
            position = [value + share * more for value, more in zip(position, each.position, strict=True)]
            velocity = [value + share * more for value, more in zip(velocity, each.velocity, strict=True)]
            done = each.until
            if done >= end:
                break
        return _fixed(position), _fixed(velocity)


class _Taken(NamedTuple):
    """References that EGM held: until when [s], positions [rad] and speeds [rad/s]."""

    until: float
    position: Joints
    velocity: Joints


_ROUNDING = 1e-9  # [s] of sums of cycles


def _mean_rate(before: Joints, now: Joints, dt: float) -> Joints:
    return cast("Joints", tuple((new - old) / dt for old, new in zip(before, now, strict=True)))
