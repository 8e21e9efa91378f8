"""The URDF, read by a plain chain of matrices, puts the tool exactly where the closed formula does."""

from __future__ import annotations

from functools import lru_cache
from math import cos, sin
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abb_protocols.robot.joints import YUMI_LIMITS, Side, joint_names, rotate
from abb_protocols.robot.kinematics import tool0_to_body
from abb_protocols.robot.urdf import robot_description

positions = st.tuples(*(st.floats(*limits) for limits in zip(YUMI_LIMITS.lower, YUMI_LIMITS.upper, strict=True)))


def turn(axis: int, angle: float) -> np.ndarray:
    matrix = np.eye(4)
    a, b = (axis + 1) % 3, (axis + 2) % 3
    matrix[a, a] = matrix[b, b] = cos(angle)
    matrix[b, a], matrix[a, b] = sin(angle), -sin(angle)
    return matrix


@lru_cache
def chain(side: Side) -> list[np.ndarray]:
    joints = {element.get("name"): element for element in ET.fromstring(robot_description()).findall("joint")}
    return [
        origin(joints[name])
        for name in (*joint_names(side), *(f"yumi_{name}_{side.value}_joint" for name in ("flange", "tool0")))
    ]


def origin(joint: ET.Element) -> np.ndarray:
    roll, pitch, yaw = map(float, joint.find("origin").get("rpy").split())
    matrix = turn(2, yaw) @ turn(1, pitch) @ turn(0, roll)
    matrix[:3, 3] = [float(value) for value in joint.find("origin").get("xyz").split()]
    return matrix


def tool0_of_urdf(side: Side, position: tuple[float, ...]) -> np.ndarray:
    frame = np.eye(4)
    for matrix, angle in zip(chain(side), (*position, 0.0, 0.0), strict=True):
        frame = frame @ matrix @ turn(2, angle)
    return frame


@pytest.mark.parametrize("side", list(Side))
@given(position=positions)
def test_urdf_and_formula_agree_on_tool0(side, position):
    frame, pose = tool0_of_urdf(side, position), tool0_to_body(side, position)
    assert frame[:3, 3] == pytest.approx(pose.position, abs=1e-9)
    for column, axis in enumerate(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))):
        assert frame[:3, column] == pytest.approx(rotate(pose.orientation, axis), abs=1e-9)
