"""The pace of requests: a controller wants fewer than twenty a second (reference/rws.md §1.1)."""

from __future__ import annotations

from math import inf
from threading import Lock

from yumi.clock import Clock

INTERVAL = 0.051
"""Mean time between two requests [s]."""

BURST = 15
"""So many requests may come at once after a rest, so that a short task such as bring-up need not wait."""


class RequestPace:
    """Gives every request its turn, in the order in which the requests come; safe from any thread.

    Args:
        clock: where waiting time comes from.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._lock = Lock()
        self._rested_at = -inf  # when the whole burst is available again

    def wait(self) -> None:
        """Wait for the turn of one request."""
        delay = self._take()
        if delay > 0.0:
            self._clock.wait(delay)

    def count(self) -> None:
        """Count a request that follows another at once, as a login does; later ones wait for it."""
        self._take()

    def _take(self) -> float:
        with self._lock:
            now = self._clock.now()
            self._rested_at = max(self._rested_at, now) + INTERVAL
            return self._rested_at - now - BURST * INTERVAL
