"""A PID law for the joints of one arm, with the parameters of ros2_control's ``control_toolbox``.

``output = p·e + ∫ i·e dt + d·de/dt``. The integral is kept after its gain, so that a change of the gain makes no step,
and is bounded on both sides. The rate of the error is given, not differentiated: a goal that jumps gives no kick.
"""

from __future__ import annotations

from dataclasses import dataclass

from yumi.robot.joints import JOINT_COUNT, Joints, joints


@dataclass(frozen=True, slots=True)
class PidGains:
    """The gains of all joints.

    Attributes:
        p: proportional gains, (7,).
        i: integral gains [1/s], (7,).
        d: derivative gains [s], (7,).
        i_clamp_min: lowest share of the integral in the output [rad].
        i_clamp_max: highest share of it [rad].
    """

    p: Joints
    i: Joints
    d: Joints
    i_clamp_min: float = 0.0
    i_clamp_max: float = 0.0

    @property
    def is_proportional(self) -> bool:
        """Whether nothing but the error of the moment counts."""
        return not any(self.i) and not any(self.d)


class JointPid:
    """The law with its memory.

    Args:
        gains: may be replaced at any time.
    """

    def __init__(self, gains: PidGains) -> None:
        self.gains = gains
        self._integrals = [0.0] * JOINT_COUNT

    def reset(self) -> None:
        """Forget the past."""
        self._integrals = [0.0] * JOINT_COUNT

    def step(self, error: Joints, rate: Joints, dt: float) -> Joints:
        """The output [rad], (7,), for an ``error`` [rad] and its ``rate`` [rad/s] after ``dt`` [s]."""
        gains = self.gains
        low, high = gains.i_clamp_min, gains.i_clamp_max
        grown = zip(self._integrals, gains.i, error, strict=True)
        self._integrals = [max(low, min(high, old + gain * value * dt)) for old, gain, value in grown]
        parts = zip(gains.p, error, self._integrals, gains.d, rate, strict=True)
        return joints([p * value + integral + d * slope for p, value, integral, d, slope in parts])
