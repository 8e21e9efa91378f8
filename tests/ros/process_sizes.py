"""What a program and its children hold: threads, descriptors and memory, as Linux counts them."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from abb_runtime.clock import SystemClock

PATIENCE = 10.0  # [s]
GLANCE = 0.25  # [s]
_GONE = (FileNotFoundError, ProcessLookupError)


class Sizes(NamedTuple):
    """Of all processes of one session together.

    Attributes:
        processes: how many there are.
        threads: of all of them.
        descriptors: open ones, of all of them.
        memory_kb: in use, without files and shared memory, whose pages come when they are first touched [kB].
    """

    processes: int
    threads: int
    descriptors: int
    memory_kb: int

    @property
    def counts(self) -> tuple[int, int, int]:
        """What must not grow at all."""
        return self[:3]

    def __str__(self) -> str:
        return (
            f"{self.processes} processes, {self.threads} threads, {self.descriptors} descriptors, "
            f"{self.memory_kb / 1024:.1f} MB"
        )


def sizes(session: int) -> Sizes:
    """Those of the processes that live now.

    Args:
        session: number of the process that began it, as ``abb_runtime.process.command_process`` starts each.
    """
    all_of_them = [Sizes(0, 0, 0, 0)]
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(*_GONE):
            if os.getsid(int(folder.name)) == session:
                all_of_them.append(_of_process(folder))
    return Sizes(*map(sum, zip(*all_of_them, strict=True)))


def settled_sizes(session: int) -> Sizes:
    """The sizes when nothing is begun or ended any more: two looks in turn count the same."""
    clock = SystemClock()
    end = clock.now() + PATIENCE
    before = sizes(session)
    while clock.now() < end:
        clock.wait(GLANCE)
        now = sizes(session)
        if now.counts == before.counts:
            return now
        before = now
    raise AssertionError(f"The counts do not settle within {PATIENCE:g} s: {before}")


def _of_process(folder: Path) -> Sizes:
    status = dict(line.split(":", 1) for line in (folder / "status").read_text().splitlines())
    memory = int(status["RssAnon"].split()[0]) if "RssAnon" in status else 0  # one that has ended has none
    return Sizes(1, int(status["Threads"]), len(os.listdir(folder / "fd")), memory)
