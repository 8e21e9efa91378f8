"""A ticker calls everything at its own rate, whatever the others do."""

from __future__ import annotations

from threading import Event
from time import perf_counter

import pytest

from yumi.clock import ManualClock, SystemClock
from yumi.ros.executors import TimerThread

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
def complaints() -> list[str]:
    return []


@pytest.fixture
def ticker(clock: ManualClock, complaints: list[str]) -> TimerThread:
    return TimerThread(clock, complaints.append)


def test_every_action_has_its_own_rate(ticker: TimerThread, clock: ManualClock) -> None:
    quick, slow = Counter(), Counter()
    ticker.every(PERIOD, "a topic", quick)
    ticker.every(4 * PERIOD, "a topic", slow)
    for _ in range(8):
        clock.advance(ticker.tick())
    ticker.tick()
    assert (quick.count, slow.count) == (8, 2)


def test_nothing_is_called_before_its_time(ticker: TimerThread, clock: ManualClock) -> None:
    action = Counter()
    ticker.every(PERIOD, "a topic", action)
    clock.advance(0.9 * PERIOD)
    assert ticker.tick() == pytest.approx(0.1 * PERIOD)
    assert action.count == 0


def test_calls_that_came_late_are_not_made_up_for(ticker: TimerThread, clock: ManualClock) -> None:
    action = Counter()
    ticker.every(PERIOD, "a topic", action)
    clock.advance(10.5 * PERIOD)
    assert ticker.tick() == pytest.approx(PERIOD)
    assert action.count == 1


def test_a_call_that_is_a_little_late_does_not_shift_the_next(ticker: TimerThread, clock: ManualClock) -> None:
    ticker.every(PERIOD, "a topic", Counter())
    clock.advance(1.25 * PERIOD)
    assert ticker.tick() == pytest.approx(0.75 * PERIOD)


def test_what_has_ended_is_not_called_again(ticker: TimerThread, clock: ManualClock) -> None:
    action = Counter()
    end = ticker.every(PERIOD, "a topic", action)
    clock.advance(PERIOD)
    ticker.tick()
    end()
    end()
    clock.advance(PERIOD)
    ticker.tick()
    assert action.count == 1


def test_an_action_may_end_itself(ticker: TimerThread, clock: ManualClock) -> None:
    calls: list[None] = []
    end = ticker.every(PERIOD, "a topic", lambda: (calls.append(None), end())[0])
    for _ in range(3):
        clock.advance(PERIOD)
        ticker.tick()
    assert len(calls) == 1


def test_a_failure_is_told_once_and_stops_nobody(
    ticker: TimerThread, clock: ManualClock, complaints: list[str]
) -> None:
    failing, other = Counter(), Counter()
    failing.reason = "no publisher"
    ticker.every(PERIOD, "a topic", failing)
    ticker.every(PERIOD, "a topic", other)
    for _ in range(3):
        clock.advance(PERIOD)
        ticker.tick()
    assert (failing.count, other.count) == (3, 3)
    assert complaints == ["a topic could not be published, ValueError: no publisher."]


def test_a_failure_after_a_success_is_told_again(
    ticker: TimerThread, clock: ManualClock, complaints: list[str]
) -> None:
    action = Counter()
    ticker.every(PERIOD, "a topic", action)
    for action.reason in ("one", "", "two"):
        clock.advance(PERIOD)
        ticker.tick()
    assert [each.rsplit(" ", 1)[1] for each in complaints] == ["one.", "two."]


@pytest.mark.real_time
def test_its_thread_calls_what_was_added_while_it_waited_and_ends() -> None:
    ticker, called = TimerThread(SystemClock(), print), Event()
    ticker.start()
    ticker.every(0.001, "a topic", called.set)
    assert called.wait(10.0)
    ticker.stop()
    called.clear()
    assert not called.wait(0.01)


@pytest.mark.real_time
def test_a_thread_that_never_keeps_up_lets_others_in() -> None:
    ticker = TimerThread(SystemClock(), print)

    def overrun() -> None:
        end = perf_counter() + 0.003
        while perf_counter() < end:  # with the interpreter in its hands
            continue

    ticker.every(0.001, "a topic", overrun)
    ticker.start()
    begin = perf_counter()
    for _ in range(20):
        ticker.every(0.001, "another", list)()
    assert perf_counter() - begin < 10.0
    ticker.stop()


def test_one_that_was_never_started_can_be_stopped(ticker: TimerThread) -> None:
    ticker.stop()
