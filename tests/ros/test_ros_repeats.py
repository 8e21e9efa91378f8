from __future__ import annotations

import pytest

from yumi.clock import ManualClock
from yumi.errors import CommandRefused
from yumi.ros.controller_manager import JUST_FINISHED, Repeats


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def repeats(clock: ManualClock) -> Repeats:
    return Repeats(clock)


def test_request_sent_again_has_the_outcome_of_the_first(repeats: Repeats) -> None:
    assert repeats.once("load", lambda: "first") == "first"
    assert repeats.once("load", lambda: "second") == "first"


def test_request_is_new_some_time_after_the_first_was_finished(repeats: Repeats, clock: ManualClock) -> None:
    repeats.once("load", lambda: clock.advance(60.0))  # however long it took itself
    assert repeats.once("load", lambda: "second") is None
    clock.advance(JUST_FINISHED + 0.01)
    assert repeats.once("load", lambda: "third") == "third"


def test_request_is_new_after_another_one(repeats: Repeats) -> None:
    outcomes = [repeats.once(name, lambda: step) for step, name in enumerate(["load", "unload", "load"])]  # noqa: B023
    assert outcomes == [0, 1, 2]


def test_request_is_new_after_something_else_has_changed(repeats: Repeats) -> None:
    repeats.once("load", lambda: "first")
    repeats.forget()
    assert repeats.once("load", lambda: "second") == "second"


def test_request_is_new_when_something_has_changed_while_the_first_was_in_flight(repeats: Repeats) -> None:
    repeats.once("load", repeats.forget)
    assert repeats.once("load", lambda: "second") == "second"


def test_refused_request_is_carried_out_again(repeats: Repeats) -> None:
    def refuse() -> None:
        raise CommandRefused("no")

    with pytest.raises(CommandRefused, match="no"):
        repeats.once("load", refuse)
    assert repeats.once("load", lambda: "second") == "second"
