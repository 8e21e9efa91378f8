"""Shapes the way to a wanted position so that no joint exceeds its speed, acceleration and jerk.

What is smooth enough passes unchanged; what is not is approached as fast as the limits allow, by the online trajectory
generator Ruckig. A joint never gets so fast that it could not stop before the end of its range.

Most positions are smooth by far. An outlook, made after the reply, tells so by three distances before the next one;
only what it does not vouch for is looked at joint by joint.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import copysign, dist
from typing import NamedTuple

from ruckig import ControlInterface, InputParameter, OutputParameter, Result, Ruckig, Synchronization

from yumi.control.braking import braking_reach, speed_to_come
from yumi.robot.joints import JOINT_COUNT, Joints, joints
from yumi.robot.limits import JointLimits
from yumi.robot.values import ZERO

_PACE = 0.9  # a goal that moves nearly as fast as the joint cannot be caught up with
_ROUNDING = 1.0 + 1e-6  # a command that uses a limit fully is not refused for its last digit
_CAUTION = 0.99  # an outlook is for one period, a robot's clock tells another by its last digits
_NOWHERE = -1.0  # [rad] a distance that no step keeps
_CLOSE = 1e-9  # [rad] a joint may come to rest at the end of its range
_PLANNED = (Result.Working, Result.Finished)
_SAME_PERIOD = 1e-8  # [s] by so much; at full speed the command moves less by it than the caution allows


class _Outlook(NamedTuple):
    """Where the next position is smooth beyond doubt: near three points. Distances are over all joints together.

    Attributes:
        period: the time until then [s].
        free: distance from the last position at which no joint is too fast, or cannot stop in its range [rad].
        coasting: the position at constant speed [rad].
        accelerated: distance from it at which no joint accelerates too much [rad].
        steady: the position at constant acceleration [rad].
        jerked: distance from it at which no joint jerks too much [rad].
    """

    period: float
    free: float
    coasting: Joints
    accelerated: float
    steady: Joints
    jerked: float


class _Goal(NamedTuple):
    """A joint's wanted position and how it moves, as far as a joint can follow it; in [rad] and [s]."""

    position: float
    speed: float
    gain: float


class _Step(NamedTuple):
    """Where a joint is at the end of a step, and how it moves then; in [rad] and [s]."""

    position: float
    velocity: float
    acceleration: float


_Rates = tuple[float, float]
"""Velocity [rad/s] and acceleration [rad/s²] of a joint."""


class MotionShaper:
    """The motion of the commands admitted so far: position, velocity and acceleration of each joint.

    Velocity and acceleration are differences of positions, as whoever looks at the commands sees them.

    Args:
        limits: what the joints may do.
    """

    def __init__(self, limits: JointLimits) -> None:
        self.position: Joints = ZERO
        self._velocity: Joints = ZERO
        self._acceleration: Joints = ZERO
        self._wanted: Joints = ZERO
        self._outlook: _Outlook | None = None
        self._glided: tuple[Joints, float] | None = None  # from where and for how long, not yet in the speeds
        self._goal_rates = [0.0] * JOINT_COUNT
        self._instant: dict[int, _Rates] = {}  # of joints whose last step was planned: their motion at its end
        self._chasing: frozenset[int] = frozenset()  # those of them that do not yet move as their goal does
        self._limits = limits
        self._bounds = (limits.lower, limits.upper, limits.velocity, limits.acceleration, limits.jerk)
        self._least = tuple(_CAUTION * min(each) for each in (limits.velocity, limits.acceleration, limits.jerk))
        self._generator = Ruckig(JOINT_COUNT, 0.004)
        self._input = InputParameter(JOINT_COUNT)
        self._output = OutputParameter(JOINT_COUNT)
        self._input.max_jerk = list(limits.jerk)
        self._input.target_position = [0.0] * JOINT_COUNT
        self._input.synchronization = Synchronization.No  # a joint that must wait does not make others wait
        self._brake = InputParameter(JOINT_COUNT)
        self._brake.control_interface = ControlInterface.Velocity
        self._brake.max_acceleration, self._brake.max_jerk = list(limits.acceleration), list(limits.jerk)
        self._brake.synchronization = Synchronization.No

    def rest_at(self, position: Joints) -> None:
        """Begin again, at rest."""
        self.position = self._wanted = position
        self._velocity = self._acceleration = ZERO
        self._outlook = self._glided = None
        self._instant, self._chasing = {}, frozenset()

    def glides(self, wanted: Joints, dt: float) -> bool:
        """Go to ``wanted`` within ``dt`` [s] if that is smooth by far; tells whether it was. Needs an outlook."""
        view = self._outlook
        if (
            view is None
            or not -_SAME_PERIOD < dt - view.period < _SAME_PERIOD
            or not dist(wanted, self.position) <= view.free
            or not dist(wanted, view.coasting) <= view.accelerated
            or not dist(wanted, view.steady) <= view.jerked
        ):
            return False
        self._outlook, self._glided = None, (self.position, dt)
        self.position = self._wanted = wanted
        return True

    def look_ahead(self, dt: float) -> None:
        """Make the outlook on the position that comes ``dt`` [s] after the last; when there is time for it."""
        self._settle()
        if self._chasing:
            return
        slowest, weakest, gentlest = self._least
        coasting, steady, rooms = [], [], []
        rows = zip(self.position, self._velocity, self._acceleration, *self._bounds, strict=True)
        for p, v, a, low, high, speed, top, jerk in rows:
            coasting.append(p + v * dt)
            steady.append(p + v * dt + a * dt * dt)
            strongest = abs(a) + gentlest * dt
            fastest = abs(v) + strongest * dt + strongest * strongest / (2.0 * jerk)
            rooms.append(min(p - low, high - p) - _way_to_stop(fastest, top, jerk) if fastest < speed else _NOWHERE)
        self._outlook = _Outlook(
            period=dt,
            free=min(slowest * dt, *rooms),
            coasting=joints(coasting),
            accelerated=weakest * dt * dt,
            steady=joints(steady),
            jerked=gentlest * dt * dt * dt,
        )

    def passes(self, wanted: Joints, dt: float) -> bool:
        """Go to ``wanted`` within ``dt`` [s] if that is smooth enough; tells whether it was."""
        self._settle()
        velocity, acceleration = self._rates(wanted, dt)
        if not all(self._is_smooth(*each, dt) for each in self._rows(wanted, velocity, acceleration)):
            return False
        self._goal_rates = [(new - old) / dt for old, new in zip(self._wanted, wanted, strict=True)]
        self.position = self._wanted = wanted
        self._velocity, self._acceleration, self._outlook = velocity, acceleration, None
        self._instant = {}
        return True

    def approach(self, wanted: Joints, dt: float, elapsed: float) -> Joints:
        """Go towards ``wanted`` for ``dt`` [s] as fast as the limits allow; the position reached.

        Each joint for itself: one whose own way is smooth enough goes there at once. A wanted position that moves is
        caught up with: the way is planned as seen by someone who moves with it.

        Args:
            wanted: the position [rad], (7,).
            dt: how long the joints may move [s].
            elapsed: since the position that was wanted before [s]; longer than ``dt`` after a gap.
        """
        self._settle()
        velocity, acceleration = self._rates(wanted, dt)
        is_late = [not self._is_smooth(*each, dt) for each in self._rows(wanted, velocity, acceleration)]
        goals = self._goals(wanted, dt, elapsed)
        self._wanted, self._outlook = wanted, None
        now = [self._instant.get(index) or self._estimate(index, dt) for index in range(JOINT_COUNT)]
        steps = self._way_to(goals, now, dt, is_late)
        is_unsafe = [late and not self._is_safe(index, *steps[index]) for index, late in enumerate(is_late)]
        if any(is_unsafe):
            steps = [
                brake if it else step
                for step, brake, it in zip(steps, self._brakes(now, dt, is_unsafe), is_unsafe, strict=True)
            ]
        self._go(steps, goals, dt, is_late)
        return self.position

    def _goals(self, wanted: Joints, dt: float, elapsed: float) -> list[_Goal]:
        """How the wanted position moves at the end of the step, as far as its last differences tell."""
        rates = [(new - old) / elapsed for old, new in zip(self._wanted, wanted, strict=True)]
        before, self._goal_rates = self._goal_rates, rates
        rows = enumerate(zip(wanted, rates, before, strict=True))
        return [self._goal(index, position, new, (new - old) / elapsed, dt) for index, (position, new, old) in rows]

    def _goal(self, index: int, position: float, rate: float, gain: float, dt: float) -> _Goal:
        """At rest where it cannot be caught up with; a jump is no motion."""
        if self._speed_of_goal(index, rate, dt) == 0.0:
            return _Goal(position, 0.0, 0.0)
        if abs(gain) > _PACE * self._limits.acceleration[index]:
            return _Goal(position, rate, 0.0)
        return _Goal(position, rate + 0.5 * gain * dt, gain)

    def _rates(self, position: Joints, dt: float) -> tuple[Joints, Joints]:
        """Velocity and acceleration of the step from the last position to this one, as differences."""
        velocity = joints([(new - old) / dt for old, new in zip(self.position, position, strict=True)])
        return velocity, joints([(new - old) / dt for old, new in zip(self._velocity, velocity, strict=True)])

    def _rows(
        self, position: Joints, velocity: Joints, acceleration: Joints
    ) -> Iterator[tuple[int, float, float, float]]:
        return zip(range(JOINT_COUNT), position, velocity, acceleration, strict=True)

    def _go(self, steps: list[_Step], goals: list[_Goal], dt: float, is_late: list[bool]) -> None:
        """Take the steps; a joint on a planned way stays on it until it moves as its goal does."""
        position = self._kept_in_range(joints([step.position for step in steps]))
        self._velocity, self._acceleration = self._rates(position, dt)
        self._instant = {
            index: (step.velocity, step.acceleration) for index, step in enumerate(steps) if is_late[index]
        }
        self._chasing = frozenset(
            index for index in self._instant if not self._has_arrived(index, steps[index], goals[index], dt)
        )
        self.position = position

    def _has_arrived(self, index: int, step: _Step, goal: _Goal, dt: float) -> bool:
        """Whether a joint moves as its goal does: what is left of the way is less than half a step may change."""
        change = 0.5 * self._limits.jerk[index] * dt
        return (
            abs(step.position - goal.position) < change * dt * dt
            and abs(step.velocity - goal.speed) < change * dt
            and abs(step.acceleration - goal.gain) < change
        )

    def _settle(self) -> None:
        """Take the last glide into the speeds."""
        if self._glided is None:
            return
        before, dt = self._glided
        self._glided = None
        velocity = joints([(new - old) / dt for old, new in zip(before, self.position, strict=True)])
        steps = zip(self._velocity, velocity, strict=True)
        self._acceleration = joints([(new - old) / dt for old, new in steps])
        self._velocity = velocity
        self._goal_rates, self._instant = list(velocity), {}

    def _way_to(self, goals: list[_Goal], now: list[_Rates], dt: float, is_late: list[bool]) -> list[_Step]:
        """One step on the quickest way to the goals, planned as seen from them at the end of the step."""
        given, limits = self._input, self._limits
        given.enabled = is_late
        rows = list(zip(self.position, now, goals, strict=True))
        given.current_position = [
            old - (goal.position - dt * (goal.speed - 0.5 * dt * goal.gain)) for old, _, goal in rows
        ]
        given.current_velocity = [speed - (goal.speed - dt * goal.gain) for _, (speed, _), goal in rows]
        given.current_acceleration = [gain - goal.gain for _, (_, gain), goal in rows]
        given.max_velocity = [top - goal.speed for top, goal in zip(limits.velocity, goals, strict=True)]
        given.min_velocity = [-top - goal.speed for top, goal in zip(limits.velocity, goals, strict=True)]
        given.max_acceleration = [top - goal.gain for top, goal in zip(limits.acceleration, goals, strict=True)]
        given.min_acceleration = [-top - goal.gain for top, goal in zip(limits.acceleration, goals, strict=True)]
        self._generator.delta_time = dt
        if self._generator.update(given, self._output) not in _PLANNED:
            return self._brakes(now, dt, is_late)
        planned = zip(
            goals,
            self._output.new_position,
            self._output.new_velocity,
            self._output.new_acceleration,
            is_late,
            strict=True,
        )
        return [
            _Step(goal.position + p, goal.speed + v, goal.gain + a) if late else _Step(*goal)
            for goal, p, v, a, late in planned
        ]

    def _brakes(self, now: list[_Rates], dt: float, is_late: list[bool]) -> list[_Step]:
        """One step of the joints that brake as hard as they may: what is possible from any state that is safe."""
        given, output = self._brake, self._output
        given.enabled = is_late
        given.current_position = list(self.position)
        given.current_velocity = [speed for speed, _ in now]
        given.current_acceleration = [gain for _, gain in now]
        self._generator.delta_time = dt
        if self._generator.update(given, output) not in _PLANNED:
            return [_Step(position, 0.0, 0.0) for position in self.position]
        return [
            _Step(*each) for each in zip(output.new_position, output.new_velocity, output.new_acceleration, strict=True)
        ]

    def _estimate(self, index: int, dt: float) -> tuple[float, float]:
        """Velocity and acceleration at the end of the last step, where only differences are known."""
        acceleration = self._acceleration[index]
        return self._velocity[index] + 0.5 * acceleration * dt, acceleration

    def _speed_of_goal(self, index: int, speed: float, dt: float) -> float:
        """How fast the wanted position itself moves [rad/s]; a jump is no motion, nor is what must soon end.

        Towards the end of its range a goal is not followed at its speed unless the joint could still brake after it,
        with its jerk and the length of a step taken into account.
        """
        top, gain, jerk = self._limits.velocity[index], self._limits.acceleration[index], self._limits.jerk[index]
        pace = abs(speed)
        if pace > _PACE * top:
            return 0.0
        end = self._limits.upper[index] if speed > 0.0 else self._limits.lower[index]
        room = (end - self._wanted[index]) * copysign(1.0, speed)
        return speed if pace * (pace / gain + 2.0 * gain / jerk + 2.0 * dt) < room else 0.0

    def _is_smooth(self, index: int, position: float, velocity: float, acceleration: float, dt: float) -> bool:
        """Whether a joint may take this step, and go on from there."""
        limits = self._limits
        return (
            index not in self._chasing
            and abs(velocity) <= limits.velocity[index] * _ROUNDING
            and abs(acceleration) <= limits.acceleration[index] * _ROUNDING
            and abs(acceleration - self._acceleration[index]) <= limits.jerk[index] * dt * _ROUNDING
            and self._is_safe(index, position, velocity + 0.5 * acceleration * dt, acceleration)
        )

    def _is_safe(self, index: int, position: float, velocity: float, acceleration: float) -> bool:
        """Whether a joint that moves like this can still keep its speed, and brake before the end of its range."""
        limits = self._limits
        top, jerk = limits.acceleration[index], limits.jerk[index]
        more = speed_to_come(acceleration, jerk) if velocity * acceleration > 0.0 else 0.0
        if abs(velocity) + more > limits.velocity[index] * _ROUNDING:
            return False
        lowest, highest = braking_reach(velocity, acceleration, top, jerk)
        low, high = limits.lower[index] - _CLOSE, limits.upper[index] + _CLOSE
        return (lowest == 0.0 or position + lowest >= low) and (highest == 0.0 or position + highest <= high)

    def _kept_in_range(self, position: Joints) -> Joints:
        """The last resort, should the way to a target lead past the end of the range, or further away from it."""
        if self._limits.outside(position) is None:
            return position
        rows = zip(self._limits.lower, self._limits.upper, self.position, position, strict=True)
        return joints([max(min(low, old), min(max(high, old), new)) for low, high, old, new in rows])


def _way_to_stop(speed: float, acceleration: float, jerk: float) -> float:
    """How far a joint goes on that brakes at ``speed`` [rad/s], at most [rad]."""
    return 0.5 * speed * (speed / acceleration + 3.0 * acceleration / jerk)
