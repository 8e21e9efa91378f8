"""Speeds of an arm's joints, and the positions that such speeds lead to."""

from __future__ import annotations

from abb_protocols.robot.joints import JOINT_COUNT, ZERO_JOINTS, ArmCommand, ArmState, JointLimits, Joints, joints
from yumi.control.motion.joint_steps import braking_path, ramp_speed, speed_to_stop
from yumi.control.motion.standstill import SentPositions, StandstillDetector

SHARE_OF_LIMITS = 0.95  # of acceleration and jerk, since the limiter looks at differences from cycle to cycle
_SHARE_AT_FIRST = 0.9  # in the cycles after a motion whose jerk was another, which is still in those differences
_FIRST = 2  # such cycles
_LEFT_BEHIND = 0.02  # [rad] a robot that follows speeds only has gone elsewhere
_LATE = 0.05  # [s] by so much it may be behind
_NOISE = 1e-3  # [rad/s] a measured speed below this is noise


def speeds_without_noise(velocity: Joints) -> Joints:
    """Measured speeds from which a motion can go on: those that are no more than noise are zero."""
    return joints([speed if abs(speed) > _NOISE else 0.0 for speed in velocity])


class SpeedMotion:
    """Speeds of one arm, and positions that move along with them.

    With PosCorrGain 1 the robot closes its position loop around the position that moves along, and finds nothing to
    close; with PosCorrGain 0 it follows the speeds alone (reference/egm.md §6.1). So one motion serves both.

    Args:
        limits: of the joints; a joint is slowed down so that it stops before the end of its range.
    """

    def __init__(self, limits: JointLimits) -> None:
        self._limits = limits
        self.position: Joints = ZERO_JOINTS
        self._velocity: Joints = ZERO_JOINTS
        self._rates = [0.0] * JOINT_COUNT
        self._first = 0  # cycles that are left of those
        self._standstill: StandstillDetector | None = None

    def begin(self, state: ArmState) -> None:
        """Begin from where the robot is, with the speed it has."""
        self.position = state.position
        self._velocity = speeds_without_noise(state.velocity)
        self._rates = [0.0] * JOINT_COUNT
        self._standstill = None

    def go_on(self, position: Joints, velocity: Joints, acceleration: Joints) -> None:
        """Begin from what the arm is commanded, with that speed and acceleration: it may be braking."""
        self.position, self._velocity = position, velocity
        self._rates, self._first = list(acceleration), _FIRST

    @property
    def acceleration(self) -> Joints:
        """How its speeds change now [rad/s²], (7,)."""
        return joints(self._rates)

    def follow(self, state: ArmState, goal: Joints, scale: float, sent: SentPositions) -> ArmCommand | None:
        """As :meth:`step`; an arm that is held back while it brakes to rest is held, by None, until it stands.

        What is withheld from it would be made up for as soon as its way is free.
        """
        if any(goal):
            if self._standstill is not None:
                self.begin(state)
        elif (
            self._standstill is None
            and any(self._velocity)
            and sent.is_held_back(self.position, self._velocity, state.planned)
        ):
            self._standstill = StandstillDetector(state, sent)
        if self._standstill is not None:
            if not self._standstill.is_over(state):
                return None
            self._standstill, self._velocity, self._rates = None, ZERO_JOINTS, [0.0] * JOINT_COUNT
            self.position = sent.position or state.position
        return self.step(state, goal, scale)

    def step(self, state: ArmState, goal: Joints, scale: float = 1.0) -> ArmCommand:
        """Go on for ``state.dt`` towards the speeds ``goal`` [rad/s], (7,), at most ``scale`` times the limits."""
        dt, limits = state.dt, self._limits
        if dt > 0.0:
            # Where the robot is, for joints that are not where these speeds have led them.
            rows = zip(self.position, state.planned, self._velocity, strict=True)
            base = [own if abs(own - its) < _LEFT_BEHIND + _LATE * abs(speed) else its for own, its, speed in rows]
            velocity, share = [], _SHARE_AT_FIRST if self._first else SHARE_OF_LIMITS
            self._first = max(0, self._first - 1)
            for index, (now, speed) in enumerate(zip(base, goal, strict=True)):
                acceleration, jerk = share * limits.acceleration[index], share * limits.jerk[index]
                room = limits.upper[index] - now if speed > 0.0 else now - limits.lower[index]
                top = min(scale * limits.velocity[index], speed_to_stop(room, acceleration, jerk))
                ramped, self._rates[index] = ramp_speed(
                    speed, self._velocity[index], self._rates[index], top, acceleration, jerk, dt
                )
                velocity.append(ramped)
            # On the way at the mean of both speeds: as a motion that brakes, from which and to which it goes on.
            rows = zip(base, self._velocity, velocity, strict=True)
            self.position = joints([now + 0.5 * (last + speed) * dt for now, last, speed in rows])
            self._velocity = joints(velocity)
        return ArmCommand(self.position, self._velocity if any(self._velocity) else ZERO_JOINTS)

    def give_up(self, position: Joints) -> None:
        """Go on from ``position`` [rad], (7,), where the limiter holds the arm, once no speed leads it further."""
        if not any(self._velocity):
            self.position = position

    def rest_after(self, goal: Joints, dt: float) -> Joints:
        """Where the joints would come to rest if they braked after a step of ``dt`` [s] towards the speeds ``goal``."""
        limits, places = self._limits, []
        for index, speed in enumerate(goal):
            strength, jerk = SHARE_OF_LIMITS * limits.acceleration[index], SHARE_OF_LIMITS * limits.jerk[index]
            last, rate, top = self._velocity[index], self._rates[index], limits.velocity[index]
            after, change = ramp_speed(speed, last, rate, top, strength, jerk, dt)
            way = 0.5 * (last + after) * dt
            places.append(self.position[index] + way + braking_path(after, change, strength, jerk).end)
        return joints(places)
