"""Documents of Robot Web Services: forms, pages with their states and members, XHTML, and refusals with their status.

From inside out (reference/rws.md §1, §3). What the states of a service mean is said beside its operations.

A *state* is ABB's word for one thing shown: an ``<li>`` of XHTML, an object of ``_state`` in JSON. A controller answers
with XHTML unless a client asks for JSON with ``json=1``. The client reads XHTML alone: the events of subscriptions come
in no other format, and the controller's JSON deviates from it in several names.

Names and values in queries and form bodies are written strictly and read as tolerantly as a controller does: ABB's own
C++ client sends values unescaped, Python clients percent-encode them; both must arrive as the same text.
"""

from __future__ import annotations

import builtins
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import TypeVar
from urllib.parse import quote, unquote
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from abb_protocols.catalogue import message
from abb_protocols.errors import ControllerRefused, ProtocolError
from abb_protocols.rws.values import code_meaning, code_name

_E = TypeVar("_E", bound=Enum)

Pairs = tuple[tuple[str, str], ...]

FORM_TYPE = "application/x-www-form-urlencoded"

# A raw "+" is a blank in a form, except in the exponent of a number printed by a client that escapes nothing.
_BLANK_PLUS = re.compile(r"(?<![0-9.][eE])\+|\+(?![0-9])")


def encode_form(pairs: Iterable[tuple[str, str]]) -> str:
    """``name=value&…``, everything but letters, digits and ``-._~`` percent-encoded as UTF-8."""
    return "&".join(f"{quote(name, safe='')}={quote(value, safe='')}" for name, value in pairs)


def decode_form(text: str) -> Pairs:
    """The pairs of a query or form body, in order.

    The text is split only at ``&``: a ``;`` belongs to the values of subscriptions. A name without ``=`` has
    the value "".
    """
    pairs = (part.partition("=") for part in text.split("&") if part)
    return tuple((_text(name), _text(value)) for name, _, value in pairs)


def first_value(pairs: Pairs, name: str) -> str | None:
    """The first value of ``name``, or None."""
    for key, value in pairs:  # a generator takes three times as long, and requests ask often
        if key == name:
            return value
    return None


def _text(raw: str) -> str:
    return unquote(_BLANK_PLUS.sub(" ", raw)) if "%" in raw or "+" in raw else raw


def member(kind: type[_E], text: str | int) -> _E:
    """The member of ``kind`` with the value ``text``.

    Raises:
        ProtocolError: there is none.
    """
    try:
        return kind(text)
    except ValueError as error:
        allowed = tuple(each.value for each in kind)
        raise ProtocolError(message("word_without_meaning", word=text, allowed=allowed)) from error


def _number(field: str, text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise ProtocolError(message("field_no_number", field=field, text=text)) from error


def whole_number(field: str, text: str) -> int:
    """The whole number that ``text`` of ``field`` spells.

    Raises:
        ProtocolError: it spells none.
    """
    value = _number(field, text)
    if not value.is_integer():
        raise ProtocolError(message("field_no_whole_number", field=field, text=text))
    return int(value)


@dataclass(frozen=True, slots=True)
class RwsLink:
    """A reference from a page or a state; ``href`` is relative to the page's base, without ``json=1``."""

    rel: str
    href: str


@dataclass(frozen=True, slots=True)
class EventArgument:
    """One argument of an event log message: its type (``string``, ``long``, ``float``) and its text."""

    type: str
    value: str


@dataclass(frozen=True, slots=True)
class RwsState:
    """One thing shown.

    Attributes:
        type: ABB's class, e.g. ``pnl-ctrlstate``; entries of lists end in ``-li``.
        title: the instance.
        fields: the texts by name, unescaped, in XHTML's spelling of the names.
        links: e.g. ``self``.
        children: a list inside the state, e.g. the attributes of a configuration instance.
        arguments: of an event log message.
    """

    type: str
    title: str
    fields: Mapping[str, str] = field(default_factory=dict)
    links: tuple[RwsLink, ...] = ()
    children: tuple[RwsState, ...] = ()
    arguments: tuple[EventArgument, ...] = ()

    def text(self, name: str) -> str:
        """The text of field ``name``.

        Raises:
            ProtocolError: the state has no such field.
        """
        if name not in self.fields:
            raise ProtocolError(message("state_without_field", type=self.type, title=self.title, field=name))
        return self.fields[name]

    def number(self, name: str) -> float:
        """The number in field ``name``.

        Raises:
            ProtocolError: there is none.
        """
        return _number(name, self.text(name))

    def whole(self, name: str) -> int:
        """The whole number in field ``name``.

        Raises:
            ProtocolError: there is none.
        """
        return whole_number(name, self.text(name))

    def flag(self, name: str) -> bool:
        """Whether field ``name`` says yes: TRUE, On or active; False where it is missing."""
        return self.fields.get(name, "").strip().lower() in ("true", "on", "active", "1")

    def member(self, kind: builtins.type[_E], name: str) -> _E:
        """The member of ``kind`` that field ``name`` spells.

        Raises:
            ProtocolError: it spells none.
        """
        return member(kind, self.text(name))


@dataclass(frozen=True, slots=True)
class Page:
    """An answer with states.

    Attributes:
        title: of the page; JSON does not carry it.
        base: what the links are relative to.
        states: the things shown, in order.
        links: of the page: ``self``, ``action``, and ``next`` where a list goes on.
    """

    title: str
    base: str
    states: tuple[RwsState, ...] = ()
    links: tuple[RwsLink, ...] = ()

    def of_type(self, *types: str) -> Iterator[RwsState]:
        """The states of one of ``types``, in order."""
        return (state for state in self.states if state.type in types)

    def one(self, *types: str) -> RwsState:
        """The first state of one of ``types``.

        Raises:
            ProtocolError: there is none.
        """
        for state in self.of_type(*types):
            return state
        raise ProtocolError(message("answer_without_state", types=types))

    @property
    def first(self) -> RwsState:
        """The first state.

        Raises:
            ProtocolError: there is none.
        """
        if not self.states:
            raise ProtocolError(message("answer_without_states"))
        return self.states[0]

    def link(self, rel: str) -> str | None:
        """Where the page's link ``rel`` points, or None."""
        return next((link.href for link in self.links if link.rel == rel), None)

    @property
    def next_query(self) -> Pairs | None:
        """The query of the page on which a list goes on, or None at its end."""
        href = self.link("next")
        return None if href is None else decode_form(href.partition("?")[2])


@dataclass(frozen=True, slots=True)
class Status:
    """An answer that says no: ABB's code and the controller's own words."""

    code: int
    message: str


class Form(Enum):
    """A format; the value is its content type."""

    XHTML = "application/xhtml+xml"
    JSON = "application/json"  # without a charset: abb_robot_client compares the whole value


def read_page(content_type: str, body: bytes) -> Page:
    """The page in an XHTML document.

    Raises:
        ProtocolError: it is another kind of document, or not the XHTML of Robot Web Services.
    """
    root = _parse(content_type, body)
    division = _division(root, "state")
    states = tuple(_state(item) for item in division.findall("ul/li"))
    base = root.find("head/base")
    return Page(
        root.findtext("head/title") or "", "" if base is None else base.get("href", ""), states, _links(division)
    )


def read_status(content_type: str, body: bytes) -> Status:
    """The status in an XHTML error document.

    Raises:
        ProtocolError: it is another kind of document, or holds no status.
    """
    division = _division(_parse(content_type, body), "status")
    texts = {span.get("class"): span.text or "" for span in division.findall("span")}
    try:
        return Status(int(texts["code"]), texts.get("msg", ""))
    except (KeyError, ValueError) as error:
        raise ProtocolError(message("error_without_code")) from error


XMLNS = "http://www.w3.org/1999/xhtml"
_XHTML_TYPES = (Form.XHTML.value, "text/html", "text/xml", "application/xml")
_ARGUMENT = re.compile(r"arg\d+")
_DEEPEST = 32  # lists within lists; a controller's pages have two
_LARGEST = 16 * 1024 * 1024  # [byte]; a page holds 100 items at most (reference/rws.md §1.1)


def _parse(content_type: str, body: bytes) -> Element:
    """The document without its namespace; a DOCTYPE is refused, since entities can be made to explode."""
    kind = content_type.partition(";")[0].strip().lower()
    if kind not in _XHTML_TYPES:
        raise ProtocolError(message("answer_not_xhtml", kind=kind) if kind else message("answer_of_no_type"))
    if len(body) > _LARGEST:
        raise ProtocolError(message("document_too_long", size=len(body), most=_LARGEST))
    try:
        text = body.decode("utf-8")
        if "<!DOCTYPE" in text:
            raise ProtocolError(message("document_with_doctype"))
        root = ElementTree.fromstring(text)
    except (UnicodeDecodeError, ValueError, RecursionError, ElementTree.ParseError) as error:
        raise ProtocolError(message("document_not_well_formed")) from error
    for element in root.iter():
        element.tag = element.tag.removeprefix(f"{{{XMLNS}}}")
    return root


def _division(root: Element, kind: str) -> Element:
    for division in root.iterfind("body/div"):
        if division.get("class") == kind:
            return division
    raise ProtocolError(message("document_without_division", division=kind))


def _state(item: Element, depth: int = 1) -> RwsState:
    if depth > _DEEPEST:
        raise ProtocolError(message("document_nested_too_deeply", most=_DEEPEST))
    spans = item.findall("span")
    arguments = tuple(EventArgument(span.get("type", ""), span.text or "") for span in spans if _is_argument(span))
    fields = {span.get("class", ""): span.text or "" for span in spans if not _is_argument(span)}
    children = tuple(_state(child, depth + 1) for child in item.findall("ul/li"))
    return RwsState(item.get("class", ""), item.get("title", ""), fields, _links(item), children, arguments)


def _is_argument(span: Element) -> bool:
    return span.get("type") is not None and _ARGUMENT.fullmatch(span.get("class", "")) is not None


def _links(element: Element) -> tuple[RwsLink, ...]:
    return tuple(RwsLink(anchor.get("rel", ""), anchor.get("href", "")) for anchor in element.findall("a"))


def refusal(address: str, what: str, status: int, content_type: str, body: bytes) -> ControllerRefused:
    """The error for a response of ``address`` that refuses; ``what`` is the request in a few words."""
    try:
        known = read_status(content_type, body)
    except ProtocolError:  # a body of another kind, which gateways and old versions send
        said = message("rws_refused_without_code", address=address, what=what, status=status)
        return ControllerRefused(said, status=status)
    reason = code_meaning(known.code)
    if reason is None:
        reason = message("text", text=known.message) if known.message else message("rws_no_reason")
    name = f"{code_name(known.code)} {known.code}".strip()
    said = message("rws_refused", address=address, what=what, reason=reason, status=status, name=name)
    return ControllerRefused(said, status=status, code=known.code)
