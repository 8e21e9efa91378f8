"""The event log: newest first, bounded, by domain."""

import pytest

from abb_protocols.rws.values import EventType
from abb_runtime.clock import ManualClock
from virtual_irc5.controller_log import ControllerEventLog


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def log(clock: ManualClock) -> ControllerEventLog:
    return ControllerEventLog(clock.now)


def test_log_shows_the_newest_event_first(log: ControllerEventLog) -> None:
    log.append(10011, "Motors ON")
    log.append(10010, "Motors OFF")
    assert [event.code for event in log.entries()] == [10010, 10011]


def test_log_sorts_events_into_the_domain_of_their_code(log: ControllerEventLog) -> None:
    log.append(10011, "Motors ON")
    log.append(41822, "No data", type=EventType.ERROR)
    assert [event.code for event in log.entries(4)] == [41822]
    assert [event.code for event in log.entries(0)] == [41822, 10011]


def test_log_takes_another_domain_than_the_code_says(log: ControllerEventLog) -> None:
    assert log.append(80001, "Text", domain=8).domain == 8


def test_log_stamps_events_with_the_controllers_clock(log: ControllerEventLog, clock: ManualClock) -> None:
    clock.advance(2.5)
    assert log.append(10011, "Motors ON").time == 2.5


def test_log_keeps_the_last_twenty_of_a_domain_and_a_thousand_of_all(log: ControllerEventLog) -> None:
    for _ in range(1100):
        log.append(10011, "Motors ON")
    assert (len(log.entries(1)), len(log.entries(0)), log.entries(0)[0].number) == (20, 1000, 1100)


@pytest.mark.parametrize(("domain", "left"), [(1, [41822, 10011]), (0, [])])
def test_log_forgets_a_domain_or_all(log: ControllerEventLog, domain: int, left: list[int]) -> None:
    log.append(10011, "Motors ON")
    log.append(41822, "No data")
    log.clear(domain)
    assert log.entries(1) == ()
    assert [event.code for event in log.entries(0)] == left
