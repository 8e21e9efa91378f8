"""The motions of one arm: its dynamics, travel, stop and EGM, and the geometry of RAPID's moves.

EGM's controller makes the positions the arm plans from the sensor's references (reference/egm.md §6.1):
``speed = k·(pos_ref - pos) + speed_ref``, where ``pos`` is the position that the robot reports, late by the servo's
delay and lag, and the references are used some time after they were taken. The speed fades in, passes a low-pass filter
and is capped with one factor for all joints; the plan is the integral of that speed. Its parameters come from the
configuration and RAPID's EGM instructions, in SI units and chain order (reference/egm.md §5, §6.3).

What one move instruction describes is a `Leg`: a straight line, a circle or a joint motion, and the corner to the next,
sampled close enough that what lies between two samples follows from them; :mod:`yumi.virtual.mechanics.path` adds the
time. A leg is seen as RAPID sees it: the tool in the work object. A straight line is straight there, also where the
robot holds the work object and the tool stands still.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from math import atan2, ceil, degrees, exp, inf, pi, radians
from typing import NamedTuple, Protocol, cast

import numpy as np
import numpy.ma  # np.unique imports it when called first, 80 ms in the middle of a motion
from numpy.typing import NDArray
from ruckig import ControlInterface, InputParameter, Result, Ruckig, Synchronization, Trajectory

from yumi.errors import CommandRefused, YumiError
from yumi.robot.arms import Arm, Lost, rotation_vectors, rotations_about
from yumi.robot.description import Mass
from yumi.robot.dynamics import HAND
from yumi.robot.joints import CYCLE, YUMI_LIMITS, ZERO, JointLimits, Joints, Pose
from yumi.robot.kinematics import IDENTITY, matrix, quaternion_from_matrix

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


ORIGIN = Pose((0.0, 0.0, 0.0), IDENTITY)
_SAMPLE_LENGTH = 0.004  # between two samples [m]: at a radius of 0.2 m the chord is 0.01 mm off
_SAMPLE_TURN = 0.05  # the same of the tool and of joints [rad]
_MOST_SAMPLES = 500
_CORNER_SAMPLES = 16
_NO_LENGTH = 1e-6  # [m], [rad]
_WRIST_MARGIN = radians(0.1)
_SHORTEST_CHORD = 1e-4  # [m] between the points of a circle


class MotionFault(Enum):
    """Why a motion is refused: ABB's event number and title."""

    OUT_OF_RANGE = (50027, "Joint Out of Range")
    SINGULAR = (50026, "Close to singularity")
    OUT_OF_REACH = (50050, "Position outside reach")
    CIRCLE = (50063, "Circle uncertain")
    CONFIGURATION = (50080, "Position not compatible")


class MotionRefused(YumiError):
    """A motion cannot be planned.

    Attributes:
        fault: why.
    """

    def __init__(self, fault: MotionFault, sentence: str) -> None:
        super().__init__(f"{sentence} ({fault.value[0]})")
        self.fault = fault


@dataclass(frozen=True, slots=True)
class Frames:
    """Which tool moves in which work object.

    Attributes:
        tool: the tool in tool0; where the robot does not hold it, in the world.
        wobj: the work object in the world; where the robot holds it, in tool0.
        robot_holds_tool: whether the tool moves and the work object stands.
    """

    tool: Pose = ORIGIN
    wobj: Pose = ORIGIN
    robot_holds_tool: bool = True

    def tool0(self, points: Array, rotations: Array) -> tuple[Array, Array]:
        """Where tool0 is in the world when the tool is at poses in the object, (n, 3) [m] and (n, 3, 3)."""
        (tool, tool_turn), (wobj, wobj_turn) = _parts(self.tool), _parts(self.wobj)
        if self.robot_holds_tool:
            turned = wobj_turn @ rotations @ tool_turn.T
            return wobj + points @ wobj_turn.T - turned @ tool, turned
        turned = tool_turn @ np.swapaxes(rotations, 1, 2) @ wobj_turn.T
        return tool - (turned @ (wobj + points @ wobj_turn.T)[..., None])[..., 0], turned

    def tip(self, points: Array, rotations: Array) -> tuple[Array, Array]:
        """Where the tool is in the object when tool0 is at poses in the world."""
        (tool, tool_turn), (wobj, wobj_turn) = _parts(self.tool), _parts(self.wobj)
        if self.robot_holds_tool:
            return (points + rotations @ tool - wobj) @ wobj_turn, wobj_turn.T @ rotations @ tool_turn
        back = np.swapaxes(rotations, 1, 2)
        return ((back @ (tool - points)[..., None])[..., 0] - wobj) @ wobj_turn, wobj_turn.T @ back @ tool_turn


def _parts(pose: Pose) -> tuple[Array, Array]:
    return np.array(pose.position), matrix(pose.orientation)


@dataclass(frozen=True, slots=True)
class Speed:
    """How fast a leg is.

    Attributes:
        tool: of the tool's point [m/s].
        turn: of its orientation [rad/s].
        duration: how long the leg takes instead, RAPID's T [s]; 0 where the speeds count.
    """

    tool: float = inf
    turn: float = inf
    duration: float = 0.0


@dataclass(frozen=True, slots=True)
class Zone:
    """How near the tool comes to the end of a leg before it turns to the next one.

    Attributes:
        radius: of the corner about the end [m]; 0 is a stop point.
        turn: where the tool only turns, how far before the end the corner begins [rad].
    """

    radius: float = 0.0
    turn: float = 0.0

    @property
    def is_stop(self) -> bool:
        return self.radius <= 0.0


STOP = Zone()


@dataclass(frozen=True, eq=False, slots=True)
class Piece:
    """A part of the path; where another one follows, its first sample is this one's last.

    Attributes:
        joints: samples [rad], (n, k).
        way: of the tool's point from the first sample [m], (n,).
        turned: of its orientation, likewise [rad], (n,).
        speed: for the intervals between the samples.
    """

    joints: Array
    way: Array
    turned: Array
    speed: Speed

    def part(self, first: int, last: int) -> Piece:
        """The samples from ``first`` to ``last``, both in it."""
        part = slice(first, last + 1)
        return Piece(
            self.joints[part], self.way[part] - self.way[first], self.turned[part] - self.turned[first], self.speed
        )


Place = Callable[[Array], tuple[Array, Array, Array]]
"""Points [m], rotations and arm angles [rad] of the tool in the object, at shares 0 to 1 of a leg, (n,)."""


@dataclass(frozen=True, eq=False, slots=True)
class Leg:
    """A planned move.

    Attributes:
        frames: tool and work object.
        zone: at its end.
        shares: of the samples, 0 to 1, (n,).
        piece: the samples.
        place: where the tool is; None for a motion of the joints.
        into: index of the sample where the corner at its beginning may end.
        out: index of the sample where the corner at its end may begin.
    """

    frames: Frames
    zone: Zone
    shares: Array
    piece: Piece
    place: Place | None
    into: int
    out: int

    @property
    def end(self) -> Joints:
        """Where it ends [rad]."""
        return cast("Joints", tuple(self.piece.joints[-1].tolist()))

    def joints_at(self, shares: Array) -> Array:
        """Joint positions [rad] between the samples, (n, k)."""
        columns = [np.interp(shares, self.shares, column) for column in self.piece.joints.T]
        return np.stack(columns, 1)


def joint_leg(
    arm: Arm, start: Joints, end: Joints, frames: Frames, speed: Speed, zone: Zone, entry: Zone = STOP
) -> Leg:
    """All joints from start to end together: MoveAbsJ and MoveJ.

    Args:
        arm: the arm.
        start: where it begins [rad].
        end: where it ends [rad].
        frames: tool and work object.
        speed: of the tool.
        zone: at its end.
        entry: the zone at its beginning, that of the leg before.

    Raises:
        MotionRefused: a joint would leave its range.
    """
    check_limits(arm, np.array([end]))
    along = np.array(end) - np.array(start)
    coarse = np.linspace(0.0, 1.0, 17)
    way, _ = _distances(arm, np.array(start) + coarse[:, None] * along, frames)
    shares = _shares(float(way[-1]), 0.0, float(np.max(np.abs(along))))
    way, turned = _distances(arm, np.array(start) + shares[:, None] * along, frames)
    begin, leave = _corner_shares(shares, way, turned, entry, zone)
    shares = np.unique(np.concatenate([shares, [begin, leave]]))
    joints = np.array(start) + shares[:, None] * along
    joints[-1] = end
    way, turned = _distances(arm, joints, frames)
    piece = Piece(joints, way, turned, speed)
    into, out = int(np.searchsorted(shares, begin)), int(np.searchsorted(shares, leave))
    return Leg(frames, zone, shares, piece, None, into, out)


def retraced_leg(arm: Arm, joints: Array, frames: Frames, speed: Speed) -> Leg:
    """Through positions that the arm has been at [rad], (n, k), to a stop."""
    way, turned = _distances(arm, joints, frames)
    return Leg(
        frames, STOP, np.linspace(0.0, 1.0, len(joints)), Piece(joints, way, turned, speed), None, 0, len(joints) - 1
    )


def line(start: tuple[Array, Array, float], end: tuple[Array, Array, float]) -> Place:
    """A straight line of the tool's point, with its orientation and the arm angle turning evenly."""
    (point, rotation, angle), (to, to_rotation, to_angle) = start, end
    turn = rotation_vectors((rotation.T @ to_rotation)[None])[0]

    def place(shares: Array) -> tuple[Array, Array, Array]:
        rotations = rotation @ rotations_about(shares[:, None] * turn)
        return point + shares[:, None] * (to - point), rotations, angle + shares * (to_angle - angle)

    return place


def circle(
    start: tuple[Array, Array, float],
    via: tuple[Array, Array],
    end: tuple[Array, Array, float],
    mode: CircleMode,
) -> Place:
    """An arc of the tool's point from start through ``via`` to end.

    Raises:
        MotionRefused: the three points are too close together, or in a line.
    """
    (first, rotation, angle), (middle, via_rotation), (last, to_rotation, to_angle) = start, via, end
    a, b = middle - first, last - first
    if min(float(np.linalg.norm(each)) for each in (a, b, last - middle)) < _SHORTEST_CHORD:
        raise MotionRefused(
            MotionFault.CIRCLE, "MoveC: two of the circle's three points are in one place. Move them apart."
        )
    normal = np.cross(a, b)
    size = float(np.linalg.norm(normal))
    if size < 1e-4 * float(np.linalg.norm(a)) * float(np.linalg.norm(b)):
        raise MotionRefused(
            MotionFault.CIRCLE, "MoveC: the circle's three points are in a line. Use MoveL, or move one."
        )
    normal = normal / size
    # The centre is as far from all three points.
    centre = first + (np.dot(b, b) * np.cross(np.cross(a, b), a) + np.dot(a, a) * np.cross(b, np.cross(a, b))) / (
        2.0 * size * size
    )
    x = first - centre
    y = np.cross(normal, x)
    sweep = atan2(float(y @ (last - centre)), float(x @ (last - centre))) % (2.0 * pi)
    at_via = atan2(float(y @ (middle - centre)), float(x @ (middle - centre))) % (2.0 * pi)

    if mode is CircleMode.POINT:
        turn_to_via = rotation_vectors((rotation.T @ via_rotation)[None])[0]
        turn_to_end = rotation_vectors((via_rotation.T @ to_rotation)[None])[0]
        share_of_via = at_via / sweep
    relative_end = to_rotation
    if mode is CircleMode.PATH:
        relative_end = rotations_about(-sweep * normal[None])[0] @ to_rotation
    turn = rotation_vectors((rotation.T @ relative_end)[None])[0]
    if mode is CircleMode.PATH:  # as the tool turns in the object on the shortest way, beside its turn with the path
        own = rotation_vectors((rotation.T @ to_rotation)[None])[0]
        turn = _with_turns(turn, own - sweep * (rotation.T @ normal))

    def place(shares: Array) -> tuple[Array, Array, Array]:
        angles = shares[:, None] * sweep
        points = centre + np.cos(angles) * x + np.sin(angles) * y
        if mode is CircleMode.POINT:
            to_via = rotation @ rotations_about(np.minimum(shares / share_of_via, 1.0)[:, None] * turn_to_via)
            rest = np.maximum((shares - share_of_via) / (1.0 - share_of_via), 0.0)
            rotations = to_via @ rotations_about(rest[:, None] * turn_to_end)
        else:
            rotations = rotation @ rotations_about(shares[:, None] * turn)
            if mode is CircleMode.PATH:
                rotations = rotations_about(angles * normal) @ rotations
        return points, rotations, angle + shares * (to_angle - angle)

    return place


def _with_turns(vector: Array, near: Array) -> Array:
    """The rotation vector of the same rotation, with as many whole turns as bring it near another one [rad]."""
    angle = float(np.linalg.norm(vector))
    axis = vector / angle if angle > _NO_LENGTH else near / max(float(np.linalg.norm(near)), _NO_LENGTH)
    turns = round((float(near @ axis) - angle) / (2.0 * pi))
    return np.asarray(vector + axis * (turns * 2.0 * pi))


class CircleMode(Enum):
    """How the tool turns on a circle (CirPathMode): with the path, evenly in the object, or through the via point."""

    PATH = "PathFrame"
    OBJECT = "ObjectFrame"
    POINT = "CirPointOri"


def tool_leg(
    arm: Arm,
    start: Joints,
    place: Place,
    frames: Frames,
    speed: Speed,
    zone: Zone,
    entry: Zone = STOP,
    *,
    passes_wrist: bool = False,
) -> Leg:
    """The tool along a line or circle: MoveL and MoveC; arguments as of `joint_leg`.

    It may pass an aligned wrist with ``passes_wrist`` (SingArea Wrist).

    Raises:
        MotionRefused: the path leaves the reach or the range of a joint, or goes through a singularity.
    """
    points, rotations, _ = place(np.linspace(0.0, 1.0, 33))
    length = float(np.sum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    shares = _shares(length, float(np.sum(_turns(rotations))), 0.0)
    points, rotations, _ = place(shares)
    way, turned = _cumulated(np.linalg.norm(np.diff(points, axis=0), axis=1)), _cumulated(_turns(rotations))
    begin, leave = _corner_shares(shares, way, turned, entry, zone)
    shares = np.unique(np.concatenate([shares, [begin, leave]]))
    points, rotations, angles = place(shares)
    joints = followed(arm, points, rotations, angles, frames, start)
    if arm.wrist is not None and not passes_wrist and _is_aligned(joints[:, arm.wrist]):
        sentence = f"The path of the {arm.name} passes axis {arm.axes[arm.wrist]} at 0°. Use MoveJ, or SingArea\\Wrist."
        raise MotionRefused(MotionFault.SINGULAR, sentence)
    way, turned = _cumulated(np.linalg.norm(np.diff(points, axis=0), axis=1)), _cumulated(_turns(rotations))
    into, out = int(np.searchsorted(shares, begin)), int(np.searchsorted(shares, leave))
    return Leg(frames, zone, shares, Piece(joints, way, turned, speed), place, into, out)


def corner(arm: Arm, before: Leg, after: Leg) -> Piece:
    """From where the zone at the end of a leg begins to where it ends on the next leg: C1, inside the zone.

    Both legs are passed slower and slower towards the corner point, the second one backwards, and added: of two lines
    that is a parabola.

    Raises:
        MotionRefused: as of `tool_leg`.
    """
    out, into = float(before.shares[before.out]), float(after.shares[after.into])
    span = float(before.piece.way[-1] - before.piece.way[before.out] + after.piece.way[after.into])
    count = max(_CORNER_SAMPLES, min(_MOST_SAMPLES, ceil(span / _SAMPLE_LENGTH)))
    time = np.linspace(0.0, 1.0, count + 1)
    first, second = 1.0 - (1.0 - out) * (1.0 - time) ** 2, into * time**2
    if before.place is not None and after.place is not None and before.frames == after.frames:
        (points, rotations, angles), (to, to_rotations, to_angles) = before.place(first), after.place(second)
        points = points + to - to[0]
        rotations = rotations @ to_rotations[0].T @ to_rotations
        seed = cast("Joints", tuple(before.piece.joints[before.out].tolist()))
        joints = followed(arm, points, rotations, angles + to_angles - to_angles[0], after.frames, seed)
        way, turned = _cumulated(np.linalg.norm(np.diff(points, axis=0), axis=1)), _cumulated(_turns(rotations))
    else:
        joints = before.joints_at(first) + after.joints_at(second) - after.piece.joints[0]
        check_limits(arm, joints)
        way, turned = _distances(arm, joints, after.frames)
    joints[0], joints[-1] = before.piece.joints[before.out], after.piece.joints[after.into]
    return Piece(joints, way, turned, before.piece.speed)


def followed(arm: Arm, points: Array, rotations: Array, angles: Array, frames: Frames, start: Joints) -> Array:
    """Joint positions [rad], (n, k), on a path of the tool.

    Raises:
        MotionRefused: as of `tool_leg`.
    """
    at, turned = frames.tool0(points, rotations)
    try:
        joints = arm.follow(at, turned, angles, start)
    except Lost as lost:
        x, y, z = at[lost.index].tolist()
        pose = Pose((x, y, z), quaternion_from_matrix(turned[lost.index]))
        where = f"[{x * 1e3:.1f}, {y * 1e3:.1f}, {z * 1e3:.1f}] mm (tool0 in the base frame)"
        if arm.postures(pose, float(angles[lost.index])):
            sentence = f"The path of the {arm.name} passes a singularity near {where}. Use MoveJ, or another target."
            raise MotionRefused(MotionFault.SINGULAR, sentence) from lost
        sentence = f"The {arm.name} does not reach {where}. Choose a target within reach."
        raise MotionRefused(MotionFault.OUT_OF_REACH, sentence) from lost
    check_limits(arm, joints)
    return joints


def _is_aligned(wrist: Array) -> bool:
    """Whether a wrist's middle axis [rad] comes to zero or changes its sign."""
    return bool(np.min(np.abs(wrist)) < _WRIST_MARGIN or np.any(wrist[:-1] * wrist[1:] < 0.0))


def check_limits(arm: Arm, joints: Array) -> None:
    """Raise MotionRefused where a sample, (n, k), is out of the joints' range."""
    lower, upper = np.array(arm.limits.lower), np.array(arm.limits.upper)
    beyond = np.maximum(lower - joints, joints - upper)
    if float(beyond.max()) <= 1e-6:
        return
    sample, index = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    raise MotionRefused(
        MotionFault.OUT_OF_RANGE,
        f"Axis {arm.axes[index]} of the {arm.name} cannot move to {degrees(joints[sample, index]):.2f}°: its range is "
        f"{arm.limits.range_deg(int(index))}.",
    )


def _shares(length: float, turn: float, joint_turn: float) -> Array:
    count = ceil(max(length / _SAMPLE_LENGTH, turn / _SAMPLE_TURN, joint_turn / _SAMPLE_TURN))
    return np.linspace(0.0, 1.0, max(4, min(_MOST_SAMPLES, count)) + 1)


def _corner_shares(shares: Array, way: Array, turned: Array, entry: Zone, zone: Zone) -> tuple[float, float]:
    """Where the corner at the beginning ends, and where that at the end begins; each has half the leg at most."""
    by_way = float(way[-1]) > _NO_LENGTH
    measure = way if by_way else turned
    total = float(measure[-1])
    if total <= _NO_LENGTH:
        return 0.0, 1.0
    begin, leave = (min(each.radius if by_way else each.turn, total / 2.0) for each in (entry, zone))
    return float(np.interp(begin, measure, shares)), float(np.interp(total - leave, measure, shares))


def _distances(arm: Arm, joints: Array, frames: Frames) -> tuple[Array, Array]:
    """Way [m] and turn [rad] of the tool from the first of joint positions on, (n,) each."""
    points, rotations = frames.tip(*arm.forward(joints))
    return _cumulated(np.linalg.norm(np.diff(points, axis=0), axis=1)), _cumulated(_turns(rotations))


def _turns(rotations: Array) -> Array:
    return np.asarray(np.linalg.norm(rotation_vectors(np.swapaxes(rotations[:-1], 1, 2) @ rotations[1:]), axis=1))


def _cumulated(steps: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(steps)])
