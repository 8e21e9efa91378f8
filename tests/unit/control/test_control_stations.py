from __future__ import annotations

from dataclasses import astuple

import pytest

from yumi.clock import ManualClock
from yumi.control.statistics import (
    ADMIT,
    AFTER_REPLY,
    DECODE,
    ENCODE,
    RECEIVE,
    SEND,
    UPDATE,
    StationClock,
    StationTimes,
    station_times,
)


def test_station_clock_tells_how_long_each_station_took(clock: ManualClock) -> None:
    stations = StationClock(clock.now)
    clock.advance(5.0)
    stations.begin(clock.now())
    for number, station in enumerate((RECEIVE, DECODE, UPDATE, ADMIT, ENCODE, SEND, AFTER_REPLY), start=1):
        clock.advance(number * 1e-6)
        assert stations.timed(station, "result") == "result"
    times = station_times(stations.marks)
    assert astuple(times) == pytest.approx([number * 1e-6 for number in range(1, 8)])
    assert times.reply == pytest.approx(21e-6)


def test_station_that_nobody_noted_took_no_time(clock: ManualClock) -> None:
    stations = StationClock(clock.now)
    clock.advance(1.0)
    stations.begin(clock.now())
    clock.advance(2e-6)
    stations.note(UPDATE)
    assert station_times(stations.marks).update == pytest.approx(2e-6)
    assert station_times(stations.marks).send == 0.0


def test_station_clock_forgets_the_cycle_before(clock: ManualClock) -> None:
    stations = StationClock(clock.now)
    stations.begin(clock.now())
    clock.advance(1.0)
    stations.note(AFTER_REPLY)
    stations.begin(clock.now())
    assert station_times(stations.marks) == StationTimes(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
