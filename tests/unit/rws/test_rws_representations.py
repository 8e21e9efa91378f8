from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from yumi.errors import ProtocolError
from yumi.rws.documents import (
    Argument,
    Form,
    Link,
    Page,
    State,
    Status,
    representations_read_page,
    representations_read_status,
    representations_write_page,
    representations_write_status,
)

LEGAL = st.characters(exclude_categories=("Cs", "Cc"), exclude_characters="￾￿")
texts = st.text(LEGAL | st.sampled_from("\t\n\r\"'<>&;"), max_size=12)
names = st.from_regex(r"[a-z][a-z0-9-]{0,10}", fullmatch=True)
fields = st.dictionaries(names.filter(lambda name: name not in ("lvalue", "pvalue", "argv")), texts, max_size=4)
links = st.dictionaries(names.filter("base".__ne__), names, max_size=3).map(
    lambda hrefs: tuple(Link(rel, href) for rel, href in hrefs.items())
)
arguments = st.lists(st.builds(Argument, names, texts), max_size=3).map(tuple)
children = st.lists(st.builds(State, st.just("cfg-ia-t-li"), texts, fields), max_size=3).map(tuple)
states = st.builds(State, names, texts, fields, links, children, arguments)
pages = st.builds(Page, texts, texts, st.lists(states, max_size=3).map(tuple), links)

CTRLSTATE = Page(
    "panel",
    "http://192.168.125.1/rw/panel/",
    (State("pnl-ctrlstate", "ctrlstate", {"ctrlstate": "motoron"}),),
    (Link("self", "ctrlstate"),),
)


def json_of(page: Page) -> dict[str, object]:
    return json.loads(representations_write_page(page, Form.JSON))  # type: ignore[no-any-return]


@given(pages)
def test_xhtml_page_brings_back_what_was_written(page: Page) -> None:
    assert representations_read_page(Form.XHTML.value, representations_write_page(page, Form.XHTML)) == page


@given(pages)
def test_json_page_brings_back_all_but_the_title(page: Page) -> None:
    assert representations_read_page(Form.JSON.value, representations_write_page(page, Form.JSON)) == replace(
        page, title=""
    )


@given(st.builds(Status, st.integers(), texts), st.sampled_from(Form))
def test_status_survives_either_form(status: Status, form: Form) -> None:
    assert (
        representations_read_status(form.value, representations_write_status(status, form, base="http://h/")) == status
    )


def test_xhtml_is_one_line_after_the_declaration() -> None:
    assert representations_write_page(CTRLSTATE, Form.XHTML).decode() == (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<html xmlns="http://www.w3.org/1999/xhtml"><head><title>panel</title>'
        '<base href="http://192.168.125.1/rw/panel/"/></head><body><div class="state">'
        '<a href="ctrlstate" rel="self"/><ul><li class="pnl-ctrlstate" title="ctrlstate">'
        '<span class="ctrlstate">motoron</span></li></ul></div></body></html>'
    )


def test_json_has_the_controllers_shape() -> None:
    assert json_of(CTRLSTATE) == {
        "_links": {"base": {"href": "http://192.168.125.1/rw/panel/"}, "self": {"href": "ctrlstate?json=1"}},
        "_embedded": {"_state": [{"_type": "pnl-ctrlstate", "_title": "ctrlstate", "ctrlstate": "motoron"}]},
    }


def test_rapid_string_is_escaped_in_xhtml() -> None:
    page = Page("rapid", "", (State("rap-data", "x", {"value": '"a<b"'}),))
    assert b"&quot;a&lt;b&quot;" in representations_write_page(page, Form.XHTML)


def test_logical_value_is_a_number_in_json_only() -> None:
    page = Page("io", "", (State("ios-signal", "x", {"lvalue": "1"}),))
    assert b'"lvalue":1' in representations_write_page(page, Form.JSON)
    assert representations_read_page(Form.JSON.value, representations_write_page(page, Form.JSON)).states == page.states


@pytest.mark.parametrize(
    ("kind", "ours", "theirs"),
    [
        ("ms-robtargets", "eax_a", "eaxa"),
        ("ms-mechunit", "task-name", "task"),
        ("ms-mechunit", "has-integrated-unit", "has-integrated-unitname"),
    ],
)
def test_json_spells_some_fields_otherwise(kind: str, ours: str, theirs: str) -> None:
    page = Page("", "", (State(kind, "x", {ours: "1"}),))
    assert f'"{theirs}":"1"'.encode() in representations_write_page(page, Form.JSON)
    assert representations_read_page(Form.JSON.value, representations_write_page(page, Form.JSON)) == page


def test_character_xml_cannot_carry_is_replaced() -> None:
    page = Page("", "", (State("rap-data", "x", {"value": "a\x00\ud800b"}),))
    assert (
        representations_read_page(Form.XHTML.value, representations_write_page(page, Form.XHTML))
        .states[0]
        .text("value")
        == "a��b"
    )


BOMB = b'<!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><html><body>&b;</body></html>'


@pytest.mark.parametrize(
    ("kind", "body", "sentence"),
    [
        ("application/xhtml+xml", BOMB, "DOCTYPE"),
        ("application/xhtml+xml", BOMB.decode().encode("utf-16"), "not well-formed"),
        ("application/xhtml+xml", b"<html>", "not well-formed"),
        ("text/html", b"<html><body><p>It works</p></body></html>", "no 'state' division"),
        ("application/json", b"[]", "not a JSON document of Robot Web Services"),
        ("application/json", b"{", "not JSON"),
        ("application/json", b"[" * 100_000, "not JSON"),
        ("application/json", b'{"_embedded":{"_state":[1]}}', "not an object"),
        ("application/json", b'{"_embedded":{}}', "no list of states"),
        ("image/png", b"", "image/png, neither XHTML nor JSON"),
        ("", b"", "of no type, neither"),
    ],
)
def test_body_of_another_kind_is_refused_with_a_sentence(kind: str, body: bytes, sentence: str) -> None:
    with pytest.raises(ProtocolError, match=sentence):
        representations_read_page(kind, body)


@pytest.mark.parametrize("body", [b'{"_embedded":{"status":{}}}', b'{"_embedded":{"_state":[]}}'])
def test_json_status_without_a_code_is_refused(body: bytes) -> None:
    with pytest.raises(ProtocolError, match="no code"):
        representations_read_status("application/json", body)


def test_xhtml_status_without_a_code_is_refused() -> None:
    with pytest.raises(ProtocolError, match="no code"):
        representations_read_status("text/html", b'<html><body><div class="status"></div></body></html>')


def test_page_says_which_state_is_missing() -> None:
    with pytest.raises(ProtocolError, match="holds no 'pnl-opmode'"):
        CTRLSTATE.one("pnl-opmode")


def test_state_says_which_field_is_missing() -> None:
    with pytest.raises(ProtocolError, match="'pnl-ctrlstate' of 'ctrlstate' lacks the field 'opmode'"):
        CTRLSTATE.states[0].text("opmode")


def nested_xhtml(depth: int) -> bytes:
    lists = "<ul><li>" * depth + "</li></ul>" * depth
    return f'<html xmlns="http://www.w3.org/1999/xhtml"><body><div class="state">{lists}</div></body></html>'.encode()


def nested_json(depth: int) -> bytes:
    states = '{"_type":"a","state":[' * depth + "]}" * depth
    return f'{{"_embedded":{{"_state":[{states}]}}}}'.encode()


@pytest.mark.parametrize(
    ("kind", "nested"), [("application/xhtml+xml", nested_xhtml), ("application/json", nested_json)]
)
def test_page_is_read_to_a_depth_that_no_controller_needs_and_no_further(
    kind: str, nested: Callable[[int], bytes]
) -> None:
    assert len(representations_read_page(kind, nested(32)).states) == 1
    for depth in (33, 300, 1000, 100_000):
        with pytest.raises(ProtocolError) as refused:
            representations_read_page(kind, nested(depth))
        assert str(refused.value).count(".") == 1


@pytest.mark.parametrize("kind", ["application/xhtml+xml", "application/json"])
def test_page_that_is_larger_than_any_of_a_controller_is_not_read(kind: str) -> None:
    with pytest.raises(ProtocolError, match="document of 16777217 bytes; a controller's has 16777216 at most"):
        representations_read_page(kind, b" " * (16 * 1024 * 1024 + 1))


@pytest.mark.parametrize("kind", ["application/xhtml+xml", "application/json"])
@given(body=st.binary(max_size=300))
def test_page_of_any_bytes_is_read_or_refused(kind: str, body: bytes) -> None:
    with suppress(ProtocolError):
        representations_read_page(kind, body)
