"""EGM's control law: from the sensor's references to the positions the arm plans (reference/egm.md §6.1).

``speed = k·(pos_ref - pos) + speed_ref``, where ``pos`` is EGM's own reference, the integral of that speed. The
speed fades in, passes a low-pass filter and is capped with one scale for all joints.
"""

from __future__ import annotations

from math import exp, expm1, pi
from typing import cast

from yumi.robot.joints import Joints
from yumi.robot.limits import JointLimits
from yumi.robot.values import ZERO
from yumi.virtual.arm_motion import MotionState
from yumi.virtual.egm_settings import EgmSettings


class EgmMotion:
    """The motion of an arm that EGM guides; each part of the law is exact for references held during a step.

    Args:
        position: where the arm stands [rad], (7,); the reference until the sensor gives one.
        settings: of the law.
        limits: whose speeds cap the joints beside MaxSpeedDeviation.

    Attributes:
        reference: position last ordered [rad], (7,).
        reference_velocity: speed last fed forward [rad/s], (7,).
        utilization: share of the allowed speed that the references ask for; above 1 the motion is slowed.
    """

    is_finished = False

    def __init__(self, position: Joints, settings: EgmSettings, limits: JointLimits) -> None:
        self._settings = settings
        self._start = position
        self._caps = tuple(min(settings.max_speed, most) for most in limits.velocity)
        self._filtered = ZERO
        self._time = 0.0
        self.reference = position
        self.reference_velocity = ZERO
        self.utilization = 0.0
        self.state = MotionState(position)

    @property
    def start(self) -> Joints:
        """Where EGM began [rad], (7,)."""
        return self._start

    def advance(self, dt: float) -> None:
        self._filtered = self._low_pass(self._wanted_speed(self._fade(dt), dt), dt)
        before, position = self.state, self._moved(self._capped(self._filtered), dt)
        velocity = _rate(before.position, position, dt)  # less than the law's where the deviation is bounded
        self.state = MotionState(position, velocity, _rate(before.velocity, velocity, dt))

    def _fade(self, dt: float) -> float:
        """Mean of the linear ramp-in over the step; afterwards 1."""
        begin, self._time = self._time, self._time + dt
        ramp = self._settings.ramp_in_time
        if begin >= ramp:
            return 1.0
        faded_in = min(self._time, ramp)
        return (faded_in * faded_in - begin * begin) / (2.0 * ramp * dt) + (self._time - faded_in) / dt

    def _wanted_speed(self, fade: float, dt: float) -> Joints:
        gain = self._settings.gain * fade
        # The law closes in exponentially: its mean speed over the step is below that at the start.
        closing = -expm1(-gain * dt) / (gain * dt) if gain > 0.0 else 1.0
        position_share, speed_share = gain * closing, fade * closing
        speed = tuple(
            position_share * (reference - position) + speed_share * velocity
            for reference, position, velocity in zip(
                self.reference, self.state.position, self.reference_velocity, strict=True
            )
        )
        return cast("Joints", speed)

    def _low_pass(self, speed: Joints, dt: float) -> Joints:
        bandwidth = self._settings.bandwidth
        if bandwidth <= 0.0:
            return speed
        share = 1.0 - exp(-2.0 * pi * bandwidth * dt)
        return cast("Joints", tuple(f + (s - f) * share for f, s in zip(self._filtered, speed, strict=True)))

    def _capped(self, speed: Joints) -> Joints:
        """One scale for all joints, so that the direction stays."""
        self.utilization = max(abs(value) / cap for value, cap in zip(speed, self._caps, strict=True))
        if self.utilization <= 1.0:
            return speed
        return cast("Joints", tuple(value / self.utilization for value in speed))

    def _moved(self, speed: Joints, dt: float) -> Joints:
        reach = self._settings.max_deviation
        position = tuple(
            max(start - reach, min(start + reach, now + value * dt))
            for start, now, value in zip(self._start, self.state.position, speed, strict=True)
        )
        return cast("Joints", position)


def _rate(before: Joints, now: Joints, dt: float) -> Joints:
    return cast("Joints", tuple((new - old) / dt for old, new in zip(before, now, strict=True)))
