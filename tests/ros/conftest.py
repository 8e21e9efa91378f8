"""A virtual controller and the driver as processes of their own, and a plain rclpy client beside them."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from ros_bench import TIMEOUT, Client, Robot, rclpy

from yumi.links.command import Command


@pytest.fixture(scope="module")
def ros() -> Iterator[None]:
    rclpy.init()
    yield
    rclpy.shutdown()


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot]:
    robot = Robot(tmp_path_factory.mktemp("robot"))
    robot.start()
    yield robot
    robot.stop()


@pytest.fixture(scope="module")
def driver(ros: None, robot: Robot, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Command]:
    log = tmp_path_factory.mktemp("driver") / "driver.log"
    arguments = ["up", "--robot", "127.0.0.1", "--rws-port", str(robot.rws_port), *robot.egm_options]
    with Command("driver", arguments, log) as command:
        command.wait_until_ready(2 * TIMEOUT)  # three processes start, each with all of Python's modules to read
        yield command


@pytest.fixture
def client(driver: Command) -> Iterator[Client]:
    client = Client()
    yield client
    client.close()
