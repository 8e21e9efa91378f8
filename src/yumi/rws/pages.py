"""What one answer of Robot Web Services holds, free of its format: a page of states, or a status.

A *state* is ABB's word for one thing shown: an ``<li>`` of XHTML, an object of ``_state`` in JSON
(reference/rws.md §3).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from yumi.errors import ProtocolError
from yumi.rws import forms
from yumi.rws.forms import Pairs


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
        return None if href is None else forms.decode(href.partition("?")[2])


@dataclass(frozen=True, slots=True)
class Status:
    """An answer that says no: ABB's code and the controller's own words."""

    code: int
    message: str
