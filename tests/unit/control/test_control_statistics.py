from __future__ import annotations

import statistics

import pytest
from hypothesis import given
from hypothesis import strategies as st

from yumi.control.statistics import RunningStatistics, Statistics


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=50))
def test_running_statistics_agree_with_those_of_the_whole_series(values: list[float]) -> None:
    running = RunningStatistics()
    for value in values:
        running.add(value)
    result = running.result()
    assert (result.count, result.current) == (len(values), values[-1])
    assert (result.minimum, result.maximum) == (min(values), max(values))
    assert result.mean == pytest.approx(statistics.fmean(values), abs=1e-12)
    assert result.deviation == pytest.approx(statistics.pstdev(values), abs=1e-7)


def test_running_statistics_of_nothing_are_zero_again_after_a_reset() -> None:
    running = RunningStatistics()
    running.add(3.0)
    running.reset()
    assert running.result() == Statistics()
