"""Real-time settings: priority, memory that stays, no collector, short turns of threads, processors kept awake."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

_PRIORITY = 50
_ROBOT_PRIORITY = 40  # of a virtual robot: its driver answers first
_NICE = -20
_MCL_CURRENT_AND_FUTURE = 3
_SWITCH_INTERVAL = 0.0002  # [s] Python's own is 5 ms, longer than a cycle
_DMA_LATENCY = "/dev/cpu_dma_latency"


class AwakeProcessors:
    """Keeps the machine's processors from falling asleep between two datagrams, while it is held.

    A halted processor takes longest of all to answer (reference/performance.md, recommendation 4). The price: idle
    processors draw power and get warm, and other guests of a virtual machine's host have less.
    """

    def __init__(self) -> None:
        self._file: int | None = None

    @staticmethod
    def are_permitted() -> bool:
        """Whether this process may hold them awake."""
        try:
            os.close(os.open(_DMA_LATENCY, os.O_WRONLY))
        except OSError:  # containers refuse what the file's mode permits
            return False
        return True

    def hold(self) -> None:
        """Keep them awake from now on; does nothing when they are.

        Raises:
            OSError: it is not permitted.
        """
        if self._file is None:
            self._file = os.open(_DMA_LATENCY, os.O_WRONLY)
            os.write(self._file, bytes(4))  # a latency of 0 µs, as a 32-bit number; holds while the file is open

    def release(self) -> None:
        """Let them sleep again."""
        if self._file is not None:
            os.close(self._file)
            self._file = None


def prepare_process() -> str:
    """Make this process as prompt as it may be; returns what was done, for the log (reference/performance.md)."""
    gc.collect()
    gc.freeze()
    gc.disable()
    priority = "normal priority"
    if hasattr(os, "sched_setscheduler"):
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_PRIORITY))
            priority = f"real-time priority {_PRIORITY}"
        except PermissionError:
            priority = _raise_nice()
    try:
        is_locked = ctypes.CDLL(None, use_errno=True).mlockall(_MCL_CURRENT_AND_FUTURE) == 0
    except (OSError, AttributeError):  # not a POSIX libc
        is_locked = False
    return f"{priority}, {'memory locked' if is_locked else 'memory not locked (not permitted)'}"


def release_process() -> None:
    """Give back what was frozen, so that libraries find nothing of theirs left at the end of the process."""
    gc.unfreeze()
    gc.collect()


def prefer_process() -> None:
    """Let this process run before ordinary ones, where that is permitted; for a robot that must keep its pace."""
    _raise_nice()
    settle_memory()


def prefer_thread() -> None:
    """Let the calling thread alone run in real time, below the control loop, where that is permitted.

    Nice values do not do: Linux shares the processors between sessions first (sched_autogroup), so a program of another
    terminal takes half of a processor whatever the niceness. Threads that are started later are ordinary ones: what
    clients and RAPID modules make them compute must not keep the machine from anything else.
    """
    with suppress(AttributeError, PermissionError):  # neither elsewhere than on Linux nor without permission
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(_ROBOT_PRIORITY))


def settle_memory() -> None:
    """What there is by now stays: the collector need not look at it again, which would take longer than a cycle."""
    gc.collect()
    gc.freeze()


@contextmanager
def paused_collector() -> Iterator[None]:
    """No garbage is collected meanwhile: among all that is recorded, looking for some takes tens of milliseconds."""
    settle_memory()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
        release_process()


@contextmanager
def short_switch_interval() -> Iterator[None]:
    """A thread that waits for the interpreter gets it soon: a message on its way changes threads several times."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(_SWITCH_INTERVAL)
    try:
        yield
    finally:
        sys.setswitchinterval(before)


def _raise_nice() -> str:
    try:
        return f"nice {os.nice(_NICE)} (real-time priority is not permitted)"
    except PermissionError:
        return "normal priority (neither real-time priority nor nice is permitted)"
