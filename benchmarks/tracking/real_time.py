"""The streamed reference in real time: from a ROS 2 node through the driver and over the wire to a virtual controller.

Three processes besides this one, as a user has them: ``yumi controller``, ``yumi up`` and its fast line.
"""

from __future__ import annotations

import gc
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

import rclpy
from builtin_interfaces.msg import Time
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from yumi.driver.settings import config_folder
from yumi.egm.udp import free_port
from yumi.process.child import Command
from yumi_evaluation.experiment import JOINT, Reference, Run, Sample

PERIOD = 0.002
"""Of the stream: 500 Hz [s]."""

_TIMEOUT = 30.0  # [s]


def stream_over_ros(reference: Reference, duration: float) -> Run:
    """Have the virtual controller's left arm follow ``reference`` on one joint for ``duration`` [s]."""
    with TemporaryDirectory() as folder, _driver(Path(folder)), _node() as (node, executor):
        return _Streamer(node, executor).run(reference, duration)


class _Streamer:
    """Sends goals and listens to joint states."""

    def __init__(self, node: Any, executor: Any) -> None:
        self._node = node
        self._executor = executor
        self._heard: list[Any] = []
        self._goals = node.create_publisher(JointState, "l/joint_commands", 10)
        node.create_subscription(JointState, "l/joint_states", self._heard.append, 1000)

    def run(self, reference: Reference, duration: float) -> Run:
        self._call("yumi_robot_manager/start_egm")
        self._until(lambda: bool(self._heard) and self._goals.get_subscription_count() > 0)
        names, start = list(self._heard[-1].name), list(self._heard[-1].position)
        self._heard.clear()
        gc.disable()  # a pause of this collector is nothing that the driver could do anything about
        begin = due = time.time()
        while due < begin + duration:
            self._executor.spin_once(timeout_sec=max(0.0, due - time.time()))
            now = time.time()
            if now >= due:
                way = reference(now - begin)
                position = [value + way * (index == JOINT) for index, value in enumerate(start)]
                goal = JointState(name=names, position=position)
                goal.header.stamp = Time(sec=int(now), nanosec=int(now % 1.0 * 1e9))
                self._goals.publish(goal)
                due += PERIOD
        gc.enable()
        self._call("yumi_robot_manager/stop_egm")
        return Run(reference, tuple(self._samples(reference, begin, duration, start[JOINT])), 0)

    def _samples(self, reference: Reference, begin: float, duration: float, start: float) -> Iterator[Sample]:
        for message in self._heard:
            now = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec - begin
            if 0.0 <= now < duration:
                yield Sample(now, reference(now), message.position[JOINT] - start, message.velocity[JOINT])

    def _call(self, name: str) -> None:
        client = self._node.create_client(Trigger, name)
        self._until(client.service_is_ready)
        future = client.call_async(Trigger.Request())
        self._until(future.done)
        answer = future.result()
        assert answer.success, answer.message

    def _until(self, is_so: Callable[[], bool]) -> None:
        end = time.monotonic() + _TIMEOUT
        while not is_so():
            assert time.monotonic() < end, f"nothing happened within {_TIMEOUT:g} s"
            self._executor.spin_once(timeout_sec=0.05)


@contextmanager
def _node() -> Iterator[tuple[Any, Any]]:
    rclpy.init()
    node, executor = rclpy.create_node("streamed_reference"), SingleThreadedExecutor()
    executor.add_node(node)
    try:
        yield node, executor
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.shutdown()


@contextmanager
def _driver(folder: Path) -> Iterator[None]:
    """A virtual controller, and a driver whose position controllers feed forward."""
    text = (config_folder() / "controllers.yaml").read_text(encoding="utf-8")
    controllers = folder / "controllers.yaml"
    controllers.write_text(text.replace("feed_forward: false", "feed_forward: true"), encoding="utf-8")
    rws, left, right = free_port(), free_port(), free_port()
    ports = ["--left-egm-port", str(left), "--right-egm-port", str(right)]
    robot = ["controller", "--rws-port", str(rws), *ports]
    driver = ["up", "--robot", "127.0.0.1", "--rws-port", str(rws), *ports, "--controllers", str(controllers)]
    with Command("virtual controller", robot, folder / "controller.log") as controller:
        controller.wait_until_ready(_TIMEOUT)
        with Command("driver", driver, folder / "driver.log") as command:
            command.wait_until_ready(_TIMEOUT)
            yield
