"""The position limiter: the next position that one arm is sent, within what its joints may do."""

from __future__ import annotations

from math import copysign, dist, hypot
from operator import sub

from yumi.control.motion import (
    Setpoint,
    braking_path,
    fixed,
    speed_to_come,
    step_to_rest,
    step_towards,
)
from yumi.robot.joints import JOINT_COUNT, ZERO, JointLimits, Joints, change_rate, joints, moved

_ROUNDING = 1.0 + 1e-6  # a command that uses a limit fully is not refused for its last digit
_STANDS = 1e-6  # [rad] a command that moves less in a cycle stands
_CLOSE = 1e-9  # [rad] a joint may come to rest at the end of its range
_FOLLOWABLE = 0.96  # a goal nearly as fast as the joint, or nearly as strong, cannot be caught up with


class PositionLimiter:
    """The positions sent so far, and the next one: no joint exceeds its speed, acceleration or jerk.

    What is smooth enough passes unchanged; what is not is approached as fast as the limits allow. A joint never gets so
    fast that it could not stop before the end of its range. Velocity and acceleration are differences of positions,
    which is what the robot can make of them.

    Args:
        limits: of the joints.
    """

    def __init__(self, limits: JointLimits) -> None:
        self.limit(limits)
        self.rest_at(ZERO)

    @property
    def position(self) -> Joints:
        """The position sent last [rad], (7,)."""
        return self._sent.position

    def limit(self, limits: JointLimits) -> None:
        """Apply other limits from the next step on."""
        self._limits = limits
        # What the weakest joint may do, and how long the slowest one needs to build up its acceleration [s].
        self._weakest = min(limits.velocity), min(limits.acceleration), min(limits.jerk)
        self._longest_ramp = max(top / jerk for top, jerk in zip(limits.acceleration, limits.jerk, strict=True))

    def rest_at(self, position: Joints) -> None:
        """Begin again, at rest."""
        self._sent = Setpoint(position)
        self._goal = Setpoint(position)  # the desired position, with differences of its own
        # Of joints whose last step was planned: velocity and acceleration at its end, which the plan goes on from.
        self._planned: dict[int, tuple[float, float]] = {}
        self._chasing: frozenset[int] = frozenset()  # those of them that do not yet move as their goal does
        self._step_time = 0.0  # [s] of the last step
        self._motion: Setpoint | None = None  # see motion

    def next(self, desired: Joints, dt: float, elapsed: float) -> Joints:
        """``desired`` itself if a step there is smooth enough, else the next position towards it, within the limits.

        Each joint for itself: one whose own step is smooth enough takes it. A goal that moves is caught up with.

        Args:
            desired: the position [rad], (7,).
            dt: how long the joints may move [s].
            elapsed: since the position that was desired before [s]; longer than ``dt`` after a gap.
        """
        step, self._step_time, self._motion = self._step_to(desired, dt), dt, None
        is_late = () if self._is_gentle(step, dt) else [not self._is_smooth(i, step, dt) for i in range(JOINT_COUNT)]
        if not any(is_late):
            self._sent = self._goal = step
            self._planned = {}
            return desired
        goal = self._motion_of_goal(desired, dt, elapsed)
        # How the joints move now. Where only differences are known, the last one is half a step old.
        motion = [
            self._planned.get(index) or (velocity + 0.5 * acceleration * dt, acceleration)
            for index, (velocity, acceleration) in enumerate(zip(*self._sent[1:], strict=True))
        ]
        velocity, acceleration = map(fixed, zip(*motion, strict=True))
        now = Setpoint(self.position, velocity, acceleration)
        found = step_towards(now, goal, self._limits, dt, is_late)
        way = found or goal
        must_brake = [
            late and (found is None or not self._is_safe(index, *(values[index] for values in way)))
            for index, late in enumerate(is_late)
        ]
        # A joint that is not late takes its step; braking is possible from any state that is safe.
        brake = step_to_rest(now, self._limits, dt, must_brake) if any(must_brake) else way
        sources = [brake if brakes else way if late else goal for late, brakes in zip(is_late, must_brake, strict=True)]
        taken = Setpoint(*(fixed([each[field][i] for i, each in enumerate(sources)]) for field in range(3)))
        # The last resort, should the way to a target lead past the end of the range, or further away from it.
        self._sent = self._step_to(inside(taken.position, self._limits, self.position), dt)
        self._planned = {
            index: (taken.velocity[index], taken.acceleration[index]) for index, late in enumerate(is_late) if late
        }
        # A joint has arrived when what is left of the way is less than half a step may change.
        changes = [0.5 * jerk * dt for jerk in self._limits.jerk]
        self._chasing = frozenset(
            index
            for index in self._planned
            if abs(taken.position[index] - goal.position[index]) >= changes[index] * dt * dt
            or abs(taken.velocity[index] - goal.velocity[index]) >= changes[index] * dt
            or abs(taken.acceleration[index] - goal.acceleration[index]) >= changes[index]
        )
        return self.position

    def place_to_stop(self) -> Joints:
        """Where the motion so far comes to rest that brakes as hard as it may [rad], (7,), within the range."""
        limits = self._limits
        rows = zip(*self._sent, limits.acceleration, limits.jerk, strict=True)
        ends = joints([p + braking_path(v, a, top, jerk).end for p, v, a, top, jerk in rows])
        return inside(ends, limits, self.position)

    @property
    def motion(self) -> Setpoint:
        """The position sent last, and how it moves at the end of its step."""
        if self._motion is not None:  # asked for twice in a cycle
            return self._motion
        position, rates = self._sent.position, self._sent.acceleration
        speeds = moved(self._sent.velocity, rates, 0.5 * self._step_time)
        if self._planned:
            own = [self._planned.get(index, each) for index, each in enumerate(zip(speeds, rates, strict=True))]
            speeds, rates = map(fixed, zip(*own, strict=True))
        self._motion = Setpoint(position, speeds, rates) if any(speeds) or any(rates) else Setpoint(position)
        return self._motion

    def brake(self, dt: float) -> Joints:
        """The next position of joints that all brake as hard as they may, for ``dt`` [s]."""
        rest = step_to_rest(self.motion, self._limits, dt, [True] * JOINT_COUNT)
        self._sent = self._goal = self._step_to(inside(rest.position, self._limits, self.position), dt)
        self._planned = dict(enumerate(zip(rest.velocity, rest.acceleration, strict=True)))
        self._chasing = frozenset()
        self._step_time, self._motion = dt, None
        return self.position

    def stands(self, dt: float) -> bool:
        """Whether no joint has moved with the last step of ``dt`` [s], nor with the one before it.

        One step alone may be short because a joint turns round: to stop there would be a jerk.
        """
        _, velocity, acceleration = self._sent
        return hypot(*velocity) * dt < _STANDS and hypot(*acceleration) * dt * dt < _STANDS

    def _step_to(self, position: Joints, dt: float) -> Setpoint:
        """The step from the last position to this one: velocity and acceleration as differences."""
        last, before, _ = self._sent
        velocity = change_rate(position, last, dt)
        return Setpoint(position, velocity, change_rate(velocity, before, dt))

    def _is_gentle(self, step: Setpoint, dt: float) -> bool:
        """Whether no joint asks for more than the weakest one may do: nearly always so, and seen quickly."""
        (speed, top, jerk), limits = self._weakest, self._limits
        acceleration = hypot(*step.acceleration)
        fastest = max(map(abs, step.velocity)) + 0.5 * acceleration * dt + speed_to_come(acceleration, jerk)
        way = 0.5 * fastest * (fastest / top + 3.0 * self._longest_ramp)  # see speed_to_stop
        return (
            not self._chasing
            and fastest <= speed
            and acceleration <= top
            and dist(step.acceleration, self._sent.acceleration) <= jerk * dt
            and way < min(map(sub, step.position, limits.lower))
            and way < min(map(sub, limits.upper, step.position))
        )

    def _is_smooth(self, index: int, step: Setpoint, dt: float) -> bool:
        """Whether a joint may take this step, and go on from there."""
        limits, acceleration = self._limits, step.acceleration[index]
        return (
            index not in self._chasing
            and abs(step.velocity[index]) <= limits.velocity[index] * _ROUNDING
            and abs(acceleration) <= limits.acceleration[index] * _ROUNDING
            and abs(acceleration - self._sent.acceleration[index]) <= limits.jerk[index] * dt * _ROUNDING
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

    def _motion_of_goal(self, desired: Joints, dt: float, elapsed: float) -> Setpoint:
        """The goals at the end of the step, with that of their motion which a joint can make use of.

        A goal that cannot be followed counts as resting; one whose last two steps contradict each other has no
        acceleration: that is noise, a stream with uneven steps, or a jump.
        """
        limits, last, before = self._limits, self._goal, self._goal.acceleration
        velocity = change_rate(desired, last.position, elapsed)
        acceleration = change_rate(velocity, last.velocity, elapsed)
        self._goal = Setpoint(desired, velocity, acceleration)
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
        return Setpoint(desired, fixed(speeds), fixed(rates))


def inside(position: Joints, limits: JointLimits, last: Joints) -> Joints:
    """``position`` cut at the range; joints that were outside ``last`` may come back but not go further [rad], (7,)."""
    if limits.outside(position) is None:
        return position
    rows = zip(limits.lower, limits.upper, last, position, strict=True)
    return joints([max(min(low, old), min(max(high, old), new)) for low, high, old, new in rows])
