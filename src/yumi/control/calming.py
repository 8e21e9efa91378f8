"""How to take over an arm that moves: hold it until it stands.

Controllers lead an arm by different laws: the command of one runs ahead of the arm, that of another is where the arm
shall be now and has its speed beside it. Either is no place for the other to go on from; standstill is.
"""

from __future__ import annotations

from yumi.robot.cycle import CYCLE
from yumi.robot.joints import Joints
from yumi.robot.values import ArmState

STANDING = 0.05
"""An arm whose joints all move slower than this stands [rad/s]; measured positions jitter."""

_CALM_CYCLES = 10  # the feedback is behind by less
_LONGEST = 1.0  # [s] the guard brings an arm to rest from full speed in less than half of it


class Calming:
    """Watches an arm that is held until it stands: its plan and its measurement, which comes later, lie still.

    Args:
        state: when the watch begins.
    """

    def __init__(self, state: ArmState) -> None:
        self._planned = state.planned
        self._calm_cycles = 0
        self._time = 0.0

    def is_over(self, state: ArmState) -> bool:
        """Whether the arm stands, as far as this new state tells; an arm that trembles counts after a while."""
        moved, self._planned = largest_difference(state.planned, self._planned), state.planned
        is_calm = moved <= STANDING * CYCLE and max(map(abs, state.velocity)) < STANDING
        self._calm_cycles = self._calm_cycles + 1 if is_calm else 0
        self._time += state.dt
        return self._calm_cycles >= _CALM_CYCLES or self._time > _LONGEST


def largest_difference(left: Joints, right: Joints) -> float:
    """Of two positions, by the joint that differs most [rad]."""
    return max(abs(a - b) for a, b in zip(left, right, strict=True))
