"""Motions along a path in joints keep speed, acceleration and jerk, and take little longer than without jerk limits."""

from __future__ import annotations

from statistics import median

import numpy as np
import pytest
from numpy.typing import NDArray

from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS
from soak import long, short, tell
from yumi.planning.path_timing import NO_PATH_CEILING, MotionLimits, accelerating_law, fastest_along, time_demand
from yumi.planning.rounded_path import RoundedPath

Array = NDArray[np.float64]

BOTH = MotionLimits(
    *(
        np.tile(np.array(each), 2)
        for each in (
            YUMI_LIMITS.velocity,
            YUMI_LIMITS.acceleration,
            YUMI_LIMITS.jerk,
            YUMI_LIMITS.lower,
            YUMI_LIMITS.upper,
        )
    )
)
RATIO, BUILD_UP = 1.12, 0.16
"""How much longer than without jerk limits: an eighth, and the time in which the jerk builds accelerations up [s]."""


def corners(seed: int, count: int) -> Array:
    return np.random.default_rng(seed).uniform(0.5 * BOTH.lower, 0.5 * BOTH.upper, (count, 14))


@pytest.mark.parametrize("count", [short(6), long(2000, 1800.0)])
def test_motion_keeps_the_limits_and_is_nearly_the_fastest(count: int) -> None:
    ratios = []
    for seed in range(count):
        given = corners(seed, 2 + seed % 5)
        path = RoundedPath(given, BOTH.velocity, deviation=0.15)
        _, positions = fastest_along(path, BOTH)
        assert positions[[0, -1]] == pytest.approx(given[[0, -1]], abs=1e-9)
        rows = np.concatenate([*[positions[:1]] * 3, positions, *[positions[-1:]] * 3])
        for order, most in enumerate((BOTH.velocity, BOTH.acceleration, BOTH.jerk), 1):
            assert np.all(np.abs(np.diff(rows, order, axis=0)) / CYCLE**order <= most * (1.0 + 1e-9)), (seed, order)
        duration, fastest = len(positions) * CYCLE, len(accelerating_law(path, BOTH, 1.0)) * CYCLE
        ratios.append(duration / fastest)
        assert duration <= RATIO * fastest + BUILD_UP, (seed, duration, fastest)
    if count > 6:
        tell(f"{count} motions: {median(ratios):.2f} times as long as without jerk limits, at most {max(ratios):.2f}")


def test_one_joint_on_a_straight_line_takes_little_more_than_its_least_time() -> None:
    given = np.zeros((2, 14))
    given[1, 0] = 1.5
    _, positions = fastest_along(RoundedPath(given, BOTH.velocity, 0.15), BOTH)
    # 180°/s, 20 rad/s², 300 rad/s³: way / speed + speed / acceleration + acceleration / jerk.
    best = 1.5 / BOTH.velocity[0] + BOTH.velocity[0] / 20.0 + 20.0 / 300.0
    assert best <= (len(positions) - 1) * CYCLE < 1.15 * best


def test_path_is_passed_below_its_ceiling_and_not_slower_elsewhere() -> None:
    given = corners(1, 2)
    path = RoundedPath(given, BOTH.velocity, 0.15)
    free, _ = fastest_along(path, BOTH)
    places, most = np.linspace(0.0, path.length, 200), float(np.max(np.diff(free))) / CYCLE
    ceiling = np.where(np.abs(places / path.length - 0.5) < 0.2, 0.3 * most, NO_PATH_CEILING)
    law, positions = fastest_along(path, BOTH, ceiling)
    assert float(np.max(time_demand(positions, BOTH))) <= 1.0
    speeds, at = np.diff(law) / CYCLE, law[1:] / path.length
    assert np.max(speeds[np.abs(at - 0.5) < 0.1]) <= 0.301 * most
    assert np.max(speeds[at < 0.3]) > 0.5 * most
    assert np.max(speeds[at > 0.7]) > 0.5 * most


def test_rounded_path_bends_without_a_jump_and_stays_near_its_corners() -> None:
    given = corners(3, 4)
    path = RoundedPath(given, BOTH.velocity, deviation=0.15)
    places, step = np.linspace(0.0, path.length, 4_001), path.length / 4_000
    positions, slopes, bends = path.at(places)
    assert np.gradient(positions, step, axis=0)[5:-5] == pytest.approx(slopes[5:-5], abs=5e-3)
    assert np.max(np.abs(np.diff(slopes, axis=0))) <= np.max(np.abs(bends)) * step * 1.01
    for corner in given:
        assert np.min(np.max(np.abs(positions - corner), axis=1)) <= 0.15 + 1e-9


def test_corner_without_room_is_sharpened_until_it_has_none() -> None:
    given = corners(4, 3)
    path = RoundedPath(given, BOTH.velocity, deviation=0.15)
    at_corner = np.array([float(np.linalg.norm((given[1] - given[0]) / BOTH.velocity))])
    far = np.max(np.abs(path.at(at_corner)[0] - given[1]))
    assert path.sharpen(at_corner)
    assert np.max(np.abs(path.at(at_corner)[0] - given[1])) == pytest.approx(0.5 * far)
    assert not path.sharpen(np.array([0.0]))  # no corner there
    while path.sharpen(at_corner):
        pass
    assert np.max(np.abs(path.at(at_corner)[0] - given[1])) < 1e-4
    _, positions = fastest_along(path, BOTH)  # nearly stops there
    assert float(np.max(time_demand(positions, BOTH))) <= 1.0


def test_joint_comes_to_the_end_of_its_range_only_as_fast_as_it_can_stop() -> None:
    given = np.zeros((2, 14))
    given[1, 0] = BOTH.upper[0]
    _, positions = fastest_along(RoundedPath(given, BOTH.velocity, 0.15), BOTH)
    free = MotionLimits(BOTH.velocity, BOTH.acceleration, BOTH.jerk, BOTH.lower - 9.0, BOTH.upper + 9.0)
    _, faster = fastest_along(RoundedPath(given, BOTH.velocity, 0.15), free)
    assert float(np.max(time_demand(positions, BOTH))) <= 1.0 < float(np.max(time_demand(faster, BOTH)))
