from __future__ import annotations

from collections.abc import Callable
from math import nan
from threading import Lock
from typing import cast

import pytest

from abb_protocols.errors import CommandRefused, GoalNotReached, RobotNotReady
from abb_protocols.robot.gripper_values import (
    GripDirection,
    GripOutcome,
    GripperGoal,
    VacuumState,
    finger_position_goal,
    grip,
)
from abb_protocols.robot.joints import Side
from refusals import refused
from yumi.api.gripper import Grip, Gripper
from yumi.driver import gripper as driver


class FakeGripper:
    """Ends every command as the test says, with its fingers where the test says."""

    side = Side.LEFT
    alone = driver.RwsGripper.alone

    def __init__(self) -> None:
        self.busy = Lock()
        self.begun: list[GripperGoal] = []
        self.on_begin: Callable[[], None] = lambda: None
        self.outcome = GripOutcome.HOLDING
        self.last_position = 0.01
        self.log: list[str] = []
        self.cup = VacuumState(sucks=True, blows=False, pressure=40e3)

    def calibrate(self) -> None:
        self.log.append("calibrate")

    def clear_error(self) -> None:
        self.log.append("clear_error")

    def begin(self, order: GripperGoal, check: Callable[[], None]) -> None:
        self.on_begin()
        check()
        self.begun.append(order)

    def wait(self, order: GripperGoal) -> GripOutcome:
        return self.outcome

    def position(self) -> float:
        return self.last_position

    def switch_vacuum(self, channel: int, *, is_on: bool) -> None:
        self.log.append(f"vacuum {channel} {is_on}")

    def wait_until_picked(self, channel: int, threshold: float, timeout: float) -> bool:
        return self.cup.has_picked(threshold)

    def vacuum(self, channel: int) -> VacuumState:
        return self.cup

    def drop(self, channel: int) -> None:
        self.log.append(f"drop {channel}")

    def is_holding(self) -> bool:
        return self.outcome is GripOutcome.HOLDING


@pytest.fixture
def fake() -> FakeGripper:
    return FakeGripper()


@pytest.fixture
def gripper(fake: FakeGripper) -> Gripper:
    return Gripper(Side.LEFT, lambda: cast("driver.Gripper", fake), 10.0)


def test_gripper_grasps_with_the_force_it_is_given_or_the_usual_one(gripper: Gripper, fake: FakeGripper) -> None:
    assert gripper.grasp() == gripper.grasp(force=4.0) == Grip(GripOutcome.HOLDING, 0.02)
    assert fake.begun == [grip(GripDirection.INWARDS, 10.0), grip(GripDirection.INWARDS, 4.0)]


def test_stop_that_comes_while_a_command_begins_counts(fake: FakeGripper) -> None:
    stops: list[str] = []

    def check() -> None:
        if stops:
            raise RobotNotReady("A stop waits.", stops[0])

    fake.on_begin = lambda: stops.append("50204-1")
    gripper = Gripper(Side.LEFT, lambda: cast("driver.Gripper", fake), 10.0, check=check)
    with pytest.raises(RobotNotReady, match="A stop waits"):
        gripper.open()
    assert fake.begun == []


def test_command_is_refused_while_another_one_is_carried_out(gripper: Gripper, fake: FakeGripper) -> None:
    with fake.alone():
        for command in (gripper.open, gripper.close, gripper.calibrate):
            with refused(CommandRefused, "gripper_busy", gripper="left"):
                command()
    assert (fake.begun, fake.log) == ([], [])
    gripper.close()


def test_gripper_accepts_the_width_it_expects(gripper: Gripper) -> None:
    assert gripper.grasp(width=0.022).width == 0.02


@pytest.mark.parametrize("width", [0.016, 0.024])
def test_gripper_holds_on_to_the_wrong_thing_and_says_so(gripper: Gripper, width: float) -> None:
    with refused(GoalNotReached, "gripper_holds_other_width", gripper="left", width=0.02, wanted=width):
        gripper.grasp(width=width)


def test_gripper_that_holds_nothing_says_so(gripper: Gripper, fake: FakeGripper) -> None:
    fake.outcome = GripOutcome.CLOSED
    with refused(GoalNotReached, "gripper_holds_nothing", gripper="left", outcome="closed"):
        gripper.grasp()
    assert gripper.close().outcome is GripOutcome.CLOSED


def test_gripper_opens_to_a_width(gripper: Gripper, fake: FakeGripper) -> None:
    fake.outcome = GripOutcome.IN_PLACE
    gripper.open(0.03)
    gripper.open()
    assert fake.begun == [finger_position_goal(0.015), finger_position_goal(0.025)]


def test_gripper_that_cannot_open_says_so(gripper: Gripper, fake: FakeGripper) -> None:
    fake.outcome = GripOutcome.STALLED
    with refused(GoalNotReached, "gripper_stopped_short", gripper="left", width=0.02, wanted=0.05):
        gripper.open()


def test_gripper_reports_what_is_measured(gripper: Gripper) -> None:
    assert gripper.position == 0.01
    assert gripper.width == 0.02
    assert gripper.is_holding


@pytest.mark.parametrize("width", [0.0, -0.01, 0.051, nan])
def test_gripper_refuses_an_impossible_width(gripper: Gripper, fake: FakeGripper, width: float) -> None:
    with refused(CommandRefused, "gripper_width_out_of_range", most=0.05):
        gripper.open(width)
    with refused(CommandRefused, "object_width_out_of_range", most=0.05):
        gripper.grasp(width=width)
    assert fake.begun == []


def test_gripper_grasps_outwards_and_closes_to_let_go(gripper: Gripper, fake: FakeGripper) -> None:
    gripper.grasp(outwards=True)
    fake.outcome = GripOutcome.CLOSED
    gripper.release()
    assert fake.begun == [grip(GripDirection.OUTWARDS, 10.0), finger_position_goal(0.0)]


def test_gripper_opens_to_let_go(gripper: Gripper, fake: FakeGripper) -> None:
    gripper.grasp()
    fake.outcome = GripOutcome.OPEN
    assert gripper.release().outcome is GripOutcome.OPEN
    assert fake.begun[-1] == finger_position_goal(0.025)


def test_gripper_that_cannot_let_go_says_so(gripper: Gripper, fake: FakeGripper) -> None:
    gripper.grasp(outwards=True)
    fake.outcome = GripOutcome.STALLED
    with refused(GoalNotReached, "gripper_stopped_short", gripper="left", width=0.02, wanted=0.0):
        gripper.release()


def test_vacuum_picks_and_drops(gripper: Gripper, fake: FakeGripper) -> None:
    gripper.pick(2)
    assert (gripper.has_picked(2), gripper.pressure(2)) == (True, 40e3)
    gripper.drop(2)
    assert fake.log == ["vacuum 2 True", "drop 2"]


def test_vacuum_that_picks_nothing_says_so(gripper: Gripper, fake: FakeGripper) -> None:
    fake.cup = VacuumState(sucks=True, blows=False, pressure=90e3)
    with refused(
        GoalNotReached, "vacuum_picked_nothing", channel=1, gripper="left", pressure=90e3, timeout=1.0, needed=70e3
    ):
        gripper.pick()


def test_gripper_is_calibrated_and_its_error_cleared_when_asked(gripper: Gripper, fake: FakeGripper) -> None:
    gripper.calibrate()
    gripper.clear_error()
    assert fake.log == ["calibrate", "clear_error"]
