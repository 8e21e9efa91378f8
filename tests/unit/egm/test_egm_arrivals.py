from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from yumi.egm.session import Arrivals

CYCLE = 0.004032


def arrivals_of(seconds: float, *, drift_ppm: float = 0.0, delay_spread: float = 0.0, epoch: float = 0.0) -> Arrivals:
    """Of a robot whose datagrams are delayed by up to ``delay_spread`` [s]."""
    delays, arrivals = random.Random(1), Arrivals()
    arrivals.begin(100.0, epoch)
    for count in range(1, round(seconds / CYCLE)):
        ours = count * CYCLE
        arrivals.note(100.0 + ours + delays.uniform(0.0, delay_spread), epoch + ours * (1.0 + drift_ppm * 1e-6), 1)
    return arrivals


def test_arrivals_of_one_datagram_have_no_cycle_time() -> None:
    assert Arrivals().cycle_time == 0.0


def test_arrivals_of_a_regular_robot_have_no_jitter() -> None:
    arrivals = arrivals_of(3.0)
    assert arrivals.cycle_time == pytest.approx(CYCLE)
    assert arrivals.worst_jitter < 1e-9
    assert abs(arrivals.drift_ppm) < 1e-6


def test_jitter_settles_at_the_mean_difference_of_delays() -> None:
    arrivals = arrivals_of(20.0, delay_spread=0.0003)
    assert arrivals.jitter == pytest.approx(0.0001, rel=0.5)  # a third of the spread
    assert 0.00025 < arrivals.worst_jitter < 0.0003


@pytest.mark.parametrize("epoch", [0.0, 28_800.0, 1.8e9])
@pytest.mark.parametrize("drift_ppm", [-80.0, 0.0, 30.0])
def test_drift_is_found_beneath_the_jitter(drift_ppm: float, epoch: float) -> None:
    arrivals = arrivals_of(30.0, drift_ppm=drift_ppm, delay_spread=0.0005, epoch=epoch)
    assert arrivals.drift_ppm == pytest.approx(drift_ppm, abs=2.0)


def test_drift_is_unknown_before_two_seconds() -> None:
    assert arrivals_of(1.9, drift_ppm=50.0).drift_ppm == 0.0


def test_lost_datagrams_do_not_change_the_cycle_time() -> None:
    arrivals = Arrivals()
    arrivals.begin(0.0, 0.0)
    arrivals.note(5 * CYCLE, 5 * CYCLE, 5)
    assert arrivals.cycle_time == pytest.approx(CYCLE)


def test_a_clock_that_was_set_is_no_jitter() -> None:
    arrivals = arrivals_of(3.0, drift_ppm=40.0)
    before = arrivals.jitter
    arrivals.note(103.0, 1.8e9, 1)
    assert (arrivals.jitter, arrivals.worst_jitter) == (before, pytest.approx(0.0, abs=1e-6))


@given(st.lists(st.tuples(st.floats(0.0, 0.1), st.floats(0.0, 1e9), st.integers(1, 64)), max_size=200))
def test_arrivals_stand_any_clock(steps: list[tuple[float, float, int]]) -> None:
    arrivals, now = Arrivals(), 0.0
    for step, robot_time, sent in steps:
        now += step
        arrivals.note(now, robot_time, sent)
    assert 0.0 <= arrivals.jitter <= arrivals.worst_jitter <= 1.0
