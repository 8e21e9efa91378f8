"""A child process and the pipe to it: requests down, answers and news up, and the end of either side noticed."""

from __future__ import annotations

from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from yumi.links.realtime import release_process
from yumi.links.shared_memory import PROCESSES


class PipeClosed(Exception):
    """The other side is gone."""


class PipeEnd:
    """One end of a pipe between two processes; values must be picklable."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def fileno(self) -> int:
        return self._connection.fileno()

    def send(self, value: object) -> None:
        """Pass ``value`` on.

        Raises:
            PipeClosed: nobody is left to read it.
        """
        try:
            self._connection.send(value)
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
        ours, theirs = PROCESSES.Pipe()
        self.pipe = PipeEnd(ours)
        self._theirs = theirs
        self._process = PROCESSES.Process(name=name, target=_run, args=(main, theirs, *arguments))

    @property
    def exit_code(self) -> int | None:
        return self._process.exitcode

    def start(self) -> None:
        self._process.start()
        self._theirs.close()  # so that the pipe ends when the child does

    def join(self, timeout: float) -> bool:
        """Wait for its end, at most ``timeout`` [s]; tells whether it ended."""
        self._process.join(timeout)
        return self._process.exitcode is not None

    def kill(self) -> None:
        self._process.kill()
        self._process.join()


def _run(main: Callable[..., None], connection: Connection, *arguments: object) -> None:
    main(PipeEnd(connection), *arguments)
    release_process()
