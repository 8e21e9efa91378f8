"""Following a stream of goals almost without lag: where it is heading, and how the joints get there.

:class:`TargetPredictor` estimates position, velocity and acceleration of each joint's goal from the goals and their
times, by a filter with fading memory for motions of constant acceleration (Morrison, *Introduction to Sequential
Smoothing and Prediction*, 1969): it follows such a motion without lag, and what is older counts less by a factor e
each ``memory``. Beside it goes a plain comparison with the last goals, which finds jumps: a jump moves
the prediction and leaves its speed alone, two in a row are a new speed.

:class:`TrackingFilter` brings the joints to the predicted target. Near it the difference dies away as a critically
damped filter of third order would have it, which lets noise of the target through only far below its corner. A joint
that this would ask too much of is brought there as fast as its limits allow (:func:`yumi.control.motion.step_towards`).
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp, inf, isnan
from typing import NamedTuple

from yumi.control.motion import Setpoint, slower, step_to_rest, step_towards
from yumi.robot.joints import JOINT_COUNT, ZERO, JointLimits, Joints, joints

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


_SHARE = 0.95  # of the limits, since the limiter looks at differences from cycle to cycle
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
