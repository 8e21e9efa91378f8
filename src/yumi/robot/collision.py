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
from math import ceil, hypot, inf, sqrt
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
from yumi.robot.joints import Joints, Pose, Side, Vector
from yumi.robot.kinematics import matrix, quaternion_from_euler_zyx

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

PADDING = 0.004
"""Added to every radius: cables, labels, and castings that differ from the meshes [m]."""

_ROUND_END = 0.002  # [m]
_LINKS = 7
TOOL_FRAME = _LINKS
"""Index of tool0's frame, behind those of the links."""


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
    # Capsules side by side, a little thicker than circles that cover the cross-section, so that their
    # round ends cover its corners from further inside.
    columns, rows = (-0.75, -0.25, 0.25, 0.75), (-2.0 / 3.0, 0.0, 2.0 / 3.0)
    corner = hypot(half_x / len(columns), half_y / len(rows))
    radius = corner + _ROUND_END
    inset = sqrt(radius * radius - corner * corner)
    parts = [
        Part("gripper", TOOL_FRAME, (x * half_x, y * half_y, inset), (x * half_x, y * half_y, height - inset), radius)
        for x in columns
        for y in rows
    ]
    (finger,) = FINGER_SHAPES
    (low_x, low_y, low_z), (_, high_y, high_z) = ([value / 1000.0 for value in corner] for corner in _corners(finger))
    # Both fingers, wherever they are: side by side along x, one above the other along z.
    origin, slices = FINGER_ORIGINS[0].xyz, 3
    reach, step = FINGER_TRAVEL - low_x, (high_z - low_z) / slices
    half_y = max(abs(low_y + origin[1]), abs(high_y + origin[1]))
    for index in range(slices):
        z = origin[2] + low_z + (index + 0.5) * step
        parts.append(Part("fingers", TOOL_FRAME, (-reach, 0.0, z), (reach, 0.0, z), hypot(half_y, step / 2.0)))
    if modules.has_camera:
        parts.append(Part("camera", TOOL_FRAME, (-0.0073, 0.0, 0.0351), (-0.0073, 0.0283, 0.0351), 0.015))
    for channel, side in zip(modules.vacuum_channels, (1.0, -1.0), strict=False):
        parts.append(Part(f"cup {channel}", TOOL_FRAME, (0.0, 0.0185, 0.0375), (side * 0.0635, 0.0185, 0.0375), 0.012))
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
            distances.append(box_distances(start, end, self._halves[box])[0] - arm.radii[part])
            names += [(arm.names[i], self._fixed_names[j]) for i, j in zip(part.tolist(), box.tolist(), strict=True)]
        together = np.concatenate(distances)
        order = np.argsort(together, kind="stable")[:count]
        return tuple(Distance(float(together[index]), *names[index]) for index in order)


BALL_EXCESS = 0.0015
"""A row of balls that covers a capsule is at most so much thicker than it [m]."""


class SweptArm(NamedTuple):
    """An arm on its way along lines in joint space: each ball sweeps a capsule that contains where it comes.

    Attributes:
        postures: that the lines lead from and to, (n, 7) [rad].
        frames: of the links and of tool0 in those, in the body frame, (n, 8, 4, 4).
        starts: the postures that the lines begin with, (lines,).
        ends: those that they end with, (lines,).
        excess: by how much the balls of a part may be off their straight lines, (parts, lines) [m].
        part_middles: of the lines of balls round whole parts, (3, parts, lines) [m].
        part_sizes: from there to the surface of anything of the part, at most, (parts, lines) [m].
    """

    postures: Array
    frames: Array
    starts: Indices
    ends: Indices
    excess: Array
    part_middles: Array
    part_sizes: Array


class Nearest(NamedTuple):
    """How near pairs of parts come to each other on their ways.

    Attributes:
        distances: no part of the pair comes nearer than this [m], (pairs,); below zero where they may overlap.
        bounds: the same of the balls that were compared, (n,) [m].
        pairs: whose balls they are, ascending, (n,).
        lines: of the arm's way and of the other one's, (n,) each.
        balls: of both, (n,) each; the second is the box where the other one stands still.
        shares: how far along their lines they are, (n,) each, 0 to 1.
    """

    distances: Array
    bounds: Array
    pairs: Indices
    lines: tuple[Indices, Indices]
    balls: tuple[Indices, Indices]
    shares: tuple[Array, Array]

    def least(self, pair: int) -> int | None:
        """Which of the balls that were compared are nearest; None where none of the pair were."""
        begin, end = np.searchsorted(self.pairs, (pair, pair + 1)).tolist()
        return begin + int(self.bounds[begin:end].argmin()) if begin < end else None


_NONE: Indices = np.empty(0, dtype=np.intp)
_NOWHERE: Array = np.empty(0)


def _found(
    gaps: Array,
    bounds: Array,
    pairs: Indices,
    lines: tuple[Indices, Indices],
    balls: tuple[Indices, Indices],
    shares: tuple[Array, Array],
) -> Nearest:
    """Of balls compared the least distance of each pair; ``gaps`` are those on the lines that were left out."""
    begins = np.concatenate((_FIRST, np.flatnonzero(pairs[1:] != pairs[:-1]) + 1))
    its = pairs[begins]
    gaps[its] = np.minimum(gaps[its], np.minimum.reduceat(bounds, begins))
    return Nearest(gaps, bounds, pairs, lines, balls, shares)


_FIRST: Indices = np.zeros(1, dtype=np.intp)


class BallModel:
    """The shapes of a :class:`CollisionModel` covered by balls: a little larger, and quick for many ways at once.

    Args:
        model: the shapes.

    Attributes:
        arms: the balls of each arm.
        boxes: the names of what stands still.
    """

    def __init__(self, model: CollisionModel) -> None:
        self.arms = {side: ArmBalls(arm) for side, arm in model.arms.items()}
        self.boxes = [obstacle.name for obstacle in model.fixed]
        self._to_boxes = np.array([matrix(obstacle.centre.orientation).T for obstacle in model.fixed])
        centres = np.array([obstacle.centre.position for obstacle in model.fixed])
        self._box_offsets = (self._to_boxes @ centres[..., None])[..., 0]  # (boxes, 3)
        self._halves = np.array([obstacle.size for obstacle in model.fixed]) / 2.0
        # The balls of each two parts, each ball of one with each of the other; each ball of a part with itself.
        self._pairs = {
            side: [
                [[each.ravel() for each in np.meshgrid(a, b, indexing="ij")] for b in self.arms[side.other].balls]
                for a in arm.balls
            ]
            for side, arm in self.arms.items()
        }

    def between(
        self, side: Side, way: SweptArm, other: SweptArm, pairs: tuple[Indices, Indices], within: Array
    ) -> Nearest:
        """How near parts of an arm come to parts of the other one, whichever is quicker.

        Args:
            side: which arm.
            way: where it moves.
            other: where the other one moves.
            pairs: the numbers of its parts and of the other one's, (n,) each.
            within: distances below this are exact for the balls' lines, others lower bounds, (n,) [m].
        """
        mine, its = self.arms[side], self.arms[side.other]
        rows, columns = pairs
        # Larger balls round whole parts first.
        apart = way.part_middles.take(rows, 1)[..., None] - other.part_middles.take(columns, 1)[:, :, None]
        gaps = np.sqrt(np.einsum("xnab,xnab->nab", apart, apart))
        gaps -= way.part_sizes.take(rows, 0)[:, :, None] + other.part_sizes.take(columns, 0)[:, None]
        is_near = gaps < within[:, None, None]
        pair, first, second = np.nonzero(is_near)
        if not len(pair):
            return Nearest(gaps.min((1, 2)), _NOWHERE, _NONE, (_NONE, _NONE), (_NONE, _NONE), (_NOWHERE, _NOWHERE))
        gaps[is_near] = inf
        # Then all balls of parts that may be near, on lines of which they may be.
        tables = self._pairs[side]
        balls = [tables[row][column] for row, column in zip(rows[pair].tolist(), columns[pair].tolist(), strict=True)]
        counts = np.array([len(each[0]) for each in balls])
        a, b = np.concatenate([each[0] for each in balls]), np.concatenate([each[1] for each in balls])
        pair, first, second = (np.repeat(each, counts) for each in (pair, first, second))
        (a_middles, a_halves), (b_middles, b_halves) = mine.lines(way, a, first), its.lines(other, b, second)
        radii = mine.radii.take(a) + its.radii.take(b)
        radii += way.excess[rows[pair], first] + other.excess[columns[pair], second]
        apart = a_middles - b_middles
        bounds = np.sqrt(np.einsum("nx,nx->n", apart, apart)) - radii
        bounds -= np.sqrt(np.einsum("nx,nx->n", a_halves, a_halves)) + np.sqrt(
            np.einsum("nx,nx->n", b_halves, b_halves)
        )
        near = np.flatnonzero(bounds < within.take(pair))
        shares = np.full((2, len(bounds)), 0.5)
        if len(near):
            exact, *shares[:, near] = _line_distances(apart[near], a_halves[near], b_halves[near])
            bounds[near] = exact - radii[near]
        return _found(gaps.min((1, 2)), bounds, pair, (first, second), (a, b), (shares[0], shares[1]))

    def from_fixed(self, side: Side, way: SweptArm, pairs: tuple[Indices, Indices], within: Array) -> Nearest:
        """How near parts of an arm come to boxes; arguments as for :meth:`between`."""
        mine = self.arms[side]
        rows, boxes = pairs
        turn, offset, half = self._to_boxes[boxes], self._box_offsets[boxes], self._halves[boxes]
        over = np.abs(np.einsum("nij,jnl->nli", turn, way.part_middles.take(rows, 1)) - offset[:, None])
        over = np.maximum(over - half[:, None], 0.0)
        gaps = np.sqrt(np.einsum("nlx,nlx->nl", over, over)) - way.part_sizes.take(rows, 0)
        is_near = gaps < within[:, None]
        pair, first = np.nonzero(is_near)
        if not len(pair):
            return Nearest(gaps.min(1), _NOWHERE, _NONE, (_NONE, _NONE), (_NONE, _NONE), (_NOWHERE, _NOWHERE))
        gaps[is_near] = inf
        balls = [mine.balls[row] for row in rows[pair].tolist()]
        counts = np.array([len(each) for each in balls])
        a = np.concatenate(balls)
        pair, first = np.repeat(pair, counts), np.repeat(first, counts)
        turns, offsets, box_halves = turn[pair], offset[pair], half[pair]
        middles, halves = mine.lines(way, a, first)
        middles = np.einsum("nij,nj->ni", turns, middles) - offsets
        halves = np.einsum("nij,nj->ni", turns, halves)
        lengths, radii = (
            np.sqrt(np.einsum("nx,nx->n", halves, halves)),
            mine.radii.take(a) + way.excess[rows[pair], first],
        )
        over = np.abs(middles) - box_halves
        bounds = np.minimum(over.max(1), 0.0) - radii - lengths
        np.maximum(over, 0.0, out=over)
        bounds += np.sqrt(np.einsum("nx,nx->n", over, over))
        shares = np.full(len(bounds), 0.5)
        near = np.flatnonzero((bounds < within.take(pair)) & (lengths > _SHORT))
        if len(near):  # a shorter line is as near as its middle
            middle, along = middles[near], halves[near]
            exact, shares[near] = box_distances(middle - along, middle + along, box_halves[near])
            bounds[near] = np.where(exact > 0.0, exact - radii[near], bounds[near])
        return _found(gaps.min(1), bounds, pair, (first, first), (a, boxes[pair]), (shares, shares))

    def gradient(self, side: Side, way: SweptArm, posture: int, ball: int, other: Array | int) -> Array:
        """How the distance of a ball changes with the joints of its arm [m/rad], (7,).

        Args:
            side: which arm.
            way: where it moves.
            posture: in which of its postures.
            ball: its number.
            other: the middle of the other arm's ball, (3,) [m], or the number of a box.
        """
        middle = self.arms[side].middle(way, posture, ball)
        if isinstance(other, int):
            local = self._to_boxes[other] @ middle - self._box_offsets[other]
            over = np.abs(local) - self._halves[other]
            # Inside of a box the nearest face counts.
            over = np.maximum(over, 0.0) if over.max() > 0.0 else np.where(over == over.max(), 1.0, 0.0)
            away = self._to_boxes[other].T @ (over * np.sign(local))
        else:
            away = middle - other
        nx, ny, nz = (away / max(float(np.linalg.norm(away)), _TOUCHING)).tolist()
        frames = way.frames[posture, :_LINKS]
        (ax, ay, az), (x, y, z) = frames[:, :3, 2].T, (middle - frames[:, :3, 3]).T
        moved = nx * (ay * z - az * y) + ny * (az * x - ax * z) + nz * (ax * y - ay * x)
        moved[int(self.arms[side].frames[ball]) + 1 :] = 0.0  # a joint moves what comes behind it
        return np.asarray(moved)


_TOUCHING = 1e-9  # [m]
_SHORT = 5e-5  # [m]


def _line_distances(apart: Array, half: Array, other_half: Array) -> tuple[Array, Array, Array]:
    """Distances of lines given by where their middles are from each other and by their halves, (n, 3) each [m].

    As :func:`segment_distances`; also how far along both lines they are nearest, 0 to 1.
    """
    a, b = np.einsum("nx,nx->n", half, half), np.einsum("nx,nx->n", other_half, other_half)
    dot = np.einsum("nx,nx->n", half, other_half)
    offset, other_offset = np.einsum("nx,nx->n", half, apart), np.einsum("nx,nx->n", other_half, apart)
    denominator = a * b - dot * dot
    denominator[denominator < 1e-12 * a * b + 1e-24] = inf  # parallel: begin in the middle
    a, b = np.maximum(a, _POINT), np.maximum(b, _POINT)
    # Parameters from -1 to 1.
    first = np.minimum(np.maximum((dot * other_offset - offset * b) / denominator, -1.0), 1.0)
    second = np.minimum(np.maximum((dot * first + other_offset) / b, -1.0), 1.0)
    first = np.minimum(np.maximum((dot * second - offset) / a, -1.0), 1.0)
    between = apart + first[:, None] * half - second[:, None] * other_half
    return np.sqrt(np.einsum("nx,nx->n", between, between)), 0.5 * (first + 1.0), 0.5 * (second + 1.0)


_POINT = 1e-18  # [m²] a line so short is a point


class ArmBalls:
    """One arm covered by balls, as arrays.

    Attributes:
        names: of the parts; a link consists of several.
        part_of: which part a ball belongs to, (balls,), ascending.
        balls: of each part.
        radii: of the balls, (balls,) [m].
        frames: whose balls they are: of a link from 0, or 7 for tool0, (balls,).
        part_radii, part_frames: the same of larger balls round whole parts, (parts,).
        reach: by how much a radian of each joint moves anything of a part, at most, (parts, 7) [m/rad].
    """

    def __init__(self, arm: _ArmShapes) -> None:
        self._origins, self._tool0 = arm.origins, arm.tool0
        shapes: list[list[tuple[Array, float]]] = []
        for part in arm.parts:
            start, end = np.array(part.start), np.array(part.end)
            length = float(np.linalg.norm(end - start))
            # Halfway between two balls of this radius their common circle is as wide as the capsule.
            steps = ceil(length / (2.0 * sqrt((part.radius + BALL_EXCESS) ** 2 - part.radius * part.radius)))
            radius = hypot(part.radius, 0.5 * length / max(steps, 1))
            shapes.append([(start + (end - start) * (step / max(steps, 1)), radius) for step in range(steps + 1)])
        self.names = arm.names
        self.part_of = np.repeat(np.arange(len(shapes)), [len(balls) for balls in shapes])
        self.balls = [np.flatnonzero(self.part_of == part) for part in range(len(shapes))]
        self.part_frames = arm.frames
        self.frames = self.part_frames[self.part_of]
        self.radii = np.array([radius for balls in shapes for _, radius in balls])
        middles, part_radii, reaches = [], [], []
        for frame, balls in zip(arm.frames.tolist(), shapes, strict=True):
            points = np.array([point for point, _ in balls])
            middle = 0.5 * (points.min(0) + points.max(0))
            middles.append(middle)
            part_radii.append(max(float(np.linalg.norm(point - middle)) + radius for point, radius in balls))
            reach, behind = [0.0] * _LINKS, float(np.linalg.norm(points, axis=1).max())
            if frame == TOOL_FRAME:
                behind += float(np.linalg.norm(self._tool0[:3, 3]))
            for index in reversed(range(min(frame, _LINKS - 1) + 1)):
                reach[index] = behind
                behind += float(np.linalg.norm(self._origins[index, :3, 3]))
            reaches.append(reach)
        self.part_radii, self.reach = np.array(part_radii), np.array(reaches)
        self._points = np.array([[*point, 1.0] for balls in shapes for point, _ in balls])
        # The middles of the parts in their own frames, elsewhere zero, for one product with all frames.
        self._part_points = np.zeros((_LINKS + 1, 4, len(shapes)))
        for index, (frame, middle) in enumerate(zip(arm.frames.tolist(), middles, strict=True)):
            self._part_points[frame, :, index] = *middle, 1.0

    def sweep(self, positions: Array, starts: Indices, ends: Indices, off: Array) -> SweptArm:
        """Where the balls come on lines in joint space.

        Args:
            positions: postures, (n, 7) [rad].
            starts: those that the lines begin with, (lines,).
            ends: those that they end with, (lines,).
            off: by how much each joint may be off its line, (lines, 7) [rad].
        """
        frames = self._place(positions)
        # A ball is off the straight line between its places by an eighth of its curve's second derivative, and a
        # radian of two joints bends it by no more than its reach from the outer one.
        ways = np.abs(positions[ends] - positions[starts])
        bends = 0.125 * ways * (2.0 * np.cumsum(ways, 1) - ways)
        excess = self.reach @ (bends + off).T
        points = np.einsum("nfij,fjp->ipn", frames[:, :, :3], self._part_points)
        begin, end = points.take(starts, 2), points.take(ends, 2)
        halves = 0.5 * (end - begin)
        sizes = np.sqrt(np.einsum("xpa,xpa->pa", halves, halves)) + excess + self.part_radii[:, None]
        return SweptArm(positions, frames, starts, ends, excess, 0.5 * (begin + end), sizes)

    def middle(self, way: SweptArm, posture: int, ball: int) -> Array:
        """Where the middle of a ball is in one of the postures, (3,) [m]."""
        return np.asarray(way.frames[posture, self.frames[ball], :3] @ self._points[ball])

    def lines(self, way: SweptArm, balls: Indices, lines: Indices) -> tuple[Array, Array]:
        """The middles of the lines on which balls move, and from there to their ends, (n, 3) each [m]."""
        frames, points = self.frames.take(balls), self._points.take(balls, 0)
        begin, end = (
            np.einsum("nij,nj->ni", way.frames[at.take(lines), frames, :3], points) for at in (way.starts, way.ends)
        )
        return 0.5 * (begin + end), 0.5 * (end - begin)

    def _place(self, positions: Array) -> Array:
        """The frames of the links and of tool0 in a number of postures, (n, 8, 4, 4)."""
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
        return frames


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
