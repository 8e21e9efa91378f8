"""The joint states of the whole robot are those of arms that are heard."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from yumi.clock import ManualClock
from yumi.control.controller import MemoryBuffer
from yumi.control.shared_state import JointStates
from yumi.robot.joints import JOINT_COUNT, Side, finger_names, joint_names
from yumi.ros.executors import TimerThread
from yumi.ros.topics import STALE, MergedJointStates

pytestmark = pytest.mark.ros

PERIOD = 0.01


class Node:
    """What it publishes is kept."""

    def __init__(self, clock: ManualClock) -> None:
        self.published: list[Any] = []
        self.timers = TimerThread(clock, pytest.fail)
        self._clock = clock

    def tick(self) -> None:
        self._clock.advance(PERIOD)
        self.timers.tick()

    def create_publisher(self, *_: Any) -> Any:
        return SimpleNamespace(publish=self.published.append)

    def get_clock(self) -> Any:
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=int((1e9 + self._clock.now()) * 1e9)))


@pytest.fixture
def states() -> dict[Side, MemoryBuffer]:
    return {side: MemoryBuffer() for side in Side}


@pytest.fixture
def node(clock: ManualClock, states: dict[Side, MemoryBuffer]) -> Node:
    node = Node(clock)
    buffers: Any = {side: SimpleNamespace(states=box) for side, box in states.items()}
    MergedJointStates(node, buffers, lambda: {Side.LEFT: (0.01, 0.0)}, 1.0 / PERIOD, clock, node.timers)
    return node


def hear(box: MemoryBuffer, time: float) -> None:
    box.write(JointStates(time, (0.1,) * JOINT_COUNT, (0.2,) * JOINT_COUNT))


def test_merged_states_have_both_arms_and_the_fingers_that_are_known(
    node: Node, states: dict[Side, MemoryBuffer], clock: ManualClock
) -> None:
    for box in states.values():
        hear(box, clock.now())
    node.tick()
    arms = [name for side in states for name in joint_names(side)]
    assert list(node.published[-1].name) == [*arms, *finger_names(Side.LEFT)]


def test_merged_states_leave_out_an_arm_that_fell_silent(
    node: Node, states: dict[Side, MemoryBuffer], clock: ManualClock
) -> None:
    hear(states[Side.RIGHT], clock.now())
    clock.advance(STALE - PERIOD)
    hear(states[Side.LEFT], clock.now())
    node.tick()
    assert list(node.published[-1].name) == [*joint_names(Side.LEFT), *finger_names(Side.LEFT)]


def test_merged_states_bear_the_time_of_the_oldest_of_them(
    node: Node, states: dict[Side, MemoryBuffer], clock: ManualClock
) -> None:
    oldest = clock.now()
    hear(states[Side.RIGHT], oldest)
    clock.advance(0.1)
    hear(states[Side.LEFT], clock.now())
    node.tick()
    stamp = node.published[-1].header.stamp
    assert stamp.sec + stamp.nanosec * 1e-9 == pytest.approx(1e9 + oldest, abs=1e-3)
