"""What topics of the tool refuse because it is too late for it."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, TwistStamped
from test_ros_command_topics import Node, commanded

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import YUMI_LIMITS, Pose, Side, joints
from abb_protocols.robot.kinematics import IDENTITY_QUATERNION, tool0_to_body
from abb_protocols.robot.urdf import robot_description
from refusals import refused
from unit.robot.test_robot_kinematics import rad
from yumi.control.controller_info import ParameterInfo
from yumi.control.controllers.cartesian import CartesianController
from yumi.control.goals import GoalKind, MemoryBuffer
from yumi.control.hand_over import Commander, HandOver, requested_by
from yumi.control.loop_commands import Commands, ControllerCommand
from yumi.control.trajectory_commands import CancelTrajectory, FollowTrajectory
from yumi.ros.frames import RobotFrames
from yumi.ros.tool_topics import ServoPoseTopic, ServoTwistTopic, TargetPoseTopic

pytestmark = pytest.mark.ros
POSTURE = rad((20, -90, -110, 10, 30, 60, 10))
TOOL = Pose((0.0, 0.0, 0.0), IDENTITY_QUATERNION)


class Control:
    """A right arm that stands."""

    def __init__(self) -> None:
        self.now = commanded(POSTURE, goal_kind=GoalKind.TOOL)._replace(sent=POSTURE)
        self.buffers = {Side.RIGHT: SimpleNamespace(tool_goals=MemoryBuffer(), goals=MemoryBuffer())}
        self.commands: list[ControllerCommand] = []
        self.parameters = CartesianController(Side.RIGHT, MemoryBuffer(), MemoryBuffer()).parameters(())
        self.is_stopped_meanwhile = False
        self.hand_over = HandOver(lambda: 0.0)

    def snapshot(self, _: Side) -> Any:
        return self.now

    def call(self, command: Any, *args: Any) -> Any:
        if command is Commands.list_parameters:
            return tuple(ParameterInfo(each, each.default) for each in self.parameters)
        if command is Commands.commanded_positions:
            if self.is_stopped_meanwhile:
                wire = self.now.wire._replace(session=self.now.session + 1)
                self.now = self.now._replace(wire=wire, activation=self.now.activation + 1)
            return {Side.RIGHT: POSTURE}
        for each in args:
            if each.activation not in (0, self.now.activation):  # as the control process has it
                raise CommandRefused(message("interrupted_while_planned", arm=each.side.word))
        self.commands += args
        return None


@pytest.fixture
def node() -> Node:
    return Node()


@pytest.fixture
def control() -> Control:
    return Control()


def make(kind: Any, node: Node, control: Control) -> Any:
    """A topic of the right arm's Cartesian controller."""
    frames = RobotFrames(robot_description(), "", lambda _: TOOL, lambda _: None, dict, lambda: 0.0)
    return kind(node, Side.RIGHT, control, lambda: 12.5, "cartesian_controller", frames)


def pose(up: float = 0.0) -> Any:
    """Where the tool is, or higher."""
    here, stamped = tool0_to_body(Side.RIGHT, POSTURE), PoseStamped()
    place, turn = stamped.pose.position, stamped.pose.orientation
    place.x, place.y, place.z = here.position
    place.z += up
    turn.w, turn.x, turn.y, turn.z = here.orientation
    return stamped


@pytest.mark.parametrize("is_stopped", [False, True])
def test_a_line_planned_before_a_stop_is_not_followed_after_it(node: Node, control: Control, is_stopped: bool) -> None:
    topic = make(TargetPoseTopic, node, control)
    topic.limits = YUMI_LIMITS
    control.is_stopped_meanwhile = is_stopped
    topic.take(pose(0.02))
    assert len(control.commands) == (not is_stopped)
    assert node.warnings == [str(message("interrupted_while_planned", arm="right"))] * is_stopped


@pytest.mark.parametrize("is_moving", [False, True])
def test_target_that_no_arm_can_have_takes_no_arm_and_ends_no_motion(
    node: Node, control: Control, is_moving: bool
) -> None:
    topic, target = make(TargetPoseTopic, node, control), pose(math.nan if is_moving else 5.0)
    topic.limits = YUMI_LIMITS
    control.now = control.now._replace(velocity=joints([1.0 if is_moving else 0.0] * 7))
    topic.take(target)
    assert len(node.warnings) == 1
    assert control.commands == []
    assert control.hand_over.of(Side.RIGHT).who is Commander.NONE
    topic.take(pose(0.02))
    (command,) = control.commands
    assert isinstance(command.message, CancelTrajectory if is_moving else FollowTrajectory)
    assert control.hand_over.of(Side.RIGHT).who is Commander.STREAM


@pytest.mark.parametrize(("kind", "noun"), [(ServoPoseTopic, "Pose"), (ServoTwistTopic, "Velocity")])
@pytest.mark.parametrize(
    ("sec", "nanosec", "is_old"),
    [(0, 0, False), (1000, 30_000_000, False), (999, 970_000_000, False), (1001, 0, False), (999, 940_000_000, True)],
)
def test_what_comes_too_late_on_a_stream_is_refused(
    node: Node, control: Control, kind: Any, noun: str, sec: int, nanosec: int, is_old: bool
) -> None:
    command = pose() if kind is ServoPoseTopic else TwistStamped()
    command.header.stamp = Time(sec=sec, nanosec=nanosec)  # it is 1000.050 s
    make(kind, node, control).take(command)
    assert (control.buffers[Side.RIGHT].tool_goals.read() is None) is is_old
    reason = message("stamp_too_old", age=0.11, longest=0.1)
    assert node.warnings == [str(message("command_refused", noun=noun, reason=reason))] * is_old


def test_poses_go_on_near_the_tool_after_a_person_has_led_it(node: Node, control: Control) -> None:
    topic, goals = make(ServoPoseTopic, node, control), control.buffers[Side.RIGHT].tool_goals
    with requested_by(Commander.PAGE, "person", "page"):
        control.hand_over.take(Side.RIGHT, Commander.PAGE)
        control.hand_over.let_go(Side.RIGHT)
    control.hand_over.give_back((Side.RIGHT,))
    topic.take(pose(0.2))
    assert goals.read() is None
    values = {"distance": pytest.approx(0.2), "turn": pytest.approx(0.0, abs=1e-6), "most": 0.1, "most_turn": 0.35}
    reason = message("tool_stream_begins_elsewhere", arm="right", **values)
    with refused(CommandRefused, "command_refused", noun="Pose", reason=reason):
        topic._accept(pose(0.2), 12.5)
    for count, up in enumerate((0.05, 0.2), 1):
        topic.take(pose(up))
        assert goals.read()[0] == count
