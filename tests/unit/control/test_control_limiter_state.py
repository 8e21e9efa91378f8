"""The table of the limiter's states: complete where something happens to an arm, and kept to."""

from __future__ import annotations

import pytest

from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, ZERO_JOINTS, ArmCommand, ArmState, joints
from reported_limiter import ReportedLimiter, reportable
from yumi.control.limiter_state import (
    LIMITER_EVENT_MEANINGS,
    LIMITER_STATE_MEANINGS,
    SETTLING_STATES,
    TRANSITIONS,
    ForbiddenTransition,
    LimiterEvent,
    LimiterState,
)

SESSIONS = {event for event in LimiterEvent if event.name.startswith("SESSION")}


def test_every_state_and_event_has_a_meaning_and_a_place() -> None:
    assert set(LIMITER_STATE_MEANINGS) == set(TRANSITIONS) == set(LimiterState)
    assert set(LIMITER_EVENT_MEANINGS) == set(LimiterEvent) == {event for row in TRANSITIONS.values() for event in row}
    reached, waiting = set(), [LimiterState.NO_SESSION]
    while waiting:
        state = waiting.pop()
        if state not in reached:
            reached.add(state)
            waiting += TRANSITIONS[state].values()
    assert reached == set(LimiterState)


@pytest.mark.parametrize("state", LimiterState, ids=lambda state: state.name)
def test_interruption_and_a_new_session_may_come_at_any_time(state: LimiterState) -> None:
    possible = set(TRANSITIONS[state])
    assert possible >= {LimiterEvent.INTERRUPTION, LimiterEvent.CONNECTION_LOST}
    if state is not LimiterState.NO_SESSION:
        assert possible >= SESSIONS


def test_session_that_begins_is_left_by_its_first_command_or_by_another_session_only() -> None:
    left = {
        event for event, state in TRANSITIONS[LimiterState.BEGINNING].items() if state is not LimiterState.BEGINNING
    }
    assert left == {LimiterEvent.FIRST_SENT} | (SESSIONS - {LimiterEvent.SESSION_NEW})


@pytest.mark.parametrize("state", [LimiterState.NO_SESSION, LimiterState.ENTERING, LimiterState.BEGINNING])
def test_nothing_desired_is_followed_before_a_session_has_begun(state: LimiterState) -> None:
    assert LimiterState.FOLLOWING not in TRANSITIONS[state].values()


@pytest.mark.parametrize("state", SETTLING_STATES, ids=lambda state: state.name)
def test_arm_follows_again_only_after_it_has_settled(state: LimiterState) -> None:
    assert LimiterState.FOLLOWING not in TRANSITIONS[state].values()
    assert TRANSITIONS[state][LimiterEvent.UNDESIRED] is LimiterState.SETTLING
    assert TRANSITIONS[LimiterState.SETTLING][LimiterEvent.BACK] is LimiterState.HOLDING
    assert TRANSITIONS[LimiterState.HOLDING][LimiterEvent.DESIRED] is LimiterState.FOLLOWING


def test_what_the_table_forbids_raises_and_changes_nothing() -> None:
    limiter = ReportedLimiter(YUMI_LIMITS)
    with pytest.raises(ForbiddenTransition, match="DESIRED in the state NO_SESSION"):
        limiter.go(LimiterEvent.DESIRED)
    assert limiter.state is LimiterState.NO_SESSION


@pytest.mark.parametrize("is_running", [True, False], ids=["follows", "does not follow"])
def test_first_command_is_where_the_robot_is_whatever_comes_before(is_running: bool) -> None:
    """A first datagram of a robot that does not follow gets no reply; then the connection was lost for a while."""
    limiter = ReportedLimiter(YUMI_LIMITS)
    position = joints([0.3, -1.0, 0.5, 0.2, 0.1, -0.3, 0.4])
    first = ArmState(
        session=1, time=10.0, dt=0.0, position=position, velocity=ZERO_JOINTS, planned=position, is_running=False
    )
    assert limiter.check(first) is None
    limiter.note_interruption()
    limiter.note_connection_lost()
    again = first._replace(time=10.2, is_running=is_running)
    commands = []
    for cycle in range(3):
        state = again._replace(time=again.time + cycle * CYCLE, dt=cycle * CYCLE)
        checked = limiter.check(state)
        if checked is not None:
            commands.append(limiter.limit(checked, ArmCommand(position)).position)
            limiter.observe(checked)
    assert commands
    assert all(command == pytest.approx(position, abs=1e-9) for command in commands)


def test_session_does_not_begin_where_the_arm_was_in_the_session_before() -> None:
    """Its first datagram gets no reply, and the position of the next one is false."""
    limiter = ReportedLimiter(YUMI_LIMITS)
    there = joints([0.3, -1.0, 0.5, 0.2, 0.1, -0.3, 0.4])
    here = reportable(joints([0.1, -1.2, 0.3, 0.0, -0.1, -0.1, 0.2]))
    old = ArmState(session=1, time=10.0, dt=0.0, position=there, velocity=ZERO_JOINTS, planned=there, is_running=True)
    limiter.limit(old, None)
    limiter.observe(old)
    first = ArmState(session=2, time=20.0, dt=0.0, position=here, velocity=ZERO_JOINTS, planned=here, is_running=False)
    assert limiter.check(first) is None
    false = joints([each + 3.0 for each in here])
    assert limiter.check(first._replace(time=20.0 + CYCLE, dt=CYCLE, position=false, planned=false)) is None
    assert limiter.check(first._replace(time=20.0 + 2.0 * CYCLE, dt=CYCLE)) is None
    state = limiter.check(first._replace(time=20.0 + 3.0 * CYCLE, dt=CYCLE))
    assert state is not None
    assert limiter.limit(state, ArmCommand(there)).position == here


@pytest.mark.parametrize(
    "event", [LimiterEvent.NOT_FOLLOWING, LimiterEvent.INTERRUPTION, LimiterEvent.FEEDBACK_DOUBTED]
)
def test_arm_that_has_to_settle_still_has_to_after_something_else(event: LimiterEvent) -> None:
    limiter = ReportedLimiter(YUMI_LIMITS)
    for each in (
        LimiterEvent.SESSION_NEW,
        LimiterEvent.FIRST_SENT,
        LimiterEvent.DESIRED,
        LimiterEvent.UNDESIRED,
        event,
    ):
        limiter.go(each)
    assert limiter.must_settle
