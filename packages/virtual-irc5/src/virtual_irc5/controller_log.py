"""Events of the virtual controller: its event log (reference/rws.md §12), and refusals."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto

from abb_protocols.errors import YumiError
from abb_protocols.rws.values import EventType

_ALL_DOMAINS = 0
_LOG_CAPACITY = 1000
_DOMAIN_CAPACITY = 20


@dataclass(frozen=True, slots=True)
class ControllerLogEvent:
    """One entry of the log.

    Attributes:
        number: rises by one with each event, over all domains.
        code: ABB's event number.
        time: when it happened, on the controller's clock [s].
        type: how serious it is.
        domain: the log it is in; domain 0 shows all.
        title: one line.
        description: what happened and what to do, in sentences.
        arguments: what of it differs from event to event.
    """

    number: int
    code: int
    time: float
    type: EventType
    domain: int
    title: str
    description: str
    arguments: tuple[str, ...] = ()


class ControllerEventLog:
    """Remembers the latest events, all of them together and each domain for itself.

    Attributes:
        watchers: called for each event.
    """

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self.watchers: list[Callable[[ControllerLogEvent], None]] = []
        self._last_number = 0
        self._logs: dict[int, deque[ControllerLogEvent]] = {_ALL_DOMAINS: deque(maxlen=_LOG_CAPACITY)}

    def append(
        self,
        code: int,
        title: str,
        description: str = "",
        type: EventType = EventType.INFORMATION,
        domain: int | None = None,
        arguments: tuple[str, ...] = (),
    ) -> ControllerLogEvent:
        """Log an event; its domain is the ten-thousands of its code unless another one is given."""
        self._last_number += 1
        place = code // 10000 if domain is None else domain
        event = ControllerLogEvent(self._last_number, code, self._now(), type, place, title, description, arguments)
        self._logs[_ALL_DOMAINS].appendleft(event)
        if place != _ALL_DOMAINS:
            self._logs.setdefault(place, deque(maxlen=_DOMAIN_CAPACITY)).appendleft(event)
        for watcher in tuple(self.watchers):
            watcher(event)
        return event

    def entries(self, domain: int = _ALL_DOMAINS) -> tuple[ControllerLogEvent, ...]:
        """Events of a domain, newest first; domain 0 has all."""
        return tuple(self._logs.get(domain, ()))

    def clear(self, domain: int = _ALL_DOMAINS) -> None:
        """Forget the events of a domain; domain 0 forgets all."""
        if domain == _ALL_DOMAINS:
            self._logs = {_ALL_DOMAINS: deque(maxlen=_LOG_CAPACITY)}
        else:
            self._logs.pop(domain, None)


class RefusalReason(Enum):
    """The reason of a refusal; it shows the caller what to do."""

    WRONG_MODE = auto()
    MOTORS_OFF = auto()
    NOT_STOPPED = auto()
    ALREADY_RUNNING = auto()
    NO_PROGRAM_POINTER = auto()
    READ_ONLY = auto()
    UNKNOWN = auto()
    OUT_OF_RANGE = auto()
    EMERGENCY_STOP = auto()
    BAD_VALUE = auto()
    NO_FILE = auto()
    NO_MODULE = auto()
    NAME_TAKEN = auto()
    BAD_PROGRAM = auto()
    NO_SPACE = auto()


class Refused(YumiError):
    """The virtual controller refuses a request and has changed nothing.

    Attributes:
        reason: the kind of refusal.
    """

    def __init__(self, reason: RefusalReason, sentence: str) -> None:
        super().__init__(sentence)
        self.reason = reason
