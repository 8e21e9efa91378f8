"""Waits for whichever of several sockets and pipes has something to read."""

from __future__ import annotations

import select
import selectors
from collections.abc import Callable
from typing import Protocol


class HasFileno(Protocol):
    """Anything the operating system can wait for."""

    def fileno(self) -> int:
        """Its descriptor."""


class Poller:
    """Calls a handler per readable thing; one thread only."""

    def __init__(self) -> None:
        self._selector = selectors.DefaultSelector()

    def close(self) -> None:
        self._selector.close()

    def watch(self, thing: HasFileno, handler: Callable[[], None]) -> None:
        self._selector.register(thing, selectors.EVENT_READ, handler)

    def forget(self, thing: HasFileno) -> None:
        self._selector.unregister(thing)

    def wait(self, timeout: float) -> bool:
        """Wait until something is readable, at most ``timeout`` [s] in whole milliseconds, and call its handlers.

        Returns:
            Whether anything was readable.
        """
        ready = self._selector.select(timeout)
        for key, _ in ready:
            key.data()
        return bool(ready)

    def doze(self, duration: float) -> None:
        """Sleep for ``duration`` [s], to the microsecond, or until something is readable; calls no handler."""
        select.select(tuple(self._selector.get_map()), (), (), duration)
