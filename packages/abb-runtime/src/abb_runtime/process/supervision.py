"""Threads of a program, supervised: what fails in them is logged, and their work starts again."""

from __future__ import annotations

import logging
import time
from collections import Counter
from collections.abc import Callable
from threading import Event as Flag
from threading import Thread, current_thread

from abb_protocols.catalogue import Message, message, said_by
from abb_protocols.errors import MissingPrerequisite

_log = logging.getLogger(__name__)

FIRST_RESTART_PAUSE = 0.1
"""The work begins again after this time [s]; the time doubles with each failure that follows soon."""

LONGEST_RESTART_PAUSE = 5.0
"""The time does not grow beyond this [s]; work that ran for longer begins with the shortest one again."""


class ThreadFailures:
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
            _log.error("%s failed with %s: %s", what, type(error).__name__, error, exc_info=error)
        elif count == 10 ** (len(str(count)) - 1):
            _log.error("%s has failed %d times with %s: %s", what, count, type(error).__name__, error)
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
        self._failures = ThreadFailures()
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
        pause = FIRST_RESTART_PAUSE
        while not self._is_over.is_set():
            begun = time.monotonic()
            try:
                self._work()
                return
            except Exception as error:  # whatever it is: the program depends on this thread
                self._failures.note(f"Thread {self._name}", error)
            self._failures.attempt(f"Thread {self._name}", self._on_failure)
            if time.monotonic() - begun > LONGEST_RESTART_PAUSE:
                pause = FIRST_RESTART_PAUSE
            self._is_over.wait(pause)
            pause = min(2.0 * pause, LONGEST_RESTART_PAUSE)


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
