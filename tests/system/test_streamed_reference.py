"""A streamed reference, of which the future is not known, is followed almost without lag; in virtual time."""

from __future__ import annotations

from dataclasses import replace
from math import radians

import pytest
from tracking_runs import FULL_SPEED_LIMITS, Stream, follow

from yumi_evaluation.experiments import AXIS_6, FEED_FORWARD, Sine, Step

START = 2.0
"""A sine that begins at full speed cannot be followed from its first moment [s]."""


@pytest.mark.parametrize(("amplitude_deg", "most_deg"), [(10.0, 0.05), (60.0, 0.2)])
def test_sine_is_followed_with_the_figures_that_are_published(amplitude_deg: float, most_deg: float) -> None:
    """Asked for are 10 ms, 0.2° and 0.8°."""
    run = follow(Sine(radians(amplitude_deg)), 8.0, FEED_FORWARD)
    assert run.slowed == 0  # the limiter has nothing to do
    later = run.after(START)
    assert abs(later.lag) < 0.003
    assert later.max_error_deg < most_deg


def test_sine_is_caught_up_with_within_half_a_second() -> None:
    assert follow(Sine(radians(60.0)), 3.0, FEED_FORWARD).settling_time(0.3) < 0.5


@pytest.mark.parametrize("stream", [Stream(lateness=0.001), Stream(rate=100.0)], ids=["late goals", "100 Hz"])
def test_sine_is_followed_when_goals_come_late_or_seldom(stream: Stream) -> None:
    later = follow(Sine(radians(60.0)), 8.0, FEED_FORWARD, stream).after(START)
    assert abs(later.lag) < 0.010
    assert later.max_error_deg < 0.8


def test_proportional_law_lags_as_it_always_did() -> None:
    later = follow(Sine(radians(10.0)), 8.0, {"p": 2.0}).after(START)
    assert 0.08 < later.lag < 0.13


@pytest.mark.parametrize("size_deg", [-30.0, -1.0, 0.1, 10.0])
def test_step_has_no_overshoot_and_keeps_the_acceleration_limit(size_deg: float) -> None:
    run = follow(Step(radians(size_deg)), 1.0, FEED_FORWARD)
    assert run.overshoot_deg < 0.1
    assert run.settling_time(0.1) < 0.5
    assert run.max_acceleration <= FULL_SPEED_LIMITS.acceleration[AXIS_6]


def test_stream_that_ends_in_mid_motion_does_not_run_on() -> None:
    """That it ends is known when it is late: the arm goes on for that time, brakes and comes back."""
    sine, end = Sine(radians(60.0)), 1.0
    run = follow(sine, 3.0, FEED_FORWARD, Stream(until=end))
    ended = replace(run, reference=Step(sine(end), 0.0)).after(end)
    assert ended.errors.max() < radians(75.0) * (0.030 + 0.032) + radians(2.0)
    assert ended.measured[-1] == pytest.approx(sine(end), abs=1e-4)
