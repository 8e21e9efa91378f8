"""A change that is asked for twice: clients that give up waiting send the same request again, after it was served."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock
from typing import TypeVar

from yumi.clock import Clock

T = TypeVar("T")

JUST_FINISHED = 1.0
"""A request that waited while the same one was served is looked at within this time after it [s]."""


class Repeats:
    """Gives a request that comes again, in flight or just finished, the outcome of the first.

    Only a success is remembered, since a refusal has changed nothing; and only the last, since another change in
    between, also one that nobody asked for, makes the same request a new one.

    Args:
        clock: tells what is just finished.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._lock = Lock()
        self._last: tuple[object, object, float] | None = None
        self._changes = 0

    def once(self, request: object, carry: Callable[[], T]) -> T:
        """What ``carry`` gives, or has just given for an equal ``request``; what it raises is raised."""
        with self._lock:
            last = self._last
            if last is not None and last[0] == request and self._clock.now() - last[2] <= JUST_FINISHED:
                return last[1]  # type: ignore[return-value]  # an equal request gave it
            self._last, changes = None, self._changes
            outcome = carry()
            if changes == self._changes:
                self._last = (request, outcome, self._clock.now())
            return outcome

    def forget(self) -> None:
        """Something else has changed: the next request is a new one; from any thread."""
        self._changes += 1
        self._last = None
