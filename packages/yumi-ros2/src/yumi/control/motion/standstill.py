"""The standstill of an arm that a controller takes over, and whether the limiter holds the arm back."""

from __future__ import annotations

from abb_protocols.robot.joints import CYCLE, ArmState, Joints
from yumi.control.motion.robot_response import STANDING
from yumi.control.motion.setpoint import largest_difference

_CALM_CYCLES = 10  # the feedback is behind by less
_LONGEST_WAIT = 1.0  # [s] the limiter brings an arm to rest from full speed in less than half of it


class StandstillDetector:
    """Detects that an arm that is held stands: its plan and its measurement, which comes later, do not move.

    Controllers command in different ways: the command of one runs ahead of the arm, that of another is where the arm
    has to be now, with its speed beside it. Neither is a start for the other; standstill is.

    Args:
        state: when the arm was held.
    """

    def __init__(self, state: ArmState) -> None:
        self._planned = state.planned
        self._calm_cycles = 0
        self._time = 0.0

    def is_over(self, state: ArmState) -> bool:
        """Whether the arm stands by this new state; one that trembles counts as standing after a second."""
        moved, self._planned = largest_difference(state.planned, self._planned), state.planned
        is_calm = moved <= STANDING * CYCLE and max(map(abs, state.velocity)) < STANDING
        self._calm_cycles = self._calm_cycles + 1 if is_calm else 0
        self._time += state.dt
        return self._calm_cycles >= _CALM_CYCLES or self._time > _LONGEST_WAIT


_ELSEWHERE = 0.05  # [rad]
_DELAYED = 0.25  # [s] by so much of its speed an arm is behind what it is commanded
AT_GOAL = 1e-3
"""An arm that stands no further than this from where it is commanded to be is there [rad]."""


def is_held_back(commanded: Joints, velocity: Joints, planned: Joints) -> bool:
    """Whether an arm is further behind what it is commanded than it is by its delay.

    Args:
        commanded: the position [rad], (7,).
        velocity: of that [rad/s], (7,).
        planned: where the robot plans to be [rad], (7,).
    """
    rows = zip(commanded, velocity, planned, strict=True)
    return any(not abs(wanted - now) <= _ELSEWHERE + _DELAYED * abs(speed) for wanted, speed, now in rows)  # NaN too
