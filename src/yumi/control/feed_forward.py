"""Bounds a speed that is fed forward, by what the robot makes of it together with its position reference.

A robot in EGM moves at ``k · (position reference - planned position) + speed reference``. Each of the two may be
within the limits and their sum not: a position that runs ahead already asks for a speed. So the sum is what is kept
within the joints' velocity, acceleration and jerk, and able to stop before the end of their ranges; a sum that is
smooth passes unchanged.
"""

from __future__ import annotations

from math import copysign, sqrt

from yumi.robot.joints import JOINT_COUNT, Joints, joints
from yumi.robot.limits import JointLimits
from yumi.robot.values import ZERO

EGM_GAIN = 5.0
"""Gain of the robot's own position loop, at which a command's lead becomes speed [1/s] (reference/egm.md §6.1)."""

_ROUNDING = 1.0 + 1e-3  # a speed at a limit is not refused for the last digits of the planned position
_UNEXPECTED = 0.02  # [rad] a plan further from where it was led to than the robot's own cap on speeds explains
_REST = 1e-6  # [rad/s] slower than this, in two cycles one after the other, is no motion


class FeedForward:
    """The speeds fed forward to one arm so far, and the speeds the arm has by now.

    Args:
        limits: what the joints may do.
        gain: of the robot's position loop [1/s]; 0 where it follows speeds only.

    Attributes:
        velocity: the speed admitted last [rad/s], (7,).
        is_bounded: whether less was admitted than was wanted.
    """

    def __init__(self, limits: JointLimits, gain: float = EGM_GAIN) -> None:
        self.velocity: Joints = ZERO
        self.is_bounded = False
        self._gain = gain
        self._limits = limits
        self._is_feeding = False
        self._speeds = [0.0] * JOINT_COUNT
        self._rates = [0.0] * JOINT_COUNT
        self._planned: Joints | None = None
        self._position: Joints = ZERO
        self._position_before: Joints = ZERO

    def limit(self, limits: JointLimits) -> None:
        """Take other limits from the next command on."""
        self._limits = limits

    def end(self) -> None:
        """Forget; the robot is told no speed from now on."""
        self.velocity, self._is_feeding, self._planned = ZERO, False, None

    def resume(self, planned: Joints, position: Joints) -> None:
        """Go on from the motion that a robot has come to which repeated the last command for a while.

        Args:
            planned: where it plans to be by now [rad], (7,).
            position: the position reference it was told last [rad], (7,).
        """
        if self._is_feeding:
            speeds = zip(self._led(position, planned), self.velocity, strict=True)
            self._speeds, self._rates = [led + fed for led, fed in speeds], [0.0] * JOINT_COUNT

    def note(self, planned: Joints, position: Joints) -> None:
        """Note where the robot planned to be and the position reference it was told then, both [rad], (7,).

        What it makes of them is the motion that a speed sets in upon.
        """
        self._position_before = position if self._planned is None else self._position
        self._planned, self._position = planned, position

    def admit(self, planned: Joints, position: Joints, velocity: Joints, dt: float) -> Joints:
        """The speed that may be fed forward [rad/s], (7,), next to ``velocity``.

        Args:
            planned: where the robot plans to be [rad], (7,); the command before this one is not in it yet.
            position: the position reference that goes with it [rad], (7,), admitted already.
            velocity: the speed wanted [rad/s], (7,).
            dt: time since the last command [s] > 0.
        """
        self.is_bounded = False
        if velocity is ZERO and not self._is_feeding:
            return ZERO
        if not self._is_feeding:
            self._begin(planned, dt)
        predicted = dt
        if self._planned is not None:
            rows = zip(self._planned, planned, self._speeds, strict=True)
            if max(abs(now - last - speed * dt) for last, now, speed in rows) > _UNEXPECTED:
                predicted = 0.0
                self.resume(planned, self._position)
        admitted = [
            self._admit_joint(index, now + last * predicted, ahead, speed, last, dt)
            for index, (now, ahead, speed, last) in enumerate(
                zip(planned, position, velocity, tuple(self._speeds), strict=True)
            )
        ]
        is_over = velocity is ZERO and not self.is_bounded and max(map(abs, (*admitted, *self.velocity))) < _REST
        self.velocity, self._is_feeding = (ZERO, False) if is_over else (joints(admitted), True)
        return self.velocity

    def _begin(self, planned: Joints, dt: float) -> None:
        """Set in upon the motion that the position references before made."""
        if self._planned is None:
            self._speeds, self._rates = [0.0] * JOINT_COUNT, [0.0] * JOINT_COUNT
            return
        self._speeds = self._led(self._position, planned)
        rates = zip(
            self._speeds, self._led(self._position_before, self._planned), self._limits.acceleration, strict=True
        )
        self._rates = [max(-top, min(top, (new - old) / dt)) for new, old, top in rates]

    def _led(self, position: Joints, planned: Joints) -> list[float]:
        """How fast the robot sets out towards a position reference [rad/s]."""
        return [self._gain * (ahead - now) for ahead, now in zip(position, planned, strict=True)]

    def _admit_joint(self, index: int, now: float, ahead: float, speed: float, last: float, dt: float) -> float:
        """The share of one joint; ``now`` is where it will be when the robot takes the command."""
        limits, lead = self._limits, self._gain * (ahead - now)
        most, strength, jerk = limits.velocity[index], limits.acceleration[index], limits.jerk[index]
        wanted = lead + max(-most, min(most, speed))
        room = limits.upper[index] - now if wanted > 0.0 else now - limits.lower[index]
        top = min(most, speed_to_stop(room, strength, jerk))
        admitted, self._rates[index] = ramped(wanted, last, self._rates[index], top, strength, jerk, dt)
        self._speeds[index] = admitted
        self.is_bounded = self.is_bounded or admitted != wanted
        return admitted - lead


def ramped(
    wanted: float, last: float, rate: float, top: float, strength: float, jerk: float, dt: float
) -> tuple[float, float]:
    """The speed after ``dt`` [s] and its rate of change, on the way from ``last`` to ``wanted`` [rad/s].

    Args:
        wanted: the speed to come to; one that changes smoothly is followed at once.
        last: the speed so far.
        rate: its rate of change so far [rad/s²].
        top: highest speed allowed.
        strength: highest rate of change allowed [rad/s²].
        jerk: highest change of that rate allowed [rad/s³].
        dt: time that passes [s] > 0.
    """
    change = (wanted - last) / dt
    if (
        abs(wanted) <= top * _ROUNDING
        and abs(change) <= strength * _ROUNDING
        and abs(change - rate) <= jerk * dt * _ROUNDING
    ):
        return wanted, change
    missing = max(-top, min(top, wanted)) - last
    half = 0.5 * jerk * dt
    # As hard as it can still be taken back, at the jerk, when the speed is reached.
    ease = sqrt(2.0 * jerk * abs(missing) + half * half) - half
    aim = copysign(min(strength, ease, abs(missing) / dt), missing)
    change = max(rate - jerk * dt, min(rate + jerk * dt, aim))
    return last + change * dt, change


def speed_to_stop(room: float, strength: float, jerk: float) -> float:
    """How fast a joint may be that has ``room`` [rad] to stop in, see ``shaper``'s way to stop [rad/s]."""
    if room <= 0.0:
        return 0.0
    slow = 3.0 * strength / jerk
    return 0.5 * strength * (sqrt(slow * slow + 8.0 * room / strength) - slow)
