"""Refusals of messages on topics: their sentence, that one has waited for too long, and the log of all of a topic."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Mapping
from time import time_ns
from typing import Any

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import CommandRefused

_LOG_PERIOD = 1.0
"""The same reason is logged once in this time [s], with how often it came meanwhile."""

_MOST_LINES = 10
"""Lines in one period, however many reasons there are: each message may have another invalid name."""

_REASONS = 50  # remembered; the oldest make room

_LONGEST_WAIT = 0.5
"""A command that waited for longer in the driver may be from before a stop that was recovered from meanwhile [s]."""


def command_refused(noun: str, reason: Message) -> CommandRefused:
    """The refusal of a message; ``noun`` is what it is, e.g. ``Goal``."""
    return CommandRefused(message("command_refused", noun=noun, reason=reason))


def waited_for(info: Mapping[str, Any]) -> float:
    """For how long a busy driver has left a message unread [s]; 0 where the middleware does not say when it came."""
    received = info["received_timestamp"]
    return max((time_ns() - received) * 1e-9, 0.0) if received else 0.0


def check_wait(noun: str, waited: float) -> None:
    """Raise CommandRefused if a message has waited for too long; ``noun`` as of :func:`command_refused`."""
    if waited > _LONGEST_WAIT:
        raise command_refused(noun, message("command_waited", waited=waited, longest=_LONGEST_WAIT))


def _reason(value: object) -> Hashable:
    """What a refusal is for, whatever its numbers: its code, and the names and reasons among its values."""
    if isinstance(value, Message):
        return (value.code, *map(_reason, value.values.values()))
    if isinstance(value, tuple):
        return tuple(map(_reason, value))
    return "" if isinstance(value, (int, float)) else str(value)


class RefusalLog:
    """Warnings of one topic, throttled by reason: different mistakes are all logged, however soon they follow.

    Args:
        log: a node's logger.
        now: the time [s].
    """

    def __init__(self, log: Any, now: Callable[[], float]) -> None:
        self._log = log
        self._now = now
        self._last: OrderedDict[Hashable, float] = OrderedDict()  # when a reason was logged
        self._begin = -_LOG_PERIOD  # of the period whose lines are counted
        self._lines = 0
        self._unlogged = 0  # refusals since the last line

    def warn(self, refusal: Message) -> None:
        """Log a refusal, unless its reason was logged just now; what was not logged is counted with the next line."""
        now, reason, sentence = self._now(), _reason(refusal), str(refusal)
        if now - self._begin >= _LOG_PERIOD:
            self._begin, self._lines = now, 0
        if now - self._last.get(reason, -_LOG_PERIOD) < _LOG_PERIOD or self._lines >= _MOST_LINES:
            self._unlogged += 1
            return
        self._last[reason] = now
        self._last.move_to_end(reason)
        if len(self._last) > _REASONS:
            self._last.popitem(last=False)
        self._lines += 1
        count, self._unlogged = self._unlogged, 0
        self._log.warning(f"{sentence} ({count} more refusals since the last line)" if count else sentence)
