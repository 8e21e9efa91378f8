"""The catalogue: every message of the program has a text with its values, and every text is said in all words."""

from __future__ import annotations

import ast
import pickle
import runpy
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest

from abb_protocols.catalogue import (
    Message,
    all_texts,
    clause,
    from_wire,
    is_known,
    message,
    remedy_of,
    sentence,
    speak_as,
    subjects,
    to_wire,
)
from abb_protocols.catalogue.actions import ACTIONS, Action, FrontEnd

SOURCES = Path(__file__).parents[3] / "packages"
page = runpy.run_path(str(SOURCES.parent / "setup" / "messages.py"))["page"]  # with the texts of all packages
STOP = message("event_10013", number=10013, title="Emergency stop", detail="")


@cache
def calls() -> tuple[tuple[str, str, set[str] | None], ...]:
    """Place, code and names of the values of each call ``message("…", …)``; None where some names are dynamic."""
    return tuple(_called_with_a_code())


def _called_with_a_code() -> Iterator[tuple[str, str, set[str] | None]]:
    for path in sorted(SOURCES.rglob("*.py")):
        text = path.read_text()
        for node in ast.walk(ast.parse(text)) if "message(" in text else ():
            if (
                isinstance(node, ast.Call)
                and isinstance(node.func, ast.Name)
                and node.func.id == "message"
                and node.args
            ):
                names = {keyword.arg for keyword in node.keywords}
                for code in ast.walk(node.args[0]):
                    if isinstance(code, ast.Constant) and isinstance(code.value, str):
                        where = f"{path.relative_to(SOURCES)}:{node.lineno}"
                        yield where, code.value, None if None in names else {name for name in names if name}


BELOW = {
    "abb_protocols": (),
    "abb_runtime": ("abb_protocols",),
    "abb_view": ("abb_protocols", "abb_runtime"),
    "virtual_irc5": ("abb_protocols", "abb_runtime"),
}
"""The packages on which others are built, each with those below it."""


@pytest.mark.parametrize("package", BELOW)
def test_package_has_the_texts_of_its_messages_without_those_above_it(package: str):
    own = (
        subjects for name in (package, *BELOW[package]) for subjects in import_module(f"{name}.texts").SUBJECTS.values()
    )
    known = {"text"}.union(*own)
    lacking = [f"{where}: {code}" for where, code, _ in calls() if f"/src/{package}/" in where and code not in known]
    assert lacking == []


def test_every_message_of_the_program_has_a_text_with_its_values():
    wrong = [
        f"{where}: {code} with {sorted(names or ())}"
        for where, code, names in calls()
        if code not in all_texts() or (names is not None and not is_known(Message(code, dict.fromkeys(names))))
    ]
    assert len(calls()) > 0
    assert wrong == []


def test_every_action_is_worded_by_every_front_end():
    assert set(ACTIONS) == {action.value for action in Action}
    for words in ACTIONS.values():
        assert set(words) == {front_end.value for front_end in FrontEnd}


def test_no_code_stands_under_two_subjects():
    assert sum(map(len, subjects().values())) + 1 == len(all_texts())  # and that of others' texts


def test_text_leaves_its_full_stop_to_the_sentence_and_has_no_space_around_it():
    parts = [(code, part) for code, text in all_texts().items() if code != "text" for part in text]
    assert [(code, part) for code, part in parts if part.endswith(".") or part != part.strip()] == []
    assert len(parts) > 1000


@pytest.mark.words
def test_sentence_is_what_happened_and_what_to_do_in_the_words_of_the_reader():
    said = message("arm_without_egm", arm="right")
    assert sentence(said, FrontEnd.ROS) == "EGM is not running on the right arm; call start_egm."
    assert sentence(said, FrontEnd.SHELL) == "EGM is not running on the right arm; run `yumi start`."
    assert sentence(said, FrontEnd.PAGE) == "EGM is not running on the right arm; press “Start EGM”."
    assert clause(said) == "EGM is not running on the right arm"
    assert remedy_of(said, FrontEnd.SCRIPT) == "call robot.recover()"


def test_string_of_a_message_is_in_the_words_of_the_program():
    speak_as(FrontEnd.SHELL)
    try:
        said = message("motors_off")
        assert str(said) == sentence(said, FrontEnd.SHELL)
        assert "run `yumi start`" in str(said)
    finally:
        speak_as(FrontEnd.SCRIPT)


@pytest.mark.words
def test_message_in_a_message_is_part_of_its_sentence():
    said = message(
        "stopped_by", causes=(STOP, message("event_50204", number=50204, title="Collision")), stop="10013-7-aa"
    )
    assert sentence(said, FrontEnd.SCRIPT) == (
        "The robot was stopped by 10013 Emergency stop: an emergency stop was pressed; then 50204 Collision: an arm "
        "has collided, or moves against a force; see that its button is released; see what the arm touched, and free "
        "the arm; look at the robot and call "
        "robot.recover(confirm='10013-7-aa'); nothing moves before that."
    )


def test_actions_are_those_of_the_text_and_of_the_messages_in_it():
    assert message("not_in_auto", mode="MANR").actions == (Action.TURN_TO_AUTO,)
    assert message("not_ready", reasons=(message("motors_off"), message("system_failure"))).actions == (
        Action.MOTORS_ON,
    )


def test_values_are_shown_in_the_units_of_people():
    said = message("position_not_believed", arm="left", joint="yumi_joint_2_l", distance=0.5)
    assert " 28.6° " in sentence(said)
    assert " 82 ms" in sentence(message("session_ended", arm="left", silence=0.082))


def test_message_comes_back_from_the_wire_and_from_another_process():
    said = message("stopped_by", causes=(STOP, message("motors_off")), stop="10013-7-aa")
    assert from_wire(to_wire(said)) == said
    assert pickle.loads(pickle.dumps(said)) == said


def test_page_of_the_documentation_is_written_from_the_texts():
    written = SOURCES.parent / "docs" / "reference" / "messages.md"
    assert written.read_text() == page(), "run: make pages"


def test_message_of_another_version_is_not_known():
    assert not is_known(Message("of_the_next_version"))
    assert not is_known(Message("not_in_auto"))
    assert not is_known(message("stopped_by", causes=(Message("event_of_the_next_version"),), stop="1-a"))
    assert not is_known(message("stopped_by", causes=()))
    assert is_known(message("not_in_auto", mode="MANR"))
