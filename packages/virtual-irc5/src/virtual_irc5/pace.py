"""The pace of a robot that keeps real time: when its cycles begin."""

from __future__ import annotations

from abb_protocols.robot.joints import CYCLE
from abb_runtime.clock import Clock

TIME_TO_ANSWER = 0.3 * CYCLE
"""Shortest time from a datagram to the next cycle, for its answer to arrive [s]."""

LONGEST_LAG = 5 * CYCLE
"""A machine that has fallen behind by more skips cycles [s]."""


class Pace:
    """When the cycles of a robot that keeps real time begin.

    A machine that has fallen behind catches up, but not at once: the answer to one datagram has to be there for the
    next cycle. Of answers that come two at a time only the newer one counts (reference/egm.md §4.3). On a machine whose
    cycles take longer than what is left beside that, the robot is slower than real time.

    Args:
        clock: the machine's.
        speed: how many times faster than real time the robot is; whatever this is, one cycle is 4.032 ms to it.
    """

    def __init__(self, clock: Clock, speed: float = 1.0) -> None:
        self._clock = clock
        self._speed = speed
        self._due = clock.now()

    def wait(self) -> None:
        """From the end of a cycle, when its datagrams have left, until the next one begins."""
        self._due += CYCLE / self._speed
        self._clock.wait(max(self._due - self._clock.now(), TIME_TO_ANSWER / self._speed))
        if self._clock.now() - self._due > LONGEST_LAG:
            self._due = self._clock.now()
