"""The fast step of the inverse kinematics: exact where the arm is free, bounded where its axes are in line."""

from __future__ import annotations

from math import degrees, hypot

import numpy as np
import pytest

from abb_protocols.robot.differential_kinematics import (
    DifferentialSolver,
    posture_near,
    target_error,
    wrist_of,
    wrist_target,
)
from abb_protocols.robot.inverse_kinematics import arm_angle, jacobian
from abb_protocols.robot.joints import YUMI_LIMITS, Joints, Side, home, joints
from abb_protocols.robot.kinematics import foot_to_body, matrix_from_quaternion, tool0_to_body
from unit.robot.test_robot_inverse_kinematics import random_postures
from unit.robot.test_robot_kinematics import rad

POSTURE = rad((20, -90, -110, 10, 30, 60, 10))


def test_the_wrist_of_a_posture_is_that_of_its_pose_and_arm_angle() -> None:
    for side, position in random_postures(1500, 50):
        target = wrist_target(side, tool0_to_body(side, position), arm_angle(side, position))
        assert max(map(abs, target_error(wrist_of(side, position), target))) < 1e-12


def test_derivatives_are_those_of_forward_kinematics() -> None:
    step = 1e-6
    for side, position in random_postures(1501, 30):
        now = wrist_of(side, position)
        foot = matrix_from_quaternion(foot_to_body(side).orientation)
        assert foot @ np.array(now.rotation) == pytest.approx(jacobian(side, position)[3:], abs=1e-12)
        found = np.array([*now.velocity, *now.rotation, now.elbow])
        for index in range(7):
            ahead, back = list(position), list(position)
            ahead[index] += step
            back[index] -= step
            target = wrist_target(side, tool0_to_body(side, joints(ahead)), arm_angle(side, joints(ahead)))
            change = np.array(target_error(wrist_of(side, joints(back)), target)) / (2.0 * step)
            assert change == pytest.approx(found[:, index], rel=1e-6, abs=1e-6)


def test_a_seeded_solve_ends_at_the_posture() -> None:
    for side, position in [(Side.RIGHT, POSTURE), (Side.LEFT, home(Side.LEFT))]:
        target = wrist_target(side, tool0_to_body(side, position), arm_angle(side, position))
        seed = joints([value + (0.03 if index % 2 else -0.03) for index, value in enumerate(position)])
        found, miss = posture_near(side, target, seed)
        assert miss < 1e-11
        assert found == pytest.approx(position, abs=1e-9)


def test_independence_is_the_smallest_singular_value() -> None:
    now = wrist_of(Side.RIGHT, POSTURE)
    weighted = np.concatenate([4.0 * np.array(now.velocity), np.array(now.rotation)])
    expected = np.linalg.svd(weighted, compute_uv=False)[-1]
    solver = DifferentialSolver(now)
    for _ in range(20):
        solver = DifferentialSolver(now, weakest=solver.weakest)
    assert solver.independence == pytest.approx(expected, rel=1e-3)


def test_a_change_keeps_locked_joints() -> None:
    now = wrist_of(Side.RIGHT, POSTURE)
    change = DifferentialSolver(now, locked=(2,)).change((0.001, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert change[2] == 0.0
    moved = wrist_of(Side.RIGHT, joints([a + b for a, b in zip(POSTURE, change, strict=True)]))
    assert np.subtract(moved.wrist, now.wrist) == pytest.approx([0.001, 0.0, 0.0], abs=2e-6)
    assert degrees(abs(moved.angle - now.angle)) > 0.01  # what is left of the freedom is the elbow's


@pytest.mark.parametrize("posture_deg", [(20, -90, -110, 10, 30, 0, 10), (20, 0, -110, 10, 30, 60, 10)])
def test_no_joint_jumps_where_axes_are_in_line(posture_deg: tuple[float, ...]) -> None:
    position: Joints = rad(posture_deg)
    for number in range(200):
        generator = np.random.default_rng(number)
        wanted = generator.normal(size=7)
        wanted *= 0.001 / hypot(*wanted)
        near = joints([value + offset for value, offset in zip(position, generator.normal(0, 1e-3, 7), strict=True)])
        change = DifferentialSolver(wrist_of(Side.RIGHT, near)).change(tuple(wanted.tolist()))
        assert max(map(abs, change)) < 0.06


def test_the_weakest_direction_is_limited() -> None:
    stretched = rad((0, -60, -90, -89, 0, 60, 0))
    now = wrist_of(Side.RIGHT, stretched)
    solver = DifferentialSolver(now)
    for _ in range(20):
        solver = DifferentialSolver(now, weakest=solver.weakest)
    outward = np.array(now.wrist) - (0.0, 0.0, 0.166)
    outward *= 0.01 / np.linalg.norm(outward)
    wanted = (*outward.tolist(), 0.0, 0.0, 0.0, 0.0)
    free, limited = solver.change(wanted), solver.change(wanted, most=0.01)
    assert max(map(abs, limited)) < max(map(abs, free))
    assert max(map(abs, limited)) < 0.05
    assert YUMI_LIMITS.outside(stretched) is None
