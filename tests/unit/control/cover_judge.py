"""An independent judge of how near the arms are: the meshes of the robot's covers, compared by FCL.

It shares neither shapes nor distance computation with :mod:`yumi.core.collision`, only the kinematics of the robot's
description, which other tests check against other libraries.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import fcl
import numpy as np

from abb_protocols.robot.description import FINGER_ORIGINS, JOINT_ORIGINS, joint_1_origin
from abb_protocols.robot.joints import Joints, Pose, Side
from abb_protocols.robot.kinematics import matrix_from_quaternion, quaternion_from_euler_zyx, tool0_to_body
from abb_view.robot_model import MESH_FOLDER
from yumi.core.collision import Obstacle

_LINKS = 7


def triangles(name: str) -> np.ndarray:
    """Of a binary STL file in metres, (n, 3, 3)."""
    content = (MESH_FOLDER / f"{name}.stl").read_bytes()[84:]
    layout = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    records = np.frombuffer(content, dtype=layout)
    return records["corners"].astype(np.float64)


def _mesh(corners: np.ndarray) -> Any:
    model = fcl.BVHModel()
    count = len(corners)
    model.beginModel(3 * count, count)
    model.addSubModel(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))
    model.endModel()
    return model


def _transform(rotation: np.ndarray, offset: np.ndarray) -> np.ndarray:
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = rotation, offset
    return result


class CoverJudge:
    """Distances of the meshes.

    Args:
        obstacles: boxes around the robot.
        opening: of the fingers [m].
    """

    def __init__(self, obstacles: Sequence[Obstacle] = (), opening: float = 0.0) -> None:
        self._parts: dict[Side, list[tuple[str, int, Any]]] = {}
        finger = triangles("finger")
        turned = finger * (-1.0, -1.0, 1.0)
        first, second = (np.array(each.xyz) for each in FINGER_ORIGINS)
        apart = np.array((opening, 0.0, 0.0))
        tool = np.concatenate([triangles("gripper"), finger + first - apart, turned + second + apart])
        for side in Side:
            parts = []
            for index in range(_LINKS):
                corners = triangles(f"link_{index + 1}")
                if index < _LINKS - 1:
                    corners = np.concatenate([corners, triangles(f"ring_{index + 1}")])
                parts.append((f"link_{index + 1}", index, fcl.CollisionObject(_mesh(corners), fcl.Transform())))
            parts.append(("gripper", _LINKS, fcl.CollisionObject(_mesh(tool), fcl.Transform())))
            self._parts[side] = parts
        body = np.concatenate([triangles("torso"), triangles("base")])
        self._fixed = [("body", fcl.CollisionObject(_mesh(body), fcl.Transform()))]
        for box in obstacles:
            place = fcl.Transform(matrix_from_quaternion(box.centre.orientation), np.array(box.centre.position))
            self._fixed.append((box.name, fcl.CollisionObject(fcl.Box(*box.size), place)))
        self._origins = {
            side: [
                _transform(matrix_from_quaternion(quaternion_from_euler_zyx(origin.rpy)), np.array(origin.xyz))
                for origin in (joint_1_origin(side), *JOINT_ORIGINS)
            ]
            for side in Side
        }

    def _place(self, side: Side, position: Joints) -> None:
        frame, frames = np.eye(4), []
        for origin, angle in zip(self._origins[side], position, strict=True):
            turn = np.eye(4)
            turn[:2, :2] = (np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle))
            frame = frame @ origin @ turn
            frames.append(frame)
        pose = tool0_to_body(side, position, Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)))
        frames.append(_transform(matrix_from_quaternion(pose.orientation), np.array(pose.position)))
        for _, index, part in self._parts[side]:
            part.setTransform(fcl.Transform(frames[index][:3, :3], frames[index][:3, 3]))

    def distance(self, positions: Mapping[Side, Joints]) -> float:
        """The smallest of all pairs that can touch; 0 or less where they do [m]."""
        for side, position in positions.items():
            self._place(side, position)
        right, left = ([part for _, _, part in self._parts[side]] for side in Side)
        body, boxes = self._fixed[0][1], [each for _, each in self._fixed[1:]]
        groups = [(right[1:], left), (right[:1], left[1:]), (right[1:] + left[1:], [body])]
        groups += [(right + left, boxes)] if boxes else []
        least = np.inf
        for first, second in groups:
            managers = fcl.DynamicAABBTreeCollisionManager(), fcl.DynamicAABBTreeCollisionManager()
            for manager, objects in zip(managers, (first, second), strict=True):
                manager.registerObjects(objects)
                manager.setup()
            data = fcl.DistanceData()
            managers[0].distance(managers[1], data, fcl.defaultDistanceCallback)
            least = min(least, float(data.result.min_distance))
        return least
