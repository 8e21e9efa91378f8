"""Distances between the arms, their grippers, the body and what stands around the robot.

Each moving part is covered by capsules (segments with a radius), the body and everything that stands still by boxes.
The shapes contain those of the robot's description (:mod:`yumi.robot.description`), which are fitted to public meshes
of the robot's covers; `PADDING` leaves room for cables and the tolerances of castings. This is no safety function: a
person in the way, or a part that was not declared, is not seen.

Positions are in the body frame [m], joints in chain order [rad].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, hypot, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from yumi.robot.description import (
    BODY_SHAPES,
    FINGER_ORIGINS,
    FINGER_SHAPES,
    FINGER_TRAVEL,
    FLANGE_ORIGIN,
    GRIPPER_SHAPES,
    JOINT_ORIGINS,
    LINK_SHAPES,
    TOOL0_ORIGIN,
    Box,
    Origin,
    joint_1_origin,
)
from yumi.robot.gripper import GripperModules
from yumi.robot.joints import Joints, Pose, Side, Vector, joints
from yumi.robot.kinematics import matrix, quaternion_from_euler_zyx

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

PADDING = 0.004
"""Added to every radius: cables, labels, and castings that differ from the meshes [m]."""

_LINKS = 7
_GRIPPER = _LINKS  # index of tool0's frame behind those of the links


@dataclass(frozen=True, slots=True)
class Part:
    """A capsule that moves with a link or with tool0.

    Attributes:
        name: of the part, as it is shown, e.g. ``forearm``.
        frame: index of the link from 0 in chain order, or 7 for tool0.
        start: one end of its axis in that frame [m].
        end: the other end [m].
        radius: around the axis, without padding [m].
    """

    name: str
    frame: int
    start: Vector
    end: Vector
    radius: float


@dataclass(frozen=True, slots=True)
class Obstacle:
    """A box that stands still.

    Attributes:
        name: as it is shown, e.g. ``table``.
        centre: pose of the box's centre in the body frame.
        size: its edges along x, y, z of that pose [m].
    """

    name: str
    centre: Pose
    size: Vector


@dataclass(frozen=True, slots=True)
class Distance:
    """How near two parts are.

    Attributes:
        distance: between the padded surfaces; negative where they overlap [m].
        part: of the first arm, e.g. ``right wrist``.
        other: of the other arm, of the body or around the robot.
    """

    distance: float
    part: str
    other: str


LINK_NAMES = ("shoulder", "upper arm", "upper arm", "elbow", "forearm", "wrist", "flange")


def gripper_parts(modules: GripperModules) -> tuple[Part, ...]:
    """The gripper with its fingers in any opening, its camera and its cups (reference/yumi.md §2.2, §2.4)."""
    (body,) = GRIPPER_SHAPES
    half_x, half_y, height = (value / 1000.0 for value in body.high_mm)
    # Four capsules side by side: circles of this radius about the middles of its quarters cover the cross-section.
    radius = hypot(half_x / 2.0, half_y / 2.0)
    parts = [
        Part("gripper", _GRIPPER, (x, y, 0.0), (x, y, height), radius)
        for x in (-half_x / 2.0, half_x / 2.0)
        for y in (-half_y / 2.0, half_y / 2.0)
    ]
    (finger,) = FINGER_SHAPES
    (low_x, low_y, low_z), (_, high_y, high_z) = ([value / 1000.0 for value in corner] for corner in _corners(finger))
    # Both fingers, wherever they are: side by side along x, one above the other along z.
    origin, slices = FINGER_ORIGINS[0].xyz, 3
    reach, step = FINGER_TRAVEL - low_x, (high_z - low_z) / slices
    half_y = max(abs(low_y + origin[1]), abs(high_y + origin[1]))
    for index in range(slices):
        z = origin[2] + low_z + (index + 0.5) * step
        parts.append(Part("fingers", _GRIPPER, (-reach, 0.0, z), (reach, 0.0, z), hypot(half_y, step / 2.0)))
    if modules.has_camera:
        parts.append(Part("camera", _GRIPPER, (-0.0073, 0.0, 0.0351), (-0.0073, 0.0283, 0.0351), 0.015))
    for channel, side in zip(modules.vacuum_channels, (1.0, -1.0), strict=False):
        parts.append(Part(f"cup {channel}", _GRIPPER, (0.0, 0.0185, 0.0375), (side * 0.0635, 0.0185, 0.0375), 0.012))
    return tuple(parts)


class CollisionModel:
    """The shapes of one robot with its grippers, tools and surroundings.

    Args:
        grippers: the modules of each arm's gripper.
        tools: more parts of an arm: fingers of one's own, a tool, an object it holds.
        obstacles: what stands around the robot.
        padding: added to every radius [m].
    """

    def __init__(
        self,
        grippers: Mapping[Side, GripperModules],
        *,
        tools: Mapping[Side, Sequence[Part]] | None = None,
        obstacles: Sequence[Obstacle] = (),
        padding: float = PADDING,
    ) -> None:
        self.arms = {
            side: _ArmShapes(
                side, (*link_parts(), *gripper_parts(grippers[side]), *(tools or {}).get(side, ())), padding
            )
            for side in Side
        }
        self.fixed = fixed = [Obstacle("body", *_middle_and_size(box)) for box in BODY_SHAPES] + list(obstacles)
        self._fixed_names = [obstacle.name for obstacle in fixed]
        self._rotations = np.array([matrix(obstacle.centre.orientation) for obstacle in fixed])
        self._centres = np.array([obstacle.centre.position for obstacle in fixed])
        self._halves = np.array([obstacle.size for obstacle in fixed]) / 2.0
        right, left = (self.arms[side] for side in Side)
        first, second = (index.ravel() for index in np.indices((len(right.names), len(left.names))))
        # The shoulders are bolted to one body, next to each other.
        keep = (right.frames[first] > 0) | (left.frames[second] > 0)
        self._pairs = first[keep], second[keep]
        self._with_fixed = {}
        for side, arm in self.arms.items():
            part, box = (index.ravel() for index in np.indices((len(arm.names), len(fixed))))
            keep = (arm.frames[part] > 0) | (np.array(self._fixed_names)[box] != "body")
            self._with_fixed[side] = part[keep], box[keep]

    def nearest(self, positions: Mapping[Side, Joints], count: int = 1) -> tuple[Distance, ...]:
        """The nearest pairs of parts, nearest first: arm to arm, and arm to body and obstacles.

        Args:
            positions: of both arms [rad].
            count: how many pairs.
        """
        ends = {side: arm.placed(positions[side]) for side, arm in self.arms.items()}
        right, left = (self.arms[side] for side in Side)
        first, second = self._pairs
        (r_start, r_end), (l_start, l_end) = (ends[side] for side in Side)
        distances = [segment_distances(r_start[first], r_end[first], l_start[second], l_end[second])]
        distances[0] -= right.radii[first] + left.radii[second]
        names = [(right.names[i], left.names[j]) for i, j in zip(first.tolist(), second.tolist(), strict=True)]
        for side, arm in self.arms.items():
            part, box = self._with_fixed[side]
            start, end = (
                np.einsum("nji,nj->ni", self._rotations[box], each[part] - self._centres[box]) for each in ends[side]
            )
            distances.append(box_distances(start, end, self._halves[box]) - arm.radii[part])
            names += [(arm.names[i], self._fixed_names[j]) for i, j in zip(part.tolist(), box.tolist(), strict=True)]
        together = np.concatenate(distances)
        order = np.argsort(together, kind="stable")[:count]
        return tuple(Distance(float(together[index]), *names[index]) for index in order)


BALL_EXCESS = 0.0015
"""A row of balls that covers a capsule is at most so much thicker than it [m]."""


class PlacedArm(NamedTuple):
    """The balls that cover an arm in a number of postures, in the body frame.

    Attributes:
        middles: of the balls, (n, 3, balls) [m].
        parts: the middles of the parts, (n, 3, parts) [m].
        frames: of the links and of tool0, (n, 8, 4, 4).
    """

    middles: Array
    parts: Array
    frames: Array


class NearPairs(NamedTuple):
    """Pairs of balls, or of a ball and a box.

    Attributes:
        pairs: their numbers, (k,), see :class:`BallModel`.
        distances: between the surfaces in all postures [m], below zero where they overlap: (right, left, k) of two
            arms, (n, k) of an arm with what stands still.
    """

    pairs: Indices
    distances: Array


class BallModel:
    """The shapes of a :class:`CollisionModel` covered by balls: a little larger, and quick for many postures at once.

    A pair of balls, or of a ball and a box, has a number: first those of both arms, then those of the right arm and of
    the left arm with what stands still.

    Args:
        model: the shapes.

    Attributes:
        reach: by how much a radian of each joint moves any part of an arm, at most [m/rad], (7,), by arm.
        count: of all pairs.
    """

    def __init__(self, model: CollisionModel) -> None:
        self._arms = {side: _ArmBalls(arm) for side, arm in model.arms.items()}
        self.reach = {side: arm.reach() for side, arm in model.arms.items()}
        self._fixed_names = [obstacle.name for obstacle in model.fixed]
        self._to_boxes = np.array([matrix(obstacle.centre.orientation).T for obstacle in model.fixed])
        centres = np.array([obstacle.centre.position for obstacle in model.fixed])
        self._box_offsets = self._to_boxes @ centres[..., None]  # (boxes, 3, 1)
        self._halves = np.array([obstacle.size for obstacle in model.fixed])[..., None] / 2.0
        # What is bolted to each other is infinitely far.
        right, left = self._arms.values()
        together = (right.frames[:, None] == 0) & (left.frames == 0)
        self._sizes = np.where(together, -np.inf, right.radii[:, None] + left.radii)
        self._part_sizes = right.part_radii[:, None] + left.part_radii
        bodies = np.array([name == "body" for name in self._fixed_names])[:, None]
        self._fixed_sizes = {
            side: np.where((arm.frames == 0) & bodies, -np.inf, arm.radii) for side, arm in self._arms.items()
        }
        boxes, both = len(model.fixed), len(right.radii) * len(left.radii)
        self._begins = {Side.RIGHT: both, Side.LEFT: both + boxes * len(right.radii)}
        self.count = self._begins[Side.LEFT] + boxes * len(left.radii)

    def place(self, side: Side, positions: Array) -> PlacedArm:
        """Where an arm's balls are in a number of postures, (n, 7) [rad]."""
        return self._arms[side].place(positions)

    def between(self, right: PlacedArm, left: PlacedArm, within: float) -> NearPairs:
        """The pairs of both arms that may be nearer than ``within`` [m] in any of the postures."""
        # Larger balls round whole parts first: few of them are near each other.
        apart = right.parts[:, None, :, :, None] - left.parts[:, :, None]
        gaps = np.sqrt(np.einsum("rlxab,rlxab->rlab", apart, apart).min((0, 1))) - self._part_sizes
        is_near = gaps < within
        if not is_near.any():
            return NearPairs(np.empty(0, dtype=np.intp), np.empty((len(right.parts), len(left.parts), 0)))
        first, second = self._arms.values()
        rows, columns = np.nonzero(is_near.any(1)[first.part_of])[0], np.nonzero(is_near.any(0)[second.part_of])[0]
        apart = right.middles.take(rows, 2)[:, None, :, :, None] - left.middles.take(columns, 2)[:, :, None]
        distances = np.sqrt(np.einsum("rlxab,rlxab->rlab", apart, apart))
        distances -= self._sizes.take(rows, 0).take(columns, 1)
        pairs = (rows[:, None] * len(second.radii) + columns).ravel()
        return NearPairs(pairs, distances.reshape(len(right.parts), len(left.parts), -1))

    def from_fixed(self, side: Side, placed: PlacedArm, within: float) -> NearPairs:
        """The pairs of an arm with what stands still that may be nearer than ``within`` [m] in any of the postures."""
        arm = self._arms[side]
        over = np.abs(self._to_boxes @ placed.parts[:, None] - self._box_offsets) - self._halves
        np.maximum(over, 0.0, out=over)
        gaps = np.sqrt(np.einsum("nbxp,nbxp->nbp", over, over).min(0)) - arm.part_radii
        is_near = gaps < within
        if not is_near.any():
            return NearPairs(np.empty(0, dtype=np.intp), np.empty((len(placed.parts), 0)))
        boxes, balls = np.nonzero(is_near.any(1))[0], np.nonzero(is_near.any(0)[arm.part_of])[0]
        over = np.abs(self._to_boxes[boxes] @ placed.middles.take(balls, 2)[:, None] - self._box_offsets[boxes])
        over -= self._halves[boxes]
        inside = np.minimum(over.max(2), 0.0)
        np.maximum(over, 0.0, out=over)
        distances = np.sqrt(np.einsum("nbxp,nbxp->nbp", over, over))
        distances += inside
        distances -= self._fixed_sizes[side].take(boxes, 0).take(balls, 1)
        pairs = (self._begins[side] + boxes[:, None] * len(arm.radii) + balls).ravel()
        return NearPairs(pairs, distances.reshape(len(placed.parts), -1))

    def parts_of(self, pair: int) -> tuple[str, str]:
        """What the parts of a pair are called, e.g. ``right gripper`` and ``left forearm``, or ``table``."""
        right, left = self._arms.values()
        if pair < self._begins[Side.RIGHT]:
            first, second = divmod(pair, len(left.radii))
            return right.names[first], left.names[second]
        side = Side.RIGHT if pair < self._begins[Side.LEFT] else Side.LEFT
        box, ball = divmod(pair - self._begins[side], len(self._arms[side].radii))
        return self._arms[side].names[ball], self._fixed_names[box]

    def pairs_of(self, name: str, other: str) -> list[int]:
        """The numbers of all pairs of parts with these names, in either order.

        A name is that of a part (``right gripper``), of an arm (``right arm``) or of what stands still (``table``).
        """

        def fits(part: str, wanted: str) -> bool:
            return wanted in {part, f"{part.partition(' ')[0]} arm"}

        return [
            pair
            for pair, (a, b) in enumerate(map(self.parts_of, range(self.count)))
            if (fits(a, name) and fits(b, other)) or (fits(a, other) and fits(b, name))
        ]

    def gradient(self, side: Side, pair: int, placed: PlacedArm, posture: int, other: Array | None = None) -> Array:
        """How the distance of a pair changes with the joints of one arm [m/rad], (7,).

        Args:
            side: whose joints.
            pair: its number.
            placed: this arm.
            posture: in which posture.
            other: the middles of the other arm's balls in its own posture, (3, balls), where the pair is of both arms.
        """
        arm = self._arms[side]
        if pair < self._begins[Side.RIGHT]:
            assert other is not None
            balls = divmod(pair, len(self._arms[Side.LEFT].radii))
            ball, its = balls if side is Side.RIGHT else balls[::-1]
            middle = placed.middles[posture, :, ball]
            away = middle - other[:, its]
        else:
            box, ball = divmod(pair - self._begins[side], len(arm.radii))
            middle = placed.middles[posture, :, ball]
            local = self._to_boxes[box] @ middle - self._box_offsets[box, :, 0]
            over = np.abs(local) - self._halves[box, :, 0]
            # Inside of a box the nearest face counts.
            over = np.maximum(over, 0.0) if over.max() > 0.0 else np.where(over == over.max(), 1.0, 0.0)
            away = self._to_boxes[box].T @ (over * np.sign(local))
        away = away / max(float(np.linalg.norm(away)), _TOUCHING)
        frames = placed.frames[posture, :_LINKS]
        (ax, ay, az), (x, y, z) = frames[:, :3, 2].T, (middle - frames[:, :3, 3]).T
        nx, ny, nz = away
        moved = nx * (ay * z - az * y) + ny * (az * x - ax * z) + nz * (ax * y - ay * x)
        moved[int(arm.frames[ball]) + 1 :] = 0.0  # a joint moves what comes behind it
        return np.asarray(moved)


_TOUCHING = 1e-9  # [m]


class _ArmBalls:
    """One arm covered by balls, as arrays."""

    def __init__(self, arm: _ArmShapes) -> None:
        self._origins, self._tool0 = arm.origins, arm.tool0
        columns: list[list[Array]] = [[] for _ in range(_LINKS + 1)]
        places: list[tuple[int, int]] = []
        ends: list[tuple[int, int]] = []
        radii: list[float] = []
        frames, names, part_of = [], [], []
        for number, part in enumerate(arm.parts):
            start, end = np.array(part.start), np.array(part.end)
            length = float(np.linalg.norm(end - start))
            # Halfway between two balls of this radius their common circle is as wide as the capsule.
            steps = ceil(length / (2.0 * sqrt((part.radius + BALL_EXCESS) ** 2 - part.radius * part.radius)))
            ends.append((len(radii), len(radii) + steps))
            for step in range(steps + 1):
                places.append((part.frame, len(columns[part.frame])))
                columns[part.frame].append(start + (end - start) * (step / max(steps, 1)))
                radii.append(hypot(part.radius, 0.5 * length / max(steps, 1)))
                frames.append(part.frame)
                names.append(arm.names[number])
                part_of.append(number)
        self.radii, self.frames, self.names, self.part_of = np.array(radii), np.array(frames), names, np.array(part_of)
        self._firsts, self._lasts = (np.array(each) for each in zip(*ends, strict=True))
        ways = [float(np.linalg.norm(np.subtract(part.end, part.start))) for part in arm.parts]
        self.part_radii = self.radii[self._firsts] + 0.5 * np.array(ways)
        # By frame, as homogeneous columns, for one product of matrices; then one after the other.
        most = max(map(len, columns))
        self._points = np.zeros((_LINKS + 1, 4, most))
        self._points[:, 3] = 1.0
        for frame, points in enumerate(columns):
            for index, point in enumerate(points):
                self._points[frame, :3, index] = point
        self._places = np.array([frame * most + index for frame, index in places])

    def place(self, positions: Array) -> PlacedArm:
        """See :meth:`BallModel.place`."""
        count = len(positions)
        sine, cosine = np.sin(positions)[..., None], np.cos(positions)[..., None]
        along_x, along_y = self._origins[..., 0], self._origins[..., 1]
        turned = np.empty((count, _LINKS, 4, 4))
        turned[..., 0] = cosine * along_x + sine * along_y
        turned[..., 1] = cosine * along_y - sine * along_x
        turned[..., 2:] = self._origins[..., 2:]
        frames = np.empty((count, _LINKS + 1, 4, 4))
        frames[:, 0] = turned[:, 0]
        for index in range(1, _LINKS):
            np.matmul(frames[:, index - 1], turned[:, index], out=frames[:, index])
        np.matmul(frames[:, _LINKS - 1], self._tool0, out=frames[:, _LINKS])
        points = (frames[..., :3, :] @ self._points).swapaxes(1, 2).reshape(count, 3, -1)
        middles = points.take(self._places, 2)
        return PlacedArm(middles, 0.5 * (middles.take(self._firsts, 2) + middles.take(self._lasts, 2)), frames)


class _ArmShapes:
    """The parts of one arm as arrays."""

    def __init__(self, side: Side, parts: Sequence[Part], padding: float) -> None:
        self.names = [f"{side.word} {part.name}" for part in parts]
        self.parts = [replace(part, radius=part.radius + padding) for part in parts]
        self.frames = np.array([part.frame for part in parts])
        self.radii = np.array([part.radius + padding for part in parts])
        self._starts, self._ends = np.array([part.start for part in parts]), np.array([part.end for part in parts])
        (flange, offset), (turn, _) = _transform(FLANGE_ORIGIN), _transform(TOOL0_ORIGIN)
        places = [_transform(origin) for origin in (joint_1_origin(side), *JOINT_ORIGINS)]
        self._origins = [*places, (flange @ turn, offset)]
        self.origins, self.tool0 = (
            np.stack([_homogeneous(*each) for each in places]),
            _homogeneous(flange @ turn, offset),
        )

    def reach(self) -> Joints:
        """How far any part's axis is from each joint's axis, whatever the other joints do, at most [m]."""
        furthest = [0.0] * (_LINKS + 1)
        for part in self.parts:
            furthest[part.frame] = max(furthest[part.frame], hypot(*part.start), hypot(*part.end))
        reach = [0.0] * _LINKS
        behind = float(np.linalg.norm(self.tool0[:3, 3])) + furthest[_LINKS]
        for index in reversed(range(_LINKS)):
            behind = max(behind, furthest[index])
            reach[index] = behind
            behind += float(np.linalg.norm(self.origins[index, :3, 3]))
        return joints(reach)

    def placed(self, position: Joints) -> tuple[Array, Array]:
        """Both ends of the axis of each part in the body frame, (n, 3) each."""
        rotation, point = np.eye(3), np.zeros(3)
        rotations, points = np.empty((_LINKS + 1, 3, 3)), np.empty((_LINKS + 1, 3))
        for index, (turn, offset) in enumerate(self._origins):
            point = point + rotation @ offset
            rotation = rotation @ turn
            if index < _LINKS:
                sine, cosine = np.sin(position[index]), np.cos(position[index])
                rotation = rotation @ np.array([(cosine, -sine, 0.0), (sine, cosine, 0.0), (0.0, 0.0, 1.0)])
            rotations[index], points[index] = rotation, point
        at, turned = points[self.frames], rotations[self.frames]
        return at + np.einsum("nij,nj->ni", turned, self._starts), at + np.einsum("nij,nj->ni", turned, self._ends)


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


def box_distances(start: Array, end: Array, half: Array) -> Array:
    """Distances of segments from boxes about the origin, (n,); 0 where a segment passes through its box.

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
    return np.asarray(np.linalg.norm(outside(left + share * (right - left))[:, 0], axis=1))


def link_parts() -> tuple[Part, ...]:
    """The arm's links, the same on both arms."""
    parts = []
    for frame, shapes in enumerate(LINK_SHAPES):
        for shape in shapes:
            if isinstance(shape, Box):
                raise TypeError("a link's shape is a capsule or a cylinder")
            start, end = (
                (x / 1000.0, y / 1000.0, z / 1000.0) for x, y, z in (shape.start_mm, shape.end_mm)
            )  # a cylinder lies inside the capsule of its axis and radius
            parts.append(Part(LINK_NAMES[frame], frame, start, end, shape.radius_mm / 1000.0))
    return tuple(parts)


def _corners(shape: object) -> tuple[Vector, Vector]:
    if not isinstance(shape, Box):
        raise TypeError("the gripper's shapes are boxes")
    return shape.low_mm, shape.high_mm


def _middle_and_size(box: Box) -> tuple[Pose, Vector]:
    low, high = np.array(box.low_mm) / 1000.0, np.array(box.high_mm) / 1000.0
    x, y, z = ((low + high) / 2.0).tolist()
    width, depth, height = (high - low).tolist()
    return Pose((x, y, z), (1.0, 0.0, 0.0, 0.0)), (width, depth, height)


def _homogeneous(rotation: Array, offset: Array) -> Array:
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = rotation, offset
    return transform


def _transform(origin: Origin) -> tuple[Array, Array]:
    return matrix(quaternion_from_euler_zyx(origin.rpy)), np.array(origin.xyz)
