"""Which event stopped the robot, and what is said about it."""

from __future__ import annotations

import pytest

from abb_protocols.catalogue import message
from abb_protocols.robot.joints import Side
from abb_protocols.rws.operations.event_log import RwsEvent
from abb_protocols.rws.values import EventType
from yumi.control.loop_events import RobotStoppedFollowing, SessionLost
from yumi.driver.stops import Cause, because, cause_among, explain, explained, is_without_person, needs_person
from yumi.texts.events import KNOWN_NUMBERS

INFORMATION, ERROR = EventType.INFORMATION, EventType.ERROR


def log(*codes: tuple[int, EventType]) -> list[RwsEvent]:
    """The events of a log, given oldest first, as a controller lists them."""
    events = [
        RwsEvent(number, type, code, "2026-07-09 T 08:15:30", f"title {code}", f"Text {code}.")
        for number, (code, type) in enumerate(codes, start=1)
    ]
    return events[::-1]


@pytest.mark.parametrize(
    ("codes", "cause"),
    [
        ([(10150, INFORMATION), (50204, ERROR), (40228, ERROR), (10125, INFORMATION)], 50204),
        ([(10125, INFORMATION), (10013, INFORMATION), (10010, INFORMATION)], 10013),
        ([(10125, INFORMATION), (10010, INFORMATION), (10015, INFORMATION)], 10015),
        ([(10125, INFORMATION)], 10125),
    ],
)
def test_cause_is_the_first_error_or_the_stop_that_reports_most(codes: list[tuple[int, EventType]], cause: int) -> None:
    found = cause_among(log(*codes))
    assert found is not None
    assert found.code == cause


def test_nothing_before_the_start_of_the_program_is_a_cause() -> None:
    assert cause_among(log((50204, ERROR), (10150, INFORMATION), (10140, INFORMATION))) is None


def test_known_error_is_explained_with_the_controllers_own_text() -> None:
    (event,) = log((50204, ERROR))
    values = {"number": 50204, "title": "title 50204", "detail": "Text 50204"}
    assert explain(event) == message("event_50204_with_detail", **values)


def test_emergency_stop_is_explained_once() -> None:
    (event,) = log((10013, ERROR))
    assert explain(event) == message("event_10013", number=10013, title="title 10013")


def test_known_information_is_explained_without_it() -> None:
    (event,) = log((10125, INFORMATION))
    assert explain(event) == message("event_10125", number=10125, title="title 10125")


def test_unknown_event_is_reported_in_the_controllers_words() -> None:
    (event,) = log((71058, ERROR))
    assert explain(event) == message("event", number=71058, title="title 71058", detail="Text 71058")


@pytest.mark.parametrize("number", sorted(KNOWN_NUMBERS))
def test_event_that_a_person_must_confirm_asks_for_no_recovery_of_its_own(number: int) -> None:
    (event,) = log((number, ERROR))
    assert not (needs_person(number) and "recover" in {action.value for action in explain(event).actions})


def test_end_of_egm_is_explained_by_what_stopped_the_robot() -> None:
    lost, cause = SessionLost(Side.RIGHT, 0.1, ("a",)), message("event_10125", number=10125, title="Program stopped")
    assert explained(lost, Cause()) == lost.said
    assert explained(lost, Cause((cause,))) == message("explained", event=lost.said, causes=(cause,))
    assert explained(lost, Cause((cause,), "10125-1-a")) == message(
        "explained_stop", event=lost.said, causes=(cause,), stop="10125-1-a"
    )
    assert because(lost.said, Cause()) == lost.said


def test_program_that_ends_egm_without_a_stop_is_named() -> None:
    ended = RobotStoppedFollowing(Side.RIGHT, ("a",))
    assert explained(ended, Cause()) == message("ended_by_program", event=ended.said)


@pytest.mark.parametrize(
    ("code", "is_persons"),
    [(10012, True), (10013, True), (50056, True), (50204, True), (90200, True), (90213, True), (90299, True)]
    + [(code, False) for code in (10010, 10015, 10017, 10045, 10125, 41822, 50375, 80001, 90300, 112755)],
)
def test_emergency_stop_guard_stop_and_collision_need_a_person(code: int, is_persons: bool) -> None:
    assert needs_person(code) is is_persons
    assert not (is_persons and is_without_person(log((code, ERROR))[0]))


def test_program_stop_alone_may_have_been_a_person() -> None:
    assert not is_without_person(log((10125, INFORMATION))[0])


@pytest.mark.parametrize(("title", "is_watchdog"), [("Stopped by the watchdog", True), ("My own program", False)])
def test_only_our_watchdog_is_known_to_stop_the_program_without_a_person(title: str, is_watchdog: bool) -> None:
    event = RwsEvent(1, ERROR, 80001, "2026-07-09 T 08:15:30", title, "Text.")
    assert is_without_person(event) is is_watchdog
