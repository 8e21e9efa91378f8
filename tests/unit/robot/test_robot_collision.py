"""Distances of segments and boxes are exact, and the collision shapes contain the described ones."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from yumi.robot.collision import CollisionModel, Obstacle, Part, box_distances, gripper_parts, segment_distances
from yumi.robot.description import FINGER_ORIGINS, FINGER_SHAPES, FINGER_TRAVEL, GRIPPER_SHAPES, SERVO_GRIPPERS, Box
from yumi.robot.gripper import GripperModules
from yumi.robot.joints import Joints, Pose, Side, home
from yumi.robot.kinematics import tool0_to_body

UPRIGHT = (1.0, 0.0, 0.0, 0.0)
HOME = {side: home(side) for side in Side}


def test_distances_of_segments_are_those_of_their_nearest_points() -> None:
    generator = np.random.default_rng(3)
    a, b, c, d = generator.uniform(-1.0, 1.0, (4, 200, 3))
    b[:20] = a[:20] + (d - c)[:20]  # parallel
    b[20:30] = a[20:30]  # points
    d[25:40] = c[25:40]
    exact = segment_distances(a, b, c, d)
    shares = np.linspace(0.0, 1.0, 201)
    first = a[:, None] + shares[:, None] * (b - a)[:, None]
    second = c[:, None] + shares[:, None] * (d - c)[:, None]
    sampled = np.linalg.norm(first[:, :, None] - second[:, None], axis=3).min((1, 2))
    assert np.all(exact <= sampled + 1e-12)
    assert np.all(sampled <= exact + 0.02)


def test_distances_from_boxes_are_those_of_the_nearest_points() -> None:
    generator = np.random.default_rng(4)
    start, end = generator.uniform(-2.0, 2.0, (2, 300, 3))
    end[:20] = start[:20]
    end[20:40, :2] = start[20:40, :2]  # along an edge
    half = generator.uniform(0.1, 1.0, (300, 3))
    exact, share = box_distances(start, end, half)
    points = start[:, None] + np.linspace(0.0, 1.0, 4001)[:, None] * (end - start)[:, None]
    sampled = np.linalg.norm(points - np.clip(points, -half[:, None], half[:, None]), axis=2).min(1)
    assert np.all(exact <= sampled + 1e-12)
    assert np.all(sampled <= exact + 2e-3)
    nearest = start + share[:, None] * (end - start)
    assert np.allclose(np.linalg.norm(nearest - np.clip(nearest, -half, half), axis=1), exact)


def inside(points: np.ndarray, parts: tuple[Part, ...]) -> np.ndarray:
    """Whether each point lies in one of the parts."""
    result = np.zeros(len(points), dtype=bool)
    for part in parts:
        start, end = (np.broadcast_to(each, points.shape) for each in (part.start, part.end))
        result |= segment_distances(points, points, start, end) <= part.radius + 1e-9
    return result


def surface(box: Box) -> np.ndarray:
    steps = np.linspace(0.0, 1.0, 9)
    grid = np.array([each for each in product(steps, repeat=3) if any(value in {0.0, 1.0} for value in each)])
    low, high = np.array(box.low_mm) / 1000.0, np.array(box.high_mm) / 1000.0
    return low + grid * (high - low)


@pytest.mark.parametrize("modules", GripperModules)
def test_gripper_shapes_contain_the_described_gripper_in_every_opening(modules: GripperModules) -> None:
    (base,), (finger,) = GRIPPER_SHAPES, FINGER_SHAPES
    assert isinstance(base, Box)
    assert isinstance(finger, Box)
    parts = gripper_parts(modules)
    assert inside(surface(base), parts).all()
    for opening in (0.0, FINGER_TRAVEL / 2.0, FINGER_TRAVEL):
        first = surface(finger) + FINGER_ORIGINS[0].xyz - (opening, 0.0, 0.0)
        assert inside(first, parts).all()
        assert inside(first * (-1.0, -1.0, 1.0), parts).all()


@pytest.mark.parametrize("modules", GripperModules)
def test_arms_at_home_are_free(modules: GripperModules) -> None:
    nearest = CollisionModel(dict.fromkeys(Side, modules)).nearest(HOME)[0]
    assert nearest.distance > 0.0, nearest


def test_arms_whose_shoulders_turn_towards_each_other_overlap() -> None:
    """Sent both to joint 1 = ±168°, they pass through one another (issue: two arms that cannot touch)."""
    turned: dict[Side, Joints] = {}
    for side, sign in ((Side.RIGHT, 1.0), (Side.LEFT, -1.0)):
        turned[side] = (sign * np.radians(100.0), *home(side)[1:])
    assert CollisionModel(SERVO_GRIPPERS).nearest(turned)[0].distance < 0.0


@pytest.mark.parametrize("side", Side)
def test_a_box_at_the_tool_is_named(side: Side) -> None:
    tip = tool0_to_body(side, home(side), Pose((0.0, 0.0, 0.20), UPRIGHT)).position
    model = CollisionModel(SERVO_GRIPPERS, obstacles=[Obstacle("crate", Pose(tip, UPRIGHT), (0.02, 0.02, 0.02))])
    nearest = model.nearest(HOME, count=100)
    crates = [each for each in nearest if each.other == "crate"]
    assert crates[0].part == f"{side.word} fingers"
    assert 0.02 < crates[0].distance < 0.06


def test_a_turned_box_is_as_near_as_its_faces() -> None:
    """A wall turned by 45° about z, nearer by its turned face than by its corner circle."""
    quarter = Pose((0.9, 0.0, 0.2), (np.cos(np.pi / 8.0), 0.0, 0.0, np.sin(np.pi / 8.0)))
    straight = Pose((0.9, 0.0, 0.2), UPRIGHT)
    distances = []
    for pose in (quarter, straight):
        model = CollisionModel(SERVO_GRIPPERS, obstacles=[Obstacle("post", pose, (0.2, 0.2, 2.0))])
        distances.append(min(each.distance for each in model.nearest(HOME, 10_000) if each.other == "post"))
    assert distances[1] - distances[0] == pytest.approx(0.1 * (2.0**0.5 - 1.0), abs=0.03)


def test_a_declared_tool_reaches_further() -> None:
    needle = Part("needle", 7, (0.0, 0.0, 0.1), (0.0, 0.0, 0.3), 0.003)
    floor = Obstacle("floor", Pose((0.0, 0.0, -0.6), UPRIGHT), (4.0, 4.0, 0.2))
    model = CollisionModel(SERVO_GRIPPERS, tools={Side.LEFT: [needle]}, obstacles=[floor])
    assert [each for each in model.nearest(HOME, 10_000) if each.part == "left needle" and each.other == "floor"]
