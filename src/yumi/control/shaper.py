"""Shapes the way to a wanted position so that no joint exceeds its speed, acceleration and jerk.

What is smooth enough passes unchanged; what is not is approached as fast as the limits allow, by the online trajectory
generator Ruckig. A joint never gets so fast that it could not stop before the end of its range.

Most positions are smooth by far. An outlook, made after the reply, tells so by three distances before the next one;
only what it does not vouch for is looked at joint by joint.
"""

from __future__ import annotations

from math import copysign, dist
from typing import NamedTuple

from ruckig import InputParameter, OutputParameter, Result, Ruckig, Synchronization

from yumi.robot.joints import JOINT_COUNT, Joints, joints
from yumi.robot.limits import JointLimits
from yumi.robot.values import ZERO

_PACE = 0.9  # a goal that moves nearly as fast as the joint cannot be caught up with
_ROUNDING = 1.0 + 1e-6  # a command that uses a limit fully is not refused for its last digit
_CAUTION = 0.99  # an outlook is for one period, a robot's clock tells another by its last digits
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


class MotionShaper:
    """The motion of the commands admitted so far: position, velocity and acceleration of each joint.

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
        self._limits = limits
        self._bounds = (limits.lower, limits.upper, limits.acceleration, limits.jerk)
        self._least = tuple(_CAUTION * min(each) for each in (limits.velocity, limits.acceleration, limits.jerk))
        self._generator = Ruckig(JOINT_COUNT, 0.004)
        self._input = InputParameter(JOINT_COUNT)
        self._output = OutputParameter(JOINT_COUNT)
        self._input.max_acceleration = list(limits.acceleration)
        self._input.max_jerk = list(limits.jerk)
        self._input.synchronization = Synchronization.No  # a joint that must wait does not make others wait

    def rest_at(self, position: Joints) -> None:
        """Begin again, at rest."""
        self.position = self._wanted = position
        self._velocity = self._acceleration = ZERO
        self._outlook = self._glided = None

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
        slowest, weakest, gentlest = self._least
        coasting, steady, rooms = [], [], []
        for p, v, a, low, high, top, jerk in zip(
            self.position, self._velocity, self._acceleration, *self._bounds, strict=True
        ):
            coasting.append(p + v * dt)
            steady.append(p + v * dt + a * dt * dt)
            strongest = abs(a) + gentlest * dt
            fastest = abs(v) + strongest * dt + strongest * strongest / (2.0 * jerk)
            rooms.append(min(p - low, high - p) - _way_to_stop(fastest, top, jerk))
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
        velocity = joints([(new - old) / dt for old, new in zip(self.position, wanted, strict=True)])
        acceleration = joints([(new - old) / dt for old, new in zip(self._velocity, velocity, strict=True)])
        if not self._is_smooth(velocity, acceleration, dt) or not self._can_stop(wanted, velocity, acceleration):
            return False
        self.position = self._wanted = wanted
        self._velocity, self._acceleration, self._outlook = velocity, acceleration, None
        return True

    def approach(self, wanted: Joints, dt: float) -> Joints:
        """Go towards ``wanted`` for ``dt`` [s] as fast as the limits allow; the position reached.

        A wanted position that moves is caught up with: the way is planned as seen by someone who moves with it.
        """
        self._settle()
        steps = zip(self._wanted, wanted, strict=True)
        frame = [self._speed_of_goal(index, (new - old) / dt, dt) for index, (old, new) in enumerate(steps)]
        self._wanted, self._outlook = wanted, None
        self._plan(wanted, frame, dt)
        if self._generator.update(self._input, self._output) not in (Result.Working, Result.Finished):
            self.rest_at(self.position)
            return self.position
        before, self.position = self.position, joints(self._output.new_position)
        self._velocity = joints([new + speed for new, speed in zip(self._output.new_velocity, frame, strict=True)])
        self._acceleration = joints(self._output.new_acceleration)
        self._keep_in_range(before)
        return self.position

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

    def _plan(self, wanted: Joints, frame: list[float], dt: float) -> None:
        """The frame coincides with the room's at the end of this step."""
        given, top = self._input, self._limits.velocity
        given.current_position = [old + speed * dt for old, speed in zip(self.position, frame, strict=True)]
        given.current_velocity = [old - speed for old, speed in zip(self._velocity, frame, strict=True)]
        given.current_acceleration = list(self._acceleration)
        given.target_position = list(wanted)
        given.max_velocity = [limit - speed for limit, speed in zip(top, frame, strict=True)]
        given.min_velocity = [-limit - speed for limit, speed in zip(top, frame, strict=True)]
        self._generator.delta_time = dt

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

    def _is_smooth(self, velocity: Joints, acceleration: Joints, dt: float) -> bool:
        limits = self._limits
        for index, top in enumerate(limits.velocity):
            now = acceleration[index]
            if (
                abs(velocity[index]) > top * _ROUNDING
                or abs(now) > limits.acceleration[index] * _ROUNDING
                or abs(now - self._acceleration[index]) > limits.jerk[index] * dt * _ROUNDING
            ):
                return False
        return True

    def _can_stop(self, position: Joints, velocity: Joints, acceleration: Joints) -> bool:
        """Whether each joint could still brake before the end of its range."""
        limits = self._limits
        for index, speed in enumerate(velocity):
            top, jerk = limits.acceleration[index], limits.jerk[index]
            gain = max(0.0, copysign(acceleration[index], speed * acceleration[index])) ** 2 / (2.0 * jerk)
            fastest = abs(speed) + gain
            end = limits.upper[index] if speed > 0.0 else limits.lower[index]
            if _way_to_stop(fastest, top, jerk) > abs(end - position[index]) and fastest > 1e-3:
                return False
        return True

    def _keep_in_range(self, before: Joints) -> None:
        """The last resort, should the way to a target lead past the end of the range, or further away from it."""
        if self._limits.outside(self.position) is None:
            return
        rows = zip(self._limits.lower, self._limits.upper, before, self.position, strict=True)
        for index, (low, high, old, new) in enumerate(rows):
            kept = max(min(low, old), min(max(high, old), new))
            if kept != new:
                self.position = _replaced(self.position, index, kept)
                self._velocity = _replaced(self._velocity, index, 0.0)
                self._acceleration = _replaced(self._acceleration, index, 0.0)


def _way_to_stop(speed: float, acceleration: float, jerk: float) -> float:
    """How far a joint goes on that brakes at ``speed`` [rad/s], at most [rad]."""
    return 0.5 * speed * (speed / acceleration + 3.0 * acceleration / jerk)


def _replaced(values: Joints, index: int, value: float) -> Joints:
    return joints([*values[:index], value, *values[index + 1 :]])
