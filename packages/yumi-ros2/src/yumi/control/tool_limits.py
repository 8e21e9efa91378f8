"""The limits of a tool on lines and streams: its speed and walls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import fsum, inf
from typing import NamedTuple

from abb_protocols.catalogue import Message, message
from abb_protocols.robot.joints import Vector

TOP_TOOL_SPEED = 1.5
"""The tool's highest speed [m/s], ABB's for this robot."""


class Wall(NamedTuple):
    """A plane with its free side.

    Attributes:
        name: of the settings.
        point: on it, in the body frame [m].
        normal: of length 1, to the side where the tool may be.
    """

    name: str
    point: Vector
    normal: Vector

    def distance(self, place: Sequence[float]) -> float:
        """How far a place is on the free side [m]; below 0 beyond the wall."""
        rows = zip(self.normal, place[:3], self.point, strict=True)
        return fsum([n * (p - at) for n, p, at in rows])

    def towards(self, velocity: Sequence[float]) -> float:
        """How fast a velocity leads towards the wall [m/s]."""
        return -fsum([n * v for n, v in zip(self.normal, velocity[:3], strict=True)])

    def moved(self, vector: Sequence[float], by: float) -> Vector:
        """A place or velocity, changed by so much along the normal."""
        x, y, z = (value + by * n for value, n in zip(vector[:3], self.normal, strict=True))
        return (x, y, z)


@dataclass(frozen=True, slots=True)
class ToolLimits:
    """The limits of a tool's centre point.

    Attributes:
        speed: at most [m/s].
        walls: that it stays behind.
        turning: of its orientation on streams, at most [rad/s].
    """

    speed: float = TOP_TOOL_SPEED
    walls: tuple[Wall, ...] = ()
    turning: float = inf


class ToolLimited(NamedTuple):
    """A report: a wall holds a tool that follows a stream.

    Attributes:
        wall: its name.
    """

    wall: str

    def __str__(self) -> str:
        return str(self.said)

    @property
    def said(self) -> Message:
        """The report for a person."""
        return message("tool_held_by_wall", wall=self.wall)
