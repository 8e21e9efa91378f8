from __future__ import annotations

from collections.abc import Callable
from math import cos, nan, pi, radians, sin
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from abb_protocols.robot.joints import YUMI_LIMITS, ZERO_JOINTS, Joints, joints
from controller_states import moved
from yumi.control.goals import UNKNOWN_JOINTS
from yumi.control.motion.target_predictor import TargetPredictor

PERIOD = 0.004
AHEAD = 0.030


@pytest.fixture
def forecast() -> TargetPredictor:
    forecast = TargetPredictor(YUMI_LIMITS)
    forecast.rest_at(ZERO_JOINTS)
    return forecast


def stream(
    forecast: TargetPredictor,
    path: Callable[[float], float],
    seconds: float,
    lateness: Callable[[], float] = lambda: 0.0,
) -> float:
    """Feed goals of joint 6; returns when the last one came [s]."""
    time = 0.0
    for number in range(round(seconds / PERIOD)):
        time = number * PERIOD
        forecast.add(moved(ZERO_JOINTS, 6, path(time)), UNKNOWN_JOINTS, time + lateness())
    return time


@given(speed=st.floats(-3.0, 3.0), gain=st.floats(-3.0, 3.0))
def test_motion_of_constant_acceleration_is_forecast_without_lag(speed: float, gain: float) -> None:
    forecast = TargetPredictor(YUMI_LIMITS)
    forecast.rest_at(ZERO_JOINTS)
    last = stream(forecast, lambda time: time * (speed + 0.5 * gain * time), 0.8)
    target, then = forecast.at(last, AHEAD), last + AHEAD
    assert target.position[6] == pytest.approx(then * (speed + 0.5 * gain * then), abs=2e-3)
    assert target.velocity[6] == pytest.approx(speed + gain * then, abs=0.02)


def test_goal_that_does_not_move_is_forecast_where_it_is(forecast: TargetPredictor, middle: Joints) -> None:
    for number in range(10):
        forecast.add(middle, UNKNOWN_JOINTS, number * PERIOD)
    assert forecast.at(9 * PERIOD, AHEAD).position == middle


@pytest.mark.parametrize("size_deg", [0.2, 1.0, 10.0, 90.0])
def test_jump_of_the_goal_is_no_motion(forecast: TargetPredictor, size_deg: float) -> None:
    size, speeds, places = radians(size_deg), [], []
    for number in range(100):
        time = number * PERIOD
        forecast.add(moved(ZERO_JOINTS, 6, size * (number >= 50)), UNKNOWN_JOINTS, time)
        target = forecast.at(time, AHEAD)
        speeds.append(target.velocity[6])
        places.append(target.position[6])
    assert max(map(abs, speeds)) == 0.0
    assert places[-1] == pytest.approx(size)
    assert max(places) <= size + 1e-9


def test_jump_while_the_goal_moves_leaves_its_speed_alone(forecast: TargetPredictor) -> None:
    for number in range(200):
        time = number * PERIOD
        forecast.add(moved(ZERO_JOINTS, 6, 0.5 * time + 0.3 * (number >= 100)), UNKNOWN_JOINTS, time)
        if number > 60:
            assert forecast.at(time, AHEAD).velocity[6] == pytest.approx(0.5, abs=0.02)


def test_new_speed_is_known_after_two_goals(forecast: TargetPredictor) -> None:
    for number in range(53):
        time = number * PERIOD
        forecast.add(moved(ZERO_JOINTS, 6, max(0.0, time - 49.5 * PERIOD)), UNKNOWN_JOINTS, time)
    assert forecast.at(time, AHEAD).velocity[6] == pytest.approx(1.0, abs=0.1)


def test_noisy_times_disturb_the_forecast_little(forecast: TargetPredictor) -> None:
    chance = Random(3)
    last = stream(forecast, sin, 2.0, lambda: chance.expovariate(1000.0))
    assert forecast.at(last, AHEAD).position[6] == pytest.approx(sin(last + AHEAD - 0.001), abs=0.006)


def test_speed_that_is_given_is_used(forecast: TargetPredictor) -> None:
    for number in range(50):
        time = number * PERIOD
        forecast.add(moved(ZERO_JOINTS, 6, sin(time)), joints([nan] * 6 + [cos(time)]), time)
    assert forecast.at(time, AHEAD).position[6] == pytest.approx(sin(time + AHEAD), abs=2e-4)


def test_two_goals_at_one_time_make_no_speed(forecast: TargetPredictor) -> None:
    stream(forecast, lambda time: 0.0, 0.2)
    forecast.add(moved(ZERO_JOINTS, 6, 1e-4), UNKNOWN_JOINTS, 0.196)
    forecast.add(moved(ZERO_JOINTS, 6, 2e-4), UNKNOWN_JOINTS, 0.196)
    assert abs(forecast.at(0.196, AHEAD).velocity[6]) < 0.02


def test_cycle_without_a_goal_goes_on_with_the_motion(forecast: TargetPredictor) -> None:
    last = stream(forecast, lambda time: time, 0.4)
    assert forecast.at(last + 0.02, AHEAD).position[6] == pytest.approx(last + 0.02 + AHEAD, abs=1e-3)


def test_stream_that_ends_is_not_forecast_any_further(forecast: TargetPredictor) -> None:
    last = stream(forecast, lambda time: time, 0.4)
    target = forecast.at(last + forecast.timeout + 1e-3, AHEAD)
    assert (target.position[6], target.velocity) == (last, ZERO_JOINTS)


def test_slow_stream_is_given_three_periods(forecast: TargetPredictor) -> None:
    for number in range(60):
        forecast.add(moved(ZERO_JOINTS, 6, 0.025 * number), UNKNOWN_JOINTS, 0.025 * number)
    assert forecast.at(59 * 0.025 + 0.05, 0.0).velocity[6] == pytest.approx(1.0, abs=0.01)
    assert forecast.at(59 * 0.025 + 0.08, 0.0).velocity == ZERO_JOINTS


def test_stream_that_begins_again_has_forgotten_its_speed(forecast: TargetPredictor) -> None:
    last = stream(forecast, lambda time: time, 0.4)
    forecast.add(moved(ZERO_JOINTS, 6, 0.1), UNKNOWN_JOINTS, last + 1.0)
    assert forecast.at(last + 1.0, AHEAD).velocity == ZERO_JOINTS


@given(st.lists(st.tuples(st.floats(-4.0, 4.0), st.floats(0.0, 0.1)), min_size=1, max_size=60))
def test_forecast_never_asks_for_more_than_the_joint_can_do(steps: list[tuple[float, float]]) -> None:
    forecast, time = TargetPredictor(YUMI_LIMITS), 0.0
    forecast.rest_at(ZERO_JOINTS)
    for goal, interval in steps:
        time += interval
        forecast.add(moved(ZERO_JOINTS, 6, goal), UNKNOWN_JOINTS, time)
        target = forecast.at(time, 0.0)
        assert abs(target.velocity[6]) <= YUMI_LIMITS.velocity[6]
        assert abs(target.acceleration[6]) <= YUMI_LIMITS.acceleration[6]


def test_sine_is_forecast_within_its_third_derivative(forecast: TargetPredictor) -> None:
    turn, size = 2.0 * pi * 0.2, radians(60.0)
    last = stream(forecast, lambda time: size * sin(turn * time), 3.0)
    then = last + AHEAD
    assert forecast.at(last, AHEAD).position[6] == pytest.approx(size * sin(turn * then), abs=1e-3)
