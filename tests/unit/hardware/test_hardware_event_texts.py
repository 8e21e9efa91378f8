"""Which event stopped the robot, and what is said about it."""

from __future__ import annotations

import pytest

from yumi.hardware.event_texts import EVENT_TEXTS, cause_among, explain
from yumi.rws.replies import Event
from yumi.rws.states import EventType

INFORMATION, ERROR = EventType.INFORMATION, EventType.ERROR


def log(*codes: tuple[int, EventType]) -> list[Event]:
    """The events of a log, given oldest first, as a controller lists them."""
    events = [
        Event(number, type, code, "2026-07-09 T 08:15:30", f"title {code}", f"Text {code}.")
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
def test_cause_is_the_first_error_or_the_stop_that_tells_most(codes: list[tuple[int, EventType]], cause: int) -> None:
    found = cause_among(log(*codes))
    assert found is not None
    assert found.code == cause


def test_nothing_before_the_start_of_the_program_is_a_cause() -> None:
    assert cause_among(log((50204, ERROR), (10150, INFORMATION), (10140, INFORMATION))) is None


def test_known_event_is_told_with_cause_and_remedy() -> None:
    (event,) = log((50204, ERROR))
    assert explain(event) == (
        "50204 title 50204: an arm has collided, or moves against a force (Text 50204); see what it touched and "
        "free it, then recover"
    )


def test_unknown_event_is_told_in_the_controllers_words() -> None:
    (event,) = log((71058, ERROR))
    assert explain(event) == "71058 title 71058: Text 71058"


@pytest.mark.parametrize("code", sorted(EVENT_TEXTS))
def test_texts_are_parts_of_a_sentence(code: int) -> None:
    text = EVENT_TEXTS[code]
    for part in (text.cause, text.remedy):
        assert part
        assert not part.endswith(".")
