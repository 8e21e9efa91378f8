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
from itertools import pairwise
from math import hypot, sqrt
from typing import Any, NamedTuple

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
    joint_1_origin,
)
from yumi.robot.gripper import GripperModules
from yumi.robot.joints import Joints, Pose, Side, Vector
from yumi.robot.kinematics import quaternion_from_euler_zyx

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
        start: where ``part`` is nearest to the other one, in the body frame [m].
        end: where ``other`` is.
    """

    distance: float
    part: str
    other: str
    start: Vector
    end: Vector


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


FAR = 10.0
"""Nothing of the robot is further away [m]."""

_MEMORY = 1 << 24  # [bytes] for the contacts of all pairs
_FIXED = 4  # bit of what stands still; those of the arms are 1 and 2
_OTHERS = 7  # of all of them


class Query(NamedTuple):
    """Which distances to calculate.

    Attributes:
        positions: of both arms, right, left [rad], (14,).
        within: pairs further apart than this are left out [m].
        alone: the arm whose parts are compared with what stands still; None: both arms with each other.
    """

    positions: Array
    within: float
    alone: Side | None = None


class Contacts(NamedTuple):
    """Parts that are near each other in some postures of both arms.

    Attributes:
        distances: between their padded surfaces; below zero where they overlap [m], (n,).
        parts: the numbers of both parts of each pair, as in :attr:`CollisionModel.names`, (n, 2).
        queries: the number of the query that found each pair, (n,).
        normals: from the first part to the second along the line of nearest distance, (n, 3).
        points: the middle of that line [m], (n, 3).
        shapes: rows of ``centres`` and ``halves`` that belong to the parts, (n, 2).
        centres: of all shapes of all queries [m], (m, 3).
        halves: from there to the end of each capsule [m], (m, 3).
        arms: the rows of ``screws`` of the right and the left arm in each query, (queries, 2).
        screws: of the joints of all arms of all queries: their axes and the moments of these [m], (k, 6, 7).
    """

    distances: Array
    parts: Indices
    queries: Indices
    normals: Array
    points: Array
    shapes: Indices
    centres: Array
    halves: Array
    arms: Indices
    screws: Array


_NOTHING, _NO_ROWS = np.zeros(0), np.zeros((0, 2), dtype=np.intp)
_NONE = Contacts(
    _NOTHING, _NO_ROWS, _NO_ROWS[:, 0], _NOTHING, _NOTHING, _NO_ROWS, _NOTHING, _NOTHING, _NO_ROWS, _NOTHING
)


class CollisionModel:
    """The shapes of one robot with its grippers, tools and surroundings, whose distances MuJoCo calculates.

    A distance is exact as long as the axis of a capsule does not enter a box. Not for several threads at once.

    Args:
        grippers: the modules of each arm's gripper.
        tools: more parts of an arm: fingers of one's own, a tool, an object it holds.
        obstacles: what stands around the robot.
        padding: added to every radius [m].

    Attributes:
        names: of all parts, those of the right arm first, then the left arm's, then what stands still.
        arms: the parts of each arm.
        frames: the link that a part moves with, from 0 in chain order, or 7 for tool0; -1 for what stands still.
        reach: by how much a radian of each joint moves the axis of a part, at most, (parts, 14) [m/rad].
    """

    def __init__(
        self,
        grippers: Mapping[Side, GripperModules],
        *,
        tools: Mapping[Side, Sequence[Part]] | None = None,
        obstacles: Sequence[Obstacle] = (),
        padding: float = PADDING,
    ) -> None:
        self.names: list[str] = []
        self.arms: dict[Side, slice] = {}
        frames: list[int] = []
        reaches: list[Array] = []
        parts: dict[Side, tuple[Part, ...]] = {}
        for index, side in enumerate(Side):
            own = parts[side] = (*link_parts(), *gripper_parts(grippers[side]), *(tools or {}).get(side, ()))
            self.arms[side] = slice(len(self.names), len(self.names) + len(own))
            self.names += [f"{side.word} {part.name}" for part in own]
            frames += [part.frame for part in own]
            for part in own:
                reach = np.zeros(2 * _LINKS)
                reach[index * _LINKS : (index + 1) * _LINKS] = _reach(part, side)
                reaches.append(reach)
        fixed = [Obstacle("body", *_middle_and_size(box)) for box in BODY_SHAPES] + list(obstacles)
        self.names += [box.name for box in fixed]
        self.frames = np.array(frames + [-1] * len(fixed))
        self.reach = np.vstack([*reaches, np.zeros((len(fixed), 2 * _LINKS))])
        self._is_of = {side: np.zeros(len(self.names), dtype=bool) for side in Side}
        for side, numbers in self.arms.items():
            self._is_of[side][numbers] = True
        self._is_moved = np.arange(_LINKS) <= self.frames[:, None]  # a joint moves what comes behind it
        capsules = [
            (side, number, part, part.radius + padding)
            for side in Side
            for number, part in enumerate(parts[side], self.arms[side].start)
        ]
        boxes = list(enumerate(fixed, len(capsules)))
        alone = {side: [each for each in capsules if each[0] is side] for side in Side}
        self._scenes: dict[Side | None, _Scene] = {None: _Scene(capsules, ())}
        self._scenes |= {side: _Scene(own, boxes) for side, own in alone.items()}

    def contacts(self, *queries: Query) -> Contacts:
        """The pairs of parts that are near each other in some postures, query by query."""
        found: list[tuple[Array, ...]] = []
        numbers: list[int] = []
        arms = np.zeros((len(queries), len(Side)), dtype=np.intp)
        shapes_before, arms_before = [], 0
        shape_count = 0
        for number, query in enumerate(queries):
            each = self._scenes[query.alone].contacts(query)
            if each is not None:
                is_both = query.alone is None
                arms[number] = arms_before, arms_before + is_both
                shapes_before.append(shape_count)
                found.append(each)
                numbers.append(number)
                arms_before, shape_count = arms_before + 1 + is_both, shape_count + len(each[5])
        if not found:
            return _NONE
        distances, parts, normals, points, shapes, centres, halves, axes, anchors = (
            np.concatenate(each) for each in zip(*found, strict=True)
        )
        counts = [len(each[0]) for each in found]
        screws = np.concatenate((axes, _cross(anchors, axes)), 1).reshape(-1, _LINKS, 6).transpose(0, 2, 1)
        shapes = shapes + np.repeat(shapes_before, counts)[:, None]
        queried = np.repeat(numbers, counts)
        return Contacts(distances, parts, queried, normals, points, shapes, centres, halves, arms, screws)

    def slopes(self, near: Contacts, contacts: Indices, which: Indices) -> tuple[Array, Array]:
        """How both ends of parts of an arm move along the lines of nearest distance, towards the other parts.

        Args:
            near: what :meth:`contacts` found.
            contacts: numbers of some of that, (n,).
            which: of their parts, 0 or 1; one of an arm, (n,).

        Returns:
            How much further back than the foremost end each end is [m], (n, 2), and by how much a radian of each joint
            moves it forward [m/rad], (n, 2, 7).
        """
        parts, shapes = near.parts[contacts, which], near.shapes[contacts, which]
        normals = (near.normals[contacts] * (1.0 - 2.0 * which)[:, None])[:, None]
        centres, halves = near.centres[shapes], near.halves[shapes]
        ends = np.concatenate((centres + halves, centres - halves), 1).reshape(-1, 2, 3)
        arms = near.arms[near.queries[contacts], (parts >= self.arms[Side.LEFT].start).astype(np.intp)]
        # How fast a joint moves a point along a line is the product of the joint's screw and the line's.
        lines = np.empty((len(parts), 2, 6))
        lines[:, :, :3], lines[:, :, 3:] = _cross(ends, normals), normals
        slopes = lines @ near.screws[arms]
        slopes *= self._is_moved[parts][:, None]
        forward = (ends * normals).sum(2)
        return forward.max(1)[:, None] - forward, slopes

    def nearest(
        self, positions: Mapping[Side, Joints], count: int = 1, *, within: float = FAR, ignore: str = ""
    ) -> tuple[Distance, ...]:
        """The nearest pairs of parts, nearest first: arm to arm, and arm to body and obstacles.

        Args:
            positions: of both arms [rad].
            count: how many pairs.
            within: how near they are [m].
            ignore: the name of what stands still and does not count.
        """
        both = np.array([*positions[Side.RIGHT], *positions[Side.LEFT]])
        found = self.contacts(*(Query(both, within, alone) for alone in self._scenes))
        nearest: dict[tuple[int, int], Distance] = {}
        for index, (distance, (first, second)) in enumerate(
            zip(found.distances.tolist(), found.parts.tolist(), strict=True)
        ):
            turned = first > second  # the right arm's part first, what stands still last
            pair = (second, first) if turned else (first, second)
            part, other = (self.names[number] for number in pair)
            if other == ignore or (pair in nearest and nearest[pair].distance <= distance):
                continue
            half = found.normals[index] * (-0.5 if turned else 0.5) * distance
            (ax, ay, az), (bx, by, bz) = (found.points[index] - half).tolist(), (found.points[index] + half).tolist()
            nearest[pair] = Distance(distance, part, other, (ax, ay, az), (bx, by, bz))
        return tuple(sorted(nearest.values(), key=lambda each: each.distance)[:count])


def _joints_of(side: Side) -> slice:
    return slice(0, _LINKS) if side is Side.RIGHT else slice(_LINKS, 2 * _LINKS)


def _cross(first: Array, second: Array) -> Array:
    """Cross products of the last axes; numpy's own takes several times as long for few of them."""
    ax, ay, az, bx, by, bz = (each[..., axis] for each in (first, second) for axis in range(3))
    x = ay * bz - az * by
    product = np.empty((*x.shape, 3))
    product[..., 0], product[..., 1], product[..., 2] = x, az * bx - ax * bz, ax * by - ay * bx
    return product


class _Scene:
    """What MuJoCo compares: the arms' capsules with each other, or those of one arm with boxes.

    Attributes:
        model, data: MuJoCo's.
        numbers: of the parts, in MuJoCo's order.
    """

    def __init__(
        self, capsules: Sequence[tuple[Side, int, Part, float]], boxes: Sequence[tuple[int, Obstacle]]
    ) -> None:
        import mujoco  # noqa: PLC0415 - 0.2 s that commands which only name shapes need not wait for

        self._mujoco = mujoco
        spec = mujoco.MjSpec()
        spec.memory = _MEMORY
        # The margin of all pairs is that of one call; see contacts().
        spec.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_OVERRIDE)
        sides = list(dict.fromkeys(side for side, *_ in capsules))
        bodies = {side: _chain(spec, side) for side in sides}
        for side, number, part, radius in capsules:
            bodies[side][part.frame].add_geom(
                name=str(number),
                type=mujoco.mjtGeom.mjGEOM_CAPSULE,
                fromto=(*part.start, *part.end) if part.start != part.end else (*part.start, *_above(part.end)),
                size=(radius, 0.0, 0.0),
                contype=1 << sides.index(side),
                conaffinity=_OTHERS & ~(1 << sides.index(side)),
            )
        body = spec.worldbody.add_body(name="body")
        for number, box in boxes:
            (body if box.name == "body" else spec.worldbody).add_geom(
                name=str(number),
                type=mujoco.mjtGeom.mjGEOM_BOX,
                pos=box.centre.position,
                quat=box.centre.orientation,
                size=[edge / 2.0 for edge in box.size],
                contype=_FIXED,
                conaffinity=_OTHERS & ~_FIXED,
            )
        # The shoulders are bolted to one body, next to each other.
        for one, other in pairwise([*(f"{side.word} 0" for side in sides), "body"]):
            spec.add_exclude(bodyname1=one, bodyname2=other)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        # MuJoCo sorts its shapes by the bodies that they belong to.
        self.numbers = np.array([int(self.model.geom(index).name) for index in range(self.model.ngeom)])
        self._lengths = self.model.geom_size[:, 1:2].copy()

    def contacts(self, query: Query) -> tuple[Array, ...] | None:
        """Most fields of :class:`Contacts` of one query, and axes and anchors of the joints; None without contacts."""
        model, data = self.model, self.data
        data.qpos[:] = query.positions if query.alone is None else query.positions[_joints_of(query.alone)]
        model.opt.o_margin = query.within
        self._mujoco.mj_kinematics(model, data)
        self._mujoco.mj_collision(model, data)
        if not data.ncon:
            return None
        found = data.contact
        shapes = found.geom
        return (
            found.dist.copy(),
            self.numbers[shapes],
            found.frame[:, :3].copy(),
            found.pos.copy(),
            shapes.copy(),
            data.geom_xpos.copy(),
            data.geom_xmat[:, 2::3] * self._lengths,
            data.xaxis.copy(),
            data.xanchor.copy(),
        )


def _chain(spec: Any, side: Side) -> list[Any]:
    """Adds the links of an arm and its tool0, in this order."""
    bodies, parent = [], spec.worldbody
    for index, origin in enumerate((joint_1_origin(side), *JOINT_ORIGINS)):
        parent = parent.add_body(
            name=f"{side.word} {index}", pos=origin.xyz, quat=quaternion_from_euler_zyx(origin.rpy)
        )
        parent.add_joint(axis=(0.0, 0.0, 1.0))
        parent.mass, parent.inertia = 1.0, (1.0, 1.0, 1.0)  # nothing here depends on them
        bodies.append(parent)
    for origin in (FLANGE_ORIGIN, TOOL0_ORIGIN):
        parent = parent.add_body(pos=origin.xyz, quat=quaternion_from_euler_zyx(origin.rpy))
    return [*bodies, parent]


def _reach(part: Part, side: Side) -> list[float]:
    """By how much a radian of each joint moves the axis of a part, at most, (7,) [m/rad]."""
    reach, behind = [0.0] * _LINKS, max(hypot(*part.start), hypot(*part.end))
    if part.frame == TOOL_FRAME:
        behind += hypot(*FLANGE_ORIGIN.xyz) + hypot(*TOOL0_ORIGIN.xyz)
    origins = (joint_1_origin(side), *JOINT_ORIGINS)
    for index in reversed(range(min(part.frame, _LINKS - 1) + 1)):
        reach[index] = behind
        behind += hypot(*origins[index].xyz)
    return reach


def _above(point: Vector) -> Vector:
    """A point so near that a capsule between both is a ball; MuJoCo takes none without length."""
    x, y, z = point
    return (x, y, z + 1e-9)


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
