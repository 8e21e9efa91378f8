"""The driver's executors answer in families, and tell of callbacks that failed."""

from __future__ import annotations

from collections.abc import Iterator
from queue import SimpleQueue
from threading import Event, Thread
from typing import Any

import pytest
import rclpy
from rclpy.callback_groups import ReentrantCallbackGroup

from abb_protocols.errors import MissingPrerequisite
from refusals import refused
from yumi.ros.nodes import Executors

pytestmark = pytest.mark.ros

LONG = 10.0


class Family:
    """A node whose one callback is the test's, spun by executors."""

    def __init__(self, name: str = "family") -> None:
        self.complaints: SimpleQueue[str] = SimpleQueue()
        self.callback: Any = lambda: None
        self.node: Any = rclpy.create_node(name)
        self._condition = self.node.create_guard_condition(self._call_back, ReentrantCallbackGroup())
        self.executors = Executors(self.complaints.put)

    def call(self) -> None:
        self._condition.trigger()

    def close(self) -> None:
        self.executors.stop()
        self.node.destroy_node()

    def _call_back(self) -> None:
        self.callback()


@pytest.fixture
def family(ros: None) -> Iterator[Family]:
    family = Family()
    yield family
    family.close()


def test_a_failed_callback_is_reported_though_no_other_one_comes(family: Family) -> None:
    may_fail = Event()

    def fail() -> None:
        may_fail.wait(LONG)
        raise ValueError("no such thing")

    family.callback = fail
    family.executors.add_multi_threaded("services", family.node)
    family.executors.start()
    family.call()
    may_fail.set()
    assert family.complaints.get(timeout=LONG) == "A callback failed with ValueError: no such thing."


def test_a_family_that_waits_keeps_no_other_one_waiting(family: Family) -> None:
    other, may_end, has_come = Family("other"), Event(), Event()
    family.callback, other.callback = lambda: may_end.wait(LONG), has_come.set
    family.executors.add_single_threaded("one", family.node)
    family.executors.add_multi_threaded("two", other.node)
    family.executors.start()
    family.call()
    other.call()
    assert has_come.wait(LONG)
    may_end.set()
    family.executors.stop()
    other.close()


def test_a_callback_that_always_fails_is_reported_less_and_less(family: Family) -> None:
    count, has_failed = 200, Event()
    calls: list[None] = []

    def fail() -> None:
        calls.append(None)
        if len(calls) < count:
            family.call()
        else:
            has_failed.set()
        raise ValueError("no such thing")

    family.callback = fail
    family.executors.add_multi_threaded("services", family.node)
    family.executors.start()
    family.call()
    assert has_failed.wait(LONG)
    family.executors.stop()
    assert 1 <= family.complaints.qsize() <= 3


def test_callbacks_are_answered_by_one_thread_where_the_system_permits_no_other(
    family: Family, monkeypatch: pytest.MonkeyPatch
) -> None:
    start, pool = Thread.start, []

    def permit_one(self: Thread) -> None:
        if self.name.startswith("ThreadPoolExecutor"):
            pool.append(self.name)
            if len(pool) > 1:
                raise RuntimeError("can't start new thread")
        start(self)

    family.executors.add_multi_threaded("services", family.node)
    monkeypatch.setattr(Thread, "start", permit_one)
    family.executors.start()
    assert len(pool) > 1
    for _ in range(3):
        has_come = Event()
        family.callback = has_come.set
        family.call()
        assert has_come.wait(LONG)


def test_executors_that_get_no_thread_are_refused_in_a_sentence(
    family: Family, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(self: Thread) -> None:
        raise RuntimeError("can't start new thread")

    family.executors.add_multi_threaded("services", family.node)
    monkeypatch.setattr(Thread, "start", refuse)
    with refused(MissingPrerequisite, "no_further_thread", thread="ROS 2's services"):
        family.executors.start()
