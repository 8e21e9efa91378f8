"""Messages and failures in the words of the page, and the commands that it has buttons for."""

from __future__ import annotations

import pytest

from abb_protocols.catalogue import message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import StopNotConfirmed
from abb_view.robot_model import yumi_model
from yumi.driver.commands import offered_to
from yumi.web.page_words import failure_for_page, words_for_page
from yumi.web.robot_model import robot_model


def test_page_of_a_driver_draws_a_yumi_and_has_a_button_for_each_command_without_arguments() -> None:
    model = robot_model()
    buttons = [each["button"] for each in model.pop("commands")]
    assert buttons == [kind.button for kind in offered_to(FrontEnd.PAGE) if kind.button]
    assert buttons
    assert model == yumi_model()


@pytest.mark.parametrize("is_virtual", [True, False])
def test_page_gets_code_sentence_and_the_action_of_its_button(is_virtual: bool) -> None:
    said = message("not_in_auto", mode="MANR")
    front_end = FrontEnd.VIRTUAL_PAGE if is_virtual else FrontEnd.PAGE
    assert words_for_page(said, is_virtual=is_virtual) == {
        "code": "not_in_auto",
        "sentence": sentence(said, front_end),
        "action": "turn_to_auto",
    }
    assert words_for_page(message("system_failure"), is_virtual=is_virtual)["action"] is None


def test_silence_of_a_virtual_robot_is_that_of_a_busy_machine() -> None:
    said = message("feedback_lost", arm="right", silence=0.082, controllers=("a",))
    assert words_for_page(said, is_virtual=True)["code"] == "virtual_robot_was_late"
    assert words_for_page(said, is_virtual=False)["code"] == "feedback_lost"


def test_failure_carries_the_stop_that_a_person_must_confirm() -> None:
    stop = message("stopped_by", causes=(message("event_10013", number=10013, title="Emergency stop"),), stop="10013-4")
    failure = failure_for_page(StopNotConfirmed(stop, "10013-4"), is_virtual=True)
    assert {name: failure[name] for name in ("kind", "code", "stop", "action")} == {
        "kind": "StopNotConfirmed",
        "code": "stopped_by",
        "stop": "10013-4",
        "action": "confirm_stop",
    }
