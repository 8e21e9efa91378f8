"""What the ROS tests work with: a virtual controller that can be killed, and a plain rclpy client."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

# A ROS domain of its own, so that nothing else on the machine hears or disturbs the tests.
os.environ["ROS_DOMAIN_ID"] = str(1 + os.getpid() % 100)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

import rclpy
from rcl_interfaces.msg import Log
from rclpy.executors import Executor, SingleThreadedExecutor
from std_srvs.srv import Trigger

from abb_runtime.process.command_process import CommandProcess
from abb_runtime.udp import free_port
from free_ports import free_tcp_port

TIMEOUT = 30.0


class Robot:
    """The virtual controller; can be killed and started again at the same address.

    Args:
        folder: for its log.
        options: of the command; its grippers are calibrated where nothing else is said.
    """

    def __init__(self, folder: Path, *options: str) -> None:
        self.rws_port = free_tcp_port()
        self.ports = {"--left-egm-port": free_port(), "--right-egm-port": free_port()}
        self._folder = folder
        self._options = options or ("--left-object", "0.02", "--calibrated")
        self._command: CommandProcess | None = None

    @property
    def egm_options(self) -> list[str]:
        return [text for name, port in self.ports.items() for text in (name, str(port))]

    def start(self) -> None:
        self.begin()
        self.wait_until_ready()

    def begin(self) -> None:
        """Start its process, and wait for nothing."""
        arguments = ["controller", "--rws-port", str(self.rws_port), *self._options, *self.egm_options]
        self.stop()
        self._command = CommandProcess(
            "virtual controller", "yumi", arguments, self._folder / "controller.log"
        ).__enter__()

    def wait_until_ready(self) -> None:
        assert self._command is not None
        self._command.wait_until_ready(TIMEOUT)

    def kill(self) -> None:
        """As a power cut."""
        assert self._command is not None
        self._command.kill()
        self._command = None

    @contextmanager
    def power_cut(self) -> Iterator[None]:
        """Without power for the time of a block; it is back for the next test, however the block ends."""
        self.kill()
        try:
            yield
        finally:
            self.start()

    def stop(self) -> None:
        if self._command is not None:
            self._command.stop()
            self._command = None


class Client:
    """A node that listens and calls; everything waits for what it waits for."""

    def __init__(self, executor: Executor | None = None) -> None:
        self.node: Any = rclpy.create_node("test_client")
        self.sentences: list[str] = []
        self._executor = executor or SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._callers: dict[str, Any] = {}
        self._own: set[Any] = set()
        self.node.create_subscription(Log, "/rosout", lambda message: self.sentences.append(message.msg), 100)

    def until(self, is_so: Callable[[], bool], timeout: float = TIMEOUT, what: str = "it") -> None:
        """Spin until ``is_so``; like :meth:`ros_clients.Spinner.until`, whose place it can take."""
        clock = self.node.get_clock()
        end = clock.now().nanoseconds + int(timeout * 1e9)
        while not is_so():
            assert clock.now().nanoseconds < end, f"{what} did not happen within {timeout} s; heard: {self.sentences}"
            self._executor.spin_once(timeout_sec=0.05)

    def call(self, kind: Any, name: str, request: Any = None, timeout: float = TIMEOUT) -> Any:
        """Call a service."""
        future = self.find(kind, name).call_async(request or kind.Request())
        self.until(future.done, timeout)
        return future.result()

    def find(self, kind: Any, name: str) -> Any:
        """Of a service that is there; kept, since finding a service again may take DDS seconds."""
        if name not in self._callers:
            self._callers[name] = self.node.create_client(kind, name)
        self.until(self._callers[name].service_is_ready)
        return self._callers[name]

    def begin(self) -> None:
        """A test begins."""
        self.sentences.clear()
        self._own = {*self.node.subscriptions, *self.node.publishers}

    def end(self) -> None:
        """A test has ended: what it listened and talked to is left."""
        for subscription in [*self.node.subscriptions]:
            if subscription not in self._own:
                self.node.destroy_subscription(subscription)
        for publisher in [*self.node.publishers]:
            if publisher not in self._own:
                self.node.destroy_publisher(publisher)

    def hears(self, part: str) -> Callable[[], bool]:
        return lambda: any(part in sentence for sentence in self.sentences)

    def close(self) -> None:
        self._executor.remove_node(self.node)
        self._executor.shutdown()
        self.node.destroy_node()


def begin_egm(client: Client) -> None:
    """Start EGM on both arms unless it runs, which is known sooner."""
    client.find(Trigger, "yumi_robot_manager/start_egm")  # so that the driver has long found who calls when it matters
    if client.call(Trigger, "yumi_robot_manager/robot_is_ready").message != "ready, EGM runs":
        answer = client.call(Trigger, "yumi_robot_manager/start_egm")
        assert answer.success, answer.message
