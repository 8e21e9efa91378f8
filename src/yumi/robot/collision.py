"""Distances between the arms, their grippers, the body and what stands around the robot.

Each moving part is covered by capsules (segments with a radius), the body and everything that stands still by boxes.
The shapes contain those of the robot's description (:mod:`yumi.robot.description`), which are fitted to public meshes
of the robot's covers; `PADDING` leaves room for cables and the tolerances of castings. This is no safety function: a
person in the way, or a part that was not declared, is not seen.

Positions are in the body frame [m], joints in chain order [rad].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import hypot

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
from yumi.robot.joints import Joints, Pose, Side, Vector
from yumi.robot.kinematics import matrix, quaternion_from_euler_zyx

Array = NDArray[np.float64]

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
    # Two capsules side by side: circles of this radius about ±half_x/2 cover the box's cross-section.
    radius = hypot(half_x / 2.0, half_y)
    parts = [Part("gripper", _GRIPPER, (x, 0.0, 0.0), (x, 0.0, height), radius) for x in (-half_x / 2.0, half_x / 2.0)]
    (finger,) = FINGER_SHAPES
    (low_x, low_y, low_z), (_, high_y, high_z) = ([value / 1000.0 for value in corner] for corner in _corners(finger))
    middle_y, middle_z = (
        (low_y + high_y) / 2.0 + FINGER_ORIGINS[0].xyz[1],
        (low_z + high_z) / 2.0 + FINGER_ORIGINS[0].xyz[2],
    )
    reach = FINGER_TRAVEL - low_x
    across = hypot((high_y - low_y) / 2.0, (high_z - low_z) / 2.0) + abs(middle_y)
    parts.append(Part("fingers", _GRIPPER, (-reach, 0.0, middle_z), (reach, 0.0, middle_z), across))
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
        self._arms = {
            side: _ArmShapes(
                side, (*link_parts(), *gripper_parts(grippers[side]), *(tools or {}).get(side, ())), padding
            )
            for side in Side
        }
        fixed = [Obstacle("body", *_middle_and_size(box)) for box in BODY_SHAPES] + list(obstacles)
        self._fixed_names = [obstacle.name for obstacle in fixed]
        self._rotations = np.array([matrix(obstacle.centre.orientation) for obstacle in fixed])
        self._centres = np.array([obstacle.centre.position for obstacle in fixed])
        self._halves = np.array([obstacle.size for obstacle in fixed]) / 2.0
        right, left = (self._arms[side] for side in Side)
        first, second = (index.ravel() for index in np.indices((len(right.names), len(left.names))))
        # The shoulders are bolted to one body, next to each other.
        keep = (right.frames[first] > 0) | (left.frames[second] > 0)
        self._pairs = first[keep], second[keep]
        self._with_fixed = {}
        for side, arm in self._arms.items():
            part, box = (index.ravel() for index in np.indices((len(arm.names), len(fixed))))
            keep = (arm.frames[part] > 0) | (np.array(self._fixed_names)[box] != "body")
            self._with_fixed[side] = part[keep], box[keep]

    def nearest(self, positions: Mapping[Side, Joints], count: int = 1) -> tuple[Distance, ...]:
        """The nearest pairs of parts, nearest first: arm to arm, and arm to body and obstacles.

        Args:
            positions: of both arms [rad].
            count: how many pairs.
        """
        ends = {side: arm.placed(positions[side]) for side, arm in self._arms.items()}
        right, left = (self._arms[side] for side in Side)
        first, second = self._pairs
        (r_start, r_end), (l_start, l_end) = (ends[side] for side in Side)
        distances = [segment_distances(r_start[first], r_end[first], l_start[second], l_end[second])]
        distances[0] -= right.radii[first] + left.radii[second]
        names = [(right.names[i], left.names[j]) for i, j in zip(first.tolist(), second.tolist(), strict=True)]
        for side, arm in self._arms.items():
            part, box = self._with_fixed[side]
            start, end = (
                np.einsum("nji,nj->ni", self._rotations[box], each[part] - self._centres[box]) for each in ends[side]
            )
            distances.append(box_distances(start, end, self._halves[box]) - arm.radii[part])
            names += [(arm.names[i], self._fixed_names[j]) for i, j in zip(part.tolist(), box.tolist(), strict=True)]
        together = np.concatenate(distances)
        order = np.argsort(together, kind="stable")[:count]
        return tuple(Distance(float(together[index]), *names[index]) for index in order)


class _ArmShapes:
    """The parts of one arm as arrays."""

    def __init__(self, side: Side, parts: Sequence[Part], padding: float) -> None:
        self.names = [f"{side.word} {part.name}" for part in parts]
        self.frames = np.array([part.frame for part in parts])
        self.radii = np.array([part.radius + padding for part in parts])
        self._starts, self._ends = np.array([part.start for part in parts]), np.array([part.end for part in parts])
        (flange, offset), (turn, _) = _transform(FLANGE_ORIGIN), _transform(TOOL0_ORIGIN)
        joints = [_transform(origin) for origin in (joint_1_origin(side), *JOINT_ORIGINS)]
        self._origins = [*joints, (flange @ turn, offset)]

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


def _transform(origin: Origin) -> tuple[Array, Array]:
    return matrix(quaternion_from_euler_zyx(origin.rpy)), np.array(origin.xyz)
