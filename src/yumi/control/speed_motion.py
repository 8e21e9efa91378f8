"""A motion by speeds: positions that move along with them, so that it works whatever the robot's position gain is.

With PosCorrGain 1 the robot closes its position loop around the position that moves along, and finds nothing to close;
with PosCorrGain 0 it heeds the speeds alone.
"""

from __future__ import annotations

from yumi.control.feed_forward import ramped, speed_to_stop
from yumi.robot.joints import JOINT_COUNT, Joints, joints
from yumi.robot.limits import JointLimits
from yumi.robot.values import ZERO, ArmCommand, ArmState

_SHARE = 0.95  # of acceleration and jerk, since the guard looks at differences from cycle to cycle
_LEFT_BEHIND = 0.02  # [rad] a robot that follows speeds only has gone elsewhere
_LATE = 0.05  # [s] by so much it may be behind
_STANDING = 1e-3  # [rad/s] less than the measured speed tells


class SpeedMotion:
    """Speeds of one arm and where they lead to.

    Args:
        limits: what the joints may do; a joint is slowed down so that it stops before the end of its range.
    """

    def __init__(self, limits: JointLimits) -> None:
        self._limits = limits
        self._position: Joints = ZERO
        self._velocity: Joints = ZERO
        self._rates = [0.0] * JOINT_COUNT

    @property
    def position(self) -> Joints:
        """Where it has come to [rad], (7,)."""
        return self._position

    def begin(self, state: ArmState) -> None:
        """Begin from where the robot plans to be, with the speed it has."""
        self._position = state.planned
        self._velocity = joints([speed if abs(speed) > _STANDING else 0.0 for speed in state.velocity])
        self._rates = [0.0] * JOINT_COUNT

    def step(self, state: ArmState, wanted: Joints, scale: float = 1.0) -> ArmCommand:
        """Go on for ``state.dt`` towards the speeds ``wanted`` [rad/s], (7,), at most ``scale`` times the limits."""
        dt = state.dt
        if dt <= 0.0:
            return ArmCommand(self._position, self._velocity if any(self._velocity) else ZERO)
        base = self._carried_along(state)
        velocity = joints(
            [self._joint_speed(index, base[index], speed, scale, dt) for index, speed in enumerate(wanted)]
        )
        self._position = joints([now + speed * dt for now, speed in zip(base, velocity, strict=True)])
        self._velocity = velocity
        return ArmCommand(self._position, velocity if any(velocity) else ZERO)

    def _joint_speed(self, index: int, now: float, wanted: float, scale: float, dt: float) -> float:
        limits = self._limits
        strength, jerk = _SHARE * limits.acceleration[index], _SHARE * limits.jerk[index]
        room = limits.upper[index] - now if wanted > 0.0 else now - limits.lower[index]
        top = min(scale * limits.velocity[index], speed_to_stop(room, strength, jerk))
        speed, self._rates[index] = ramped(wanted, self._velocity[index], self._rates[index], top, strength, jerk, dt)
        return speed

    def _carried_along(self, state: ArmState) -> Joints:
        """The positions so far; where the robot is where they do not lead it."""
        both = zip(self._position, state.planned, self._velocity, strict=True)
        return joints(
            [ours if abs(ours - its) < _LEFT_BEHIND + _LATE * abs(speed) else its for ours, its, speed in both]
        )
