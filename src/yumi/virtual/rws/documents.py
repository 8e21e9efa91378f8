"""A controller's documents: pages and errors as XHTML or JSON, events as XHTML (reference/rws.md §3, §14).

Clients cut them with regular expressions and receive events into buffers of 1024 bytes, so spelling and length count:
events are one line of ASCII.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from xml.sax.saxutils import escape

from yumi.rws.documents import XMLNS, Form, Link, Page, State, Status

_XML = '<?xml version="1.0" encoding="UTF-8"?>'
_ILLEGAL = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_PLAIN = re.compile("[ !#-%'-;=?-~]*")  # most texts: nothing in them has to be escaped
_ENTITIES = {'"': "&quot;", "\t": "&#9;", "\n": "&#10;", "\r": "&#13;"}

MAX_EVENT = 1024
"""What the receive buffers of common clients hold [byte]."""


def write_page(page: Page, form: Form) -> bytes:
    """The page as a document: XHTML on one line after the XML declaration, as clients match it line by line.

    The title has no place in JSON.
    """
    if form is Form.JSON:
        links = {"base": {"href": page.base}} | _json_links(page.links)
        return _dump({"_links": links, "_embedded": {"_state": [_json_state(state) for state in page.states]}})
    states = "".join(map(_item, page.states))
    content = f'<div class="state">{_anchors(page.links)}<ul>{states}</ul></div>'
    return f"{_XML}\n{_html(page.title, page.base, content)}".encode("utf-8", "replace")


def write_status(status: Status, form: Form, *, base: str, title: str = "rw") -> bytes:
    """The status as an error document; its code is a number in JSON."""
    if form is Form.JSON:
        embedded = {"status": {"code": status.code, "msg": status.message}, "_state": []}
        return _dump({"_links": {"base": {"href": base}}, "_embedded": embedded})
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
    return _dump(document)


def write_hal_status(status: Status, base: str) -> bytes:
    """The status as an error document of RobotWare 7."""
    return _dump({"_links": {"base": {"href": base}}, "status": {"code": status.code, "msg": status.message}})


def write_group(root: str, group: int, events: Sequence[Sequence[State]], *, is_secure: bool = False) -> bytes:
    """The answer to a subscription, with the values of this moment; ``root`` is ``host:port`` of the controller."""
    links = (
        f'<a href="subscription/{group}" rel="group"></a>'
        f'<a href="{"wss" if is_secure else "ws"}://{_escaped(root)}/poll/{group}" rel="self"></a>'
    )
    if not is_secure:
        links += f'<a href="subscription/{group}?action=show" rel="action"></a>'
    return _event(root, links, (state for event in events for state in event), is_secure)


def write_event(root: str, group: int, event: Sequence[State], *, is_secure: bool = False) -> str:
    """The message with one event; common clients look for one only in each.

    What is too long for their buffers is sent without its value, which a client can read where the link leads.
    """
    link = f'<a href="subscription/{group}" rel="group"></a>'
    text = _event(root, link, event, is_secure)
    if len(text) > MAX_EVENT:
        text = _event(root, link, [replace(event[0], fields={})], is_secure)
    return text.decode("ascii")


def _event(root: str, links: str, states: Iterable[State], is_secure: bool) -> bytes:
    content = f'<div class="state">{links}<ul>{"".join(map(_item, states))}</ul></div>'
    base = f"{'https' if is_secure else 'http'}://{root}/"
    return f"{_XML}{_html('Event', base, content)}".encode("ascii", "xmlcharrefreplace")


# XHTML


def _html(title: str, base: str, content: str) -> str:
    head = f'<head><title>{_escaped(title)}</title><base href="{_escaped(base)}"/></head>'
    return f'<html xmlns="{XMLNS}">{head}<body>{content}</body></html>'


def _item(state: State) -> str:
    spans = "".join([_span(name, text) for name, text in state.fields.items()])
    arguments = "".join(
        f'<span class="arg{number}" type="{_escaped(argument.type)}">{_escaped(argument.value)}</span>'
        for number, argument in enumerate(state.arguments, start=1)
    )
    children = f"<ul>{''.join(map(_item, state.children))}</ul>" if state.children else ""
    head = f'<li class="{_escaped_name(state.type)}" title="{_escaped(state.title)}">'
    return f"{head}{_anchors(state.links)}{spans}{arguments}{children}</li>"


def _anchors(links: tuple[Link, ...]) -> str:
    return "".join([f'<a href="{_escaped(link.href)}" rel="{_escaped_name(link.rel)}"/>' for link in links])


def _span(name: str, text: str) -> str:
    return f'<span class="{_escaped_name(name)}">{_escaped(text)}</span>'


def _escaped(text: str) -> str:
    return text if _PLAIN.fullmatch(text) else escape(_ILLEGAL.sub("\ufffd", text), _ENTITIES)


_escaped_name = lru_cache(1024)(_escaped)
"""For types, names of fields and relations: there are few, and each page has many of them."""


# JSON


# Where it from the XHTML (reference/rws.md §3.2).
_FIELD_NAMES: Mapping[str, Mapping[str, str]] = {
    "ms-robtargets": {f"eax_{letter}": f"eax{letter}" for letter in "abcdef"},
    "ms-mechunit": {
        "task-name": "task",
        "is-integrated-unit": "is-integrated-unitname",
        "has-integrated-unit": "has-integrated-unitname",
    },
    "ctrl-env": {"value": "_value"},
}
_TYPES = {"elog-message-li": "elog-message"}
_LISTS = {
    "sys-option-li": "options",
    "cfg-ia-t-li": "attrib",
    "sys-option": "options",
    "cfg-ia-t": "attrib",
    "sys-energy-mec-li": "mec",
    "sys-energy-axis-li": "axis",
    "dev-id-li": "devices",
}
_NUMBERS = ("lvalue", "pvalue")


_ENCODER = json.JSONEncoder(ensure_ascii=False, separators=(",", ":"))


def _dump(value: object) -> bytes:
    return _ENCODER.encode(value).encode("utf-8", "replace")


def _json_state(state: State) -> dict[str, object]:
    names = _FIELD_NAMES.get(state.type, {})
    result: dict[str, object] = {"_type": _TYPES.get(state.type, state.type), "_title": state.title}
    if state.links:
        result["_links"] = _json_links(state.links)
    for name, text in state.fields.items():
        result[names.get(name, name)] = _number(text) if name in _NUMBERS else text
    if state.arguments:
        result["argv"] = [{"type": argument.type, "value": argument.value} for argument in state.arguments]
    if state.children:
        result[_LISTS.get(state.children[0].type, "state")] = [_json_state(child) for child in state.children]
    return result


def _number(text: str) -> float | str:
    """The number a text is; the text where it is none."""
    try:
        return int(text) if text.lstrip("-").isdecimal() else float(text)
    except ValueError:
        return text


def _json_links(links: tuple[Link, ...]) -> dict[str, dict[str, str]]:
    return {link.rel: {"href": f"{link.href}{'&' if '?' in link.href else '?'}json=1"} for link in links}


# HAL


_HAL_SUCCESS = 294912
_HAL_TYPES = {"sys-option": "sys-options"}  # where it differs from the XHTML


def _hal_state(state: State) -> dict[str, object]:
    result: dict[str, object] = {"_links": _hal_links(state.links)} if state.links else {}
    result |= {"_type": _HAL_TYPES.get(state.type, state.type), "_title": state.title, **state.fields}
    if state.arguments:
        result["argv"] = [{"type": argument.type, "value": argument.value} for argument in state.arguments]
    if state.children:
        result[_LISTS.get(state.children[0].type, "state")] = [_hal_state(child) for child in state.children]
    return result


def _hal_links(links: tuple[Link, ...]) -> dict[str, dict[str, str]]:
    return {link.rel: {"href": link.href} for link in links}
