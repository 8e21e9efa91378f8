"""Logs refused commands: each reason when it first comes, a stream of refusals once a second with its count."""

from __future__ import annotations

import re
from collections import OrderedDict
from collections.abc import Callable
from typing import Any

PERIOD = 1.0
"""The same reason is logged once in this time [s], with how often it came meanwhile."""

MOST = 10
"""Lines in one period, however many reasons there are: a sender may make up names."""

_REASONS = 50  # remembered; the oldest make room
_NUMBER = re.compile(r"(?<![\w'])-?\d[\d.e+-]*")  # what stands alone: the digits in a joint's name tell joints apart


class RefusalLog:
    """Warnings of one topic, throttled by reason: different mistakes are all answered, however soon they follow.

    Args:
        log: a node's logger.
        now: tells the time [s].
    """

    def __init__(self, log: Any, now: Callable[[], float]) -> None:
        self._log = log
        self._now = now
        self._last: OrderedDict[str, float] = OrderedDict()  # when a reason was logged
        self._begin = -PERIOD  # of the period whose lines are counted
        self._lines = 0
        self._silent = 0  # refusals since the last line that were not logged

    def warn(self, sentence: str) -> None:
        """Log a refusal, unless its reason was logged just now; what was not logged is counted with the next line."""
        now, reason = self._now(), _NUMBER.sub("#", sentence)
        if now - self._begin >= PERIOD:
            self._begin, self._lines = now, 0
        if now - self._last.get(reason, -PERIOD) < PERIOD or self._lines >= MOST:
            self._silent += 1
            return
        self._last[reason] = now
        self._last.move_to_end(reason)
        if len(self._last) > _REASONS:
            self._last.popitem(last=False)
        self._lines += 1
        count, self._silent = self._silent, 0
        self._log.warning(f"{sentence} ({count} more refusals since the last line)" if count else sentence)
