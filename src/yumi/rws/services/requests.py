"""What the services of Robot Web Services have in common: a request, its page, and what the controller refused."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Lock
from typing import TypeVar

import httpx

from yumi.clock import Clock
from yumi.errors import ControllerRefused, YumiError
from yumi.rws import replies
from yumi.rws.documents import Page, Pairs, State, read_page
from yumi.rws.session import BUSY, Request, RwsSession
from yumi.rws.types import Code

log = logging.getLogger(__name__)

T = TypeVar("T")

OnProgress = Callable[[str], None]
"""Called with what is being done, in a few words."""


class Requests:
    """Sends the requests of one session; a service adds a method for each of its operations."""

    address: str
    _session: RwsSession
    _clock: Clock
    _mastership: Lock
    """Held while a mastership is requested or released: no thread releases what another one has just come to use."""
    _held: Counter[str]

    def _read(self, request: Request, parse: Callable[[Page], T], what: str) -> T:
        return parse(self._page(self._session.exchange(request), what))

    def _states(self, what: str, path: str, *query: tuple[str, str]) -> tuple[State, ...]:
        """What a list shows, on all its pages."""
        found: tuple[State, ...] = ()
        following: Pairs | None = query
        while following is not None:
            page = self._page(self._session.exchange(get(path, *following)), what)
            found += page.states
            following = page.next_query if page.states else None
        return found

    def _state(self, what: str, path: str, type: str, *query: tuple[str, str]) -> State:
        """The one thing that a page shows."""
        return self._page(self._session.exchange(get(path, *query)), what).one(type)

    def _do(self, request: Request, what: str) -> None:
        self._accepted(self._session.exchange(request), what)

    def _page(self, reply: httpx.Response, what: str) -> Page:
        self._accepted(reply, what)
        return read_page(reply.headers.get("Content-Type", ""), reply.content)

    def _accepted(self, reply: httpx.Response, what: str) -> None:
        """Raise unless the controller carried the request out."""
        if reply.status_code == BUSY:
            raise ControllerRefused(
                f"The controller at {self.address} is starting, or all its 70 sessions are taken (an idle "
                "one ends after five minutes); try again later.",
                status=reply.status_code,
            )
        if not reply.is_success:
            kind = reply.headers.get("Content-Type", "")
            raise replies.refusal(f"{self.address}: {what}", reply.status_code, kind, reply.content)

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
                self._do(post(f"/rw/mastership/{domain}", "request"), f"requesting the mastership of {domain}")
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
                self._do(post(f"/rw/mastership/{domain}", "release"), f"releasing the mastership of {domain}")
            except ControllerRefused as error:
                if error.code != Code.RESOURCE_NOT_HELD:  # a new session or another mode has ended it already
                    raise


def get(path: str, *query: tuple[str, str]) -> Request:
    """A request that reads."""
    return Request("GET", path, query)


def post(path: str, action: str, *form: tuple[str, str]) -> Request:
    """A request for an action."""
    return Request("POST", path, (("action", action),), form)


def given(**fields: object) -> Pairs:
    """The fields of a form that have a value; ``_`` in a name stands for ``-``, a bool is ``true`` or ``false``."""
    return tuple(
        (name.rstrip("_").replace("_", "-"), str(value).lower() if isinstance(value, bool) else str(value))
        for name, value in fields.items()
        if value is not None
    )


def file_path(path: str) -> str:
    """Where RAPID's ``HOME:/pick.mod`` is on the network; the device's name stands behind ``$`` there."""
    device, _, rest = path.partition(":")
    return f"/fileservice/${device.lower()}/{rest.lstrip('/')}"
