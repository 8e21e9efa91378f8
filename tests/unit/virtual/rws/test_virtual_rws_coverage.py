"""Every operation of Robot Web Services, in both representations, with the code of its line in the table."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from urllib.parse import urljoin, urlsplit

import pytest

from abb_protocols.rws.documents import RwsLink, RwsState, read_page, read_status
from rws_examples import EXAMPLES, Example, Session, content_type, operation_of
from virtual_irc5.rws.http import HttpReply
from virtual_irc5.rws.render import _JSON_FIELD_NAMES, _JSON_TYPES


@pytest.fixture(scope="module")
def session() -> Session:
    return Session()


def in_json(body: bytes) -> list[tuple[str, str, list[str]]]:
    document = json.loads(body)
    if "status" in document["_embedded"]:
        return [("status", str(document["_embedded"]["status"]["code"]), [])]
    return [
        (
            state["_type"],
            re.sub(r"/\d+$", "", state["_title"]),  # setups number what they make
            sorted(
                name
                for name, value in state.items()
                if not isinstance(value, (list, dict)) and name not in ("_type", "_title")
            ),
        )
        for state in document["_embedded"]["_state"]
    ]


def in_xhtml(reply: HttpReply) -> list[tuple[str, str, list[str]]]:
    if reply.status >= 400:
        return [("status", str(read_status(content_type(reply), reply.body).code), [])]
    page = read_page(content_type(reply), reply.body)
    return [
        (
            _JSON_TYPES.get(state.type, state.type),
            re.sub(r"/\d+$", "", state.title),
            sorted(_JSON_FIELD_NAMES.get(state.type, {}).get(name, name) for name in state.fields),
        )
        for state in page.states
    ]


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda each: f"{each.method} {each.target}")
def test_operation_is_answered_in_both_representations(session: Session, example: Example) -> None:
    operation = operation_of(session, example)
    xhtml, data = example.send(session), example.send(session, "json")
    expected = (operation.success, operation.success)
    assert (xhtml.status, data.status) == expected, (xhtml.body, data.body)
    if b"<html" in xhtml.body and content_type(data) == "application/json":
        assert in_xhtml(xhtml) == in_json(data.body)


def test_every_operation_has_an_example(session: Session) -> None:
    found = Counter(id(operation_of(session, example)) for example in EXAMPLES)
    missing = [each for each in session.service.operations if id(each) not in found]
    assert [(each.method, each.path, each.action, each.resource) for each in missing] == []


def links(states: Iterable[RwsState]) -> Iterator[RwsLink]:
    for state in states:
        yield from state.links
        yield from links(state.children)


NOT_NOW = ("/subscription", "/rw/rapid/modules", "/rw/rapid/uiinstr/active")
"""Named by other pages, and readable with a number, a task, and a question of a program."""


@pytest.mark.parametrize(
    "example", [each for each in EXAMPLES if each.method == "GET"], ids=lambda each: f"{each.method} {each.target}"
)
def test_links_of_a_page_lead_to_resources(session: Session, example: Example) -> None:
    reply = example.send(session)
    if reply.status != 200 or b"<html" not in reply.body:
        return
    page = read_page(content_type(reply), reply.body)
    for link in (*page.links, *links(page.states)):
        url = urlsplit(urljoin(page.base, link.href))
        if url.scheme == "http" and link.rel != "action":
            target = f"{url.path}?{url.query}" if url.query else url.path
            is_there = session.ask("GET", target).status in (200, 204)
            assert is_there or target in NOT_NOW, f"{link.href} leads to {target}"
