"""The feed-forward limiter: the next speed that is fed forward to one arm, within what its joints may do."""

from __future__ import annotations

from collections.abc import Sequence

from yumi.control.motion import EGM_GAIN, SERVO_CYCLES, Setpoint, fixed, ramp_speed, speed_to_stop
from yumi.robot.joints import CYCLE, JOINT_COUNT, ZERO, ArmState, JointLimits, Joints, joints

_CORRECTED = 1.5  # times a joint's acceleration
_EXACT = 0.995  # of an acceleration: where the robot will report to be is not predicted better
_REST = 1e-6  # [rad/s] slower than this, in two cycles one after the other, is no motion

UNEXPECTED = 0.02
"""A plan further from where it was led to than this is not explained by the robot's own cap on speeds [rad]."""


def _reported(state: ArmState, later: float) -> list[float]:
    """Where a robot will report to be ``later`` [s] from now [rad], (7,): it is on the way to its plan."""
    share = min(1.0, later / (SERVO_CYCLES * CYCLE))
    return [now + share * (plan - now) for now, plan in zip(state.position, state.planned, strict=True)]


class FeedForwardLimiter:
    """The speeds fed forward to one arm so far, and the speeds the arm has by now.

    A robot in EGM plans to move at ``k · (position reference - reported position) + speed reference``, and uses a
    command a cycle after it was taken (reference/egm.md §6.1). Each of the two may be
    within the limits and their sum not: a position that runs ahead already asks for a speed. So the sum is what is kept
    within the joints' velocity, acceleration and jerk, and able to stop before the end of their ranges; a sum that is
    smooth passes unchanged.

    Args:
        limits: of the joints.
        gain: of the robot's position loop [1/s]; 0 where it follows speeds only.
        period: time between two states of the arm [s].

    Attributes:
        velocity: the speed sent last [rad/s], (7,).
        is_bounded: whether it is less than was desired.
    """

    def __init__(self, limits: JointLimits, gain: float = EGM_GAIN, period: float = CYCLE) -> None:
        self.velocity: Joints = ZERO
        self.is_bounded = False
        self._gain = gain
        self._used_after = (
            period + CYCLE
        )  # from a state to the use of its reply [s]: a period, and a cycle in the robot
        self._limits = limits
        self._is_feeding = False
        self._speeds = [0.0] * JOINT_COUNT
        self._rates = [0.0] * JOINT_COUNT
        self._places: list[float] = []
        self._state: ArmState | None = None
        self._position: Joints = ZERO
        self._position_before: Joints = ZERO

    @property
    def motion(self) -> Setpoint | None:
        """How the robot will move when it takes the last command; None where no speed is fed forward."""
        if not self._is_feeding or not self._places:
            return None
        return Setpoint(fixed(self._places), fixed(self._speeds), fixed(self._rates))

    def limit(self, limits: JointLimits) -> None:
        """Apply other limits from the next command on."""
        self._limits = limits

    def end(self) -> None:
        """Forget; no speed is fed forward from now on."""
        self.velocity, self._is_feeding, self._state = ZERO, False, None

    def resume(self, state: ArmState, position: Joints) -> None:
        """Go on from the motion of a robot that repeated the last command for a while.

        Args:
            state: of the robot by now.
            position: the position reference it got last [rad], (7,).
        """
        if self._is_feeding:
            speeds = zip(self._led(position, _reported(state, CYCLE)), self.velocity, strict=True)
            self._speeds, self._rates = [led + fed for led, fed in speeds], [0.0] * JOINT_COUNT
        elif self._state is not None:
            # A speed that sets in now must not take the way since the last known state for the motion of one cycle.
            self._state, self._position, self._position_before = state, position, position

    def follow(self, speeds: list[float], dt: float) -> None:
        """Come to the motion of a robot that does not follow the last commands: ``speeds`` [rad/s] of its joints.

        Within some cycles, as it may follow them all the same, and its reports be late.
        """
        if self._is_feeding:
            rows = zip(speeds, self._speeds, self._limits.acceleration, strict=True)
            steps = [(speed, old, _CORRECTED * top * dt) for speed, old, top in rows]
            self._speeds = [max(old - most, min(old + most, speed)) for speed, old, most in steps]
            self._rates = [0.0] * JOINT_COUNT

    def observe(self, state: ArmState, position: Joints) -> None:
        """The robot's state and the position reference it got then [rad], (7,), after each reply.

        What it makes of them is the motion that a speed sets in upon.
        """
        self._position_before = position if self._state is None else self._position
        self._state, self._position = state, position

    def next(self, state: ArmState, position: Joints, desired: Joints, dt: float) -> Joints:
        """The speed that may be fed forward [rad/s], (7,), next to ``desired``.

        Args:
            state: of the robot; the last commands are not in it yet.
            position: the position reference that goes with it [rad], (7,), limited already.
            desired: the speed [rad/s], (7,).
            dt: time since the last command [s] > 0.
        """
        self.is_bounded = False
        if desired is ZERO and not self._is_feeding:
            return ZERO
        if not self._is_feeding:
            self._begin(state, dt)
        predicted = self._used_after
        if self._state is not None:
            rows = zip(self._state.planned, state.planned, self._speeds, strict=True)
            if max(abs(now - last - speed * dt) for last, now, speed in rows) > UNEXPECTED:
                predicted = 0.0
                self.resume(state, self._position)
        limits, fed = self._limits, []
        # New lists: for a command that is not sent, the ones before are taken back.
        self._speeds, self._rates, self._places = self._speeds.copy(), self._rates.copy(), []
        reported = _reported(state, self._used_after)
        values = zip(state.planned, reported, position, desired, self._speeds, strict=True)
        for index, (now, then, ahead, speed, last) in enumerate(values):
            place = now + last * predicted  # where the robot will plan to be by then
            self._places.append(place)
            most, top, jerk = limits.velocity[index], limits.acceleration[index], limits.jerk[index]
            lead = self._gain * (ahead - then)
            goal = lead + max(-most, min(most, speed))
            room = limits.upper[index] - place if goal > 0.0 else place - limits.lower[index]
            total, self._rates[index] = ramp_speed(
                goal, last, self._rates[index], min(most, speed_to_stop(room, top, jerk)), _EXACT * top, jerk, dt
            )
            self._speeds[index] = total
            self.is_bounded = self.is_bounded or total != goal
            fed.append(total - lead)
        is_over = desired is ZERO and not self.is_bounded and max(map(abs, (*fed, *self.velocity))) < _REST
        self.velocity, self._is_feeding = (ZERO, False) if is_over else (joints(fed), True)
        return self.velocity

    def _begin(self, state: ArmState, dt: float) -> None:
        """Set in upon the motion that the position references before made."""
        if self._state is None:
            self._speeds, self._rates = [0.0] * JOINT_COUNT, [0.0] * JOINT_COUNT
            return
        self._speeds = self._led(self._position, state.position)
        before = self._led(self._position_before, self._state.position)
        rates = zip(self._speeds, before, self._limits.acceleration, strict=True)
        self._rates = [max(-top, min(top, (new - old) / dt)) for new, old, top in rates]

    def against(self, state: ArmState, position: Joints) -> Joints:
        """The speed that keeps the robot from following a position reference [rad/s], (7,)."""
        return joints([-speed for speed in self._led(position, _reported(state, self._used_after))])

    def _led(self, position: Joints, reported: Sequence[float]) -> list[float]:
        """How fast a robot that reports to be there sets out towards a position reference [rad/s]."""
        return [self._gain * (ahead - now) for ahead, now in zip(position, reported, strict=True)]
