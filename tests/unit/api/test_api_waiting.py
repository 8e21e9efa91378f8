from __future__ import annotations

from threading import Timer
from unittest.mock import patch

import pytest

from abb_protocols.catalogue import message
from abb_protocols.errors import GoalNotReached
from abb_protocols.robot.joints import Side, home
from fake_robot import FakeRobot
from refusals import refused
from yumi.api import arm_access as waiting
from yumi.api.arm_access import wait_for
from yumi.control.controllers.joint_goal import GoalOutcome, StopMotion

BOTH = {side: home(side) for side in Side}


class ObedientRobot(FakeRobot):
    """Its arms come to rest as soon as they are told to."""

    def __init__(self) -> None:
        super().__init__()
        self.control.on_command = self.rest

    @property
    def stopped(self) -> list[Side]:
        return [order.side for order in self.control.commands if isinstance(order.message, StopMotion)]


@pytest.fixture
def robot() -> ObedientRobot:
    return ObedientRobot()


def test_wait_ends_when_all_motions_have(robot: ObedientRobot) -> None:
    motions = robot.executor.move(BOTH, None, None)
    for order in list(robot.control.commands):
        robot.end(order)
    wait_for(motions, None, robot.executor)
    assert robot.stopped == []


def test_wait_whose_time_is_up_stops_the_arms_that_still_move(robot: ObedientRobot) -> None:
    motions = robot.executor.move(BOTH, None, None)
    robot.end(robot.control.commands[0])
    with refused(GoalNotReached, "goal_not_reached_in_time", arms=("left",), timeout=0.01):
        wait_for(motions, 0.01, robot.executor)
    assert robot.stopped == [Side.LEFT]


def test_arm_that_fails_stops_the_other(robot: ObedientRobot) -> None:
    motions = robot.executor.move(BOTH, None, None)
    robot.end(robot.control.commands[1], GoalOutcome.ABORTED, "axis 2 was held")
    with refused(GoalNotReached, "goal_not_reached", arm="left", reason=message("text", text="axis 2 was held")):
        wait_for(motions, None, robot.executor)
    assert robot.stopped == [Side.RIGHT]


def test_ctrl_c_during_a_wait_stops_the_arms(robot: ObedientRobot) -> None:
    motions = robot.executor.move(BOTH, None, None)
    with (
        patch.object(waiting, "wait_for_futures", side_effect=KeyboardInterrupt),
        pytest.raises(KeyboardInterrupt),
    ):
        wait_for(motions, None, robot.executor)
    assert robot.stopped == list(BOTH)


def test_wait_in_one_thread_ends_by_a_notice_in_another(robot: ObedientRobot) -> None:
    motions = robot.executor.move({Side.LEFT: BOTH[Side.LEFT]}, None, None)
    notice = Timer(0.01, robot.end, robot.control.commands)
    notice.start()
    wait_for(motions, 30.0, robot.executor)
    notice.join()
