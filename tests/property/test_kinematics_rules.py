"""Rules that hold in every pose: rotations stay rotations, and the arms mirror each other."""

from __future__ import annotations

from math import isclose, pi, sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from abb_protocols.robot.joints import YUMI_LIMITS, Joints, Pose, Quaternion, Side, rotate
from abb_protocols.robot.kinematics import (
    compose_poses,
    euler_zyx,
    inverse_pose,
    quaternion_from_euler_zyx,
    quaternion_of_upper_half,
    quaternion_product,
    tool0_to_body,
    tool0_to_foot,
)

positions = st.tuples(*(st.floats(*limits) for limits in zip(YUMI_LIMITS.lower, YUMI_LIMITS.upper, strict=True)))
angles = st.floats(-pi, pi)
vectors = st.tuples(*[st.floats(-1.0, 1.0)] * 3)
rotations = st.builds(quaternion_from_euler_zyx, st.tuples(angles, st.floats(-pi / 2, pi / 2), angles))


def mirrored(position: Joints) -> Joints:
    a1, a2, a7, a3, a4, a5, a6 = position
    return (-a1, a2, -a7, a3, -a4, a5, -a6)


def agrees(a: Quaternion, b: Quaternion) -> bool:
    return isclose(abs(sum(x * y for x, y in zip(a, b, strict=True))), 1.0, abs_tol=1e-12)


@given(positions)
def test_arms_mirror_each_other_in_the_plane_between_them(position):
    left = tool0_to_body(Side.LEFT, position)
    right = tool0_to_body(Side.RIGHT, mirrored(position))
    x, y, z = left.position
    w, qx, qy, qz = left.orientation
    assert right.position == pytest.approx((x, -y, z), abs=1e-12)
    assert agrees(right.orientation, (w, -qx, qy, -qz))


@given(positions)
def test_tool_orientation_is_a_unit_quaternion_with_positive_w(position):
    orientation = tool0_to_body(Side.LEFT, position).orientation
    assert sqrt(sum(value * value for value in orientation)) == pytest.approx(1.0, abs=1e-12)
    assert orientation[0] >= 0.0


@given(positions, st.floats(-pi, pi))
def test_axis_6_turns_the_tool_about_its_own_z(position, turn):
    before, after = tool0_to_foot(position), tool0_to_foot((*position[:6], position[6] + turn))
    assert after.position == before.position
    z = (0.0, 0.0, 1.0)
    assert rotate(after.orientation, z) == pytest.approx(rotate(before.orientation, z), abs=1e-12)


@given(rotations)
def test_euler_angles_give_the_same_rotation_back(rotation):
    assert (
        agrees(quaternion_from_euler_zyx(euler_zyx(rotation)), rotation) or abs(euler_zyx(rotation)[1]) > pi / 2 - 1e-6
    )


@given(rotations, rotations, vectors)
def test_product_of_rotations_turns_by_one_after_the_other(a, b, vector):
    assert rotate(quaternion_product(a, b), vector) == pytest.approx(rotate(a, rotate(b, vector)), abs=1e-12)


@given(rotations, rotations, vectors, vectors)
def test_composed_pose_moves_points_through_both_frames(a, b, p, q):
    b_to_a, c_to_b = Pose(p, a), Pose(q, b)
    x, y, z = rotate(a, q)
    assert compose_poses(b_to_a, c_to_b).position == pytest.approx((p[0] + x, p[1] + y, p[2] + z), abs=1e-12)


@given(rotations)
def test_upper_half_keeps_the_rotation(rotation):
    assert agrees(quaternion_of_upper_half(rotation), rotation)
    assert quaternion_of_upper_half(rotation)[0] >= 0.0


@given(rotations, vectors)
def test_pose_and_its_inverse_cancel(rotation, point):
    pose = Pose(point, rotation)
    assert compose_poses(pose, inverse_pose(pose)).position == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    assert compose_poses(inverse_pose(pose), pose).position == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
