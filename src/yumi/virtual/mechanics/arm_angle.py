"""The arm angle: how far the elbow is turned about the line from shoulder to wrist, ``eax_a`` of a robtarget."""

from __future__ import annotations

from math import atan2, degrees, pi

import numpy as np
from numpy.typing import NDArray

from yumi.robot.joints import Joints, Side
from yumi.robot.kinematics import foot_to_body, multiply, rotate, tool0_to_body

_SHOULDER_HEIGHT = 0.166
_WRIST_TO_TOOL0 = 0.036


def arm_angle_deg(side: Side, position: Joints) -> float:
    """Arm angle as RAPID writes it [deg], -180 to 180, at joint positions [rad] (reference/yumi.md §5.2)."""
    foot, tool0 = foot_to_body(side), tool0_to_body(side, position)
    shoulder = np.add(foot.position, rotate(foot.orientation, (0.0, 0.0, _SHOULDER_HEIGHT)))
    wrist = np.add(tool0.position, rotate(tool0.orientation, (0.0, 0.0, -_WRIST_TO_TOOL0)))
    line = _unit(wrist - shoulder)
    y_axis = _unit(np.cross(line, (0.0, 1.0 if side is Side.RIGHT else -1.0, 0.0)))
    x_axis = np.cross(y_axis, line)
    # The direction of the elbow's axis in the body frame: a quarter turn of that joint turns the tool about it.
    a1, a2, a7, a3, a4, a5, a6 = position
    after = tool0_to_body(side, (a1, a2, a7, a3 + pi / 2.0, a4, a5, a6))
    w, x, y, z = tool0.orientation
    turn = multiply(after.orientation, (w, -x, -y, -z))
    # A quaternion and its negative are the same turn; the one with a positive scalar part turns by +90 degrees.
    elbow = _unit(np.copysign(1.0, turn[0]) * np.array(turn[1:]))
    angle = atan2(float(y_axis @ elbow), float(x_axis @ elbow)) + pi / 2.0
    return degrees(angle - 2.0 * pi if angle > pi else angle)


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    return vector / float(np.linalg.norm(vector))
