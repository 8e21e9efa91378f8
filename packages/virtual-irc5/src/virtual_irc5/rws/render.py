"""The documents of the virtual controller: pages, errors and events as XHTML, JSON, or HAL of RobotWare 7.

Clients cut them with regular expressions and receive events into buffers of 1024 bytes, so spelling and length count:
events are one line of ASCII (reference/rws.md §3, §14).
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any
from xml.sax.saxutils import escape

from abb_protocols.rws.documents import XMLNS, Form, Page, RwsLink, RwsState, Status
from abb_protocols.rws.operations.operation import Operation

_XML = '<?xml version="1.0" encoding="UTF-8"?>'
_ILLEGAL_IN_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_NOTHING_TO_ESCAPE = re.compile("[ !#-%'-;=?-~]*")  # most texts: nothing in them has to be escaped
_ENTITIES = {'"': "&quot;", "\t": "&#9;", "\n": "&#10;", "\r": "&#13;"}

MAX_EVENT = 1024
"""What the receive buffers of common clients hold [byte]."""


def page_at(title: str, base: str, href: str, *states: RwsState, next_href: str | None = None) -> Page:
    """A page with the links every resource has; ``base`` is a path, the service puts the host before it."""
    links = (RwsLink("self", href), RwsLink("action", f"{href}{'&' if '?' in href else '?'}action=show"))
    more = () if next_href is None else (RwsLink("next", next_href),)
    return Page(title, base, states, links + more)


def page_entry(type: str, title: str, href: str | None = None, /, **fields: str) -> RwsState:
    """An entry of a list that leads to ``href``, by default its title; ``_`` in field names stands for ``-``."""
    named = {name.replace("_", "-"): text for name, text in fields.items()}
    return RwsState(type, title, named, (RwsLink("self", title if href is None else href),))


_TITLES = {
    "dipc": "RobAPI2 DIPC",
    "elog": "Elog",
    "fileservice": "File Service",
    "iosystem": "io",
    "mastership": "MasterShip",
    "users": "ROBAPI2 User",
}
"""Of pages, by service, where it is not the service."""

_BASES = ("/rw/cfg/", "/rw/elog/", "/rw/iosystem/")
"""Of links in pages below them; elsewhere it is what is before the last part of the address."""


def page_of(operation: Operation[Any], path: Sequence[str], values: Mapping[str, object]) -> Page:
    """The page of an operation's values by their titles; its address has the spelling of the titles."""
    answer = operation.answered
    spelled = {title.lower(): title for title in values}
    segments = [spelled.get(segment.lower(), segment) for segment in path]
    states = (answer.state(title, value) for title, value in values.items())
    address = "/".join(("", *segments))
    base = next((each for each in _BASES if address.startswith(each)), f"{address.rpartition('/')[0]}/")
    return page_at(_TITLES.get(operation.service, operation.service), base, address.removeprefix(base), *states)


def write_page(page: Page, form: Form) -> bytes:
    """The page as a document: XHTML on one line after the XML declaration, as clients match it line by line.

    The title has no place in JSON.
    """
    if form is Form.JSON:
        links = {"base": {"href": page.base}} | _json_links(page.links)
        return _json_bytes({"_links": links, "_embedded": {"_state": [_json_state(state) for state in page.states]}})
    states = "".join(map(_list_item, page.states))
    content = f'<div class="state">{_anchors(page.links)}<ul>{states}</ul></div>'
    return f"{_XML}\n{_html(page.title, page.base, content)}".encode("utf-8", "replace")


def write_status(status: Status, form: Form, *, base: str, title: str = "rw") -> bytes:
    """The status as an error document; its code is a number in JSON."""
    if form is Form.JSON:
        embedded = {"status": {"code": status.code, "msg": status.message}, "_state": []}
        return _json_bytes({"_links": {"base": {"href": base}}, "_embedded": embedded})
    content = f'<div class="status">{_span("code", f"{status.code:d}")}{_span("msg", status.message)}</div>'
    return f"{_XML}\n{_html(title, base, content)}".encode("utf-8", "replace")


def write_hal(page: Page) -> bytes:
    """The page as HAL of RobotWare 7: what has an address of its own is embedded, the rest is the page's state.

    Names are those of the XHTML, and all values are texts.
    """
    document: dict[str, object] = {"_links": {"base": {"href": page.base}} | _hal_links(page.links)}
    own = [_hal_state(state) for state in page.states if not state.links]
    embedded = [_hal_state(state) for state in page.states if state.links]
    if not embedded:
        document["status"] = {"code": _HAL_SUCCESS}
    if own or not embedded:
        document["state"] = own
    if embedded:
        document["_embedded"] = {"resources": embedded}
    return _json_bytes(document)


def write_hal_status(status: Status, base: str) -> bytes:
    """The status as an error document of RobotWare 7."""
    return _json_bytes({"_links": {"base": {"href": base}}, "status": {"code": status.code, "msg": status.message}})


def write_group(root: str, group: int, events: Sequence[Sequence[RwsState]], *, is_secure: bool = False) -> bytes:
    """The answer to a subscription, with the values of this moment; ``root`` is ``host:port`` of the controller."""
    links = (
        f'<a href="subscription/{group}" rel="group"></a>'
        f'<a href="{"wss" if is_secure else "ws"}://{_escaped(root)}/poll/{group}" rel="self"></a>'
    )
    if not is_secure:
        links += f'<a href="subscription/{group}?action=show" rel="action"></a>'
    return _event_document(root, links, (state for event in events for state in event), is_secure)


def render_event(root: str, group: int, event: Sequence[RwsState], *, is_secure: bool = False) -> str:
    """The message with one event; common clients look for one only in each.

    What is too long for their buffers is sent without its value, which a client can read where the link leads.
    """
    link = f'<a href="subscription/{group}" rel="group"></a>'
    text = _event_document(root, link, event, is_secure)
    if len(text) > MAX_EVENT:
        text = _event_document(root, link, [replace(event[0], fields={})], is_secure)
    return text.decode("ascii")


def _event_document(root: str, links: str, states: Iterable[RwsState], is_secure: bool) -> bytes:
    content = f'<div class="state">{links}<ul>{"".join(map(_list_item, states))}</ul></div>'
    base = f"{'https' if is_secure else 'http'}://{root}/"
    return f"{_XML}{_html('Event', base, content)}".encode("ascii", "xmlcharrefreplace")


# XHTML


def _html(title: str, base: str, content: str) -> str:
    head = f'<head><title>{_escaped(title)}</title><base href="{_escaped(base)}"/></head>'
    return f'<html xmlns="{XMLNS}">{head}<body>{content}</body></html>'


def _list_item(state: RwsState) -> str:
    spans = "".join([_span(name, text) for name, text in state.fields.items()])
    arguments = "".join(
        f'<span class="arg{number}" type="{_escaped(argument.type)}">{_escaped(argument.value)}</span>'
        for number, argument in enumerate(state.arguments, start=1)
    )
    children = f"<ul>{''.join(map(_list_item, state.children))}</ul>" if state.children else ""
    head = f'<li class="{_escaped_name(state.type)}" title="{_escaped(state.title)}">'
    return f"{head}{_anchors(state.links)}{spans}{arguments}{children}</li>"


def _anchors(links: tuple[RwsLink, ...]) -> str:
    return "".join([f'<a href="{_escaped(link.href)}" rel="{_escaped_name(link.rel)}"/>' for link in links])


def _span(name: str, text: str) -> str:
    return f'<span class="{_escaped_name(name)}">{_escaped(text)}</span>'


def _escaped(text: str) -> str:
    return text if _NOTHING_TO_ESCAPE.fullmatch(text) else escape(_ILLEGAL_IN_XML.sub("\ufffd", text), _ENTITIES)


_escaped_name = lru_cache(1024)(_escaped)
"""For types, names of fields and relations: there are few, and each page has many of them."""

# JSON


# Where it differs from the XHTML (reference/rws.md §3.2).
_JSON_FIELD_NAMES: Mapping[str, Mapping[str, str]] = {
    "ms-robtargets": {f"eax_{letter}": f"eax{letter}" for letter in "abcdef"},
    "ms-mechunit": {
        "task-name": "task",
        "is-integrated-unit": "is-integrated-unitname",
        "has-integrated-unit": "has-integrated-unitname",
    },
    "ctrl-env": {"value": "_value"},
}
_JSON_TYPES = {"elog-message-li": "elog-message"}
_LIST_NAMES = {
    "sys-option-li": "options",
    "cfg-ia-t-li": "attrib",
    "sys-option": "options",
    "cfg-ia-t": "attrib",
    "sys-energy-mec-li": "mec",
    "sys-energy-axis-li": "axis",
    "dev-id-li": "devices",
}
_NUMBER_FIELDS = ("lvalue", "pvalue")
_ENCODER = json.JSONEncoder(ensure_ascii=False, separators=(",", ":"))


def _json_bytes(value: object) -> bytes:
    return _ENCODER.encode(value).encode("utf-8", "replace")


def _json_state(state: RwsState) -> dict[str, object]:
    names = _JSON_FIELD_NAMES.get(state.type, {})
    result: dict[str, object] = {"_type": _JSON_TYPES.get(state.type, state.type), "_title": state.title}
    if state.links:
        result["_links"] = _json_links(state.links)
    for name, text in state.fields.items():
        result[names.get(name, name)] = _number_or_text(text) if name in _NUMBER_FIELDS else text
    if state.arguments:
        result["argv"] = [{"type": argument.type, "value": argument.value} for argument in state.arguments]
    if state.children:
        result[_LIST_NAMES.get(state.children[0].type, "state")] = [_json_state(child) for child in state.children]
    return result


def _number_or_text(text: str) -> float | str:
    """The number a text is; the text where it is none."""
    try:
        return int(text) if text.lstrip("-").isdecimal() else float(text)
    except ValueError:
        return text


def _json_links(links: tuple[RwsLink, ...]) -> dict[str, dict[str, str]]:
    return {link.rel: {"href": f"{link.href}{'&' if '?' in link.href else '?'}json=1"} for link in links}


# HAL


_HAL_SUCCESS = 294912
_HAL_TYPES = {"sys-option": "sys-options"}  # where it differs from the XHTML


def _hal_state(state: RwsState) -> dict[str, object]:
    result: dict[str, object] = {"_links": _hal_links(state.links)} if state.links else {}
    result |= {"_type": _HAL_TYPES.get(state.type, state.type), "_title": state.title, **state.fields}
    if state.arguments:
        result["argv"] = [{"type": argument.type, "value": argument.value} for argument in state.arguments]
    if state.children:
        result[_LIST_NAMES.get(state.children[0].type, "state")] = [_hal_state(child) for child in state.children]
    return result


def _hal_links(links: tuple[RwsLink, ...]) -> dict[str, dict[str, str]]:
    return {link.rel: {"href": link.href} for link in links}
