"""Parts that may touch for a while: who may allow it, how slow the arms are, and when it ends."""

from __future__ import annotations

from math import nan
from typing import cast

import pytest

from yumi.clock import ManualClock
from yumi.control.allowed_collisions import CONTACT_SPEED_SCALE, AllowedCollisions
from yumi.control.collisions import CollisionLimiter
from yumi.control.controller import MemoryBuffer
from yumi.control.limiter import SpeedScale
from yumi.control.shared_state import Factor
from yumi.errors import CommandRefused

RIGHT, LEFT, TABLE = "right gripper", "left gripper", "table"


class Arm:
    is_moving = False
    highest = 1.0

    def cap_speed(self, highest: float) -> None:
        self.highest = highest


class Collisions:
    """Notes what may touch."""

    permitted: tuple[tuple[str, str], ...] = ()

    def pairs_of(self, part: str, other: str) -> int:
        return int({part, other} <= {RIGHT, LEFT, TABLE})

    def permit(self, *pairs: tuple[str, str]) -> None:
        self.permitted = pairs


class Bench:
    def __init__(self) -> None:
        self.clock, self.arms, self.collisions = ManualClock(), (Arm(), Arm()), Collisions()
        limiter = cast("CollisionLimiter", self.collisions)
        self.allowed = AllowedCollisions(self.arms, limiter, self.clock.now)

    @property
    def state(self) -> tuple[tuple[tuple[str, str], ...], tuple[float, ...], list[str]]:
        """What may touch, the arms' speeds, and what was reported."""
        events = [str(event) for event in self.allowed.take_events()]
        return self.collisions.permitted, tuple(arm.highest for arm in self.arms), events


@pytest.fixture
def bench() -> Bench:
    return Bench()


SLOW, FULL = (CONTACT_SPEED_SCALE,) * 2, (1.0, 1.0)
OVER = "All parts are kept apart again, and the arms have their speed."


def test_parts_touch_slowly_until_it_is_ended(bench: Bench) -> None:
    bench.allowed.allow(RIGHT, LEFT, 10.0)
    assert bench.state == (((LEFT, RIGHT),), SLOW, ["May touch for a while, slowly: left gripper - right gripper."])
    bench.allowed.end(LEFT, RIGHT)  # whichever is named first
    assert bench.state == ((), FULL, [OVER])
    bench.allowed.end(LEFT, RIGHT)
    assert bench.state == ((), FULL, [])


def test_each_pair_has_its_own_time(bench: Bench) -> None:
    bench.allowed.allow(RIGHT, LEFT, 2.0)
    bench.allowed.allow(RIGHT, TABLE, 5.0)
    assert len(bench.state[0]) == 2
    bench.clock.advance(1.9)
    assert len(bench.state[0]) == 2
    bench.clock.advance(0.1)
    assert bench.state == (((RIGHT, TABLE),), SLOW, ["May touch for a while, slowly: right gripper - table."])
    bench.clock.advance(3.0)
    assert bench.state == ((), FULL, [OVER])


def test_the_time_begins_anew_when_it_is_asked_for_again_while_the_arms_move(bench: Bench) -> None:
    bench.allowed.allow(RIGHT, LEFT, 2.0)
    bench.arms[0].is_moving = True
    bench.clock.advance(1.5)
    bench.allowed.allow(LEFT, RIGHT, 2.0)
    bench.clock.advance(1.5)
    assert bench.state[:2] == (((LEFT, RIGHT),), SLOW)
    bench.clock.advance(0.6)
    assert bench.state[:2] == ((), FULL)


@pytest.mark.parametrize(
    ("part", "other", "seconds", "sentence"),
    [
        (RIGHT, "shelf", 1.0, "no two parts 'right gripper' and 'shelf'"),
        (RIGHT, LEFT, 0.0, "the time is 0 s; give more than 0, up to 60 s"),
        (RIGHT, LEFT, -1.0, "the time is -1 s"),
        (RIGHT, LEFT, nan, "the time is nan s"),
        (RIGHT, LEFT, 61.0, "the time is 61 s"),
    ],
)
def test_what_cannot_be_allowed_is_refused_and_changes_nothing(
    bench: Bench, part: str, other: str, seconds: float, sentence: str
) -> None:
    with pytest.raises(CommandRefused, match=sentence):
        bench.allowed.allow(part, other, seconds)
    assert bench.state == ((), FULL, [])


def test_it_is_refused_while_an_arm_moves(bench: Bench) -> None:
    bench.arms[1].is_moving = True
    with pytest.raises(CommandRefused, match="an arm moves, and contact is for slow motions"):
        bench.allowed.allow(RIGHT, LEFT, 1.0)
    assert bench.state == ((), FULL, [])


def test_it_is_refused_where_nothing_keeps_the_arms_apart() -> None:
    with pytest.raises(CommandRefused, match=r"collision\.enabled is false"):
        AllowedCollisions((Arm(), Arm()), None, ManualClock().now).allow(RIGHT, LEFT, 1.0)


def test_speed_scale_goes_down_gradually_to_its_cap_and_back_to_what_is_set() -> None:
    box = MemoryBuffer[Factor]()
    box.write(Factor(0.8))
    scale = SpeedScale(box)
    scale.highest = CONTACT_SPEED_SCALE
    assert scale.advance(0.004)
    assert 0.7 < scale.value < 0.8
    for _ in range(250):
        scale.advance(0.004)
    assert scale.value == CONTACT_SPEED_SCALE
    box.write(Factor(0.05))
    for _ in range(250):
        scale.advance(0.004)
    assert scale.value == 0.05
    box.write(Factor(0.8))
    scale.highest = 1.0
    for _ in range(250):
        scale.advance(0.004)
    assert scale.value == 0.8
