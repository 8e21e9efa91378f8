"""A mailbox holds the latest value only: the one way state and goals cross between the fast line and the rest."""

from __future__ import annotations

from typing import Protocol

Values = tuple[float, ...]


class Mailbox(Protocol):
    """Numbers of a fixed count; one side puts, any side peeks, nobody waits."""

    def put(self, values: Values) -> None:
        """Replace what is in the box."""

    def peek(self) -> tuple[int, Values] | None:
        """The number of the letter, from 1, and its values; None while nothing was ever put."""


class MemoryMailbox:
    """A mailbox inside one process."""

    def __init__(self) -> None:
        self._letter: tuple[int, Values] | None = None

    def put(self, values: Values) -> None:
        number = self._letter[0] if self._letter else 0
        self._letter = (number + 1, values)

    def peek(self) -> tuple[int, Values] | None:
        return self._letter
