"""A driver whose network hangs ends all the same when it is asked to, and says what it could not do."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from time import monotonic

import pytest
from rclpy.action import ActionClient
from ros_bench import TIMEOUT, Client, Robot, begin_egm
from std_srvs.srv import Trigger
from yumi_interfaces.action import Recover
from yumi_interfaces.msg import RobotState

from hostile_server import HostileServer, dripping, hostile_before
from yumi.process.supervision import Command

# A machine that stands still for a second makes the end of a driver late by as much.
pytestmark = [pytest.mark.ros, pytest.mark.real_time, pytest.mark.timeout(120)]

ENDED = 5.0
RECOVERED = 10.0
UNKNOWN = 10.0  # as docs/reference/recovery.md says
DRIP = dripping(b"HTTP/1.1 200 OK\r\nX-Drop: ")


class Driven:
    """A driver with EGM on both arms, and a proxy between it and its controller."""

    def __init__(self, folder: Path, robot: Robot, server: HostileServer) -> None:
        self.server = server
        port = server.address.rpartition(":")[2]
        arguments = ["up", "--robot", f"127.0.0.1:{port}", *robot.egm_options]
        self.driver = Command("driver", arguments, folder / "driver.log").__enter__()
        self.driver.wait_until_ready(2 * TIMEOUT)
        self.client = Client()

    def seconds_to_end(self, number: signal.Signals) -> float:
        """From the signal to the end of the process."""
        begin = monotonic()
        os.kill(self.driver.pid, number)
        self.client.until(lambda: self.driver.exit_code is not None, TIMEOUT, "the end of the driver")
        return monotonic() - begin

    def close(self) -> None:
        self.client.close()
        if self.driver.exit_code is None:
            self.driver.kill()
        else:
            self.driver.stop()


@pytest.fixture
def driven(ros: None, tmp_path: Path) -> Iterator[Driven]:
    robot = Robot(tmp_path)  # its own: a driver that cannot log out leaves its subscriptions with the controller
    robot.start()
    with hostile_before(f"127.0.0.1:{robot.rws_port}") as server:
        driven = Driven(tmp_path, robot, server)
        yield driven
        driven.close()
    robot.stop()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_driver_before_a_controller_that_drips_ends_within_5_s(driven: Driven, number: signal.Signals) -> None:
    begin_egm(driven.client)
    driven.server.attack = DRIP
    driven.client.until(lambda: driven.server.attacked > 0)
    assert driven.seconds_to_end(number) < ENDED
    assert "EGM could not be ended on the robot" in driven.driver.log.read_text()
    assert "Traceback" not in driven.driver.log.read_text()


def test_driver_with_a_sane_controller_ends_egm_and_itself_within_5_s(driven: Driven) -> None:
    begin_egm(driven.client)
    assert driven.seconds_to_end(signal.SIGINT) < ENDED
    assert driven.driver.exit_code == 0
    assert "could not be ended" not in driven.driver.log.read_text()
    assert "stop EGM" in driven.driver.log.read_text()


def test_recover_before_a_controller_that_drips_answers_within_10_s_and_works_again_after(driven: Driven) -> None:
    client = driven.client
    states: list[RobotState] = []
    client.node.create_subscription(RobotState, "yumi_robot_manager/state", states.append, 10)
    action = ActionClient(client.node, Recover, "yumi_robot_manager/recover")
    client.until(action.server_is_ready)

    def recover() -> tuple[bool, str, float]:
        begin = monotonic()
        sending = action.send_goal_async(Recover.Goal())
        client.until(sending.done)
        result = sending.result().get_result_async()
        client.until(result.done)
        return result.result().result.success, result.result().result.message, monotonic() - begin

    driven.server.attack = DRIP
    client.until(lambda: bool(states) and not states[-1].is_connected, UNKNOWN, "a state that is unknown")
    is_done, sentence, seconds = recover()
    assert not is_done
    assert "The web service of the controller hangs" in sentence
    assert seconds < RECOVERED
    driven.server.attack = None
    is_done, sentence, seconds = recover()
    assert is_done, sentence
    assert seconds < RECOVERED
    assert client.call(Trigger, "yumi_robot_manager/robot_is_ready").message == "ready"
    driven.server.attack = DRIP
    attacked = driven.server.attacked
    action.send_goal_async(Recover.Goal())
    client.until(lambda: driven.server.attacked > attacked)
    assert driven.seconds_to_end(signal.SIGINT) < ENDED
    action.destroy()
