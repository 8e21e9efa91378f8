"""A ticker: what is published at fixed rates is published by one thread.

A timer of a node costs a turn of the executor each time, in which every subscription and service of all its nodes is
looked at; that is many times as much as what most timers do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from threading import Condition, RLock, Thread

from yumi.clock import Clock

Action = Callable[[], None]


@dataclass(eq=False, slots=True)
class _Repeated:
    action: Action
    period: float
    due: float
    is_failing: bool = False


class Ticker:
    """Calls actions at fixed periods, one after the other, between start and stop.

    What comes late is not made up for, and what fails is called again.

    Args:
        clock: what the periods are measured on.
        complain: told what an action fails with, once until it succeeds.
        name: of the thread.
    """

    def __init__(self, clock: Clock, complain: Callable[[str], None], name: str = "ticker") -> None:
        self._clock = clock
        self._complain = complain
        self._repeated: list[_Repeated] = []
        self._news = Condition(RLock())
        self._is_over = False
        self._thread = Thread(target=self._run, name=name, daemon=True)

    def every(self, period: float, action: Action) -> Callable[[], None]:
        """Call ``action`` once each ``period`` [s]; returns what ends that, after which no call goes on."""
        repeated = _Repeated(action, period, self._clock.now() + period)
        with self._news:
            self._repeated.append(repeated)
            self._news.notify()

        def end() -> None:
            with self._news:
                if repeated in self._repeated:
                    self._repeated.remove(repeated)

        return end

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """Call nothing any more; before what is called loses what it needs."""
        with self._news:
            self._is_over = True
            self._news.notify()
        if self._thread.ident is not None:
            self._thread.join()

    def tick(self) -> float:
        """Call what is due; returns how long nothing will be [s]."""
        now = self._clock.now()
        for each in tuple(self._repeated):
            if each.due <= now:
                each.due = each.due + each.period if now < each.due + each.period else now + each.period
                self._call(each)
        return min((each.due for each in self._repeated), default=inf) - self._clock.now()

    def _run(self) -> None:
        with self._news:
            while not self._is_over:
                pause = self.tick()
                self._news.wait(max(0.0, pause) if pause < inf else None)

    def _call(self, each: _Repeated) -> None:
        try:
            each.action()
            each.is_failing = False
        except Exception as error:  # the others still have to be published
            if not each.is_failing:
                self._complain(f"A topic could not be published, {type(error).__name__}: {error}.")
            each.is_failing = True
