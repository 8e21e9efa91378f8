"""What holds for the metrics of the evaluation, whatever was measured."""

from __future__ import annotations

from math import exp, log

import pytest
from hypothesis import given
from hypothesis import strategies as st

from yumi.evaluation.metrics import (
    Series,
    distribution,
    final_error,
    lost_count,
    match_lags,
    overshoot,
    settling_time,
    swings,
)

PERIOD = 0.004

offsets = st.floats(-1.0, 1.0)


def triangle(branch: int, count: int) -> list[float]:
    """Up and down by one a sample."""
    return [float(branch - abs(index % (2 * branch) - branch)) for index in range(count)]


def sampled(values: list[float]) -> Series:
    return [(index * PERIOD, value) for index, value in enumerate(values)]


def first_order(time_constant: float, goal: float, count: int = 2000) -> Series:
    return [(i * PERIOD, goal * (1.0 - exp(-i * PERIOD / time_constant))) for i in range(count)]


@given(branch=st.integers(20, 60), late=st.integers(0, 19), slack=st.floats(0.5, 0.99))
def test_known_delay_is_recovered_to_one_sample(branch: int, late: int, slack: float) -> None:
    reference = triangle(branch, 6 * branch)
    measured = [0.0] * late + reference
    matches = match_lags(sampled(reference), sampled(measured), slack)
    assert matches.lags
    assert all(abs(lag - late * PERIOD) < PERIOD * 1.001 for _, lag in matches.lags)


@given(branch=st.integers(20, 60), late=st.integers(0, 19))
def test_share_counts_samples_that_were_not_reached_before_the_reference_turned(branch: int, late: int) -> None:
    reference = triangle(branch, branch + 1)
    measured = [-1.0] * late + reference
    matches = match_lags(sampled(reference), sampled(measured), 0.4)
    assert matches.sought == branch + 1
    assert len(matches.lags) == branch + 1 - late


@given(st.lists(offsets, min_size=1, max_size=50), st.floats(0.001, 10.0), st.floats(-5.0, 5.0))
def test_jitter_of_two_equal_halves_is_their_distance_from_the_mean(
    around: list[float], half: float, middle: float
) -> None:
    values = [middle + sign * half for sign in (-1.0, 1.0) for _ in around]
    assert distribution(values).jitter == pytest.approx(half, rel=1e-6)


@given(st.integers(100, 400), st.floats(0.1, 10.0))
def test_jitter_of_a_uniform_distribution_is_a_quarter_of_its_width(count: int, width: float) -> None:
    values = [width * (index + 0.5) / count for index in range(count)]
    assert distribution(values).jitter == pytest.approx(width / 4.0, rel=0.01)


@given(st.lists(offsets, min_size=1))
def test_quantiles_are_ordered_and_within_the_values(values: list[float]) -> None:
    found = distribution(values)
    cuts = [found.lowest, found.p50, found.p90, found.p99, found.p999, found.highest]
    assert cuts == sorted(cuts)
    assert (found.lowest, found.highest) == (min(values), max(values))


@given(st.integers(2, 300), st.integers(0, 10**9), st.data())
def test_loss_is_counted_exactly(sent: int, first: int, data: st.DataObject) -> None:
    numbers = range(first, first + sent)
    lost = data.draw(st.sets(st.sampled_from(numbers[1:-1]))) if sent > 2 else set()
    came = data.draw(st.permutations([number for number in numbers if number not in lost]))
    assert lost_count([*came, came[0]]) == len(lost)


@given(st.floats(0.05, 0.5), st.floats(1.0, 20.0), st.sampled_from([-1.0, 1.0]))
def test_settling_of_a_first_order_lag_is_its_logarithm(time_constant: float, size: float, sign: float) -> None:
    found = settling_time(first_order(time_constant, sign * size), sign * size, 0.1)
    assert found == pytest.approx(time_constant * log(size / 0.1), abs=1e-4)


@given(st.floats(0.05, 0.5), st.floats(1.0, 20.0))
def test_first_order_lag_neither_overshoots_nor_swings_nor_stays_away(time_constant: float, size: float) -> None:
    series = first_order(time_constant, size)
    assert overshoot(series, size) == 0.0
    assert swings(series, size, 0.01) == 0
    assert final_error(series, size, 0.1) < 1e-3 * size


@given(st.floats(0.2, 5.0), st.integers(1, 8))
def test_swings_are_counted_and_the_first_is_the_overshoot(size: float, count: int) -> None:
    values = [-1.0, *(size * (-1.0) ** number * 0.9**number for number in range(count)), 0.0]
    assert swings(sampled(values), 0.0, 1e-6) == count
    assert overshoot(sampled(values), 0.0) == size


def test_values_that_end_outside_have_not_settled() -> None:
    assert settling_time(sampled([0.0, 1.0, 0.0]), 1.0, 0.1) is None


def test_nothing_has_no_lag_and_no_loss() -> None:
    assert match_lags((), (), 0.1).sought == 0
    assert lost_count(()) == 0
