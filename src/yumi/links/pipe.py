"""A child process and the pipe to it: requests down, answers and news up, and the end of either side noticed."""

from __future__ import annotations

import os
import struct
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from multiprocessing.reduction import ForkingPickler
from types import ModuleType
from typing import Any

from yumi.errors import MissingPrerequisite
from yumi.links.realtime import release_process
from yumi.links.shared_memory import PROCESSES

_LENGTH = struct.Struct("!i")  # what a Connection expects before each value


class PipeClosed(Exception):
    """The other side is gone."""


class PipeEnd:
    """One end of a pipe between two processes; values must be picklable."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def fileno(self) -> int:
        return self._connection.fileno()

    def send(self, value: object) -> None:
        """Pass ``value`` on, at one go.

        A :class:`Connection` would write the length of what is long first, and give the interpreter away before the
        rest: who reads would wait for it in between.

        Raises:
            PipeClosed: nobody is left to read it.
        """
        payload = ForkingPickler.dumps(value)
        data = memoryview(_LENGTH.pack(len(payload)) + bytes(payload))
        try:
            while data:
                data = data[os.write(self.fileno(), data) :]
        except OSError as error:
            raise PipeClosed(str(error)) from error

    def receive(self) -> Any:
        """Wait for the next value.

        Raises:
            PipeClosed: nothing will come any more.
        """
        try:
            return self._connection.recv()
        except (EOFError, OSError) as error:
            raise PipeClosed(str(error)) from error

    def has_value(self, timeout: float = 0.0) -> bool:
        """Whether a value, or the end, waits; looks for at most ``timeout`` [s]."""
        return self._connection.poll(timeout)

    def close(self) -> None:
        self._connection.close()


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
        """Wait for its end, at most ``timeout`` [s]; tells whether it ended."""
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
