"""What becomes of a goal when its controller can tell nothing any more."""

from __future__ import annotations

from collections.abc import Iterator
from threading import Thread
from types import SimpleNamespace
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from control_msgs.action import FollowJointTrajectory
from rclpy.action import ActionClient
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from ros_bench import Client, rclpy
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import YUMI_LIMITS, Side, home, joint_names
from abb_runtime.clock import SystemClock
from yumi.control.controller import State
from yumi.control.controller_info import ControllerInfo
from yumi.control.goals import MemoryBuffer
from yumi.control.loop_commands import Commands, ControllerCommand
from yumi.control.loop_events import ControlProcessEnded, ReportsDropped
from yumi.control.trajectory_commands import (
    CancelTrajectory,
    FollowTrajectory,
    ResultCode,
    TrajectoryEnded,
    TrajectoryOutcome,
)
from yumi.driver.stops import Cause
from yumi.ros.nodes import TimerThread
from yumi.ros.trajectory_action import TrajectoryAction

pytestmark = pytest.mark.ros


INACTIVE = ControllerInfo("lone", "tests/One", State.INACTIVE, ("a/position",), ())
ACTIVE = ControllerInfo("other", "tests/One", State.ACTIVE, ("a/position",), ("a/position",))


ACTIVATION = 7

UPSAMPLING = SimpleNamespace(parameter=SimpleNamespace(name="positions_upsampling.enable"), value=False)
NO_CAUSE = SimpleNamespace(cause=Cause, wait_for_cause=Cause)  # nothing has stopped the robot


class Lone:
    """An action whose controllers take everything, unless there is a ``refusal``, and tell nothing."""

    def __init__(self, sides: tuple[Side, ...] = (Side.RIGHT,)) -> None:
        self.commands: list[object] = []
        self.refusal = ""
        self.replaced: dict[Side, tuple[str, ...]] = {}
        self.node: Any = rclpy.create_node("lone")
        buffers: dict[Side, Any] = {side: MemoryBuffer() for side in sides}
        timers = TimerThread(SystemClock(), print)
        self.switched = 0
        self.action = TrajectoryAction(
            self.node, "lone", buffers, self, SystemClock(), YUMI_LIMITS, timers, NO_CAUSE, on_switch=self.count_switch
        )
        self._executor = MultiThreadedExecutor(4)
        self._executor.add_node(self.node)
        self._thread = Thread(target=self._executor.spin)
        self._thread.start()

    def call(self, command: Any, /, *args: Any) -> Any:
        self.commands += args
        answers: dict[Any, Any] = {
            Commands.commanded_positions: {side: home(side) for side in Side},
            Commands.list_controllers: (INACTIVE, ACTIVE),
            Commands.list_parameters: (UPSAMPLING,),
            Commands.check_commands: {Side.RIGHT: ACTIVATION},
            Commands.send_commands: self.replaced,
        }
        if self.refusal and command is Commands.check_commands:
            raise CommandRefused(self.refusal)
        return answers.get(command)

    def count_switch(self) -> None:
        self.switched += 1

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


def send(caller: Client, goals: ActionClient, names: list[str], positions: list[float]) -> Any:
    """One point in a second; the future of the goal's handle, done."""
    caller.until(goals.server_is_ready)
    point = JointTrajectoryPoint(positions=positions)
    point.time_from_start.sec = 1
    trajectory = JointTrajectory(joint_names=names, points=[point])
    sent = goals.send_goal_async(FollowJointTrajectory.Goal(trajectory=trajectory))
    caller.until(sent.done)
    return sent


def test_joints_that_a_goal_leaves_out_get_where_they_are_commanded_to_be(lone: Lone, caller: Client) -> None:
    goals = ActionClient(caller.node, FollowJointTrajectory, "lone/follow_joint_trajectory")
    names, here = joint_names(Side.RIGHT), home(Side.RIGHT)
    handle = send(caller, goals, [names[6]], [here[6] + 0.1]).result()
    assert handle.accepted
    (follow,) = [
        each.message
        for each in lone.commands
        if isinstance(each, ControllerCommand) and isinstance(each.message, FollowTrajectory)
    ]
    assert follow.plan.first.position == (*here[:6], here[6] + 0.1)
    assert follow.plan.left_out == names[:6]
    lone.action.on_event(ControlProcessEnded(Side.RIGHT, 1))
    caller.until(handle.get_result_async().done)
    goals.destroy()


def test_goal_is_for_the_controllers_that_were_active_before_it_was_planned(lone: Lone, caller: Client) -> None:
    """A stop while it is planned drops it, see Commands.check_commands."""
    goals = ActionClient(caller.node, FollowJointTrajectory, "lone/follow_joint_trajectory")
    handle = send(caller, goals, list(joint_names(Side.RIGHT)), list(home(Side.RIGHT))).result()
    sent = [each for each in lone.commands if isinstance(each, ControllerCommand)]
    assert [each.activation for each in sent if isinstance(each.message, FollowTrajectory)] == [ACTIVATION]
    lone.action.on_event(ControlProcessEnded(Side.RIGHT, 1))
    caller.until(handle.get_result_async().done)
    goals.destroy()


BUSY = "Controller 'lone' is inactive, and other commands the arm."


def refused(caller: Client, sent: Any) -> Any:
    """The result of a goal that was accepted for it alone."""
    assert sent.result().accepted
    ended = sent.result().get_result_async()
    caller.until(ended.done)
    assert ended.result().status == GoalStatus.STATUS_ABORTED
    return ended.result().result


def test_result_of_a_goal_that_cannot_be_followed_now_names_the_commands_that_switch(
    lone: Lone, caller: Client
) -> None:
    lone.refusal = BUSY
    goals = ActionClient(caller.node, FollowJointTrajectory, "lone/follow_joint_trajectory")
    result = refused(caller, send(caller, goals, list(joint_names(Side.RIGHT)), list(home(Side.RIGHT))))
    advice = "ros2 control switch_controllers -c /controller_manager --activate lone --deactivate other)."
    sentence = f"{BUSY} To activate: yumi switch right lone (in ROS: {advice}"
    assert (result.error_code, result.error_string) == (FollowJointTrajectory.Result.INVALID_GOAL, sentence)
    caller.until(caller.hears(sentence))
    goals.destroy()


def test_goal_has_its_controller_activated_and_the_log_says_in_place_of_which(lone: Lone, caller: Client) -> None:
    lone.replaced = {Side.RIGHT: ("other",)}
    goals = ActionClient(caller.node, FollowJointTrajectory, "lone/follow_joint_trajectory")
    handle = send(caller, goals, list(joint_names(Side.RIGHT)), list(home(Side.RIGHT))).result()
    assert handle.accepted
    sent = [each for each in lone.commands if isinstance(each, ControllerCommand)]
    assert [each.takes_over for each in sent] == [True, True]  # the check before it is planned, and the goal
    caller.until(caller.hears("lone was activated on the right arm for a goal, in place of other."))
    assert lone.switched == 1
    lone.action.on_event(ControlProcessEnded(Side.RIGHT, 1))
    caller.until(handle.get_result_async().done)
    goals.destroy()


def test_goal_for_an_inactive_controller_is_refused_before_it_is_planned(
    lone: Lone, caller: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    planned: list[object] = []
    monkeypatch.setattr("yumi.ros.trajectory_action.plan_trajectory", lambda *given: planned.append(given))
    lone.refusal = BUSY
    goals = ActionClient(caller.node, FollowJointTrajectory, "lone/follow_joint_trajectory")
    refused(caller, send(caller, goals, [joint_names(Side.RIGHT)[6]], [0.1]))
    assert planned == []
    sent = [each.message for each in lone.commands if isinstance(each, ControllerCommand)]
    assert sent == [CancelTrajectory()]
    goals.destroy()


ENDED = ControlProcessEnded(Side.RIGHT, 1), str(message("control_process_is_gone"))
DROPPED = ReportsDropped(Side.RIGHT, 300), str(ReportsDropped(Side.RIGHT, 300))


@pytest.mark.parametrize(("event", "sentence"), [ENDED, DROPPED])
def test_goal_is_aborted_when_its_end_cannot_be_reported(
    lone: Lone, caller: Client, event: object, sentence: str
) -> None:
    goals = ActionClient(caller.node, FollowJointTrajectory, "lone/follow_joint_trajectory")
    sent = send(caller, goals, list(joint_names(Side.RIGHT)), list(home(Side.RIGHT)))
    lone.action.on_event(event)
    ended = sent.result().get_result_async()
    caller.until(ended.done)
    assert ended.result().status == GoalStatus.STATUS_ABORTED
    assert ended.result().result.error_string == sentence
    goals.destroy()


@pytest.fixture
def both(ros: None) -> Iterator[Lone]:
    both = Lone(tuple(Side))
    yield both
    both.close()


@pytest.mark.parametrize(("event", "sentence"), [ENDED, DROPPED])
def test_goal_of_both_arms_does_not_succeed_where_only_one_has_reported_it(
    both: Lone, event: object, sentence: str
) -> None:
    caller = Client(SingleThreadedExecutor())
    goals = ActionClient(caller.node, FollowJointTrajectory, "lone/follow_joint_trajectory")
    names, here = [name for side in Side for name in joint_names(side)], [it for side in Side for it in home(side)]
    ended = send(caller, goals, names, here).result().get_result_async()
    sent = [each.message for each in both.commands if isinstance(each, ControllerCommand)]
    (number,) = {each.goal for each in sent if isinstance(each, FollowTrajectory)}
    both.action.on_arm_event(
        Side.RIGHT, TrajectoryEnded(number, TrajectoryOutcome.SUCCEEDED, ResultCode.SUCCESSFUL, "There.")
    )
    both.action.on_arm_event(Side.LEFT, event)
    caller.until(ended.done)
    assert (ended.result().status, ended.result().result.error_string) == (GoalStatus.STATUS_ABORTED, sentence)
    goals.destroy()
    caller.close()
