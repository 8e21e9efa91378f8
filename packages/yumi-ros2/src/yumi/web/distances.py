"""Distances of an arm: the two parts nearest to each other, and what limits each arm, long enough to be read."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from math import inf

from abb_protocols.robot.joints import Joints, Side
from yumi.control.shared_state import Limited
from yumi.core.collision import BODY, CollisionModel, Distance
from yumi.driver.surroundings import Surroundings, shapes_of

_SHOWN_FOR = 0.5  # [s] what limited an arm is shown for so long: several parts may do so in turn

NEAR_DISTANCE = 0.05
"""Parts further from each other than this are not shown [m]."""


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
        """Of arms at joint positions [rad], both (7,); None where nothing is within :data:`NEAR_DISTANCE`.

        ``only``: look among these pairs of parts alone, also with the body; by names, such as what limits the arms.
        """
        if not only:
            return next(iter(self._model.nearest(positions, within=NEAR_DISTANCE, ignore=BODY)), None)
        wanted = {frozenset(pair) for pair in only}
        near = self._model.nearest(positions, len(self._model.names) ** 2, within=NEAR_DISTANCE)
        return next((each for each in near if frozenset((each.part, each.other)) in wanted), None)


class ShownLimits:
    """What limits each arm, so that a person can read it: the same parts for as long as they do so now and again."""

    def __init__(self) -> None:
        self._shown: dict[str, tuple[Limited, float]] = {}  # and when it was last so [s]

    def update(self, limited: Mapping[str, Limited | None], now: float) -> dict[str, Limited]:
        """What to show of the arms at ``now`` [s]."""
        for arm, newest in limited.items():
            last, since = self._shown.get(arm, (None, -inf))
            is_same = last is not None and newest is not None and (last.part, last.other) == (newest.part, newest.other)
            if newest is not None and (is_same or now - since > _SHOWN_FOR):
                self._shown[arm] = newest, now
            elif last is not None and now - since > _SHOWN_FOR:
                del self._shown[arm]
        return {arm: last for arm, (last, _) in self._shown.items()}
