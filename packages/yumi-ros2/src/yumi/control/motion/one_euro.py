"""The One-Euro filter: a low-pass filter whose cutoff grows with the speed of what it filters.

G. Casiez, N. Roussel, D. Vogel, *1 € Filter: A Simple Speed-based Low-pass Filter for Noisy Input in Interactive
Systems*, CHI 2012: a hand that stands trembles less, a hand that moves lags less. Time is an argument.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, tau

from abb_protocols.robot.joints import Pose, Vector
from abb_protocols.robot.kinematics import quaternion_of, quaternion_product, turn_between, unit_quaternion

_SPEED_CUTOFF = 1.0  # [Hz] of the speed that sets the cutoff; the paper's


def _weight(cutoff: float, dt: float) -> float:
    """Of a new value in a low-pass filter of first order."""
    return 1.0 - 1.0 / (1.0 + tau * cutoff * dt)


class OneEuroFilter:
    """Filters some numbers that one speed belongs to, such as the three of a position.

    Args:
        start: the first values.
        cutoff: at standstill [Hz]; 0 filters nothing.
        beta: by which the cutoff grows with the speed [Hz per unit a second].

    Attributes:
        values: after the last step.
    """

    def __init__(self, start: Sequence[float], cutoff: float, beta: float) -> None:
        self.values = self._raw = tuple(start)
        self._cutoff, self._beta = cutoff, beta
        self._velocity = (0.0,) * len(self.values)

    def step(self, values: Sequence[float], dt: float) -> tuple[float, ...]:
        """The next values, ``dt`` [s] after the last ones, filtered."""
        if dt > 0.0:
            weight = _weight(_SPEED_CUTOFF, dt)
            rows = zip(values, self._raw, self._velocity, strict=True)
            self._velocity = tuple([v + weight * ((new - old) / dt - v) for new, old, v in rows])
            self._raw = tuple(values)
            weight = _weight(self._cutoff + self._beta * hypot(*self._velocity), dt) if self._cutoff else 1.0
            self.values = tuple([f + weight * (new - f) for f, new in zip(self.values, values, strict=True)])
        return self.values


class PoseFilter:
    """Filters a pose: its position, and its orientation by the turns between two of them.

    Args:
        start: the first pose.
        cutoff: as of :class:`OneEuroFilter`.
        beta: as of :class:`OneEuroFilter`, for the position [Hz per m/s] and the orientation [Hz per rad/s].
    """

    def __init__(self, start: Pose, cutoff: float, beta: float) -> None:
        self._position = OneEuroFilter(start.position, cutoff, beta)
        self._cutoff, self._beta = cutoff, beta
        self._raw = self._orientation = start.orientation
        self._spin: Vector = (0.0, 0.0, 0.0)

    def step(self, pose: Pose, dt: float) -> Pose:
        """The next pose, ``dt`` [s] after the last one, filtered."""
        x, y, z = self._position.step(pose.position, dt)
        if dt > 0.0:
            weight = _weight(_SPEED_CUTOFF, dt)
            rows = zip(turn_between(self._raw, pose.orientation), self._spin, strict=True)
            a, b, c = (v + weight * (turn / dt - v) for turn, v in rows)
            self._spin, self._raw = (a, b, c), pose.orientation
            weight = _weight(self._cutoff + self._beta * hypot(*self._spin), dt) if self._cutoff else 1.0
            turn = turn_between(self._orientation, pose.orientation)
            self._orientation = unit_quaternion(quaternion_product(quaternion_of(turn, weight), self._orientation))
        return Pose((x, y, z), self._orientation)
