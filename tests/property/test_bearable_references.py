"""Any reference that keeps the accelerations of the limits is bearable for the drives, at the fastest EGM settings."""

from __future__ import annotations

import random
from collections.abc import Iterator
from math import radians

import pytest

from abb_protocols.robot.joints import YUMI_LIMITS, Joints, Side
from virtual_irc5.mechanics.arm import VirtualArm
from virtual_irc5.mechanics.arm_motion import ArmModel
from virtual_irc5.mechanics.egm_motion import EgmMotionParameters

CYCLE = 0.004032
START = tuple((low + high) / 2.0 for low, high in zip(YUMI_LIMITS.lower, YUMI_LIMITS.upper, strict=True))


class Joint:
    """Speeds up and slows down at random as hard as it may, and turns before its range ends."""

    def __init__(self, index: int, harder: float, chance: random.Random) -> None:
        self.position, self.velocity, self._push, self._left = START[index], 0.0, 0.0, 0
        self._lower, self._upper = YUMI_LIMITS.lower[index], YUMI_LIMITS.upper[index]
        self._fastest, self._most = YUMI_LIMITS.velocity[index], YUMI_LIMITS.acceleration[index] * harder
        self._chance = chance

    def advance(self) -> None:
        self._left -= 1
        if self._left <= 0:
            self._left, self._push = self._chance.randint(20, 120), self._chance.choice((-1.0, 1.0))
        way = self.velocity**2 / (2.0 * self._most) + abs(self.velocity) * 2.0 * CYCLE
        if self.velocity > 0.0 and self.position + way > self._upper - 0.05:
            self._push = -1.0
        elif self.velocity < 0.0 and self.position - way < self._lower + 0.05:
            self._push = 1.0
        before = self.velocity
        self.velocity += self._push * self._most * CYCLE
        self.velocity = max(-self._fastest, min(self._fastest, self.velocity))
        self.position += (before + self.velocity) / 2.0 * CYCLE


def motion(harder: float, seconds: float) -> Iterator[tuple[Joints, Joints]]:
    chance = random.Random(14000)
    joints = [Joint(index, harder, chance) for index in range(7)]
    for _ in range(round(seconds / CYCLE)):
        for joint in joints:
            joint.advance()
        yield tuple(joint.position for joint in joints), tuple(joint.velocity for joint in joints)


def guided(gain: float) -> VirtualArm:
    arm = VirtualArm(Side.LEFT, START, ArmModel(supervises_load=True))
    arm.switch_motors_on()
    arm.start_egm(EgmMotionParameters(gain=gain, bandwidth=0.0, max_speed=radians(400.0)))
    return arm


@pytest.mark.parametrize(
    ("gain", "feeds_forward"), [(0.0, True), (5.0, True), (5.0, False), (20.0, True), (20.0, False)]
)
def test_motion_within_the_limits_is_bearable(gain: float, feeds_forward: bool) -> None:
    arm = guided(gain)
    for position, velocity in motion(harder=1.0, seconds=10.0):
        arm.set_reference(position, velocity if feeds_forward else None)
        arm.advance(CYCLE)
        assert arm.overload is None


def test_motion_five_times_as_hard_is_not() -> None:
    arm = guided(5.0)
    for position, velocity in motion(harder=5.0, seconds=10.0):
        arm.set_reference(position, velocity)
        arm.advance(CYCLE)
    assert arm.overload is not None
