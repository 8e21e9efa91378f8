"""Every operation of Robot Web Services, in both representations, with the code of its line in the table."""

from __future__ import annotations

import json
import re
from collections import Counter

import pytest

from rws_examples import EXAMPLES, Example, Session
from yumi.rws.documents import decode_form, read_page, read_status
from yumi.virtual.rws.documents import _FIELD_NAMES, _TYPES
from yumi.virtual.rws.http import HttpReply
from yumi.virtual.rws.operations import Call, Operation


@pytest.fixture(scope="module")
def session() -> Session:
    return Session()


def operation_of(session: Session, example: Example) -> Operation:
    path, _, query = re.sub("{[a-z]+}", "1", example.target).partition("?")
    segments = tuple(part.partition(";")[0] for part in path.split("/") if part)
    return session.service._router.find(Call(example.method, segments, decode_form(query)))[0]


def content_type(reply: HttpReply) -> str:
    return reply.header("Content-Type") or ""


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
            _TYPES.get(state.type, state.type),
            re.sub(r"/\d+$", "", state.title),
            sorted(_FIELD_NAMES.get(state.type, {}).get(name, name) for name in state.fields),
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
