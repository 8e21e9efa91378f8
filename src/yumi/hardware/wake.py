"""How the fast line waits for the next datagram: asleep, beside processors that are awake, or looking ahead of time.

========== ==================================================== =================================================
mode       how it waits                                         what it costs
========== ==================================================== =================================================
blocking   asleep until a datagram comes; awake shortly before  a rehearsal each cycle; a processor that is halted
           it is due, for a rehearsal                           wakes up late
hot        the same beside processors that never halt           idle processors draw power; needs permission
ahead      after the rehearsal it looks for the datagram        at most 15 % of one processor per arm; a virtual
           without pause, for at most a tenth of a period       robot beside it has to wait
auto       ``hot`` where it is permitted, else ``ahead``
========== ==================================================== =================================================
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from enum import Enum

from yumi.clock import Clock
from yumi.control.arrival import ArrivalForecast
from yumi.links.poller import Poller
from yumi.links.realtime import AwakeProcessors

GLANCE = 0.010
"""How often the silence of the robot is looked at when nothing arrives [s]."""

_SHARE_TO_LOOK = 0.05
"""At most this share of a period is spent looking, at either side of the expected arrival."""

_STEADINESS = 1.0 / 16.0  # weight of one rehearsal in what the next is expected to take
_LONGEST_REHEARSAL = 0.001  # [s]; one that took longer was interrupted, and tells nothing about the next


class WakeMode(Enum):
    """What a user may choose."""

    AUTO = "auto"
    BLOCKING = "blocking"
    HOT = "hot"
    AHEAD = "ahead"


class Wait(ABC):
    """Sleeps until shortly before a datagram is due, then has the reply rehearsed: the real one finds warm caches.

    Args:
        clock: the machine's clock.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._forecast = ArrivalForecast()
        self._rehearsal: Callable[[], None] = _nothing
        self._rehearsal_time = 0.0
        self._was_asleep = True

    def prepare(self, rehearse: Callable[[], None]) -> None:
        """Take what rehearses the arm's cycle; who wakes up ahead of a datagram has the time for it."""
        self._rehearsal = rehearse

    def wait(self, poller: Poller, is_streaming: bool) -> None:
        """Wait for something to read and have it handled, or return after a glance.

        Args:
            poller: what is waited for.
            is_streaming: whether a robot sends datagrams now.
        """
        now, forecast = self._clock.now(), self._forecast
        self._was_asleep = True
        if not is_streaming or forecast.give_up_at() <= now:
            poller.wait(GLANCE)
            return
        pause = forecast.wake_at() - self._rehearsal_time - now
        if pause > 0.0 and not poller.doze(pause):
            self._rehearse()
        self._await(poller, forecast.give_up_at())

    def note_arrival(self, now: float) -> None:
        """A datagram came at ``now`` [s]."""
        self._forecast.note_arrival(now, was_waiting=self._was_asleep)

    def close(self) -> None:
        """Give back what it holds."""

    @abstractmethod
    def _await(self, poller: Poller, late: float) -> None:
        """Wait for a datagram that is due, until ``late`` [s] at least; the first look finds what came meanwhile."""

    def _rehearse(self) -> None:
        begin = self._clock.now()
        self._rehearsal()
        took = min(self._clock.now() - begin, _LONGEST_REHEARSAL)
        self._rehearsal_time += _STEADINESS * (took - self._rehearsal_time)


class BlockingWait(Wait):
    """Sleeps until a datagram comes."""

    def _await(self, poller: Poller, late: float) -> None:
        if not poller.wait(0.0):
            self._was_asleep = False
            poller.wait(GLANCE)


class HotWait(BlockingWait):
    """Sleeps, while a robot streams beside processors that stay awake.

    It does not look for the datagram: a robot on this machine, with less priority, could not send it meanwhile.
    """

    def __init__(self, clock: Clock) -> None:
        super().__init__(clock)
        self._processors = AwakeProcessors()

    def wait(self, poller: Poller, is_streaming: bool) -> None:
        if is_streaming:
            self._processors.hold()
        else:
            self._processors.release()
        super().wait(poller, is_streaming)

    def close(self) -> None:
        self._processors.release()


class AheadWait(Wait):
    """Sleeps until shortly before a datagram is due, then looks for it without a pause."""

    def __init__(self, clock: Clock) -> None:
        super().__init__(clock)
        self._forecast = ArrivalForecast(_SHARE_TO_LOOK)

    def _await(self, poller: Poller, late: float) -> None:
        while not poller.wait(0.0):
            self._was_asleep = False
            if self._clock.now() >= late:
                return


def _nothing() -> None:
    """Until there is something to rehearse."""


def way_to_wait(mode: WakeMode, clock: Clock) -> Wait:
    """How to wait in ``mode``; ``auto`` and ``hot`` take what is permitted."""
    if mode is WakeMode.BLOCKING:
        return BlockingWait(clock)
    if mode is not WakeMode.AHEAD and AwakeProcessors.are_permitted():
        return HotWait(clock)
    return BlockingWait(clock) if mode is WakeMode.HOT else AheadWait(clock)


def describe(wait: Wait) -> str:
    """The way to wait in a few words for the log."""
    if isinstance(wait, HotWait):
        return "processors kept awake while EGM runs"
    return "awake shortly before each datagram" if isinstance(wait, AheadWait) else "asleep between datagrams"
