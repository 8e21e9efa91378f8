"""Time as an argument: the one way real time enters; tests hand in a clock they move by hand."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Seconds on a clock that never goes back."""

    def now(self) -> float:
        """Time in [s]; only differences mean anything."""

    def wait(self, seconds: float) -> None:
        """Let ``seconds`` pass."""


class SystemClock:
    """The machine's monotonic clock; processes on one machine share it."""

    def now(self) -> float:
        return time.monotonic()

    def wait(self, seconds: float) -> None:
        time.sleep(seconds)


class ManualClock:
    """A clock that stands still until it is moved."""

    def __init__(self, start: float = 0.0) -> None:
        self._now = start

    def now(self) -> float:
        return self._now

    def wait(self, seconds: float) -> None:
        self.advance(seconds)

    def advance(self, seconds: float) -> None:
        if seconds < 0.0:
            raise ValueError(f"time does not go back: {seconds} s")
        self._now += seconds
