"""How the fast line waits for the next datagram: asleep, beside processors that are awake, or looking ahead of time.

========== ==================================================== =================================================
mode       how it waits                                         what it costs
========== ==================================================== =================================================
blocking   asleep until a datagram comes                        nothing; a halted processor wakes up late
hot        the same, with processors that never halt            idle processors draw power; needs permission
ahead      asleep until shortly before a datagram is due, then  at most a tenth of one processor per arm
           it looks without pause
auto       ``hot`` where it is permitted, else ``ahead``
========== ==================================================== =================================================
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import Protocol

from yumi.clock import Clock
from yumi.control.arrival import ArrivalForecast
from yumi.links.poller import Poller
from yumi.links.realtime import AwakeProcessors
from yumi.robot.joints import Side

GLANCE = 0.010
"""How often the silence of the robot is looked at when nothing arrives [s]."""


class WakeMode(Enum):
    """What a user may choose."""

    AUTO = "auto"
    BLOCKING = "blocking"
    HOT = "hot"
    AHEAD = "ahead"


class Wait(Protocol):
    """A way to wait."""

    def wait(self, poller: Poller, is_streaming: bool) -> None:
        """Wait for something to read and have it handled, or return after a glance.

        Args:
            poller: what is waited for.
            is_streaming: whether a robot sends datagrams now.
        """

    def note_arrival(self, side: Side, now: float) -> None:
        """A datagram of an arm came at ``now`` [s]."""

    def close(self) -> None:
        """Give back what it holds."""


class BlockingWait:
    """Sleeps until something comes."""

    def wait(self, poller: Poller, is_streaming: bool) -> None:
        poller.wait(GLANCE)

    def note_arrival(self, side: Side, now: float) -> None:
        """Nothing is learned from it."""

    def close(self) -> None:
        """It holds nothing."""


class HotWait(BlockingWait):
    """Sleeps, while a robot streams beside processors that stay awake."""

    def __init__(self) -> None:
        self._processors = AwakeProcessors()

    def wait(self, poller: Poller, is_streaming: bool) -> None:
        if is_streaming:
            self._processors.hold()
        else:
            self._processors.release()
        poller.wait(GLANCE)

    def close(self) -> None:
        self._processors.release()


class AheadWait:
    """Sleeps until shortly before a datagram is due, then looks for it without a pause.

    Args:
        clock: the machine's clock.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._forecasts: Mapping[Side, ArrivalForecast] = {side: ArrivalForecast() for side in Side}
        self._was_asleep = True

    def wait(self, poller: Poller, is_streaming: bool) -> None:
        now = self._clock.now()
        upcoming = [one for one in self._forecasts.values() if one.give_up_at() > now]
        if not is_streaming or not upcoming:
            self._was_asleep = True
            poller.wait(GLANCE)
            return
        forecast = min(upcoming, key=ArrivalForecast.wake_at)
        pause = forecast.wake_at() - now
        if pause > 0.0:
            self._was_asleep = True
            poller.doze(pause)
        self._look(poller, forecast.give_up_at())

    def note_arrival(self, side: Side, now: float) -> None:
        self._forecasts[side].note_arrival(now, was_waiting=self._was_asleep)

    def close(self) -> None:
        """It holds nothing."""

    def _look(self, poller: Poller, until: float) -> None:
        """The first look finds what came while asleep."""
        while not poller.wait(0.0):
            self._was_asleep = False
            if self._clock.now() >= until:
                return


def way_to_wait(mode: WakeMode, clock: Clock) -> Wait:
    """How to wait in ``mode``; ``auto`` and ``hot`` take what is permitted."""
    if mode is WakeMode.BLOCKING:
        return BlockingWait()
    if mode is not WakeMode.AHEAD and AwakeProcessors.are_permitted():
        return HotWait()
    return BlockingWait() if mode is WakeMode.HOT else AheadWait(clock)


def describe(wait: Wait) -> str:
    """The way to wait in a few words for the log."""
    if isinstance(wait, HotWait):
        return "processors kept awake while EGM runs"
    return "awake shortly before each datagram" if isinstance(wait, AheadWait) else "asleep between datagrams"
