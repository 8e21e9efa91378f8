"""What one response of Robot Web Services holds, free of its format, and the formats (reference/rws.md §1, §3).

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

from yumi.errors import ProtocolError

E = TypeVar("E", bound=Enum)

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


def member(kind: type[E], text: str | int) -> E:
    """The member of ``kind`` with the value ``text``.

    Raises:
        ProtocolError: there is none.
    """
    try:
        return kind(text)
    except ValueError as error:
        allowed = ", ".join(str(each.value) for each in kind)
        raise ProtocolError(f"The controller says {text!r} where only {allowed} have a meaning.") from error


@dataclass(frozen=True, slots=True)
class Link:
    """A reference from a page or a state; ``href`` is relative to the page's base, without ``json=1``."""

    rel: str
    href: str


@dataclass(frozen=True, slots=True)
class Argument:
    """One argument of an event log message: its type (``string``, ``long``, ``float``) and its text."""

    type: str
    value: str


@dataclass(frozen=True, slots=True)
class State:
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
    links: tuple[Link, ...] = ()
    children: tuple[State, ...] = ()
    arguments: tuple[Argument, ...] = ()

    def text(self, name: str) -> str:
        """The text of field ``name``.

        Raises:
            ProtocolError: the state has no such field.
        """
        if name not in self.fields:
            raise ProtocolError(f"The controller's {self.type!r} of {self.title!r} lacks the field {name!r}.")
        return self.fields[name]

    def number(self, name: str) -> float:
        """The number in field ``name``.

        Raises:
            ProtocolError: there is none.
        """
        text = self.text(name)
        try:
            return float(text)
        except ValueError as error:
            raise ProtocolError(f"The controller's {name!r} is {text!r}, not a number.") from error

    def whole(self, name: str) -> int:
        """The whole number in field ``name``.

        Raises:
            ProtocolError: there is none.
        """
        value = self.number(name)
        if not value.is_integer():
            raise ProtocolError(f"The controller's {name!r} is {self.text(name)!r}, not a whole number.")
        return int(value)

    def flag(self, name: str) -> bool:
        """Whether field ``name`` says yes: TRUE, On or active; False where it is missing."""
        return self.fields.get(name, "").strip().lower() in ("true", "on", "active", "1")

    def member(self, kind: builtins.type[E], name: str) -> E:
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
    states: tuple[State, ...] = ()
    links: tuple[Link, ...] = ()

    def of_type(self, *types: str) -> Iterator[State]:
        """The states of one of ``types``, in order."""
        return (state for state in self.states if state.type in types)

    def one(self, *types: str) -> State:
        """The first state of one of ``types``.

        Raises:
            ProtocolError: there is none.
        """
        for state in self.of_type(*types):
            return state
        raise ProtocolError(f"The controller's answer holds no {' or '.join(types)!r}.")

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
        raise ProtocolError("The controller's error document holds no code.") from error


XMLNS = "http://www.w3.org/1999/xhtml"
_XHTML_TYPES = (Form.XHTML.value, "text/html", "text/xml", "application/xml")
_ARGUMENT = re.compile(r"arg\d+")
_DEEPEST = 32  # lists within lists; a controller's pages have two
_LARGEST = 16 * 1024 * 1024  # [byte]; a page holds 100 items at most (reference/rws.md §1.1)


def _parse(content_type: str, body: bytes) -> Element:
    """The document without its namespace; a DOCTYPE is refused, since entities can be made to explode."""
    kind = content_type.partition(";")[0].strip().lower()
    if kind not in _XHTML_TYPES:
        raise ProtocolError(f"The answer is {kind or 'of no type'}, not XHTML.")
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
        element.tag = element.tag.removeprefix(f"{{{XMLNS}}}")
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
