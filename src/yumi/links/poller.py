"""Waits for whichever of several sockets and pipes has something to read."""

from __future__ import annotations

import select
from collections.abc import Callable
from typing import Protocol

_MS = 1e3


class HasFileno(Protocol):
    """Anything the operating system can wait for."""

    def fileno(self) -> int:
        """Its descriptor."""


class Poller:
    """Calls a handler per readable thing; one thread only.

    It stands between a datagram and its reply, with cold caches: hence ``poll`` itself, not the layers of a selector.
    """

    def __init__(self) -> None:
        self._poll = select.poll()
        self._handlers: dict[int, Callable[[], None]] = {}

    def close(self) -> None:
        for descriptor in tuple(self._handlers):
            self._forget(descriptor)

    def watch(self, thing: HasFileno, handler: Callable[[], None]) -> None:
        self._handlers[thing.fileno()] = handler
        self._poll.register(thing, select.POLLIN)

    def forget(self, thing: HasFileno) -> None:
        self._forget(thing.fileno())

    def wait(self, timeout: float) -> bool:
        """Wait until something is readable, at most ``timeout`` [s] in whole milliseconds, and call its handlers.

        Returns:
            Whether anything was readable.
        """
        ready = self._poll.poll(timeout * _MS)
        for descriptor, _ in ready:
            self._handlers[descriptor]()
        return bool(ready)

    def doze(self, duration: float) -> bool:
        """Sleep for ``duration`` [s], to the microsecond, or until something is readable; calls no handler.

        Returns:
            Whether something is readable.
        """
        return bool(select.select(tuple(self._handlers), (), (), duration)[0])

    def _forget(self, descriptor: int) -> None:
        self._poll.unregister(descriptor)
        del self._handlers[descriptor]
