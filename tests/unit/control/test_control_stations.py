from __future__ import annotations

from dataclasses import astuple

import pytest

from yumi.clock import ManualClock
from yumi.control.statistics import (
    AFTER_REPLY,
    DECODE,
    ENCODE,
    LIMIT,
    RECEIVE,
    SEND,
    UPDATE,
    StageClock,
    StageTimes,
)


def test_station_clock_tells_how_long_each_station_took(clock: ManualClock) -> None:
    stations = StageClock(clock.now)
    clock.advance(5.0)
    stations.begin(clock.now())
    for number, station in enumerate((RECEIVE, DECODE, UPDATE, LIMIT, ENCODE, SEND, AFTER_REPLY), start=1):
        clock.advance(number * 1e-6)
        assert stations.timed(station, "result") == "result"
    times = StageTimes.of(stations.marks)
    assert astuple(times) == pytest.approx([number * 1e-6 for number in range(1, 8)])
    assert times.reply == pytest.approx(21e-6)


def test_station_that_nobody_noted_took_no_time(clock: ManualClock) -> None:
    stations = StageClock(clock.now)
    clock.advance(1.0)
    stations.begin(clock.now())
    clock.advance(2e-6)
    stations.note(UPDATE)
    assert StageTimes.of(stations.marks).update == pytest.approx(2e-6)
    assert StageTimes.of(stations.marks).send == 0.0


def test_station_clock_forgets_the_cycle_before(clock: ManualClock) -> None:
    stations = StageClock(clock.now)
    stations.begin(clock.now())
    clock.advance(1.0)
    stations.note(AFTER_REPLY)
    stations.begin(clock.now())
    assert StageTimes.of(stations.marks) == StageTimes(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
