"""Where frames are: those of the robot, and those that others fix to it on ``/tf_static``."""

from __future__ import annotations

from math import dist, inf, sqrt
from typing import Any

import pytest
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import ZERO_JOINTS, Joints, Pose, Side, home
from abb_protocols.robot.kinematics import IDENTITY_QUATERNION, compose_poses, rotation_vector, tool0_to_body
from abb_protocols.robot.urdf import robot_description
from refusals import refused
from yumi.control.shared_state import JointStates
from yumi.ros.frames import RobotFrames

pytestmark = pytest.mark.ros
TOOL = Pose((0.01, 0.02, 0.1), (sqrt(0.5), 0.0, sqrt(0.5), 0.0))
POSITION = home(Side.RIGHT)


class Robot:
    """What is known of it."""

    def __init__(self, prefix: str = "") -> None:
        self.now, self.heard_at, self.fingers = 10.0, {Side.RIGHT: 9.5}, {Side.RIGHT: (0.01, 0.0)}
        self.frames = RobotFrames(
            robot_description(), prefix, lambda _: TOOL, self.state, lambda: self.fingers, lambda: self.now
        )

    def state(self, side: Side) -> Any:
        position: Joints = home(side)
        heard = self.heard_at.get(side)
        return None if heard is None else JointStates(heard, position, ZERO_JOINTS)

    def fix(self, name: str, parent: str, *place: float, turn: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0)) -> None:
        transform = TransformStamped(child_frame_id=name)
        transform.header.frame_id = parent
        to, rotation = transform.transform.translation, transform.transform.rotation
        to.x, to.y, to.z = place
        rotation.x, rotation.y, rotation.z, rotation.w = turn
        self.frames.take(TFMessage(transforms=[transform]))


@pytest.fixture
def robot() -> Robot:
    return Robot()


def is_same(one: Pose, other: Pose) -> bool:
    w, x, y, z = one.orientation
    turn = rotation_vector(compose_poses(Pose((0.0, 0.0, 0.0), (w, -x, -y, -z)), other).orientation)
    return dist(one.position, other.position) < 1e-9 and max(map(abs, turn)) < 1e-9


def test_frames_of_the_robot_are_where_its_joints_have_them(robot: Robot) -> None:
    tool = tool0_to_body(Side.RIGHT, POSITION, TOOL)
    assert is_same(robot.frames.to_base("yumi_tcp_r"), tool)
    assert is_same(robot.frames.to_base("/yumi_tool0_r"), tool0_to_body(Side.RIGHT, POSITION))
    for name in ("", "yumi_base", "yumi_base_link"):
        assert is_same(robot.frames.to_base(name), Pose((0.0, 0.0, 0.0), IDENTITY_QUATERNION))


def test_a_finger_is_where_it_stands_and_unknown_where_it_is_not_heard(robot: Robot) -> None:
    finger, other = (robot.frames.to_base(name).position for name in ("gripper_r_finger", "gripper_r_finger_m"))
    robot.fingers = {Side.RIGHT: (0.02, 0.0)}
    moved, opposite = (robot.frames.to_base(name).position for name in ("gripper_r_finger", "gripper_r_finger_m"))
    assert dist(moved, finger) == pytest.approx(0.01)
    way, back = ([b - a for a, b in zip(*ends, strict=True)] for ends in ((finger, moved), (opposite, other)))
    assert way == pytest.approx(back)
    robot.fingers = {}
    with refused(CommandRefused, "frame_not_located", frame="gripper_r_finger", what="gripper"):
        robot.frames.to_base("gripper_r_finger")


@pytest.mark.parametrize("heard_at", [None, 8.9])
def test_a_frame_of_an_arm_that_is_not_heard_lately_is_refused(robot: Robot, heard_at: float | None) -> None:
    robot.heard_at = {} if heard_at is None else {Side.RIGHT: heard_at}
    with refused(CommandRefused, "frame_not_located", frame="yumi_link_3_r", what="arm"):
        robot.frames.to_base("yumi_link_3_r")
    robot.frames.to_base("yumi_body")


@pytest.mark.parametrize("prefix", ["", "cell1/"])
def test_frames_that_others_fix_to_the_robot_are_known(prefix: str) -> None:
    robot = Robot(prefix)
    robot.fix("table", f"{prefix}yumi_base", 0.5, 0.1, -0.2, turn=(0.0, 0.0, sqrt(0.5), sqrt(0.5)))
    robot.fix("box", "/table", 0.1, 0.0, 0.0)
    assert robot.frames.to_base("box").position == pytest.approx((0.5, 0.2, -0.2))
    robot.fix("box", "table", 0.2, 0.0, 0.0)  # published anew
    assert robot.frames.to_base("box").position == pytest.approx((0.5, 0.3, -0.2))
    robot.fix("pen", f"{prefix}yumi_tool0_r", 0.0, 0.0, 0.15)
    assert robot.frames.tool(Side.RIGHT, "pen").position == pytest.approx((0.0, 0.0, 0.15))


def test_a_robot_that_stands_in_a_world_is_known_in_it(robot: Robot) -> None:
    robot.fix("yumi_base_link", "world", 1.0, 2.0, 0.0)
    robot.fix("shelf", "world", 1.5, 2.0, 0.3)
    assert robot.frames.to_base("shelf").position == pytest.approx((0.5, 0.0, 0.3))
    assert robot.frames.to_base("world").position == pytest.approx((-1.0, -2.0, 0.0))


def test_frames_of_others_change_none_of_the_robot(robot: Robot) -> None:
    before = robot.frames.to_base("yumi_tool0_r")
    robot.fix("yumi_tool0_r", "yumi_base", 9.0, 9.0, 9.0)
    robot.fix("yumi_tcp_r", "yumi_base", 9.0, 9.0, 9.0)
    assert robot.frames.to_base("yumi_tool0_r") == before
    assert is_same(robot.frames.to_base("yumi_tcp_r"), tool0_to_body(Side.RIGHT, POSITION, TOOL))


def test_frames_that_lead_nowhere_are_refused(robot: Robot) -> None:
    robot.fix("egg", "hen", 0.1, 0.0, 0.0)
    robot.fix("hen", "egg", 0.1, 0.0, 0.0)
    robot.fix("island", "sea", 0.0, 0.0, 0.0)
    robot.fix("broken", "yumi_base", inf, 0.0, 0.0)
    robot.fix("flat", "yumi_base", 0.0, 0.0, 0.0, turn=(0.0, 0.0, 0.0, 0.0))
    for name in ("egg", "island", "sea"):
        with refused(CommandRefused, "frame_not_connected", frame=name):
            robot.frames.to_base(name)
    for name in ("broken", "flat", "moon"):
        with refused(CommandRefused, "frame_unknown", frame=name, base="yumi_base"):
            robot.frames.to_base(name)


def test_tools_are_frames_that_are_fixed_to_the_flange(robot: Robot) -> None:
    assert is_same(robot.frames.tool(Side.RIGHT, ""), TOOL)
    assert is_same(robot.frames.tool(Side.RIGHT, "yumi_tcp_r"), TOOL)
    assert robot.frames.tool(Side.RIGHT, "gripper_r_fingertips").position == pytest.approx((0.0, 0.0, 0.1142))
    for name in ("yumi_base", "gripper_r_finger", "yumi_tool0_l", "yumi_link_6_r"):
        with refused(CommandRefused, "frame_not_on_flange", frame=name, arm="right"):
            robot.frames.tool(Side.RIGHT, name)
    seen = robot.frames.in_tool(Side.RIGHT, "yumi_tool0_r")
    assert seen is not None
    assert is_same(compose_poses(TOOL, seen), Pose((0.0, 0.0, 0.0), IDENTITY_QUATERNION))
