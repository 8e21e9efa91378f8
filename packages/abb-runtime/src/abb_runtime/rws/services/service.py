"""The base of the client's services: an operation of a table, filled in, sent, and its answer read."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from threading import Lock
from typing import Any, TypeVar

import httpx

from abb_protocols.catalogue import message
from abb_protocols.errors import ControllerRefused, YumiError
from abb_protocols.rws import documents
from abb_protocols.rws.documents import Page, Pairs, RwsState, read_page
from abb_protocols.rws.operations import mastership
from abb_protocols.rws.operations.operation import Operation
from abb_protocols.rws.values import RwsCode
from abb_runtime.clock import Clock
from abb_runtime.rws.session import BUSY, RwsRequest, RwsSession

log = logging.getLogger(__name__)

T = TypeVar("T")

_MOST_SESSIONS = 70  # at a time, of a controller (reference/rws.md §2)


def request(operation: Operation[Any], /, *places: str, **arguments: object) -> RwsRequest:
    """The request for an operation.

    Args:
        operation: of a table.
        places: texts for the placeholders in its path, in order.
        arguments: of URL and body by name, with ``_`` for ``-``; one that is None is left out.
    """
    query, form = operation.filled(arguments)
    has_form = operation.method in ("POST", "PUT")
    return RwsRequest(
        operation.method, operation.path_of(*places), (*operation.marks, *query), form if has_form else None
    )


class Service:
    """Calls of operations in one session.

    Where a method takes ``what``, that is what is done, in a few words for an error; the rest is as for a request.
    """

    address: str
    _session: RwsSession
    _clock: Clock
    _mastership: Lock
    """Held while a mastership is requested or released: no thread releases what another one has just come to use."""
    _held: Counter[str]

    def _call(self, what: str, operation: Operation[Any], /, *places: str, **arguments: object) -> httpx.Response:
        """The reply to an operation, for which the mastership is held that it needs."""
        return self._sent(what, operation, request(operation, *places, **arguments))

    def _sent(self, what: str, operation: Operation[Any], called: RwsRequest) -> httpx.Response:
        """The reply to a request for an operation."""
        with self.holding(operation.needs_mastership) if operation.needs_mastership else nullcontext():
            reply = self._session.exchange(called)
            self._accepted(reply, what)
        return reply

    def _shown(self, what: str, operation: Operation[Any], /, *places: str, **arguments: object) -> Page:
        """The page that an operation is answered with."""
        return self._page(self._call(what, operation, *places, **arguments), what)

    def _answer(self, what: str, operation: Operation[T], /, *places: str, **arguments: object) -> T:
        """The value that an operation is answered with."""
        return operation.answered.of(self._shown(what, operation, *places, **arguments))

    def _first(self, what: str, operation: Operation[T], /, *places: str, **arguments: object) -> T:
        """The value in the first state of the answer, whatever its type is."""
        return operation.answered.read(self._shown(what, operation, *places, **arguments).first)

    def _answers(self, what: str, operation: Operation[T], /, *places: str, **arguments: object) -> tuple[T, ...]:
        """The values of a list, on all its pages."""
        return tuple(map(operation.answered.read, self._listed(what, operation, *places, **arguments)))

    def _listed(
        self, what: str, operation: Operation[Any], /, *places: str, **arguments: object
    ) -> tuple[RwsState, ...]:
        """The states of a list, on all its pages."""
        return self._states(what, request(operation, *places, **arguments))

    def _states(self, what: str, called: RwsRequest) -> tuple[RwsState, ...]:
        found: tuple[RwsState, ...] = ()
        following: Pairs | None = called.query
        while following is not None:
            page = self._page(self._session.exchange(replace(called, query=following)), what)
            found += page.states
            following = page.next_query if page.states else None
        return found

    def _page(self, reply: httpx.Response, what: str) -> Page:
        self._accepted(reply, what)
        return read_page(reply.headers.get("Content-Type", ""), reply.content)

    def _accepted(self, reply: httpx.Response, what: str) -> None:
        """Raise unless the controller carried the request out."""
        if reply.status_code == BUSY:
            raise ControllerRefused(
                message("sessions_taken", address=self.address, most=_MOST_SESSIONS),
                status=reply.status_code,
            )
        if not reply.is_success:
            kind = reply.headers.get("Content-Type", "")
            raise documents.refusal(self.address, what, reply.status_code, kind, reply.content)

    @contextmanager
    def holding(self, domain: str) -> Iterator[None]:
        """The mastership of ``cfg``, ``rapid`` or ``motion`` for the time of the block.

        A client that keeps it locks the FlexPendant out. A block within another one of the same domain keeps it, in
        any thread.

        Raises:
            ControllerRefused: another client has it, or its release was refused after the block.
        """
        with self._mastership:
            if not self._held[domain]:
                self._call(f"requesting the mastership of {domain}", mastership.REQUEST, domain)
            self._held[domain] += 1
        try:
            yield
        except BaseException:
            try:
                self._release(domain)
            except YumiError as error:  # what failed in the block says more
                log.warning(
                    "The mastership of %s may still be held, which locks the FlexPendant out: %s", domain, error
                )
            raise
        self._release(domain)

    def _release(self, domain: str) -> None:
        """End one block that holds a mastership; the last one gives it back."""
        with self._mastership:
            self._held[domain] -= 1
            if self._held[domain]:
                return
            try:
                self._call(f"releasing the mastership of {domain}", mastership.RELEASE, domain)
            except ControllerRefused as error:
                if error.code != RwsCode.RESOURCE_NOT_HELD:  # a new session or another mode has ended it already
                    raise
