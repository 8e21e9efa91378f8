"""Jerk-limited motion of an arm's joints: each thing once, for the limiter and all controllers.

- :func:`step_towards`: one step after goals that may move; :func:`step_to_rest`: one step of braking.
- :func:`travel` and :func:`stop`: whole motions to a point and to rest, calculated once and then looked up by time.
- :func:`ramp_speed`: a speed that follows another; :class:`SpeedMotion`: the positions such speeds lead to.
- :func:`braking_path`: where a joint comes to that brakes; :func:`speed_to_stop`: how fast it may be to stop in time.
- :class:`StandstillDetector`: how a controller takes over an arm that moves.
- :class:`TargetPredictor` and :class:`TrackingFilter`: how joints follow a stream of goals almost without lag.

Whole motions are planned by Ruckig; steps, which the limiter takes in every cycle, by the core.

The predictor estimates position, velocity and acceleration of each joint's goal from the goals and their times, by a
filter with fading memory for motions of constant acceleration (Morrison, *Introduction to Sequential Smoothing and
Prediction*, 1969): it follows such a motion without lag, and what is older counts less by a factor e each ``memory``.
Beside it goes a plain comparison with the last goals, which finds jumps: a jump moves the prediction and leaves its
speed alone, two in a row are a new speed.

The filter brings the joints to the predicted target. Near it the difference dies away as a critically damped filter of
third order would have it, which lets noise of the target through only far below its corner. A joint that this would ask
too much of is brought there as fast as its limits allow, by :func:`step_towards`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from ctypes import c_double
from dataclasses import replace
from functools import lru_cache
from itertools import chain
from math import exp, inf, isnan, sqrt
from typing import Any, NamedTuple

from ruckig import ControlInterface, InputParameter, Result, Ruckig, RuckigError, Synchronization, Trajectory

from yumi.catalogue import message
from yumi.core.library import LIMITS, SETPOINT, load
from yumi.errors import CommandRefused
from yumi.robot.joints import CHAIN_AXES, CYCLE, JOINT_COUNT, ZERO, ArmCommand, ArmState, JointLimits, Joints, joints

EGM_GAIN = 5.0
"""Gain of the robot's own position loop, at which a command's lead becomes speed [1/s] (reference/egm.md §6.1)."""

SERVO_CYCLES = 4
"""So many cycles after its plan a robot reports to be where it planned, behind which its position loop is closed:
transport delay and lag of the servo, as measured on an IRB 6640 (docs/explanation/virtual-robot.md)."""


def plan_gain(gain: float) -> float:
    """The gain at which a robot's plan closes its lead on a command [1/s], where that of its position loop is ``gain``.

    The loop is closed over what the robot reports, which is behind the plan by its speed times the servo's delay.
    """
    return gain / (1.0 - gain * SERVO_CYCLES * CYCLE)


DELAY = 0.0262
"""From a command to the motion that the virtual robot reports, at full-speed settings [s]: a cycle until the reply is
taken, a cycle in the robot, half of the cycle for which it counts, and the servo's cycles; ``yumi_evaluation.metrics``
finds it in recorded cycles."""

STANDING = 0.05
"""An arm whose joints all move slower than this stands [rad/s]; measured positions jitter."""


class Setpoint(NamedTuple):
    """Where the joints are at one moment, and how they move.

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
            fixed([factor * each for each in self.velocity]),
            fixed([factor * factor * each for each in self.acceleration]),
        )

    def unscaled(self, factor: float) -> Setpoint:
        """The point of a motion for which time will go by ``factor`` times as fast as outside.

        An acceleration would be far beyond a joint's limits there; it is left out, and the limiter takes it back.
        """
        if factor == 1.0 or self.velocity is ZERO:
            return self
        return Setpoint(self.position, fixed([each / factor for each in self.velocity]))


def fixed(values: Sequence[float]) -> Joints:
    """Seven values that were calculated, as a tuple; :func:`joints` checks what comes from elsewhere."""
    return tuple(values)


def slower(limits: JointLimits, speed: float = 1.0, acceleration: float = 1.0, top_speed: float = inf) -> JointLimits:
    """``limits`` for a gentler motion.

    Args:
        limits: of the joints.
        speed: factor on the speeds, above 0 up to 1.
        acceleration: factor on accelerations and jerks, above 0 up to 1.
        top_speed: no joint is faster than ``speed`` times this [rad/s].
    """
    return replace(
        limits,
        velocity=fixed([speed * min(each, top_speed) for each in limits.velocity]),
        acceleration=fixed([acceleration * each for each in limits.acceleration]),
        jerk=fixed([acceleration * each for each in limits.jerk]),
    )


def largest_difference(left: Joints, right: Joints) -> float:
    """Of two positions, by the joint that differs most [rad]."""
    return max(abs(a - b) for a, b in zip(left, right, strict=True))


# ---- one step at a time


def step_towards(
    now: Setpoint, goal: Setpoint, limits: JointLimits, dt: float, enabled: Sequence[bool]
) -> Setpoint | None:
    """Where the ``enabled`` joints are after ``dt`` [s] on their quickest ways to their goals; None if none was found.

    Each joint moves for itself. A goal that moves is caught up with and followed without lag: ``core/motion.hpp``.

    Args:
        now: where the joints are.
        goal: where the goals are at the end of the step; slower and weaker than the limits.
        limits: of the joints.
        dt: how long the step is [s].
        enabled: which joints move; the others' values in the result mean nothing.
    """
    reached = (c_double * 21)()
    arguments = _packed_limits(limits), SETPOINT.pack(*chain(*now)), SETPOINT.pack(*chain(*goal)), dt, bytes(enabled)
    return _setpoint(list(reached)) if load().motion_step_towards(*arguments, reached) else None


def step_to_rest(now: Setpoint, limits: JointLimits, dt: float, enabled: Sequence[bool]) -> Setpoint:
    """Where the ``enabled`` joints are after ``dt`` [s] of braking as hard as they may."""
    after = (c_double * 21)()
    load().motion_step_to_rest(_packed_limits(limits), SETPOINT.pack(*chain(*now)), dt, bytes(enabled), after)
    return _setpoint(list(after))


@lru_cache(64)
def _packed_limits(limits: JointLimits) -> bytes:
    return LIMITS.pack(*limits.lower, *limits.upper, *limits.velocity, *limits.acceleration, *limits.jerk)


def _setpoint(values: Sequence[float]) -> Setpoint:
    return Setpoint(fixed(values[:7]), fixed(values[7:14]), fixed(values[14:]))


def _calculate(plan: InputParameter) -> Trajectory | Result | Exception:
    """The trajectory that Ruckig finds, or why it finds none: at a few degrees a second it sometimes does not.

    It raises in some cases where its documentation returns a result; ValueError stands for results that its Python
    side does not know (0.19). A new generator for each plan keeps no state between plans.
    """
    trajectory = Trajectory(JOINT_COUNT)
    try:
        result = Ruckig(JOINT_COUNT).calculate(plan, trajectory)
    except (RuckigError, ValueError) as error:
        return error
    return trajectory if result in (Result.Working, Result.Finished) else result


def _plan_of_stop(start: Setpoint, limits: JointLimits) -> InputParameter:
    plan = InputParameter(JOINT_COUNT)
    plan.control_interface = ControlInterface.Velocity
    plan.synchronization = Synchronization.No  # a joint that needs longer does not make others wait
    plan.current_position, plan.current_velocity, plan.current_acceleration = start
    plan.max_acceleration, plan.max_jerk = limits.acceleration, limits.jerk
    return plan


# ---- braking, in closed form


class BrakingPath(NamedTuple):
    """The way of a joint that brakes, seen from where it is [rad].

    Attributes:
        lowest: how far it gets backwards, ≤ 0; a joint may have to turn round before it rests.
        highest: how far it gets forwards, ≥ 0.
        end: where it rests, between both.
    """

    lowest: float
    highest: float
    end: float


def braking_path(velocity: float, acceleration: float, top: float, jerk: float) -> BrakingPath:
    """The quickest way to standstill from ``velocity`` [rad/s] and ``acceleration`` [rad/s²], at most ``top``.

    ``top`` and ``jerk`` are > 0.
    """
    path = (c_double * 3)()
    load().motion_braking_path(velocity, acceleration, top, jerk, path)
    return BrakingPath(*path)


def speed_to_stop(room: float, acceleration: float, jerk: float) -> float:
    """How fast a joint may be that has ``room`` [rad] to stop in [rad/s].

    The inverse of the way it needs at most, v/2 · (v/a + 3a/j): its acceleration may have to be turned round first.
    """
    return float(load().motion_speed_to_stop(room, acceleration, jerk))


# ---- speeds


def ramp_speed(
    goal: float, last: float, rate: float, top: float, acceleration: float, jerk: float, dt: float
) -> tuple[float, float]:
    """The speed after ``dt`` [s] and its rate of change, on the way from ``last`` to ``goal`` [rad/s].

    A goal that changes smoothly is followed at once, as far as it does not rise too quickly to stay below the highest.

    Args:
        goal: the speed to come to; one that is no number is 0.
        last: the speed so far.
        rate: its rate of change so far [rad/s²].
        top: highest speed.
        acceleration: highest rate of change [rad/s²].
        jerk: highest change of that rate [rad/s³].
        dt: time that passes [s] > 0.
    """
    ramp = (c_double * 2)()
    load().motion_ramp_speed(goal, last, rate, top, acceleration, jerk, dt, ramp)
    speed, change = ramp
    return speed, change


_SHARE = 0.95  # of acceleration and jerk, since the limiter looks at differences from cycle to cycle
_SHARE_AT_FIRST = 0.9  # in the cycles after a motion whose jerk was another, which is still in those differences
_FIRST = 2  # such cycles
_LEFT_BEHIND = 0.02  # [rad] a robot that follows speeds only has gone elsewhere
_LATE = 0.05  # [s] by so much it may be behind
_NOISE = 1e-3  # [rad/s] a measured speed below this is noise


def speeds_without_noise(velocity: Joints) -> Joints:
    """Measured speeds from which a motion can go on: those that are no more than noise are zero."""
    return joints([speed if abs(speed) > _NOISE else 0.0 for speed in velocity])


class SpeedMotion:
    """Speeds of one arm, and positions that move along with them.

    With PosCorrGain 1 the robot closes its position loop around the position that moves along, and finds nothing to
    close; with PosCorrGain 0 it follows the speeds alone (reference/egm.md §6.1). So one motion serves both.

    Args:
        limits: of the joints; a joint is slowed down so that it stops before the end of its range.
    """

    def __init__(self, limits: JointLimits) -> None:
        self._limits = limits
        self.position: Joints = ZERO
        self._velocity: Joints = ZERO
        self._rates = [0.0] * JOINT_COUNT
        self._first = 0  # cycles that are left of those

    def begin(self, state: ArmState) -> None:
        """Begin from where the robot is, with the speed it has."""
        self.position = state.position
        self._velocity = speeds_without_noise(state.velocity)
        self._rates = [0.0] * JOINT_COUNT

    def go_on(self, position: Joints, velocity: Joints, acceleration: Joints) -> None:
        """Begin from what the arm is commanded, with that speed and acceleration: it may be braking."""
        self.position, self._velocity = position, velocity
        self._rates, self._first = list(acceleration), _FIRST

    @property
    def acceleration(self) -> Joints:
        """How its speeds change now [rad/s²], (7,)."""
        return joints(self._rates)

    def step(self, state: ArmState, goal: Joints, scale: float = 1.0) -> ArmCommand:
        """Go on for ``state.dt`` towards the speeds ``goal`` [rad/s], (7,), at most ``scale`` times the limits."""
        dt, limits = state.dt, self._limits
        if dt > 0.0:
            # Where the robot is, for joints that are not where these speeds have led them.
            rows = zip(self.position, state.planned, self._velocity, strict=True)
            base = [own if abs(own - its) < _LEFT_BEHIND + _LATE * abs(speed) else its for own, its, speed in rows]
            velocity, share = [], _SHARE_AT_FIRST if self._first else _SHARE
            self._first = max(0, self._first - 1)
            for index, (now, speed) in enumerate(zip(base, goal, strict=True)):
                acceleration, jerk = share * limits.acceleration[index], share * limits.jerk[index]
                room = limits.upper[index] - now if speed > 0.0 else now - limits.lower[index]
                top = min(scale * limits.velocity[index], speed_to_stop(room, acceleration, jerk))
                ramped, self._rates[index] = ramp_speed(
                    speed, self._velocity[index], self._rates[index], top, acceleration, jerk, dt
                )
                velocity.append(ramped)
            # On the way at the mean of both speeds: as a motion that brakes, from which and to which it goes on.
            rows = zip(base, self._velocity, velocity, strict=True)
            self.position = joints([now + 0.5 * (last + speed) * dt for now, last, speed in rows])
            self._velocity = joints(velocity)
        return ArmCommand(self.position, self._velocity if any(self._velocity) else ZERO)

    def give_up(self, position: Joints) -> None:
        """Go on from ``position`` [rad], (7,), where the limiter holds the arm, once no speed leads it further."""
        if not any(self._velocity):
            self.position = position

    def rest_after(self, goal: Joints, dt: float) -> Joints:
        """Where the joints would come to rest if they braked after a step of ``dt`` [s] towards the speeds ``goal``."""
        limits, places = self._limits, []
        for index, speed in enumerate(goal):
            strength, jerk = _SHARE * limits.acceleration[index], _SHARE * limits.jerk[index]
            last, rate, top = self._velocity[index], self._rates[index], limits.velocity[index]
            after, change = ramp_speed(speed, last, rate, top, strength, jerk, dt)
            way = 0.5 * (last + after) * dt
            places.append(self.position[index] + way + braking_path(after, change, strength, jerk).end)
        return joints(places)


# ---- whole motions

_RANGE_ROUNDING = 1e-6  # [rad] a plan that turns round at the end of a range exceeds it in the last digits


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
        """Where the joints are ``time`` [s] >= 0 after the begin."""
        if self._at_time is None or time >= self.duration:
            return Setpoint(self.end)
        return Setpoint(*map(fixed, self._at_time(time)))


def travel(start: Setpoint, goal: Joints, limits: JointLimits) -> PointMotion:
    """To ``goal``, all joints arriving together; a straight way in joint space where the start allows it.

    Args:
        start: how the joints move when it begins.
        goal: where it ends [rad], (7,).
        limits: speeds, accelerations and jerks it keeps; a start that is faster comes down to them at once.

    Raises:
        CommandRefused: the way would leave the range of a joint: it cannot turn round before its end.
    """
    plan = InputParameter(JOINT_COUNT)
    plan.synchronization = Synchronization.Phase
    plan.current_position, plan.current_velocity, plan.current_acceleration = start
    plan.target_position = goal
    plan.max_velocity, plan.max_acceleration, plan.max_jerk = limits.velocity, limits.acceleration, limits.jerk
    trajectory = _checked(plan)
    for index, profile in enumerate(trajectory.profiles[0]):
        lowest = min(limits.lower[index], start.position[index]) - _RANGE_ROUNDING
        highest = max(limits.upper[index], start.position[index]) + _RANGE_ROUNDING
        if not all(lowest <= turn <= highest for turn in _turning_points(profile)):
            raise CommandRefused(
                message(
                    "goal_turn_too_fast",
                    axis=CHAIN_AXES[index],
                    lower=limits.lower[index],
                    upper=limits.upper[index],
                )
            )
    return PointMotion(trajectory, goal)


def stop(start: Setpoint, limits: JointLimits) -> PointMotion:
    """From how the joints move now to rest, each joint as soon as ``limits`` let it."""
    trajectory = _checked(_plan_of_stop(start, limits))
    return PointMotion(trajectory, joints(trajectory.at_time(trajectory.duration)[0]))


def _checked(plan: InputParameter) -> Trajectory:
    trajectory = _calculate(plan)
    if not isinstance(trajectory, Trajectory):
        start = tuple(map(float, plan.current_position))
        raise CommandRefused(message("goal_without_motion", start=start, result=str(trajectory)))
    return trajectory


def _turning_points(profile: Any) -> Iterator[float]:
    """Positions [rad] where a joint turns round; Ruckig's own extrema leave some out (0.19)."""
    for part in (profile.brake, profile):
        for duration, p, v, a, j in zip(part.t, part.p, part.v, part.a, part.j, strict=False):
            # Its speed v + a·t + j·t²/2 is zero.
            times: tuple[float, ...] = ()
            if j == 0.0:
                times = (-v / a,) if a != 0.0 else ()
            elif (square := a * a - 2.0 * j * v) >= 0.0:
                times = ((-a - sqrt(square)) / j, (-a + sqrt(square)) / j)
            for time in times:
                if 0.0 < time <= duration:
                    yield p + time * (v + time * (a / 2.0 + time * j / 6.0))


# ---- taking over an arm

_CALM_CYCLES = 10  # the feedback is behind by less
_LONGEST_WAIT = 1.0  # [s] the limiter brings an arm to rest from full speed in less than half of it


class StandstillDetector:
    """Detects that an arm that is held stands: its plan and its measurement, which comes later, do not move.

    Controllers command in different ways: the command of one runs ahead of the arm, that of another is where the arm
    has to be now, with its speed beside it. Neither is a start for the other; standstill is.

    Args:
        state: when the arm was held.
    """

    def __init__(self, state: ArmState) -> None:
        self._planned = state.planned
        self._calm_cycles = 0
        self._time = 0.0

    def is_over(self, state: ArmState) -> bool:
        """Whether the arm stands by this new state; one that trembles counts as standing after a second."""
        moved, self._planned = largest_difference(state.planned, self._planned), state.planned
        is_calm = moved <= STANDING * CYCLE and max(map(abs, state.velocity)) < STANDING
        self._calm_cycles = self._calm_cycles + 1 if is_calm else 0
        self._time += state.dt
        return self._calm_cycles >= _CALM_CYCLES or self._time > _LONGEST_WAIT


_ELSEWHERE = 0.05  # [rad]
_DELAYED = 0.25  # [s] by so much of its speed an arm is behind what it is commanded
AT_GOAL = 1e-3
"""An arm that stands no further than this from where it is commanded to be is there [rad]."""


def is_held_back(commanded: Joints, velocity: Joints, planned: Joints) -> bool:
    """Whether an arm is further behind what it is commanded than it is by its delay.

    Args:
        commanded: the position [rad], (7,).
        velocity: of that [rad/s], (7,).
        planned: where the robot plans to be [rad], (7,).
    """
    rows = zip(commanded, velocity, planned, strict=True)
    return any(abs(wanted - now) > _ELSEWHERE + _DELAYED * abs(speed) for wanted, speed, now in rows)


# ---- following a stream of goals

_RESOLUTION = 2e-4
"""A goal this far from where it was expected is where it was expected [rad]."""

_UNPUNCTUAL = 0.005
"""By how much the time between two goals may be wrong: what a network and a scheduler add now and then [s]."""

_SHORTEST = 0.0005
"""Goals that come closer upon each other say nothing about a speed [s]."""

_HARDER = 1.5  # a goal may be asked to accelerate somewhat more than the joint can follow
_LEARNING = 0.1  # weight of one interval in the learned period
_MISSED = 3.0  # goals missing in a row mean that the stream has ended


class _Gains(NamedTuple):
    """What a surprise does to position, velocity and acceleration, for goals ``interval`` [s] apart."""

    interval: float
    position: float
    velocity: float
    acceleration: float


def _fading_gains(interval: float, memory: float) -> _Gains:
    """Gains of the critically damped filter of third order whose memory fades within ``memory`` [s]."""
    left = exp(-interval / memory)
    gone = 1.0 - left
    return _Gains(
        interval,
        1.0 - left**3,
        1.5 * gone * gone * (1.0 + left) / interval,
        gone**3 / (interval * interval),
    )


class _Track:
    """The goals of one joint; ``top`` is its highest speed [rad/s], ``strength`` its highest acceleration [rad/s²]."""

    __slots__ = ("_strength", "_surprise", "_top", "acceleration", "last", "position", "rate", "velocity")

    def __init__(self, top: float, strength: float) -> None:
        self._top, self._strength = top, strength
        self.rest_at(0.0)

    def rest_at(self, position: float) -> None:
        self.position = self.last = position
        self.velocity = self.acceleration = self.rate = self._surprise = 0.0

    def add(self, goal: float, gains: _Gains) -> None:
        """The next goal [rad], ``gains.interval`` after the last one."""
        dt = gains.interval
        self.position += dt * (self.velocity + 0.5 * dt * self.acceleration)
        self.velocity += dt * self.acceleration
        if not self._begins_anew(goal, dt):
            wrong = goal - self.position
            self.position += gains.position * wrong
            self.velocity += gains.velocity * wrong
            self.acceleration += gains.acceleration * wrong
        self.last = goal
        self.velocity = max(-self._top, min(self._top, self.velocity))
        self.acceleration = max(-self._strength, min(self._strength, self.acceleration))

    def add_motion(self, goal: float, velocity: float, gains: _Gains) -> None:
        """The next goal [rad], with its velocity [rad/s]."""
        gain = gains.position * (velocity - self.velocity) / gains.interval - gains.position * self.acceleration
        self.position = self.last = goal
        self.velocity = self.rate = max(-self._top, min(self._top, velocity))
        self.acceleration = max(-self._strength, min(self._strength, self.acceleration + gain))
        self._surprise = 0.0

    def _begins_anew(self, goal: float, dt: float) -> bool:
        """Whether the goal set out with a new speed; one that only jumped takes the prediction with it."""
        way, before = goal - self.last, self._surprise
        # The last step knows a hard acceleration at once, the filter is not misled by a goal that came late.
        surprise = min(way - self.rate * dt, way - self.velocity * dt, key=abs)
        late = _UNPUNCTUAL * max(abs(self.rate), abs(self.velocity))
        if abs(surprise) < _RESOLUTION + late + _HARDER * self._strength * dt * dt:
            self._surprise = 0.0
            if dt > _SHORTEST:
                self.rate = way / dt
            return False
        self._surprise = surprise
        if surprise * before <= 0.0 or abs(way) > self._top * dt:
            self.position += surprise
            return False
        self.position, self.velocity, self.acceleration = goal, way / dt, 0.0
        self.rate, self._surprise = way / dt, 0.0
        return True


class TargetPredictor:
    """Predicts the goals of one arm.

    Args:
        limits: of the joints; no stream is expected to move faster.

    Attributes:
        memory: how long a goal counts [s]; a longer memory takes noise better, a shorter one changes of acceleration.
        timeout: a stream without a goal for so long has ended [s]; a slow one is given three of its periods.
        goal: the last goal [rad], (7,).
    """

    def __init__(self, limits: JointLimits) -> None:
        self.memory = 0.020
        self.timeout = 0.030
        self.goal: Joints = ZERO
        self._tracks = tuple(_Track(*each) for each in zip(limits.velocity, limits.acceleration, strict=True))
        self._time = -inf
        self._period = 0.0

    def rest_at(self, position: Joints) -> None:
        """Begin again, with a goal that does not move."""
        self.goal, self._time, self._period = position, -inf, 0.0
        for track, value in zip(self._tracks, position, strict=True):
            track.rest_at(value)

    def rebase(self, change: Callable[[Setpoint], Setpoint]) -> None:
        """Count positions from elsewhere; ``change`` says what a motion is there."""
        tracks = self._tracks
        now = change(
            Setpoint(
                joints([t.position for t in tracks]),
                joints([t.velocity for t in tracks]),
                joints([t.acceleration for t in tracks]),
            )
        )
        last = change(Setpoint(joints([t.last for t in tracks]), joints([t.rate for t in tracks])))
        self.goal = change(Setpoint(self.goal)).position
        for track, *motion, place, rate in zip(tracks, *now, *last[:2], strict=True):
            track.position, track.velocity, track.acceleration = motion
            track.last, track.rate = place, rate

    def add(self, goal: Joints, velocity: Joints, time: float) -> None:
        """The next goal.

        Args:
            goal: positions [rad], (7,).
            velocity: velocities [rad/s], (7,); NaN where the sender gave none.
            time: when it was sent or, if nothing better is known, when it arrived [s].
        """
        interval = time - self._time
        if interval < self._patience:
            self._period += _LEARNING * (interval - self._period)
            gains = _fading_gains(max(interval, _SHORTEST), self.memory)
        else:  # another stream: only what this goal itself says counts
            self.rest_at(goal)
            gains = _Gains(1.0, 0.0, 0.0, 0.0)
        for track, value, speed in zip(self._tracks, goal, velocity, strict=True):
            if not isnan(speed):
                track.add_motion(value, speed, gains)
            elif gains.position:
                track.add(value, gains)
        self.goal, self._time = goal, max(time, self._time)

    def at(self, now: float, ahead: float) -> Setpoint:
        """Where the goals will be ``ahead`` [s] after ``now`` [s]; where the last one was when no more come."""
        if now - self._time > self._patience:
            return Setpoint(self.goal)
        after = now - self._time + ahead
        return Setpoint(
            joints([t.position + after * (t.velocity + 0.5 * after * t.acceleration) for t in self._tracks]),
            joints([t.velocity + after * t.acceleration for t in self._tracks]),
            joints([t.acceleration for t in self._tracks]),
        )

    @property
    def _patience(self) -> float:
        return max(self.timeout, _MISSED * self._period)


_FOLLOWABLE = 0.9  # a target nearly as fast or as strong as the joint cannot be caught up with
_NEAR = 3e-4  # a chase ends when the filter would go no further than this past the target [rad]


class TrackingFilter:
    """The joints of one arm after a target.

    Args:
        limits: of the joints.

    Attributes:
        stiffness: corner of the filter [rad/s]; larger follows more closely and lets more noise through.
    """

    def __init__(self, limits: JointLimits) -> None:
        self.stiffness = 40.0
        self._limits = slower(limits, _SHARE, _SHARE)
        self.begin(ZERO)

    def begin(self, position: Joints, velocity: Joints = ZERO) -> None:
        """Begin again, at ``position`` [rad] with ``velocity`` [rad/s], (7,)."""
        self._now = Setpoint(position, velocity)
        self._is_chasing = [False] * JOINT_COUNT

    def rebase(self, change: Callable[[Setpoint], Setpoint], mixed: range) -> None:
        """Count positions from elsewhere; ``change`` says what a motion is there, ``mixed`` which joints it mixes."""
        self._now = change(self._now)
        is_chasing = any(self._is_chasing[index] for index in mixed)
        for index in mixed:
            self._is_chasing[index] = is_chasing

    def step(self, target: Setpoint, dt: float, scale: float = 1.0) -> Setpoint:
        """Go on for ``dt`` [s] > 0, with at most ``scale`` times the joints' speeds; where the joints are then.

        Args:
            target: where the target is at the end of the step.
            dt: time that passes [s].
            scale: factor on the speeds.
        """
        limits = self._limits if scale == 1.0 else slower(self._limits, scale)
        rows = zip(*self._now, *target, limits.velocity, limits.acceleration, limits.jerk, strict=True)
        steps = [self._filtered(chasing, dt, *row) for chasing, row in zip(self._is_chasing, rows, strict=True)]
        self._is_chasing = [step is None for step in steps]
        if any(self._is_chasing):
            # A joint can catch up only with what it is stronger than.
            goal = target._replace(
                velocity=_followable(target.velocity, limits.velocity),
                acceleration=_followable(target.acceleration, limits.acceleration),
            )
            chase = step_towards(self._now, goal, limits, dt, self._is_chasing)
            chase = chase or step_to_rest(self._now, limits, dt, self._is_chasing)
            steps = [step or chased for step, chased in zip(steps, zip(*chase, strict=True), strict=True)]
        self._now = Setpoint(*(joints([step[field] for step in steps if step]) for field in range(3)))
        return self._now

    def _filtered(
        self,
        is_chasing: bool,
        dt: float,
        position: float,
        velocity: float,
        acceleration: float,
        target: float,
        speed: float,
        gain: float,
        fastest: float,
        strongest: float,
        jerk: float,
    ) -> tuple[float, float, float] | None:
        """Position, velocity and acceleration of one joint after the filter's step; None where it has to chase."""
        w = self.stiffness
        behind = position - (target - dt * (speed - 0.5 * dt * gain))
        slower_by = velocity - (speed - dt * gain)
        weaker_by = acceleration - gain
        if is_chasing and max(abs(behind), abs(slower_by) / w, abs(weaker_by) / (w * w)) > _NEAR:
            return None
        # The difference is (a + b·t + c·t²)·exp(-w·t).
        b, c = slower_by + w * behind, 0.5 * (weaker_by + w * (2.0 * slower_by + w * behind))
        left, value, slope = exp(-w * dt), behind + dt * (b + dt * c), b + 2.0 * c * dt
        after = (
            target + value * left,
            speed + (slope - w * value) * left,
            gain + (2.0 * c - 2.0 * w * slope + w * w * value) * left,
        )
        is_within = (
            abs(after[1]) <= fastest and abs(after[2]) <= strongest and abs(after[2] - acceleration) <= jerk * dt
        )
        return after if is_within else None


def _followable(values: Joints, limits: Joints) -> Joints:
    rows = zip(values, limits, strict=True)
    return joints([value if abs(value) < _FOLLOWABLE * top else 0.0 for value, top in rows])
