"""The virtual controller keeps real time, and its cycles apart."""

from __future__ import annotations

from itertools import pairwise

import pytest

from yumi.clock import ManualClock
from yumi.robot.joints import CYCLE
from yumi.virtual.server import LONGEST_LAG, TIME_TO_ANSWER, Pace


@pytest.fixture
def pace(clock: ManualClock) -> Pace:
    return Pace(clock)


def test_cycles_keep_their_times_whatever_they_take(pace: Pace, clock: ManualClock) -> None:
    begin = clock.now()
    for number, taken in enumerate((0.1, 0.6, 0.3), start=1):
        clock.advance(taken * CYCLE)
        pace.wait()
        assert clock.now() - begin == pytest.approx(number * CYCLE)


def test_a_late_cycle_is_caught_up_and_its_datagrams_can_be_answered(pace: Pace, clock: ManualClock) -> None:
    begin, taken, begins = clock.now(), 0.1 * CYCLE, []
    clock.advance(2.0 * CYCLE)
    for _ in range(6):
        pace.wait()
        begins.append(clock.now() - begin)
        clock.advance(taken)
    assert begins[0] == pytest.approx(2.0 * CYCLE + TIME_TO_ANSWER)
    assert min(after - before for before, after in pairwise(begins)) == pytest.approx(taken + TIME_TO_ANSWER)
    assert begins[-1] == pytest.approx(6.0 * CYCLE)


def test_what_a_machine_that_stood_still_has_missed_is_let_go(pace: Pace, clock: ManualClock) -> None:
    clock.advance(CYCLE + LONGEST_LAG)
    pace.wait()
    begin = clock.now()
    pace.wait()
    assert clock.now() - begin == pytest.approx(CYCLE)
