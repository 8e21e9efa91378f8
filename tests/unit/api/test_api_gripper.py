from __future__ import annotations

from math import nan
from typing import cast

import pytest

from yumi.api.gripper import Grip, Gripper
from yumi.errors import CommandRefused, GoalNotReached
from yumi.hardware.gripper import Gripper as Hand
from yumi.robot.gripper import Outcome
from yumi.robot.joints import Side


class FakeHand:
    """Ends every command as the test says, with its fingers where the test says."""

    def __init__(self) -> None:
        self.begun: list[tuple[float, float]] = []
        self.outcome = Outcome.HOLDING
        self.last_position = 0.01

    def begin(self, position: float, force: float) -> None:
        self.begun.append((position, force))

    def wait(self, position: float, on_feedback: object) -> Outcome:
        return self.outcome

    def position(self) -> float:
        return self.last_position

    def is_holding(self) -> bool:
        return self.outcome is Outcome.HOLDING


@pytest.fixture
def hand() -> FakeHand:
    return FakeHand()


@pytest.fixture
def gripper(hand: FakeHand) -> Gripper:
    return Gripper(Side.LEFT, lambda: cast("Hand", hand), 10.0)


def test_gripper_grasps_with_the_force_it_is_given_or_the_usual_one(gripper: Gripper, hand: FakeHand) -> None:
    assert gripper.grasp() == gripper.grasp(force=4.0) == Grip(Outcome.HOLDING, 0.02)
    assert hand.begun == [(0.0, 10.0), (0.0, 4.0)]


def test_gripper_accepts_the_width_it_expects(gripper: Gripper) -> None:
    assert gripper.grasp(width=0.022).width == 0.02


@pytest.mark.parametrize("width", [0.016, 0.024])
def test_gripper_holds_on_to_the_wrong_thing_and_says_so(gripper: Gripper, width: float) -> None:
    with pytest.raises(GoalNotReached, match=rf"holds something 20\.0 mm wide, not {width * 1e3:.1f} mm; it holds on"):
        gripper.grasp(width=width)


def test_gripper_that_holds_nothing_says_so(gripper: Gripper, hand: FakeHand) -> None:
    hand.outcome = Outcome.CLOSED
    with pytest.raises(GoalNotReached, match="The left gripper holds nothing: it is closed"):
        gripper.grasp()
    assert gripper.close().outcome is Outcome.CLOSED


def test_gripper_opens_to_a_width(gripper: Gripper, hand: FakeHand) -> None:
    hand.outcome = Outcome.IN_PLACE
    gripper.open(0.03)
    gripper.open()
    assert hand.begun == [(0.015, 10.0), (0.025, 10.0)]


def test_gripper_that_cannot_open_says_so(gripper: Gripper, hand: FakeHand) -> None:
    hand.outcome = Outcome.STALLED
    with pytest.raises(GoalNotReached, match=r"The left gripper stopped at 20\.0 mm instead of 50\.0 mm; look"):
        gripper.open()


def test_gripper_tells_what_is_measured(gripper: Gripper) -> None:
    assert gripper.position == 0.01
    assert gripper.width == 0.02
    assert gripper.is_holding


@pytest.mark.parametrize("width", [0.0, -0.01, 0.051, nan])
def test_gripper_refuses_an_impossible_width(gripper: Gripper, hand: FakeHand, width: float) -> None:
    with pytest.raises(CommandRefused, match=r"Gripper width .* m is out of range; allowed is above 0 to 0\.05 m"):
        gripper.open(width)
    with pytest.raises(CommandRefused, match=r"Object width .* m is out of range; allowed is above 0 to 0\.05 m"):
        gripper.grasp(width=width)
    assert hand.begun == []
