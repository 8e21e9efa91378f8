"""A timers calls everything at its own rate, whatever the others do."""

from __future__ import annotations

from threading import Event
from time import perf_counter

import pytest

from abb_runtime.clock import ManualClock, SystemClock
from yumi.ros.nodes import TimerThread

PERIOD = 0.25


class Counter:
    """Counts calls, and refuses while it has a reason."""

    def __init__(self) -> None:
        self.count = 0
        self.reason = ""

    def __call__(self) -> None:
        self.count += 1
        if self.reason:
            raise ValueError(self.reason)


@pytest.fixture
def errors() -> list[str]:
    return []


@pytest.fixture
def timers(clock: ManualClock, errors: list[str]) -> TimerThread:
    return TimerThread(clock, errors.append)


def test_every_action_has_its_own_rate(timers: TimerThread, clock: ManualClock) -> None:
    quick, slow = Counter(), Counter()
    timers.every(PERIOD, "a topic", quick)
    timers.every(4 * PERIOD, "a topic", slow)
    for _ in range(8):
        clock.advance(timers.tick())
    timers.tick()
    assert (quick.count, slow.count) == (8, 2)


def test_nothing_is_called_before_its_time(timers: TimerThread, clock: ManualClock) -> None:
    action = Counter()
    timers.every(PERIOD, "a topic", action)
    clock.advance(0.9 * PERIOD)
    assert timers.tick() == pytest.approx(0.1 * PERIOD)
    assert action.count == 0


def test_calls_that_came_late_are_not_made_up_for(timers: TimerThread, clock: ManualClock) -> None:
    action = Counter()
    timers.every(PERIOD, "a topic", action)
    clock.advance(10.5 * PERIOD)
    assert timers.tick() == pytest.approx(PERIOD)
    assert action.count == 1


def test_a_call_that_is_a_little_late_does_not_shift_the_next(timers: TimerThread, clock: ManualClock) -> None:
    timers.every(PERIOD, "a topic", Counter())
    clock.advance(1.25 * PERIOD)
    assert timers.tick() == pytest.approx(0.75 * PERIOD)


def test_what_has_ended_is_not_called_again(timers: TimerThread, clock: ManualClock) -> None:
    action = Counter()
    end = timers.every(PERIOD, "a topic", action)
    clock.advance(PERIOD)
    timers.tick()
    end()
    end()
    clock.advance(PERIOD)
    timers.tick()
    assert action.count == 1


def test_an_action_may_end_itself(timers: TimerThread, clock: ManualClock) -> None:
    calls: list[None] = []
    end = timers.every(PERIOD, "a topic", lambda: (calls.append(None), end())[0])
    for _ in range(3):
        clock.advance(PERIOD)
        timers.tick()
    assert len(calls) == 1


def test_failure_is_logged_once_and_stops_no_other_action(
    timers: TimerThread, clock: ManualClock, errors: list[str]
) -> None:
    failing, other = Counter(), Counter()
    failing.reason = "no publisher"
    timers.every(PERIOD, "a topic", failing)
    timers.every(PERIOD, "a topic", other)
    for _ in range(3):
        clock.advance(PERIOD)
        timers.tick()
    assert (failing.count, other.count) == (3, 3)
    assert errors == ["a topic could not be published, ValueError: no publisher."]


def test_failure_after_a_success_is_logged_again(timers: TimerThread, clock: ManualClock, errors: list[str]) -> None:
    action = Counter()
    timers.every(PERIOD, "a topic", action)
    for action.reason in ("one", "", "two"):
        clock.advance(PERIOD)
        timers.tick()
    assert [each.rsplit(" ", 1)[1] for each in errors] == ["one.", "two."]


@pytest.mark.real_time
def test_its_thread_calls_what_was_added_while_it_waited_and_ends() -> None:
    timers, called = TimerThread(SystemClock(), print), Event()
    timers.start()
    timers.every(0.001, "a topic", called.set)
    assert called.wait(10.0)
    timers.stop()
    called.clear()
    assert not called.wait(0.01)


@pytest.mark.real_time
def test_a_thread_that_never_keeps_up_lets_others_in() -> None:
    timers = TimerThread(SystemClock(), print)

    def overrun() -> None:
        end = perf_counter() + 0.003
        while perf_counter() < end:  # that holds the interpreter
            continue

    timers.every(0.001, "a topic", overrun)
    timers.start()
    begin = perf_counter()
    for _ in range(20):
        timers.every(0.001, "another", list)()
    assert perf_counter() - begin < 10.0
    timers.stop()


def test_one_that_was_never_started_can_be_stopped(timers: TimerThread) -> None:
    timers.stop()
