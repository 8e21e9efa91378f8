from __future__ import annotations

from itertools import pairwise
from math import inf, nan
from typing import Any

import pytest

from abb_protocols.catalogue.actions import Action
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import CYCLE, Side
from refusals import assert_says, refused
from yumi.control.goals import MemoryBuffer
from yumi.control.speed_scale import SpeedFactor, SpeedScale
from yumi.driver.settings import RobotSettings
from yumi.driver.speed_setting import SpeedSetting


class Arms:
    """What a setting tells the arms; EGM runs on those in ``in_egm``."""

    def __init__(self, value: float = 1.0) -> None:
        self.buffers = {side: MemoryBuffer() for side in Side}
        self.in_egm: set[Side] = set()
        self.setting = SpeedSetting(value, self.buffers, self.in_egm.__contains__)

    def told(self) -> list[float]:
        letters = [box.read() for box in self.buffers.values()]
        return [letter[1][0] for letter in letters if letter is not None]


def test_both_arms_are_told_what_is_set() -> None:
    arms = Arms(0.1)
    assert arms.told() == [0.1, 0.1]
    arms.setting.set(0.5)
    assert_says(arms.setting.said, "speed_scale_in_force", value=0.5)
    assert arms.told() == [0.5, 0.5]
    assert (arms.setting.value, arms.setting.in_force) == (0.5, 0.5)


@pytest.mark.parametrize("value", [0.0, -0.1, 0.009, 1.001, 2, nan, inf, -inf, 1e308])
def test_value_out_of_range_is_refused_and_changes_nothing(value: float) -> None:
    arms = Arms(0.3)
    with refused(CommandRefused, "speed_scale_out_of_range", lowest=0.01, highest=1.0):
        arms.setting.set(value)
    assert (arms.setting.value, arms.told()) == (0.3, [0.3, 0.3])


@pytest.mark.parametrize("value", ["fast", None, [1.0]])
def test_value_that_is_no_number_is_refused(value: Any) -> None:
    with refused(CommandRefused, "speed_scale_no_number", value=repr(value), lowest=0.01, highest=1.0):
        Arms().setting.set(value)


def test_arm_is_told_no_more_than_the_robots_own_limit_was_lowered_to_when_egm_started() -> None:
    arms = Arms(0.1)
    arms.setting.note_start([Side.RIGHT], 0.1)
    arms.in_egm.add(Side.RIGHT)
    arms.setting.set(1.0)
    assert_says(arms.setting.said, "speed_scale_waits_for_egm", value=1.0, in_force=0.1)
    assert arms.setting.said.actions == (Action.RESTART_EGM,)
    told = {side: box.read() for side, box in arms.buffers.items()}
    assert told[Side.RIGHT] is not None
    assert told[Side.RIGHT][1] == (0.1,)
    assert arms.setting.in_force == 0.1
    arms.setting.note_start([Side.RIGHT], 1.0)
    assert (arms.told(), arms.setting.in_force) == ([1.0, 1.0], 1.0)


def test_lower_value_holds_at_once_while_egm_runs() -> None:
    arms = Arms()
    arms.in_egm.update(Side)
    arms.setting.note_start(Side, 1.0)
    arms.setting.set(0.2)
    assert (arms.told(), arms.setting.in_force) == ([0.2, 0.2], 0.2)


@pytest.mark.parametrize(
    ("address", "given", "scale"),
    [
        ("127.0.0.1", None, 1.0),
        ("localhost", None, 1.0),
        ("127.0.1.1", None, 1.0),
        ("192.168.125.1", None, 0.1),
        ("192.168.125.1", 0.7, 0.7),
        ("127.0.0.1", 0.4, 0.4),
    ],
)
def test_first_contact_with_a_robot_at_another_address_is_slow(address: str, given: float | None, scale: float) -> None:
    assert RobotSettings(address=address, speed_scale=given).first_speed_scale == scale


def test_scale_of_an_arm_begins_with_what_was_put_and_then_changes_gradually() -> None:
    box = MemoryBuffer()
    box.write(SpeedFactor(0.1))
    scale = SpeedScale(box)
    assert (scale.value, scale.advance(CYCLE)) == (0.1, False)
    box.write(SpeedFactor(1.0))
    values = [0.1]
    while scale.advance(CYCLE):
        values.append(scale.value)
    steps = [after - before for before, after in pairwise(values)]
    changes = [after - before for before, after in zip([0.0, *steps], [*steps, 0.0], strict=True)]
    assert values[-1] == 1.0
    assert min(steps) >= 0.0
    assert max(steps) <= 4.0 * CYCLE * 1.001
    assert max(map(abs, changes)) <= 95.0 * CYCLE**2  # a joint's jerk at its full speed
    assert len(values) * CYCLE == pytest.approx(0.33, abs=0.05)


def test_scale_without_anybody_who_sets_it_is_one() -> None:
    scale = SpeedScale()
    assert (scale.advance(CYCLE), scale.value) == (False, 1.0)
