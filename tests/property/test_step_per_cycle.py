"""No reply moves a joint further than one cycle of the robot allows, whatever happened to the datagrams before."""

from __future__ import annotations

from itertools import count
from random import Random

import pytest

from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, ArmCommand, ArmState, Joints, Side, joints
from egm_loop import EgmLoop, Wire
from soak import MINUTES, long, short, tell
from virtual_irc5.mechanics.arm_motion import ArmModel
from yumi.control.limiter import Limiter

ROUNDING = 1.001
SPELL = 250  # cycles of each way in which datagrams come
GOALS = 25  # cycles from one goal to the next
LIMITS = YUMI_LIMITS.velocity, YUMI_LIMITS.acceleration, YUMI_LIMITS.jerk


def bundled(size: int) -> Wire:
    """So many datagrams arrive at once."""
    waiting: list[bytes] = []

    def wire(datagram: bytes) -> list[bytes]:
        waiting.append(datagram)
        if len(waiting) < size:
            return []
        due, waiting[:] = list(waiting), []
        return due

    return wire


def jittery(chance: Random, most: int) -> Wire:
    """Datagrams are late by some cycles, in their order."""
    waiting: list[tuple[int, bytes]] = []
    cycles = count()

    def wire(datagram: bytes) -> list[bytes]:
        now = next(cycles)
        waiting.append((max(now + chance.randint(0, most), waiting[-1][0] if waiting else 0), datagram))
        due = [each for time, each in waiting if time <= now]
        del waiting[: len(due)]
        return due

    return wire


def lossy(chance: Random, share: float) -> Wire:
    """A share of the datagrams is lost."""
    return lambda datagram: [] if chance.random() < share else [datagram]


class WatchedLimiter(Limiter):
    """A limiter that remembers in which cycles the command began to wait for a robot that follows an older one."""

    def __init__(self) -> None:
        super().__init__(YUMI_LIMITS)
        self.waits: list[bool] = []
        self._was_waiting = False

    def checked(self) -> ArmState:
        self._was_waiting = self.is_waiting
        return super().checked()

    def sent(self) -> ArmCommand:
        self.waits.append(self.is_waiting and not self._was_waiting)
        return super().sent()


class Steps:
    """The largest steps of the replies, each counted as one cycle of the robot, as shares of the joints' limits."""

    def __init__(self, position: Joints) -> None:
        self.shares = {"speed": 0.0, "acceleration": 0.0, "jerk": 0.0}
        self._position = position
        self.rest()

    def rest(self) -> None:
        """What follows begins at rest: a session has begun, or the command waits."""
        self._rates = [[0.0] * 7, [0.0] * 7]

    def note(self, position: Joints) -> None:
        now, before = position, self._position
        for order, (name, top) in enumerate(zip(self.shares, LIMITS, strict=True)):
            now = joints([(new - old) / CYCLE for new, old in zip(now, before, strict=True)])
            self.shares[name] = max(self.shares[name], *(abs(rate) / most for rate, most in zip(now, top, strict=True)))
            if order < 2:
                before, self._rates[order] = joints(self._rates[order]), list(now)
        self._position = position

    def __str__(self) -> str:
        return ", ".join(f"{name} {share:.4f}" for name, share in self.shares.items())


@pytest.mark.parametrize("minutes", [short(0.4), long(MINUTES, 240.0 * MINUTES)])
@pytest.mark.parametrize("side", Side, ids=str)
def test_no_reply_steps_further_than_the_limits_allow_in_a_cycle(side: Side, minutes: float) -> None:
    chance = Random(f"{side} {minutes}")
    limiter = WatchedLimiter()
    loop = EgmLoop(side, limiter, ArmModel(supervises_load=False))
    loop.begin()
    steps, session = Steps(loop.cycles[-1].sent.position), 1
    for cycle in range(round(minutes * 60.0 / CYCLE)):
        if cycle % SPELL == 0:
            kinds = [bundled(chance.randint(2, 12)), jittery(chance, chance.randint(1, 6)), lossy(chance, 0.3)]
            loop.to_us = chance.choice([*kinds, lambda datagram: [datagram]])
            loop.to_robot = chance.choice([lossy(chance, 0.2), lambda datagram: [datagram]])
        if loop.line.is_running and not loop.manager.is_commanding:
            loop.activate()
        if cycle % GOALS == 0:
            loop.go(joints([chance.uniform(*ends) for ends in zip(YUMI_LIMITS.lower, YUMI_LIMITS.upper, strict=True)]))
        answered = len(loop.cycles)
        loop.cycle()
        replies = loop.cycles[answered:]
        for each, waits in zip(replies, limiter.waits[len(limiter.waits) - len(replies) :], strict=True):
            if each.state.session != session or each.state.dt <= 0.0 or waits:
                session = each.state.session
                steps.rest()
            steps.note(each.sent.position)
        del loop.cycles[:-2]
    tell(f"{side}: {minutes:g} min, largest steps as shares of the limits: {steps}; {sum(limiter.waits)} waits")
    assert steps.shares["speed"] > 0.9  # it moves as fast as it may
    assert all(share <= ROUNDING for share in steps.shares.values())
