"""The arm angle: how far the elbow is turned about the line from shoulder to wrist, ``eax_a`` of a robtarget."""

from __future__ import annotations

from math import atan2, degrees, pi, sqrt

from yumi.robot.joints import Joints, Side
from yumi.robot.kinematics import foot_to_body, multiply, rotate, tool0_to_body
from yumi.robot.values import Quaternion, Vector

_SHOULDER_HEIGHT = 0.166
_WRIST_TO_TOOL0 = 0.036


def arm_angle(side: Side, position: Joints) -> float:
    """Arm angle [rad] at joint positions [rad], between -pi and pi (reference/yumi.md §5.2)."""
    foot, tool0 = foot_to_body(side), tool0_to_body(side, position)
    shoulder = _sum(foot.position, rotate(foot.orientation, (0.0, 0.0, _SHOULDER_HEIGHT)))
    wrist = _sum(tool0.position, rotate(tool0.orientation, (0.0, 0.0, -_WRIST_TO_TOOL0)))
    line = _unit(_difference(wrist, shoulder))
    across = (0.0, 1.0 if side is Side.RIGHT else -1.0, 0.0)
    y_axis = _unit(_cross(line, across))
    x_axis = _cross(y_axis, line)
    elbow = _elbow_axis(side, position)
    angle = atan2(_dot(y_axis, elbow), _dot(x_axis, elbow)) + pi / 2.0
    return angle - 2.0 * pi if angle > pi else angle


def arm_angle_deg(side: Side, position: Joints) -> float:
    """Arm angle as RAPID writes it [deg], at joint positions [rad]."""
    return degrees(arm_angle(side, position))


def _elbow_axis(side: Side, position: Joints) -> Vector:
    """Direction of the elbow's axis in the body frame: a quarter turn of that joint turns the tool about it."""
    a1, a2, a7, a3, a4, a5, a6 = position
    before = tool0_to_body(side, position).orientation
    after = tool0_to_body(side, (a1, a2, a7, a3 + pi / 2.0, a4, a5, a6)).orientation
    w, x, y, z = multiply(after, _conjugate(before))
    # A quaternion and its negative are the same turn; the one with a positive scalar part turns by +90 degrees.
    return _unit((x, y, z) if w > 0.0 else (-x, -y, -z))


def _conjugate(rotation: Quaternion) -> Quaternion:
    w, x, y, z = rotation
    return (w, -x, -y, -z)


def _sum(a: Vector, b: Vector) -> Vector:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def _difference(a: Vector, b: Vector) -> Vector:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Vector, b: Vector) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _unit(vector: Vector) -> Vector:
    length = sqrt(_dot(vector, vector))
    return (vector[0] / length, vector[1] / length, vector[2] / length)
