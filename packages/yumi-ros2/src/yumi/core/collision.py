"""Distances between parts: links of the arms, their grippers, the body, and obstacles that stand around the robot.

Each moving part is covered by capsules (segments with a radius), the body and everything that stands still by boxes.
The shapes contain those of the robot's description (:mod:`abb_protocols.robot.description`), which are fitted to public
meshes of the robot's covers; `COLLISION_PADDING` leaves room for cables and the tolerances of castings. This is no
safety function: a person in the way, or a part that was not declared, is not seen.

Positions are in the body frame [m], joints in chain order [rad].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from math import hypot, sqrt

import numpy as np
from numpy.typing import NDArray

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.description import (
    BODY_SHAPES,
    FINGER_ORIGINS,
    FINGER_SHAPES,
    FLANGE_ORIGIN,
    GRIPPER_SHAPES,
    JOINT_ORIGINS,
    LINK_SHAPES,
    TOOL0_ORIGIN,
    joint_1_origin,
)
from abb_protocols.robot.gripper_values import FINGER_TRAVEL, GripperModules
from abb_protocols.robot.joints import JOINT_COUNT, Joints, Pose, Quaternion, Side, Vector
from abb_protocols.robot.kinematics import IDENTITY_QUATERNION, matrix_from_quaternion, quaternion_from_euler_zyx
from yumi.core.library import load, new_handle

Array = NDArray[np.float64]

COLLISION_PADDING = 0.004
"""Added to every radius: cables, labels, and castings that differ from the meshes [m]."""

_ROUND_END = 0.002  # [m]
TOOL_FRAME = JOINT_COUNT
"""Index of tool0's frame, behind those of the links."""


@dataclass(frozen=True, slots=True)
class CollisionPart:
    """A capsule that moves with a link or with tool0.

    Attributes:
        name: of the part, as it is shown, e.g. ``forearm``.
        frame: index of the link from 0 in chain order, or :data:`TOOL_FRAME`.
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


_LINK_NAMES = ("shoulder", "upper arm", "upper arm", "elbow", "forearm", "wrist", "flange")


def gripper_parts(modules: GripperModules) -> tuple[CollisionPart, ...]:
    """The gripper with its fingers in any opening, its camera and its cups (reference/yumi.md §2.2, §2.4)."""
    (body,) = GRIPPER_SHAPES
    half_x, half_y, height = _metres(body.high_mm)
    # Capsules side by side, a little thicker than circles that cover the cross-section, so that their
    # round ends cover its corners from further inside.
    columns, rows = (-0.75, -0.25, 0.25, 0.75), (-2.0 / 3.0, 0.0, 2.0 / 3.0)
    corner = hypot(half_x / len(columns), half_y / len(rows))
    radius = corner + _ROUND_END
    inset = sqrt(radius * radius - corner * corner)
    parts = [
        CollisionPart(
            "gripper", TOOL_FRAME, (x * half_x, y * half_y, inset), (x * half_x, y * half_y, height - inset), radius
        )
        for x in columns
        for y in rows
    ]
    (finger,) = FINGER_SHAPES
    (low_x, low_y, low_z), (_, high_y, high_z) = _metres(finger.low_mm), _metres(finger.high_mm)
    # Both fingers, wherever they are: side by side along x, one above the other along z.
    origin, slices = FINGER_ORIGINS[0].xyz, 3
    reach, step = FINGER_TRAVEL - low_x, (high_z - low_z) / slices
    half_y = max(abs(low_y + origin[1]), abs(high_y + origin[1]))
    for index in range(slices):
        z = origin[2] + low_z + (index + 0.5) * step
        parts.append(CollisionPart("fingers", TOOL_FRAME, (-reach, 0.0, z), (reach, 0.0, z), hypot(half_y, step / 2.0)))
    if modules.has_camera:
        parts.append(CollisionPart("camera", TOOL_FRAME, (-0.0073, 0.0, 0.0351), (-0.0073, 0.0283, 0.0351), 0.015))
    for channel, side in zip(modules.vacuum_channels, (1.0, -1.0), strict=False):
        parts.append(
            CollisionPart(f"cup {channel}", TOOL_FRAME, (0.0, 0.0185, 0.0375), (side * 0.0635, 0.0185, 0.0375), 0.012)
        )
    return tuple(parts)


BODY = "body"
"""Name of what stands still and belongs to the robot."""

_MAX_OBSTACLES = 100
"""So many boxes may be declared; a hundred cost both arms 12 µs of a cycle."""

_MAX_TOOLS = 20
"""So many tools of an arm may be declared; each is compared with every part of the other arm."""


def check_declared(tools: Mapping[Side, Sequence[CollisionPart]], obstacles: Sequence[Obstacle]) -> None:
    """Check names and number of what a user declares.

    A margin, and whether two parts may touch, is looked up by name: a name means one thing.

    Raises:
        CommandRefused: there are too many, or a name is empty, another one's or one of the robot's own.
    """
    own = {"arm", *_LINK_NAMES, *(part.name for modules in GripperModules for part in gripper_parts(modules))}
    names = {BODY}
    for side in Side:
        declared = [part.name for part in tools.get(side, ())]
        _check_names(declared, _MAX_TOOLS, own, side)
        names.update(f"{side.word} {name}" for name in (*own, *declared))
    _check_names([box.name for box in obstacles], _MAX_OBSTACLES, names)


def _check_names(names: Sequence[str], most: int, taken: Set[str], side: Side | None = None) -> None:
    """Of the tools of an arm, or of the boxes."""
    arm = {"arm": side.word} if side else {}
    if len(names) > most:
        raise CommandRefused(
            message(
                "tool_one_too_many" if side else "box_one_too_many",
                name=names[most],
                count=len(names),
                most=most,
                **arm,
            )
        )
    for index, name in enumerate(names):
        if not name.strip():
            raise CommandRefused(message("tool_without_name" if side else "box_without_name", name=name, **arm))
        if name in taken:
            raise CommandRefused(message("tool_named_as_robot" if side else "box_named_as_robot", name=name, **arm))
        if name in names[:index]:
            raise CommandRefused(message("tool_named_twice" if side else "box_named_twice", name=name, **arm))


_FAR = 10.0
"""Nothing of the robot is further away [m]."""

_CONTACT = np.dtype(
    [
        ("distance", float),
        ("normal", float, 3),
        ("points", float, (2, 3)),
        ("parts", np.int64, 2),
    ]
)
"""Two parts that are near each other.

- distance: between their padded surfaces; below zero where they overlap [m]. Where the axis of a part is inside a box
  it is that part's depth behind the box's nearest face.
- normal: from the first part to the second along the line of nearest distance.
- points: both ends of that line [m].
- parts: their numbers, as in :attr:`CollisionModel.names`.
"""

_Contacts = NDArray[np.void]
"""Of :data:`_CONTACT`, (n,)."""


class CollisionModel:
    """The shapes of one robot with its grippers, tools and surroundings, whose distances ``collision.cpp`` calculates.

    A distance is exact as long as the axis of a capsule does not enter a box. Not for several threads at once.

    Args:
        grippers: the modules of each arm's gripper.
        tools: more parts of an arm: fingers of one's own, a tool, an object it holds.
        obstacles: what stands around the robot.

    Raises:
        CommandRefused: as :func:`check_declared`.

    Attributes:
        names: of all parts, those of the right arm first, then the left arm's, then what stands still.
        arms: the parts of each arm.
        body: those of the robot's body.
        frames: the link that a part moves with, from 0 in chain order, or :data:`TOOL_FRAME`; -1 for what stands still.
        handle: what the library calls it.
    """

    def __init__(
        self,
        grippers: Mapping[Side, GripperModules],
        *,
        tools: Mapping[Side, Sequence[CollisionPart]] | None = None,
        obstacles: Sequence[Obstacle] = (),
    ) -> None:
        check_declared(tools or {}, obstacles)
        self.names: list[str] = []
        self.arms: dict[Side, slice] = {}
        frames: list[int] = []
        parts: dict[Side, tuple[CollisionPart, ...]] = {}
        for side in Side:
            own = parts[side] = (*link_parts(), *gripper_parts(grippers[side]), *(tools or {}).get(side, ()))
            self.arms[side] = slice(len(self.names), len(self.names) + len(own))
            self.names += [f"{side.word} {part.name}" for part in own]
            frames += [part.frame for part in own]
        fixed = (*body_boxes(), *obstacles)
        self.body = slice(len(self.names), len(self.names) + len(BODY_SHAPES))
        self.names += [box.name for box in fixed]
        self.frames = np.array(frames + [-1] * len(fixed))
        capsules = [
            (part.frame, *part.start, *part.end, part.radius + COLLISION_PADDING, *_reach(part, side))
            for side in Side
            for part in parts[side]
        ]
        boxes = [
            (
                *_axes(box.centre.position, box.centre.orientation),
                *(edge / 2.0 for edge in box.size),
                number < len(BODY_SHAPES),
            )
            for number, box in enumerate(fixed)
        ]
        frames_of = [_frames(side) for side in Side]
        counts = np.array([len(parts[side]) for side in Side])
        self._found = np.empty(max(counts) * max(*counts, len(boxes)), dtype=_CONTACT)
        self._library = load()
        arrays = [np.array(each, dtype=float) for each in (frames_of, capsules, boxes)]
        if not (
            np.isin(arrays[1][:, 0], range(TOOL_FRAME + 1)).all() and all(np.isfinite(each).all() for each in arrays)
        ):
            raise ValueError("a part is of a frame that is none, or its shape is not finite")
        origins, shapes, still = (each.ctypes.data for each in arrays)
        self.handle = new_handle(self, "model", origins, counts.ctypes.data, shapes, still, len(boxes))

    def contacts(self, positions: Array, within: float, alone: Side | None = None) -> _Contacts:
        """The pairs of parts that are near each other.

        Args:
            positions: of all arms, one after the other [rad], (14,).
            within: pairs further apart than this are left out [m].
            alone: the arm whose parts are compared with what stands still; None: both arms with each other.
        """
        if positions.shape != (len(Side) * JOINT_COUNT,) or not np.isfinite(positions).all():
            raise ValueError(f"positions of {len(Side) * JOINT_COUNT} joints, not {positions}")
        postures, side = np.ascontiguousarray(positions, dtype=float), alone or Side.RIGHT
        arguments = postures.ctypes.data, within, list(Side).index(side), alone is not None, self._found.ctypes.data
        count: int = self._library.model_contacts(self.handle, *arguments)
        found: _Contacts = self._found[:count].copy()
        return found

    def nearest(
        self, positions: Mapping[Side, Joints], count: int = 1, *, within: float = _FAR, ignore: str = ""
    ) -> tuple[Distance, ...]:
        """The nearest pairs of parts, nearest first: arm to arm, and arm to body and obstacles.

        Args:
            positions: of both arms [rad].
            count: how many pairs.
            within: how near they are [m].
            ignore: the name of what stands still and does not count.
        """
        both = np.concatenate([positions[side] for side in Side])
        nearest: list[Distance] = []
        for found in (self.contacts(both, within, alone) for alone in (None, *Side)):
            rows = (found[name].tolist() for name in ("distance", "parts", "points"))
            for distance, (part, other), (start, end) in zip(*rows, strict=True):
                if self.names[other] != ignore:
                    nearest.append(Distance(distance, self.names[part], self.names[other], tuple(start), tuple(end)))
        return tuple(sorted(nearest, key=lambda each: each.distance)[:count])


def _frames(side: Side) -> list[list[float]]:
    """The links of an arm and its tool0, each in the frame before, as :func:`_axes`, (8, 12)."""
    links = [_axes(each.xyz, quaternion_from_euler_zyx(each.rpy)) for each in (joint_1_origin(side), *JOINT_ORIGINS)]
    flange = matrix_from_quaternion(quaternion_from_euler_zyx(FLANGE_ORIGIN.rpy))
    tool = flange @ matrix_from_quaternion(quaternion_from_euler_zyx(TOOL0_ORIGIN.rpy))
    return [*links, [*tool.T.ravel().tolist(), *(FLANGE_ORIGIN.xyz + flange @ TOOL0_ORIGIN.xyz).tolist()]]


def _axes(position: Vector, orientation: Quaternion) -> list[float]:
    """The x, y and z axis of a frame and its origin, (12,)."""
    return [*matrix_from_quaternion(orientation).T.ravel().tolist(), *position]


def _reach(part: CollisionPart, side: Side) -> list[float]:
    """By how much a radian of each joint moves the axis of a part, at most, (7,) [m/rad]."""
    reach, behind = [0.0] * JOINT_COUNT, max(hypot(*part.start), hypot(*part.end))
    if part.frame == TOOL_FRAME:
        behind += hypot(*FLANGE_ORIGIN.xyz) + hypot(*TOOL0_ORIGIN.xyz)
    origins = (joint_1_origin(side), *JOINT_ORIGINS)
    for index in reversed(range(min(part.frame, JOINT_COUNT - 1) + 1)):
        reach[index] = behind
        behind += hypot(*origins[index].xyz)
    return reach


def link_parts() -> tuple[CollisionPart, ...]:
    """The arm's links, the same on both arms; a cylinder lies inside the capsule of its axis and radius."""
    return tuple(
        CollisionPart(name, frame, _metres(shape.start_mm), _metres(shape.end_mm), shape.radius_mm / 1000.0)
        for frame, (name, shapes) in enumerate(zip(_LINK_NAMES, LINK_SHAPES, strict=True))
        for shape in shapes
    )


def _metres(millimetres: Vector) -> Vector:
    x, y, z = millimetres
    return (x / 1000.0, y / 1000.0, z / 1000.0)


def body_boxes() -> tuple[Obstacle, ...]:
    """The robot's body."""
    boxes = []
    for shape in BODY_SHAPES:
        low, high = np.array(_metres(shape.low_mm)), np.array(_metres(shape.high_mm))
        x, y, z = ((low + high) / 2.0).tolist()
        width, depth, height = (high - low).tolist()
        boxes.append(Obstacle(BODY, Pose((x, y, z), IDENTITY_QUATERNION), (width, depth, height)))
    return tuple(boxes)
