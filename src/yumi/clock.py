"""Time as an argument: the one way real time enters; tests hand in a clock they move by hand.

Waiting for a state of the robot, with a deadline: nothing on a robot is true at once.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

from yumi.errors import RobotNotReady


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


GLANCE = 0.05
"""Pause between two looks at a state [s]; the session keeps the pace of requests."""


def wait_until(clock: Clock, is_so: Callable[[], bool], deadline: float, sentence: Callable[[], str]) -> None:
    """Wait until ``is_so``.

    Args:
        clock: where waiting time comes from.
        is_so: looks.
        deadline: longest wait [s].
        sentence: what to say when it does not come about.

    Raises:
        RobotNotReady: it did not come about in time.
    """
    end = clock.now() + deadline
    while not is_so():
        if clock.now() >= end:
            raise RobotNotReady(sentence())
        clock.wait(GLANCE)
