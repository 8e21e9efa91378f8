"""The shapes that must not collide, for the page: what a planner needs of them, and which two are nearest now."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from yumi.driver.endpoint import Surroundings
from yumi.robot.collision import TOOL_FRAME, BallModel, CollisionModel, Near, Obstacle, Part
from yumi.robot.gripper import GripperModules
from yumi.robot.joints import Joints, Side, Vector
from yumi.robot.kinematics import matrix

WITHIN = 0.05
"""Parts further from each other than this are not shown [m]."""


def shapes_of(
    surroundings: Surroundings,
) -> tuple[dict[Side, GripperModules], dict[Side, tuple[Part, ...]], tuple[Obstacle, ...]]:
    """Grippers, tools and boxes as the collision model has them."""
    grippers = {side: GripperModules(surroundings.grippers.get(side.word, "servo")) for side in Side}
    tools = {
        side: tuple(
            Part(each.name, TOOL_FRAME, each.start, each.end, each.radius)
            for each in surroundings.tools.get(side.word, ())
        )
        for side in Side
    }
    return grippers, tools, tuple(Obstacle(each.name, each.pose, each.size) for each in surroundings.boxes)


class NearestPair(NamedTuple):
    """The two parts that are nearest to each other.

    Attributes:
        part: of an arm, as ``right gripper``.
        other: of the other arm, ``body``, or a box by its name.
        distance: between them [m]; below zero where their shapes overlap.
        start: where ``part`` is nearest, in the body's frame [m].
        end: where ``other`` is.
    """

    part: str
    other: str
    distance: float
    start: Vector
    end: Vector


class Distances:
    """Finds the two parts that are nearest to each other: each two parts of different arms, and each part and box.

    The body is left out: at home the arms are within a few millimetres of it.

    Args:
        surroundings: grippers, tools and boxes.
    """

    def __init__(self, surroundings: Surroundings) -> None:
        grippers, tools, obstacles = shapes_of(surroundings)
        self._model = CollisionModel(grippers, tools=tools, obstacles=obstacles)
        self._balls = BallModel(self._model)

    def nearest(self, positions: Mapping[Side, Joints]) -> NearestPair | None:
        """Of arms at joint positions [rad], both (7,); None where nothing is within :data:`WITHIN`."""
        balls = self._balls
        placed = {side: balls.arms[side].place(np.array([positions[side]])) for side in Side}
        found: list[NearestPair] = []

        def add(side: Side, near: Near, other: Side | None) -> None:
            if not near.distances.size:
                return
            distances = near.distances[0, 0]
            if other is None:
                distances = np.where(np.array([balls.boxes[box] == "body" for box in near.columns]), np.inf, distances)
            row, column = np.unravel_index(int(np.argmin(distances)), distances.shape)
            if not (distance := float(distances[row, column])) < WITHIN:
                return
            arm, ball = balls.arms[side], int(near.rows[row])
            middle = placed[side].middles[0, :, ball]
            if other is None:
                box = self._model.fixed[int(near.columns[column])]
                turn, centre, half = (
                    matrix(box.centre.orientation),
                    np.array(box.centre.position),
                    np.array(box.size) / 2,
                )
                name, reached = box.name, centre + turn @ np.clip(turn.T @ (middle - centre), -half, half)
            else:
                its, its_ball = balls.arms[other], int(near.columns[column])
                name, reached = its.names[its.part_of[its_ball]], placed[other].middles[0, :, its_ball]
                way = middle - reached
                reached = reached + its.radii[its_ball] * way / max(float(np.linalg.norm(way)), 1e-9)
            way = reached - middle
            start = middle + arm.radii[ball] * way / max(float(np.linalg.norm(way)), 1e-9)
            start_point, end_point = ((float(x), float(y), float(z)) for x, y, z in (start, reached))
            found.append(NearestPair(arm.names[arm.part_of[ball]], name, distance, start_point, end_point))

        add(Side.RIGHT, balls.between(Side.RIGHT, placed[Side.RIGHT], placed[Side.LEFT], WITHIN), Side.LEFT)
        for side in Side:
            add(side, balls.from_fixed(side, placed[side], WITHIN), None)
        return min(found, key=lambda pair: pair.distance, default=None)
