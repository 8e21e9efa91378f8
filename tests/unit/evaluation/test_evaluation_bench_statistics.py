"""Quantiles, spreads and ratios of the benchmark."""

from __future__ import annotations

from math import isnan, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from yumi_evaluation.bench.figures import Spread, latency_figures, ratio, spread_of
from yumi_evaluation.metrics import quantiles

LATENCIES = st.lists(st.integers(1, 10**9), min_size=1, max_size=200)
FIGURES = st.lists(st.floats(0.0, 1e9), min_size=1, max_size=20)


@pytest.mark.parametrize(("share", "value"), [(0.5, 50.0), (0.99, 99.0), (0.999, 100.0), (1.0, 100.0)])
def test_quantile_of_one_to_a_hundred(share: float, value: float) -> None:
    assert quantiles(range(100, 0, -1), (share,)) == [value]


def test_quantile_of_nothing_is_no_number() -> None:
    assert isnan(quantiles([], (0.5,))[0])


@given(LATENCIES, st.floats(0.01, 1.0))
def test_quantile_is_not_exceeded_by_its_share_and_no_smaller_one_is(values: list[int], share: float) -> None:
    ordered = sorted(map(float, values))
    (found,) = quantiles(ordered, (share,))
    assert sum(value <= found for value in ordered) >= share * len(ordered) - 1e-6
    assert sum(value < found for value in ordered) < share * len(ordered)


@given(LATENCIES)
def test_latency_figures_are_in_order_and_within_the_data(values: list[int]) -> None:
    figures = latency_figures(values)
    assert min(values) / 1e3 <= figures.p50_us <= figures.p99_us <= figures.p999_us <= figures.max_us
    assert figures.max_us == max(values) / 1e3


@given(LATENCIES, st.integers(0, 50))
def test_latency_figures_leave_out_cycles_without_a_reply(values: list[int], missed: int) -> None:
    assert latency_figures([*values, *[0] * missed]) == latency_figures(values)


def test_latency_figures_of_a_silent_server_are_no_numbers() -> None:
    assert isnan(latency_figures([0, 0, 0]).p50_us)


@given(FIGURES)
def test_spread_has_its_median_between_its_ends(values: list[float]) -> None:
    spread = spread_of(values)
    assert spread is not None
    assert min(values) == spread.lowest <= spread.median <= spread.highest == max(values)
    assert sum(value < spread.median for value in values) <= len(values) / 2
    assert sum(value > spread.median for value in values) <= len(values) / 2


def test_spread_leaves_out_what_is_no_number() -> None:
    assert spread_of([3.0, nan, 1.0]) == Spread(median=2.0, lowest=1.0, highest=3.0, rounds=2)


def test_spread_of_nothing_is_none() -> None:
    assert spread_of([nan]) is None


def test_ratio_without_a_reference_is_no_number() -> None:
    assert ratio(3.0, 2.0) == 1.5
    assert isnan(ratio(3.0, 0.0))
    assert isnan(ratio(3.0, nan))
