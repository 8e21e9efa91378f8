"""The One-Euro filter: rest, motion, turns."""

from __future__ import annotations

from math import exp, hypot, pi, sin, tau

import numpy as np
import pytest

from abb_protocols.robot.joints import Pose
from abb_protocols.robot.kinematics import (
    IDENTITY_QUATERNION,
    pose_distance,
    quaternion_of,
    quaternion_product,
    turn_between,
)
from yumi.control.motion.one_euro import OneEuroFilter, PoseFilter

DT = 1.0 / 90.0


def test_value_that_stays_is_reached_as_by_a_filter_of_first_order() -> None:
    smooth = OneEuroFilter((0.0,), cutoff=2.0, beta=0.0)
    values = [smooth.step((1.0,), 1e-4)[0] for _ in range(1000)]
    assert values[-1] == pytest.approx(1.0 - exp(-tau * 2.0 * 0.1), abs=1e-3)


def test_trembling_is_filtered_and_a_motion_lags_less_the_faster_it_is() -> None:
    generator = np.random.default_rng(1)
    smooth = OneEuroFilter((0.0, 0.0, 0.0), cutoff=1.0, beta=0.0)
    noise = [smooth.step(generator.normal(size=3).tolist(), DT)[0] for _ in range(2000)]
    assert np.std(noise[200:]) < 0.25

    def lag(speed: float, beta: float) -> float:
        smooth = OneEuroFilter((0.0,), cutoff=1.0, beta=beta)
        last = 0.0
        for number in range(1, 400):
            (last,) = smooth.step((speed * number * DT,), DT)
        return 399 * DT - last / speed

    assert lag(0.5, 0.0) == pytest.approx(1.0 / tau, rel=0.05)
    assert lag(1.0, 20.0) < 0.6 * lag(0.5, 20.0) < 0.1 * lag(0.5, 0.0)


def test_cutoff_of_zero_filters_nothing() -> None:
    smooth = PoseFilter(Pose((0.0, 0.0, 0.0), IDENTITY_QUATERNION), cutoff=0.0, beta=5.0)
    pose = Pose((1.0, 2.0, 3.0), quaternion_of((0.3, -0.2, 0.9)))
    assert pose_distance(smooth.step(pose, DT), pose) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_orientation_is_filtered_the_shorter_way_round() -> None:
    start = Pose((0.0, 0.0, 0.0), quaternion_of((0.0, 0.0, 3.0)))
    smooth = PoseFilter(start, cutoff=5.0, beta=0.0)
    target = Pose(
        start.position, quaternion_product(quaternion_of((0.0, 0.0, 0.4)), start.orientation)
    )  # beyond half a turn
    turned = [hypot(*turn_between(start.orientation, smooth.step(target, DT).orientation)) for _ in range(90)]
    assert turned == sorted(turned)
    assert turned[-1] == pytest.approx(0.4, abs=1e-9)


def test_filtered_orientation_stays_a_rotation() -> None:
    smooth = PoseFilter(Pose((0.0, 0.0, 0.0), IDENTITY_QUATERNION), cutoff=1.0, beta=1.0)
    for number in range(1000):
        turn = (2.0 * sin(0.1 * number), pi * sin(0.03 * number), 0.5)
        pose = smooth.step(Pose((0.0, 0.0, 0.0), quaternion_of(turn)), DT)
        assert hypot(*pose.orientation) == pytest.approx(1.0, abs=1e-12)


def test_time_that_stands_still_changes_nothing() -> None:
    smooth = OneEuroFilter((1.0,), cutoff=1.0, beta=1.0)
    assert smooth.step((2.0,), 0.0) == (1.0,)
