"""The driver's executors: one for what streams, and one for each family of nodes that answers.

A turn of an executor looks at every entity of all its nodes, several times for each request; with the whole driver in
one that takes ten milliseconds, during which no other thread gets on.

A ticker: what is published at fixed rates is published by one thread.

A timer of a node costs a turn of the executor each time, in which every subscription and service of all its nodes is
looked at; that is many times as much as what most timers do.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import inf
from threading import Event as Flag
from threading import RLock
from typing import Any

from rclpy._rclpy_pybind11 import InvalidHandle
from rclpy.executors import Executor, MultiThreadedExecutor, SingleThreadedExecutor

from yumi.clock import Clock
from yumi.errors import MissingPrerequisite
from yumi.process.supervision import Failures, SupervisedThread, no_thread

_THREADS = 8  # so many slow callbacks of a family run side by side
_BREATH = 0.01  # [s]
_GLANCE = 0.5  # [s] how soon a failed callback is told


class _AnsweringExecutor(MultiThreadedExecutor):  # type: ignore[misc]  # rclpy has no types
    """One that soon tells of a failed callback; rclpy's own looks when the next callback comes, however late."""

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


class Executors:
    """Some executors, with a thread each between start and stop.

    Args:
        complain: told what a callback failed with.
    """

    def __init__(self, complain: Callable[[str], None]) -> None:
        self._complain = complain
        self._is_over = Flag()
        self._executors: list[Executor] = []
        self._threads: list[SupervisedThread] = []
        self._failures = Failures()

    def add_answering(self, name: str, *nodes: Any) -> Executor:
        """Add one for services and actions, which may take their time."""
        return self._add(_AnsweringExecutor(num_threads=_THREADS), name, nodes)

    def add_streaming(self, name: str, *nodes: Any) -> Executor:
        """Add one for topics that come hundreds of times a second."""
        return self._add(SingleThreadedExecutor(), name, nodes)

    def start(self) -> None:
        """Spin all from now on.

        Raises:
            MissingPrerequisite: the operating system permits too few threads.
        """
        for executor in self._executors:
            if isinstance(executor, _AnsweringExecutor):
                executor.start_threads()
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Begin no callback any more; one that runs is not waited for."""
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
                executor.spin_once(timeout_sec=_GLANCE)
            except InvalidHandle:
                continue  # a controller's node went while the executor looked for work
            except Exception as error:  # of a callback; everybody else still wants to be answered
                if self._is_over.is_set():
                    return  # the executor was taken away while it looked for work
                if self._failures.note("A callback", error):
                    self._complain(f"A callback failed with {type(error).__name__}: {error}.")
                self._is_over.wait(_BREATH)  # should nothing but failures come


Action = Callable[[], None]

_TICKER_BREATH = 0.001  # [s] even a thread that is behind lets others in between


@dataclass(eq=False, slots=True)
class _Repeated:
    what: str
    action: Action
    period: float
    due: float
    is_failing: bool = False


class Ticker:
    """Calls actions at fixed periods, one after the other, between start and stop.

    What comes late is not made up for, and what fails is called again.

    Args:
        clock: what the periods are measured on.
        complain: told what an action fails with, once until it succeeds.
        name: of the thread.
    """

    def __init__(self, clock: Clock, complain: Callable[[str], None], name: str = "ticker") -> None:
        self._clock = clock
        self._complain = complain
        self._repeated: list[_Repeated] = []
        self._lock = RLock()
        self._bell, self._is_over = Flag(), Flag()
        self._failures = Failures()
        self._thread = SupervisedThread(name, self._run, self._is_over)

    def every(self, period: float, what: str, action: Action) -> Callable[[], None]:
        """Call ``action``, which publishes ``what``, once each ``period`` [s].

        Returns:
            What ends that; no call goes on after it, but for one that ends itself.
        """
        repeated = _Repeated(what, action, period, self._clock.now() + period)
        with self._lock:
            self._repeated.append(repeated)
        self._bell.set()

        def end() -> None:
            with self._lock:
                if repeated in self._repeated:
                    self._repeated.remove(repeated)

        return end

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """Call nothing any more; before what is called loses what it needs."""
        self._is_over.set()
        self._bell.set()
        self._thread.join()

    def tick(self) -> float:
        """Call what is due; returns how long nothing will be [s]. The thread does that once it has started."""
        now = self._clock.now()
        for each in tuple(self._repeated):
            if each.due <= now:
                each.due = each.due + each.period if now < each.due + each.period else now + each.period
                self._call(each)
        return min((each.due for each in self._repeated), default=inf) - self._clock.now()

    def _run(self) -> None:
        while not self._is_over.is_set():
            self._bell.clear()
            with self._lock:
                pause = self.tick()
            self._bell.wait(max(_TICKER_BREATH, pause) if pause < inf else None)

    def _call(self, each: _Repeated) -> None:
        try:
            each.action()
            each.is_failing = False
        except Exception as error:  # the others still have to be published
            self._failures.note(f"Publishing {each.what}", error)
            if not each.is_failing:
                each.is_failing = True
                self._complain(f"{each.what} could not be published, {type(error).__name__}: {error}.")
