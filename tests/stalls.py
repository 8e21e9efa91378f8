"""How long threads wait for a processor of a busy machine, which no test counts as time that a program takes."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path


def waited_for_a_processor(*pids: int) -> float:
    """How long this thread, and all of some processes, were ready and did not run, since they began [s].

    0 where the system does not count that.
    """
    threads = [thread for pid in pids for thread in Path(f"/proc/{pid}/task").glob("*")]
    waited = 0
    for thread in (Path("/proc/thread-self"), *threads):
        with suppress(OSError):
            waited += int((thread / "schedstat").read_text().split()[1])
    return waited * 1e-9
