"""The motion of one arm under EGM, and the arguments of RAPID's EGM instructions that it follows from.

EGM's controller makes the positions the arm plans from the sensor's references (reference/egm.md §6.1):
``speed = k·(pos_ref - pos) + speed_ref``, where ``pos`` is the position that the robot reports, late by the servo's
delay and lag, and the references are used some time after they were taken. The speed fades in, passes a low-pass filter
and is capped with one factor for all joints; the plan is the integral of that speed. Its parameters come from the
configuration and RAPID's EGM instructions, in SI units and chain order (reference/egm.md §5, §6.3).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from enum import Enum
from math import exp, pi, radians
from operator import le
from typing import NamedTuple

from abb_protocols.robot.joints import JOINT_COUNT, Joints, Pose
from virtual_irc5.mechanics.arm_motion import ArmModel, MotionState

Band = tuple[float, float]
"""``egm_minmax``: lowest and highest difference from the reference that counts as converged [rad]."""

_Bands = tuple[Band, ...]
_Axes = tuple[bool, ...]
_ALL_AXES: _Axes = (True,) * JOINT_COUNT


class EgmStopMode(Enum):
    """``egmstopmode``: what the arm does when EGM ends."""

    HOLD = 0
    RAMP_DOWN = 1


def same_egm_band(low: float, high: float) -> _Bands:
    """One convergence band [rad] for all joints."""
    return ((low, high),) * JOINT_COUNT


DEFAULT_BANDS = same_egm_band(radians(-0.5), radians(0.5))


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
    cond_min_max: _Bands = DEFAULT_BANDS
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

    stop_mode: EgmStopMode = EgmStopMode.HOLD
    axes: _Axes = _ALL_AXES
    cond_time: float = 1.0
    ramp_in_time: float = 0.0
    ramp_out_time: float = 1.0
    pos_corr_gain: float = 1.0
    is_waited: bool = True


@dataclass(frozen=True, slots=True)
class EgmMotionParameters:
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
    def of(cls, data: ExternalMotionData, activation: EgmActivation, run: EgmRun) -> EgmMotionParameters:
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
        start: where EGM began [rad], (7,).
        reference: last position reference [rad], (7,).
        reference_velocity: speed last fed forward [rad/s], (7,).
        reported: where the robot reports to be [rad], (7,); the arm sets it before each step.
        utilization: how much of what is allowed the references ask for; above 1 the motion is reduced.
    """

    is_finished = False

    def __init__(self, position: Joints, settings: EgmMotionParameters, model: ArmModel) -> None:
        self._settings = settings
        self._model = model
        self.start = position
        self._caps = tuple(min(settings.max_speed, most) for most in model.limits.velocity)
        reach = settings.max_deviation
        self._reach = tuple([each - reach for each in position]), tuple([each + reach for each in position])
        self.state = MotionState.standing(position)
        self._filtered: tuple[float, ...] = self.state.velocity
        self._time = 0.0
        self._taken = deque([_Taken(0.0, position, self.state.velocity)])
        self.reference = position
        self.reference_velocity = self.state.velocity
        self.reported = position
        self.utilization = 0.0

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
        position = tuple([now + value * dt for now, value in zip(before.position, speed, strict=True)])
        lowest, highest = self._reach
        if not (all(map(le, lowest, position)) and all(map(le, position, highest))):
            position = tuple(map(max, lowest, map(min, highest, position)))
        velocity = _mean_rate(before.position, position, dt)  # less than asked for where the deviation is bounded
        self.state = MotionState(position, velocity, _mean_rate(before.velocity, velocity, dt))

    def _used(self, dt: float) -> tuple[Joints, Joints]:
        """The references that count during the next step: the mean of what was held ``reference_delay`` before."""
        taken, held = self._taken, _Taken(self._time + dt, self.reference, self.reference_velocity)
        last = taken[-1]
        if last.position == held.position and last.velocity == held.velocity:
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
        return tuple(position), tuple(velocity)


class _Taken(NamedTuple):
    """References that EGM held: until when [s], positions [rad] and speeds [rad/s]."""

    until: float
    position: Joints
    velocity: Joints


_ROUNDING = 1e-9  # [s] of sums of cycles


def _mean_rate(before: Joints, now: Joints, dt: float) -> Joints:
    return tuple([(new - old) / dt for old, new in zip(before, now, strict=True)])
