"""Where streamed goals are heading: position, velocity and acceleration of each joint, from the goals and their times.

Each joint has a filter with fading memory for motions of constant acceleration (Morrison, *Introduction to Sequential
Smoothing and Prediction*, 1969): it follows such a motion without lag, and what is older counts less by a factor e
each ``memory``. Beside it goes a plain comparison with the last goals, which tells a jump from a motion: a jump moves
the forecast and leaves its speed alone, two in a row are a new speed.

Catches up with a moving target and stays with it, within the joints' velocity, acceleration and jerk.

Near the target the difference to it dies away as a critically damped filter of third order would have it, which lets
noise of the target through only far below its corner. A joint that this would ask too much of is brought to the target
as fast as its limits allow, by the online trajectory generator Ruckig, as seen by someone who moves with the target.
"""

from __future__ import annotations

from math import exp, inf, isnan
from typing import NamedTuple

from ruckig import InputParameter, OutputParameter, Ruckig

from yumi.control.motion import take_step
from yumi.robot.joints import JOINT_COUNT, ZERO, JointLimits, Joints, joints

_RESOLUTION = 2e-4
"""A goal this far from where it was expected is where it was expected [rad]."""

_UNPUNCTUAL = 0.005
"""By how much the time between two goals may be wrong: what a network and a scheduler add now and then [s]."""

_SHORTEST = 0.0005
"""Goals that come closer upon each other tell nothing about a speed [s]."""

_HARDER = 1.5  # a goal may be asked to accelerate somewhat more than the joint can follow
_LEARNING = 0.1  # weight of one interval in the learned period
_MISSED = 3.0  # goals missing in a row mean that the stream has ended


class Target(NamedTuple):
    """Where goals are at one moment: positions [rad], velocities [rad/s] and accelerations [rad/s²], each (7,)."""

    position: Joints
    velocity: Joints = ZERO
    acceleration: Joints = ZERO


class _Gains(NamedTuple):
    """What a surprise does to position, velocity and acceleration, for goals ``interval`` [s] apart."""

    interval: float
    position: float
    velocity: float
    acceleration: float


def fading_gains(interval: float, memory: float) -> _Gains:
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
    """The goals of one joint.

    Args:
        top: highest speed of the joint [rad/s].
        strength: its highest acceleration [rad/s²].
    """

    __slots__ = ("_last", "_pace", "_strength", "_surprise", "_top", "acceleration", "position", "velocity")

    def __init__(self, top: float, strength: float) -> None:
        self._top, self._strength = top, strength
        self.rest_at(0.0)

    def rest_at(self, position: float) -> None:
        self.position = self._last = position
        self.velocity = self.acceleration = self._pace = self._surprise = 0.0

    def take(self, goal: float, gains: _Gains) -> None:
        """The next goal [rad], ``gains.interval`` after the last one."""
        dt = gains.interval
        self.position += dt * (self.velocity + 0.5 * dt * self.acceleration)
        self.velocity += dt * self.acceleration
        if not self._begins_anew(goal, dt):
            wrong = goal - self.position
            self.position += gains.position * wrong
            self.velocity += gains.velocity * wrong
            self.acceleration += gains.acceleration * wrong
        self._last = goal
        self.velocity = max(-self._top, min(self._top, self.velocity))
        self.acceleration = max(-self._strength, min(self._strength, self.acceleration))

    def take_motion(self, goal: float, velocity: float, gains: _Gains) -> None:
        """The next goal [rad], of which the velocity [rad/s] is given too."""
        gain = gains.position * (velocity - self.velocity) / gains.interval - gains.position * self.acceleration
        self.position = self._last = goal
        self.velocity = self._pace = max(-self._top, min(self._top, velocity))
        self.acceleration = max(-self._strength, min(self._strength, self.acceleration + gain))
        self._surprise = 0.0

    def _begins_anew(self, goal: float, dt: float) -> bool:
        """Whether the goal set out with a new speed; one that only jumped takes the forecast with it."""
        way, before = goal - self._last, self._surprise
        # The last step knows a hard acceleration at once, the filter is not misled by a goal that came late.
        surprise = min(way - self._pace * dt, way - self.velocity * dt, key=abs)
        late = _UNPUNCTUAL * max(abs(self._pace), abs(self.velocity))
        if abs(surprise) < _RESOLUTION + late + _HARDER * self._strength * dt * dt:
            self._surprise = 0.0
            if dt > _SHORTEST:
                self._pace = way / dt
            return False
        self._surprise = surprise
        if surprise * before <= 0.0 or abs(way) > self._top * dt:
            self.position += surprise
            return False
        self.position, self.velocity, self.acceleration = goal, way / dt, 0.0
        self._pace, self._surprise = way / dt, 0.0
        return True


class GoalForecast:
    """Forecasts the goals of one arm.

    Args:
        limits: what the joints can do; nobody means to stream more.

    Attributes:
        memory: how long a goal counts [s]; a longer memory takes noise better, a shorter one changes of acceleration.
        silence: a stream that has been silent for so long has ended [s]; a slow one is given three of its periods.
    """

    def __init__(self, limits: JointLimits) -> None:
        self.memory = 0.020
        self.silence = 0.030
        self._tracks = tuple(
            _Track(top, strength) for top, strength in zip(limits.velocity, limits.acceleration, strict=True)
        )
        self._goal: Joints = ZERO
        self._time = -inf
        self._period = 0.0

    def rest_at(self, position: Joints) -> None:
        """Begin again, with a goal that does not move."""
        self._goal, self._time, self._period = position, -inf, 0.0
        for track, value in zip(self._tracks, position, strict=True):
            track.rest_at(value)

    def take(self, goal: Joints, velocity: Joints, time: float) -> None:
        """The next goal.

        Args:
            goal: positions [rad], (7,).
            velocity: velocities [rad/s], (7,); NaN where the sender gave none.
            time: when it was sent or, if nothing better is known, when it arrived [s].
        """
        interval = time - self._time
        is_stream = interval < self._patience
        if is_stream:
            gains = fading_gains(max(interval, _SHORTEST), self.memory)
            for track, value, speed in zip(self._tracks, goal, velocity, strict=True):
                if isnan(speed):
                    track.take(value, gains)
                else:
                    track.take_motion(value, speed, gains)
            self._period += _LEARNING * (interval - self._period)
        else:
            self._begin(goal, velocity, interval)
        self._goal, self._time = goal, max(time, self._time)

    def at(self, now: float, ahead: float) -> Target:
        """Where the goals will be ``ahead`` [s] after ``now`` [s]; where the last one was when no more come."""
        if now - self._time > self._patience:
            return Target(self._goal)
        after = now - self._time + ahead
        return Target(
            joints([t.position + after * (t.velocity + 0.5 * after * t.acceleration) for t in self._tracks]),
            joints([t.velocity + after * t.acceleration for t in self._tracks]),
            joints([t.acceleration for t in self._tracks]),
        )

    @property
    def goal(self) -> Joints:
        """The last goal [rad], (7,)."""
        return self._goal

    @property
    def _patience(self) -> float:
        return max(self.silence, _MISSED * self._period)

    def _begin(self, goal: Joints, velocity: Joints, interval: float) -> None:
        self._period = 0.0
        for index in range(JOINT_COUNT):
            self._tracks[index].rest_at(goal[index])
            if not isnan(velocity[index]):
                self._tracks[index].take_motion(goal[index], velocity[index], _Gains(1.0, 0.0, 0.0, 0.0))


_SHARE = 0.95  # of the limits, since the guard looks at differences from cycle to cycle
_PACE = 0.9  # a target that moves nearly as fast as the joint cannot be caught up with
_NEAR = 3e-4  # a chase ends when the filter would go no further than this past the target [rad]


class _Joint:
    """One joint on its way.

    Args:
        velocity, acceleration, jerk: its limits, in [rad] and [s].
    """

    __slots__ = ("_is_chasing", "_limits", "_tools", "acceleration", "position", "velocity")

    def __init__(self, velocity: float, acceleration: float, jerk: float) -> None:
        self._limits = (_SHARE * velocity, _SHARE * acceleration, _SHARE * jerk)
        self._tools: tuple[Ruckig, InputParameter, OutputParameter] | None = None
        self.begin(0.0, 0.0)

    def begin(self, position: float, velocity: float) -> None:
        self.position, self.velocity, self.acceleration = position, velocity, 0.0
        self._is_chasing = False

    def step(self, target: float, speed: float, gain: float, dt: float, stiffness: float, scale: float) -> None:
        """Go on for ``dt`` [s], at whose end the target is at ``target`` [rad] with ``speed`` and acceleration."""
        w = stiffness
        behind = self.position - (target - dt * (speed - 0.5 * dt * gain))
        slower = self.velocity - (speed - dt * gain)
        weaker = self.acceleration - gain
        if self._is_chasing and max(abs(behind), abs(slower) / w, abs(weaker) / (w * w)) > _NEAR:
            self._chase(target, speed, gain, dt, scale)
            return
        # The difference is (a + b·t + c·t²)·exp(-w·t).
        b, c = slower + w * behind, 0.5 * (weaker + w * (2.0 * slower + w * behind))
        left, value, slope = exp(-w * dt), behind + dt * (b + dt * c), b + 2.0 * c * dt
        velocity = speed + (slope - w * value) * left
        acceleration = gain + (2.0 * c - 2.0 * w * slope + w * w * value) * left
        top, strength, jerk = self._limits
        if (
            abs(velocity) > scale * top
            or abs(acceleration) > strength
            or abs(acceleration - self.acceleration) > jerk * dt
        ):
            self._chase(target, speed, gain, dt, scale)
            return
        self._is_chasing = False
        self.position, self.velocity, self.acceleration = target + value * left, velocity, acceleration

    def _chase(self, target: float, speed: float, gain: float, dt: float, scale: float) -> None:
        """As seen by someone who moves with the target, as long as the joint is stronger than the target."""
        self._is_chasing = True
        top, strength = scale * self._limits[0], self._limits[1]
        speed = speed if abs(speed) < _PACE * top else 0.0
        gain = gain if abs(gain) < _PACE * strength else 0.0
        generator, given, output = self._generator()
        given.current_position = [self.position - (target - dt * (speed - 0.5 * dt * gain))]
        given.current_velocity = [self.velocity - (speed - dt * gain)]
        given.current_acceleration = [self.acceleration - gain]
        given.max_velocity, given.min_velocity = [top - speed], [-top - speed]
        given.max_acceleration, given.min_acceleration = [strength - gain], [-strength - gain]
        if not take_step(generator, given, output, dt):
            self.begin(self.position, 0.0)
            return
        self.position = target + output.new_position[0]
        self.velocity = speed + output.new_velocity[0]
        self.acceleration = gain + output.new_acceleration[0]

    def end(self) -> None:
        """Give the generator back; it is made again when it is needed."""
        self._tools = None

    def _generator(self) -> tuple[Ruckig, InputParameter, OutputParameter]:
        if self._tools is None:
            given = InputParameter(1)
            given.max_jerk, given.target_position = [self._limits[2]], [0.0]
            self._tools = (Ruckig(1, 0.004), given, OutputParameter(1))
        return self._tools


class Pursuit:
    """The joints of one arm after a target.

    Args:
        limits: what the joints may do.

    Attributes:
        stiffness: corner of the filter [rad/s]; larger follows more closely and lets more noise through.
    """

    def __init__(self, limits: JointLimits) -> None:
        self.stiffness = 40.0
        self._joints = tuple(
            _Joint(*each) for each in zip(limits.velocity, limits.acceleration, limits.jerk, strict=True)
        )

    def begin(self, position: Joints, velocity: Joints = ZERO) -> None:
        """Begin again, at ``position`` [rad] with ``velocity`` [rad/s], (7,)."""
        for joint, place, speed in zip(self._joints, position, velocity, strict=True):
            joint.begin(place, speed)

    def end(self) -> None:
        """Give back what the generator holds outside of Python; :meth:`begin` goes on."""
        for joint in self._joints:
            joint.end()

    def step(self, target: Target, dt: float, scale: float = 1.0) -> Target:
        """Go on for ``dt`` [s] > 0, with at most ``scale`` times the joints' speeds; where the joints are then."""
        stiffness = self.stiffness
        for joint, position, speed, gain in zip(self._joints, *target, strict=True):
            joint.step(position, speed, gain, dt, stiffness, scale)
        return Target(
            joints([joint.position for joint in self._joints]),
            joints([joint.velocity for joint in self._joints]),
            joints([joint.acceleration for joint in self._joints]),
        )
