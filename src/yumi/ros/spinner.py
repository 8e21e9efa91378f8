"""An application's node, and waiting in it: the node is spun by who waits, and by nobody else."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from yumi.clock import SystemClock
from yumi.errors import RobotNotReady

_SPIN = 0.05  # [s]


class Spinner:
    """Spins one node until something has happened; everything an application waits for goes through here.

    Args:
        node: the application's node.
        check: called again and again while waiting; raises when waiting has become useless.
    """

    def __init__(self, node: Any, check: Callable[[], None] = lambda: None) -> None:
        self.node = node
        self._check = check
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(node)

    def close(self) -> None:
        """Let go of the node, so that another spinner may have it."""
        self._executor.remove_node(self.node)
        self._executor.shutdown()

    def until(self, is_so: Callable[[], bool], timeout: float, what: str) -> None:
        """Spin until ``is_so``.

        Raises:
            RobotNotReady: it did not become so within ``timeout`` [s].
            Exception: whatever the check raises.
        """
        clock = SystemClock()  # not the node's, which somebody may set meanwhile
        end = clock.now() + timeout
        while not is_so():
            self._check()
            if clock.now() > end:
                raise RobotNotReady(f"{what} did not happen within {timeout:g} s.")
            self._executor.spin_once(timeout_sec=_SPIN)


@contextmanager
def application(name: str) -> Iterator[Spinner]:
    """ROS with one node, for a program that has nothing else; it ends with the block.

    ::

        with application("grip") as spinner:
            GripperClient(spinner, Side.LEFT).move_to(0.01)

    Ctrl-C stays Python's KeyboardInterrupt, so that the program can end its motion with ROS before it goes.

    Args:
        name: the node's.
    """
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = rclpy.create_node(name)
        spinner = Spinner(node)
        try:
            yield spinner
        finally:
            spinner.close()
            node.destroy_node()
    finally:
        rclpy.try_shutdown()
