"""A virtual controller and the driver as processes of their own, and a plain rclpy client beside them, for all tests.

Each of them takes seconds to start, and to find the others; a test leaves them as it found them, but for EGM, which it
may find running or not: ``egm_running`` and ``idle`` see to that.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from robot_manager_bench import RobotManagerRig
from ros_bench import TIMEOUT, Client, Robot, rclpy
from std_srvs.srv import Trigger

from abb_runtime.process.command_process import CommandProcess

HERE = Path(__file__).parent


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files whose tests share the driver come last: it has the names of the nodes that others make themselves.

    Before them come those that have a driver of their own, since two would refuse each other. A file stays whole, since
    ``make test-real-time`` gives files to its workers in the order of their first tests.
    """
    places: dict[Path, int] = {}
    for item in items:
        places[item.path] = max(places.get(item.path, 0), _place(item))
    items.sort(key=lambda item: places[item.path])


def _place(item: pytest.Item) -> int:
    names = getattr(item, "fixturenames", ())
    if HERE not in item.path.parents or "robot" not in names:
        return 0
    has_own = "driver" in vars(getattr(item, "module", object))
    return 1 if has_own or "driver" not in names else 2


@pytest.fixture(scope="session")
def ros() -> Iterator[None]:
    rclpy.init()
    yield
    rclpy.shutdown()


@pytest.fixture(scope="session")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot]:
    robot = Robot(tmp_path_factory.mktemp("robot"))
    robot.start()
    yield robot
    robot.stop()


@pytest.fixture(scope="session")
def driver(ros: None, robot: Robot, tmp_path_factory: pytest.TempPathFactory) -> Iterator[CommandProcess]:
    log = tmp_path_factory.mktemp("driver") / "driver.log"
    arguments = ["up", "--robot", f"127.0.0.1:{robot.rws_port}", *robot.egm_options]
    with CommandProcess("driver", "yumi", arguments, log) as command:
        command.wait_until_ready(2 * TIMEOUT)  # three processes start, each with all of Python's modules to read
        yield command


@pytest.fixture(scope="session")
def found(driver: CommandProcess) -> Iterator[Client]:
    """A client that finds the driver's services once."""
    client = Client()
    yield client
    client.close()


@pytest.fixture
def client(found: Client) -> Iterator[Client]:
    """It has heard nothing yet, and hears nothing any more afterwards."""
    found.begin()
    yield found
    found.end()


@pytest.fixture
def idle(client: Client) -> Client:
    """With no EGM running."""
    client.call(Trigger, "yumi_robot_manager/stop_egm")
    return client


@pytest.fixture
def egm_running(client: Client) -> Client:
    """With EGM running on both arms, and something that commands them."""
    answer = client.call(Trigger, "yumi_robot_manager/start_egm")
    assert answer.success, answer.message
    return client


@pytest.fixture(scope="module")
def whole_rig(ros: None) -> Iterator[RobotManagerRig]:
    rig = RobotManagerRig()
    yield rig
    rig.close()


@pytest.fixture
def rig(whole_rig: RobotManagerRig) -> RobotManagerRig:
    """The robot manager's ROS side in this process, on a manager that remembers what it is asked."""
    whole_rig.begin()
    return whole_rig
