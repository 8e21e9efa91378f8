from __future__ import annotations

import json
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from abb_protocols.errors import ProtocolError
from abb_protocols.rws.documents import (
    EventArgument,
    Form,
    Page,
    RwsLink,
    RwsState,
    Status,
    decode_form,
    encode_form,
    first_value,
    read_page,
    read_status,
)
from refusals import refused
from virtual_irc5.rws.render import write_page, write_status

LEGAL = st.characters(exclude_categories=("Cs", "Cc"), exclude_characters="￾￿")
texts = st.text(LEGAL | st.sampled_from("\t\n\r\"'<>&;"), max_size=12)
names = st.from_regex(r"[a-z][a-z0-9-]{0,10}", fullmatch=True)
fields = st.dictionaries(names.filter(lambda name: name not in ("lvalue", "pvalue", "argv")), texts, max_size=4)
links = st.dictionaries(names.filter("base".__ne__), names, max_size=3).map(
    lambda hrefs: tuple(RwsLink(rel, href) for rel, href in hrefs.items())
)
arguments = st.lists(st.builds(EventArgument, names, texts), max_size=3).map(tuple)
children = st.lists(st.builds(RwsState, st.just("cfg-ia-t-li"), texts, fields), max_size=3).map(tuple)
states = st.builds(RwsState, names, texts, fields, links, children, arguments)
pages = st.builds(Page, texts, texts, st.lists(states, max_size=3).map(tuple), links)

CTRLSTATE = Page(
    "panel",
    "http://192.168.125.1/rw/panel/",
    (RwsState("pnl-ctrlstate", "ctrlstate", {"ctrlstate": "motoron"}),),
    (RwsLink("self", "ctrlstate"),),
)


def json_of(page: Page) -> dict[str, object]:
    return json.loads(write_page(page, Form.JSON))  # type: ignore[no-any-return]


@given(pages)
def test_xhtml_page_brings_back_what_was_written(page: Page) -> None:
    assert read_page(Form.XHTML.value, write_page(page, Form.XHTML)) == page


def as_json(state: RwsState) -> dict[str, object]:
    """What a controller's JSON says of a state none of whose names deviate."""
    shown: dict[str, object] = {"_type": state.type, "_title": state.title, **state.fields}
    if state.links:
        shown["_links"] = {link.rel: {"href": f"{link.href}?json=1"} for link in state.links}
    if state.arguments:
        shown["argv"] = [{"type": each.type, "value": each.value} for each in state.arguments]
    if state.children:
        shown["attrib"] = [as_json(child) for child in state.children]
    return shown


@given(pages)
def test_json_page_says_all_but_the_title(page: Page) -> None:
    document = json_of(page)
    assert document["_embedded"] == {"_state": [as_json(state) for state in page.states]}
    links = {link.rel: {"href": f"{link.href}?json=1"} for link in page.links}
    assert document["_links"] == {"base": {"href": page.base}, **links}


@given(st.builds(Status, st.integers(), texts))
def test_status_survives_xhtml(status: Status) -> None:
    assert read_status(Form.XHTML.value, write_status(status, Form.XHTML, base="http://h/")) == status


@given(st.builds(Status, st.integers(), texts))
def test_status_is_said_in_json(status: Status) -> None:
    document = json.loads(write_status(status, Form.JSON, base="http://h/"))
    assert document["_embedded"]["status"] == {"code": status.code, "msg": status.message}


def test_xhtml_is_one_line_after_the_declaration() -> None:
    assert write_page(CTRLSTATE, Form.XHTML).decode() == (
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
    page = Page("rapid", "", (RwsState("rap-data", "x", {"value": '"a<b"'}),))
    assert b"&quot;a&lt;b&quot;" in write_page(page, Form.XHTML)


def test_logical_value_is_a_number_in_json_only() -> None:
    page = Page("io", "", (RwsState("ios-signal", "x", {"lvalue": "1"}),))
    assert b'"lvalue":1' in write_page(page, Form.JSON)
    assert read_page(Form.XHTML.value, write_page(page, Form.XHTML)).states == page.states


@pytest.mark.parametrize(
    ("kind", "ours", "theirs"),
    [
        ("ms-robtargets", "eax_a", "eaxa"),
        ("ms-mechunit", "task-name", "task"),
        ("ms-mechunit", "has-integrated-unit", "has-integrated-unitname"),
    ],
)
def test_json_spells_some_fields_otherwise(kind: str, ours: str, theirs: str) -> None:
    page = Page("", "", (RwsState(kind, "x", {ours: "1"}),))
    assert f'"{theirs}":"1"'.encode() in write_page(page, Form.JSON)


def test_character_xml_cannot_carry_is_replaced() -> None:
    page = Page("", "", (RwsState("rap-data", "x", {"value": "a\x00\ud800b"}),))
    assert read_page(Form.XHTML.value, write_page(page, Form.XHTML)).states[0].text("value") == "a��b"


BOMB = b'<!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><html><body>&b;</body></html>'


@pytest.mark.parametrize(
    ("kind", "body", "code", "values"),
    [
        ("application/xhtml+xml", BOMB, "document_with_doctype", {}),
        ("application/xhtml+xml", BOMB.decode().encode("utf-16"), "document_not_well_formed", {}),
        ("application/xhtml+xml", b"<html>", "document_not_well_formed", {}),
        (
            "text/html",
            b"<html><body><p>It works</p></body></html>",
            "document_without_division",
            {"division": "state"},
        ),
        ("application/json", b'{"_embedded":{"_state":[]}}', "answer_not_xhtml", {"kind": "application/json"}),
        ("image/png", b"", "answer_not_xhtml", {"kind": "image/png"}),
        ("", b"", "answer_of_no_type", {}),
    ],
)
def test_body_of_another_kind_is_refused(kind: str, body: bytes, code: str, values: dict[str, str]) -> None:
    with refused(ProtocolError, code, **values):
        read_page(kind, body)


def test_xhtml_status_without_a_code_is_refused() -> None:
    with refused(ProtocolError, "error_without_code"):
        read_status("text/html", b'<html><body><div class="status"></div></body></html>')


def test_page_says_which_state_is_missing() -> None:
    with refused(ProtocolError, "answer_without_state", types=("pnl-opmode",)):
        CTRLSTATE.one("pnl-opmode")


def test_state_says_which_field_is_missing() -> None:
    missing = {"type": "pnl-ctrlstate", "title": "ctrlstate", "field": "opmode"}
    with refused(ProtocolError, "state_without_field", **missing):
        CTRLSTATE.states[0].text("opmode")


def nested_xhtml(depth: int) -> bytes:
    lists = "<ul><li>" * depth + "</li></ul>" * depth
    return f'<html xmlns="http://www.w3.org/1999/xhtml"><body><div class="state">{lists}</div></body></html>'.encode()


def test_page_is_read_to_a_depth_that_no_controller_needs_and_no_further() -> None:
    assert len(read_page("application/xhtml+xml", nested_xhtml(32)).states) == 1
    for depth in (33, 300, 1000, 100_000):
        with refused(ProtocolError, "document_nested_too_deeply", most=32):
            read_page("application/xhtml+xml", nested_xhtml(depth))


def test_page_that_is_larger_than_any_of_a_controller_is_not_read() -> None:
    with refused(ProtocolError, "document_too_long", size=16777217, most=16777216):
        read_page("application/xhtml+xml", b" " * (16 * 1024 * 1024 + 1))


@pytest.mark.parametrize("kind", ["application/xhtml+xml", "text/html"])
@given(body=st.binary(max_size=300))
def test_page_of_any_bytes_is_read_or_refused(kind: str, body: bytes) -> None:
    with suppress(ProtocolError):
        read_page(kind, body)


any_texts = st.text(alphabet=st.characters(exclude_categories=("Cs",)))


@given(st.lists(st.tuples(any_texts, any_texts).filter(any)))
def test_form_brings_back_what_was_written(pairs: list[tuple[str, str]]) -> None:
    assert decode_form(encode_form(pairs)) == tuple(pairs)


@pytest.mark.parametrize(
    ("raw", "value"),
    [
        ('value=[[1,2,3],"abc"]', '[[1,2,3],"abc"]'),
        ("value=%5B%5B1%2C2%5D%5D", "[[1,2]]"),
        ("value=1e+06", "1e+06"),
        ("value=[1.5E+09,2.E+10]", "[1.5E+09,2.E+10]"),
        ('value="move+to+7"', '"move to 7"'),
        ('value="50% full"', '"50% full"'),
        ("value=a=b", "a=b"),
        ("value=", ""),
        ("value", ""),
    ],
)
def test_value_is_read_whether_escaped_or_raw(raw: str, value: str) -> None:
    assert decode_form(raw) == (("value", value),)


def test_form_is_split_only_at_ampersands() -> None:
    assert decode_form("resources=0&0=/rw/rapid/execution;ctrlexecstate&0-p=1") == (
        ("resources", "0"),
        ("0", "/rw/rapid/execution;ctrlexecstate"),
        ("0-p", "1"),
    )


def test_first_value_counts_when_a_name_repeats() -> None:
    assert first_value(decode_form("json=1&json=2"), "json") == "1"


def test_missing_name_has_no_value() -> None:
    assert first_value((), "json") is None
