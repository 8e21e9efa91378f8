"""A ticker: what is published at fixed rates is published by one thread.

A timer of a node costs a turn of the executor each time, in which every subscription and service of all its nodes is
looked at; that is many times as much as what most timers do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from threading import Event as Flag
from threading import RLock

from yumi.clock import Clock
from yumi.links.supervision import Failures, SupervisedThread

Action = Callable[[], None]

_BREATH = 0.001  # [s] even a thread that is behind lets others in between


@dataclass(eq=False, slots=True)
class _Repeated:
    what: str
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
        self._lock = RLock()
        self._bell, self._is_over = Flag(), Flag()
        self._failures = Failures()
        self._thread = SupervisedThread(name, self._run, self._is_over)

    def every(self, period: float, what: str, action: Action) -> Callable[[], None]:
        """Call ``action``, which publishes ``what``, once each ``period`` [s].

        Returns:
            What ends that; no call goes on after it, but for one that ends itself.
        """
        repeated = _Repeated(what, action, period, self._clock.now() + period)
        with self._lock:
            self._repeated.append(repeated)
        self._bell.set()

        def end() -> None:
            with self._lock:
                if repeated in self._repeated:
                    self._repeated.remove(repeated)

        return end

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """Call nothing any more; before what is called loses what it needs."""
        self._is_over.set()
        self._bell.set()
        self._thread.join()

    def tick(self) -> float:
        """Call what is due; returns how long nothing will be [s]. The thread does that once it has started."""
        now = self._clock.now()
        for each in tuple(self._repeated):
            if each.due <= now:
                each.due = each.due + each.period if now < each.due + each.period else now + each.period
                self._call(each)
        return min((each.due for each in self._repeated), default=inf) - self._clock.now()

    def _run(self) -> None:
        while not self._is_over.is_set():
            self._bell.clear()
            with self._lock:
                pause = self.tick()
            self._bell.wait(max(_BREATH, pause) if pause < inf else None)

    def _call(self, each: _Repeated) -> None:
        try:
            each.action()
            each.is_failing = False
        except Exception as error:  # the others still have to be published
            self._failures.note(f"Publishing {each.what}", error)
            if not each.is_failing:
                each.is_failing = True
                self._complain(f"{each.what} could not be published, {type(error).__name__}: {error}.")
