"""Every frame of the robot in its parent, for given joint positions: what a URDF says, by forward kinematics."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin
from xml.etree import ElementTree

from yumi.robot.joints import Pose, Quaternion, Vector
from yumi.robot.kinematics import IDENTITY, compose, quaternion_from_euler_zyx


@dataclass(frozen=True, slots=True)
class Frame:
    """A link seen from its parent, where the joint between them is at zero.

    Attributes:
        name: of the link.
        parent: of the link before it.
        origin: ``frame_to_parent`` at zero.
        joint: the joint that moves it, of which a mimicking one follows; empty when it is fixed.
        axis: of the joint, in the frame.
        slides: whether the joint slides along its axis [m], else it turns about it [rad].
        multiplier: what the joint's position is multiplied by.
    """

    name: str
    parent: str
    origin: Pose
    joint: str = ""
    axis: Vector = (0.0, 0.0, 0.0)
    slides: bool = False
    multiplier: float = 1.0

    def to_parent(self, position: float = 0.0) -> Pose:
        """``frame_to_parent`` with its joint at ``position`` [rad] or [m]."""
        if not self.joint:
            return self.origin
        position *= self.multiplier
        x, y, z = self.axis
        if self.slides:
            return compose(self.origin, Pose((x * position, y * position, z * position), IDENTITY))
        s, turn = sin(position / 2.0), cos(position / 2.0)
        return compose(self.origin, Pose((0.0, 0.0, 0.0), (turn, x * s, y * s, z * s)))


def read_frames(urdf: str) -> tuple[Frame, ...]:
    """The frames of a URDF in its order, parents first; the root has none."""
    frames = []
    for joint in ElementTree.fromstring(urdf).iter("joint"):
        kind, mimic, name = joint.attrib["type"], joint.find("mimic"), joint.attrib["name"]
        origin, axis = joint.find("origin"), joint.find("axis")
        place = {} if origin is None else origin.attrib
        frames.append(
            Frame(
                joint.find("child").attrib["link"],  # type: ignore[union-attr]  # every joint has both
                joint.find("parent").attrib["link"],  # type: ignore[union-attr]
                Pose(_vector(place.get("xyz")), _orientation(place.get("rpy"))),
                "" if kind == "fixed" else name if mimic is None else mimic.attrib["joint"],
                (0.0, 0.0, 0.0) if axis is None else _vector(axis.get("xyz")),
                kind == "prismatic",
                1.0 if mimic is None else float(mimic.get("multiplier", "1")),
            )
        )
    return tuple(frames)


def _vector(text: str | None) -> Vector:
    x, y, z = (float(word) for word in (text or "0 0 0").split())
    return (x, y, z)


def _orientation(rpy: str | None) -> Quaternion:
    return quaternion_from_euler_zyx(_vector(rpy))
