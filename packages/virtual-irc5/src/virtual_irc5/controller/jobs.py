"""The jobs of the controller: work that takes its time, such as a backup, and what a client reads of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from abb_protocols.errors import YumiError

_JOBS_REMEMBERED = 50


@dataclass(slots=True)
class Job:
    """Work that takes its time, such as a backup; a client reads how far it is at ``/progress/{number}``.

    Attributes:
        number: as in its address.
        work: done at its end; what it raises is the failure.
        left: time until then [s].
        is_done: whether it has ended.
        failure: why it has failed; empty as long as it has not.
    """

    number: int
    work: Callable[[], None]
    left: float
    is_done: bool = False
    failure: str = ""

    @property
    def state(self) -> str:
        """In the words of RWS."""
        return "Pending" if not self.is_done else f"Error: {self.failure}" if self.failure else "Ready"


class Jobs:
    """The jobs of a controller; it remembers the latest ones after their end."""

    def __init__(self) -> None:
        self._jobs: dict[int, Job] = {}
        self._begun = 0
        self._later: list[tuple[float, Callable[[], None]]] = []

    def begin(self, work: Callable[[], None], duration: float) -> Job:
        """Do ``work`` in ``duration`` [s]."""
        self._begun += 1
        job = self._jobs[self._begun] = Job(self._begun, work, duration)
        for number in [each for each, known in self._jobs.items() if known.is_done][:-_JOBS_REMEMBERED]:
            del self._jobs[number]
        return job

    def find(self, number: str) -> Job | None:
        """The job of that number, or None."""
        return next((job for job in self._jobs.values() if str(job.number) == number), None)

    def later(self, delay: float, work: Callable[[], None]) -> None:
        """Do something of the controller's own in ``delay`` [s], such as the end of a pulse."""
        self._later.append((delay, work))

    def advance(self, dt: float) -> None:
        """Let ``dt`` [s] pass."""
        for job in tuple(self._jobs.values()) if self._jobs else ():
            if job.is_done:
                continue
            job.left -= dt
            if job.left <= 0.0:
                job.is_done = True
                try:
                    job.work()
                except YumiError as error:
                    job.failure = str(error)
        if self._later:
            waiting, self._later = [(left - dt, work) for left, work in self._later], []
            for left, work in waiting:
                if left > 0.0:
                    self._later.append((left, work))
                else:
                    work()
