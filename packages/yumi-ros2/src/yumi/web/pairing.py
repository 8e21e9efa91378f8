"""Pairing: which browser sessions on other machines may operate a real robot.

A person reads a code in the terminal of the robot's machine and types it on the page. Each code is for one session; a
session has a key then, until this program ends.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable
from math import ceil

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused

PAIRING_DIGITS = 6
"""Of a code."""

WRONG_PAIRING_CODES = 3
"""After so many wrong codes there is another code, and a pause in which none is taken."""

FIRST_PAIRING_PAUSE, LONGEST_PAIRING_PAUSE = 30.0, 3600.0
"""The first pause, and the longest [s]: each is twice as long as the one before."""


class Pairing:
    """The code that is shown, and the keys of the sessions that are paired.

    Args:
        show: takes each new code, for a person at this machine.
        now: the time [s].
    """

    def __init__(self, show: Callable[[str], None], now: Callable[[], float] = time.monotonic) -> None:
        self._show, self._now = show, now
        self._keys: list[bytes] = []
        self._wrong, self._pause, self._paused_until = 0, FIRST_PAIRING_PAUSE, 0.0
        self._code = ""

    def begin(self) -> None:
        """Show a new code."""
        self._code = f"{secrets.randbelow(10**PAIRING_DIGITS):0{PAIRING_DIGITS}d}"
        self._show(self._code)

    def pair(self, code: str) -> str:
        """The key of a session whose person has typed the code.

        Raises:
            CommandRefused: the code is wrong, or too many were.
        """
        left = self._paused_until - self._now()
        if left > 0.0:
            raise CommandRefused(message("pairing_paused", duration=ceil(left)))
        typed = "".join(code.split()).encode(errors="surrogatepass")
        if not (self._code and secrets.compare_digest(typed, self._code.encode())):
            self._refuse()
        self._wrong, self._pause = 0, FIRST_PAIRING_PAUSE
        key = secrets.token_urlsafe(24)
        self._keys.append(key.encode())
        self.begin()  # a code that was used is known to more than one person
        return key

    def _refuse(self) -> None:
        self._wrong += 1
        if self._wrong < WRONG_PAIRING_CODES:
            raise CommandRefused(message("pairing_code_wrong"))
        pause, self._wrong = self._pause, 0
        self._paused_until, self._pause = self._now() + pause, min(LONGEST_PAIRING_PAUSE, 2.0 * pause)
        self.begin()
        raise CommandRefused(message("pairing_paused", duration=pause))

    def is_paired(self, key: str) -> bool:
        """Whether a session has this key."""
        given = key.encode(errors="surrogateescape")
        found = [secrets.compare_digest(given, known) for known in self._keys]  # all of them, in the same time
        return any(found)
