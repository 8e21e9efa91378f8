"""Named joint positions of the robot."""

from __future__ import annotations

from math import radians

from yumi.robot.joints import Joints, Side, joints


def home(side: Side) -> Joints:
    """The calibration pose (``cal_position`` of the controller): both arms folded in front of the body [rad]."""
    axis_7_deg = -135.0 if side is Side.RIGHT else 135.0
    return joints([radians(angle_deg) for angle_deg in (0.0, -130.0, axis_7_deg, 30.0, 0.0, 40.0, 0.0)])
