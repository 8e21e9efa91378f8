"""Work in the background: what takes longer than a cycle is done in a thread of its own, one job after another."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from queue import Queue
from threading import Thread
from typing import TypeVar

_T = TypeVar("_T")


class Background:
    """Does long work in a thread of its own, one piece after another, while the robot goes on."""

    def __init__(self, name: str = "background") -> None:
        self._work: Queue[Callable[[], None] | None] = Queue()
        # A daemon, since parsing a long module takes seconds, and the process must end before.
        self._thread = Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """Do nothing more; what is under way goes on."""
        self._work.put(None)

    def submit(self, work: Callable[[], _T]) -> Future[_T]:
        """What ``work`` will have returned or raised."""
        result: Future[_T] = Future()
        self._work.put(partial(_run_for, work, result))
        return result

    def _run(self) -> None:
        while (work := self._work.get()) is not None:
            work()
            del work  # a thread that waits holds nothing: what it held would be freed after the libraries it came from


def _run_for(work: Callable[[], _T], result: Future[_T]) -> None:
    if not result.set_running_or_notify_cancel():  # the client is gone
        return
    try:
        result.set_result(work())
    except Exception as error:  # raised where the result is awaited
        result.set_exception(error)
    finally:
        del work, result  # the error's traceback leads here, and from here a result would lead back to it
