"""Both arms move for a long time, half of it beside programs that take all the processors they get."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from math import radians

import pytest
from script_bench import VirtualRobot
from wire_faults import center

import yumi
from abb_protocols.robot.joints import Joints, Side, joints
from abb_runtime.clock import SystemClock
from soak import MINUTES, long, short, tell
from yumi.api.robot import Robot
from yumi_evaluation.bench.run import busy_loops

TURN = radians(40.0)
LONGEST_SPELL = 30.0
"""The machine is busy and idle in turns of this time at most [s]."""


@contextmanager
def idle_machine() -> Iterator[None]:
    yield


def turned(side: Side, angle: float) -> Joints:
    """Two joints turned by ``angle`` [rad], with room on all sides."""
    signs = {4: 1.0, 6: -1.0}
    return joints([value + signs.get(index, 0.0) * angle for index, value in enumerate(center(side))])


class Watch:
    """What each arm's fast line counts, and how long its slowest reply took.

    Attributes:
        slowest: from the datagram's being read until its reply had left, so far [s].
    """

    def __init__(self, robot: Robot) -> None:
        self._control = robot.executor.control  # type: ignore[assignment]
        self._seen = {side: self._control.recorders[side].newest for side in Side}
        self._first = {side: self._control.snapshot(side) for side in Side}
        self.slowest = 0.0

    def look(self) -> None:
        """To be done every ten seconds, for which the recorders remember."""
        for side in Side:
            frames = self._control.recorders[side].since(self._seen[side])
            self._seen[side] = frames[-1].number if frames else self._seen[side]
            self.slowest = max([self.slowest, *(frame.stages.reply for frame in frames)])

    @property
    def missed(self) -> int:
        return sum(self._control.snapshot(side).wire.missed - self._first[side].wire.missed for side in Side)

    @property
    def cycles(self) -> int:
        return sum(self._control.snapshot(side).cycles - self._first[side].cycles for side in Side)

    @property
    def sessions(self) -> int:
        """How often a robot that was lost came back."""
        return sum(self._control.snapshot(side).session - self._first[side].session for side in Side)

    def __str__(self) -> str:
        worst = max(self._control.snapshot(side).wire.worst_jitter for side in Side)
        return (
            f"{self.cycles} datagrams answered, {self.missed} missed; slowest reply {self.slowest * 1e3:.2f} ms, "
            f"datagrams up to {worst * 1e3:.1f} ms apart from their time"
        )


@pytest.fixture
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot]:
    virtual = VirtualRobot(tmp_path_factory.mktemp("robot"))
    virtual.start()
    with yumi.connect(**virtual.options, default_speed_scale=1.0, acceleration=1.0) as robot:
        yield robot
    virtual.stop()


@pytest.mark.alone
@pytest.mark.parametrize("duration", [short(6.0, pytest.mark.real_time), long(60.0 * MINUTES, 60.0 * MINUTES + 120.0)])
def test_no_arm_is_lost_beside_a_busy_machine(robot: Robot, duration: float) -> None:
    clock = SystemClock()
    watch = Watch(robot)
    spell = min(LONGEST_SPELL, duration / 4)
    begin = clock.now()
    end, number, direction = begin + duration, 0, 1.0
    while clock.now() < end:
        number += 1
        with idle_machine() if number % 2 else busy_loops():
            spell_end = min(end, begin + number * spell)
            while clock.now() < spell_end:
                direction = -direction
                goals = {side.word: turned(side, direction * TURN) for side in Side}
                robot.move_to(**goals)  # raises when an arm is lost
                watch.look()
        tell(f"{(clock.now() - begin) / 60.0:.1f} of {duration / 60.0:.1f} min: {watch}")
    assert watch.sessions == 0
    assert watch.missed <= 0.01 * watch.cycles
