"""Render the robot for the pictures of make_tool_motions.py, from the shapes of its URDF.

A small ray marcher in numpy: each link is a distance field, the smooth union of its boxes, cylinders and spheres, so
that the pictures follow ``robot/description.py`` whatever shapes it has. The background is transparent, for light and
dark pages.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce
from math import radians
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray
from PIL import Image

Array = NDArray[np.float32]

EYE = (1.95, -1.02, 0.92)  # [m] from the robot's base
TARGET = (0.02, -0.015, 0.222)
FIELD_OF_VIEW = 25.5  # [°], from top to bottom
LIGHT = np.array((0.42, -0.62, 1.0), dtype=np.float32)
ROUNDING = 0.014  # of a box's edges [m]
BLEND = 0.03  # within which two solids of a link flow into each other [m]
STEPS, NEAR = 72, 0.0004  # of a ray, and how close it must come [m]
SUPERSAMPLING = 2
COLORS = {"abb_white": (0.93, 0.935, 0.93), "abb_grey": (0.66, 0.685, 0.71), "abb_graphite": (0.25, 0.265, 0.285)}
OTHER_COLOR = (0.8, 0.8, 0.8)


@dataclass(frozen=True)
class Solid:
    """A box, cylinder, sphere or capsule of a link.

    Attributes:
        kind: URDF's name; "capsule" is a cylinder with a sphere at both ends.
        size: half edges of a box, radius and half length of a cylinder or capsule, radius of a sphere [m].
        to_link: its frame in the link's, 4 × 4.
    """

    kind: str
    size: tuple[float, ...]
    to_link: Array

    @property
    def reach(self) -> float:
        """Radius of the ball around its middle that holds it [m]."""
        return sum(self.size) if self.kind == "capsule" else float(np.linalg.norm(self.size))

    def distance(self, points: Array) -> Array:
        """How far points (n, 3) of the link's frame are from its surface; negative inside [m]."""
        x, y, z = ((points - self.to_link[:3, 3]) @ self.to_link[:3, :3]).T
        if self.kind == "capsule":
            z = z - np.clip(z, -self.size[1], self.size[1])
        if self.kind in {"sphere", "capsule"}:
            return length(x, y, z) - np.float32(self.size[0])
        rounding = np.float32(min(ROUNDING, 0.6 * min(self.size)) if self.kind == "box" else 0.0)
        beyond = (np.hypot(x, y), np.abs(z)) if self.kind == "cylinder" else (np.abs(x), np.abs(y), np.abs(z))
        beyond = tuple(value - np.float32(half) + rounding for value, half in zip(beyond, self.size, strict=True))
        inside = np.minimum(reduce(np.maximum, beyond), 0.0)
        return inside + length(*(np.maximum(value, 0.0) for value in beyond)) - rounding


@dataclass(frozen=True)
class Link:
    """A link with shapes: where it is, and what it looks like.

    Attributes:
        to_base: its frame in the robot's, 4 × 4.
        solids: its shapes.
        color: red, green and blue from 0 to 1.
    """

    to_base: Array
    solids: tuple[Solid, ...]
    color: tuple[float, float, float]

    def distance(self, points: Array) -> Array:
        """How far points (n, 3) of the link's frame are from its surface [m]."""
        nearest = self.solids[0].distance(points)
        for solid in self.solids[1:]:
            other = solid.distance(points)
            overlap = np.maximum(BLEND - np.abs(nearest - other), 0.0) / BLEND
            nearest = np.minimum(nearest, other) - overlap * overlap * np.float32(BLEND / 4.0)
        return nearest

    def ball(self) -> tuple[Array, float]:
        """Middle, in the robot's frame, and radius of a ball that holds it [m]."""
        middles = np.array([solid.to_link[:3, 3] for solid in self.solids], dtype=np.float32)
        middle = middles.mean(axis=0)
        radius = max(
            float(np.linalg.norm(each - middle)) + solid.reach for each, solid in zip(middles, self.solids, strict=True)
        )
        return self.to_base[:3, :3] @ middle + self.to_base[:3, 3], radius + BLEND


@dataclass(frozen=True)
class View:
    """What rays (n, 3) met.

    Attributes:
        depth: along the ray [m]; infinite where there was nothing.
        normal: of the surface.
        color: of the link.
    """

    depth: Array
    normal: Array
    color: Array


def length(*components: Array) -> Array:
    """Of vectors whose components are given, each as (n,)."""
    return np.sqrt(sum(each * each for each in components))


def frame(element: ET.Element | None) -> Array:
    """The 4 × 4 matrix of a URDF ``origin``."""
    matrix = np.eye(4, dtype=np.float32)
    if element is not None:
        matrix[:3, 3] = [float(value) for value in element.get("xyz", "0 0 0").split()]
        roll, pitch, yaw = (float(value) for value in element.get("rpy", "0 0 0").split())
        matrix[:3, :3] = (turn((0, 0, 1), yaw) @ turn((0, 1, 0), pitch) @ turn((1, 0, 0), roll))[:3, :3]
    return matrix


def turn(axis: tuple[float, float, float], angle: float) -> Array:
    """The 4 × 4 matrix of a rotation by ``angle`` [rad] about ``axis``."""
    x, y, z = axis
    cross = np.array(((0, -z, y), (z, 0, -x), (-y, x, 0)))
    matrix = np.eye(4)
    matrix[:3, :3] += np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    return matrix.astype(np.float32)


def links_of(urdf: ET.Element, positions: Mapping[str, float]) -> list[Link]:
    """Every link that has shapes, where it is with these joint positions [rad, m]."""
    children: dict[str, list[ET.Element]] = {}
    for joint in urdf.iter("joint"):
        children.setdefault(joint.find("parent").get("link"), []).append(joint)  # type: ignore[union-attr, arg-type]
    named = {link.get("name"): link for link in urdf.iter("link")}
    roots = set(named) - {joint.find("child").get("link") for joint in urdf.iter("joint")}  # type: ignore[union-attr]
    waiting, found = [(name, np.eye(4, dtype=np.float32)) for name in roots], []
    while waiting:
        name, to_base = waiting.pop()
        visuals = list(named[name].iter("visual"))
        if solids := [solid for visual in visuals if (solid := solid_of(visual)) is not None]:
            material = visuals[0].find("material")
            color = COLORS.get(material.get("name", ""), OTHER_COLOR) if material is not None else OTHER_COLOR
            found.append(Link(to_base, with_capsules(solids), color))
        for joint in children.get(str(name), ()):
            axis_element, position = joint.find("axis"), positions.get(joint.get("name", ""), 0.0)
            axis = [float(value) for value in axis_element.get("xyz", "").split()] if axis_element is not None else []
            motion = np.eye(4, dtype=np.float32)
            if joint.get("type") in {"revolute", "continuous"}:
                motion = turn((axis[0], axis[1], axis[2]), position)
            elif joint.get("type") == "prismatic":
                motion[:3, 3] = np.float32(axis) * np.float32(position)
            child = joint.find("child").get("link")  # type: ignore[union-attr]
            waiting.append((child, to_base @ frame(joint.find("origin")) @ motion))
    return found


def solid_of(visual: ET.Element) -> Solid | None:
    """The solid of a ``visual``; None when it is of another kind, such as a mesh."""
    to_link = frame(visual.find("origin"))
    if (box := visual.find("geometry/box")) is not None:
        return Solid("box", tuple(0.5 * float(value) for value in box.get("size", "").split()), to_link)
    if (cylinder := visual.find("geometry/cylinder")) is not None:
        size = (float(cylinder.get("radius", 0)), 0.5 * float(cylinder.get("length", 0)))
        return Solid("cylinder", size, to_link)
    if (sphere := visual.find("geometry/sphere")) is not None:
        return Solid("sphere", (float(sphere.get("radius", 0)),), to_link)
    return None


def with_capsules(solids: list[Solid]) -> tuple[Solid, ...]:
    """The same solids, where cylinders with equal spheres at both ends are capsules, which URDF does not have."""
    left, capsules = list(solids), []
    for cylinder in (each for each in solids if each.kind == "cylinder"):
        tip = cylinder.size[1] * cylinder.to_link[:3, 2]
        ends = [
            each
            for each in left
            if each.kind == "sphere"
            and abs(each.size[0] - cylinder.size[0]) < 1e-6
            and min(np.linalg.norm(each.to_link[:3, 3] - cylinder.to_link[:3, 3] - sign * tip) for sign in (-1, 1))
            < 1e-4
        ]
        if len(ends) == 2:
            left = [each for each in left if each is not cylinder and not any(each is end for end in ends)]
            capsules.append(Solid("capsule", cylinder.size, cylinder.to_link))
    return (*left, *capsules)


def look(links: list[Link], origins: Array, rays: Array) -> View:
    """What rays from ``origins`` (n, 3) along ``rays`` (n, 3) of length 1 meet first."""
    count = len(rays)
    depth = np.full(count, np.inf, dtype=np.float32)
    normal, color = np.zeros((count, 3), np.float32), np.zeros((count, 3), np.float32)
    for link in links:
        middle, radius = link.ball()
        to_middle = [np.float32(middle[axis]) - origins[:, axis] for axis in range(3)]
        along = sum(to_middle[axis] * rays[:, axis] for axis in range(3))
        beside = np.sqrt(np.maximum(sum(each * each for each in to_middle) - along * along, 0.0))
        near = np.flatnonzero((beside < radius) & (along - radius < depth))
        if not near.size:
            continue
        # In the link's frame from here on: its solids stand still there.
        rotation = link.to_base[:3, :3]
        start = (origins[near] - link.to_base[:3, 3]) @ rotation
        ray = rays[near] @ rotation
        chord = np.sqrt(radius**2 - beside[near] ** 2)
        travelled, end = along[near] - chord, along[near] + chord
        is_hit, moving = np.zeros(near.size, bool), np.arange(near.size)
        for _ in range(STEPS):
            step = link.distance(start[moving] + travelled[moving, None] * ray[moving])
            travelled[moving] += step
            is_hit[moving[step < NEAR]] = True
            moving = moving[(step >= NEAR) & (travelled[moving] < end[moving])]
            if not moving.size:
                break
        hit = np.flatnonzero(is_hit & (travelled < depth[near]))
        points, pixels = start[hit] + travelled[hit, None] * ray[hit], near[hit]
        depth[pixels], color[pixels] = travelled[hit], link.color
        corners = np.float32(((1, -1, -1), (-1, -1, 1), (-1, 1, -1), (1, 1, 1)))
        slope = sum(corner * link.distance(points + NEAR * corner)[:, None] for corner in corners)
        slope /= np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-9)
        normal[pixels] = slope @ rotation.T
    return View(depth, normal, color)


def render(links: list[Link], width: int, height: int) -> Image.Image:
    """The robot on its table, with a transparent background."""
    wide, high = SUPERSAMPLING * width, SUPERSAMPLING * height
    eye, target = np.float32(EYE), np.float32(TARGET)
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, (0.0, 0.0, 1.0)).astype(np.float32)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    edge = np.tan(radians(FIELD_OF_VIEW) / 2.0)
    x, y = np.meshgrid(np.linspace(-edge, edge, wide) * wide / high, np.linspace(edge, -edge, high))
    rays = (forward + x[..., None] * right + y[..., None] * up).reshape(-1, 3).astype(np.float32)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    seen = look(links, np.broadcast_to(eye, rays.shape), rays)

    # The light sees the robot from far away: what it does not see is in shadow, on the robot as on the table.
    light = LIGHT / np.linalg.norm(LIGHT)
    side = np.cross(light, (0.0, 1.0, 0.0)).astype(np.float32)
    side /= np.linalg.norm(side)
    upward = np.cross(side, light)
    span, cells = 1.5, 640
    a, b = np.meshgrid(np.linspace(-span / 2, span / 2, cells), np.linspace(-span / 2, span / 2, cells))
    sources = (target + 2.0 * light + a[..., None] * side + b[..., None] * upward).reshape(-1, 3).astype(np.float32)
    lit_depth = look(links, sources, np.broadcast_to(-light, sources.shape)).depth.reshape(cells, cells)

    def lit(points: Array, softness: int, spread: int) -> Array:
        """How much of the light reaches points (n, 3), from 0 to 1; shadows soften over softness × spread cells."""
        relative = points - (target + 2.0 * light)
        column = np.round((relative @ side / span + 0.5) * (cells - 1)).astype(int)
        row = np.round((relative @ upward / span + 0.5) * (cells - 1)).astype(int)
        distance = relative @ -light
        steps = spread * np.arange(-softness, softness + 1)
        total = np.zeros(len(points), np.float32)
        for down in steps:
            for across in steps:
                found = lit_depth[np.clip(row + down, 0, cells - 1), np.clip(column + across, 0, cells - 1)]
                total += distance < found + 0.006
        return total / len(steps) ** 2

    shown = np.isfinite(seen.depth)
    image = np.zeros((len(rays), 4), np.float32)
    points, normal, ray = eye + seen.depth[shown, None] * rays[shown], seen.normal[shown], rays[shown]
    towards = np.clip(normal @ light, 0.0, 1.0) * lit(points + 0.004 * normal, 3, 1)
    half = light - ray
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    shine = np.clip(np.einsum("ij,ij->i", normal, half), 0.0, 1.0) ** 42 * (towards > 0.0)
    sky = 0.5 + 0.5 * normal[:, 2]
    rim = (1.0 - np.clip(-np.einsum("ij,ij->i", normal, ray), 0.0, 1.0)) ** 3
    brightness = 0.34 + 0.20 * sky + 0.55 * towards - 0.22 * rim
    image[shown, :3] = seen.color[shown] * brightness[:, None] * (1.0, 1.0, 1.01) + 0.10 * shine[:, None]
    image[shown, 3] = 1.0

    # The table, by its shadow alone.
    floor = lowest(links)
    down = np.flatnonzero(~shown & (rays[:, 2] < -1e-3))
    on_table = eye + ((floor - eye[2]) / rays[down, 2])[:, None] * rays[down]
    image[down, 3] = (
        0.42 * (1.0 - lit(on_table.astype(np.float32), 5, 3)) * (np.abs(on_table - target).max(axis=1) < 1.0)
    )
    pixels = np.clip(image, 0.0, 1.0).reshape(height, SUPERSAMPLING, width, SUPERSAMPLING, 4)
    alpha = pixels[..., 3].mean(axis=(1, 3))
    colors = (pixels[..., :3] * pixels[..., 3:]).mean(axis=(1, 3)) / np.maximum(alpha, 1e-6)[..., None]
    return Image.fromarray((255.0 * np.dstack((colors, alpha)) + 0.5).astype(np.uint8), "RGBA")


def lowest(links: list[Link]) -> float:
    """Height of the lowest corner of the boxes [m]: where the table is."""
    heights = [0.0]
    for link in links:
        for solid in (each for each in link.solids if each.kind == "box"):
            to_base = link.to_base @ solid.to_link
            heights.append(float(to_base[2, 3] - np.abs(to_base[2, :3]) @ np.float32(solid.size)))
    return min(heights)
