"""Forward kinematics of a URDF by matrices, written from the format's definition and from nothing of ours."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]


def rotation(axis: Matrix, angle: float) -> Matrix:
    """Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turned: Matrix = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    return turned


def numbers(text: str | None) -> Matrix:
    return np.array([float(word) for word in (text or "0 0 0").split()])


def links_to_root(urdf: str, positions: Mapping[str, float]) -> dict[str, Matrix]:
    """Each link's frame seen from the root, (4, 4), with the joints at ``positions`` [rad] or [m]."""
    robot = ElementTree.fromstring(urdf)
    joints = {joint.find("child").get("link"): joint for joint in robot.iter("joint")}
    poses: dict[str, Matrix] = {}

    def pose(link: str) -> Matrix:
        if link not in joints:
            return np.eye(4)
        if link in poses:
            return poses[link]
        joint = joints[link]
        origin, axis, mimic = joint.find("origin"), joint.find("axis"), joint.find("mimic")
        place, moved = np.eye(4), np.eye(4)
        roll, pitch, yaw = numbers(origin.get("rpy"))
        x, y, z = np.eye(3)
        place[:3, :3] = rotation(z, yaw) @ rotation(y, pitch) @ rotation(x, roll)
        place[:3, 3] = numbers(origin.get("xyz"))
        kind = joint.get("type")
        if kind != "fixed":
            value = positions[joint.get("name") if mimic is None else mimic.get("joint")]
            along = numbers(axis.get("xyz"))
            if kind == "prismatic":
                moved[:3, 3] = along * value
            else:
                moved[:3, :3] = rotation(along, value)
        poses[link] = pose(joint.find("parent").get("link")) @ place @ moved
        return poses[link]

    return {link.get("name"): pose(link.get("name")) for link in robot.iter("link")}


def matrix(position: tuple[float, ...], orientation: tuple[float, ...]) -> Matrix:
    """A pose of position and quaternion w, x, y, z as a matrix, (4, 4)."""
    w, x, y, z = orientation
    pose = np.eye(4)
    pose[:3, 3] = position
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return pose
