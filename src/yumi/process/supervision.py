"""Threads and processes of a program: started, watched, and ended in order, whatever fails in them.

- :class:`SupervisedThread`: a failure of its work is logged with its traceback, and the work starts again.
- :class:`Command`: ``yumi`` as a process of its own, watched for a ready line.
- :class:`ChildProcess`: a function in a process of its own; :class:`PipeEnd`: the pipe to it, with commands down,
  answers and events up, and the end of either side noticed.
- :class:`SingleInstance`: a program that runs once; a second one learns which process does.
"""

from __future__ import annotations

import io
import logging
import mmap
import multiprocessing
import os
import pickle
import re
import socket
import stat
import struct
import subprocess
import sys
import tempfile
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnContext
from multiprocessing.reduction import ForkingPickler
from pathlib import Path
from queue import Empty, Queue
from threading import Event as Flag
from threading import Thread, current_thread
from types import ModuleType, TracebackType
from typing import Any

from yumi.catalogue import Message, message, said_by
from yumi.errors import MissingPrerequisite, RobotNotReady, SettingsError
from yumi.process.realtime import release_process

if sys.platform != "win32":
    import fcntl

log = logging.getLogger(__name__)

FIRST_PAUSE = 0.1
"""The work begins again after this time [s]; the time doubles with each failure that follows soon."""

LONGEST_PAUSE = 5.0
"""The time does not grow beyond this [s]; work that ran for longer begins with the shortest one again."""


class Failures:
    """Logs exceptions that end nothing: each kind once with its traceback, then its 10th, 100th, 1000th, … time.

    A kind is a type of exception from one line of code. Safe from any thread.
    """

    def __init__(self) -> None:
        self._counts: Counter[tuple[type[Exception], str, int]] = Counter()

    def attempt(self, what: str, call: Callable[..., object], *args: object) -> None:
        """Call something on which nothing that follows depends; ``what`` says in the log what failed."""
        try:
            call(*args)
        except Exception as error:  # whatever it is: the others must be called
            self.note(what, error)

    def note(self, what: str, error: Exception) -> bool:
        """Log that ``what`` failed with ``error``; whether that was logged, or has been too often already."""
        trace = error.__traceback__
        while trace is not None and trace.tb_next is not None:
            trace = trace.tb_next
        file, line = ("", 0) if trace is None else (trace.tb_frame.f_code.co_filename, trace.tb_lineno)
        kind = (type(error), file, line)
        self._counts[kind] += 1
        count = self._counts[kind]
        if count == 1:
            log.error("%s failed with %s: %s", what, type(error).__name__, error, exc_info=error)
        elif count == 10 ** (len(str(count)) - 1):
            log.error("%s has failed %d times with %s: %s", what, count, type(error).__name__, error)
        else:
            return False
        return True


class SupervisedThread:
    """A thread as long as the program runs: an exception ends its work, which starts again, not the thread.

    Args:
        name: of the thread, for the log.
        work: what it does; it ends the thread when it returns.
        is_over: set when the work is to end; no work begins again after that.
        on_failure: called after each failure, before the pause: marks what the work fed as stale.
    """

    def __init__(
        self, name: str, work: Callable[[], None], is_over: Flag, on_failure: Callable[[], None] = lambda: None
    ) -> None:
        self._name = name
        self._work = work
        self._is_over = is_over
        self._on_failure = on_failure
        self._failures = Failures()
        self._thread = Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Begin.

        Raises:
            MissingPrerequisite: the operating system permits no further thread.
        """
        start_thread(self._thread)

    @property
    def is_alive(self) -> bool:
        """Whether it has begun and not ended."""
        return self._thread.is_alive()

    def join(self) -> None:
        """Wait for its end; at once where it has not begun, or from the thread itself."""
        if self._thread.ident is not None and self._thread is not current_thread():
            self._thread.join()

    def _run(self) -> None:
        pause = FIRST_PAUSE
        while not self._is_over.is_set():
            begun = time.monotonic()
            try:
                self._work()
                return
            except Exception as error:  # whatever it is: the program depends on this thread
                self._failures.note(f"Thread {self._name}", error)
            try:
                self._on_failure()
            except Exception as error:
                self._failures.note(f"Thread {self._name}", error)
            if time.monotonic() - begun > LONGEST_PAUSE:
                pause = FIRST_PAUSE
            self._is_over.wait(pause)
            pause = min(2.0 * pause, LONGEST_PAUSE)


def start_thread(thread: Thread) -> None:
    """Start ``thread``.

    Raises:
        MissingPrerequisite: the operating system permits no further thread.
    """
    try:
        thread.start()
    except RuntimeError as error:
        raise MissingPrerequisite(no_thread(thread.name, error)) from error


def no_thread(name: str, error: Exception) -> Message:
    """Why a thread could not be started, and what to do."""
    return message("no_further_thread", thread=name, reason=said_by(error))


# ---- commands

CONTROLLER_READY = "Virtual controller ready: "
DRIVER_READY = "Driver ready: "
DRIVER_RUNNING = "Driver running, robot not ready: "
PAGE_READY = "Page ready: "
"""How the line begins that a command prints when it serves; the third one when the robot is not ready."""

_STOP_TIMEOUT = 20.0  # [s]
_ERROR = "Error: "  # how the line of a command begins that has failed
_POLL_PERIOD = 0.1  # [s]


class Command:
    """``yumi <arguments>`` as a child in a session of its own, so that Ctrl-C reaches its parent only.

    The child ends when its standard input does, so a parent that is killed leaves no child behind.

    Args:
        name: for sentences.
        arguments: what follows ``yumi``; every user of the machine can read them.
        log: where its output goes.
        environment: variables beside this process's own; where secrets go.
    """

    def __init__(
        self, name: str, arguments: Sequence[str], log: Path, environment: Mapping[str, str] | None = None
    ) -> None:
        self.name = name
        self.log = log
        self._environment = environment or {}
        self._arguments = [sys.executable, "-m", "yumi", *arguments, "--until-stdin-closes"]
        self._lines: Queue[str | None] = Queue()

    def __enter__(self) -> Command:
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

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
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


# ---- child processes and their pipes

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
            ours, theirs = PROCESSES.Pipe()
        self.pipe = PipeEnd(ours)
        self._theirs = theirs
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


def _run_child(main: Callable[..., None], connection: Connection, *arguments: object) -> None:
    main(PipeEnd(connection), *arguments)
    release_process()


_NUMBER = struct.Struct("!I")
_PICKLE_PROTOCOL = 5  # whose large blocks of memory travel beside the pickle, and are not copied by it
_READ_AT_ONCE = 1 << 16  # bytes; takes 20 µs
_MOST_QUEUED = 256  # values that wait for a reader; one that was stopped does not read, and further ones are dropped


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
        if len(self._queue) >= _MOST_QUEUED:
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
    ForkingPickler(payload, _PICKLE_PROTOCOL, True, blocks.append).dump(value)
    raw = [block.raw() for block in blocks]
    lengths = [len(payload.getbuffer()), *(block.nbytes for block in raw)]
    head = b"".join(_NUMBER.pack(number) for number in (len(lengths), *lengths))
    return [memoryview(head + payload.getvalue()), *raw]


# ---- what runs once

_NOT_IN_FILE_NAMES = re.compile(r"[^\w.:-]")


class SingleInstance:
    """A lock, so that a program runs once for this user on this machine; a second one learns which process has it.

    It is held from ``claim`` to ``release`` or the end of the process: a locked file in a folder that only this user
    may enter, so that no other user can take its place first. The file stays: removing it could take away the lock of
    a process that has just opened it.

    Args:
        name: what may run once.
        refusal: what is said when another process has the lock, which it is given.
    """

    def __init__(self, name: str, refusal: Callable[[Message], Message]) -> None:
        self._name = f"{_NOT_IN_FILE_NAMES.sub('_', name)}.lock"
        self._refusal = refusal
        self._file: int | None = None

    def claim(self) -> None:
        """Take the lock.

        Raises:
            RobotNotReady: another process has it, whose number the message has; or there is no folder for the lock.
        """
        if sys.platform == "win32":
            return
        folder = lock_folder()
        try:
            file = os.open(folder / self._name, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
        except OSError as error:
            raise _no_lock(folder, error.strerror) from error
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            number = os.read(file, 32).decode("ascii", "replace").strip()
            os.close(file)
            owner = message("owner_process", process=number) if number else message("owner_starting")
            raise RobotNotReady(self._refusal(owner)) from error
        os.truncate(file, 0)
        os.write(file, f"{os.getpid()}\n".encode("ascii"))
        self._file = file

    def release(self) -> None:
        """Let another process take the lock."""
        if self._file is not None:
            os.close(self._file)
            self._file = None


def lock_folder() -> Path:
    """The folder for locks: the user's own of this login, else one in the folder for temporary files.

    Raises:
        RobotNotReady: it cannot be made, or others may enter it.
    """
    for runtime in (os.environ.get("XDG_RUNTIME_DIR"), f"/run/user/{os.getuid()}"):
        if runtime and os.access(runtime, os.W_OK | os.X_OK):
            return Path(runtime)
    folder = Path(tempfile.gettempdir()) / f"yumi-{os.getuid()}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError as error:
        raise _no_lock(folder, error.strerror) from error
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o077:
        raise RobotNotReady(message("lock_folder_open_to_others", folder=str(folder)))
    return folder


def _no_lock(folder: Path, reason: str | None) -> RobotNotReady:
    return RobotNotReady(message("no_lock", folder=str(folder), reason=reason or ""))
