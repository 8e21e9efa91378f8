"""Where RAPID tasks wait for one another (WaitSyncTask)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable


class SyncPoints:
    """Counts who has come to which point how often: the n-th of one task meets the n-th of each other."""

    def __init__(self) -> None:
        self._arrivals: Counter[tuple[str, str]] = Counter()

    def arrive(self, point: str, task: str) -> int:
        """Note an arrival; tells the how many-th of this task at this point it is."""
        self._arrivals[point, task] += 1
        return self._arrivals[point, task]

    def have_met(self, point: str, arrival: int, tasks: Iterable[str]) -> bool:
        """Whether every task has come to the point at least ``arrival`` times."""
        return all(self._arrivals[point, task] >= arrival for task in tasks)

    def leave(self, point: str, task: str) -> None:
        """Take an arrival back: the task waits no longer."""
        self._arrivals[point, task] -= 1
