"""Where streamed goals are heading: position, velocity and acceleration of each joint, from the goals and their times.

Each joint has a filter with fading memory for motions of constant acceleration (Morrison, *Introduction to Sequential
Smoothing and Prediction*, 1969): it follows such a motion without lag, and what is older counts less by a factor e
each ``memory``. Beside it goes a plain comparison with the last goals, which tells a jump from a motion: a jump moves
the forecast and leaves its speed alone, two in a row are a new speed.
"""

from __future__ import annotations

from math import exp, inf, isnan
from typing import NamedTuple

from yumi.robot.joints import JOINT_COUNT, Joints, joints
from yumi.robot.limits import JointLimits
from yumi.robot.values import ZERO

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
