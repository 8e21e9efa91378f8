"""Every posture of a pose and an arm angle is found and has them; continuing from a posture stays on its branch."""

from __future__ import annotations

from dataclasses import replace
from math import degrees, dist, pi, radians
from time import perf_counter

import numpy as np
import pytest

from abb_protocols.catalogue import message
from abb_protocols.robot.confdata import configuration
from abb_protocols.robot.inverse_kinematics import (
    TO_WRIST,
    Unreachable,
    arm_angle,
    jacobian,
    nearest_posture,
    nearest_reachable_posture,
    postures,
    postures_of_each,
    unreachable,
)
from abb_protocols.robot.joints import YUMI_LIMITS, Joints, Pose, Side, home, joints
from abb_protocols.robot.kinematics import matrix_from_quaternion, tool0_to_body
from refusals import assert_says, refused
from soak import long, short, tell
from unit.robot.test_robot_kinematics import ROBOTSTUDIO, rad

# Arm angles of RobotStudio's poses, counted from z and from y of the single arm's base (reference/yumi.md §1.4) [deg].
ARM_ANGLES = [
    (0, 90),
    (6.86, 105.54),
    (14.50, 99.26),
    (106.67, 15.68),
    (99.01, -26.00),
    (19.58, -165.56),
    (80.07, -131.03),
    (139.68, -15.92),
    (-146.69, 119.74),
    (165.86, 50.38),
]

BATCH = 500


def random_postures(seed: int, count: int) -> list[tuple[Side, Joints]]:
    generator = np.random.default_rng(seed)
    values = generator.uniform(YUMI_LIMITS.lower, YUMI_LIMITS.upper, (count, 7))
    return [(tuple(Side)[index % 2], joints(each)) for index, each in enumerate(values.tolist())]


def errors(side: Side, position: Joints, pose: Pose, angle: float) -> tuple[float, float, float]:
    """What a posture misses of a pose [m], [rad] and of an arm angle [rad]."""
    actual = tool0_to_body(side, position)
    distance = float(np.linalg.norm(np.subtract(actual.position, pose.position)))
    turn = matrix_from_quaternion(actual.orientation) @ matrix_from_quaternion(pose.orientation).T
    return (
        distance,
        float(np.linalg.norm(turn - np.eye(3))),
        abs((arm_angle(side, position) - angle + pi) % (2 * pi) - pi),
    )


@pytest.mark.parametrize("side", Side)
@pytest.mark.parametrize("count", [short(25), long(100_000, 3 * 3600.0)])
def test_postures_of_a_pose_contain_the_one_it_was_made_from(side: Side, count: int) -> None:
    generator = np.random.default_rng(14000 + (side is Side.LEFT))
    begin, found = perf_counter(), 0
    for batch in range(0, count, BATCH):
        values = generator.uniform(YUMI_LIMITS.lower, YUMI_LIMITS.upper, (min(BATCH, count - batch), 7))
        positions = [joints(each) for each in values.tolist()]
        poses = [tool0_to_body(side, position) for position in positions]
        angles = [arm_angle(side, position) for position in positions]
        solutions = postures_of_each(side, poses, angles)
        for position, pose, angle, own in zip(positions, poses, angles, solutions, strict=True):
            assert min(np.max(np.abs(np.subtract(each, position))) for each in own) < 1e-6, position
            for each in own:
                assert YUMI_LIMITS.outside(each) is None
                assert max(errors(side, each, pose, angle)) < 1e-9, (position, each)
            found += len(own)
        if count > BATCH and batch % (20 * BATCH) == 0:
            done = batch + len(positions)
            tell(f"{side.word}: {done} postures, {found / done:.1f} solutions and ")
            tell(f"{(perf_counter() - begin) / done * 1e3:.1f} ms each")


@pytest.mark.parametrize(("beyond", "count"), [(0.0, 1), (8e-9, 0), (-8e-9, 1)])
def test_no_posture_is_beyond_a_limit_by_ever_so_little(beyond: float, count: int) -> None:
    limit = YUMI_LIMITS.lower[4]
    position = (-0.7951414, 0.5308771, -0.2870791, -1.7514163, limit - beyond, 0.8505248, 1.0)
    pose = tool0_to_body(Side.LEFT, position)
    found = postures(Side.LEFT, pose, arm_angle(Side.LEFT, position))
    assert all(YUMI_LIMITS.outside(each) is None for each in found)
    assert sum(np.max(np.abs(np.subtract(each, position))) < 1e-6 for each in found) == count


def test_many_poses_at_once_have_the_postures_of_each_alone() -> None:
    side, positions = Side.LEFT, [position for _, position in random_postures(3, 6)]
    poses = [tool0_to_body(side, position) for position in positions]
    poses.append(Pose((2.0, 0.0, 0.5), (1.0, 0.0, 0.0, 0.0)))
    angles = [*(arm_angle(side, position) for position in positions), 0.0]
    for pose, angle, found in zip(poses, angles, postures_of_each(side, poses, angles), strict=True):
        alone = postures(side, pose, angle)
        assert len(found) == len(alone)
        assert np.array(found).reshape(-1, 7) == pytest.approx(np.array(alone).reshape(-1, 7), abs=1e-6)
    assert postures_of_each(side, [], []) == []


NEARLY_SINGULAR = [
    # Pairs of postures 0.5 rad and 0.005 rad apart, on a curve along which the arm angle hardly changes.
    (Side.RIGHT, (-17.867938, -0.504788, -38.620213, -64.421015, 134.364291, 93.376178, 169.965113)),
    (Side.LEFT, (-131.862, -126.158, 135.071, -73.957, 127.263, 0.627, -57.722)),
    (Side.LEFT, (102.38, 0.9, -113.06, 75.13, -177.29, 49.74, 101.05)),
    (Side.RIGHT, (156.45, -142.6, -4.86, 23.71, -180.14, -4.74, 205.2)),
    (Side.RIGHT, (10.0, 0.001, 20.0, 30.0, 40.0, 50.0, 60.0)),
    (Side.LEFT, (10.0, -70.0, 20.0, 30.0, 40.0, 0.001, 60.0)),
    (Side.LEFT, (10.0, -70.0, 20.0, -89.99, 40.0, 30.0, 60.0)),
    # Not singular, but one of the two equations is so steep there that not every start in its cell leads to it.
    (Side.LEFT, (-80.312626, -142.084747, -163.557562, 76.396862, -190.617711, 72.754817, -29.889153)),
    # Nor this one, but both equations say nearly the same there: Newton's steps lead away.
    (
        Side.RIGHT,
        (-142.043481916, -1.068310123, -57.032862458, -66.398821082, -103.923956598, 83.402974991, -196.967971122),
    ),
]


@pytest.mark.parametrize(("side", "posture_deg"), NEARLY_SINGULAR)
def test_postures_close_to_a_singularity_are_told_apart(side: Side, posture_deg: tuple[float, ...]) -> None:
    position = rad(posture_deg)
    found = postures(side, tool0_to_body(side, position), arm_angle(side, position))
    assert min(np.max(np.abs(np.subtract(each, position))) for each in found) < 1e-6


def test_joints_that_turn_further_than_once_appear_with_each_turn() -> None:
    position = rad((10, -70, 20, 30, -100, 30, 170))
    found = postures(Side.LEFT, tool0_to_body(Side.LEFT, position), arm_angle(Side.LEFT, position))
    turns = {(round(degrees(each[4])), round(degrees(each[6]))) for each in found if abs(each[0] - position[0]) < 1e-6}
    assert turns == {(-100, 170), (260, 170), (-100, -190), (260, -190)}


@pytest.mark.parametrize("side", Side)
def test_home_has_the_arm_angle_of_the_controllers_home_target(side: Side) -> None:
    mirror = -1.0 if side is Side.RIGHT else 1.0
    assert degrees(arm_angle(side, home(side))) == pytest.approx(mirror * 101.964427, abs=1e-4)


@pytest.mark.parametrize(("row", "angles_deg"), list(zip(ROBOTSTUDIO, ARM_ANGLES, strict=True)))
def test_arm_angle_is_robotstudios(row, angles_deg) -> None:
    for axis, expected in zip(((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)), angles_deg, strict=True):
        chain = replace(TO_WRIST[Side.RIGHT], reference=axis)
        angle = degrees(chain.angles(np.array([rad(row[0])]))[0])
        assert (angle - expected + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=0.0055)


def test_a_pose_out_of_reach_has_no_posture() -> None:
    far = Pose((2.0, 0.0, 0.5), (1.0, 0.0, 0.0, 0.0))
    assert postures(Side.LEFT, far, 0.0) == ()
    with refused(Unreachable, "pose_not_reached", arm="left"):
        nearest_posture(Side.LEFT, far, 0.0, home(Side.LEFT))


@pytest.mark.parametrize("side", Side)
def test_the_posture_that_is_nearest_to_a_pose_out_of_reach_is_found(side: Side) -> None:
    reached, out = [], []
    for _, position in random_postures(7, 5):
        pose = tool0_to_body(side, position)
        far = Pose((1.6 * pose.position[0], 1.6 * pose.position[1], 1.6 * pose.position[2]), pose.orientation)
        reached.append(dist(nearest_reachable_posture(side, pose, home(side))[1].position, pose.position))
        found, there = nearest_reachable_posture(side, far, home(side))
        assert YUMI_LIMITS.outside(found) is None
        assert there == tool0_to_body(side, found)
        others = [tool0_to_body(side, each).position for _, each in random_postures(8, 500)]
        out.append((dist(there.position, far.position), min(dist(each, far.position) for each in others)))
    assert max(reached) < 1e-6
    assert all(found < other + 0.02 for found, other in out)  # of those, none has the orientation


def test_a_pose_that_is_reached_with_another_arm_angle_says_with_which() -> None:
    position = random_postures(9, 1)[0][1]
    reason = message("text", text="No posture.")
    error = unreachable(Side.RIGHT, tool0_to_body(Side.RIGHT, position), reason, home(Side.RIGHT))
    assert error.nearest is not None
    assert_says(error.said, "nearest_arm_angle", reason=reason, angle=arm_angle(Side.RIGHT, error.nearest))


def test_a_posture_out_of_range_is_refused_with_its_joint() -> None:
    beyond = rad((0, -130, 135, 30, 0, 137, 0))
    pose = tool0_to_body(Side.LEFT, joints([*beyond[:5], radians(139.0), beyond[6]]))
    angle = arm_angle(Side.LEFT, joints([*beyond[:5], radians(139.0), beyond[6]]))
    limits = {"lower": YUMI_LIMITS.lower[5], "upper": YUMI_LIMITS.upper[5]}
    with refused(Unreachable, "pose_beyond_range", arm="left", joint=6, **limits) as caught:
        nearest_posture(Side.LEFT, pose, angle, beyond)
    assert caught.value.said.values["position"] == pytest.approx(radians(139.0), abs=1e-4)


@pytest.mark.parametrize("side", Side)
def test_continuing_from_a_posture_follows_its_branch(side: Side) -> None:
    start, seed = np.add(home(side), 0.1), joints(np.add(home(side), 0.1))
    for step in range(1, 101):
        on_path = joints(start + 0.008 * step * np.array([0.3, -0.2, 0.1, 0.3, 0.2, -0.3, 0.1]))
        seed = nearest_posture(side, tool0_to_body(side, on_path), arm_angle(side, on_path), seed)
        assert seed == pytest.approx(on_path, abs=1e-9)


@pytest.mark.parametrize(("side", "position"), random_postures(7, 6))
@pytest.mark.parametrize("tool", [None, Pose((0.01, -0.02, 0.114), (0.6, 0.0, 0.8, 0.0))])
def test_jacobian_is_the_derivative_of_the_tools_pose(side: Side, position: Joints, tool: Pose | None) -> None:
    derivative, step = jacobian(side, position, tool), 1e-6
    for joint in range(7):
        ahead, back = list(position), list(position)
        ahead[joint], back[joint] = position[joint] + step, position[joint] - step
        after, before = tool0_to_body(side, joints(ahead), tool), tool0_to_body(side, joints(back), tool)
        velocity = np.subtract(after.position, before.position) / (2.0 * step)
        turn = (
            matrix_from_quaternion(after.orientation) @ matrix_from_quaternion(before.orientation).T - np.eye(3)
        ) / (2.0 * step)
        expected = [*velocity, turn[2, 1], turn[0, 2], turn[1, 0]]
        assert derivative[:, joint] == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize(
    ("posture_deg", "confdata"),
    [
        ((0, -130, -135, 30, 0, 40, 0), (0, 0, 0, 4)),  # home
        ((162, -88, 74, -102, 165, 62, 77), (1, 1, 0, 5)),  # a public target of a left arm
        ((104, 30, -74, -25, 46, 43, -175), (1, 0, -2, 0)),
        ((-65, 30, -2, 8, 124, 17, 26), (-1, 1, 0, 0)),
        ((90, 10, 0, 0, -90, -10, 180), (1, -1, 2, 2)),
    ],
)
def test_configuration_of_a_posture(posture_deg, confdata) -> None:
    assert configuration(rad(posture_deg)) == confdata


@pytest.mark.parametrize("beside_deg", [-0.004, 0.0, 0.004])
def test_configuration_beside_a_border_is_that_of_the_border(beside_deg: float) -> None:
    posture = tuple(angle + beside_deg for angle in (0, 0, 0, -90, 0, 0, 90))
    assert configuration(rad(posture)) == (0, 0, 1, 0)
    assert configuration(rad(tuple(angle - 0.1 for angle in posture))) == (-1, -1, 0, 7)
