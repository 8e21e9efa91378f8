from __future__ import annotations

import random

import numpy as np
import pytest

from abb_protocols.robot.joints import YUMI_LIMITS, Joints, Pose, Side, home, joints
from yumi.core.collision import CollisionModel
from yumi.driver.surroundings import Surroundings, SurroundingsBox, shapes_of
from yumi.web.distances import NEAR_DISTANCE, Distances

TURNED = Pose((0.35, 0.05, 0.1), (0.9238795, 0.0, 0.0, 0.3826834))  # by 45 degrees about z
SURROUNDINGS = Surroundings(boxes=(SurroundingsBox("box", TURNED, (0.2, 0.1, 0.2)),))


def test_nearest_pair_is_that_of_the_exact_shapes_and_its_points_are_as_far_from_each_other() -> None:
    numbers = random.Random(5)
    distances = Distances(SURROUNDINGS)
    grippers, tools, obstacles = shapes_of(SURROUNDINGS)
    exact = CollisionModel(grippers, tools=tools, obstacles=obstacles)
    seen = 0
    for _ in range(60):
        positions: dict[Side, Joints] = {
            side: joints(
                [numbers.uniform(0.6 * a, 0.6 * b) for a, b in zip(YUMI_LIMITS.lower, YUMI_LIMITS.upper, strict=True)]
            )
            for side in Side
        }
        found = distances.nearest(positions)
        pairs = [pair for pair in exact.nearest(positions, 10_000) if pair.other != "body"]
        if found is None:
            assert pairs[0].distance > NEAR_DISTANCE - 0.003
            continue
        seen += 1
        if pairs[0].distance < 0.004:  # how deep shapes lie in each other is told otherwise of balls
            assert found.distance < 0.004
        else:
            assert found.distance == pytest.approx(pairs[0].distance, abs=0.004)
            assert np.linalg.norm(np.subtract(found.start, found.end)) == pytest.approx(found.distance, abs=1e-6)
    assert seen > 20


def test_nothing_is_near_at_home_without_boxes() -> None:
    assert Distances(Surroundings()).nearest({side: home(side) for side in Side}) is None
