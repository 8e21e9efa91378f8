"""Chunks on a topic reach the controllers of the arms whose joints they name, and what became of them is published."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.executors import SingleThreadedExecutor
from ros_bench import Client
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import YUMI_LIMITS, Side, home, joint_names
from abb_runtime.clock import SystemClock
from refusals import refused
from yumi.control.chunk_commands import ChunkTaken, FollowChunk
from yumi.control.loop_commands import Commands, CommandsTaken, ControllerCommand
from yumi.control.motion.spline import TrajectoryPoint
from yumi.planning.trajectory_request import JointTrajectory as Trajectory
from yumi.ros.chunk_topic import ChunkTopic, chunk_topic_plans

pytestmark = pytest.mark.ros

NAMES = (*joint_names(Side.LEFT), *joint_names(Side.RIGHT))
HOME = (*home(Side.LEFT), *home(Side.RIGHT))


class Control:
    """Takes every chunk, as one that is joined at once."""

    def __init__(self) -> None:
        self.clock = SystemClock()
        self.commands: list[ControllerCommand] = []

    def call(self, command: Any, /, *args: ControllerCommand) -> CommandsTaken:
        assert command is Commands.take_commands
        self.commands += args
        now = self.clock.now()
        return CommandsTaken({}, {each.side: ChunkTaken(2, 5, now, now + 0.1, now + 0.7) for each in args})


@pytest.fixture
def client(ros: None) -> Iterator[Client]:
    client = Client(SingleThreadedExecutor())
    yield client
    client.close()


def chunk(names: tuple[str, ...], position: tuple[float, ...], count: int = 8) -> JointTrajectory:
    points = []
    for number in range(count):
        point = JointTrajectoryPoint(positions=position)
        point.time_from_start.nanosec = 20_000_000 * number
        points.append(point)
    return JointTrajectory(joint_names=names, points=points)


def test_chunk_of_both_arms_reaches_both_controllers_in_one_command(client: Client) -> None:
    control, node, states = Control(), client.node, []
    group = MutuallyExclusiveCallbackGroup()
    topic = ChunkTopic(node, group, "both", tuple(Side), control, control.clock, YUMI_LIMITS)
    name = f"{node.get_fully_qualified_name()}/"
    node.create_subscription(Float64MultiArray, f"{name}chunk_state", states.append, 10)
    sender = node.create_publisher(JointTrajectory, f"{name}chunks", 1)
    client.until(lambda: sender.get_subscription_count() == 1 and topic._states.get_subscription_count() == 1)
    message = chunk(NAMES, HOME)
    message.header.stamp = node.get_clock().now().to_msg()
    begin = control.clock.now()
    sender.publish(message)
    client.until(lambda: bool(states))
    assert [each.side for each in control.commands] == [Side.RIGHT, Side.LEFT]
    for each in control.commands:
        assert isinstance(each.message, FollowChunk)
        assert each.controller == "both"
        assert not each.takes_over
        assert each.message.is_of_both
        assert each.message.spline.last.position == home(each.side)
        assert each.message.start == pytest.approx(begin, abs=0.1)
    late, replaced, joined, until = states[0].data
    assert (late, replaced) == (2.0, 5.0)
    assert (joined, until) == (pytest.approx(0.1, abs=0.05), pytest.approx(0.7, abs=0.05))


@pytest.mark.parametrize(
    ("names", "code"),
    [
        ((), "trajectory_without_joints"),
        (("elbow", *NAMES[1:]), "trajectory_joint_unknown"),
        (NAMES[:6], "trajectory_joints_missing"),
        ((NAMES[0], *NAMES[:6]), "trajectory_joint_twice"),
    ],
)
def test_chunk_with_wrong_joints_is_refused(names: tuple[str, ...], code: str) -> None:
    points = tuple(TrajectoryPoint(0.02 * number, HOME[: len(names)]) for number in range(8))
    with refused(CommandRefused, code):
        chunk_topic_plans(Trajectory(names, points), tuple(Side), YUMI_LIMITS)


def test_chunk_of_one_arm_is_for_that_arm() -> None:
    points = tuple(TrajectoryPoint(0.02 * number, HOME[:7]) for number in range(8))
    assert set(chunk_topic_plans(Trajectory(NAMES[:7], points), tuple(Side), YUMI_LIMITS)) == {Side.LEFT}


def test_points_give_every_named_joint_a_position() -> None:
    points = tuple(TrajectoryPoint(0.02 * number, HOME[:6]) for number in range(8))
    with refused(CommandRefused, "point_value_count", count=6, joints=7):
        chunk_topic_plans(Trajectory(NAMES[:7], points), tuple(Side), YUMI_LIMITS)
