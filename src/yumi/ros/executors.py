"""The driver's two executors: one answers services and actions, a lean one has what comes hundreds of times a second.

A turn of the first costs milliseconds with so many entities, which nothing that streams can afford.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from threading import Event as Flag
from threading import Thread
from typing import Any

from rclpy._rclpy_pybind11 import InvalidHandle
from rclpy.executors import Executor, MultiThreadedExecutor, SingleThreadedExecutor

_THREADS = 8  # more than there are slow services and actions
_LAST_TURN = 2.0  # [s]


class Executors:
    """Both, with a thread each.

    Args:
        complain: told what a callback failed with.

    Attributes:
        answering: for services and actions.
        streaming: for topics.
    """

    def __init__(self, complain: Callable[[str], None]) -> None:
        self.answering: Executor = MultiThreadedExecutor(num_threads=_THREADS)
        self.streaming: Executor = SingleThreadedExecutor()
        self._complain = complain
        self._is_over = Flag()
        self._threads = [
            Thread(target=self._spin, args=(self.answering,), name="executor"),
            Thread(target=self._spin, args=(self.streaming,), name="streams"),
        ]

    def start(self, answering: Iterable[Any], streaming: Iterable[Any]) -> None:
        """Spin these nodes from now on."""
        for node in answering:
            self.answering.add_node(node)
        for node in streaming:
            self.streaming.add_node(node)
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Spin nothing any more."""
        self._is_over.set()
        self.answering.shutdown(timeout_sec=_LAST_TURN)
        self.streaming.shutdown(timeout_sec=_LAST_TURN)
        for thread in self._threads:
            if thread.ident is not None:
                thread.join()

    def _spin(self, executor: Executor) -> None:
        while not self._is_over.is_set():
            try:
                executor.spin_once(timeout_sec=0.1)
            except InvalidHandle:
                continue  # a controller's node went while the executor looked for work
            except Exception as error:  # of a callback; everybody else still wants to be answered
                self._complain(f"A callback failed with {type(error).__name__}: {error}.")
