"""What every arm must let a position controller do: the perfect arm in memory and the virtual arm over the wire."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from math import radians

import pytest

from system.virtual_time_bench import System
from yumi.control.cycle import run_cycle
from yumi.control.goals import put_goal
from yumi.control.guard import Guard
from yumi.control.mailbox import MemoryMailbox
from yumi.control.manager import ControllerManager
from yumi.control.stations import StationClock
from yumi.controllers.joint_position import JointPositionController
from yumi.hardware.perfect_arm import PerfectArm
from yumi.robot.cycle import CYCLE
from yumi.robot.joints import Joints, Side, joint_names, joints
from yumi.robot.limits import YUMI_LIMITS
from yumi.robot.poses import home

Move = Callable[[Joints, float], list[Joints]]
"""Sends an arm at home to a goal for a time [s]; returns the measured positions of all cycles."""

GOAL = joints(
    [value + radians(step) for value, step in zip(home(Side.RIGHT), (20, 10, -15, 5, 30, -20, 40), strict=True)]
)


def move_perfect_arm(goal: Joints, duration: float) -> list[Joints]:
    goals = MemoryMailbox()
    manager = ControllerManager(joint_names(Side.RIGHT))
    manager.load("controller", JointPositionController(goals))
    manager.configure("controller", {"p": 1.0})
    arm, guard, stations = PerfectArm(home(Side.RIGHT)), Guard(YUMI_LIMITS), StationClock()
    first = run_cycle(arm, manager, guard, 0.0, stations)
    assert first is not None
    manager.switch(["controller"], [], first.state)
    put_goal(goals, 1, goal)
    cycles = [run_cycle(arm, manager, guard, count * CYCLE, stations) for count in range(round(duration / CYCLE))]
    return [cycle.state.position for cycle in cycles if cycle is not None]


def move_virtual_arm(goal: Joints, duration: float) -> list[Joints]:
    system = System()
    system.start_egm()
    arm = system.arms[Side.RIGHT]
    arm.go(goal)
    arm.measured.clear()
    system.wait(duration)
    return arm.measured


@pytest.fixture(params=[move_perfect_arm, move_virtual_arm], ids=["perfect arm", "virtual arm"])
def move(request: pytest.FixtureRequest) -> Move:
    return request.param  # type: ignore[no-any-return]


def test_arm_arrives_and_stays(move: Move) -> None:
    path = move(GOAL, 4.0)
    assert path[-1] == pytest.approx(GOAL, abs=radians(0.05))
    assert path[-100] == pytest.approx(path[-1], abs=radians(0.05))


def test_arm_starts_from_where_it_is(move: Move) -> None:
    assert move(GOAL, 0.1)[0] == pytest.approx(home(Side.RIGHT), abs=1e-6)


def test_no_joint_is_faster_than_it_may_be(move: Move) -> None:
    path = move(GOAL, 2.0)
    for before, after in itertools.pairwise(path):
        for old, new, speed in zip(before, after, YUMI_LIMITS.velocity, strict=True):
            assert abs(new - old) <= speed * CYCLE * 1.001


def test_joints_that_have_nowhere_to_go_stay(move: Move) -> None:
    goal = (GOAL[0], *home(Side.RIGHT)[1:])
    for position in move(goal, 1.0):
        assert position[1:] == pytest.approx(home(Side.RIGHT)[1:], abs=1e-6)
