"""Distances are those of another calculation, and the collision shapes contain the described ones."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import mujoco
import numpy as np
import pytest

from abb_protocols.errors import CommandRefused
from abb_protocols.robot.description import (
    BODY_SHAPES,
    FINGER_ORIGINS,
    FINGER_SHAPES,
    FLANGE_ORIGIN,
    GRIPPER_SHAPES,
    JOINT_ORIGINS,
    SERVO_GRIPPERS,
    TOOL0_ORIGIN,
    Box,
    joint_1_origin,
)
from abb_protocols.robot.gripper_values import FINGER_TRAVEL, GripperModules
from abb_protocols.robot.joints import POSES, YUMI_LIMITS, Joints, Pose, Side, home, joints, named_pose
from abb_protocols.robot.kinematics import (
    compose_poses,
    inverse_pose,
    matrix_from_quaternion,
    quaternion_from_euler_zyx,
    tool0_to_body,
)
from abb_view.robot_model import MESH_FOLDER
from refusals import refused
from yumi.control.collisions import BODY_MARGIN
from yumi.core.collision import (
    COLLISION_PADDING,
    Array,
    CollisionModel,
    CollisionPart,
    Obstacle,
    gripper_parts,
    link_parts,
)

UPRIGHT = (1.0, 0.0, 0.0, 0.0)
HOME = {side: home(side) for side in Side}


def segment_distances(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Distances of segments a-b from segments c-d, (n,), each given by its ends (n, 3) [m].

    The nearest points of the lines, moved into the segments one after the other; then the first again, for where it is
    nearest to the second's point (C. Ericson, Real-Time Collision Detection, §5.1.9).
    """
    along, other, between = b - a, d - c, a - c
    length, other_length = np.sum(along * along, 1), np.sum(other * other, 1)
    dot, offset, other_offset = np.sum(along * other, 1), np.sum(along * between, 1), np.sum(other * between, 1)
    tiny = 1e-18
    denominator = length * other_length - dot * dot
    parallel = denominator < tiny
    first = np.clip((dot * other_offset - offset * other_length) / np.where(parallel, 1.0, denominator), 0.0, 1.0)
    first = np.where(parallel, 0.0, first)
    second = np.clip((dot * first + other_offset) / np.maximum(other_length, tiny), 0.0, 1.0)
    first = np.clip((dot * second - offset) / np.maximum(length, tiny), 0.0, 1.0)
    return np.asarray(np.linalg.norm(between + first[:, None] * along - second[:, None] * other, axis=1))


def box_distances(start: Array, end: Array, half: Array) -> tuple[Array, Array]:
    """Distances of segments from boxes about the origin, (n,); 0 where a segment passes through its box.

    Also how far along the segments that is, from 0 to 1, (n,).

    The squared distance along a segment is convex, and a parabola between the places where the segment crosses the
    plane of a face, so its slope is a line between two of them: the nearest point is where it is zero.

    Args:
        start: one end of each segment in the frame of its box, (n, 3) [m].
        end: the other end, (n, 3) [m].
        half: half the edges of each box, (n, 3) [m].
    """
    along = end - start
    safe = np.where(np.abs(along) < 1e-15, 1e-15, along)
    crossings = np.concatenate([(half - start) / safe, (-half - start) / safe], 1)
    limits = np.broadcast_to((0.0, 1.0), (len(start), 2))
    shares = np.sort(np.concatenate([np.clip(crossings, 0.0, 1.0), limits], 1), 1)

    def outside(share: Array) -> Array:
        points = start[:, None] + share[..., None] * along[:, None]
        return np.asarray(points - np.clip(points, -half[:, None], half[:, None]))

    slopes = np.sum(outside(shares) * along[:, None], 2)
    # The last crossing with a slope below zero and the next one; the zero lies between them.
    index = np.clip(np.sum(slopes < 0.0, 1) - 1, 0, shares.shape[1] - 2)[:, None]
    low, high = np.take_along_axis(slopes, index, 1), np.take_along_axis(slopes, index + 1, 1)
    left, right = np.take_along_axis(shares, index, 1), np.take_along_axis(shares, index + 1, 1)
    share = np.clip(-low / np.where(high - low == 0.0, 1.0, high - low), 0.0, 1.0)
    share = left + share * (right - left)
    return np.linalg.norm(outside(share)[:, 0], axis=1), share[:, 0]


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
    squares = sum(np.square(first[:, :, None, axis] - second[:, None, :, axis]) for axis in range(3))
    sampled = np.sqrt(np.min(squares, axis=(1, 2)))
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


def placed(side: Side, position: Joints, parts: tuple[CollisionPart, ...]) -> tuple[Array, Array]:
    """Both ends of the axis of each part in the body frame, (n, 3) each."""
    frame, frames = np.eye(4), []
    origins = (joint_1_origin(side), *JOINT_ORIGINS, FLANGE_ORIGIN, TOOL0_ORIGIN)
    for origin, angle in zip(origins, (*position, 0.0, 0.0), strict=True):
        step, turn = np.eye(4), np.eye(4)
        step[:3, :3], step[:3, 3] = matrix_from_quaternion(quaternion_from_euler_zyx(origin.rpy)), origin.xyz
        turn[:2, :2] = (np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle))
        frame = frame @ step @ turn
        frames.append(frame)
    frames[7:] = frames[8:]  # without the flange's
    start, end = (
        np.array([(frames[part.frame] @ (*getattr(part, name), 1.0))[:3] for part in parts])
        for name in ("start", "end")
    )
    return start, end


def test_distances_in_random_postures_are_those_of_another_calculation() -> None:
    generator = np.random.default_rng(8)
    pose = Pose((0.4, 0.1, 0.1), (np.cos(0.3), 0.0, 0.0, np.sin(0.3)))
    model, compared = CollisionModel(SERVO_GRIPPERS, obstacles=[Obstacle("box", pose, (0.2, 0.1, 0.3))]), 0
    parts = {side: (*link_parts(), *gripper_parts(SERVO_GRIPPERS[side])) for side in Side}
    for _ in range(30):
        positions = {side: joints(list(generator.uniform(YUMI_LIMITS.lower, YUMI_LIMITS.upper))) for side in Side}
        both = np.concatenate([positions[side] for side in Side])
        found: dict[tuple[int, int], float] = {}
        for alone in (None, *Side):
            near = model.contacts(both, 0.3, alone)
            found |= {(first, second): distance for distance, _, _, (first, second) in near.tolist()}
        (right, left), fixed = (placed(side, positions[side], parts[side]) for side in Side), len(model.names) - 1
        radii = {side: np.array([part.radius + COLLISION_PADDING for part in parts[side]]) for side in Side}
        for i in range(len(parts[Side.RIGHT])):
            for j in range(len(parts[Side.LEFT])):
                ends = right[0][i], right[1][i], left[0][j], left[1][j]
                exact = (
                    segment_distances(*(each[None] for each in ends))[0] - radii[Side.RIGHT][i] - radii[Side.LEFT][j]
                )
                pair = i, model.arms[Side.LEFT].start + j
                if parts[Side.RIGHT][i].frame == parts[Side.LEFT][j].frame == 0 or not -0.01 < exact < 0.29:
                    assert parts[Side.RIGHT][i].frame == 0 or exact < 0.0 or pair not in found or found[pair] > 0.28
                    continue
                assert found[pair] == pytest.approx(exact, abs=1e-6)
                compared += 1
        for side, (start, end) in ((Side.RIGHT, right), (Side.LEFT, left)):
            local = [(each - pose.position) @ matrix_from_quaternion(pose.orientation) for each in (start, end)]
            exact = box_distances(*local, np.tile((0.1, 0.05, 0.15), (len(start), 1)))[0]
            for part, (distance, radius) in enumerate(zip(exact, radii[side], strict=True)):
                if 1e-3 < distance < 0.29 + radius:
                    assert found[model.arms[side].start + part, fixed] == pytest.approx(distance - radius, abs=1e-6)
                    compared += 1
    assert compared > 3000


def test_distances_and_nearest_points_are_those_of_mujoco() -> None:
    generator, compared = np.random.default_rng(9), 0
    pose = Pose((0.45, 0.0, 0.2), (np.cos(0.4), 0.0, 0.0, np.sin(0.4)))
    model = CollisionModel(SERVO_GRIPPERS, obstacles=[Obstacle("box", pose, (0.2, 0.1, 0.3))])
    for _ in range(10):
        positions = {side: joints(list(generator.uniform(YUMI_LIMITS.lower, YUMI_LIMITS.upper))) for side in Side}
        spec = mujoco.MjSpec()
        for side in Side:
            parts = (*link_parts(), *gripper_parts(SERVO_GRIPPERS[side]))
            for part, start, end in zip(parts, *placed(side, positions[side], parts), strict=True):
                size = (part.radius + COLLISION_PADDING, 0.0, 0.0)
                spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=[*start, *end], size=size)
        boxes = (pose.position, pose.orientation, (0.1, 0.05, 0.15))
        box = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, pos=boxes[0], quat=boxes[1], size=boxes[2])
        shapes, numbers = spec.compile(), {len(model.names) - 1: box.id}
        data = mujoco.MjData(shapes)
        mujoco.mj_kinematics(shapes, data)
        for found in [model.contacts(np.concatenate([*positions.values()]), 0.2, alone) for alone in (None, *Side)]:
            for distance, normal, points, (first, second) in found.tolist():
                geometry = numbers.get(second, second)
                if distance < 1e-3 or geometry > box.id or model.names[second] == "body":
                    continue
                line = np.zeros(6)
                exact = mujoco.mj_geomDistance(shapes, data, first, geometry, 0.3, line)
                assert distance == pytest.approx(exact, abs=1e-6)
                assert np.subtract(points[1], points[0]) == pytest.approx(np.multiply(distance, normal), abs=1e-12)
                compared += 1
    assert compared > 200


def test_segments_that_are_parallel_or_balls_have_a_distance() -> None:
    """A rod along each tool's axis, the arms mirrored, with a ball at its end."""
    rods = [
        CollisionPart("rod", 7, (0.0, 0.0, 0.1), (0.0, 0.0, 0.3), 0.01),
        CollisionPart("ball", 7, *[(0.0, 0.0, 0.3)] * 2, 0.02),
    ]
    model, generator = CollisionModel(SERVO_GRIPPERS, tools=dict.fromkeys(Side, rods)), np.random.default_rng(4)
    for _ in range(20):
        right = generator.uniform(YUMI_LIMITS.lower, YUMI_LIMITS.upper)
        left = right * (-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0)
        ends = [placed(side, joints(list(each)), tuple(rods)) for side, each in zip(Side, (right, left), strict=True)]
        found = {
            tuple(model.names[number] for number in parts): distance
            for distance, *_, parts in model.contacts(np.concatenate((right, left)), 5.0).tolist()
        }
        for i, j in product(range(2), repeat=2):
            names = f"right {rods[i].name}", f"left {rods[j].name}"
            (exact,) = segment_distances(
                *(each[None] for each in (ends[0][0][i], ends[0][1][i], ends[1][0][j], ends[1][1][j]))
            )
            assert found[names] == pytest.approx(
                exact - rods[i].radius - rods[j].radius - 2.0 * COLLISION_PADDING, abs=1e-9
            )


def test_axis_inside_a_box_is_as_deep_as_the_nearest_face() -> None:
    """So an arm that was switched on there may leave."""
    tip = tool0_to_body(Side.RIGHT, home(Side.RIGHT), Pose((0.0, 0.0, 0.2), UPRIGHT)).position
    needle = CollisionPart("needle", 7, (0.0, 0.0, 0.199), (0.0, 0.0, 0.201), 0.001)
    depths = []
    for lower in (0.0, 0.002, 0.004):
        box = Obstacle("box", Pose((tip[0], tip[1], tip[2] - lower), UPRIGHT), (0.3, 0.3, 0.1))
        model = CollisionModel(SERVO_GRIPPERS, tools={Side.RIGHT: [needle]}, obstacles=[box])
        (distance,) = (
            each.distance for each in model.nearest(HOME, 10_000) if each.part == "right needle" and each.other == "box"
        )
        depths.append(distance)
    assert -0.06 < depths[0] < -0.05
    assert np.diff(depths) == pytest.approx([0.002, 0.002], abs=1e-9)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_positions_and_shapes_that_are_no_numbers_are_refused(value: float) -> None:
    with pytest.raises(ValueError, match="not finite"):
        CollisionModel(
            SERVO_GRIPPERS, tools={Side.LEFT: [CollisionPart("x", 7, (0.0, 0.0, value), (0.0, 0.0, 0.3), 0.003)]}
        )
    with pytest.raises(ValueError, match="positions of 14 joints"):
        CollisionModel(SERVO_GRIPPERS).contacts(np.full(14, value), 0.1)
    with pytest.raises(ValueError, match="positions of 14 joints"):
        CollisionModel(SERVO_GRIPPERS).contacts(np.zeros(7), 0.1)
    with pytest.raises(ValueError, match="of a frame that is none"):
        CollisionModel(
            SERVO_GRIPPERS, tools={Side.LEFT: [CollisionPart("x", 8, (0.0, 0.0, 0.1), (0.0, 0.0, 0.3), 0.003)]}
        )


def inside(points: np.ndarray, parts: tuple[CollisionPart, ...]) -> np.ndarray:
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


def outside(points: Array, boxes: tuple[Box, ...]) -> Array:
    """How far each point is outside of the nearest box [mm], (n,)."""
    beyond = (np.maximum(np.subtract(box.low_mm, points), np.subtract(points, box.high_mm)) for box in boxes)
    return np.asarray(np.min([np.linalg.norm(np.maximum(each, 0.0), axis=1) for each in beyond], 0))


def cover(name: str) -> Array:
    """Points of a mesh that is shown, between the corners of each triangle, too [m], (n, 3)."""
    content = (MESH_FOLDER / f"{name}.stl").read_bytes()[84:]
    layout = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    corners = np.frombuffer(content, dtype=layout)["corners"].astype(float)
    shares = [(i / 4.0, j / 4.0, (4 - i - j) / 4.0) for i in range(5) for j in range(5) if i + j <= 4]
    return np.concatenate([np.einsum("c,ncx->nx", share, corners) for share in shares])


WITHIN = 0.7e-3
"""Covers are this near to the shapes that collide, so that the padding is left for what else there is [m]."""


@pytest.mark.parametrize("name", ["base", "torso"])
def test_body_shapes_contain_its_covers(name: str) -> None:
    points = cover(name) * 1e3
    far = outside(points, BODY_SHAPES)
    assert far.max() <= WITHIN * 1e3, f"{far.max():.1f} mm at {points[far.argmax()].round()}"


@pytest.mark.parametrize("index", range(7))
def test_link_shapes_contain_their_covers(index: int) -> None:
    """Those of the neighbours help, however the joints are turned; the first link's ring is sunk in the body."""
    points = np.concatenate([cover(f"link_{index + 1}"), *([cover(f"ring_{index + 1}")] if 0 < index < 6 else [])])
    far = np.full((5, len(points)), np.inf)
    for part in link_parts():
        if abs(part.frame - index) > 1:
            continue
        for turn, distances in zip(np.linspace(-2.0, 2.0, len(far)), far, strict=True):
            to_link = Pose((0.0, 0.0, 0.0), UPRIGHT)
            if part.frame != index:
                origin = JOINT_ORIGINS[min(part.frame, index)]
                turned = Pose((0.0, 0.0, 0.0), (np.cos(turn / 2.0), 0.0, 0.0, np.sin(turn / 2.0)))
                to_link = compose_poses(Pose(origin.xyz, quaternion_from_euler_zyx(origin.rpy)), turned)
            if part.frame < index:
                to_link = inverse_pose(to_link)
            start, end = (
                np.broadcast_to(matrix_from_quaternion(to_link.orientation) @ each + to_link.position, points.shape)
                for each in (part.start, part.end)
            )
            distances[:] = np.minimum(distances, segment_distances(points, points, start, end) - part.radius)
    assert far.max() <= WITHIN, f"{far.max() * 1e3:.1f} mm at {points[far.max(0).argmax()].round(3)}"


@pytest.mark.parametrize("modules", GripperModules)
def test_arms_at_home_are_free(modules: GripperModules) -> None:
    nearest = CollisionModel(dict.fromkeys(Side, modules)).nearest(HOME)[0]
    assert nearest.distance > 0.0, nearest


@pytest.mark.parametrize("name", POSES)
@pytest.mark.parametrize("modules", GripperModules)
def test_arms_at_named_poses_keep_their_margin_to_the_body(modules: GripperModules, name: str) -> None:
    pose = {side: named_pose(side, name) for side in Side}
    nearest = CollisionModel(dict.fromkeys(Side, modules)).nearest(pose)[0]
    assert nearest.distance > BODY_MARGIN, nearest


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
    nearest = model.nearest(HOME, count=10_000)
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
    needle = CollisionPart("needle", 7, (0.0, 0.0, 0.1), (0.0, 0.0, 0.3), 0.003)
    floor = Obstacle("floor", Pose((0.0, 0.0, -0.6), UPRIGHT), (4.0, 4.0, 0.2))
    model = CollisionModel(SERVO_GRIPPERS, tools={Side.LEFT: [needle]}, obstacles=[floor])
    assert [each for each in model.nearest(HOME, 10_000) if each.part == "left needle" and each.other == "floor"]


def boxes_of(*names: str) -> list[Obstacle]:
    return [Obstacle(name, Pose((1.0, 0.0, 0.0), UPRIGHT), (0.1, 0.1, 0.1)) for name in names]


@pytest.mark.parametrize("side", list(Side))
@pytest.mark.parametrize("modules", list(GripperModules))
def test_box_with_the_name_of_a_part_of_the_robot_is_refused(side: Side, modules: GripperModules) -> None:
    own = {name for name in CollisionModel(dict.fromkeys(Side, modules)).names if name != "body"}
    for name in {"body", f"{side.word} arm", *own}:
        with refused(CommandRefused, "box_named_as_robot", name=name):
            CollisionModel(SERVO_GRIPPERS, obstacles=boxes_of("table", name))


def test_box_with_the_name_of_a_declared_tool_is_refused() -> None:
    needle = {Side.RIGHT: [CollisionPart("needle", 7, (0.0, 0.0, 0.1), (0.0, 0.0, 0.3), 0.003)]}
    with refused(CommandRefused, "box_named_as_robot", name="right needle"):
        CollisionModel(SERVO_GRIPPERS, tools=needle, obstacles=boxes_of("right needle"))
    assert CollisionModel(SERVO_GRIPPERS, tools=needle, obstacles=boxes_of("left needle")).names[-1] == "left needle"


@pytest.mark.parametrize(
    ("names", "code", "values"),
    [
        (("",), "box_without_name", {"name": ""}),
        ((" ",), "box_without_name", {"name": " "}),
        (("post", "table", "post"), "box_named_twice", {"name": "post"}),
        ([f"b{each}" for each in range(101)], "box_one_too_many", {"name": "b100", "count": 101, "most": 100}),
    ],
)
def test_box_is_refused_whose_name_does_not_stand_for_it_alone(
    names: Sequence[str], code: str, values: dict[str, object]
) -> None:
    with refused(CommandRefused, code, **values):
        CollisionModel(SERVO_GRIPPERS, obstacles=boxes_of(*names))


@pytest.mark.parametrize(
    ("names", "code", "values"),
    [
        (["gripper"], "tool_named_as_robot", {"name": "gripper"}),
        (["arm"], "tool_named_as_robot", {"name": "arm"}),
        (["pen", "pen"], "tool_named_twice", {"name": "pen"}),
        ([f"t{each}" for each in range(21)], "tool_one_too_many", {"name": "t20", "count": 21, "most": 20}),
    ],
)
def test_tool_is_refused_whose_name_does_not_stand_for_it_alone(
    names: Sequence[str], code: str, values: dict[str, object]
) -> None:
    tools = [CollisionPart(name, 7, (0.0, 0.0, 0.1), (0.0, 0.0, 0.3), 0.003) for name in names]
    with refused(CommandRefused, code, arm="left", **values):
        CollisionModel(SERVO_GRIPPERS, tools={Side.LEFT: tools})
