"""Judges motions by other shapes and another library than ours: the meshes that are shown, with Pinocchio and Coal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np
import pytest

from abb_protocols.robot.joints import Joints, Side, joint_names
from abb_protocols.robot.kinematics import matrix_from_quaternion
from abb_protocols.robot.urdf import robot_description
from abb_view.robot_model import MESH_FOLDER
from yumi.core.collision import Obstacle
from yumi.planning.scene_description import disabled_pairs


class MeshJudge:
    """How near the meshes of the robot and of boxes are to each other.

    Links of one arm that are neighbours are not looked at, nor the body and the two links that turn within it. The
    links are their meshes' convex hulls, which contain them; the body is its mesh.

    Args:
        obstacles: boxes that stand about.
    """

    def __init__(self, obstacles: Sequence[Obstacle] = ()) -> None:
        self._pin = pin = pytest.importorskip("pinocchio", reason="pip install yumi-ros2[planning]")
        coal = pytest.importorskip("coal")
        urdf = robot_description(meshes=f"file://{MESH_FOLDER}")
        self._model = pin.buildModelFromXML(urdf)
        shapes = pin.buildGeomFromUrdfString(self._model, urdf, pin.GeometryType.VISUAL)
        links = [self._model.frames[shape.parentFrame].name for shape in shapes.geometryObjects]
        for shape, link in zip(shapes.geometryObjects, links, strict=True):
            if link != "yumi_body":
                shape.geometry.buildConvexHull(True, "Qt")
                shape.geometry = shape.geometry.convex
        for obstacle in obstacles:
            pose = pin.SE3(matrix_from_quaternion(obstacle.centre.orientation), np.array(obstacle.centre.position))
            shapes.addGeometryObject(pin.GeometryObject(obstacle.name, 0, pose, coal.Box(*obstacle.size)))
            links.append("yumi_body")
        ignored = {frozenset(pair[:2]) for pair in disabled_pairs()}
        for first, second in combinations(range(len(links)), 2):
            pair = frozenset((links[first], links[second]))
            if len(pair) == 2 and pair not in ignored:
                shapes.addCollisionPair(pin.CollisionPair(first, second))
        self._names = [shape.name for shape in shapes.geometryObjects]
        self._shapes, self._data, self._shape_data = shapes, self._model.createData(), shapes.createData()

    def distance(self, positions: Mapping[Side, Joints]) -> tuple[float, str, str]:
        """The smallest distance [m], not positive where shapes touch, and the two shapes."""
        pin: Any = self._pin
        values = pin.neutral(self._model)
        for side, position in positions.items():
            for name, value in zip(joint_names(side), position, strict=True):
                values[self._model.joints[self._model.getJointId(name)].idx_q] = value
        pin.computeDistances(self._model, self._data, self._shapes, self._shape_data, values)
        distances = [result.min_distance for result in self._shape_data.distanceResults]
        nearest = int(np.argmin(distances))
        pair = self._shapes.collisionPairs[nearest]
        return float(distances[nearest]), self._names[pair.first], self._names[pair.second]
