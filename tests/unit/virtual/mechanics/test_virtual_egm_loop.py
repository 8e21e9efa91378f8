"""Dead time inside EGM's loop: with which gains a step overshoots, and from which on the loop is unstable."""

from __future__ import annotations

import pytest
from egm_loop_gains import DELAYS, overshoot, overshoot_gain, predicted_gains, step_response, unstable_gain

from virtual_irc5.mechanics.arm_motion import ARM_MODELS, ArmModel


@pytest.mark.parametrize("delay", DELAYS)
def test_overshoot_begins_with_the_gain_that_is_predicted(delay: float) -> None:
    assert overshoot_gain(delay) == pytest.approx(predicted_gains(delay)[0], rel=0.1)


@pytest.mark.parametrize("delay", DELAYS)
def test_loop_becomes_unstable_with_the_gain_that_is_predicted(delay: float) -> None:
    assert unstable_gain(delay) == pytest.approx(predicted_gains(delay)[1], rel=0.1)


@pytest.mark.parametrize("model", ARM_MODELS.values(), ids=ARM_MODELS)
@pytest.mark.parametrize(("bandwidth", "level"), [(0.0, 0), (20.0, 0), (100.0, 0), (20.0, 1)])
def test_step_is_not_overshot_with_the_default_gain(model: ArmModel, bandwidth: float, level: int) -> None:
    assert overshoot(5.0, model, bandwidth, level) < 1e-9
    assert step_response(5.0, model, 3.0, bandwidth, level)[-1] == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize("model", ARM_MODELS.values(), ids=ARM_MODELS)
def test_step_is_overshot_with_the_highest_gain_and_the_usual_filter(model: ArmModel) -> None:
    assert 0.01 < overshoot(20.0, model, bandwidth=20.0) < 0.3
