"""Messages and failures in the words of the page of ``yumi view``."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue import Message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_view import page_server

PAGE_PROGRAM = "yumi view"
"""The command that serves the page."""


def words_of_error(error: Exception) -> Message:
    """As :func:`abb_view.page_server.error_on_page`."""
    return page_server.error_on_page(error, PAGE_PROGRAM)


def words_for_page(said: Message, *, is_virtual: bool) -> Mapping[str, object]:
    """A message in the page's words, with the first thing that a person can do about it."""
    if is_virtual and said.code == "feedback_lost":  # a virtual robot falls silent where its machine has no time for it
        said = Message("virtual_robot_was_late", said.values)
    front_end = FrontEnd.VIRTUAL_PAGE if is_virtual else FrontEnd.PAGE
    action = said.actions[0].value if said.actions else None
    return {"code": said.code, "sentence": sentence(said, front_end), "action": action}


def failure_for_page(error: Exception, *, is_virtual: bool) -> Mapping[str, object]:
    """What a page gets of an exception."""
    stop = getattr(error, "stop", "")
    return {"kind": type(error).__name__, "stop": stop, **words_for_page(words_of_error(error), is_virtual=is_virtual)}
