"""Pages and statuses as XHTML documents, the default representation (reference/rws.md §3.1, §3.4)."""

from __future__ import annotations

import re
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from yumi.errors import ProtocolError
from yumi.rws.pages import Argument, Link, Page, State, Status

CONTENT_TYPE = "application/xhtml+xml"

_XML = '<?xml version="1.0" encoding="UTF-8"?>'
_XMLNS = "http://www.w3.org/1999/xhtml"
_ILLEGAL = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_ENTITIES = {
    "&": "&amp;",
    "<": "&lt;",
    ">": "&gt;",
    '"': "&quot;",
    "\t": "&#9;",
    "\n": "&#10;",
    "\r": "&#13;",
}
_SPECIAL = re.compile('[&<>"\t\n\r]')
_ARGUMENT = re.compile(r"arg\d+")
_DEEPEST = 32  # lists within lists; a controller's pages have two
_LARGEST = 16 * 1024 * 1024  # [byte]; a page holds 100 items at most (reference/rws.md §1.1)


def write_page(page: Page) -> str:
    """The page on one line after the XML declaration; clients match it line by line."""
    states = "".join(map(write_item, page.states))
    content = f'<div class="state">{_anchors(page.links)}<ul>{states}</ul></div>'
    return _document(page.title, page.base, content)


def write_status(status: Status, title: str, base: str) -> str:
    """An error document."""
    content = f'<div class="status">{_span("code", str(status.code))}{_span("msg", status.message)}</div>'
    return _document(title, base, content)


def read_page(body: bytes) -> Page:
    """The page in an XHTML document.

    Raises:
        ProtocolError: it is not the XHTML of Robot Web Services.
    """
    root = _parse(body)
    division = _division(root, "state")
    states = tuple(_state(item) for item in division.findall("ul/li"))
    title = root.findtext("head/title") or ""
    base = root.find("head/base")
    return Page(title, "" if base is None else base.get("href", ""), states, _links(division))


def read_status(body: bytes) -> Status:
    """The status in an XHTML error document.

    Raises:
        ProtocolError: there is none.
    """
    division = _division(_parse(body), "status")
    texts = {span.get("class"): span.text or "" for span in division.findall("span")}
    try:
        return Status(int(texts["code"]), texts.get("msg", ""))
    except (KeyError, ValueError) as error:
        raise ProtocolError("The controller's error document holds no code.") from error


def _document(title: str, base: str, content: str) -> str:
    head = f'<head><title>{escaped(title)}</title><base href="{escaped(base)}"/></head>'
    return f'{_XML}\n<html xmlns="{_XMLNS}">{head}<body>{content}</body></html>'


def write_item(state: State) -> str:
    """A state as an item of a list."""
    spans = "".join(_span(name, text) for name, text in state.fields.items())
    arguments = "".join(
        f'<span class="arg{number}" type="{escaped(argument.type)}">{escaped(argument.value)}</span>'
        for number, argument in enumerate(state.arguments, start=1)
    )
    children = f"<ul>{''.join(map(write_item, state.children))}</ul>" if state.children else ""
    head = f'<li class="{escaped(state.type)}" title="{escaped(state.title)}">'
    return f"{head}{_anchors(state.links)}{spans}{arguments}{children}</li>"


def _anchors(links: tuple[Link, ...]) -> str:
    return "".join(f'<a href="{escaped(link.href)}" rel="{escaped(link.rel)}"/>' for link in links)


def _span(name: str, text: str) -> str:
    return f'<span class="{escaped(name)}">{escaped(text)}</span>'


def escaped(text: str) -> str:
    """``text`` as it may stand in a document."""
    return _SPECIAL.sub(lambda match: _ENTITIES[match.group()], _ILLEGAL.sub("\ufffd", text))


def _parse(body: bytes) -> Element:
    """The document without its namespace; a DOCTYPE is refused, since entities can be made to explode."""
    if len(body) > _LARGEST:
        raise ProtocolError(f"The answer is a document of {len(body)} bytes; a controller's has {_LARGEST} at most.")
    try:
        text = body.decode("utf-8")
        if "<!DOCTYPE" in text:
            raise ProtocolError("The answer is a document with a DOCTYPE, which no controller sends.")
        root = ElementTree.fromstring(text)
    except (UnicodeDecodeError, ValueError, RecursionError, ElementTree.ParseError) as error:
        raise ProtocolError("The answer is not well-formed XHTML.") from error
    for element in root.iter():
        element.tag = element.tag.removeprefix(f"{{{_XMLNS}}}")
    return root


def _division(root: Element, kind: str) -> Element:
    for division in root.iterfind("body/div"):
        if division.get("class") == kind:
            return division
    raise ProtocolError(f"The answer is not a document of Robot Web Services: it has no {kind!r} division.")


def _state(item: Element, depth: int = 1) -> State:
    if depth > _DEEPEST:
        raise ProtocolError(f"The answer has more than {_DEEPEST} lists within each other, which no controller sends.")
    spans = item.findall("span")
    arguments = tuple(Argument(span.get("type", ""), span.text or "") for span in spans if _is_argument(span))
    fields = {span.get("class", ""): span.text or "" for span in spans if not _is_argument(span)}
    children = tuple(_state(child, depth + 1) for child in item.findall("ul/li"))
    return State(item.get("class", ""), item.get("title", ""), fields, _links(item), children, arguments)


def _is_argument(span: Element) -> bool:
    return span.get("type") is not None and _ARGUMENT.fullmatch(span.get("class", "")) is not None


def _links(element: Element) -> tuple[Link, ...]:
    return tuple(Link(anchor.get("rel", ""), anchor.get("href", "")) for anchor in element.findall("a"))
