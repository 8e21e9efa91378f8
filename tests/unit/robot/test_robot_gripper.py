from __future__ import annotations

import pytest

from abb_protocols.robot.gripper_values import ALLOWANCE, TRAVEL, Outcome, outcome_of


@pytest.mark.parametrize(
    ("position", "effort", "stalled", "reached_goal", "outcome"),
    [
        (0.0, 0.0, False, True, Outcome.CLOSED),
        (ALLOWANCE, 0.0, False, True, Outcome.CLOSED),
        (ALLOWANCE + 1e-4, 0.0, False, True, Outcome.IN_PLACE),
        (TRAVEL - ALLOWANCE, 0.0, False, True, Outcome.OPEN),
        (0.010, 10.0, True, False, Outcome.HOLDING),
        (0.010, 0.0, True, False, Outcome.STALLED),
        (0.010, 0.0, False, False, Outcome.STALLED),
    ],
)
def test_outcome_follows_from_the_result_of_the_action(
    position: float, effort: float, stalled: bool, reached_goal: bool, outcome: Outcome
) -> None:
    assert outcome_of(position, effort, stalled=stalled, reached_goal=reached_goal) is outcome
