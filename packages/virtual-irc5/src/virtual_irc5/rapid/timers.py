"""The timer queue of a task: what it does at a later time, such as the end of a pulse."""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Callable

from virtual_irc5.rapid.types import RapidRuntimeError

_Action = Callable[[], None]
_MOST_ACTIONS = 1000


class TimerQueue:
    """Actions in the order of their task time [s]."""

    def __init__(self) -> None:
        self._entries: list[tuple[float, int, _Action]] = []
        self._order = itertools.count()

    def add(self, time: float, action: _Action) -> None:
        """Do something at a task time [s]; raises ERR_EXECPHR when too many wait already."""
        if len(self._entries) >= _MOST_ACTIONS:
            raise RapidRuntimeError("ERR_EXECPHR", f"{_MOST_ACTIONS} delayed outputs and pulses are under way already.")
        heapq.heappush(self._entries, (time, next(self._order), action))

    @property
    def next_time(self) -> float:
        """When the next action is due [s]; infinite when there is none."""
        return self._entries[0][0] if self._entries else math.inf

    def perform(self, now: float) -> None:
        """Do everything that is due."""
        while self._entries and self._entries[0][0] <= now:
            heapq.heappop(self._entries)[2]()
