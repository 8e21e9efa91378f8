"""Obstacles as scripts give them: boxes by name, each with its pose and edges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import SupportsFloat

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from yumi.api.poses import PoseLike, numbers_from, pose_from
from yumi.core.collision import Obstacle


def boxes_from(given: Mapping[str, tuple[PoseLike, Sequence[SupportsFloat]]]) -> tuple[Obstacle, ...]:
    """Boxes by name, each with the pose of its centre and its edges [m], as obstacles.

    Raises:
        CommandRefused: a pose or a size is none.
    """
    found = []
    for name, (centre, size) in given.items():
        length, width, height = numbers_from(size, 3, message("size_of_box", box=name))
        if min(length, width, height) <= 0.0:
            raise CommandRefused(message("box_edge_not_positive", box=name))
        found.append(Obstacle(name, pose_from(centre), (length, width, height)))
    return tuple(found)
