"""The begin of a stream of joint positions: how far from the arm it may lie, and how what lies between fades away."""

from __future__ import annotations

from abb_protocols.robot.joints import ZERO_JOINTS, Joints, joints

FARTHEST_STREAM_BEGIN = 0.1
"""A stream may begin so far from where the arm is sent [rad]: the arm is there in a moment, within its limits."""


class StreamBegin:
    """How a stream of joint positions begins that is not where the arm is sent: what lies between fades away.

    Args:
        sent: where the arm is sent [rad], (7,).
        first: the stream's first goal [rad], (7,).
        seconds: the stream is followed as it is after this time [s]; 0 follows it so at once.
    """

    def __init__(self, sent: Joints, first: Joints, seconds: float) -> None:
        self._offset: Joints = joints([a - b for a, b in zip(sent, first, strict=True)])
        self._seconds = seconds

    def at(self, goal: Joints, time: float, velocity: Joints = ZERO_JOINTS) -> tuple[Joints, Joints]:
        """A goal of the stream, ``time`` [s] after its begin, as the arm is sent there.

        Args:
            goal: position [rad], (7,).
            time: below 0 counts as 0.
            velocity: that of the stream there [rad/s], (7,); NaN where it is not known, and is not known then.

        Returns:
            Position [rad] and velocity [rad/s], (7,) each.
        """
        share = min(1.0, max(0.0, time / self._seconds)) if self._seconds > 0.0 else 1.0
        if share == 1.0:
            return goal, velocity
        left = 1.0 - share**3 * (10.0 - 15.0 * share + 6.0 * share * share)  # no step in speed or acceleration
        fades = -30.0 * (share * (1.0 - share)) ** 2 / self._seconds  # [1/s]
        return (
            joints([to + left * by for to, by in zip(goal, self._offset, strict=True)]),
            joints([speed + fades * by for speed, by in zip(velocity, self._offset, strict=True)]),
        )
