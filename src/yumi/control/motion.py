"""One step of the online trajectory generator Ruckig, which raises where its documentation returns a result.

Bounds a speed that is fed forward, by what the robot makes of it together with its position reference.

A robot in EGM moves at ``k · (position reference - planned position) + speed reference``. Each of the two may be
within the limits and their sum not: a position that runs ahead already asks for a speed. So the sum is what is kept
within the joints' velocity, acceleration and jerk, and able to stop before the end of their ranges; a sum that is
smooth passes unchanged.

Motions to a single point, planned online: jerk-limited, all joints together, from whatever the joints do now.

A plan is calculated once, by the online trajectory generator Ruckig, and then only looked up by its time.

A motion by speeds: positions that move along with them, so that it works whatever the robot's position gain is.

With PosCorrGain 1 the robot closes its position loop around the position that moves along, and finds nothing to close;
with PosCorrGain 0 it heeds the speeds alone.

How to take over an arm that moves: hold it until it stands.

Controllers lead an arm by different laws: the command of one runs ahead of the arm, that of another is where the arm
shall be now and has its speed beside it. Either is no place for the other to go on from; standstill is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import copysign, inf, sqrt
from typing import Any, NamedTuple, cast

from ruckig import (
    ControlInterface,
    InputParameter,
    OutputParameter,
    Result,
    Ruckig,
    RuckigError,
    Synchronization,
    Trajectory,
)

from yumi.errors import CommandRefused
from yumi.robot.joints import CHAIN_AXES, CYCLE, JOINT_COUNT, ZERO, ArmCommand, ArmState, JointLimits, Joints, joints


def take_step(generator: Ruckig, given: InputParameter, output: OutputParameter, dt: float) -> bool:
    """Write to ``output`` where the joints are after ``dt`` [s]; tells whether a way was found.

    It cannot always be, at speeds of a few degrees a second.
    """
    generator.delta_time = dt
    try:
        return generator.update(given, output) in (Result.Working, Result.Finished)
    except (RuckigError, ValueError):  # the latter for results that its Python side does not know
        generator.reset()
        return False


EGM_GAIN = 5.0
"""Gain of the robot's own position loop, at which a command's lead becomes speed [1/s] (reference/egm.md §6.1)."""

_ROUNDING = 1.0 + 1e-3  # a speed at a limit is not refused for the last digits of the planned position
_UNEXPECTED = 0.02  # [rad] a plan further from where it was led to than the robot's own cap on speeds explains
_REST = 1e-6  # [rad/s] slower than this, in two cycles one after the other, is no motion


class FeedForward:
    """The speeds fed forward to one arm so far, and the speeds the arm has by now.

    Args:
        limits: what the joints may do.
        gain: of the robot's position loop [1/s]; 0 where it follows speeds only.

    Attributes:
        velocity: the speed admitted last [rad/s], (7,).
        is_bounded: whether less was admitted than was wanted.
    """

    def __init__(self, limits: JointLimits, gain: float = EGM_GAIN) -> None:
        self.velocity: Joints = ZERO
        self.is_bounded = False
        self._gain = gain
        self._limits = limits
        self._is_feeding = False
        self._speeds = [0.0] * JOINT_COUNT
        self._rates = [0.0] * JOINT_COUNT
        self._planned: Joints | None = None
        self._position: Joints = ZERO
        self._position_before: Joints = ZERO

    def limit(self, limits: JointLimits) -> None:
        """Take other limits from the next command on."""
        self._limits = limits

    def end(self) -> None:
        """Forget; the robot is told no speed from now on."""
        self.velocity, self._is_feeding, self._planned = ZERO, False, None

    def resume(self, planned: Joints, position: Joints) -> None:
        """Go on from the motion that a robot has come to which repeated the last command for a while.

        Args:
            planned: where it plans to be by now [rad], (7,).
            position: the position reference it was told last [rad], (7,).
        """
        if self._is_feeding:
            speeds = zip(self._led(position, planned), self.velocity, strict=True)
            self._speeds, self._rates = [led + fed for led, fed in speeds], [0.0] * JOINT_COUNT

    def note(self, planned: Joints, position: Joints) -> None:
        """Note where the robot planned to be and the position reference it was told then, both [rad], (7,).

        What it makes of them is the motion that a speed sets in upon.
        """
        self._position_before = position if self._planned is None else self._position
        self._planned, self._position = planned, position

    def admit(self, planned: Joints, position: Joints, velocity: Joints, dt: float) -> Joints:
        """The speed that may be fed forward [rad/s], (7,), next to ``velocity``.

        Args:
            planned: where the robot plans to be [rad], (7,); the command before this one is not in it yet.
            position: the position reference that goes with it [rad], (7,), admitted already.
            velocity: the speed wanted [rad/s], (7,).
            dt: time since the last command [s] > 0.
        """
        self.is_bounded = False
        if velocity is ZERO and not self._is_feeding:
            return ZERO
        if not self._is_feeding:
            self._begin(planned, dt)
        predicted = dt
        if self._planned is not None:
            rows = zip(self._planned, planned, self._speeds, strict=True)
            if max(abs(now - last - speed * dt) for last, now, speed in rows) > _UNEXPECTED:
                predicted = 0.0
                self.resume(planned, self._position)
        admitted = [
            self._admit_joint(index, now + last * predicted, ahead, speed, last, dt)
            for index, (now, ahead, speed, last) in enumerate(
                zip(planned, position, velocity, tuple(self._speeds), strict=True)
            )
        ]
        is_over = velocity is ZERO and not self.is_bounded and max(map(abs, (*admitted, *self.velocity))) < _REST
        self.velocity, self._is_feeding = (ZERO, False) if is_over else (joints(admitted), True)
        return self.velocity

    def _begin(self, planned: Joints, dt: float) -> None:
        """Set in upon the motion that the position references before made."""
        if self._planned is None:
            self._speeds, self._rates = [0.0] * JOINT_COUNT, [0.0] * JOINT_COUNT
            return
        self._speeds = self._led(self._position, planned)
        rates = zip(
            self._speeds, self._led(self._position_before, self._planned), self._limits.acceleration, strict=True
        )
        self._rates = [max(-top, min(top, (new - old) / dt)) for new, old, top in rates]

    def _led(self, position: Joints, planned: Joints) -> list[float]:
        """How fast the robot sets out towards a position reference [rad/s]."""
        return [self._gain * (ahead - now) for ahead, now in zip(position, planned, strict=True)]

    def _admit_joint(self, index: int, now: float, ahead: float, speed: float, last: float, dt: float) -> float:
        """The share of one joint; ``now`` is where it will be when the robot takes the command."""
        limits, lead = self._limits, self._gain * (ahead - now)
        most, strength, jerk = limits.velocity[index], limits.acceleration[index], limits.jerk[index]
        wanted = lead + max(-most, min(most, speed))
        room = limits.upper[index] - now if wanted > 0.0 else now - limits.lower[index]
        top = min(most, speed_to_stop(room, strength, jerk))
        admitted, self._rates[index] = ramped(wanted, last, self._rates[index], top, strength, jerk, dt)
        self._speeds[index] = admitted
        self.is_bounded = self.is_bounded or admitted != wanted
        return admitted - lead


def ramped(
    wanted: float, last: float, rate: float, top: float, strength: float, jerk: float, dt: float
) -> tuple[float, float]:
    """The speed after ``dt`` [s] and its rate of change, on the way from ``last`` to ``wanted`` [rad/s].

    Args:
        wanted: the speed to come to; one that changes smoothly is followed at once.
        last: the speed so far.
        rate: its rate of change so far [rad/s²].
        top: highest speed allowed.
        strength: highest rate of change allowed [rad/s²].
        jerk: highest change of that rate allowed [rad/s³].
        dt: time that passes [s] > 0.
    """
    change = (wanted - last) / dt
    if (
        abs(wanted) <= top * _ROUNDING
        and abs(change) <= strength * _ROUNDING
        and abs(change - rate) <= jerk * dt * _ROUNDING
    ):
        return wanted, change
    missing = max(-top, min(top, wanted)) - last
    half = 0.5 * jerk * dt
    # As hard as it can still be taken back, at the jerk, when the speed is reached.
    ease = sqrt(2.0 * jerk * abs(missing) + half * half) - half
    aim = copysign(min(strength, ease, abs(missing) / dt), missing)
    change = max(rate - jerk * dt, min(rate + jerk * dt, aim))
    return last + change * dt, change


def speed_to_stop(room: float, strength: float, jerk: float) -> float:
    """How fast a joint may be that has ``room`` [rad] to stop in, see ``shaper``'s way to stop [rad/s]."""
    if room <= 0.0:
        return 0.0
    slow = 3.0 * strength / jerk
    return 0.5 * strength * (sqrt(slow * slow + 8.0 * room / strength) - slow)


_POINT_MOTION_ROUNDING = 1e-6  # [rad] a plan that turns round at the end of a range exceeds it in the last digits


class Setpoint(NamedTuple):
    """Where the joints shall be at one moment, and how they move.

    Attributes:
        position: chain order [rad], (7,).
        velocity: [rad/s], (7,); the tuple ``ZERO`` itself at rest.
        acceleration: [rad/s²], (7,).
    """

    position: Joints
    velocity: Joints = ZERO
    acceleration: Joints = ZERO

    def scaled(self, factor: float) -> Setpoint:
        """The same point of a motion for which time goes by ``factor`` times as fast."""
        if factor == 1.0 or self.velocity is ZERO:
            return self
        return Setpoint(
            self.position,
            _fixed([factor * each for each in self.velocity]),
            _fixed([factor * factor * each for each in self.acceleration]),
        )

    def unscaled(self, factor: float) -> Setpoint:
        """The point of a motion for which time will go by ``factor`` times as fast as outside.

        An acceleration would be far beyond a joint's limits there; it is left out, and the limiter takes it back.
        """
        if factor == 1.0 or self.velocity is ZERO:
            return self
        return Setpoint(self.position, _fixed([each / factor for each in self.velocity]))


class PointMotion:
    """A motion that ends at rest.

    Args:
        trajectory: the way; None for a motion that is over.
        end: where it ends exactly [rad], (7,).

    Attributes:
        end: as above.
        duration: time until it ends [s].
    """

    def __init__(self, trajectory: Trajectory | None, end: Joints) -> None:
        self._at_time = trajectory.at_time if trajectory else None
        self.end = end
        self.duration = float(trajectory.duration) if trajectory else 0.0

    def at(self, time: float) -> Setpoint:
        """Where the joints shall be ``time`` [s] >= 0 after the begin."""
        if self._at_time is None or time >= self.duration:
            return Setpoint(self.end)
        position, velocity, acceleration = self._at_time(time)
        return Setpoint(_fixed(position), _fixed(velocity), _fixed(acceleration))


def slower(limits: JointLimits, speed: float = 1.0, acceleration: float = 1.0, top_speed: float = inf) -> JointLimits:
    """``limits`` for a gentler motion.

    Args:
        limits: what the joints may do.
        speed: share of the speeds, above 0 up to 1.
        acceleration: share of the accelerations and jerks, above 0 up to 1.
        top_speed: no joint is faster than this share of it [rad/s].
    """
    return replace(
        limits,
        velocity=_fixed([speed * min(each, top_speed) for each in limits.velocity]),
        acceleration=_fixed([acceleration * each for each in limits.acceleration]),
        jerk=_fixed([acceleration * each for each in limits.jerk]),
    )


def travel(start: Setpoint, goal: Joints, limits: JointLimits) -> PointMotion:
    """To ``goal``, all joints arriving together; a straight way in joint space where the start allows it.

    Args:
        start: what the joints do when it begins.
        goal: where it ends [rad], (7,).
        limits: speeds, accelerations and jerks it keeps; a start that is faster comes down to them at once.

    Raises:
        CommandRefused: the way would leave the range of a joint: it cannot turn round before its end.
    """
    plan = _plan(start, limits)
    plan.target_position = goal
    plan.max_velocity = limits.velocity
    plan.synchronization = Synchronization.Phase
    trajectory = _calculated(plan)
    _check_range(trajectory, start.position, limits)
    return PointMotion(trajectory, goal)


def stop(start: Setpoint, limits: JointLimits) -> PointMotion:
    """From what the joints do now to rest, each joint as soon as ``limits`` let it."""
    plan = _plan(start, limits)
    plan.control_interface = ControlInterface.Velocity
    plan.synchronization = Synchronization.No
    trajectory = _calculated(plan)
    return PointMotion(trajectory, joints(trajectory.at_time(trajectory.duration)[0]))


def _plan(start: Setpoint, limits: JointLimits) -> InputParameter:
    plan = InputParameter(JOINT_COUNT)
    plan.current_position, plan.current_velocity, plan.current_acceleration = start
    plan.max_acceleration, plan.max_jerk = limits.acceleration, limits.jerk
    return plan


def _calculated(plan: InputParameter) -> Trajectory:
    trajectory = Trajectory(JOINT_COUNT)
    result = Ruckig(JOINT_COUNT).calculate(plan, trajectory)
    if result not in (Result.Working, Result.Finished):
        raise CommandRefused(
            f"Goal refused: no motion within the limits leads there from {plan.current_position} rad ({result}); "
            "let the arm come to rest first."
        )
    return trajectory


def _check_range(trajectory: Trajectory, start: Joints, limits: JointLimits) -> None:
    for index, profile in enumerate(trajectory.profiles[0]):
        turns = list(_turning_points(profile))
        lowest, highest = min(limits.lower[index], start[index]), max(limits.upper[index], start[index])
        if (
            turns
            and not lowest - _POINT_MOTION_ROUNDING <= min(turns) <= max(turns) <= highest + _POINT_MOTION_ROUNDING
        ):
            raise CommandRefused(
                f"Goal refused: axis {CHAIN_AXES[index]} is too fast to turn round within its range "
                f"({limits.range_deg(index)}) at this acceleration; ask for a higher one or let the arm stop first."
            )


def _turning_points(profile: Any) -> Iterator[float]:
    """Positions [rad] where a joint turns round; Ruckig's own extrema leave some out (0.19)."""
    for part in (profile.brake, profile):
        for duration, p, v, a, j in zip(part.t, part.p, part.v, part.a, part.j, strict=False):
            for time in _standstills(v, a, j):
                if 0.0 < time <= duration:
                    yield p + time * (v + time * (a / 2.0 + time * j / 6.0))


def _standstills(v: float, a: float, j: float) -> tuple[float, ...]:
    """Times [s] at which the speed ``v + a·t + j·t²/2`` is zero."""
    if j == 0.0:
        return (-v / a,) if a != 0.0 else ()
    square = a * a - 2.0 * j * v
    return () if square < 0.0 else ((-a - sqrt(square)) / j, (-a + sqrt(square)) / j)


def _fixed(values: Sequence[float]) -> Joints:
    return cast("Joints", tuple(values))


_SHARE = 0.95  # of acceleration and jerk, since the guard looks at differences from cycle to cycle
_LEFT_BEHIND = 0.02  # [rad] a robot that follows speeds only has gone elsewhere
_LATE = 0.05  # [s] by so much it may be behind
_STANDING = 1e-3  # [rad/s] less than the measured speed tells


class SpeedMotion:
    """Speeds of one arm and where they lead to.

    Args:
        limits: what the joints may do; a joint is slowed down so that it stops before the end of its range.
    """

    def __init__(self, limits: JointLimits) -> None:
        self._limits = limits
        self._position: Joints = ZERO
        self._velocity: Joints = ZERO
        self._rates = [0.0] * JOINT_COUNT

    @property
    def position(self) -> Joints:
        """Where it has come to [rad], (7,)."""
        return self._position

    def begin(self, state: ArmState) -> None:
        """Begin from where the robot plans to be, with the speed it has."""
        self._position = state.planned
        self._velocity = joints([speed if abs(speed) > _STANDING else 0.0 for speed in state.velocity])
        self._rates = [0.0] * JOINT_COUNT

    def step(self, state: ArmState, wanted: Joints, scale: float = 1.0) -> ArmCommand:
        """Go on for ``state.dt`` towards the speeds ``wanted`` [rad/s], (7,), at most ``scale`` times the limits."""
        dt = state.dt
        if dt <= 0.0:
            return ArmCommand(self._position, self._velocity if any(self._velocity) else ZERO)
        base = self._carried_along(state)
        velocity = joints(
            [self._joint_speed(index, base[index], speed, scale, dt) for index, speed in enumerate(wanted)]
        )
        self._position = joints([now + speed * dt for now, speed in zip(base, velocity, strict=True)])
        self._velocity = velocity
        return ArmCommand(self._position, velocity if any(velocity) else ZERO)

    def _joint_speed(self, index: int, now: float, wanted: float, scale: float, dt: float) -> float:
        limits = self._limits
        strength, jerk = _SHARE * limits.acceleration[index], _SHARE * limits.jerk[index]
        room = limits.upper[index] - now if wanted > 0.0 else now - limits.lower[index]
        top = min(scale * limits.velocity[index], speed_to_stop(room, strength, jerk))
        speed, self._rates[index] = ramped(wanted, self._velocity[index], self._rates[index], top, strength, jerk, dt)
        return speed

    def _carried_along(self, state: ArmState) -> Joints:
        """The positions so far; where the robot is where they do not lead it."""
        both = zip(self._position, state.planned, self._velocity, strict=True)
        return joints(
            [ours if abs(ours - its) < _LEFT_BEHIND + _LATE * abs(speed) else its for ours, its, speed in both]
        )


STANDING = 0.05
"""An arm whose joints all move slower than this stands [rad/s]; measured positions jitter."""

_CALM_CYCLES = 10  # the feedback is behind by less
_LONGEST = 1.0  # [s] the guard brings an arm to rest from full speed in less than half of it


class Calming:
    """Watches an arm that is held until it stands: its plan and its measurement, which comes later, lie still.

    Args:
        state: when the watch begins.
    """

    def __init__(self, state: ArmState) -> None:
        self._planned = state.planned
        self._calm_cycles = 0
        self._time = 0.0

    def is_over(self, state: ArmState) -> bool:
        """Whether the arm stands, as far as this new state tells; an arm that trembles counts after a while."""
        moved, self._planned = largest_difference(state.planned, self._planned), state.planned
        is_calm = moved <= STANDING * CYCLE and max(map(abs, state.velocity)) < STANDING
        self._calm_cycles = self._calm_cycles + 1 if is_calm else 0
        self._time += state.dt
        return self._calm_cycles >= _CALM_CYCLES or self._time > _LONGEST


def largest_difference(left: Joints, right: Joints) -> float:
    """Of two positions, by the joint that differs most [rad]."""
    return max(abs(a - b) for a, b in zip(left, right, strict=True))
