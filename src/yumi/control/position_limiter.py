"""The position limiter: the next position that one arm is sent, within what its joints may do."""

from __future__ import annotations

from math import copysign, dist, hypot
from operator import sub
from typing import Final, NamedTuple

from yumi.control.motion import (
    Setpoint,
    braking_path,
    fixed,
    speed_to_come,
    step_to_rest,
    step_towards,
)
from yumi.robot.joints import JOINT_COUNT, JointLimits, Joints, change_rate, joints, moved

_ROUNDING = 1.0 + 1e-6  # a command that uses a limit fully is not refused for its last digit
_STANDS = 1e-6  # [rad] a command that moves less in a cycle stands
_CLOSE = 1e-9  # [rad] a joint may come to rest at the end of its range
_FOLLOWABLE = 0.96  # a goal nearly as fast as the joint, or nearly as strong, cannot be caught up with


class PositionMotion(NamedTuple):
    """The positions that an arm was sent so far, as far as the next one depends on them.

    Attributes:
        sent: the last one; velocity and acceleration are differences of positions, which a robot can make of them.
        goal: the position desired, with differences of its own.
        planned: of each joint, where its last step was planned: velocity and acceleration at its end, from which the
            plan goes on, else None; empty where none was.
        chasing: the joints with such a step that do not yet move as their goal does.
        step_time: of the last step [s].
    """

    sent: Setpoint
    goal: Setpoint
    step_time: float = 0.0
    planned: tuple[tuple[float, float] | None, ...] = ()
    chasing: frozenset[int] = frozenset()

    @property
    def position(self) -> Joints:
        """The position sent last [rad], (7,)."""
        return self.sent.position

    @property
    def moving(self) -> Setpoint:
        """The position sent last, with velocity and acceleration as they are at the end of its step."""
        position, velocity, rates = self.sent
        speeds = moved(velocity, rates, 0.5 * self.step_time)
        if self.planned:
            rows = zip(self.planned, speeds, rates, strict=True)
            speeds, rates = map(fixed, zip(*[own or (speed, rate) for own, speed, rate in rows], strict=True))
        return Setpoint(position, speeds, rates) if any(speeds) or any(rates) else Setpoint(position)

    def stands(self, dt: float) -> bool:
        """Whether no joint has moved with the last step of ``dt`` [s], nor with the one before it.

        One step alone may be short because a joint turns round: to stop there would be a jerk.
        """
        _, velocity, acceleration = self.sent
        return hypot(*velocity) * dt < _STANDS and hypot(*acceleration) * dt * dt < _STANDS


def resting_at(position: Joints) -> PositionMotion:
    """The motion of an arm that begins at rest."""
    rest = Setpoint(position)
    return PositionMotion(rest, rest)


_UNPLANNED = (None,) * JOINT_COUNT


class PositionLimiter:
    """Limits how positions move: no joint exceeds its speed, acceleration or jerk.

    What is smooth enough passes unchanged; what is not is approached as fast as the limits allow. A joint never gets so
    fast that it could not stop before the end of its range. Nothing is kept here between two steps.

    Args:
        limits: of the joints.
    """

    def __init__(self, limits: JointLimits) -> None:
        self._limits: Final = limits
        # What the weakest joint may do, and how long the slowest one needs to build up its acceleration [s].
        self._weakest: Final = min(limits.velocity), min(limits.acceleration), min(limits.jerk)
        self._longest_ramp: Final = max(top / j for top, j in zip(limits.acceleration, limits.jerk, strict=True))

    def step(self, motion: PositionMotion, desired: Joints, dt: float, elapsed: float) -> PositionMotion:
        """To ``desired`` itself if a step there is smooth enough, else to the next position towards it, in the limits.

        Each joint for itself: one whose own step is smooth enough takes it. A goal that moves is caught up with.

        Args:
            motion: so far.
            desired: the position [rad], (7,).
            dt: how long the joints may move [s].
            elapsed: since the position that was desired before [s]; longer than ``dt`` after a gap.
        """
        step = _step_to(motion, desired, dt)
        if self._is_gentle(motion, step, dt):
            return PositionMotion(step, step, dt)
        is_late = [not self._is_smooth(motion, i, step, dt) for i in range(JOINT_COUNT)]
        if not any(is_late):
            return PositionMotion(step, step, dt)
        limits, last = self._limits, motion.sent
        moved_goal, goal = self._motion_of_goal(motion, desired, dt, elapsed)
        # How the joints move now. Where only differences are known, the last one is half a step old.
        rows = zip(motion.planned or _UNPLANNED, last.velocity, last.acceleration, strict=True)
        rates = [planned or (velocity + 0.5 * rate * dt, rate) for planned, velocity, rate in rows]
        velocity, acceleration = map(fixed, zip(*rates, strict=True))
        now = Setpoint(last.position, velocity, acceleration)
        found = step_towards(now, goal, limits, dt, is_late)
        way = found or goal
        must_brake = [
            late and (found is None or not self._is_safe(index, *(values[index] for values in way)))
            for index, late in enumerate(is_late)
        ]
        # A joint that is not late takes its step; braking is possible from any state that is safe.
        brake = step_to_rest(now, limits, dt, must_brake) if any(must_brake) else way
        sources = [brake if brakes else way if late else goal for late, brakes in zip(is_late, must_brake, strict=True)]
        taken = Setpoint(*(fixed([each[field][i] for i, each in enumerate(sources)]) for field in range(3)))
        # The last resort, should the way to a target lead past the end of the range, or further away from it.
        sent = _step_to(motion, inside(taken.position, limits, last.position), dt)
        planned = tuple(
            [(taken.velocity[index], taken.acceleration[index]) if late else None for index, late in enumerate(is_late)]
        )
        # A joint has arrived when what is left of the way is less than half a step may change.
        changes = [0.5 * jerk * dt for jerk in limits.jerk]
        chasing = frozenset(
            index
            for index, late in enumerate(is_late)
            if late
            and (
                abs(taken.position[index] - goal.position[index]) >= changes[index] * dt * dt
                or abs(taken.velocity[index] - goal.velocity[index]) >= changes[index] * dt
                or abs(taken.acceleration[index] - goal.acceleration[index]) >= changes[index]
            )
        )
        return PositionMotion(sent, moved_goal, dt, planned, chasing)

    def brake(self, motion: PositionMotion, dt: float) -> PositionMotion:
        """To the next position of joints that all brake as hard as they may, for ``dt`` [s]."""
        rest = step_to_rest(motion.moving, self._limits, dt, [True] * JOINT_COUNT)
        sent = _step_to(motion, inside(rest.position, self._limits, motion.position), dt)
        planned = tuple(zip(rest.velocity, rest.acceleration, strict=True))
        return PositionMotion(sent, sent, dt, planned)

    def place_to_stop(self, motion: PositionMotion) -> Joints:
        """Where the motion so far comes to rest that brakes as hard as it may [rad], (7,), within the range."""
        limits = self._limits
        rows = zip(*motion.sent, limits.acceleration, limits.jerk, strict=True)
        ends = joints([p + braking_path(v, a, top, jerk).end for p, v, a, top, jerk in rows])
        return inside(ends, limits, motion.position)

    def _is_gentle(self, motion: PositionMotion, step: Setpoint, dt: float) -> bool:
        """Whether no joint asks for more than the weakest one may do: nearly always so, and seen quickly."""
        (speed, top, jerk), limits = self._weakest, self._limits
        acceleration = hypot(*step.acceleration)
        fastest = max(map(abs, step.velocity)) + 0.5 * acceleration * dt + speed_to_come(acceleration, jerk)
        way = 0.5 * fastest * (fastest / top + 3.0 * self._longest_ramp)  # see speed_to_stop
        return (
            not motion.chasing
            and fastest <= speed
            and acceleration <= top
            and dist(step.acceleration, motion.sent.acceleration) <= jerk * dt
            and way < min(map(sub, step.position, limits.lower))
            and way < min(map(sub, limits.upper, step.position))
        )

    def _is_smooth(self, motion: PositionMotion, index: int, step: Setpoint, dt: float) -> bool:
        """Whether a joint may take this step, and go on from there."""
        limits, acceleration = self._limits, step.acceleration[index]
        return (
            index not in motion.chasing
            and abs(step.velocity[index]) <= limits.velocity[index] * _ROUNDING
            and abs(acceleration) <= limits.acceleration[index] * _ROUNDING
            and abs(acceleration - motion.sent.acceleration[index]) <= limits.jerk[index] * dt * _ROUNDING
            and self._is_safe(index, step.position[index], step.velocity[index] + 0.5 * acceleration * dt, acceleration)
        )

    def _is_safe(self, index: int, position: float, velocity: float, acceleration: float) -> bool:
        """Whether a joint that moves like this can still keep its speed, and brake before the end of its range."""
        limits = self._limits
        top, jerk = limits.acceleration[index], limits.jerk[index]
        speed, change = abs(velocity), speed_to_come(acceleration, jerk)
        if speed + (change if velocity * acceleration > 0.0 else 0.0) > limits.velocity[index] * _ROUNDING:
            return False
        # Nearly always it has more room than it could need, whatever its acceleration: see speed_to_stop.
        low, high, fastest = limits.lower[index] - _CLOSE, limits.upper[index] + _CLOSE, speed + change
        if 0.5 * fastest * (fastest / top + 3.0 * top / jerk) < min(position - low, high - position):
            return True
        lowest, highest, _ = braking_path(velocity, acceleration, top, jerk)
        return (lowest == 0.0 or position + lowest >= low) and (highest == 0.0 or position + highest <= high)

    def _motion_of_goal(
        self, motion: PositionMotion, desired: Joints, dt: float, elapsed: float
    ) -> tuple[Setpoint, Setpoint]:
        """The goals at the end of the step, with their motion, and with that of it which a joint can make use of.

        A goal that cannot be followed counts as resting; one whose last two steps contradict each other has no
        acceleration: that is noise, a stream with uneven steps, or a jump.
        """
        limits, last, before = self._limits, motion.goal, motion.goal.acceleration
        velocity = change_rate(desired, last.position, elapsed)
        acceleration = change_rate(velocity, last.velocity, elapsed)
        speeds, rates = [0.0] * JOINT_COUNT, [0.0] * JOINT_COUNT
        for index, (speed, rate) in enumerate(zip(velocity, acceleration, strict=True)):
            fastest, top, jerk = limits.velocity[index], limits.acceleration[index], limits.jerk[index]
            # A jump is no motion. Towards the end of its range a joint must still be able to brake after its goal,
            # as its jerk and the length of a step allow.
            end = limits.upper[index] if speed > 0.0 else limits.lower[index]
            room = (end - last.position[index]) * copysign(1.0, speed)
            way = abs(speed) * (abs(speed) / top + 2.0 * top / jerk + 2.0 * dt)
            if abs(speed) > _FOLLOWABLE * fastest or way >= room:
                continue
            speeds[index] = speed
            if abs(rate) <= _FOLLOWABLE * top and abs(rate - before[index]) <= jerk * elapsed:
                speeds[index] = max(-_FOLLOWABLE * fastest, min(_FOLLOWABLE * fastest, speed + 0.5 * rate * dt))
                rates[index] = rate
        return Setpoint(desired, velocity, acceleration), Setpoint(desired, fixed(speeds), fixed(rates))


def _step_to(motion: PositionMotion, position: Joints, dt: float) -> Setpoint:
    """The step from the last position to this one: velocity and acceleration as differences."""
    last, before, _ = motion.sent
    velocity = change_rate(position, last, dt)
    return Setpoint(position, velocity, change_rate(velocity, before, dt))


def inside(position: Joints, limits: JointLimits, last: Joints) -> Joints:
    """``position`` cut at the range; joints that were outside ``last`` may come back but not go further [rad], (7,)."""
    if limits.outside(position) is None:
        return position
    rows = zip(limits.lower, limits.upper, last, position, strict=True)
    return joints([max(min(low, old), min(max(high, old), new)) for low, high, old, new in rows])
