"""A child process and the pipe to it: commands down, answers and events up, and the end of either side noticed."""

from __future__ import annotations

import io
import mmap
import multiprocessing
import os
import pickle
import socket
import struct
import sys
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnContext
from multiprocessing.reduction import ForkingPickler
from types import ModuleType
from typing import Any

from yumi.errors import MissingPrerequisite
from yumi.process.realtime import release_process

PROCESSES: SpawnContext = multiprocessing.get_context("spawn")
"""How processes are made: spawned, since a fork would copy threads and locks of ROS."""

_NUMBER = struct.Struct("!I")
_PROTOCOL = 5  # whose large blocks of memory travel beside the pickle, and are not copied by it
_READ_AT_ONCE = 1 << 16  # bytes; takes 20 µs
_QUEUE = 256  # values that wait for a reader, as one that was stopped does not read: then further ones are dropped


class PipeClosed(Exception):
    """The other side is gone."""


class PipeEnd:
    """One end of a pipe between two processes; values must be picklable.

    A value is sent as the number of its parts, their lengths, and the parts: its pickle, then the blocks of memory that
    it offers as :class:`pickle.PickleBuffer`.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._parts: list[bytes | mmap.mmap] = []
        self._lengths: list[int] = []
        self._filled = 0  # bytes of the last part
        self._queue: deque[memoryview] = deque()  # what waits for room in the pipe
        self._sender: socket.socket | None = None  # the same pipe, for sending what does not wait

    def fileno(self) -> int:
        return self._connection.fileno()

    def send(self, value: object) -> None:
        """Pass ``value`` on, at one go.

        A :class:`Connection` would write the length of what is long first, and give the interpreter away before the
        rest: who reads would wait for it in between.

        Raises:
            PipeClosed: the reader is gone.
        """
        try:
            for part in _parts(value):
                left = part
                while left:
                    left = left[os.write(self.fileno(), left) :]
        except OSError as error:
            raise PipeClosed(str(error)) from error

    def send_soon(self, value: object) -> bool:
        """Pass ``value`` on without ever waiting: as much as the pipe has room for now, the rest with :meth:`flush`.

        Returns:
            Whether it was taken: not while too many wait already, as for a reader that was stopped.

        Raises:
            PipeClosed: the reader is gone.
        """
        if len(self._queue) >= _QUEUE:
            return False
        self._queue.extend(_parts(value))
        self.flush()
        return True

    def flush(self) -> bool:
        """Pass on what waits, as far as the pipe has room; returns whether nothing waits any more.

        Raises:
            PipeClosed: the reader is gone.
        """
        if self._queue and self._sender is None:
            self._sender = socket.socket(fileno=os.dup(self.fileno()))
        while self._queue and self._sender is not None:
            try:
                sent = self._sender.send(self._queue[0], socket.MSG_DONTWAIT)
            except BlockingIOError:
                return False
            except OSError as error:
                self._queue.clear()
                raise PipeClosed(str(error)) from error
            self._queue[0] = self._queue[0][sent:]
            if not self._queue[0]:
                self._queue.popleft()
        return True

    def receive(self) -> Any:
        """Wait for the next value.

        Raises:
            PipeClosed: nothing will come any more.
        """
        while not self.read():
            continue
        (payload, *blocks), self._parts, self._lengths = self._parts, [], []
        return pickle.loads(payload, buffers=blocks)

    def read(self) -> bool:
        """Read the begin of the next value, or at most 64 kB more of one that was begun.

        It does not wait for the rest of a long value, which may come later; to be called when something can be read.

        Returns:
            Whether the value is whole: :meth:`receive` has it at once then.

        Raises:
            PipeClosed: nothing will come any more.
        """
        if not self._lengths:
            (count,) = _NUMBER.unpack(self._exactly(_NUMBER.size))
            self._lengths = [length for (length,) in _NUMBER.iter_unpack(self._exactly(count * _NUMBER.size))]
            self._parts.append(self._exactly(self._lengths[0]))
            self._filled = self._lengths[0]
        elif not self._is_whole:
            if self._filled == self._lengths[len(self._parts) - 1]:
                self._parts.append(mmap.mmap(-1, self._lengths[len(self._parts)]))  # given back as soon as it is freed
                self._filled = 0
            with memoryview(self._parts[-1]) as part:
                self._filled += self._some(part[self._filled : self._filled + _READ_AT_ONCE])
        return self._is_whole

    @property
    def _is_whole(self) -> bool:
        return len(self._parts) == len(self._lengths) and self._filled == self._lengths[-1]

    def _exactly(self, count: int) -> bytes:
        data, filled = memoryview(bytearray(count)), 0
        while filled < count:
            filled += self._some(data[filled:])
        return bytes(data)

    def _some(self, room: memoryview) -> int:
        try:
            count = os.readv(self.fileno(), [room])
        except OSError as error:
            raise PipeClosed(str(error)) from error
        if not count:
            raise PipeClosed("the other side is gone")
        return count

    def has_value(self, timeout: float = 0.0) -> bool:
        """Whether a value, or the end, waits; looks for at most ``timeout`` [s]."""
        return self._connection.poll(timeout)

    def close(self) -> None:
        self._connection.close()
        if self._sender is not None:
            self._sender.close()


def _parts(value: object) -> list[memoryview]:
    """What is sent for ``value``."""
    blocks: list[pickle.PickleBuffer] = []
    payload = io.BytesIO()
    ForkingPickler(payload, _PROTOCOL, True, blocks.append).dump(value)
    raw = [block.raw() for block in blocks]
    lengths = [len(payload.getbuffer()), *(block.nbytes for block in raw)]
    head = b"".join(_NUMBER.pack(number) for number in (len(lengths), *lengths))
    return [memoryview(head + payload.getvalue()), *raw]


class ChildProcess:
    """A process of our own that runs ``main(pipe, *arguments)``.

    Args:
        name: for process lists.
        main: a function of a module, so that it can be found in the child.
        arguments: picklable, or shared memory.
    """

    def __init__(self, name: str, main: Callable[..., None], *arguments: object) -> None:
        with _from_the_system(name):
            ours, theirs = PROCESSES.Pipe()
        self.pipe = PipeEnd(ours)
        self._theirs = theirs
        self._process = PROCESSES.Process(name=name, target=_run, args=(main, theirs, *arguments))

    @property
    def exit_code(self) -> int | None:
        return self._process.exitcode

    @property
    def is_started(self) -> bool:
        return self._process.pid is not None

    def start(self) -> None:
        """Start it; raises MissingPrerequisite when the operating system does not let it."""
        with _without_main_module(), _from_the_system(self._process.name):
            self._process.start()
        self._theirs.close()  # so that the pipe ends when the child does

    def join(self, timeout: float) -> bool:
        """Wait for its end, at most ``timeout`` [s]; returns whether it ended."""
        self._process.join(timeout)
        return self._process.exitcode is not None

    def kill(self) -> None:
        self._process.kill()
        self._process.join()


@contextmanager
def _from_the_system(name: str) -> Iterator[None]:
    try:
        yield
    except (OSError, MemoryError) as error:
        raise MissingPrerequisite(
            f"The operating system does not let the process {name} start ({error}); see that the limits of this "
            "program are not too low (ulimit -n, ulimit -u, ulimit -v)."
        ) from error


@contextmanager
def _without_main_module() -> Iterator[None]:
    """A spawned process would import the program's main module first: a script that connects would connect again.

    Our children need nothing of it; :mod:`multiprocessing` has no other way to say so.
    """
    real = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = real


def _run(main: Callable[..., None], connection: Connection, *arguments: object) -> None:
    main(PipeEnd(connection), *arguments)
    release_process()
