"""Make the meshes of the robot that are shown: packages/abb-view/src/abb_view/meshes/*.stl.

Our own shapes, not ABB's: each link is a distance field, the smooth union of the capsules that collide
(robot/description.py), with a gap at each joint and a dark ring in it. The body is the smooth union of those boxes,
rounded. Both are within the shapes that collide. Surface nets turn the fields into triangles.

    python setup/make_meshes.py
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from itertools import product
from math import cos, sin
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from abb_protocols.robot.description import BODY_SHAPES, FINGER_SHAPES, JOINT_ORIGINS, LINK_SHAPES, Box, Capsule, Origin

Array = NDArray[np.float64]
Field = Callable[[Array], Array]
"""Distances of points (n, 3) from a surface [m], negative inside."""

FOLDER = Path(__file__).parents[1] / "packages/abb-view/src/abb_view/meshes"
INSET = 0.004  # [m] of solids behind the shapes that collide
BLEND = 4.0 * INSET  # [m] within which two of them flow into each other: by a quarter of it they bulge out
EDGE = 0.014  # [m] within which an edge that was cut is rounded
GAP = 0.0035  # [m] on both sides of a joint's plane
# Of each joint, in the frame of its link: the height of its plane [m], the side of its link, and the radius there [m].
PLANES = ((-0.044, 1, 0.060), (0.0, -1, 0.058), (-0.004, 1, 0.053), (0.0, -1, 0.052), (-0.002, 1, 0.044))
PLANES = (*PLANES, (0.0, -1, 0.042), (0.0, 1, 0.036))
FAR = 0.2


def capsule(start: Array, end: Array, radius: float) -> Field:
    along = end - start

    def field(points: Array) -> Array:
        share = np.clip((points - start) @ along / (along @ along), 0.0, 1.0)
        return np.asarray(np.linalg.norm(points - start - share[:, None] * along, axis=1) - radius)

    return field


def box(low: Array, high: Array, rounding: float) -> Field:
    middle, half = (low + high) / 2.0, (high - low) / 2.0 - rounding

    def field(points: Array) -> Array:
        beyond = np.abs(points - middle) - half
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
        return np.asarray(outside + np.minimum(beyond.max(axis=1), 0.0) - rounding)

    return field


def inset(low: Array, high: Array, rounding: float = 0.0) -> Field:
    return box(low + INSET, high - INSET, rounding)


def cylinder(low: float, high: float, radius: float, rounding: float = 0.0) -> Field:
    """About z."""

    def field(points: Array) -> Array:
        beyond = np.stack(
            [
                np.hypot(points[:, 0], points[:, 1]) - radius + rounding,
                np.abs(points[:, 2] - (low + high) / 2.0) - (high - low) / 2.0 + rounding,
            ],
            axis=1,
        )
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
        return np.asarray(outside + np.minimum(beyond.max(axis=1), 0.0) - rounding)

    return field


def union(*fields: Field, blend: float = BLEND) -> Field:
    def field(points: Array) -> Array:
        nearest = fields[0](points)
        for each in fields[1:]:
            other = each(points)
            overlap = np.maximum(blend - np.abs(nearest - other), 0.0) / blend
            nearest = np.minimum(nearest, other) - overlap * overlap * blend / 4.0
        return nearest

    return field


def without(solid: Field, *cuts: Field) -> Field:
    """What is left of a solid; its edges are rounded, since the triangles of a sharp one would be serrated."""

    def field(points: Array) -> Array:
        left = solid(points)
        for cut in cuts:
            other = -cut(points)
            overlap = np.maximum(EDGE - np.abs(left - other), 0.0) / EDGE
            left = np.maximum(left, other) + overlap * overlap * EDGE / 4.0
        return left

    return field


def within(solid: Field, *bounds: Field) -> Field:
    """What of a solid is in one of these."""
    return lambda points: np.maximum(solid(points), np.min([each(points) for each in bounds], axis=0))


def placed(field: Field, origin: Origin) -> Field:
    """A field of a child's frame in its parent's."""
    roll, pitch, yaw = origin.rpy
    about_x = np.array([(1, 0, 0), (0, cos(roll), -sin(roll)), (0, sin(roll), cos(roll))])
    about_y = np.array([(cos(pitch), 0, sin(pitch)), (0, 1, 0), (-sin(pitch), 0, cos(pitch))])
    about_z = np.array([(cos(yaw), -sin(yaw), 0), (sin(yaw), cos(yaw), 0), (0, 0, 1)])
    rotation = about_z @ about_y @ about_x
    return lambda points: field((points - np.array(origin.xyz)) @ rotation)


def link(index: int) -> tuple[Field, Field]:
    """The shell of a link, counted from 0, and the ring at its joint."""
    solids = []
    for shape in LINK_SHAPES[index]:
        if isinstance(shape, Capsule):
            start, end = np.array(shape.start_mm) / 1e3, np.array(shape.end_mm) / 1e3
            solids.append(capsule(start, end, shape.radius_mm / 1e3 - INSET))
        else:  # the flange
            solids.append(cylinder(-0.026, 0.007, 0.0312, 0.003))
    plane, side, radius = PLANES[index]
    own = plane + side * GAP
    cuts = [cylinder(*sorted((own, own - side * FAR)), radius + 0.03)] if index < 6 else []
    if index < 6:
        plane_after, side_after, radius_after = PLANES[index + 1]
        start = plane_after - side_after * GAP
        beyond = cylinder(*sorted((start, start + side_after * FAR)), radius_after + 0.004)
        cuts.append(placed(beyond, JOINT_ORIGINS[index]))
    shell = union(*solids)
    depth = 0.018 if index else 0.03
    ring = cylinder(plane - depth, plane + depth, radius - 0.010, 0.006)
    return (without(shell, *cuts) if cuts else shell), ring


def surface(field: Field, low: Array, high: Array, cell: float) -> Array:
    """Triangles (n, 3, 3) of a field's surface within a box, outwards: naive surface nets, drawn onto the surface."""
    low = low - 2.0 * cell
    counts = np.ceil((high + 2.0 * cell - low) / cell).astype(int) + 1
    axes = [low[axis] + cell * np.arange(counts[axis]) for axis in range(3)]
    values = field(np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)).reshape(counts)
    values[values == 0.0] = 1e-9
    # One vertex in each cell that the surface passes, in the middle of where it crosses the cell's edges.
    total, crossings = np.zeros((*(counts - 1), 3)), np.zeros(counts - 1)
    corners = {
        corner: tuple(slice(c, n - 1 + c) for c, n in zip(corner, counts, strict=True))
        for corner in product((0, 1), repeat=3)
    }
    for start in corners:
        for axis in range(3):
            if start[axis]:
                continue
            end = tuple(1 if each == axis else value for each, value in enumerate(start))
            a, b = values[corners[start]], values[corners[end]]
            is_crossed = (a < 0.0) != (b < 0.0)
            share = np.where(is_crossed, a / np.where(is_crossed, a - b, 1.0), 0.0)
            point = np.array(start, float) + share[..., None] * np.eye(3)[axis]
            total += np.where(is_crossed[..., None], point, 0.0)
            crossings += is_crossed
    has_vertex = crossings > 0
    number = np.full(crossings.shape, -1)
    number[has_vertex] = np.arange(has_vertex.sum())
    places = np.argwhere(has_vertex)
    vertices = low + cell * (places + total[has_vertex] / crossings[has_vertex][:, None])
    for _ in range(3):
        slope = np.stack([(field(vertices + step) - field(vertices - step)) for step in 1e-4 * np.eye(3)], 1) / 2e-4
        distance = np.clip(field(vertices), -0.3 * cell, 0.3 * cell)
        vertices -= 0.7 * distance[:, None] * slope / np.maximum((slope**2).sum(1), 0.25)[:, None]
    triangles = []
    for axis in range(3):  # a quad about each edge of the grid that the surface crosses
        one, two = (axis + 1) % 3, (axis + 2) % 3
        inner = [slice(1, n - 1) for n in counts]
        inner[axis] = slice(0, counts[axis] - 1)
        ahead = list(inner)
        ahead[axis] = slice(1, counts[axis])
        a, b = values[tuple(inner)], values[tuple(ahead)]
        at = np.argwhere((a < 0.0) != (b < 0.0)) + [each.start for each in inner]
        leaves = values[tuple(at.T)] < 0.0
        quad = []
        for back in ((1, 1), (0, 1), (0, 0), (1, 0)):
            cell_at = at.copy()
            cell_at[:, one] -= back[0]
            cell_at[:, two] -= back[1]
            quad.append(number[tuple(cell_at.T)])
        corners_of = np.stack(quad, 1)
        corners_of[~leaves] = corners_of[~leaves][:, ::-1]
        triangles += [corners_of[:, (0, 1, 2)], corners_of[:, (0, 2, 3)]]
    return np.asarray(vertices[np.concatenate(triangles)])


def write(name: str, field: Field, low: Array, high: Array, cell: float) -> None:
    """A binary STL; coordinates are rounded to 10 µm, so that other machines make the same file."""
    triangles = np.round(surface(field, low, high, cell), 5).astype("<f4")
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    data = np.zeros(len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    data["normal"], data["corners"] = normals, triangles
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / f"{name}.stl").write_bytes(b"yumi-ros2".ljust(80) + struct.pack("<I", len(data)) + data.tobytes())
    print(f"{name}.stl: {len(data)} triangles")


def corners(shape: Box) -> tuple[Array, Array]:
    return np.array(shape.low_mm) / 1e3, np.array(shape.high_mm) / 1e3


def main() -> None:
    base, left, right, column, flare, *shoulders = (corners(each) for each in BODY_SHAPES)
    low, high = np.array([-0.37, -0.21, -0.11]), np.array([0.145, 0.21, 0.48])
    feet = union(inset(*base, 0.03), inset(*left, 0.02), inset(*right, 0.02), blend=0.01)
    # The lobes begin inside the base.
    bounds = [inset(*base), *(inset(each[0] - (0.05, 0.0, 0.0), each[1]) for each in (left, right))]
    write("base", within(feet, *bounds), low, np.array([0.145, 0.21, 0.11]), 0.020)
    up = np.array([0.0, 0.0, 0.03])  # column and flare end inside the shoulders
    column, flare = ((start, end + up) for start, end in (column, flare))
    torso = union(
        inset(*column, 0.045),
        inset(*flare, 0.020),
        union(*(inset(*each, 0.009 + 0.012 * (each is shoulders[0])) for each in shoulders), blend=0.02),
        blend=0.03,
    )
    torso = within(torso, *(inset(*each) for each in (column, flare, *shoulders)))
    write("torso", torso, np.array([-0.37, -0.14, 0.07]), high, 0.014)
    for index in range(7):
        shell, ring = link(index)
        points = [
            np.array(point) / 1e3
            for shape in LINK_SHAPES[index]
            if not isinstance(shape, Box)
            for point in (shape.start_mm, shape.end_mm)
        ]
        reach = max(shape.radius_mm for shape in LINK_SHAPES[index] if not isinstance(shape, Box)) / 1e3 + 0.012
        write(
            f"link_{index + 1}",
            shell,
            np.min(points, 0) - reach,
            np.max(points, 0) + reach,
            0.0075 if index < 6 else 0.006,
        )
        if index < 6:
            plane, _, radius = PLANES[index]
            edge = np.array([radius, radius, 0.032])
            middle = np.array([0.0, 0.0, plane])
            write(f"ring_{index + 1}", ring, middle - edge, middle + edge, 0.007)
    palm = union(
        box(np.array([-0.0416, -0.0345, 0.0]), np.array([0.0416, 0.0345, 0.058]), 0.010),
        box(np.array([-0.0416, -0.024, 0.03]), np.array([0.0416, 0.024, 0.0837]), 0.006),
        blend=0.008,
    )
    write("gripper", palm, np.array([-0.0416, -0.0345, 0.0]), np.array([0.0416, 0.0345, 0.0837]), 0.007)
    finger = corners(FINGER_SHAPES[0])  # type: ignore[arg-type]
    low, high = finger
    tapered = union(
        box(low, np.array([high[0], high[1], 0.018]), 0.002),
        box(np.array([-0.007, low[1], 0.0]), np.array([0.004, high[1] - 0.003, high[2]]), 0.0015),
        blend=0.004,
    )
    write("finger", tapered, low, high, 0.003)


if __name__ == "__main__":
    main()
