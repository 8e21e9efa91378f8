"""A function in a process of its own, and the pipe to it: commands down, answers and events up.

The end of either side is noticed by the other one.
"""

from __future__ import annotations

import errno
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
from multiprocessing.connection import wait
from multiprocessing.context import SpawnContext
from types import ModuleType
from typing import Any
from weakref import finalize

from abb_protocols.catalogue import message, said_by
from abb_protocols.errors import MissingPrerequisite
from abb_runtime.process.realtime import release_process

PROCESSES: SpawnContext = multiprocessing.get_context("spawn")
"""How processes are made: spawned, since a fork would copy threads and locks of ROS."""


class ChildProcess:
    """A process of our own that runs ``main(pipe, *arguments)``.

    Args:
        name: for process lists.
        main: a function of a module, so that it can be found in the child.
        arguments: picklable, or shared memory.
    """

    def __init__(self, name: str, main: Callable[..., None], *arguments: object) -> None:
        with _from_the_system(name):
            ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.pipe = PipeEnd(ours)
        self._theirs = theirs
        for each in (ours, theirs):
            finalize(self, each.close)
        self._process = PROCESSES.Process(name=name, target=_run_child, args=(main, theirs, *arguments))

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
        raise MissingPrerequisite(message("no_further_process", process=name, reason=said_by(error))) from error


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


def _run_child(main: Callable[..., None], end: socket.socket, *arguments: object) -> None:
    main(PipeEnd(end), *arguments)
    release_process()


_LENGTH, _DESCRIPTOR = struct.Struct("Q"), struct.Struct("i")
_PICKLE_PROTOCOL = 5  # whose large blocks of memory travel beside the pickle, and are not copied by it
_LONGEST_MESSAGE = 32 * 1024  # bytes; a socket carries no longer one than its buffer, whatever that is on a machine
_IN_FILE = b"\0"  # the message whose value lies in the file that comes with it
_MOST_QUEUED = 256  # values that wait for a reader; one that was stopped does not read, and further ones are dropped


class PipeClosed(Exception):
    """The other side is gone."""


class PipeEnd:
    """One end of a pipe between two processes; values must be picklable.

    A value goes as one message, whole or not at all: the number of its parts, their lengths, and the parts, which are
    its pickle and the blocks of memory that it offers as :class:`pickle.PickleBuffer`. A long one lies in a file in
    memory, whose descriptor is sent: neither side copies it through the socket, and reading takes no longer for it.
    """

    def __init__(self, end: socket.socket) -> None:
        self._socket = end
        self._room = memoryview(bytearray(_LONGEST_MESSAGE))
        self._queue: deque[list[memoryview]] = deque()  # what waits for room in the socket

    def fileno(self) -> int:
        return self._socket.fileno()

    def send(self, value: object) -> None:
        """Pass ``value`` on.

        Raises:
            PipeClosed: the reader is gone.
        """
        self._pass_on(_parts(value))

    def send_soon(self, value: object) -> bool:
        """Pass ``value`` on without ever waiting: now, if the socket has room, else with :meth:`flush`.

        Returns:
            Whether it was taken: not while too many wait already, as for a reader that was stopped.

        Raises:
            PipeClosed: the reader is gone.
        """
        if len(self._queue) >= _MOST_QUEUED:
            return False
        self._queue.append(_parts(value))
        self.flush()
        return True

    def flush(self) -> bool:
        """Pass on what waits, as far as the socket has room; returns whether nothing waits any more.

        Raises:
            PipeClosed: the reader is gone.
        """
        while self._queue:
            try:
                self._pass_on(self._queue[0], socket.MSG_DONTWAIT)
            except BlockingIOError:
                return False
            self._queue.popleft()
        return True

    def receive(self) -> Any:
        """Wait for the next value. One that cannot be read is taken away, too: the one after it is sound.

        Raises:
            PipeClosed: nothing will come any more.
        """
        try:
            length, files, _, _ = self._socket.recvmsg_into([self._room], socket.CMSG_LEN(_DESCRIPTOR.size))
        except OSError as error:
            raise PipeClosed(str(error)) from error
        if not length:
            raise PipeClosed("the other side is gone")
        data: bytes | mmap.mmap = bytes(self._room[:length])
        if data == _IN_FILE:
            if not files:
                raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))
            (file,) = _DESCRIPTOR.unpack(files[0][2])
            try:
                data = mmap.mmap(file, 0, access=mmap.ACCESS_READ)  # given back when the value is
            finally:
                os.close(file)
        return _value(memoryview(data))

    def has_value(self) -> bool:
        """Whether a value, or the end, waits."""
        return bool(wait([self._socket], 0.0))

    def close(self) -> None:
        self._socket.close()

    def _pass_on(self, parts: list[memoryview], flags: int = 0) -> None:
        if sum(part.nbytes for part in parts) <= _LONGEST_MESSAGE:
            self._send(b"".join(parts), flags)
            return
        with open(os.memfd_create("yumi-pipe"), "wb") as file:
            file.writelines(parts)
            file.flush()
            descriptor = _DESCRIPTOR.pack(file.fileno())
            self._send(_IN_FILE, flags, (socket.SOL_SOCKET, socket.SCM_RIGHTS, descriptor))

    def _send(self, message: bytes, flags: int, *files: tuple[int, int, bytes]) -> None:
        try:
            self._socket.sendmsg([message], files, flags)  # socket.send_fds takes no notice of flags
        except BlockingIOError:
            raise
        except OSError as error:
            self._queue.clear()
            raise PipeClosed(str(error)) from error


def _parts(value: object) -> list[memoryview]:
    """What is sent for ``value``."""
    blocks: list[pickle.PickleBuffer] = []
    payload = pickle.dumps(value, _PICKLE_PROTOCOL, buffer_callback=blocks.append)
    parts = [memoryview(payload), *(block.raw() for block in blocks)]
    head = b"".join(_LENGTH.pack(number) for number in (len(parts), *(part.nbytes for part in parts)))
    return [memoryview(head), *parts]


def _value(data: memoryview) -> Any:
    """What ``data`` was made of by :func:`_parts`."""
    (count,) = _LENGTH.unpack_from(data)
    begin, parts = (count + 1) * _LENGTH.size, []
    for (length,) in _LENGTH.iter_unpack(data[_LENGTH.size : begin]):
        parts.append(data[begin : begin + length])
        begin += length
    payload, *blocks = parts
    return pickle.loads(payload, buffers=blocks)
