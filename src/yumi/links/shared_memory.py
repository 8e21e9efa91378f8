"""Mailboxes in shared memory, and bells that ring across processes: how the fast line meets the rest.

A version counter before and after each letter tells a reader that the letter changed while it looked; it then looks
again, a few times, and takes the letter it read before if the writer has died in the middle of one. Nobody ever waits.
"""

from __future__ import annotations

import ctypes
import multiprocessing
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.context import SpawnContext
from multiprocessing.sharedctypes import RawArray
from typing import Protocol

from yumi.errors import MissingPrerequisite

PROCESSES: SpawnContext = multiprocessing.get_context("spawn")
"""How processes are made: spawned, since a fork would copy threads and locks of ROS."""

_LOOKS = 10  # a writer on another processor is done by then; one that we took the processor from never will be
_HEAD = 2  # begun, finished: equal and not 0 when the letter is whole


SharedNumbers = ctypes.Array[ctypes.c_double]
"""A block of numbers that two processes see."""


def shared_numbers(count: int) -> SharedNumbers:
    """``count`` zeros of 8 bytes; hand them to the child when it is spawned. Who writes and reads how is theirs.

    Raises:
        MissingPrerequisite: the machine has no shared memory left.
    """
    with _from_the_system():
        return RawArray(ctypes.c_double, count)


class SharedMailbox:
    """A mailbox for ``size`` numbers between two processes; hand it to the child when it is spawned."""

    def __init__(self, size: int) -> None:
        self._size = size
        with _from_the_system():
            self._memory = RawArray("d", _HEAD + size)
        self._read_last: tuple[int, tuple[float, ...]] | None = None

    def put(self, values: tuple[float, ...]) -> None:
        """Replace what is in the box; one process only may put."""
        if len(values) != self._size:
            raise ValueError(f"this mailbox holds {self._size} numbers, got {len(values)}")
        memory = self._memory
        version = memory[0] + 1.0
        memory[0] = version
        memory[_HEAD:] = values
        memory[1] = version

    def peek(self) -> tuple[int, tuple[float, ...]] | None:
        """The number of the letter, from 1, and its values; None while nothing was ever put."""
        memory, before = self._memory, self._read_last
        if before is not None and memory[0] == memory[1] == before[0]:
            return before  # the fast line looks in every cycle; a new letter is rare
        for _ in range(_LOOKS):
            finished = memory[1]
            values = tuple(memory[_HEAD:])
            if memory[0] == finished:
                self._read_last = (int(finished), values) if finished else None
                break
        return self._read_last


class SharedHistory:
    """The last ``depth`` letters of ``size`` numbers each: a reader that was busy for a moment misses none."""

    def __init__(self, size: int, depth: int) -> None:
        self._slots = tuple(SharedMailbox(1 + size) for _ in range(depth))
        self._newest = shared_numbers(1)

    def put(self, values: tuple[float, ...]) -> None:
        """Add a letter; the oldest one makes room. One process only may put."""
        number = int(self._newest[0]) + 1
        self._slots[number % len(self._slots)].put((float(number), *values))
        self._newest[0] = float(number)

    def peek(self) -> tuple[int, tuple[float, ...]] | None:
        """The newest letter with its number, from 1; None while nothing was ever put."""
        letters = self.since(int(self._newest[0]) - 1)
        return letters[-1] if letters else None

    def since(self, number: int) -> list[tuple[int, tuple[float, ...]]]:
        """The letters after ``number`` that are still there, oldest first."""
        newest = int(self._newest[0])
        numbers = range(max(number, newest - len(self._slots)) + 1, newest + 1)
        letters = ((wanted, self._slots[wanted % len(self._slots)].peek()) for wanted in numbers)
        # A letter that was replaced while we looked bears another number: it comes with the next look.
        return [(wanted, letter[1][1:]) for wanted, letter in letters if letter and letter[1][0] == wanted]


class Bell(Protocol):
    """Wakes whoever waits in another process."""

    def release(self) -> None:
        """Ring once; never waits."""

    def acquire(self, block: bool = True, timeout: float | None = None) -> bool:
        """Wait for a ring; tells whether there was one in time."""


def new_bell() -> Bell:
    """A bell for a process that will be spawned; raises MissingPrerequisite as :func:`shared_numbers`."""
    with _from_the_system():
        return PROCESSES.Semaphore(0)


@contextmanager
def _from_the_system() -> Iterator[None]:
    try:
        yield
    except (OSError, MemoryError) as error:
        why = error.strerror if isinstance(error, OSError) else "out of memory"
        raise MissingPrerequisite(
            f"The operating system gives no shared memory ({why}); see that /dev/shm exists and has some MB left "
            "(df /dev/shm), and that the limits of this program are not too low (ulimit -n, ulimit -v)."
        ) from error
