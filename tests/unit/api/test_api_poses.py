"""Poses, tools and work objects of scripts, and what becomes of them."""

from __future__ import annotations

from dataclasses import replace
from math import degrees, hypot, inf, nan, pi
from typing import Any

import pytest

import fake_robot
import yumi
from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.confdata import configuration
from abb_protocols.robot.description import FINGERTIPS
from abb_protocols.robot.inverse_kinematics import Unreachable, arm_angle
from abb_protocols.robot.joints import YUMI_LIMITS, Pose, Side, joints
from abb_protocols.robot.kinematics import IDENTITY_QUATERNION, compose_poses, euler_zyx, inverse_pose, tool0_to_body
from fake_robot import FakeRobot
from refusals import refused
from unit.robot.test_robot_kinematics import rad
from yumi.api import motion_executor
from yumi.api.obstacles import boxes_from
from yumi.api.poses import PoseFrames, checked_angle, pose, pose_from, poses_from
from yumi.api.postures import posture_for, postures_of
from yumi.api.robot_arm import Arm
from yumi.control.tool_limits import ToolLimits
from yumi.driver.controller_names import GOAL_CONTROLLER
from yumi.planning.tool_path import TOOL_SPEED, TOOL_TURNING, LineWaypoint, ToolMotion, plan_tool_motions

POSTURE = rad((20, -90, -110, 10, 30, 60, 10))
HERE = tool0_to_body(Side.RIGHT, POSTURE)


def test_a_pose_has_a_quaternion_or_angles() -> None:
    assert yumi.pose(0.1, 0.2, 0.3) == Pose((0.1, 0.2, 0.3), IDENTITY_QUATERNION)
    assert pose(0, 0, 0, (2, 0, 0, 0)).orientation == (1.0, 0.0, 0.0, 0.0)
    assert pose(0, 0, 0, rpy=(pi, 0, 0)).orientation == pytest.approx((0.0, 1.0, 0.0, 0.0))
    assert pose_from([0.1, 0.2, 0.3, 1, 0, 0, 0]) == pose(0.1, 0.2, 0.3)
    assert poses_from(HERE) == [HERE]
    assert poses_from([0.1, 0.2, 0.3, 1, 0, 0, 0]) == [[0.1, 0.2, 0.3, 1, 0, 0, 0]]
    assert poses_from([HERE, HERE]) == [HERE, HERE]


def test_pose_is_moved_along_the_axes_of_the_base_or_of_the_tool() -> None:
    down = pose(0.4, -0.2, 0.2, rpy=(pi, 0.0, 0.0))
    assert down.moved(z=0.02) == replace(down, position=(0.4, -0.2, 0.2 + 0.02))
    assert down.moved(0.1, 0.1).position == pytest.approx((0.5, -0.1, 0.2))
    assert down.moved(z=0.02, frame="tool").position == pytest.approx((0.4, -0.2, 0.18))
    assert down.moved(z=0.02).orientation == down.orientation


def test_pose_is_not_moved_by_what_is_no_distance() -> None:
    with refused(CommandRefused, "pose_moved_by_no_numbers"):
        HERE.moved(z=nan)
    with refused(CommandRefused, "pose_moved_by_no_numbers"):
        HERE.moved("far")  # type: ignore[arg-type]
    with refused(CommandRefused, "pose_moved_along_unknown_frame", frame="world"):
        HERE.moved(frame="world")  # type: ignore[arg-type]


def test_pose_of_an_arm_says_of_what_it_is_and_from_where_it_is_seen() -> None:
    robot = FakeRobot()
    arm = Arm(Side.RIGHT, lambda: robot.executor, None)  # type: ignore[arg-type]
    robot.control.snapshots[Side.RIGHT] = robot.control.snapshots[Side.RIGHT]._replace(position=POSTURE)
    now = arm.pose
    x, y, z = (f"{value * 1e3:.1f} mm" for value in HERE.position)
    roll, pitch, yaw = (f"{degrees(value):.1f}°" for value in euler_zyx(HERE.orientation))
    assert repr(now) == (
        f"<yumi.Pose tool0 of the right arm in the base frame: x {x}, y {y}, z {z}, roll {roll}, pitch {pitch}, "
        f"yaw {yaw}>"
    )
    assert now == HERE
    assert now == HERE
    assert {now: 1}[HERE] == 1
    assert now != replace(now, position=(0.0, 0.0, 0.0))
    assert now != HERE.position
    assert repr(now.moved(z=0.02)).startswith("<yumi.Pose tool0 of the right arm in the base frame: ")
    arm.tool = FINGERTIPS
    assert repr(arm.pose).startswith("<yumi.Pose a tool of your own of the right arm")


@pytest.mark.parametrize(
    ("make", "code", "values"),
    [
        (lambda: pose(nan, 0, 0), "pose_values_not_finite", {"name": "its place", "given": "(nan, 0, 0)", "count": 3}),
        (lambda: pose(inf, 0, 0), "pose_values_not_finite", {"count": 3}),
        (lambda: pose("a", 0, 0), "pose_values_no_numbers", {"name": "its place", "given": "('a', 0, 0)", "count": 3}),
        (lambda: pose_from(Pose((nan, 0, 0), IDENTITY_QUATERNION)), "pose_not_finite", {}),
        (lambda: checked_angle(inf), "pose_angle_not_finite", {"given": "inf"}),
        (lambda: checked_angle("x"), "pose_angle_not_finite", {"given": "'x'"}),
        (lambda: pose(400, 0, 0), "pose_too_far", {"distance": 400.0}),
        (lambda: pose(0, 0, 0, (0, 0, 0, 0)), "pose_quaternion_without_direction", {}),
        (lambda: pose(0, 0, 0, (1, 0, 0)), "pose_values_not_finite", {"name": "quaternion", "count": 4}),
        (lambda: pose(0, 0, 0, (1, 0, 0, 0), rpy=(0, 0, 0)), "pose_orientation_twice", {}),
        (lambda: pose_from("home"), "pose_values_no_numbers", {"given": "'home'", "count": 7}),
        (lambda: PoseFrames().tool("pen"), "tool_name_unknown", {"name": "pen", "known": ("tool0", "fingertips")}),
        (lambda: PoseFrames().work_object("table"), "work_object_unknown", {"name": "table", "known": ("wobj0",)}),
    ],
)
def test_what_is_no_pose_is_refused(make, code: str, values: dict[str, Any]) -> None:
    with refused(CommandRefused, code, **values):
        make()


def test_the_posture_for_a_pose_is_the_nearest() -> None:
    found = posture_for(Side.RIGHT, HERE, None, None, joints([each + 0.05 for each in POSTURE]), YUMI_LIMITS)
    assert tool0_to_body(Side.RIGHT, found).position == pytest.approx(HERE.position, abs=1e-9)
    every = postures_of(Side.RIGHT, HERE, arm_angle(Side.RIGHT, POSTURE), POSTURE, YUMI_LIMITS)
    assert every[0] == pytest.approx(POSTURE, abs=1e-6)


@pytest.mark.parametrize(
    ("given", "code"),
    [
        ((1, 2), "pose_values_not_finite"),
        ("abcd", "pose_values_no_numbers"),
        ((0, 0.5, 0, 0), "pose_configuration_not_whole"),
        ((0, 0, 0, nan), "pose_values_not_finite"),
    ],
)
def test_what_is_no_configuration_is_refused(given, code: str) -> None:
    with refused(CommandRefused, code, given=repr(given)):
        posture_for(Side.RIGHT, HERE, None, given, POSTURE, YUMI_LIMITS)


@pytest.mark.parametrize("call", [lambda arm: arm.jacobian([1, 2]), lambda arm: arm.jacobian([nan] * 7)])
def test_a_jacobian_of_no_posture_is_refused(call) -> None:
    with refused(CommandRefused, "pose_values_not_finite", name="position", count=7):
        call(Arm(Side.RIGHT, lambda: None, None))  # type: ignore[arg-type]


@pytest.mark.parametrize("angle", [inf, nan, "up"])
def test_a_stream_with_no_arm_angle_is_refused(angle) -> None:
    with refused(CommandRefused, "pose_angle_not_finite"):
        Arm(Side.RIGHT, lambda: None, None).servo_pose(HERE, arm_angle=angle)  # type: ignore[arg-type]


def test_a_pose_out_of_reach_is_refused_with_the_nearest() -> None:
    far = Pose((HERE.position[0] + 1.0, *HERE.position[1:]), HERE.orientation)
    with refused(Unreachable, "nearest_pose") as error:
        posture_for(Side.RIGHT, far, None, None, POSTURE, YUMI_LIMITS)
    assert error.value.nearest is not None
    assert tool0_to_body(Side.RIGHT, error.value.nearest).position[0] > HERE.position[0]


def test_an_orientation_that_was_rounded_is_of_length_1() -> None:
    rounded = pose_from([0.1, 0.2, 0.3, 0.707, 0, 0.707, 0])
    assert hypot(*rounded.orientation) == pytest.approx(1.0, abs=1e-15)
    assert pose_from(Pose((0.1, 0.2, 0.3), (0.707, 0.0, 0.707, 0.0))) == rounded


def test_a_configuration_says_which_posture_is_meant() -> None:
    angle = arm_angle(Side.RIGHT, POSTURE)
    for each in postures_of(Side.RIGHT, HERE, angle, POSTURE, YUMI_LIMITS):
        wanted = configuration(each)
        found = posture_for(Side.RIGHT, HERE, angle, wanted, POSTURE, YUMI_LIMITS)
        assert configuration(found) == wanted
    with refused(Unreachable, "posture_missing_in_configuration_at_angle", arm="right", configuration=(9, 9, 9, 9)):
        posture_for(Side.RIGHT, HERE, angle, (9, 9, 9, 9), POSTURE, YUMI_LIMITS)


def test_both_arms_end_at_the_same_time() -> None:
    left = rad((-20, -90, 110, 10, -30, 60, -10))
    starts = {Side.RIGHT: POSTURE, Side.LEFT: left}
    ways = {Side.RIGHT: 0.02, Side.LEFT: -0.15}
    paths = {}
    for side, start in starts.items():
        x, y, z = (here := tool0_to_body(side, start)).position
        goal = LineWaypoint(Pose((x, y, z + ways[side]), here.orientation))
        paths[side] = ToolMotion(Pose((0.0, 0.0, 0.0), IDENTITY_QUATERNION), (goal,))
    plans = plan_tool_motions(paths, starts, YUMI_LIMITS, ToolLimits())
    assert plans[Side.RIGHT].spline.end == pytest.approx(plans[Side.LEFT].spline.end)
    assert plans[Side.RIGHT].spline.last.time == plans[Side.RIGHT].spline.end


def test_an_arms_pose_is_that_of_its_tool() -> None:
    robot, frames = FakeRobot(), PoseFrames()
    snapshot = robot.control.snapshots[Side.RIGHT]
    robot.control.snapshots[Side.RIGHT] = snapshot._replace(position=POSTURE)
    arm = Arm(Side.RIGHT, lambda: robot.executor, None, frames=frames)  # type: ignore[arg-type]
    assert arm.pose == HERE
    arm.tool = "fingertips"
    assert arm.pose == tool0_to_body(Side.RIGHT, POSTURE, FINGERTIPS)
    frames.tools["pen"] = pose(0.0, 0.0, 0.2)
    arm.tool = "pen"
    found = arm.inverse_kinematics(arm.pose)
    assert found[0] == pytest.approx(POSTURE, abs=1e-6)
    frames.work_objects["table"] = pose(0.3, -0.2, 0.1, rpy=(0, 0, 0.5))
    on_table = compose_poses(inverse_pose(pose(0.3, -0.2, 0.1, rpy=(0, 0, 0.5))), arm.pose)
    assert arm.inverse_kinematics(on_table, work_object="table")[0] == pytest.approx(POSTURE, abs=1e-6)
    assert arm.jacobian().shape == (6, 7)
    assert degrees(arm.arm_angle) == pytest.approx(degrees(arm_angle(Side.RIGHT, POSTURE)))


def test_a_driver_without_a_cartesian_controller_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fake_robot, "NAMES", (GOAL_CONTROLLER,))  # as a file of one's own may list them
    robot = FakeRobot()
    arm = Arm(Side.RIGHT, lambda: robot.executor, None)  # type: ignore[arg-type]
    with refused(CommandRefused, "cartesian_controller_missing", arm="right", controller="cartesian_controller"):
        arm.move_linear(HERE)
    with refused(CommandRefused, "cartesian_controller_missing", arm="right", controller="cartesian_controller"):
        arm.servo_twist((0.0, 0.0, 0.1))
    with refused(CommandRefused, "twist_frame_unknown", frame="moon"):
        arm.servo_twist((0.0, 0.0, 0.1), frame="moon")
    for speed in (nan, 1.7e308):
        with refused(CommandRefused, "twist_implausible", most=100.0):
            arm.servo_twist((0.0, 0.0, speed))
    with refused(CommandRefused, "pose_angle_not_finite", given="inf"):
        arm.servo_pose(HERE, arm_angle=inf)


@pytest.mark.parametrize(("line_speed", "speed"), [(None, TOOL_SPEED), (0.4, 0.4)])
def test_a_line_keeps_the_scale_of_speeds(
    monkeypatch: pytest.MonkeyPatch, line_speed: float | None, speed: float
) -> None:
    paths: dict[Side, ToolMotion] = {}

    def refuse(asked: dict[Side, ToolMotion], *others: object) -> None:
        paths.update(asked)
        raise CommandRefused("Enough.")

    monkeypatch.setattr(motion_executor, "plan_tool_motions", refuse)
    robot = FakeRobot()
    robot.control.on_command = robot.rest
    goal, tool = {Side.RIGHT: HERE.position}, {Side.RIGHT: Pose((0.0, 0.0, 0.0), IDENTITY_QUATERNION)}
    with pytest.raises(CommandRefused, match="Enough"):
        robot.executor.move_tools(goal, tool, 0.25, None, line_speed, is_linear=True)
    assert paths[Side.RIGHT].speed == 0.25 * speed
    assert paths[Side.RIGHT].turning == 0.25 * TOOL_TURNING


def test_boxes_are_given_by_name_with_pose_and_edges() -> None:
    (crate,) = boxes_from({"crate": ((0.4, 0, 0.1, 1, 0, 0, 0), (0.2, 0.1, 0.3))})
    assert (crate.name, crate.centre.position, crate.size) == ("crate", (0.4, 0.0, 0.1), (0.2, 0.1, 0.3))


@pytest.mark.parametrize(
    ("centre", "size", "code", "values"),
    [
        (
            (0.4, 0, 0.1, 1, 0, 0, 0),
            (0.2, 0.1),
            "pose_values_not_finite",
            {"name": message("size_of_box", box="crate"), "count": 3},
        ),
        ((0.4, 0, 0.1, 1, 0, 0, 0), (0.2, 0.1, 0.0), "box_edge_not_positive", {"box": "crate"}),
        ((400, 0, 0.1, 1, 0, 0, 0), (0.2, 0.1, 0.1), "pose_too_far", {}),
    ],
)
def test_box_that_is_none_is_refused(centre, size, code: str, values: dict[str, Any]) -> None:
    with refused(CommandRefused, code, **values):
        boxes_from({"crate": (centre, size)})
