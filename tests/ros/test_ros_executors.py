"""The driver's executors answer in families, and tell of callbacks that failed."""

from __future__ import annotations

from collections.abc import Iterator
from queue import SimpleQueue
from threading import Event, Thread
from typing import Any

import pytest
import rclpy
from rclpy.callback_groups import ReentrantCallbackGroup
from std_srvs.srv import Trigger

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


class Answers:
    """What sends the answers of a service: DDS drops the first ones."""

    def __init__(self, dropped: int) -> None:
        self.dropped = dropped
        self.sent: SimpleQueue[tuple[str, int]] = SimpleQueue()

    def send(self, answer: str, header: int) -> None:
        if self.dropped:
            self.dropped -= 1
            raise SystemError("returned a result with an exception set") from RuntimeWarning("failed to send response")
        self.sent.put((answer, header))


def served(family: Family, answers: Answers) -> Any:
    """A service of the family's node whose answers are sent by ``answers``."""
    service = family.node.create_service(Trigger, "late", lambda request, answer: answer)
    service.send_response = answers.send
    family.executors.add_multi_threaded("services", family.node)
    return service


@pytest.mark.parametrize("dropped", [0, 3])
def test_answer_that_dds_dropped_is_sent_again(family: Family, dropped: int) -> None:
    answers = Answers(dropped)
    served(family, answers).send_response("done", 7)
    assert answers.sent.get(timeout=LONG) == ("done", 7)
    assert answers.sent.empty()


def test_answer_whose_client_is_never_discovered_is_given_up_with_a_sentence(family: Family) -> None:
    served(family, Answers(10**6)).send_response("done", 7)
    assert "did not reach its client" in family.complaints.get(timeout=LONG)


def test_answer_that_fails_otherwise_is_reported_as_before(family: Family) -> None:
    answers = Answers(0)
    answers.send = lambda answer, header: {}["no answer"]  # type: ignore[method-assign]
    with pytest.raises(KeyError):
        served(family, answers).send_response("done", 7)


def test_late_answer_that_fails_otherwise_is_reported(family: Family) -> None:
    answers = Answers(1)
    send = answers.send

    def fail_once_discovered(answer: str, header: int) -> None:
        if not answers.dropped:
            raise ValueError("no answer")
        send(answer, header)

    answers.send = fail_once_discovered  # type: ignore[method-assign]
    served(family, answers).send_response("done", 7)
    assert "could not be sent, ValueError: no answer" in family.complaints.get(timeout=LONG)
