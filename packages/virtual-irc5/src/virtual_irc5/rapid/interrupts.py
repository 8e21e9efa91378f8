"""The interrupts of a task: traps, orders (a signal, a time, a change), and interrupts that have come and wait."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from virtual_irc5.rapid.loaded_modules import UserRoutine
from virtual_irc5.rapid.types import RapidRuntimeError

_MOST_INTERRUPTS = 100
_LONGEST_QUEUE = 1000  # interrupts; what comes while so many wait is lost


class SignalEdge(Enum):
    """Which change of a signal orders the interrupt; the values are RAPID's LOW, HIGH and EDGE."""

    LOW = 0
    HIGH = 1
    BOTH = 2

    def is_in(self, old: float, new: float) -> bool:
        """Whether a change from `old` to `new` is such an edge."""
        if old == new:
            return False
        return self is SignalEdge.BOTH or bool(new) == (self is SignalEdge.HIGH)


class InterruptChange(Protocol):
    """Which change of a signal orders an interrupt."""

    def is_in(self, old: float, new: float) -> bool: ...


@dataclass(slots=True)
class SignalOrder:
    """ISignalDI, ISignalDO, ISignalGI, ISignalGO, ISignalAI, ISignalAO."""

    signal: str
    edge: InterruptChange
    is_single: bool


@dataclass(slots=True)
class TimerOrder:
    """ITimer: due at task time `due` [s], then every `period` [s]."""

    due: float
    period: float
    is_single: bool


@dataclass(slots=True)
class ChangeOrder:
    """IPers, and whatever else reports by itself that its interrupt has come: see `Interrupts.occur`."""

    is_single: bool


_Order = SignalOrder | TimerOrder | ChangeOrder


@dataclass(slots=True)
class InterruptConnection:
    """An interrupt number with its trap; asleep, what comes is dropped."""

    trap: UserRoutine
    order: _Order | None = None
    is_asleep: bool = False


class Interrupts:
    """The interrupts of one task.

    While disabled, what comes is queued; while an interrupt is asleep, what comes for it is dropped.
    """

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Forget all connections and everything queued, as PP to main does."""
        self.connections: dict[int, InterruptConnection] = {}
        self.queue: deque[int] = deque()
        self.is_disabled = False
        self._next_number = 1

    def connect(self, number: int, trap: UserRoutine) -> int:
        """A new interrupt number for `trap`; `number` is what the intnum held before."""
        if number in self.connections:
            raise RapidRuntimeError("ERR_ALRDYCNT", f"The interrupt {number} already has a trap; IDelete it first.")
        if len(self.connections) >= _MOST_INTERRUPTS:
            raise RapidRuntimeError("ERR_INOMAX", f"A task may have {_MOST_INTERRUPTS} interrupts.")
        new = self._next_number
        self._next_number += 1
        self.connections[new] = InterruptConnection(trap)
        return new

    def order(self, number: int, order: _Order) -> None:
        self.connection(number).order = order

    def is_ordered(self, number: int, order: _Order) -> bool:
        """Whether the order still stands."""
        connection = self.connections.get(number)
        return connection is not None and connection.order is order

    def delete(self, number: int) -> None:
        """Remove an interrupt and what is queued of it; unknown numbers are none."""
        self.connections.pop(number, None)
        self.queue = deque(n for n in self.queue if n != number)

    def signal_changed(self, signal: str, old: float, new: float) -> None:
        for number, connection in list(self.connections.items()):
            order = connection.order
            if isinstance(order, SignalOrder) and order.signal.lower() == signal.lower() and order.edge.is_in(old, new):
                self._enqueue(number, connection)

    def occur(self, number: int) -> None:
        """Let an interrupt come that no signal or timer brings, such as TriggInt's; unknown numbers are none."""
        connection = self.connections.get(number)
        if connection is not None:
            self._enqueue(number, connection)

    def next_timer(self) -> float:
        """Task time at which the next timer is due [s], infinite when none runs."""
        timers = (c.order.due for c in self.connections.values() if isinstance(c.order, TimerOrder))
        return min(timers, default=math.inf)

    def time_passed(self, now: float) -> None:
        for number, connection in list(self.connections.items()):
            order = connection.order
            if isinstance(order, TimerOrder) and order.due <= now:
                order.due += order.period
                if order.due <= now:  # what came due while the task stood still is lost
                    order.due = now + order.period
                self._enqueue(number, connection)

    def take(self) -> tuple[int, UserRoutine]:
        """The next queued interrupt and its trap."""
        number = self.queue.popleft()
        return number, self.connections[number].trap

    def _enqueue(self, number: int, connection: InterruptConnection) -> None:
        if connection.order is not None and connection.order.is_single:
            connection.order = None
        if not connection.is_asleep and len(self.queue) < _LONGEST_QUEUE:
            self.queue.append(number)

    def connection(self, number: int) -> InterruptConnection:
        """The interrupt with its trap; raises ERR_UNKINO."""
        found = self.connections.get(number)
        if found is None:
            raise RapidRuntimeError("ERR_UNKINO", f"The interrupt {number} has no trap; CONNECT it first.")
        return found
