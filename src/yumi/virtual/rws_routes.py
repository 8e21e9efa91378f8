"""How a resource of the virtual controller is found: a table of method, path, action and handler.

Handlers live in one module per service (``rws_panel``, ``rws_rapid``, …), each with its part of the table.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from yumi.errors import YumiError
from yumi.links.http import HttpReply
from yumi.rws import forms
from yumi.rws.codes import Code
from yumi.rws.forms import Pairs
from yumi.rws.pages import Link, Page, State
from yumi.virtual.rws_port import Controller

_MOST_DIGITS = 12


class Failure(YumiError):
    """The answer is no.

    Attributes:
        status: of HTTP.
        code: ABB's.
    """

    def __init__(self, status: int, code: Code, sentence: str) -> None:
        super().__init__(sentence)
        self.status = status
        self.code = code


@dataclass(frozen=True, slots=True)
class Call:
    """A request whose path is understood.

    Attributes:
        method: of HTTP.
        path: the segments, unescaped, without a sub-property behind ``;``.
        query: parameters in the URL.
        form: parameters in the body.
        names: what the placeholders of the route's path stand for.
        content: the body as it came.
        session: whose request it is.
        host: host and port as the client calls them.
    """

    method: str
    path: tuple[str, ...]
    query: Pairs = ()
    form: Pairs = ()
    names: Mapping[str, str] = field(default_factory=dict)
    content: bytes = b""
    session: str = ""
    host: str = ""

    def option(self, name: str) -> str | None:
        """A parameter in the URL, or None."""
        return forms.first(self.query, name)

    def required(self, name: str) -> str:
        """A parameter in the body.

        Raises:
            Failure: it is missing.
        """
        value = forms.first(self.form, name)
        if value is None:
            raise invalid(f"the body lacks {name}")
        return value

    def number_option(self, name: str, default: int) -> int:
        """A parameter in the URL that is a whole number from 0.

        Raises:
            Failure: it is no number.
        """
        text = self.option(name)
        if text is None:
            return default
        if not text.isdecimal() or len(text) > _MOST_DIGITS:
            raise invalid(f"{name} is a whole number of up to {_MOST_DIGITS} digits, not {text[:50]!r}")
        return int(text)


Answer = Page | HttpReply | None
"""A page, a reply that is none, or None for "done, nothing to show"."""

Handler = Callable[[Controller, Call], Answer]
"""Answers a call."""


@dataclass(frozen=True, slots=True)
class Route:
    """One line of the table; ``{name}`` in the path stands for one segment, ``{name*}`` for all that follow."""

    method: str
    path: str
    handler: Handler
    action: str | None = None


def answer(routes: Sequence[Route], controller: Controller, call: Call) -> Answer:
    """What the first route that fits answers.

    Raises:
        Failure: 404 for an unknown path, 405 for a method it does not know, 400 for an action it does not know.
        Refused: the controller says no.
    """
    here = [(route, names) for route in routes if (names := _names(route.path, call.path)) is not None]
    if not here:
        raise Failure(404, Code.FAIL, f"there is no resource /{'/'.join(call.path)}")
    fitting = [(route, names) for route, names in here if route.method == call.method]
    if not fitting:
        raise Failure(405, Code.NOTIMPL, f"{call.method} is not possible on /{'/'.join(call.path)}")
    for route, names in fitting:
        if route.action is None or route.action == call.option("action"):
            return route.handler(controller, replace(call, names=names))
    raise invalid(f"/{'/'.join(call.path)} knows no action {call.option('action')!r}")


def invalid(sentence: str) -> Failure:
    """The failure for a parameter that makes no sense."""
    return Failure(400, Code.INVALIDARG, sentence)


def resource(title: str, base: str, href: str, *states: State, next_href: str | None = None) -> Page:
    """A page with the links every resource has; ``base`` is a path, the adapter puts the host before it."""
    links = (Link("self", href), Link("action", f"{href}?action=show"))
    more = () if next_href is None else (Link("next", next_href),)
    return Page(title, base, states, links + more)


def entry(type: str, title: str, href: str | None = None, /, **fields: str) -> State:
    """An entry of a list that leads to ``href``, by default its title; ``_`` in field names stands for ``-``."""
    named = {name.replace("_", "-"): text for name, text in fields.items()}
    return State(type, title, named, (Link("self", title if href is None else href),))


def _names(pattern: str, path: tuple[str, ...]) -> dict[str, str] | None:
    """What the placeholders of ``pattern`` stand for in ``path``; None when it does not fit."""
    parts = [part for part in pattern.split("/") if part]
    names: dict[str, str] = {}
    for index, part in enumerate(parts):
        if part.endswith("*}"):
            names[part[1:-2]] = "/".join(path[index:])
            return names if len(path) > index else None
        if index >= len(path) or not (part.startswith("{") or part == path[index]):
            return None
        if part.startswith("{"):
            names[part[1:-1]] = path[index]
    return names if len(parts) == len(path) else None
