"""World zones: volumes and ranges of joints that the tool, or the joints, of an arm are watched in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import dist, hypot
from typing import Protocol

from abb_protocols.robot.joints import Joints, Vector


class ZoneShape(Protocol):
    """A volume of the tool's point or a range of the joints."""

    def contains(self, point: Vector, joints: Joints) -> bool:
        """Whether it holds the tool's point in the world [m], or the joints [rad]."""


@dataclass(frozen=True, slots=True)
class ZoneBox:
    """Between two corners [m], along the world's axes."""

    low: Vector
    high: Vector

    def contains(self, point: Vector, joints: Joints) -> bool:
        return all(low <= value <= high for low, value, high in zip(self.low, point, self.high, strict=True))


@dataclass(frozen=True, slots=True)
class ZoneSphere:
    """About a point, with a radius [m]."""

    centre: Vector
    radius: float

    def contains(self, point: Vector, joints: Joints) -> bool:
        return dist(point, self.centre) <= self.radius


@dataclass(frozen=True, slots=True)
class ZoneCylinder:
    """From the middle of an end upwards along z, or downwards with a negative height [m]."""

    foot: Vector
    radius: float
    height: float

    def contains(self, point: Vector, joints: Joints) -> bool:
        x, y, z = self.foot
        low, high = sorted((z, z + self.height))
        return hypot(point[0] - x, point[1] - y) <= self.radius and low <= point[2] <= high


@dataclass(frozen=True, slots=True)
class ZoneJoints:
    """Every joint between two positions [rad]."""

    low: Joints
    high: Joints

    def contains(self, point: Vector, joints: Joints) -> bool:
        return all(low <= value <= high for low, value, high in zip(self.low, joints, self.high, strict=True))


@dataclass(frozen=True, slots=True)
class ZoneOutside:
    """All but a shape."""

    shape: ZoneShape

    def contains(self, point: Vector, joints: Joints) -> bool:
        return not self.shape.contains(point, joints)


@dataclass(eq=False, slots=True)
class WorldZone:
    """A world zone of RAPID: a volume or joint range that is watched while the arm moves.

    Attributes:
        shape: the zone.
        changed: called with whether the arm is in the zone, once at first and whenever that changes.
        is_enabled: whether it is watched.
    """

    shape: ZoneShape
    changed: Callable[[bool], None]
    is_enabled: bool = True
    _is_inside: bool | None = field(default=None, init=False)

    def watch(self, point: Vector, joints: Joints) -> None:
        """Compare with where the arm is."""
        is_inside = self.is_enabled and self.shape.contains(point, joints)
        if is_inside != self._is_inside:
            self._is_inside = is_inside
            self.changed(is_inside)
