"""One arm of the virtual robot: a planned motion, a servo that follows it, motors and brakes.

The arm angle: how far the elbow is turned about the line from shoulder to wrist, ``eax_a`` of a robtarget.

The load on the drives of one arm: the torque that EGM's references need, and whether the drives can give it.

The real controller stops with event 50375 when a reference needs too much torque of a joint; how it measures is not
published. Here the mean of the torque over some tens of milliseconds counts, since a reference is made of steps of
speed, one per cycle, which the servo smooths.

What one arm of the virtual robot can do: the numbers of its servo, its drives and its brakes.

The motions an arm can be in besides EGM: standing still, travelling to a target, coming to a stop.

The servo of one arm: a first-order lag and a transport delay between planned and measured positions.

EGM's control law: from the sensor's references to the positions the arm plans (reference/egm.md §6.1).

``speed = k·(pos_ref - pos) + speed_ref``, where ``pos`` is EGM's own reference, the integral of that speed. The
speed fades in, passes a low-pass filter and is capped with one scale for all joints.

What RAPID tells EGM before it runs, in SI units and chain order (reference/egm.md §5, §6.3).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise
from math import acos, atan2, degrees, dist, exp, expm1, pi, radians, sqrt
from typing import Protocol, cast

from ruckig import ControlInterface, InputParameter, Result, Ruckig, Synchronization, Trajectory

from yumi.errors import CommandRefused, RobotNotReady
from yumi.robot.description import Mass
from yumi.robot.dynamics import HAND, ArmDynamics
from yumi.robot.joints import (
    CYCLE,
    JOINT_COUNT,
    YUMI_LIMITS,
    ZERO,
    JointLimits,
    Joints,
    Pose,
    Quaternion,
    Side,
    Vector,
    home,
    joint_names,
)
from yumi.robot.kinematics import foot_to_body, multiply, rotate, tool0_to_body


@dataclass(frozen=True, slots=True)
class ArmModel:
    """The dynamics of one arm; see reference/egm.md §6.5 for what is documented and what is a model.

    Attributes:
        limits: positions and speeds the joints can have; accelerations and jerks of RAPID motions.
        delay: pure delay from the planned to the measured position [s]; larger means a later answer.
        lag: time constant of the servo behind the delay [s]; larger means corners are rounded more.
        filtering_delay: what EGM's level 1 (filtering) adds to the delay [s].
        brake_deceleration: how hard the brakes stop every joint [rad/s²].
        step: longest time the arm moves at one planned speed, EGM's own cycle [s].
        supervises_load: whether EGM references that need too much torque stop the robot (50375).
        torque: what the drives can give at the joints [N m], (7,).
        torque_time: how long they may be asked for more: the time constant of the mean that is supervised [s];
            as long as the servo's lag, which is what smooths a step of the reference.
        payload: what hangs on tool0, seen from tool0; None is a bare flange.
    """

    limits: JointLimits = YUMI_LIMITS
    delay: float = 0.016
    lag: float = 0.010
    filtering_delay: float = 0.016
    brake_deceleration: float = 60.0
    step: float = CYCLE
    supervises_load: bool = True
    # ABB publishes no torques. These are of the order of strain-wave gears of the joints' sizes: a tenth more than any
    # motion within the limits can need, all joints at once in the worst pose with 0.5 kg in the hand; and less than
    # what a step of several joints asks for at full-speed settings.
    torque: Joints = (72.0, 72.0, 36.0, 36.0, 6.0, 6.0, 6.0)
    torque_time: float = 0.010
    payload: Mass | None = HAND


@dataclass(frozen=True, slots=True)
class MotionState:
    """Planned positions [rad], speeds [rad/s] and accelerations [rad/s²] of the joints, each (7,)."""

    position: Joints
    velocity: Joints = ZERO
    acceleration: Joints = ZERO


class Motion(Protocol):
    """What the arm plans from one moment to the next."""

    @property
    def state(self) -> MotionState: ...

    @property
    def is_finished(self) -> bool:
        """Whether the motion has come to its end and stands still."""

    def advance(self, dt: float) -> None:
        """Go on by ``dt`` [s] > 0."""


class Standstill:
    """The arm stays where it is."""

    is_finished = True

    def __init__(self, position: Joints) -> None:
        self.state = MotionState(position)

    def advance(self, dt: float) -> None: ...


class JerkLimitedMotion:
    """A trajectory that is known from its first moment, however time advances along it.

    Args:
        trajectory: the whole way, ending at standstill.
        target: where it ends exactly; without one, where the trajectory says.
    """

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
            return MotionState(self._target or _fixed(position))
        return MotionState(_fixed(position), _fixed(velocity), _fixed(acceleration))


def travel(start: MotionState, target: Joints, model: ArmModel, duration: float = 0.0) -> JerkLimitedMotion:
    """A straight way in joint space to ``target`` [rad], all joints arriving together.

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
    plan = _plan(MotionState(start.position, start.velocity), model)
    plan.control_interface = ControlInterface.Velocity
    plan.max_acceleration = [model.brake_deceleration] * JOINT_COUNT
    plan.max_jerk = [model.brake_deceleration / 1e-3] * JOINT_COUNT  # brakes bite within a millisecond
    return JerkLimitedMotion(_trajectory(plan))


def _plan(start: MotionState, model: ArmModel) -> InputParameter:
    plan = InputParameter(JOINT_COUNT)
    plan.current_position, plan.current_velocity = start.position, start.velocity
    plan.current_acceleration = [
        max(-most, min(most, value)) for value, most in zip(start.acceleration, model.limits.acceleration, strict=True)
    ]
    return plan


def _trajectory(plan: InputParameter, duration: float = 0.0) -> Trajectory:
    if duration > 0.0:
        plan.minimum_duration = duration
    trajectory = Trajectory(JOINT_COUNT)
    result = Ruckig(JOINT_COUNT).calculate(plan, trajectory)
    if result not in (Result.Working, Result.Finished):
        raise CommandRefused(f"No motion leads from {plan.current_position} to standstill within the limits: {result}.")
    return trajectory


def _fixed(values: Sequence[float]) -> Joints:
    return cast("Joints", tuple(values))


@dataclass(frozen=True, slots=True)
class Overload:
    """A joint whose reference needs more than its drive can give.

    Attributes:
        joint: its index in chain order.
        torque: mean torque it would need [N m].
        limit: what the drive can give [N m].
    """

    joint: int
    torque: float
    limit: float


class LoadSupervision:
    """Watches what a guided motion asks of the drives.

    Args:
        side: the arm.
        model: its payload and the torque of its drives.
        position: where it stands [rad], (7,); the drives hold it there.
    """

    def __init__(self, side: Side, model: ArmModel, position: Joints) -> None:
        self._dynamics = ArmDynamics(side, model.payload)
        self._model = model
        self.torque = self._dynamics.torque(position)

    def advance(self, state: MotionState, dt: float) -> Overload | None:
        """Take in what the arm was asked to do during ``dt`` [s]; the joint that is overloaded by it, or None."""
        needed = self._dynamics.torque(state.position, state.velocity, state.acceleration)
        share = 1.0 - exp(-dt / self._model.torque_time)
        mean = tuple(old + (new - old) * share for old, new in zip(self.torque, needed, strict=True))
        self.torque = cast("Joints", mean)
        loads = [abs(torque) / limit for torque, limit in zip(self.torque, self._model.torque, strict=True)]
        if max(loads) <= 1.0:
            return None
        joint = loads.index(max(loads))
        return Overload(joint, abs(self.torque[joint]), self._model.torque[joint])


_SLEWING = 0.5  # how fast the delay may change [s/s]: below 1, so the past never runs backwards


class Servo:
    """Follows the planned position late and smoothly; exact for a plan that is straight within each step.

    Args:
        position: where the arm stands [rad], (7,).
        model: its delay and lag.
    """

    def __init__(self, position: Joints, model: ArmModel) -> None:
        self._model = model
        self._planned = position
        self._lagged = position
        self._time = 0.0
        self._delay = model.delay
        self._past = deque([(0.0, position)])
        self.wanted_delay = model.delay
        self.position = position

    def advance(self, planned: Joints, dt: float) -> None:
        """Follow the plan on its straight way to ``planned`` [rad] for ``dt`` [s] > 0."""
        self._lagged = self._follow(planned, dt)
        self._planned = planned
        self._time += dt
        self._past.append((self._time, self._lagged))
        change = self.wanted_delay - self._delay
        self._delay += max(-_SLEWING * dt, min(_SLEWING * dt, change))
        self.position = self._at(self._time - self._delay)

    def _follow(self, planned: Joints, dt: float) -> Joints:
        """The lag's exact answer to a ramp from the last plan to this one."""
        lag, left = self._model.lag, exp(-dt / self._model.lag) if self._model.lag > 0.0 else 0.0
        ramp = lag / dt
        # Per joint: u - a·τ + (y - u_before + a·τ)·e^(-dt/τ) with the slope a = (u - u_before)/dt.
        answer = tuple(
            now - (now - before) * ramp + (lagged - before + (now - before) * ramp) * left
            for now, before, lagged in zip(planned, self._planned, self._lagged, strict=True)
        )
        return cast("Joints", answer)

    def _at(self, time: float) -> Joints:
        past = self._past
        while len(past) > 1 and past[1][0] <= time:
            past.popleft()
        start, before = past[0]
        if time <= start or len(past) == 1:
            return before
        end, after = past[1]
        share = (time - start) / (end - start)
        between = tuple(a + (b - a) * share for a, b in zip(before, after, strict=True))
        return cast("Joints", between)


Band = tuple[float, float]
"""``egm_minmax``: lowest and highest difference from the ordered position that counts as arrived [rad]."""

Bands = tuple[Band, Band, Band, Band, Band, Band, Band]
Axes = tuple[bool, bool, bool, bool, bool, bool, bool]
ALL_AXES: Axes = (True, True, True, True, True, True, True)


class StopMode(Enum):
    """``egmstopmode``: what the arm does when EGM ends."""

    HOLD = 0
    RAMP_DOWN = 1


def same_band(low: float, high: float) -> Bands:
    """One convergence band [rad] for all seven joints."""
    band = (low, high)
    return (band, band, band, band, band, band, band)


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
        cond_min_max: convergence band of each joint [rad], (7,) in chain order.
        lp_filter: low-pass bandwidth [Hz]; 0 switches it off, None takes the configured one.
        sample_rate_ms: period of the datagrams in multiples of 4 ms, which stand for cycles of 4.032 ms.
        max_pos_deviation: how far any joint may go from where EGM started [rad].
        max_speed_deviation: highest joint speed EGM may ask for [rad/s].
    """

    tool: Pose | None = None
    wobj: Pose | None = None
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
        pos_corr_gain: share of the position gain in use; 0 is pure velocity control.
        is_waited: whether RAPID waits for the end; False with NoWaitCond, when a silent sensor stops the program.
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
    """What the control law needs of all that.

    Attributes:
        gain: k of the law, PosCorrGain times the default position gain [1/s].
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


def law_settings(data: ExternalMotionData, activation: EgmActivation, run: EgmRun) -> EgmSettings:
    """Join configuration, activation and run into the settings of the control law."""
    bandwidth = data.bandwidth if activation.lp_filter is None else activation.lp_filter
    return EgmSettings(
        gain=run.pos_corr_gain * data.position_gain,
        bandwidth=bandwidth,
        ramp_in_time=run.ramp_in_time,
        max_speed=activation.max_speed_deviation,
        max_deviation=activation.max_pos_deviation,
        level=data.level,
    )


class EgmMotion:
    """The motion of an arm that EGM guides; each part of the law is exact for references held during a step.

    Args:
        position: where the arm stands [rad], (7,); the reference until the sensor gives one.
        settings: of the law.
        limits: whose speeds cap the joints beside MaxSpeedDeviation.

    Attributes:
        reference: position last ordered [rad], (7,).
        reference_velocity: speed last fed forward [rad/s], (7,).
        utilization: share of the allowed speed that the references ask for; above 1 the motion is slowed.
    """

    is_finished = False

    def __init__(self, position: Joints, settings: EgmSettings, limits: JointLimits) -> None:
        self._settings = settings
        self._start = position
        self._caps = tuple(min(settings.max_speed, most) for most in limits.velocity)
        self._filtered = ZERO
        self._time = 0.0
        self.reference = position
        self.reference_velocity = ZERO
        self.utilization = 0.0
        self.state = MotionState(position)

    @property
    def start(self) -> Joints:
        """Where EGM began [rad], (7,)."""
        return self._start

    def advance(self, dt: float) -> None:
        self._filtered = self._low_pass(self._wanted_speed(self._fade(dt), dt), dt)
        before, position = self.state, self._moved(self._capped(self._filtered), dt)
        velocity = _rate(before.position, position, dt)  # less than the law's where the deviation is bounded
        self.state = MotionState(position, velocity, _rate(before.velocity, velocity, dt))

    def _fade(self, dt: float) -> float:
        """Mean of the linear ramp-in over the step; afterwards 1."""
        begin, self._time = self._time, self._time + dt
        ramp = self._settings.ramp_in_time
        if begin >= ramp:
            return 1.0
        faded_in = min(self._time, ramp)
        return (faded_in * faded_in - begin * begin) / (2.0 * ramp * dt) + (self._time - faded_in) / dt

    def _wanted_speed(self, fade: float, dt: float) -> Joints:
        gain = self._settings.gain * fade
        # The law closes in exponentially: its mean speed over the step is below that at the start.
        closing = -expm1(-gain * dt) / (gain * dt) if gain > 0.0 else 1.0
        position_share, speed_share = gain * closing, fade * closing
        speed = tuple(
            position_share * (reference - position) + speed_share * velocity
            for reference, position, velocity in zip(
                self.reference, self.state.position, self.reference_velocity, strict=True
            )
        )
        return cast("Joints", speed)

    def _low_pass(self, speed: Joints, dt: float) -> Joints:
        bandwidth = self._settings.bandwidth
        if bandwidth <= 0.0:
            return speed
        share = 1.0 - exp(-2.0 * pi * bandwidth * dt)
        return cast("Joints", tuple(f + (s - f) * share for f, s in zip(self._filtered, speed, strict=True)))

    def _capped(self, speed: Joints) -> Joints:
        """One scale for all joints, so that the direction stays."""
        self.utilization = max(abs(value) / cap for value, cap in zip(speed, self._caps, strict=True))
        if self.utilization <= 1.0:
            return speed
        return cast("Joints", tuple(value / self.utilization for value in speed))

    def _moved(self, speed: Joints, dt: float) -> Joints:
        reach = self._settings.max_deviation
        position = tuple(
            max(start - reach, min(start + reach, now + value * dt))
            for start, now, value in zip(self._start, self.state.position, speed, strict=True)
        )
        return cast("Joints", position)


def _rate(before: Joints, now: Joints, dt: float) -> Joints:
    return cast("Joints", tuple((new - old) / dt for old, new in zip(before, now, strict=True)))


IN_POSITION = 1e-5
"""Difference of planned and measured position at which the arm counts as standing [rad]."""

_WAYPOINTS = 32  # how finely the length of the tool's way is measured


class VirtualArm:
    """One arm, motors off at first.

    Args:
        side: the arm.
        position: where it stands [rad], (7,), chain order; home when left out.
        model: its dynamics.

    Attributes:
        overload: the joint of which EGM has asked too much since it began; None as long as the load is bearable.
    """

    def __init__(self, side: Side, position: Joints | None = None, model: ArmModel | None = None) -> None:
        self.side = side
        self.model = model or ArmModel()
        self._motors_on = False
        self._motion: Motion = Standstill(position or home(side))
        self._servo = Servo(self.planned, self.model)
        self._load: LoadSupervision | None = None
        self.overload: Overload | None = None

    @property
    def position(self) -> Joints:
        """Measured joint positions, chain order [rad], (7,)."""
        return self._servo.position

    @property
    def planned(self) -> Joints:
        """Joint positions the controller plans, chain order [rad], (7,); EGM's reference while EGM guides."""
        return self._motion.state.position

    @property
    def velocity(self) -> Joints:
        """Planned joint speeds, chain order [rad/s], (7,)."""
        return self._motion.state.velocity

    @property
    def motors_on(self) -> bool:
        return self._motors_on

    @property
    def reaction_time(self) -> float:
        """How much later than planned the arm is where it was planned to be [s]."""
        return self._servo.wanted_delay + self.model.lag

    @property
    def is_stationary(self) -> bool:
        """Whether no motion is under way and the arm has settled (a RAPID fine point)."""
        return self._motion.is_finished and all(
            abs(a - b) < IN_POSITION for a, b in zip(self.planned, self.position, strict=True)
        )

    @property
    def egm(self) -> EgmMotion | None:
        """The motion EGM guides, or None."""
        return self._motion if isinstance(self._motion, EgmMotion) else None

    def advance(self, dt: float) -> None:
        """Let ``dt`` [s] pass; any length, the arm divides it into its own steps."""
        steps = max(1, -int(-dt // self.model.step)) if dt > 0.0 else 0
        for _ in range(steps):
            self._motion.advance(dt / steps)
            self._servo.advance(self.planned, dt / steps)
            self._supervise_load(dt / steps)

    def switch_motors_on(self) -> None:
        self._motors_on = True

    def switch_motors_off(self) -> None:
        """The brakes stop the arm, whatever it was doing, and hold it."""
        self._motors_on = False
        if not self._motion.is_finished:
            self._motion = braking(self._motion.state, self.model)

    def move_to(
        self,
        target: Joints,
        *,
        tool_speed: float = float("inf"),
        turn_speed: float = float("inf"),
        duration: float = 0.0,
        tool: Pose | None = None,
    ) -> None:
        """Begin a jerk-limited motion to ``target`` (RAPID MoveAbsJ); it ends when :attr:`is_stationary`.

        Args:
            target: joint positions, chain order [rad], (7,).
            tool_speed: mean speed of the tool's point, ``speeddata.v_tcp`` [m/s].
            turn_speed: mean speed of its orientation, ``speeddata.v_ori`` [rad/s].
            duration: shortest time the motion takes, RAPID's optional argument T [s].
            tool: tool frame in tool0 whose speed is meant; None is tool0.

        Raises:
            CommandRefused: the target is out of the joints' range.
            RobotNotReady: the motors are off, or EGM guides the arm.
        """
        self._check_ready()
        self._check_range(target)
        if self._motion.is_finished and target == self.planned and duration <= 0.0:
            return  # there already: a program that says so in a loop must not cost a plan each time
        length, turn = self._tool_way(target, tool)
        shortest = max(duration, length / tool_speed, turn / turn_speed)
        self._motion = travel(self._motion.state, target, self.model, shortest)

    def stop(self) -> None:
        """Decelerate any motion to standstill as fast as the drives allow, and hold."""
        if not self._motion.is_finished:
            self._motion = stopping(self._motion.state, self.model)

    def start_egm(self, settings: EgmSettings) -> None:
        """Let EGM guide the arm from where it is planned to be.

        Raises:
            RobotNotReady: the motors are off, or EGM guides the arm already.
        """
        self._check_ready()
        extra = self.model.filtering_delay if settings.level > 0 else 0.0
        self._servo.wanted_delay = self.model.delay + extra
        self._motion = EgmMotion(self.planned, settings, self.model.limits)
        self.overload = None
        if self.model.supervises_load:
            self._load = LoadSupervision(self.side, self.model, self.planned)

    def set_reference(self, position: Joints | None, velocity: Joints | None) -> None:
        """Order what EGM shall reach: None keeps the last position, and means no speed [rad], [rad/s], (7,).

        Raises:
            RobotNotReady: EGM does not move the arm.
        """
        egm = self.egm
        if egm is None:
            raise RobotNotReady(f"EGM does not move the {self.side.word} arm: start EGM first.")
        if position is not None:
            egm.reference = position
        egm.reference_velocity = ZERO if velocity is None else velocity

    def stop_egm(self, ramp_time: float = 0.0, *, returns_to_start: bool = False) -> None:
        """End EGM: come to a stop over ``ramp_time`` [s] and hold, or go back to where EGM started.

        The way back takes longer than ``ramp_time`` where the arm's limits ask for it, as on the real
        controller (event 50446).
        """
        egm = self.egm
        if egm is None:
            return
        # Without EGM's acceleration, which is that of single steps of speed.
        state = MotionState(egm.state.position, egm.state.velocity)
        if returns_to_start:
            self._motion = travel(state, egm.start, self.model, ramp_time)
        else:
            self._motion = stopping(state, self.model, ramp_time)

    def _supervise_load(self, dt: float) -> None:
        """Only references from outside are supervised: the controller plans its own motions within the limits."""
        egm = self.egm
        if egm is not None and self._load is not None and self.overload is None:
            self.overload = self._load.advance(egm.state, dt)

    def _check_ready(self) -> None:
        if not self._motors_on:
            raise RobotNotReady(f"The motors of the {self.side.word} arm are off: switch them on first.")
        if self.egm is not None:
            raise RobotNotReady(f"EGM moves the {self.side.word} arm: end EGM before other motions (50453).")

    def _check_range(self, target: Joints) -> None:
        index = self.model.limits.outside(target)
        if index is not None:
            name, range_deg = joint_names(self.side)[index], self.model.limits.range_deg(index)
            raise CommandRefused(f"{name} cannot move to {target[index]:.4f} rad: its range is {range_deg} (50027).")

    def _tool_way(self, target: Joints, tool: Pose | None) -> tuple[float, float]:
        """Length [m] and turn [rad] of the tool's way when all joints move in proportion."""
        start = self.planned
        poses = [
            tool0_to_body(self.side, _between(start, target, index / _WAYPOINTS), tool)
            for index in range(_WAYPOINTS + 1)
        ]
        pairs = list(pairwise(poses))
        length = sum(dist(a.position, b.position) for a, b in pairs)
        return length, sum(_angle(a, b) for a, b in pairs)


def _between(start: Joints, target: Joints, share: float) -> Joints:
    a, b, c, d, e, f, g = (x + (y - x) * share for x, y in zip(start, target, strict=True))
    return (a, b, c, d, e, f, g)


def _angle(a: Pose, b: Pose) -> float:
    product = abs(sum(x * y for x, y in zip(a.orientation, b.orientation, strict=True)))
    return 2.0 * acos(min(1.0, product))


_SHOULDER_HEIGHT = 0.166
_WRIST_TO_TOOL0 = 0.036


def arm_angle(side: Side, position: Joints) -> float:
    """Arm angle [rad] at joint positions [rad], between -pi and pi (reference/yumi.md §5.2)."""
    foot, tool0 = foot_to_body(side), tool0_to_body(side, position)
    shoulder = _sum(foot.position, rotate(foot.orientation, (0.0, 0.0, _SHOULDER_HEIGHT)))
    wrist = _sum(tool0.position, rotate(tool0.orientation, (0.0, 0.0, -_WRIST_TO_TOOL0)))
    line = _unit(_difference(wrist, shoulder))
    across = (0.0, 1.0 if side is Side.RIGHT else -1.0, 0.0)
    y_axis = _unit(_cross(line, across))
    x_axis = _cross(y_axis, line)
    elbow = _elbow_axis(side, position)
    angle = atan2(_dot(y_axis, elbow), _dot(x_axis, elbow)) + pi / 2.0
    return angle - 2.0 * pi if angle > pi else angle


def arm_angle_deg(side: Side, position: Joints) -> float:
    """Arm angle as RAPID writes it [deg], at joint positions [rad]."""
    return degrees(arm_angle(side, position))


def _elbow_axis(side: Side, position: Joints) -> Vector:
    """Direction of the elbow's axis in the body frame: a quarter turn of that joint turns the tool about it."""
    a1, a2, a7, a3, a4, a5, a6 = position
    before = tool0_to_body(side, position).orientation
    after = tool0_to_body(side, (a1, a2, a7, a3 + pi / 2.0, a4, a5, a6)).orientation
    w, x, y, z = multiply(after, _conjugate(before))
    # A quaternion and its negative are the same turn; the one with a positive scalar part turns by +90 degrees.
    return _unit((x, y, z) if w > 0.0 else (-x, -y, -z))


def _conjugate(rotation: Quaternion) -> Quaternion:
    w, x, y, z = rotation
    return (w, -x, -y, -z)


def _sum(a: Vector, b: Vector) -> Vector:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def _difference(a: Vector, b: Vector) -> Vector:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Vector, b: Vector) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _unit(vector: Vector) -> Vector:
    length = sqrt(_dot(vector, vector))
    return (vector[0] / length, vector[1] / length, vector[2] / length)
