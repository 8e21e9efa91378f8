"""The base of the client's services: an operation of a table, filled in, sent, and its answer read."""

from __future__ import annotations

from typing import Any, TypeVar

import httpx

from yumi.rws.documents import Page, State
from yumi.rws.operations.operation import Operation
from yumi.rws.session import Request, Requests

T = TypeVar("T")


def request(operation: Operation[Any], /, *places: str, **arguments: object) -> Request:
    """The request for an operation.

    Args:
        operation: of a table.
        places: texts for the placeholders in its path, in order.
        arguments: of URL and body by name, with ``_`` for ``-``; one that is None is left out.
    """
    query, form = operation.filled(arguments)
    has_form = operation.method in ("POST", "PUT")
    return Request(operation.method, operation.path_of(*places), (*operation.marks, *query), form if has_form else None)


class Service(Requests):
    """Calls of operations; ``what`` is what is done, in a few words for an error, and the rest is as for a request."""

    def _call(self, what: str, operation: Operation[Any], /, *places: str, **arguments: object) -> httpx.Response:
        """The reply to an operation, for which the mastership is held that it needs."""
        called = request(operation, *places, **arguments)
        if not operation.needs_mastership:
            return self._exchanged(called, what)
        with self.holding(operation.needs_mastership):
            return self._exchanged(called, what)

    def _exchanged(self, called: Request, what: str) -> httpx.Response:
        reply = self._session.exchange(called)
        self._accepted(reply, what)
        return reply

    def _shown(self, what: str, operation: Operation[Any], /, *places: str, **arguments: object) -> Page:
        """The page that an operation is answered with."""
        return self._page(self._call(what, operation, *places, **arguments), what)

    def _answer(self, what: str, operation: Operation[T], /, *places: str, **arguments: object) -> T:
        """The value that an operation is answered with."""
        answer = operation.answered
        return answer.read(self._shown(what, operation, *places, **arguments).one(*answer.types))

    def _first(self, what: str, operation: Operation[T], /, *places: str, **arguments: object) -> T:
        """The value in the first state of the answer, whatever its type is."""
        return operation.answered.read(self._shown(what, operation, *places, **arguments).states[0])

    def _answers(self, what: str, operation: Operation[T], /, *places: str, **arguments: object) -> dict[str, T]:
        """The values of a list by their titles, on all its pages."""
        answer = operation.answered
        states = self._listed(what, operation, *places, **arguments)
        return {state.title: answer.read(state) for state in states if state.type in answer.types}

    def _listed(self, what: str, operation: Operation[Any], /, *places: str, **arguments: object) -> tuple[State, ...]:
        """The states of a list, on all its pages."""
        called = request(operation, *places, **arguments)
        return self._states(what, called.path, *called.query)
