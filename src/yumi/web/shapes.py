"""The shapes that must not collide, for the page: what a planner needs of them, and which two are nearest now."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from yumi.driver.endpoint import Surroundings
from yumi.robot.collision import TOOL_FRAME, CollisionModel, Distance, Obstacle, Part
from yumi.robot.gripper import GripperModules
from yumi.robot.joints import Joints, Side

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


class Distances:
    """Finds the two parts that are nearest to each other: each two parts of different arms, and each part and box.

    The body is left out: at home the arms are within a few millimetres of it.

    Args:
        surroundings: grippers, tools and boxes.
    """

    def __init__(self, surroundings: Surroundings) -> None:
        grippers, tools, obstacles = shapes_of(surroundings)
        self._model = CollisionModel(grippers, tools=tools, obstacles=obstacles)

    def nearest(self, positions: Mapping[Side, Joints], only: Collection[tuple[str, str]] = ()) -> Distance | None:
        """Of arms at joint positions [rad], both (7,); None where nothing is within :data:`WITHIN`.

        ``only``: look among these pairs of parts alone, also with the body; by names, such as what limits the arms.
        """
        if not only:
            return next(iter(self._model.nearest(positions, within=WITHIN, ignore="body")), None)
        wanted = {frozenset(pair) for pair in only}
        near = self._model.nearest(positions, len(self._model.names) ** 2, within=WITHIN)
        return next((each for each in near if frozenset((each.part, each.other)) in wanted), None)
