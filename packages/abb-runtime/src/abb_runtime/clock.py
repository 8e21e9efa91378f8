"""Time as an argument: clocks of real and of virtual time, and waiting for a condition with a deadline."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

from abb_protocols.catalogue import Message
from abb_protocols.errors import RobotNotReady


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


POLL_PERIOD = 0.05
"""Time between two polls of a condition [s]; the RWS session limits the rate of requests by itself."""


def comes_true(
    clock: Clock,
    condition: Callable[[], bool],
    timeout: float,
    *,
    check: Callable[[], None] | None = None,
    period: float | Callable[[], float] = POLL_PERIOD,
) -> bool:
    """Poll ``condition`` until it holds; whether it did within ``timeout`` [s].

    Args:
        clock: gives and passes the time.
        condition: what is waited for; polled once more when the time is up.
        timeout: longest wait [s].
        check: called after each poll that found the condition false; raises where waiting must end.
        period: time between two polls [s].
    """
    end = clock.now() + timeout
    while not condition():
        if check is not None:
            check()
        if clock.now() >= end:
            return False
        clock.wait(period() if callable(period) else period)
    return True


def wait_until(
    clock: Clock,
    condition: Callable[[], bool],
    timeout: float,
    what: Message | str | Callable[[], Message | str],
    *,
    check: Callable[[], None] | None = None,
    period: float | Callable[[], float] = POLL_PERIOD,
) -> None:
    """Wait until ``condition`` holds, polling as :func:`comes_true`.

    The error says ``what``, or what it returns: it is called when the time is up, to say how things are then.

    Raises:
        RobotNotReady: it did not hold in time.
    """
    if not comes_true(clock, condition, timeout, check=check, period=period):
        raise RobotNotReady(what() if callable(what) else what)
