"""What holds for the metrics of the evaluation, whatever was measured."""

from __future__ import annotations

from math import exp, log, pi, sin
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from yumi_evaluation.kpis import MOVED_DEG, machine_totals, motion_delay
from yumi_evaluation.metrics import (
    Series,
    best_delay,
    directions,
    distribution,
    final_error,
    largest_error,
    match_lags,
    oscillations,
    overshoot,
    series,
    settling_time,
)

PERIOD = 0.004

offsets = st.floats(-1.0, 1.0)


def triangle(branch: int, count: int) -> list[float]:
    """Up and down by one a sample."""
    return [float(branch - abs(index % (2 * branch) - branch)) for index in range(count)]


def sampled(values: list[float]) -> Series:
    return series([(index * PERIOD, value) for index, value in enumerate(values)])


def wave(frequency: float, late: float, rate: float, seconds: float = 4.0) -> Series:
    """A sine that is late, from the time on when all of it is."""
    begin = int(0.6 * rate)
    times = [index / rate for index in range(begin, int(seconds * rate))]
    return series([(time, sin(2.0 * pi * frequency * (time - late))) for time in times])


def slowly(reference: Series, measured: Series, tolerance: float) -> list[tuple[float, float]]:
    """What ``match_lags`` says it does, word for word."""
    ways, goals = directions(measured[:, 1]), directions(reference[:, 1])
    found = []
    for index, (time, value) in enumerate(reference):
        turns = [reference[later][0] for later in range(index + 1, len(reference)) if goals[later] != goals[later - 1]]
        end = min([*turns, reference[-1][0]])
        for (moment, where), way in zip(measured, ways, strict=True):
            if moment >= time and way == goals[index] and abs(where - value) <= tolerance:
                found += [(time, moment - time)] if moment <= end else []
                break
    return found


def first_order(time_constant: float, goal: float, count: int = 2000) -> Series:
    return sampled([goal * (1.0 - exp(-i * PERIOD / time_constant)) for i in range(count)])


@given(branch=st.integers(20, 60), late=st.integers(0, 19), slack=st.floats(0.5, 0.99))
def test_known_delay_is_recovered_to_one_sample(branch: int, late: int, slack: float) -> None:
    reference = triangle(branch, 6 * branch)
    measured = [0.0] * late + reference
    matches = match_lags(sampled(reference), sampled(measured), slack)
    assert len(matches.lags)
    assert all(abs(lag - late * PERIOD) < PERIOD * 1.001 for _, lag in matches.lags)


@given(frequency=st.floats(0.2, 1.0), late=st.floats(-0.05, 0.5), rate=st.sampled_from([250.0, 248.0, 333.0]))
def test_known_delay_of_a_whole_motion_is_recovered_by_least_squares(
    frequency: float, late: float, rate: float
) -> None:
    reference = [(index / 500.0, sin(2.0 * pi * frequency * index / 500.0)) for index in range(2500)]
    assert best_delay(reference, wave(frequency, late, rate)) == pytest.approx(late, abs=1e-3)


@given(late=st.integers(-10, 120), seed=st.integers(0, 10**6))
def test_known_delay_of_a_noisy_motion_is_recovered_to_one_sample(late: int, seed: int) -> None:
    noise = Random(seed)
    reference = [(index * PERIOD, sin(index * PERIOD)) for index in range(2000)]
    measured = [(time, sin(time - late * PERIOD) + noise.gauss(0.0, 0.005)) for time, _ in reference[200:1900]]
    assert best_delay(reference, measured) == pytest.approx(late * PERIOD, abs=PERIOD)


@given(branch=st.integers(20, 60), late=st.integers(0, 19))
def test_known_delay_is_found_of_every_goal_where_the_reference_does_not_turn(branch: int, late: int) -> None:
    reference, measured = triangle(branch, branch), [-5.0] * late + triangle(branch, branch)
    lags = match_lags(sampled(reference), sampled(measured), 0.4).lags
    assert {round(lag / PERIOD) for _, lag in lags} == {late}


@given(values=st.lists(st.integers(-9, 9).map(float), max_size=60), tolerance=st.sampled_from([0.5, 1.5]))
def test_matches_are_those_that_looking_at_every_sample_finds(values: list[float], tolerance: float) -> None:
    reference, measured = sampled(values), sampled([0.0, *values[::-1], *values])
    lags = match_lags(reference, measured, tolerance).lags
    assert [tuple(each) for each in lags] == slowly(reference, measured, tolerance)


@given(st.floats(0.0, 5.0), st.integers(5, 200))
def test_largest_error_of_a_shifted_motion_is_the_shift(shift: float, count: int) -> None:
    reference = sampled([0.1 * index for index in range(count)])
    assert largest_error(reference, [(time, value + shift) for time, value in reference]) == pytest.approx(shift)


@given(st.integers(1, 300), st.floats(1.1, 5.0))
def test_motion_delay_is_when_the_joint_has_left_the_place_where_it_stood(still: int, factor: float) -> None:
    series = sampled([0.0] * still + [factor * MOVED_DEG] * 3)
    assert motion_delay(series) == pytest.approx(still * PERIOD)
    assert motion_delay(series[:still]) is None


@given(st.lists(st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0)), min_size=1))
def test_whole_round_trips_are_the_sums_of_their_legs(trips: list[tuple[float, float]]) -> None:
    there, back = zip(*trips, strict=True)
    assert machine_totals({"there": there, "back": back}) == [sum(trip) for trip in trips]


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


@given(st.floats(0.05, 0.5), st.floats(1.0, 20.0), st.sampled_from([-1.0, 1.0]))
def test_settling_of_a_first_order_lag_is_its_logarithm(time_constant: float, size: float, sign: float) -> None:
    found = settling_time(first_order(time_constant, sign * size), sign * size, 0.1)
    assert found == pytest.approx(time_constant * log(size / 0.1), abs=1e-4)


@given(st.floats(0.05, 0.5), st.floats(1.0, 20.0))
def test_first_order_lag_neither_overshoots_nor_oscillates_nor_stays_away(time_constant: float, size: float) -> None:
    series = first_order(time_constant, size)
    assert overshoot(series, size) == 0.0
    assert oscillations(series, size, 0.01) == 0
    assert final_error(series, size, 0.1) < 1e-3 * size


@given(st.floats(0.2, 5.0), st.integers(1, 8))
def test_oscillations_are_counted_and_the_first_is_the_overshoot(size: float, count: int) -> None:
    values = [-1.0, *(size * (-1.0) ** number * 0.9**number for number in range(count)), 0.0]
    assert oscillations(sampled(values), 0.0, 1e-6) == count
    assert overshoot(sampled(values), 0.0) == size


def test_values_that_end_outside_have_not_settled() -> None:
    assert settling_time(sampled([0.0, 1.0, 0.0]), 1.0, 0.1) is None


def test_nothing_has_no_lag() -> None:
    assert match_lags((), (), 0.1).sought == 0
