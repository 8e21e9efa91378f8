"""What is subscribed to and what is told, as forms and documents."""

from __future__ import annotations

import re

import pytest

from abb_protocols.errors import ProtocolError
from abb_protocols.rws.documents import RwsLink, RwsState, decode_form
from abb_protocols.rws.values import Priority, Resource
from abb_runtime.rws.client import (
    Change,
    event_log,
    group_of,
    read_changes,
    signal_state,
    variable_value,
    write_resources,
)
from refusals import refused
from virtual_irc5.rws import render as virtual_documents
from virtual_irc5.rws.subscriptions import read_resources

RESOURCES = (Resource("/rw/panel/opmode"), signal_state("EGM_STOP"), variable_value("T_ROB_R", "M", "v", Priority.LOW))
SIGNAL = "/rw/iosystem/signals/EGM_STOP;state"


def event(href: str, **fields: str) -> tuple[RwsState]:
    return (RwsState("x-ev", "title", fields, (RwsLink("self", href),)),)


def told(*events: tuple[RwsState, ...], paths: tuple[str, ...] = ()) -> tuple[Change, ...]:
    return tuple(
        change for each in events for change in read_changes(virtual_documents.render_event("yumi:80", 5, each), paths)
    )


def test_resources_survive_their_form() -> None:
    assert read_resources(write_resources(RESOURCES)) == RESOURCES


def test_resources_are_read_in_the_order_of_other_clients() -> None:
    form = decode_form("1=%2Frw%2Fpanel%2Fopmode&1-p=1&2=/rw/elog/0&2-p=0&resources=1&resources=2")
    assert read_resources(form) == (Resource("/rw/panel/opmode"), Resource("/rw/elog/0", Priority.LOW))


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ("1=/rw/panel/opmode&1-p=1", "the body lacks resources"),
        ("resources=1&1-p=1", "the body lacks 1"),
        ("resources=1&1=/rw/panel/opmode", "the body lacks 1-p"),
        ("resources=1&1=/rw/panel/opmode&1-p=7", "1-p is 0, 1 or 2, not '7'"),
    ],
)
def test_form_that_lacks_something_is_refused(body: str, sentence: str) -> None:
    with pytest.raises(ProtocolError) as refused:
        read_resources(decode_form(body))
    assert str(refused.value) == sentence


def test_event_is_told_with_its_fields() -> None:
    assert told(event(SIGNAL, lvalue="1")) == (Change(SIGNAL, {"lvalue": "1"}),)


@pytest.mark.parametrize(
    ("href", "path"),
    [
        ("/rw/iosystem/signals/Local/DRV_1/EGM_STOP;state", SIGNAL),
        ("/rw/elog/0/19", event_log().path),
        ("/rw/elog/1/19", "/rw/elog/1/19"),
    ],
)
def test_change_has_the_path_that_was_subscribed(href: str, path: str) -> None:
    assert told(event(href), paths=("/rw/panel/opmode", SIGNAL, event_log().path))[0].path == path


def test_value_of_a_variable_comes_in_a_second_state() -> None:
    states = (*event("/rw/v;value"), RwsState("rap-data", "RAPID/T/M/v", {"value": '"ä<b>"'}))
    assert told(states) == (Change("/rw/v;value", {"value": '"ä<b>"'}),)


def test_event_is_one_line_of_ascii_that_ends_a_link_as_common_clients_expect() -> None:
    text = virtual_documents.render_event("192.168.125.1:80", 5, event(SIGNAL, lvalue="ä\n"))
    assert "\n" not in text
    assert text.isascii()
    assert '<a href="subscription/5" rel="group"></a>' in text
    assert re.search(r'<a\s+href="/rw/iosystem/signals/([^"]+);state"\s+rel="self"/?>.*<span\s+class="lvalue">', text)


def test_event_too_long_for_common_clients_is_told_without_its_value() -> None:
    text = virtual_documents.render_event("yumi:80", 5, event(SIGNAL, lvalue="x" * 1024))
    assert len(text) <= virtual_documents.MAX_EVENT
    assert told(event(SIGNAL, lvalue="x" * 1024)) == (Change(SIGNAL),)


def test_group_names_its_web_socket_as_common_clients_expect() -> None:
    body = virtual_documents.write_group("192.168.125.1:80", 5, [event(SIGNAL)]).decode("ascii")
    assert re.search(r'<a href="ws:\/\/.*(\/poll\/\d+)" rel="self">', body)
    assert group_of(body) == 5
    assert group_of("http://yumi/") is None


def test_message_that_is_no_document_is_refused() -> None:
    with refused(ProtocolError, "document_not_well_formed"):
        read_changes("hello", ())
