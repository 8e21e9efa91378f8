"""A gripper that follows a stream of goals."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import pytest

from abb_protocols.catalogue import Message, message
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import CommandRefused, RobotNotReady
from abb_protocols.robot.gripper_values import FINGER_TRAVEL, GripDirection, finger_position_goal, grip
from abb_protocols.robot.joints import ZERO_JOINTS, Side
from fake_driver import FakeDriver, FakeGripper
from refusals import refused
from yumi.driver.command import Caller, Command
from yumi.driver.commands import carry_out
from yumi.driver.gripper import RwsGripper
from yumi.driver.gripper_follower import GripperFollower, closed_of, goal_of
from yumi.driver.motion_commands import Jog, Move


@pytest.fixture
def gripper() -> FakeGripper:
    return FakeGripper(Side.RIGHT)


@pytest.fixture
def follower(gripper: FakeGripper) -> GripperFollower:
    return GripperFollower(cast("RwsGripper", gripper), 8.0)


def give(follower: GripperFollower, closed: float) -> None:
    """A goal, and the work of giving it to the gripper."""
    work = follower.take(closed)
    assert work is not None
    work()


def test_value_is_a_width_and_at_its_end_a_grip() -> None:
    assert goal_of(0.0, 8.0) == finger_position_goal(FINGER_TRAVEL)
    assert goal_of(0.6, 8.0) == finger_position_goal(FINGER_TRAVEL * 0.4)
    assert goal_of(1.0, 8.0) == grip(GripDirection.INWARDS, 8.0)


def test_newest_of_the_goals_that_came_during_a_command_is_the_next_one(
    gripper: FakeGripper, follower: GripperFollower
) -> None:
    later: list[Callable[[], None] | None] = []

    def come() -> None:
        if not later:
            later.extend(follower.take(value) for value in (0.3, 0.5, 0.7))

    gripper.on_begin = come
    work = follower.take(0.1)
    assert work is not None
    assert gripper.goals == []  # who gives a goal waits for nothing
    work()
    assert later == [None, None, None]
    assert gripper.goals == [goal_of(0.1, 8.0), goal_of(0.7, 8.0)]


def test_goal_that_was_not_given_yet_is_forgotten(gripper: FakeGripper, follower: GripperFollower) -> None:
    work = follower.take(0.1)
    follower.forget()
    assert work is not None
    work()
    assert gripper.goals == []
    assert follower.take(0.2) is not None


@pytest.mark.parametrize("command", [Jog(arm="right", speeds=(0.1, *ZERO_JOINTS[1:])), Move(right="ready")])
def test_goal_that_waits_is_forgotten_when_a_person_takes_the_arm(command: Command[str]) -> None:
    driver = FakeDriver()
    driver.robot.control.on_command = driver.robot.end
    robot, page = driver.server._robot, Caller(client="page", front_end=FrontEnd.PAGE)
    waiting = {side: robot.followers[side].take(0.3) for side in Side}
    carry_out(command, robot, page)
    for work in waiting.values():
        assert work is not None
        work()
    assert driver.grippers[Side.RIGHT].goals == []
    assert driver.grippers[Side.LEFT].goals == [goal_of(0.3, 10.0)]


def test_refusal_is_kept_until_a_goal_is_taken(gripper: FakeGripper, follower: GripperFollower) -> None:
    def refuse() -> None:
        raise RobotNotReady(message("gripper_not_calibrated", gripper="right"))

    gripper.on_begin = refuse
    give(follower, 1.0)
    assert follower.refusal == message("gripper_not_calibrated", gripper="right")
    gripper.on_begin = lambda: None
    give(follower, 0.5)
    assert follower.refusal is None


def test_gripper_that_does_something_else_refuses(gripper: FakeGripper, follower: GripperFollower) -> None:
    with gripper.alone():
        give(follower, 1.0)
    assert follower.refusal == message("gripper_busy", gripper="right")


def test_fault_of_ours_leaves_the_follower_usable(gripper: FakeGripper, follower: GripperFollower) -> None:
    def fail() -> None:
        raise ZeroDivisionError

    gripper.on_begin = fail
    with pytest.raises(ZeroDivisionError):
        give(follower, 1.0)
    assert follower.take(0.5) is not None


def test_goal_of_a_stream_that_is_the_same_as_before_is_left_out_unless_it_was_refused(
    gripper: FakeGripper, follower: GripperFollower
) -> None:
    reported: list[Message] = []

    def follow(closed: float) -> bool:
        work = follower.follow(closed, reported.append)
        if work is not None:
            work()
        return work is not None

    assert [follow(closed) for closed in (0.5, 0.505, 0.7)] == [True, False, True]
    assert gripper.goals == [goal_of(0.5, 8.0), goal_of(0.7, 8.0)]
    with gripper.alone():
        assert [follow(closed) for closed in (0.2, 0.2)] == [True, True]
    assert len(reported) == 1  # once for the same reason
    assert follow(0.2)
    assert gripper.goals[-1] == goal_of(0.2, 8.0)


def test_goal_of_a_stream_is_given_again_after_another_one_has_moved_the_fingers(
    gripper: FakeGripper, follower: GripperFollower
) -> None:
    def follow(closed: float) -> bool:
        work = follower.follow(closed, lambda reason: None)
        if work is not None:
            work()
        return work is not None

    assert [follow(0.5), follow(0.5)] == [True, False]
    gripper.begin(finger_position_goal(0.02), lambda: None)
    assert [follow(0.5), follow(0.5)] == [True, False]
    give(follower, 0.2)  # of a device
    assert [follow(0.5), follow(0.5)] == [True, False]


@pytest.mark.parametrize("width", [-0.001, 0.051, float("nan"), "wide", None])
def test_impossible_width_is_refused(width: object) -> None:
    with refused(CommandRefused, "stream_grippers_malformed", arm="right"):
        closed_of("right", width)


def test_width_of_zero_is_a_grip() -> None:
    assert (closed_of("left", 0.0), closed_of("left", 0.05)) == (1.0, 0.0)
