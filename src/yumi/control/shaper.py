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

from ruckig import ControlInterface, InputParameter, OutputParameter, Ruckig, Synchronization

from yumi.control.braking import braking_reach, speed_to_come
from yumi.control.goal_motion import Goal, GoalMotion
from yumi.control.online_step import take_step
from yumi.robot.joints import JOINT_COUNT, Joints, joints
from yumi.robot.limits import JointLimits
from yumi.robot.values import ZERO

_ROUNDING = 1.0 + 1e-6  # a command that uses a limit fully is not refused for its last digit
_CAUTION = 0.99  # an outlook is for one period, a robot's clock tells another by its last digits
_NOWHERE = -1.0  # [rad] a distance that no step keeps
_CLOSE = 1e-9  # [rad] a joint may come to rest at the end of its range
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


class _Step(NamedTuple):
    """Where a joint is at the end of a step, and how it moves then; in [rad] and [s]."""

    position: float
    velocity: float
    acceleration: float


_Motion = tuple[float, float]
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
        self._goal = GoalMotion(limits)
        self._outlook: _Outlook | None = None
        self._glided: tuple[Joints, float] | None = None  # from where and for how long, not yet in the speeds
        self._planned: dict[int, _Motion] = {}  # of joints whose last step was planned: how they move at its end
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
        self.position = position
        self._velocity = self._acceleration = ZERO
        self._goal.rest_at(position)
        self._outlook = self._glided = None
        self._planned, self._chasing = {}, frozenset()

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
        self.position = wanted
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
        self.position, self._velocity, self._acceleration = wanted, velocity, acceleration
        self._goal.note(wanted, velocity, acceleration)
        self._outlook, self._planned = None, {}
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
        goals = self._goal.move(wanted, dt, elapsed)
        self._outlook = None
        motion = [self._planned.get(index) or self._estimate(index, dt) for index in range(JOINT_COUNT)]
        steps = self._steps_to(goals, motion, dt, is_late)
        must_brake = [late and not self._is_safe(index, *steps[index]) for index, late in enumerate(is_late)]
        if any(must_brake):
            brakes = self._steps_to_rest(motion, dt, must_brake)
            rows = zip(steps, brakes, must_brake, strict=True)
            steps = [brake if is_braking else step for step, brake, is_braking in rows]
        self._take(steps, goals, dt, is_late)
        return self.position

    def place_to_stop(self) -> Joints:
        """Where the motion so far comes to rest that brakes as hard as it may [rad], (7,), within the range."""
        self._settle()
        places = []
        rows = zip(self.position, self._velocity, self._acceleration, *self._bounds, strict=True)
        for now, velocity, acceleration, low, high, _, top, jerk in rows:
            lowest, highest = braking_reach(velocity, acceleration, top, jerk)
            places.append(max(min(low, now), min(max(high, now), now + (highest if velocity > 0.0 else lowest))))
        return joints(places)

    def _rates(self, position: Joints, dt: float) -> tuple[Joints, Joints]:
        """Velocity and acceleration of the step from the last position to this one, as differences."""
        velocity = joints([(new - old) / dt for old, new in zip(self.position, position, strict=True)])
        return velocity, joints([(new - old) / dt for old, new in zip(self._velocity, velocity, strict=True)])

    def _rows(
        self, position: Joints, velocity: Joints, acceleration: Joints
    ) -> Iterator[tuple[int, float, float, float]]:
        return zip(range(JOINT_COUNT), position, velocity, acceleration, strict=True)

    def _take(self, steps: list[_Step], goals: list[Goal], dt: float, is_late: list[bool]) -> None:
        """Take the steps; a joint on a planned way stays on it until it moves as its goal does."""
        position = self._kept_in_range(joints([step.position for step in steps]))
        self._velocity, self._acceleration = self._rates(position, dt)
        self._planned = {
            index: (step.velocity, step.acceleration) for index, step in enumerate(steps) if is_late[index]
        }
        self._chasing = frozenset(
            index for index in self._planned if not self._has_arrived(index, steps[index], goals[index], dt)
        )
        self.position = position

    def _has_arrived(self, index: int, step: _Step, goal: Goal, dt: float) -> bool:
        """Whether a joint moves as its goal does: what is left of the way is less than half a step may change."""
        change = 0.5 * self._limits.jerk[index] * dt
        return (
            abs(step.position - goal.position) < change * dt * dt
            and abs(step.velocity - goal.velocity) < change * dt
            and abs(step.acceleration - goal.acceleration) < change
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
        self._goal.note(self.position, velocity, self._acceleration)
        self._planned = {}

    def _steps_to(self, goals: list[Goal], motion: list[_Motion], dt: float, is_late: list[bool]) -> list[_Step]:
        """A step of each joint on its quickest way to its goal, planned as seen from there at the end of the step.

        Joints that are not late go to their goals; if there is no way, those that are late brake.
        """
        given, output, limits = self._input, self._output, self._limits
        given.enabled = is_late
        given.current_position = [
            old - (goal.position - dt * (goal.velocity - 0.5 * dt * goal.acceleration))
            for old, goal in zip(self.position, goals, strict=True)
        ]
        rows = list(zip(motion, goals, strict=True))
        given.current_velocity = [now - (goal.velocity - dt * goal.acceleration) for (now, _), goal in rows]
        given.current_acceleration = [now - goal.acceleration for (_, now), goal in rows]
        given.max_velocity = [top - goal.velocity for top, goal in zip(limits.velocity, goals, strict=True)]
        given.min_velocity = [-top - goal.velocity for top, goal in zip(limits.velocity, goals, strict=True)]
        given.max_acceleration = [top - goal.acceleration for top, goal in zip(limits.acceleration, goals, strict=True)]
        given.min_acceleration = [
            -top - goal.acceleration for top, goal in zip(limits.acceleration, goals, strict=True)
        ]
        if not take_step(self._generator, given, output, dt):
            return self._steps_to_rest(motion, dt, is_late)
        ways = zip(goals, output.new_position, output.new_velocity, output.new_acceleration, is_late, strict=True)
        return [
            _Step(goal.position + p, goal.velocity + v, goal.acceleration + a) if late else _Step(*goal)
            for goal, p, v, a, late in ways
        ]

    def _steps_to_rest(self, motion: list[_Motion], dt: float, is_braking: list[bool]) -> list[_Step]:
        """A step of each joint that brakes as hard as it may: what is possible from any state that is safe."""
        given, output = self._brake, self._output
        given.enabled = is_braking
        given.current_position = list(self.position)
        given.current_velocity = [velocity for velocity, _ in motion]
        given.current_acceleration = [acceleration for _, acceleration in motion]
        if not take_step(self._generator, given, output, dt):
            return [self._slower(index, velocity, dt) for index, (velocity, _) in enumerate(motion)]
        ways = zip(output.new_position, output.new_velocity, output.new_acceleration, strict=True)
        return [_Step(*each) for each in ways]

    def _slower(self, index: int, velocity: float, dt: float) -> _Step:
        """The same without a generator, at the highest acceleration."""
        slower = copysign(max(0.0, abs(velocity) - self._limits.acceleration[index] * dt), velocity)
        return _Step(self.position[index] + 0.5 * (velocity + slower) * dt, slower, 0.0)

    def _estimate(self, index: int, dt: float) -> _Motion:
        """Velocity and acceleration at the end of the last step, where only differences are known."""
        acceleration = self._acceleration[index]
        return self._velocity[index] + 0.5 * acceleration * dt, acceleration

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
