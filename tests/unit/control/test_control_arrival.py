from __future__ import annotations

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from yumi.driver.control_process import ArrivalForecast
from yumi.robot.joints import CYCLE

SHARE = 0.1


@pytest.fixture
def forecast() -> ArrivalForecast:
    return ArrivalForecast(SHARE)


def test_forecast_expects_nothing_before_the_first_arrival(forecast: ArrivalForecast) -> None:
    assert forecast.wake_at() < -1e300
    assert forecast.give_up_at() < -1e300


def test_forecast_wakes_a_margin_before_the_next_datagram_and_looks_as_long_after(forecast: ArrivalForecast) -> None:
    forecast.note_arrival(1.0, was_waiting=False)
    assert forecast.wake_at() == pytest.approx(1.0 + CYCLE - forecast.margin)
    assert forecast.give_up_at() == pytest.approx(1.0 + CYCLE + forecast.margin)


def test_forecast_learns_the_period(forecast: ArrivalForecast) -> None:
    for count in range(1000):
        forecast.note_arrival(count * 0.004, was_waiting=False)
    assert forecast.period == pytest.approx(0.004, abs=1e-6)


@pytest.mark.parametrize("gap", [0.0001, 0.04, 5.0])
def test_forecast_does_not_take_gaps_and_bursts_for_the_period(forecast: ArrivalForecast, gap: float) -> None:
    forecast.note_arrival(1.0, was_waiting=False)
    forecast.note_arrival(1.0 + gap, was_waiting=False)
    assert forecast.period == CYCLE


def test_forecast_takes_to_a_robot_with_another_period(forecast: ArrivalForecast) -> None:
    for count in range(10):
        forecast.note_arrival(count * 3.0 * CYCLE, was_waiting=False)
    assert forecast.period == pytest.approx(3.0 * CYCLE)


def test_margin_grows_at_once_and_shrinks_slowly(forecast: ArrivalForecast) -> None:
    before = forecast.margin
    forecast.note_arrival(1.0, was_waiting=True)
    grown = forecast.margin
    forecast.note_arrival(1.0 + CYCLE, was_waiting=False)
    assert grown == pytest.approx(1.5 * before)
    assert 0.99 * grown < forecast.margin < grown


@given(st.lists(st.booleans(), max_size=300))
def test_margin_never_takes_more_than_its_share(arrivals: list[bool]) -> None:
    forecast = ArrivalForecast(SHARE)
    for count, was_waiting in enumerate(arrivals):
        forecast.note_arrival(count * CYCLE, was_waiting=was_waiting)
        assert 0.0 < forecast.margin <= SHARE * forecast.period


def test_margin_settles_where_few_datagrams_are_missed(forecast: ArrivalForecast) -> None:
    """With arrivals that jitter by 30 µs and sleeps that end up to 80 µs late."""
    random, now, waiting = Random(1), 0.0, 0
    forecast.note_arrival(now, was_waiting=False)
    for count in range(1, 5001):
        arrival = count * CYCLE + random.gauss(0.0, 30e-6)
        was_waiting = forecast.wake_at() + random.uniform(0.0, 80e-6) > arrival
        waiting += was_waiting
        forecast.note_arrival(arrival, was_waiting=was_waiting)
    assert waiting / 5000 < 0.05
    assert forecast.margin < 0.08 * CYCLE
