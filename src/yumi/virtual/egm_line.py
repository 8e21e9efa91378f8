"""The line between an arm and its sensor, which can break; advances by dt."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf


class EgmLine:
    """Carries the datagrams of one arm."""

    def __init__(self) -> None:
        self._cut_for = 0.0

    @property
    def is_cut(self) -> bool:
        """Whether nothing comes through in either direction."""
        return self._cut_for > 0.0

    def cut(self, duration: float = inf) -> None:
        """Lose all datagrams for ``duration`` [s]."""
        self._cut_for = duration

    def repair(self) -> None:
        """Let all datagrams through again."""
        self._cut_for = 0.0

    def arriving(self, inbox: Sequence[bytes]) -> Sequence[bytes]:
        """What of ``inbox`` reaches the arm."""
        return () if self.is_cut else inbox

    def leaving(self, datagram: bytes | None) -> bytes | None:
        """What of the arm's datagram gets out."""
        return None if self.is_cut else datagram

    def advance(self, dt: float) -> None:
        """Let ``dt`` [s] pass."""
        self._cut_for = max(0.0, self._cut_for - dt)
