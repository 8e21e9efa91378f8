"""The feed-forward limiter: the next speed that is fed forward to one arm, within what its joints may do."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from yumi.control.motion import EGM_GAIN, SERVO_CYCLES, Setpoint, fixed, ramp_speed, speed_to_stop
from yumi.robot.joints import CYCLE, ZERO, ArmState, JointLimits, Joints, joints

_CORRECTED = 1.5  # times a joint's acceleration
_EXACT = 0.995  # of an acceleration: where the robot will report to be is not predicted better
_REST = 1e-6  # [rad/s] slower than this, in two cycles one after the other, is no motion

UNEXPECTED = 0.02
"""A plan further from where it was led to than this is not explained by the robot's own cap on speeds [rad]."""


def _reported(state: ArmState, later: float) -> list[float]:
    """Where a robot will report to be ``later`` [s] from now [rad], (7,): it is on the way to its plan."""
    share = min(1.0, later / (SERVO_CYCLES * CYCLE))
    return [now + share * (plan - now) for now, plan in zip(state.position, state.planned, strict=True)]


class _Seen(NamedTuple):
    """What a robot was seen to make of the positions it was sent.

    Attributes:
        state: replied to last.
        position: the position reference that the robot had then [rad], (7,).
        before: the one before that [rad], (7,).
    """

    state: ArmState
    position: Joints
    before: Joints


class FedForward(NamedTuple):
    """The speeds fed forward to an arm so far, and how the arm moves by now.

    Attributes:
        velocity: the speed sent last [rad/s], (7,); the tuple ``ZERO`` itself for none.
        robot: how the robot will move when it takes the last command; None where no speed is fed forward.
        is_bounded: whether the speed is less than was desired.
        seen: what a speed sets in upon; None before the first reply.
    """

    velocity: Joints = ZERO
    robot: Setpoint | None = None
    is_bounded: bool = False
    seen: _Seen | None = None

    def observed(self, state: ArmState, position: Joints) -> FedForward:
        """After the reply to ``state``, when the robot got this position reference [rad], (7,)."""
        before = position if self.seen is None else self.seen.position
        return FedForward(self.velocity, self.robot, self.is_bounded, _Seen(state, position, before))


class FeedForwardLimiter:
    """Limits the speeds fed forward to one arm.

    A robot in EGM plans to move at ``k · (position reference - reported position) + speed reference``, and uses a
    command a cycle after it was taken (reference/egm.md §6.1). Each of the two may be
    within the limits and their sum not: a position that runs ahead already asks for a speed. So the sum is what is kept
    within the joints' velocity, acceleration and jerk, and able to stop before the end of their ranges; a sum that is
    smooth passes unchanged. Nothing is kept here between two steps.

    Args:
        limits: of the joints.
        gain: of the robot's position loop [1/s]; 0 where it follows speeds only.
        period: time between two states of the arm [s].
    """

    def __init__(self, limits: JointLimits, gain: float = EGM_GAIN, period: float = CYCLE) -> None:
        self._limits: Final = limits
        self._gain: Final = gain
        self._used_after: Final = period + CYCLE  # from a state to the use of its reply [s]: a period, a robot's cycle

    def step(self, fed: FedForward, state: ArmState, position: Joints, desired: Joints, dt: float) -> FedForward:
        """With the speed that may be fed forward next to ``desired``.

        Args:
            fed: forward so far.
            state: of the robot; the last commands are not in it yet.
            position: the position reference that goes with it [rad], (7,), limited already.
            desired: the speed [rad/s], (7,).
            dt: time since the last command [s] > 0.
        """
        if desired is ZERO and fed.robot is None:
            return fed
        robot, seen, predicted = fed.robot or self._begin(fed, state, dt), fed.seen, self._used_after
        if seen is not None:
            rows = zip(seen.state.planned, state.planned, robot.velocity, strict=True)
            if max(abs(now - last - speed * dt) for last, now, speed in rows) > UNEXPECTED:
                predicted = 0.0
                resumed = self.resume(fed, state, seen.position)
                robot, seen = resumed.robot or robot, resumed.seen
        limits, is_bounded = self._limits, False
        places, speeds, rates, velocity = [], [], [], []
        reported = _reported(state, self._used_after)
        values = zip(state.planned, reported, position, desired, robot.velocity, robot.acceleration, strict=True)
        for index, (now, then, ahead, speed, last, rate) in enumerate(values):
            place = now + last * predicted  # where the robot will plan to be by then
            most, top, jerk = limits.velocity[index], limits.acceleration[index], limits.jerk[index]
            lead = self._gain * (ahead - then)
            goal = lead + max(-most, min(most, speed))
            room = limits.upper[index] - place if goal > 0.0 else place - limits.lower[index]
            total, change = ramp_speed(
                goal, last, rate, min(most, speed_to_stop(room, top, jerk)), _EXACT * top, jerk, dt
            )
            is_bounded = is_bounded or total != goal
            places.append(place)
            speeds.append(total)
            rates.append(change)
            velocity.append(total - lead)
        if desired is ZERO and not is_bounded and max(map(abs, (*velocity, *fed.velocity))) < _REST:
            return FedForward(seen=seen)
        return FedForward(joints(velocity), Setpoint(fixed(places), fixed(speeds), fixed(rates)), is_bounded, seen)

    def resume(self, fed: FedForward, state: ArmState, position: Joints) -> FedForward:
        """Going on from the motion of a robot that repeated the last command for a while.

        Args:
            fed: forward so far.
            state: of the robot by now.
            position: the position reference it got last [rad], (7,).
        """
        if fed.robot is not None:
            rows = zip(self._led(position, _reported(state, CYCLE)), fed.velocity, strict=True)
            return fed._replace(robot=Setpoint(fed.robot.position, fixed([led + speed for led, speed in rows])))
        if fed.seen is not None:
            # A speed that sets in now must not take the way since the last known state for the motion of one cycle.
            return fed._replace(seen=_Seen(state, position, position))
        return fed

    def follow(self, fed: FedForward, speeds: list[float], dt: float) -> FedForward:
        """Coming to the motion of a robot that does not follow the last commands: ``speeds`` [rad/s] of its joints.

        Within some cycles, as it may follow them all the same, and its reports be late.
        """
        if fed.robot is None:
            return fed
        rows = zip(speeds, fed.robot.velocity, self._limits.acceleration, strict=True)
        steps = [(speed, old, _CORRECTED * top * dt) for speed, old, top in rows]
        slowed = fixed([max(old - most, min(old + most, speed)) for speed, old, most in steps])
        return fed._replace(robot=Setpoint(fed.robot.position, slowed))

    def against(self, state: ArmState, position: Joints) -> Joints:
        """The speed that keeps the robot from following a position reference [rad/s], (7,)."""
        return joints([-speed for speed in self._led(position, _reported(state, self._used_after))])

    def _begin(self, fed: FedForward, state: ArmState, dt: float) -> Setpoint:
        """The motion that the position references before made, upon which a speed sets in."""
        if fed.seen is None:
            return Setpoint(ZERO)
        speeds = self._led(fed.seen.position, state.position)
        before = self._led(fed.seen.before, fed.seen.state.position)
        rows = zip(speeds, before, self._limits.acceleration, strict=True)
        return Setpoint(ZERO, fixed(speeds), fixed([max(-top, min(top, (new - old) / dt)) for new, old, top in rows]))

    def _led(self, position: Joints, reported: Sequence[float]) -> list[float]:
        """How fast a robot that reports to be there sets out towards a position reference [rad/s]."""
        return [self._gain * (ahead - now) for ahead, now in zip(position, reported, strict=True)]
