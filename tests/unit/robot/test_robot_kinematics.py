"""Forward kinematics against RobotStudio's poses and the robot's home target (reference/yumi.md §1.4-1.5)."""

from __future__ import annotations

from math import degrees, radians

import pytest

from abb_protocols.robot.joints import Joints, Pose, Side, home, joints
from abb_protocols.robot.kinematics import (
    euler_zyx,
    foot_to_body,
    matrix_from_quaternion,
    quaternion_from_matrix,
    tool0_to_body,
    tool0_to_foot,
)

STAND = 0.140  # RobotStudio's single arm stands on a base that raises its foot [m]

ROBOTSTUDIO = [
    ((0, 0, 0, 0, 0, 0, 0), (341.50, 0, 598.00), (0, 90, 0)),
    ((20,) * 7, (292.46, 234.73, 348.75), (148.67, 16.13, 175.45)),
    ((30,) * 7, (165.49, 290.86, 255.37), (157.34, -19.80, -175.99)),
    ((-40,) * 7, (-219.17, 12.62, 796.12), (13.67, -3.39, -152.29)),
    ((-80,) * 7, (-126.60, 499.23, 441.88), (5.30, 17.08, 34.27)),
    ((104, -31, 1, -18, -55, 117, 69), (32.02, 91.43, 763.94), (157.59, 43.43, 170.70)),
    ((162, 1, -23, -88, 241, 98, -44), (45.84, 32.22, 846.74), (-98.58, 43.30, -76.21)),
    ((-20, -139, -144, 77, -263, 128, -104), (-47.12, -136.89, 270.77), (-106.88, -60.36, 122.56)),
    ((67, -142, 121, 78, -38, 113, -194), (-100.23, 3.25, 338.01), (43.05, -59.81, 44.29)),
    ((-58, -138, -35, 70, -283, 133, 207), (-123.66, 141.01, 425.04), (-118.25, -37.89, -10.09)),
]

BODY = [
    ((0, -130, 135, 30, 0, 40, 0), (-9.578, 182.610, 198.628), (0.066011, 0.842421, -0.111215, 0.523069)),
    ((0, 0, 0, 0, 0, 0, 0), (567.822, -4.731, 415.132), (0.297604, -0.067327, 0.874615, -0.376760)),
    ((0, -130, 135, 30, 0, 30, 0), (-16.616, 184.492, 195.719), (0.056067, 0.884804, -0.116545, 0.447657)),
]


def rad(angles_deg: tuple[float, ...]) -> Joints:
    return joints([radians(angle) for angle in angles_deg])


def mm(pose: Pose) -> tuple[float, ...]:
    return tuple(value * 1000 for value in pose.position)


@pytest.mark.parametrize(("angles_deg", "point_mm", "rpy_deg"), ROBOTSTUDIO)
def test_tool0_is_where_robotstudio_puts_it(angles_deg, point_mm, rpy_deg):
    pose = tool0_to_foot(rad(angles_deg))
    x, y, z = pose.position
    assert (x * 1e3, y * 1e3, (z + STAND) * 1e3) == pytest.approx(point_mm, abs=0.0062)
    if angles_deg != (0,) * 7:  # pitch 90°: roll and yaw are one
        assert [degrees(angle) for angle in euler_zyx(pose.orientation)] == pytest.approx(rpy_deg, abs=0.0055)


def test_tool_points_forward_when_all_joints_are_zero():
    assert tool0_to_foot((0.0,) * 7).orientation == pytest.approx((0.5**0.5, 0.0, 0.5**0.5, 0.0))


@pytest.mark.parametrize(("angles_deg", "point_mm", "orientation"), BODY)
def test_left_tool0_is_where_the_controller_puts_it(angles_deg, point_mm, orientation):
    pose = tool0_to_body(Side.LEFT, rad(angles_deg))
    assert mm(pose) == pytest.approx(point_mm, abs=1e-3)
    assert pose.orientation == pytest.approx(orientation, abs=1.5e-6)


@pytest.mark.parametrize(("angles_deg", "point_mm", "orientation"), BODY)
def test_right_tool0_mirrors_the_left_when_axis_7_changes_sign(angles_deg, point_mm, orientation):
    a1, a2, a7, *rest = angles_deg
    pose = tool0_to_body(Side.RIGHT, rad((a1, a2, -a7, *rest)))
    x, y, z = point_mm
    qw, qx, qy, qz = orientation
    assert mm(pose) == pytest.approx((x, -y, z), abs=1e-3)
    assert pose.orientation == pytest.approx((qw, -qx, qy, -qz), abs=1.5e-6)


def test_home_pose_agrees_with_the_home_target_of_the_right_arm():
    assert mm(tool0_to_body(Side.RIGHT, home(Side.RIGHT))) == pytest.approx((-9.578, -182.610, 198.628), abs=1e-3)


@pytest.mark.parametrize(("side", "mirror"), [(Side.LEFT, 1), (Side.RIGHT, -1)])
def test_foot_has_the_orientation_of_the_motion_configuration(side, mirror):
    expected = (0.828884, mirror * -0.314016, 0.408008, mirror * -0.218802)
    assert foot_to_body(side).orientation == pytest.approx(expected, abs=1e-6)
    assert foot_to_body(side).position == (0.0, mirror * 0.050, 0.384)


def test_tool_frame_is_carried_by_tool0():
    finger_tip = Pose((0.0, 0.0, 0.1142), (1.0, 0.0, 0.0, 0.0))
    x, y, z = tool0_to_foot((0.0,) * 7, finger_tip).position  # tool z is foot x in the all-zero pose
    assert (x, y, z) == pytest.approx((0.3415 + 0.1142, 0.0, 0.458))


@pytest.mark.parametrize(
    "orientation",
    [(1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.6, 0.0, 0.8), (0.5, -0.5, 0.5, -0.5), (0.1, 0.7, 0.1, 0.7)],
)
def test_a_rotation_matrix_gives_its_quaternion_back(orientation):
    found = quaternion_from_matrix(matrix_from_quaternion(orientation))
    assert abs(sum(a * b for a, b in zip(found, orientation, strict=True))) == pytest.approx(1.0)
    assert found[0] >= 0.0
