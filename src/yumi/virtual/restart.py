"""The warm restart of the virtual controller: announced, then dark, then up again; advances by dt."""

from __future__ import annotations

from enum import Enum, auto

NOTICE = 0.2
"""The controller still answers so long after a restart was asked for [s]."""

DARKNESS = 20.0
"""How long nothing answers [s]."""


class Turn(Enum):
    """What a restart has come to."""

    NONE = auto()
    DOWN = auto()
    UP = auto()


class Restart:
    """Whether a restart is under way.

    Attributes:
        is_dark: whether the controller is down.
    """

    def __init__(self) -> None:
        self.is_dark = False
        self._left = 0.0
        self._darkness = 0.0

    def order(self, darkness: float = DARKNESS) -> None:
        """Restart soon, and stay dark for so long [s]; nothing happens while a restart is under way."""
        if self._left <= 0.0:
            self._left, self._darkness = NOTICE, darkness

    def advance(self, dt: float) -> Turn:
        """Let ``dt`` [s] pass; what has begun."""
        if self._left <= 0.0:
            return Turn.NONE
        self._left -= dt
        if self._left > 0.0:
            return Turn.NONE
        self.is_dark = not self.is_dark
        self._left = self._darkness if self.is_dark else 0.0
        return Turn.DOWN if self.is_dark else Turn.UP
