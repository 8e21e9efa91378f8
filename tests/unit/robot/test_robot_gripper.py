from __future__ import annotations

import pytest

from abb_protocols.robot.gripper_values import FINGER_ALLOWANCE, FINGER_TRAVEL, GripOutcome, outcome_of


@pytest.mark.parametrize(
    ("position", "effort", "stalled", "reached_goal", "outcome"),
    [
        (0.0, 0.0, False, True, GripOutcome.CLOSED),
        (FINGER_ALLOWANCE, 0.0, False, True, GripOutcome.CLOSED),
        (FINGER_ALLOWANCE + 1e-4, 0.0, False, True, GripOutcome.IN_PLACE),
        (FINGER_TRAVEL - FINGER_ALLOWANCE, 0.0, False, True, GripOutcome.OPEN),
        (0.010, 10.0, True, False, GripOutcome.HOLDING),
        (0.010, 0.0, True, False, GripOutcome.STALLED),
        (0.010, 0.0, False, False, GripOutcome.STALLED),
    ],
)
def test_outcome_follows_from_the_result_of_the_action(
    position: float, effort: float, stalled: bool, reached_goal: bool, outcome: GripOutcome
) -> None:
    assert outcome_of(position, effort, stalled=stalled, reached_goal=reached_goal) is outcome
