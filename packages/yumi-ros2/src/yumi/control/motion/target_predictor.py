"""The target predictor: where a stream of goals is, and how it moves, almost without lag.

Position, velocity and acceleration of each joint's goal are estimated from the goals and their times, by a
filter with fading memory for motions of constant acceleration (Morrison, *Introduction to Sequential Smoothing and
Prediction*, 1969): it follows such a motion without lag, and what is older counts less by a factor e each ``memory``.
Beside it goes a plain comparison with the last goals, which finds jumps: a jump moves the prediction and leaves its
speed alone, two in a row are a new speed.
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp, inf, isnan
from typing import NamedTuple

from abb_protocols.robot.joints import ZERO_JOINTS, JointLimits, Joints, joints
from yumi.control.motion.setpoint import Setpoint

LONGEST_STREAM_INTERVAL = 0.25
"""Goals that are further apart than this are goals of their own, no stream [s]."""

_RESOLUTION = 2e-4
"""A goal this far from where it was expected is where it was expected [rad]."""

_UNPUNCTUAL = 0.005
"""By how much the time between two goals may be wrong: what a network and a scheduler add now and then [s]."""

_SHORTEST = 0.0005
"""Goals that come closer upon each other say nothing about a speed [s]."""

_HARDER = 1.5  # a goal may be asked to accelerate somewhat more than the joint can follow
_LEARNING = 0.1  # weight of one interval in the learned period
_MISSED = 3.0  # goals missing in a row mean that the stream has ended
_LONGEST_PATIENCE = 0.25  # [s] with a slow one; by then it has led the arm far enough into the unknown


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
        self.goal: Joints = ZERO_JOINTS
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
        if interval < LONGEST_STREAM_INTERVAL:  # a slow stream is one, too
            self._period += (interval - self._period) * (_LEARNING if self._period else 1.0)
        if interval < max(LONGEST_STREAM_INTERVAL, self.patience):
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
        if self.is_over(now):
            return Setpoint(self.goal)
        after = now - self._time + ahead
        return Setpoint(
            joints([t.position + after * (t.velocity + 0.5 * after * t.acceleration) for t in self._tracks]),
            joints([t.velocity + after * t.acceleration for t in self._tracks]),
            joints([t.acceleration for t in self._tracks]),
        )

    def is_over(self, now: float) -> bool:
        """Whether the stream has ended at ``now`` [s]: no goal has come for too long."""
        return now - self._time > self.patience

    @property
    def speed(self) -> float:
        """Of the fastest joint's goal [rad/s]."""
        return max([abs(track.velocity) for track in self._tracks])

    @property
    def patience(self) -> float:
        """A stream without a goal for so long has ended [s]."""
        return max(self.timeout, min(_MISSED * self._period, _LONGEST_PATIENCE))
