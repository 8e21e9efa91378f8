"""The routes of a service: the handler of each operation, found by method, path, action and resource."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from abb_protocols.rws.documents import Page, Pairs, first_value
from abb_protocols.rws.operations.operation import Operation
from abb_protocols.rws.values import RwsCode
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.rws.http import HttpReply
from virtual_irc5.rws.render import page_of
from virtual_irc5.rws.rws_call import CallFailure, Handler, Preparation, RwsCall, Shown, bad_call

_T = TypeVar("_T")

_PLACE = re.compile(r"([^{]*)\{(\w+)(:[^{}]*)?\}")
_BRACES = re.compile("[{}]")  # no name has them


@dataclass(frozen=True, slots=True)
class Route:
    """An operation, what answers it, and the part of it that takes longer than a cycle."""

    operation: Operation[Any]
    handler: Handler
    prepare: Preparation | None = None

    def answer(self, controller: Irc5, call: RwsCall) -> Shown:
        """What the handler answers, its values as a page."""
        found = self.handler(controller, call)
        if found is None or isinstance(found, Page | HttpReply):
            return found
        values = found if isinstance(found, Mapping) else {call.path[-1]: found}
        return page_of(self.operation, call.path, values)


class Routes(list[Route]):
    """The routes of one service; its handlers are marked with the operations that they answer."""

    def answer(
        self, *operations: Operation[_T], prepare: Preparation | None = None
    ) -> Callable[[Callable[[Irc5, RwsCall], _T | Mapping[str, _T] | Shown]], Handler]:
        """Let the handler below answer these operations, with a value, with values by title, or with what is shown."""

        def added(handler: Handler) -> Handler:
            self.extend(Route(each, handler, prepare) for each in operations)
            return handler

        return added


def absent_routes(operations: Iterable[Operation[Any]]) -> list[Route]:
    """The routes of operations that need what this robot lacks."""
    return [Route(each, _not_there) for each in operations]


def _not_there(controller: Irc5, call: RwsCall) -> None:
    raise CallFailure(404, RwsCode.FAIL, f"there is no resource /{'/'.join(call.path)}")


@dataclass(slots=True)
class _Node:
    """What may follow in a path: texts, placeholders of one segment with the text before them, and of several."""

    texts: dict[str, _Node] = field(default_factory=dict)
    places: dict[tuple[str, str], _Node] = field(default_factory=dict)
    rests: dict[str, _Node] = field(default_factory=dict)
    routes: dict[str, list[Route]] = field(default_factory=dict)

    def add(self, segments: Sequence[str], route: Route) -> None:
        if not segments:
            self.routes.setdefault(route.operation.method, []).append(route)
            return
        match = _PLACE.fullmatch(segments[0])
        if match is None:
            node = self.texts.setdefault(segments[0], _Node())
        elif match[3]:
            node = self.rests.setdefault(match[2], _Node())
        else:
            node = self.places.setdefault((match[1], match[2]), _Node())
        node.add(segments[1:], route)

    def find(self, segments: Sequence[str]) -> Iterator[tuple[_Node, dict[str, str]]]:
        """The ends of a path with the values of its placeholders: the more of it are texts, the earlier."""
        if not segments:
            yield self, {}
            return
        first, others = segments[0], segments[1:]
        if first in self.texts:
            yield from self.texts[first].find(others)
        for (before, name), node in self.places.items():
            if first.startswith(before) and first != before and not _BRACES.search(first):
                yield from ((end, {name: first[len(before) :], **names}) for end, names in node.find(others))
        for name, node in self.rests.items():
            goes_on = bool(node.texts or node.places or node.rests)
            for count in (*range(len(segments) - 1 if goes_on else 0, 0, -1), len(segments)):
                for end, names in node.find(segments[count:]):
                    yield end, {name: "/".join(segments[:count]), **names}


class Router:
    """Finds the route of a request."""

    def __init__(self, routes: Iterable[Route]) -> None:
        self._root = _Node()
        for route in routes:
            self._root.add([part for part in route.operation.path.split("/") if part], route)

    def find(self, method: str, path: Sequence[str], query: Pairs) -> tuple[Route, Mapping[str, str]]:
        """The route of a request, and the values of the placeholders in its path.

        Raises:
            CallFailure: 404 for an unknown path, 405 for a method, 400 for an action it does not have.
        """
        shown = "/" + "/".join(path)
        ends = list(self._ends(path))
        if not ends:
            raise CallFailure(404, RwsCode.FAIL, f"there is no resource {shown}")
        alternatives, names = next(((end.routes[method], each) for end, each in ends if method in end.routes), ([], {}))
        if not alternatives:
            raise CallFailure(405, RwsCode.NOTIMPL, f"{method} is not possible on {shown}")
        action, asked = first_value(query, "action"), first_value(query, "resource") or None  # an empty one is none
        fitting = [each for each in alternatives if each.operation.action == action]
        if method != "POST":  # an action of POST changes something; elsewhere an unknown one is ignored
            fitting = fitting or [each for each in alternatives if each.operation.action is None]
        if not fitting:
            raise bad_call(f"{shown} {'needs an action' if action is None else f'does not have the action {action!r}'}")
        for route in sorted(fitting, key=lambda each: each.operation.resource != asked):
            own = route.operation
            if own.resource == asked or (own.resource is None and "resource" in own.query):
                return route, names
        raise bad_call(f"{shown} does not have the resource {asked!r}")

    def actions(self, path: Sequence[str]) -> Sequence[Operation[Any]]:
        """What can be done with a path beside reading it."""
        ends = [end for end, _ in self._ends(path)]
        found: list[Operation[Any]] = []
        for method in ("POST", "PUT", "DELETE"):
            routes: list[Route] = next((end.routes[method] for end in ends if method in end.routes), [])
            found += [route.operation for route in routes]
        return found

    def _ends(self, path: Sequence[str]) -> Iterator[tuple[_Node, dict[str, str]]]:
        """Where a path may end that has operations; a ``/`` that was escaped separates all the same."""
        segments = "/".join(path).split("/") if path else []
        return ((end, names) for end, names in self._root.find(segments) if end.routes)
