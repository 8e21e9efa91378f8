"""A command line of ours as a process of its own, watched for a ready line, and ended in order."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from queue import Empty, Queue
from threading import Thread

from abb_protocols.catalogue import message
from abb_protocols.errors import RobotNotReady, SettingsError

CONTROLLER_READY = "Virtual controller ready: "
DRIVER_READY = "Driver ready: "
DRIVER_RUNNING = "Driver running, robot not ready: "
PAGE_READY = "Page ready: "
"""How the line begins that a command prints when it serves; the third one when the robot is not ready."""

_STOP_TIMEOUT = 20.0  # [s]
_ERROR = "Error: "  # how the line of a command begins that has failed
_POLL_PERIOD = 0.1  # [s]


class CommandProcess:
    """``python -m <module> <arguments>`` as a child in a session of its own, so that Ctrl-C reaches its parent only.

    The child ends when its standard input does, so a parent that is killed leaves no child behind.

    Args:
        name: for sentences.
        module: the command line, such as ``yumi``.
        arguments: what follows the module; every user of the machine can read them.
        log: where its output goes.
        environment: variables beside this process's own; where secrets go.
    """

    def __init__(
        self,
        name: str,
        module: str,
        arguments: Sequence[str],
        log: Path,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        self.name = name
        self.log = log
        self._environment = environment or {}
        self._arguments = [sys.executable, "-m", module, *arguments, "--until-stdin-closes"]
        self._lines: Queue[str | None] = Queue()

    def __enter__(self) -> CommandProcess:
        try:
            self._log_file = self.log.open("wb", buffering=0)
        except OSError as error:
            raise SettingsError(
                message("output_not_writable", program=self.name, file=str(self.log), reason=error.strerror)
            ) from error
        self._process = subprocess.Popen(
            self._arguments,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
            env={**os.environ, **self._environment},
        )
        # A daemon: a child that was never stopped must not keep its parent from ending.
        self._reader = Thread(target=self._read, name=f"{self.name}-output", daemon=True)
        self._reader.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def exit_code(self) -> int | None:
        """None while it runs."""
        return self._process.poll()

    @property
    def pid(self) -> int:
        """Number of its process."""
        return self._process.pid

    def wait_until_ready(
        self,
        timeout: float,
        check: Callable[[], None] = lambda: None,
        on_line: Callable[[str], None] = lambda line: None,
    ) -> str:
        """Wait for its ready line; returns what follows the first words.

        Args:
            timeout: longest wait [s].
            check: called again and again; raises when waiting has become useless.
            on_line: given each line that comes before, but for its error, which is raised.

        Raises:
            RobotNotReady: it ended or did not become ready in time; the message is its error, else its last line.
        """
        last, error, polls = "", "", int(timeout / _POLL_PERIOD)
        while polls > 0:
            check()
            try:
                line = self._lines.get(timeout=_POLL_PERIOD)
            except Empty:
                polls -= 1
                continue
            if line is None:
                raise RobotNotReady(error or last or message("exited_silently", program=self.name, log=str(self.log)))
            for ready in (CONTROLLER_READY, DRIVER_READY, DRIVER_RUNNING, PAGE_READY):
                if line.startswith(ready):
                    return line.removeprefix(ready).strip()
            if line.startswith(_ERROR):
                error = line.removeprefix(_ERROR)
                continue
            on_line(line)
            last = line or last
        raise RobotNotReady(message("program_not_ready_in_time", program=self.name, timeout=timeout, log=str(self.log)))

    def stop(self) -> None:
        """End it in order; it stops motion and ends EGM by itself."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            self._process.wait(_STOP_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join()

    def kill(self) -> None:
        """End it at once, as a power cut would."""
        self._process.kill()
        self.stop()

    def _read(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as output:
            for line in output:
                self._lines.put(line.rstrip())
                with suppress(OSError):  # a full disk; a child whose output is not read would stand still
                    self._log_file.write(line.encode("utf-8"))
        self._lines.put(None)
        self._log_file.close()
