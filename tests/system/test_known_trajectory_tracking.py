"""The figures of a trajectory known in advance, in virtual time at full-speed settings with the default dynamics."""

from __future__ import annotations

from math import radians

import pytest
from tracking_runs import follow_sine

from yumi.control.motion.robot_response import EGM_GAIN, RESPONSE_DELAY
from yumi_evaluation.virtual_time import PlannedSine


@pytest.mark.parametrize(("amplitude_deg", "allowed_deg"), [(10.0, 0.05), (60.0, 0.3)])
def test_arm_follows_a_known_sine_without_lag(amplitude_deg: float, allowed_deg: float) -> None:
    tracking = follow_sine(PlannedSine(radians(amplitude_deg)))
    assert tracking.max_error_deg <= allowed_deg
    assert abs(tracking.mean_lag) <= 0.004
    assert tracking.slowed == 0


def test_arm_is_a_whole_delay_late_without_lookahead() -> None:
    assert follow_sine(PlannedSine(radians(10.0), periods=1), {"lookahead": 0.0}).mean_lag == pytest.approx(
        RESPONSE_DELAY, abs=0.001
    )


def test_arm_lags_by_the_gain_of_its_own_loop_without_feedforward() -> None:
    assert follow_sine(PlannedSine(radians(10.0), periods=1), {"feedforward": 0.0}).mean_lag == pytest.approx(
        1.0 / EGM_GAIN - RESPONSE_DELAY,
        abs=0.005,  # it is commanded so much in advance
    )
