"""Arms as data: kinematics and configurations of the robots, by independent parameters and algebra."""

from __future__ import annotations

from math import degrees, pi, radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from abb_protocols.robot.arm_kinematics import KinematicArm, PathLost
from abb_protocols.robot.confdata import Confdata
from abb_protocols.robot.inverse_kinematics import arm_angle
from abb_protocols.robot.irb120 import irb120
from abb_protocols.robot.joints import YUMI_LIMITS, Joints, Side
from abb_protocols.robot.kinematics import matrix_from_quaternion, tool0_to_body
from abb_protocols.robot.rotations import rotation_vectors, rotations_about
from abb_protocols.robot.yumi_arms import irb14050, yumi_arm

Array = NDArray[np.float64]

# Denavit and Hartenberg's parameters of an IRB 120 (theta offset [deg], d [mm], a [mm], alpha [deg]), as textbooks give
# them for this kind of robot; written down for this test alone.
IRB120 = ((0, 290, 0, -90), (-90, 0, 270, 0), (0, 0, 70, -90), (0, 302, 0, 90), (0, 0, 0, -90), (180, 72, 0, 0))


def by_parameters(joints: tuple[float, ...]) -> Array:
    frame = np.eye(4)
    for angle, (offset, d, a, alpha) in zip(joints, IRB120, strict=True):
        t, k = angle + radians(offset), radians(alpha)
        frame = frame @ np.array(
            [
                [np.cos(t), -np.sin(t) * np.cos(k), np.sin(t) * np.sin(k), a * np.cos(t)],
                [np.sin(t), np.cos(t) * np.cos(k), -np.cos(t) * np.sin(k), a * np.sin(t)],
                [0.0, np.sin(k), np.cos(k), d],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )
    return frame


def within(arm: KinematicArm) -> st.SearchStrategy[Joints]:
    return st.tuples(*(st.floats(low, high) for low, high in zip(arm.limits.lower, arm.limits.upper, strict=True)))


@given(within(irb120()))
def test_irb_120_is_where_its_parameters_put_it(position: Joints) -> None:
    points, rotations = irb120().forward(np.array([position]))
    expected = by_parameters(position)
    assert points[0] * 1e3 == pytest.approx(expected[:3, 3], abs=1e-9)
    assert rotations[0] == pytest.approx(expected[:3, :3], abs=1e-12)


def test_irb_120_at_zero_looks_forward() -> None:
    pose = irb120().tool0((0.0,) * 6)  # type: ignore[arg-type]
    assert pose.position == pytest.approx((0.374, 0.0, 0.630))
    assert pose.orientation == pytest.approx((0.5**0.5, 0.0, 0.5**0.5, 0.0))


@given(within(irb120()))
def test_irb_120_finds_every_posture_of_a_pose_and_the_one_it_came_from(position: Joints) -> None:
    arm = irb120()
    found = arm.postures(arm.tool0(position), 0.0)
    expected = by_parameters(position)
    for each in found:
        assert by_parameters(each)[:3, 3] == pytest.approx(expected[:3, 3], abs=1e-6)
        assert by_parameters(each)[:3, :3] == pytest.approx(expected[:3, :3], abs=1e-6)
        assert arm.limits.outside(tuple(np.clip(each, arm.limits.lower, arm.limits.upper))) is None
    if abs(position[4]) > 1e-3:  # else axes 4 and 6 share one turn
        assert min(np.max(np.abs(np.subtract(each, position))) for each in found) < 1e-5


def test_irb_120_has_eight_branches_with_a_configuration_each() -> None:
    arm = irb120()
    found = arm.postures(arm.tool0(tuple(map(radians, (20.0, 30.0, -60.0, 40.0, 50.0, 60.0)))), 0.0)  # type: ignore[arg-type]
    assert {arm.configuration(each).cfx for each in found} >= {0, 1, 2, 3}
    assert len({arm.configuration(each) for each in found}) == len(found)


@pytest.mark.parametrize(
    ("angles", "configuration"),
    [
        ((0, 0, 0, 0, 30, 0), (0, 0, 0, 0)),
        ((-10, 0, 0, 0, 30, 0), (-1, 0, 0, 0)),
        ((100, 0, 0, 95, -30, -200), (1, 1, -3, 1)),
        ((0, 40, -100, 0, 30, 0), (0, 0, 0, 2)),
        ((0, -100, -20, 0, 30, 0), (0, 0, 0, 4)),
        ((0, -90, -100, 0, -30, 0), (0, 0, 0, 7)),
    ],
)
def test_configuration_names_quarter_turns_and_branch(
    angles: tuple[float, ...], configuration: tuple[int, int, int, int]
) -> None:
    assert irb120().configuration(tuple(map(radians, angles))) == configuration  # type: ignore[arg-type]


def test_axes_that_stand_at_zero_are_in_the_first_quarter_turn_despite_rounding() -> None:
    assert irb120().configuration((-5e-5, 0.0, 0.0, -5e-5, -5e-5, -5e-5)) == (0, 0, 0, 0)  # type: ignore[arg-type]
    assert irb120().configuration((-5e-3, 0.0, 0.0, -5e-3, -5e-3, -5e-3)) == (-1, -1, -1, 1)  # type: ignore[arg-type]


def test_posture_beside_a_border_is_of_both_configurations() -> None:
    arm, beside = irb120(), tuple(map(radians, (-0.5, 0.0, 0.0, 0.0, 30.0, 0.0)))
    assert arm.has_configuration(beside, Confdata(0, 0, 0, 0))  # type: ignore[arg-type]
    assert arm.has_configuration(beside, Confdata(-1, 0, 0, 0))  # type: ignore[arg-type]
    assert not arm.has_configuration(beside, Confdata(1, 0, 0, 0))  # type: ignore[arg-type]
    assert not arm.has_configuration(beside, Confdata(0, 0, 0, 1))  # type: ignore[arg-type]


@given(within(yumi_arm(Side.LEFT)), st.sampled_from(Side))
def test_yumi_arm_as_data_is_the_one_of_the_kinematics(position: Joints, side: Side) -> None:
    arm = yumi_arm(side)
    points, rotations = arm.forward(np.array([position]))
    pose = tool0_to_body(side, position)
    assert points[0] == pytest.approx(pose.position, abs=1e-12)
    assert rotations[0] == pytest.approx(matrix_from_quaternion(pose.orientation), abs=1e-12)
    turned = (arm.angles(np.array([position]))[0] - arm_angle(side, position) + pi) % (2.0 * pi) - pi
    assert turned == pytest.approx(0.0, abs=1e-6)


# Poses and arm angles of RobotStudio for the arm alone (reference/yumi.md §1.4), its base 140 mm below the foot.
ROBOTSTUDIO = [
    ((20.0,) * 7, (292.46, 234.73, 348.75), 6.86),
    ((30.0,) * 7, (165.49, 290.86, 255.37), 14.50),
    ((-40.0,) * 7, (-219.17, 12.62, 796.12), 106.67),
    ((104, -31, 1, -18, -55, 117, 69), (32.02, 91.43, 763.94), 19.58),
    ((162, 1, -23, -88, 241, 98, -44), (45.84, 32.22, 846.74), 80.07),
]


@pytest.mark.parametrize(("angles", "point_mm", "angle_deg"), ROBOTSTUDIO)
def test_irb_14050_is_where_robotstudio_puts_it(
    angles: tuple[float, ...], point_mm: tuple[float, float, float], angle_deg: float
) -> None:
    arm, joints = irb14050(), np.radians([angles])
    points, _ = arm.forward(joints)
    assert points[0] * 1e3 + (0.0, 0.0, 140.0) == pytest.approx(point_mm, abs=0.01)
    assert degrees(arm.angles(joints)[0]) == pytest.approx(angle_deg, abs=0.01)


def test_irb_14050_finds_the_posture_it_came_from() -> None:
    arm = irb14050()
    position = tuple(map(radians, (20.0, -80.0, -100.0, 15.0, 40.0, 50.0, 10.0)))
    found = arm.postures(arm.tool0(position), float(arm.angles(np.array([position]))[0]))  # type: ignore[arg-type]
    assert min(np.max(np.abs(np.subtract(each, position))) for each in found) < 1e-6


def test_path_is_followed_without_a_change_of_the_branch() -> None:
    arm = yumi_arm(Side.RIGHT)
    start = np.radians([20.0, -100.0, -110.0, 20.0, 0.0, 60.0, 0.0])
    goal = start + 0.3
    joints = start + np.linspace(0.0, 1.0, 60)[:, None] * (goal - start)
    points, rotations = arm.forward(joints)
    followed = arm.follow(points, rotations, np.unwrap(arm.angles(joints)), tuple(start.tolist()))
    assert followed == pytest.approx(joints, abs=1e-6)


def test_path_that_leaves_the_reach_is_lost_there() -> None:
    arm = irb120()
    points, rotations = arm.forward(np.array([arm.home]))
    away = points + np.outer(np.linspace(0.0, 1.0, 100), (1.0, 0.0, 0.0))
    with pytest.raises(PathLost) as lost:
        arm.follow(away, np.repeat(rotations, 100, 0), np.zeros(100), arm.home)
    assert 5 < lost.value.index < 50


@given(st.tuples(*(st.floats(-1.7, 1.7) for _ in range(3))))
def test_rotations_and_their_vectors_are_each_others_inverse(vector: tuple[float, float, float]) -> None:
    back = rotation_vectors(rotations_about(np.array([vector])))[0]
    assert back == pytest.approx(vector, abs=1e-6)


def test_limits_of_the_yumi_are_those_of_its_joints() -> None:
    assert yumi_arm(Side.LEFT).limits == YUMI_LIMITS
