"""The base of the services: an operation of a table, filled in, sent in a session, and its answer read."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from typing import Any, TypeVar

from abb_protocols.catalogue import message
from abb_protocols.errors import ControllerRefused
from abb_protocols.rws import documents
from abb_protocols.rws.documents import Page, Pairs, RwsState, read_page
from abb_protocols.rws.operations.operation import Operation
from abb_protocols.rws.request import BUSY_STATUS, RwsReply, RwsRequest

_T = TypeVar("_T")

OnProgress = Callable[[str], None]
"""Called with what is being done, in a few words."""

_MOST_SESSIONS = 70  # at a time, of a controller (reference/rws.md §2)
_NOT_VALID = 400  # status of HTTP of a check that fails


class Service(ABC):
    """Calls of operations in one session; :class:`abb_runtime.rws.client.RwsClient` has the session.

    Where a method takes ``what``, that is what is done, in a few words for an error; the rest is as for a request.
    """

    address: str

    @abstractmethod
    def holding(self, domain: str) -> AbstractContextManager[None]:
        """The mastership of ``cfg``, ``rapid`` or ``motion`` for the time of the block."""

    @abstractmethod
    def _exchange(self, called: RwsRequest) -> RwsReply:
        """The controller's reply to a request, whatever its status."""

    @abstractmethod
    def _polls(self, period: float, longest: float) -> Iterator[None]:
        """One item at once, then one after each ``period`` [s], until ``longest`` [s] have passed."""

    def _call(self, what: str, operation: Operation[Any], /, *places: str, **arguments: object) -> RwsReply:
        """The reply to an operation, for which the mastership is held that it needs."""
        return self._sent(what, operation, operation.request(*places, **arguments))

    def _sent(self, what: str, operation: Operation[Any], called: RwsRequest) -> RwsReply:
        """The reply to a request for an operation."""
        with self.holding(operation.needs_mastership) if operation.needs_mastership else nullcontext():
            reply = self._exchange(called)
            self._accepted(reply, what)
        return reply

    def _is_valid(self, what: str, operation: Operation[Any], /, **arguments: object) -> bool:
        """Whether the controller finds what it is asked to check valid."""
        try:
            self._call(what, operation, **arguments)
        except ControllerRefused as error:
            if error.status != _NOT_VALID:
                raise
            return False
        return True

    def _shown(self, what: str, operation: Operation[Any], /, *places: str, **arguments: object) -> Page:
        """The page that an operation is answered with."""
        return self._page(self._call(what, operation, *places, **arguments), what)

    def _answer(self, what: str, operation: Operation[_T], /, *places: str, **arguments: object) -> _T:
        """The value that an operation is answered with."""
        return operation.answered.of(self._shown(what, operation, *places, **arguments))

    def _first(self, what: str, operation: Operation[_T], /, *places: str, **arguments: object) -> _T:
        """The value in the first state of the answer, whatever its type is."""
        return operation.answered.read(self._shown(what, operation, *places, **arguments).first)

    def _answers(self, what: str, operation: Operation[_T], /, *places: str, **arguments: object) -> tuple[_T, ...]:
        """The values of a list, on all its pages."""
        return tuple(map(operation.answered.read, self._listed(what, operation, *places, **arguments)))

    def _listed(
        self, what: str, operation: Operation[Any], /, *places: str, **arguments: object
    ) -> tuple[RwsState, ...]:
        """The states of a list, on all its pages."""
        return self._states(what, operation.request(*places, **arguments))

    def _states(self, what: str, called: RwsRequest) -> tuple[RwsState, ...]:
        found: tuple[RwsState, ...] = ()
        following: Pairs | None = called.query
        while following is not None:
            page = self._page(self._exchange(replace(called, query=following)), what)
            found += page.states
            following = page.next_query if page.states else None
        return found

    def _page(self, reply: RwsReply, what: str) -> Page:
        self._accepted(reply, what)
        return read_page(reply.headers.get("Content-Type", ""), reply.content)

    def _accepted(self, reply: RwsReply, what: str) -> None:
        """Raise unless the controller carried the request out."""
        status = reply.status_code
        if status == BUSY_STATUS:
            raise ControllerRefused(message("sessions_taken", address=self.address, most=_MOST_SESSIONS), status=status)
        if not 200 <= status < 300:
            kind = reply.headers.get("Content-Type", "")
            raise documents.refusal(self.address, what, status, kind, reply.content)
