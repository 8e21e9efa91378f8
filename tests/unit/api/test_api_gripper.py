from __future__ import annotations

from collections.abc import Callable
from math import nan
from threading import Lock
from typing import cast

import pytest

from yumi.api.tool import Grip, Gripper
from yumi.driver import gripper as driver
from yumi.errors import CommandRefused, GoalNotReached, RobotNotReady
from yumi.robot.gripper import Direction, GripperGoal, Outcome, VacuumState, go_to, grip
from yumi.robot.joints import Side


class FakeGripper:
    """Ends every command as the test says, with its fingers where the test says."""

    side = Side.LEFT
    alone = driver.Gripper.alone

    def __init__(self) -> None:
        self.busy = Lock()
        self.begun: list[GripperGoal] = []
        self.on_begin: Callable[[], None] = lambda: None
        self.outcome = Outcome.HOLDING
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

    def wait(self, order: GripperGoal) -> Outcome:
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
        return self.outcome is Outcome.HOLDING


@pytest.fixture
def fake() -> FakeGripper:
    return FakeGripper()


@pytest.fixture
def gripper(fake: FakeGripper) -> Gripper:
    return Gripper(Side.LEFT, lambda: cast("driver.Gripper", fake), 10.0)


def test_gripper_grasps_with_the_force_it_is_given_or_the_usual_one(gripper: Gripper, fake: FakeGripper) -> None:
    assert gripper.grasp() == gripper.grasp(force=4.0) == Grip(Outcome.HOLDING, 0.02)
    assert fake.begun == [grip(Direction.INWARDS, 10.0), grip(Direction.INWARDS, 4.0)]


def test_stop_that_comes_while_a_command_begins_counts(fake: FakeGripper) -> None:
    stops: list[str] = []

    def check() -> None:
        if stops:
            raise RobotNotReady("A stop waits.", stops[0])

    fake.on_begin = lambda: stops.append("50204-1")
    gripper = Gripper(Side.LEFT, lambda: cast("driver.Gripper", fake), 10.0, check_not_stopped=check)
    with pytest.raises(RobotNotReady, match="A stop waits"):
        gripper.open()
    assert fake.begun == []


def test_command_is_refused_while_another_one_is_carried_out(gripper: Gripper, fake: FakeGripper) -> None:
    with fake.alone():
        for command in (gripper.open, gripper.close, gripper.calibrate):
            with pytest.raises(CommandRefused, match="The left gripper carries out another command; wait for its end"):
                command()
    assert (fake.begun, fake.log) == ([], [])
    gripper.close()


def test_gripper_accepts_the_width_it_expects(gripper: Gripper) -> None:
    assert gripper.grasp(width=0.022).width == 0.02


@pytest.mark.parametrize("width", [0.016, 0.024])
def test_gripper_holds_on_to_the_wrong_thing_and_says_so(gripper: Gripper, width: float) -> None:
    with pytest.raises(GoalNotReached, match=rf"holds something 20\.0 mm wide, not {width * 1e3:.1f} mm; it holds on"):
        gripper.grasp(width=width)


def test_gripper_that_holds_nothing_says_so(gripper: Gripper, fake: FakeGripper) -> None:
    fake.outcome = Outcome.CLOSED
    with pytest.raises(GoalNotReached, match="The left gripper holds nothing: it is closed"):
        gripper.grasp()
    assert gripper.close().outcome is Outcome.CLOSED


def test_gripper_opens_to_a_width(gripper: Gripper, fake: FakeGripper) -> None:
    fake.outcome = Outcome.IN_PLACE
    gripper.open(0.03)
    gripper.open()
    assert fake.begun == [go_to(0.015), go_to(0.025)]


def test_gripper_that_cannot_open_says_so(gripper: Gripper, fake: FakeGripper) -> None:
    fake.outcome = Outcome.STALLED
    with pytest.raises(GoalNotReached, match=r"The left gripper stopped at 20\.0 mm instead of 50\.0 mm; look"):
        gripper.open()


def test_gripper_reports_what_is_measured(gripper: Gripper) -> None:
    assert gripper.position == 0.01
    assert gripper.width == 0.02
    assert gripper.is_holding


@pytest.mark.parametrize("width", [0.0, -0.01, 0.051, nan])
def test_gripper_refuses_an_impossible_width(gripper: Gripper, fake: FakeGripper, width: float) -> None:
    with pytest.raises(CommandRefused, match=r"Gripper width .* m is out of range; allowed is above 0 to 0\.05 m"):
        gripper.open(width)
    with pytest.raises(CommandRefused, match=r"Object width .* m is out of range; allowed is above 0 to 0\.05 m"):
        gripper.grasp(width=width)
    assert fake.begun == []


def test_gripper_grasps_outwards_and_closes_to_let_go(gripper: Gripper, fake: FakeGripper) -> None:
    gripper.grasp(outwards=True)
    fake.outcome = Outcome.CLOSED
    gripper.release()
    assert fake.begun == [grip(Direction.OUTWARDS, 10.0), go_to(0.0)]


def test_gripper_opens_to_let_go(gripper: Gripper, fake: FakeGripper) -> None:
    gripper.grasp()
    fake.outcome = Outcome.OPEN
    assert gripper.release().outcome is Outcome.OPEN
    assert fake.begun[-1] == go_to(0.025)


def test_gripper_that_cannot_let_go_says_so(gripper: Gripper, fake: FakeGripper) -> None:
    gripper.grasp(outwards=True)
    fake.outcome = Outcome.STALLED
    with pytest.raises(GoalNotReached, match=r"The left gripper stopped at 20\.0 mm; look what is in the way"):
        gripper.release()


def test_vacuum_picks_and_drops(gripper: Gripper, fake: FakeGripper) -> None:
    gripper.pick(2)
    assert (gripper.has_picked(2), gripper.pressure(2)) == (True, 40e3)
    gripper.drop(2)
    assert fake.log == ["vacuum 2 True", "drop 2"]


def test_vacuum_that_picks_nothing_says_so(gripper: Gripper, fake: FakeGripper) -> None:
    fake.cup = VacuumState(sucks=True, blows=False, pressure=90e3)
    with pytest.raises(GoalNotReached, match="Vacuum 1 of the left gripper has picked nothing: 90000 Pa after 1 s, 70"):
        gripper.pick()


def test_gripper_is_calibrated_and_its_error_cleared_when_asked(gripper: Gripper, fake: FakeGripper) -> None:
    gripper.calibrate()
    gripper.clear_error()
    assert fake.log == ["calibrate", "clear_error"]
