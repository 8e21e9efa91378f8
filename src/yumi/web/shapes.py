"""The shapes that must not collide, for the page: what a planner needs of them, and which two are nearest now."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np

from yumi.driver.endpoint import Surroundings
from yumi.robot.collision import TOOL_FRAME, BallModel, CollisionModel, Obstacle, Part
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

    def nearest(self, positions: Mapping[Side, Joints], only: Collection[tuple[str, str]] = ()) -> NearestPair | None:
        """Of arms at joint positions [rad], both (7,); None where nothing is within :data:`WITHIN`.

        ``only``: look among these pairs of parts alone, also with the body; by names, such as what limits the arms.
        """
        wanted = {frozenset(pair) for pair in only}
        balls, found = self._balls, []
        still = {
            side: arm.sweep(np.array([positions[side]]), np.array([0]), np.array([0]), np.zeros((1, 7)))
            for side, arm in balls.arms.items()
        }
        for side, other in ((Side.RIGHT, Side.LEFT), (Side.RIGHT, None), (Side.LEFT, None)):
            arm = balls.arms[side]
            if other is None:
                columns = np.array(
                    [index for index, name in enumerate(balls.boxes) if wanted or name != "body"], dtype=np.intp
                )
            else:
                columns = np.arange(len(balls.arms[other].names))
            rows, columns = (each.ravel() for each in np.meshgrid(np.arange(len(arm.names)), columns, indexing="ij"))
            if other is not None:  # the shoulders are bolted to one body, next to each other
                moves = (arm.part_frames[rows] > 0) | (balls.arms[other].part_frames[columns] > 0)
                rows, columns = rows[moves], columns[moves]
            if wanted:
                others = balls.boxes if other is None else balls.arms[other].names
                kept = [frozenset((arm.names[i], others[j])) in wanted for i, j in zip(rows, columns, strict=True)]
                rows, columns = rows[kept], columns[kept]
            if not len(rows):
                continue
            within = np.full(len(rows), WITHIN)
            if other is None:
                near = balls.from_fixed(side, still[side], (rows, columns), within)
            else:
                near = balls.between(side, still[side], still[other], (rows, columns), within)
            pair = int(np.argmin(near.distances))
            distance, at = float(near.distances[pair]), near.least(pair)
            if distance >= WITHIN or at is None:
                continue
            ball, its_ball = (int(each[at]) for each in near.balls)
            middle = arm.middle(still[side], 0, ball)
            if other is None:
                box = self._model.fixed[its_ball]
                turn, centre, half = (
                    matrix(box.centre.orientation),
                    np.array(box.centre.position),
                    np.array(box.size) / 2,
                )
                name, reached = box.name, centre + turn @ np.clip(turn.T @ (middle - centre), -half, half)
            else:
                its = balls.arms[other]
                name, reached = its.names[its.part_of[its_ball]], its.middle(still[other], 0, its_ball)
                way = middle - reached
                reached = reached + its.radii[its_ball] * way / max(float(np.linalg.norm(way)), 1e-9)
            way = reached - middle
            start = middle + arm.radii[ball] * way / max(float(np.linalg.norm(way)), 1e-9)
            start_point, end_point = ((float(x), float(y), float(z)) for x, y, z in (start, reached))
            found.append(NearestPair(arm.names[arm.part_of[ball]], name, distance, start_point, end_point))
        return min(found, key=lambda pair: pair.distance, default=None)
