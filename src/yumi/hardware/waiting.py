"""Waiting for a state of the robot, with a deadline: nothing on a robot is true at once."""

from __future__ import annotations

from collections.abc import Callable

from yumi.clock import Clock
from yumi.errors import RobotNotReady

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
