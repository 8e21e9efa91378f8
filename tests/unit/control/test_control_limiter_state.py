"""The table of the limiter's states: complete where something happens to an arm, and kept to."""

from __future__ import annotations

import pytest

from yumi.control.limiter import Limiter
from yumi.control.limiter_state import (
    MEANINGS,
    SEEN,
    TRANSITIONS,
    ForbiddenTransition,
    LimiterEvent,
    LimiterState,
    next_state,
)
from yumi.robot.joints import YUMI_LIMITS

SESSIONS = [event for event in LimiterEvent if event.name.startswith("SESSION")]


def test_every_state_and_event_has_a_meaning_and_a_place() -> None:
    assert set(MEANINGS) == set(TRANSITIONS) == set(LimiterState)
    assert set(SEEN) == set(LimiterEvent) == {event for row in TRANSITIONS.values() for event in row}
    reached, waiting = set(), [LimiterState.NO_SESSION]
    while waiting:
        state = waiting.pop()
        if state not in reached:
            reached.add(state)
            waiting += TRANSITIONS[state].values()
    assert reached == set(LimiterState)


@pytest.mark.parametrize("state", LimiterState, ids=lambda state: state.name)
def test_silence_and_a_new_session_may_come_at_any_time(state: LimiterState) -> None:
    possible = set(TRANSITIONS[state])
    assert possible >= {LimiterEvent.SILENCE, LimiterEvent.LONG_SILENCE}
    if state is not LimiterState.NO_SESSION:
        assert possible >= set(SESSIONS)


@pytest.mark.parametrize("state", [LimiterState.NO_SESSION, LimiterState.ENTERING, LimiterState.BEGINNING])
def test_nothing_desired_is_followed_before_a_session_has_begun(state: LimiterState) -> None:
    assert LimiterState.FOLLOWING not in TRANSITIONS[state].values()


def test_arm_that_settles_follows_only_after_its_command_is_back() -> None:
    assert LimiterState.FOLLOWING not in TRANSITIONS[LimiterState.SETTLING].values()
    assert next_state(LimiterState.SETTLING, LimiterEvent.BACK) is LimiterState.HOLDING
    assert next_state(LimiterState.HOLDING, LimiterEvent.DESIRED) is LimiterState.FOLLOWING


def test_what_the_table_forbids_raises_here_and_has_a_robots_arm_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    limiter = Limiter(YUMI_LIMITS)
    with pytest.raises(ForbiddenTransition, match="DESIRED in the state NO_SESSION"):
        limiter._go(LimiterEvent.DESIRED)
    monkeypatch.setattr(Limiter, "is_strict", False)
    limiter._go(LimiterEvent.DESIRED)
    assert limiter.state is LimiterState.HOLDING
    assert limiter.counters.forbidden == 1
