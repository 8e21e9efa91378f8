"""What becomes of a goal when its controller can tell nothing any more."""

from __future__ import annotations

from collections.abc import Iterator
from threading import Thread
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from control_msgs.action import FollowJointTrajectory
from rclpy.action import ActionClient
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from ros_bench import Client, rclpy
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from yumi.clock import SystemClock
from yumi.control.controller import MemoryBuffer
from yumi.control.events import ControlProcessEnded
from yumi.robot.joints import YUMI_LIMITS, Side, home, joint_names
from yumi.ros.executors import TimerThread
from yumi.ros.trajectory import TrajectoryAction

pytestmark = pytest.mark.ros


class Lone:
    """An action whose controllers take everything and tell nothing."""

    def __init__(self) -> None:
        self.commands: list[object] = []
        self.node: Any = rclpy.create_node("lone")
        buffers = {Side.RIGHT: MemoryBuffer()}
        timers = TimerThread(SystemClock(), print)
        self.action = TrajectoryAction(self.node, "lone", buffers, self, SystemClock(), YUMI_LIMITS, timers)
        self._executor = MultiThreadedExecutor(4)
        self._executor.add_node(self.node)
        self._thread = Thread(target=self._executor.spin)
        self._thread.start()

    def call(self, command: Any, /, *args: Any) -> Any:
        self.commands += args

    def close(self) -> None:
        self._executor.shutdown()
        self._thread.join()
        del self._executor  # its pool's threads end with it
        self.action.destroy()
        self.node.destroy_node()


@pytest.fixture
def lone(ros: None) -> Iterator[Lone]:
    lone = Lone()
    yield lone
    lone.close()


@pytest.fixture
def caller(lone: Lone) -> Iterator[Client]:
    caller = Client(SingleThreadedExecutor())
    yield caller
    caller.close()


def test_goal_is_aborted_when_the_control_process_ends(lone: Lone, caller: Client) -> None:
    goals = ActionClient(caller.node, FollowJointTrajectory, "lone/follow_joint_trajectory")
    caller.until(goals.server_is_ready)
    point = JointTrajectoryPoint(positions=list(home(Side.RIGHT)))
    point.time_from_start.sec = 1
    trajectory = JointTrajectory(joint_names=list(joint_names(Side.RIGHT)), points=[point])
    sent = goals.send_goal_async(FollowJointTrajectory.Goal(trajectory=trajectory))
    caller.until(sent.done)
    lone.action.on_event(ControlProcessEnded(Side.RIGHT, 1))
    ended = sent.result().get_result_async()
    caller.until(ended.done)
    assert ended.result().status == GoalStatus.STATUS_ABORTED
    sentence = "The control process has ended; call recover, which starts another one."
    assert ended.result().result.error_string == sentence
    goals.destroy()
