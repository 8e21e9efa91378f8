"""A publish that fails is logged, and the next one is tried: one error of the middleware ends no joint states."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from queue import SimpleQueue
from threading import Event
from typing import Any

import pytest

from abb_protocols.robot.joints import ZERO_JOINTS, Side
from abb_runtime.clock import SystemClock
from yumi.control.shared_state import JointStates
from yumi.driver.control_process import ArmBuffers

pytestmark = pytest.mark.ros
topics = pytest.importorskip("yumi.ros.state_topics")

LONG = 10.0
HOUR = 3_600_000_000_000  # [ns]


class Node:
    """A node whose clock can be set and whose publisher can refuse."""

    def __init__(self) -> None:
        self.published: SimpleQueue[Any] = SimpleQueue()
        self.attempts: SimpleQueue[None] = SimpleQueue()
        self.refuses = Event()
        self.nanoseconds = 1_700_000_000_000_000_000

    def create_publisher(self, *_: object) -> Node:
        return self

    def get_clock(self) -> Node:
        return self

    def now(self) -> Node:
        return self

    def publish(self, message: Any) -> None:
        self.attempts.put(None)
        if self.refuses.is_set():
            raise RuntimeError("cannot publish data, at ./src/rmw_publish.cpp:64")
        self.published.put(message)


@pytest.fixture
def node() -> Node:
    return Node()


@pytest.fixture
def buffers(node: Node) -> Iterator[ArmBuffers]:
    buffers = ArmBuffers()
    publisher = topics.JointStatePublisher(node, Side.LEFT, buffers, SystemClock())
    publisher.start()
    yield buffers
    publisher.stop()


def write(buffers: ArmBuffers, number: float) -> None:
    buffers.states.write(JointStates(number, ZERO_JOINTS, ZERO_JOINTS))
    buffers.cycle_done.release()


def test_joint_states_go_on_after_publishes_that_failed(
    node: Node, buffers: ArmBuffers, caplog: pytest.LogCaptureFixture
) -> None:
    node.refuses.set()
    with caplog.at_level(logging.ERROR):
        for number in range(1, 4):
            write(buffers, float(number))
            node.attempts.get(timeout=LONG)
        node.refuses.clear()
        write(buffers, 4.0)
        node.published.get(timeout=LONG)
    assert [record.getMessage() for record in caplog.records] == [
        "Publishing l/joint_states failed with RuntimeError: cannot publish data, at ./src/rmw_publish.cpp:64"
    ]


@pytest.mark.parametrize("step", [HOUR, -2 * HOUR, -500_000 * HOUR])
def test_joint_states_go_on_when_the_clock_is_set(step: int, node: Node, buffers: ArmBuffers) -> None:
    write(buffers, 1.0)
    before = node.published.get(timeout=LONG).header.stamp
    node.nanoseconds += step
    write(buffers, 1.0)
    after = node.published.get(timeout=LONG).header.stamp
    elapsed = (after.sec - before.sec) * 1_000_000_000 + after.nanosec - before.nanosec
    assert elapsed == pytest.approx(step, abs=LONG * 1e9)
