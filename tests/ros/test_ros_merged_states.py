"""The joint states of the whole robot are those of arms that are heard, by EGM or from the controller."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from abb_protocols.robot.joints import JOINT_COUNT, Side, finger_names, joint_names
from abb_runtime.clock import ManualClock
from yumi.control.goals import MemoryBuffer
from yumi.control.shared_state import JointStates
from yumi.ros.nodes import TimerThread
from yumi.ros.state_topics import STALE_STATE, MergedJointStates

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
def polled() -> dict[Side, JointStates]:
    """What was read from the controller last."""
    return {}


@pytest.fixture
def node(clock: ManualClock, states: dict[Side, MemoryBuffer], polled: dict[Side, JointStates]) -> Node:
    node = Node(clock)
    buffers: Any = {side: SimpleNamespace(states=box) for side, box in states.items()}
    fingers = {Side.LEFT: (0.01, 0.0)}
    MergedJointStates(node, buffers, lambda: fingers, 1.0 / PERIOD, clock, node.timers, polled.get, "cell1/base")
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
    clock.advance(STALE_STATE - PERIOD)
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


def read(time: float) -> JointStates:
    return JointStates(time, (0.3,) * JOINT_COUNT, (0.0,) * JOINT_COUNT)


def test_merged_states_go_on_with_what_is_read_once_egm_is_silent(
    node: Node, states: dict[Side, MemoryBuffer], polled: dict[Side, JointStates], clock: ManualClock
) -> None:
    for box in states.values():
        hear(box, clock.now())
    for _ in range(300):
        if clock.now() - max((state.time for state in polled.values()), default=0.0) >= 0.4:
            polled.update(dict.fromkeys(Side, read(clock.now())))
        node.tick()
        message = node.published[-1]
        assert list(message.name[:14]) == [*joint_names(Side.RIGHT), *joint_names(Side.LEFT)]
        assert message.header.frame_id == "cell1/base"
    assert list(message.position[:14]) == [0.3] * 14


def test_arm_that_stands_does_not_make_the_states_of_one_that_moves_look_old(
    node: Node, states: dict[Side, MemoryBuffer], polled: dict[Side, JointStates], clock: ManualClock
) -> None:
    polled[Side.LEFT] = read(clock.now())
    clock.advance(0.3)
    heard = clock.now()
    hear(states[Side.RIGHT], heard)
    node.tick()
    stamp = node.published[-1].header.stamp
    assert list(node.published[-1].position[:14]) == [0.1] * 7 + [0.3] * 7
    assert stamp.sec + stamp.nanosec * 1e-9 == pytest.approx(1e9 + heard, abs=1e-3)


def test_what_was_read_too_long_ago_is_not_published_as_current(
    node: Node, polled: dict[Side, JointStates], clock: ManualClock
) -> None:
    polled.update(dict.fromkeys(Side, read(clock.now())))
    clock.advance(STALE_STATE)
    node.tick()
    assert list(node.published[-1].name) == [*finger_names(Side.LEFT)]
