"""What runs the driver's callbacks: executors, a thread each, and threads for what is published at fixed rates.

A turn of an executor looks at every entity of all its nodes, several times for each request. With the whole driver in
one executor a turn takes ten milliseconds, during which no other thread runs; so each family of nodes has its own. A
node's timer costs such a turn, too, many times as much as what most timers do; so periodic work has a
:class:`TimerThread`, which also goes on while a service call waits.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import inf
from typing import Any

from rclpy._rclpy_pybind11 import InvalidHandle
from rclpy.executors import Executor, MultiThreadedExecutor, SingleThreadedExecutor

from yumi.clock import Clock
from yumi.errors import MissingPrerequisite
from yumi.process.supervision import Failures, SupervisedThread, no_thread

_THREADS = 8  # so many slow callbacks of a family run side by side
_POLL = 0.5  # [s] how soon a failed callback is logged
_FAILURE_PAUSE = 0.01  # [s]
_LEAST_PAUSE = 0.001  # [s] a timer thread that is behind lets others run


class _MultiThreadedExecutor(MultiThreadedExecutor):  # type: ignore[misc]  # rclpy has no types
    """Reports a failed callback soon; rclpy's own looks when the next callback comes, however late."""

    def spin_once(self, timeout_sec: float | None = None) -> None:
        super().spin_once(timeout_sec)
        for future in [each for each in self._futures if each.done()]:
            self._futures.remove(future)
            future.result()  # raises what the callback raised

    def start_threads(self) -> None:
        """Start the pool's threads now; rclpy starts one whenever callbacks meet, and the driver would grow for hours.

        Raises:
            MissingPrerequisite: the operating system permits none; fewer than all are enough.
        """
        try:
            self._executor.submit(lambda: None).result()
        except RuntimeError as error:
            raise MissingPrerequisite(no_thread("ROS 2's services", error)) from error
        together = threading.Barrier(_THREADS)
        try:
            for _ in range(_THREADS):
                self._executor.submit(together.wait)
        except RuntimeError:  # the operating system permits fewer: so many callbacks run side by side
            together.abort()

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        is_done = bool(super().shutdown(timeout_sec))
        self._executor.shutdown(wait=False)  # the pool's threads end, which rclpy leaves to the garbage collector
        return is_done


_CANCELLING = 1.0  # [s]


def is_cancelled(handle: Any, clock: Clock) -> bool:
    """Whether the client of an action's goal has cancelled it, for a goal whose cancel callback was called.

    rclpy sets the flag, without which no goal can end as cancelled, only after that callback; what the callback has
    stopped may have ended by then.
    """
    end = clock.now() + _CANCELLING
    while not handle.is_cancel_requested and clock.now() < end:
        clock.wait(0.001)
    return bool(handle.is_cancel_requested)


class Executors:
    """Some executors, with a thread each between start and stop; ``log_error`` gets what a callback failed with."""

    def __init__(self, log_error: Callable[[str], None]) -> None:
        self._log_error = log_error
        self._is_over = threading.Event()
        self._executors: list[Executor] = []
        self._threads: list[SupervisedThread] = []
        self._failures = Failures()

    def add_multi_threaded(self, name: str, *nodes: Any) -> Executor:
        """Add one for services and actions, which may take their time."""
        return self._add(_MultiThreadedExecutor(num_threads=_THREADS), name, nodes)

    def add_single_threaded(self, name: str, *nodes: Any) -> Executor:
        """Add one for topics that come hundreds of times a second."""
        return self._add(SingleThreadedExecutor(), name, nodes)

    def start(self) -> None:
        """Spin all from now on.

        Raises:
            MissingPrerequisite: the operating system permits too few threads.
        """
        for executor in self._executors:
            if isinstance(executor, _MultiThreadedExecutor):
                executor.start_threads()
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Begin no further callback; one that runs is not waited for."""
        self._is_over.set()
        for executor in self._executors:
            executor.shutdown()
        for thread in self._threads:
            thread.join()

    def _add(self, executor: Executor, name: str, nodes: tuple[Any, ...]) -> Executor:
        for node in nodes:
            executor.add_node(node)
        self._executors.append(executor)
        self._threads.append(SupervisedThread(name, partial(self._spin, executor), self._is_over))
        return executor

    def _spin(self, executor: Executor) -> None:
        while not self._is_over.is_set():
            try:
                executor.spin_once(timeout_sec=_POLL)
            except InvalidHandle:
                continue  # a controller's node was destroyed while the executor looked for work
            except Exception as error:  # of one callback; the others must still be served
                if self._is_over.is_set():
                    return  # the executor was shut down while it looked for work
                if self._failures.note("A callback", error):
                    self._log_error(f"A callback failed with {type(error).__name__}: {error}.")
                self._is_over.wait(_FAILURE_PAUSE)


@dataclass(eq=False, slots=True)
class _Timer:
    what: str
    action: Callable[[], None]
    period: float
    due: float
    is_failing: bool = False


class TimerThread:
    """Calls actions at fixed periods, one after the other, between start and stop.

    A late call is not made up for; an action that failed is called again at its next time.

    Args:
        clock: what the periods are measured on.
        log_error: called with what an action fails with, once until it succeeds.
        name: of the thread.
    """

    def __init__(self, clock: Clock, log_error: Callable[[str], None], name: str = "timers") -> None:
        self._clock = clock
        self._log_error = log_error
        self._timers: list[_Timer] = []
        self._lock = threading.RLock()
        self._has_changed, self._is_over = threading.Event(), threading.Event()
        self._failures = Failures()
        self._thread = SupervisedThread(name, self._run, self._is_over)

    def every(self, period: float, what: str, action: Callable[[], None]) -> Callable[[], None]:
        """Call ``action``, which publishes ``what``, once each ``period`` [s].

        Returns:
            What ends that; no call goes on after it, except one that ends itself.
        """
        timer = _Timer(what, action, period, self._clock.now() + period)
        with self._lock:
            self._timers.append(timer)
        self._has_changed.set()

        def end() -> None:
            with self._lock:
                if timer in self._timers:
                    self._timers.remove(timer)

        return end

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """Call nothing any more; before the actions lose what they need."""
        self._is_over.set()
        self._has_changed.set()
        self._thread.join()

    def tick(self) -> float:
        """Call what is due; returns the time until the next call [s]. The thread does that once it has started."""
        now = self._clock.now()
        for timer in tuple(self._timers):
            if timer.due > now:
                continue
            timer.due = timer.due + timer.period if now < timer.due + timer.period else now + timer.period
            try:
                timer.action()
                timer.is_failing = False
            except Exception as error:  # the others still have to be published
                self._failures.note(f"Publishing {timer.what}", error)
                if not timer.is_failing:
                    timer.is_failing = True
                    self._log_error(f"{timer.what} could not be published, {type(error).__name__}: {error}.")
        return min((timer.due for timer in self._timers), default=inf) - self._clock.now()

    def _run(self) -> None:
        while not self._is_over.is_set():
            self._has_changed.clear()
            with self._lock:
                pause = self.tick()
            self._has_changed.wait(max(_LEAST_PAUSE, pause) if pause < inf else None)
