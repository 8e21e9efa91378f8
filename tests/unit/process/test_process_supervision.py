"""A thread whose work fails is not lost, and what it failed with is logged once."""

from __future__ import annotations

import logging
import threading
from queue import SimpleQueue
from threading import Event

import pytest

from abb_protocols.catalogue import message
from abb_protocols.errors import MissingPrerequisite
from abb_runtime.process import supervision
from abb_runtime.process.supervision import SupervisedThread, ThreadFailures
from refusals import refused

LONG = 5.0


@pytest.fixture(autouse=True)
def _short_pauses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(supervision, "FIRST_RESTART_PAUSE", 0.001)
    monkeypatch.setattr(supervision, "LONGEST_RESTART_PAUSE", 0.004)


def fail_with(error: Exception) -> Exception:
    try:
        raise error
    except Exception as raised:
        return raised


def test_work_that_fails_begins_again_and_what_it_fed_is_marked_before() -> None:
    happened: SimpleQueue[str] = SimpleQueue()
    may_fail = [True, True, False]

    def work() -> None:
        happened.put("work")
        if may_fail.pop(0):
            raise RecursionError("too deep")

    thread = SupervisedThread("test-work", work, Event(), lambda: happened.put("stale"))
    thread.start()
    thread.join()
    assert [happened.get(timeout=LONG) for _ in range(5)] == ["work", "stale", "work", "stale", "work"]
    assert not thread.is_alive


def test_work_that_always_fails_ends_when_it_is_told_to() -> None:
    is_over, has_failed = Event(), Event()

    def work() -> None:
        has_failed.set()
        raise ValueError("never works")

    thread = SupervisedThread("test-work", work, is_over)
    thread.start()
    assert has_failed.wait(LONG)
    is_over.set()
    thread.join()
    assert not thread.is_alive


def test_mark_that_fails_does_not_end_the_thread() -> None:
    attempts: list[int] = []

    def work() -> None:
        attempts.append(1)
        if len(attempts) < 3:
            raise ValueError("not yet")

    def mark() -> None:
        raise OSError("cannot be marked")

    thread = SupervisedThread("test-work", work, Event(), mark)
    thread.start()
    thread.join()
    assert len(attempts) == 3


def test_pause_between_failures_grows_to_its_longest(monkeypatch: pytest.MonkeyPatch) -> None:
    pauses: list[float] = []

    class Flag(Event):
        def wait(self, timeout: float | None = None) -> bool:
            assert timeout is not None
            pauses.append(timeout)
            return False

    def work() -> None:
        if len(pauses) < 5:
            raise ValueError("not yet")

    thread = SupervisedThread("test-work", work, Flag())
    thread.start()
    thread.join()
    assert pauses == [0.001, 0.002, 0.004, 0.004, 0.004]


def test_traceback_is_logged_once_for_each_kind_and_counted_after(caplog: pytest.LogCaptureFixture) -> None:
    failures = ThreadFailures()

    with caplog.at_level(logging.ERROR):
        for _ in range(100):
            failures.note("Thread a", fail_with(ValueError("wrong")))
        failures.note("Thread a", fail_with(KeyError("other")))
    assert [record.getMessage() for record in caplog.records] == [
        "Thread a failed with ValueError: wrong",
        "Thread a has failed 10 times with ValueError: wrong",
        "Thread a has failed 100 times with ValueError: wrong",
        "Thread a failed with KeyError: 'other'",
    ]
    assert [record.exc_info is not None for record in caplog.records] == [True, False, False, True]


def test_thread_that_the_system_refuses_is_said_in_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(self: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", refuse)
    thread = SupervisedThread("robot-watch", lambda: None, Event())
    reason = message("text", text="can't start new thread")
    with refused(MissingPrerequisite, "no_further_thread", thread="robot-watch", reason=reason):
        thread.start()
    thread.join()
