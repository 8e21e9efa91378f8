from __future__ import annotations

import time

import pytest

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, RobotNotReady
from abb_runtime.clock import POLL_PERIOD, ManualClock, SystemClock, comes_true, wait_until
from refusals import refused

NEVER_CAME = message("gripper_does_not_stop", gripper="left")


def test_wait_ends_as_soon_as_the_condition_holds(clock: ManualClock) -> None:
    wait_until(clock, lambda: clock.now() >= 0.3, 1.0, NEVER_CAME)
    assert clock.now() == pytest.approx(0.3, abs=POLL_PERIOD)


def test_condition_that_holds_is_not_waited_for(clock: ManualClock) -> None:
    wait_until(clock, lambda: True, 0.0, NEVER_CAME, check=lambda: pytest.fail("there is nothing to wait for"))
    assert clock.now() == 0.0


def test_wait_whose_time_is_up_says_how_things_are_then(clock: ManualClock) -> None:
    with refused(RobotNotReady, "gripper_still_moves", timeout=1.0):
        wait_until(clock, lambda: False, 1.0, lambda: message("gripper_still_moves", timeout=clock.now()))


def test_condition_is_polled_once_more_when_the_time_is_up(clock: ManualClock) -> None:
    assert comes_true(clock, lambda: clock.now() >= 1.0, 1.0, period=0.7)


def test_check_ends_a_wait_before_its_time(clock: ManualClock) -> None:
    def check() -> None:
        if clock.now() >= 0.5:
            raise CommandRefused(message("gripper_stopped"))

    with refused(CommandRefused, "gripper_stopped"):
        wait_until(clock, lambda: False, 10.0, NEVER_CAME, check=check)
    assert clock.now() == pytest.approx(0.5, abs=POLL_PERIOD)


def test_period_may_change_while_waiting(clock: ManualClock) -> None:
    polls: list[float] = []

    def is_over() -> bool:
        polls.append(clock.now())
        return False

    assert not comes_true(clock, is_over, 1.0, period=lambda: 0.1 if clock.now() < 0.5 else 0.5)
    assert polls == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 1.0])


def test_machines_clock_does_not_follow_the_time_of_day_when_that_is_set(monkeypatch: pytest.MonkeyPatch) -> None:
    before = SystemClock().now()
    monkeypatch.setattr(time, "time", lambda: -86_400.0)
    monkeypatch.setattr(time, "time_ns", lambda: -86_400 * 10**9)
    assert 0.0 <= SystemClock().now() - before < 3600.0
