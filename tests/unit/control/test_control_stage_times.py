from __future__ import annotations

import statistics
from dataclasses import astuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from abb_runtime.clock import ManualClock
from yumi.control.controller_info import Statistics
from yumi.control.stage_times import (
    AFTER_REPLY,
    DECODE_STAGE,
    ENCODE_STAGE,
    LIMIT_STAGE,
    RECEIVE_STAGE,
    SEND_STAGE,
    UPDATE_STAGE,
    RunningStatistics,
    StageClock,
    StageTimes,
)


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


def test_stage_clock_measures_each_stage(clock: ManualClock) -> None:
    timing = StageClock(clock.now)
    clock.advance(5.0)
    timing.begin(clock.now())
    for number, stage in enumerate(
        (RECEIVE_STAGE, DECODE_STAGE, UPDATE_STAGE, LIMIT_STAGE, ENCODE_STAGE, SEND_STAGE, AFTER_REPLY), start=1
    ):
        clock.advance(number * 1e-6)
        timing.note(stage)
    times = StageTimes.of(timing.marks)
    assert astuple(times) == pytest.approx([number * 1e-6 for number in range(1, 8)])
    assert times.reply == pytest.approx(21e-6)


def test_stage_that_was_not_noted_took_no_time(clock: ManualClock) -> None:
    timing = StageClock(clock.now)
    clock.advance(1.0)
    timing.begin(clock.now())
    clock.advance(2e-6)
    timing.note(UPDATE_STAGE)
    assert StageTimes.of(timing.marks).update == pytest.approx(2e-6)
    assert StageTimes.of(timing.marks).send == 0.0


def test_stage_clock_forgets_the_cycle_before(clock: ManualClock) -> None:
    timing = StageClock(clock.now)
    timing.begin(clock.now())
    clock.advance(1.0)
    timing.note(AFTER_REPLY)
    timing.begin(clock.now())
    assert StageTimes.of(timing.marks) == StageTimes(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def test_stages_take_no_time_where_time_is_virtual() -> None:
    timing = StageClock()
    timing.begin(100.0)
    timing.note(DECODE_STAGE)
    assert set(timing.marks) == {0.0}
