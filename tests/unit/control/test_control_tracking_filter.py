from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from math import cos, pi, radians, sin
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, ZERO_JOINTS, Joints
from controller_states import moved
from yumi.control.motion.setpoint import Setpoint
from yumi.control.motion.tracking_filter import TrackingFilter

Path = Callable[[float], tuple[float, float, float]]


def target_at(path: Path, time: float) -> Setpoint:
    position, velocity, acceleration = path(time)
    return Setpoint(
        moved(ZERO_JOINTS, 6, position), moved(ZERO_JOINTS, 6, velocity), moved(ZERO_JOINTS, 6, acceleration)
    )


def pursued(path: Path, seconds: float, start: Joints = ZERO_JOINTS) -> list[Setpoint]:
    pursuit = TrackingFilter(YUMI_LIMITS)
    pursuit.begin(start)
    return [pursuit.step(target_at(path, number * CYCLE), CYCLE) for number in range(round(seconds / CYCLE))]


def sine(time: float) -> tuple[float, float, float]:
    turn, size = 2.0 * pi * 0.5, 0.5
    return size * (1.0 - cos(turn * time)), size * turn * sin(turn * time), size * turn * turn * cos(turn * time)


def assert_within_limits(steps: list[Setpoint]) -> None:
    for before, after in pairwise(steps):
        assert abs(after.velocity[6]) <= YUMI_LIMITS.velocity[6]
        assert abs(after.acceleration[6]) <= YUMI_LIMITS.acceleration[6]
        assert abs(after.acceleration[6] - before.acceleration[6]) <= YUMI_LIMITS.jerk[6] * CYCLE * 1.01
        moved_by = after.position[6] - before.position[6]
        assert abs(moved_by) <= YUMI_LIMITS.velocity[6] * CYCLE


def test_smooth_target_is_reached_and_kept() -> None:
    """What is left is the target's jerk, 15.5 rad/s³, over the third power of the stiffness."""
    steps = pursued(sine, 2.0)
    for number, step in enumerate(steps[150:], start=150):
        assert step.position[6] == pytest.approx(sine(number * CYCLE)[0], abs=2.6e-4)


def test_target_of_constant_acceleration_is_caught_up_with() -> None:
    steps = pursued(lambda time: (0.5 * time * time + 0.1, time, 1.0), 1.0)
    assert_within_limits(steps)
    assert steps[-1].position[6] == pytest.approx(0.5 * ((len(steps) - 1) * CYCLE) ** 2 + 0.1, abs=1e-6)


@pytest.mark.parametrize("size_deg", [0.01, 0.5, 10.0, 170.0])
def test_jump_is_made_within_the_limits_and_without_overshoot(size_deg: float) -> None:
    size = radians(size_deg)
    steps = pursued(lambda _: (size, 0.0, 0.0), 2.0)
    assert_within_limits(steps)
    assert steps[-1].position[6] == pytest.approx(size, abs=1e-6)
    assert max(step.position[6] for step in steps) <= size + 1e-4


def test_target_that_sets_out_at_speed_is_caught_up_with() -> None:
    steps = pursued(lambda time: (1.5 * time + 0.2, 1.5, 0.0), 1.0)
    assert_within_limits(steps)
    assert steps[-1].position[6] == pytest.approx(1.5 * (len(steps) - 1) * CYCLE + 0.2, abs=1e-4)


def test_noise_of_the_target_is_passed_on_weakly() -> None:
    chance = Random(1)
    steps = pursued(lambda _: (chance.gauss(0.0, 1e-4), 0.0, 0.0), 4.0)
    rms = (sum(step.position[6] ** 2 for step in steps) / len(steps)) ** 0.5
    assert rms < 0.5e-4
    assert_within_limits(steps)


@given(st.lists(st.tuples(st.floats(-2.0, 2.0), st.floats(-8.0, 8.0)), min_size=1, max_size=12))
def test_limits_are_kept_whatever_the_target_does(orders: list[tuple[float, float]]) -> None:
    steps = pursued(lambda time: (*orders[int(time / 0.1) % len(orders)], 0.0), 0.1 * len(orders))
    assert_within_limits(steps)


def test_joints_are_pursued_apart_from_each_other() -> None:
    steps = pursued(lambda _: (radians(90.0), 0.0, 0.0), 0.5)
    assert all(step.position[:6] == ZERO_JOINTS[:6] for step in steps)


def test_pursuit_that_begins_in_motion_goes_on_smoothly() -> None:
    pursuit = TrackingFilter(YUMI_LIMITS)
    pursuit.begin(ZERO_JOINTS, moved(ZERO_JOINTS, 6, 1.0))
    steps = [pursuit.step(Setpoint(ZERO_JOINTS), CYCLE) for _ in range(300)]
    assert steps[0].velocity[6] == pytest.approx(1.0, abs=0.02)
    assert steps[-1].position[6] == pytest.approx(0.0, abs=1e-6)
    assert_within_limits(steps)
