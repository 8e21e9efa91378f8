"""A driver on a robot that nobody has brought up: what it says first, what it leaves alone, and how it ends.

Where its network hangs it ends all the same when it is asked to, and says what it could not do.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from time import monotonic

import pytest
from rclpy.action import ActionClient
from ros_bench import TIMEOUT, Client, Robot, begin_egm
from ros_clients import ArmClient
from std_srvs.srv import Trigger
from yumi_interfaces.action import Recover
from yumi_interfaces.msg import RobotState

from abb_protocols.robot.joints import Side, joints
from abb_protocols.rws.values import ControllerState, ExecutionState
from abb_runtime.process.command_process import CommandProcess
from abb_runtime.rws.client import RwsClient
from hostile_server import HostileServer, dripping, hostile_before

# A machine that stands still for a second makes the end of a driver late by as much.
pytestmark = [pytest.mark.ros, pytest.mark.real_time, pytest.mark.alone, pytest.mark.timeout(120)]

ENDED = 5.0
RECOVERED = 10.0
UNKNOWN = 10.0  # as docs/reference/recovery.md says
DRIP = dripping(b"HTTP/1.1 200 OK\r\nX-Drop: ")


class Driven:
    """A driver, and a proxy between it and its controller."""

    def __init__(self, folder: Path, robot: Robot, server: HostileServer, *options: str) -> None:
        self.server = server
        port = server.address.rpartition(":")[2]
        arguments = ["up", "--robot", f"127.0.0.1:{port}", *robot.egm_options, *options]
        self.driver = CommandProcess("driver", "yumi", arguments, folder / "driver.log").__enter__()
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
def fresh(tmp_path: Path) -> Iterator[Robot]:
    """One of its own: a driver that cannot log out leaves its subscriptions with the controller."""
    robot = Robot(tmp_path, "--left-object", "0.02")
    robot.start()
    yield robot
    robot.stop()


@pytest.fixture
def driven(ros: None, tmp_path: Path, fresh: Robot, request: pytest.FixtureRequest) -> Iterator[Driven]:
    with hostile_before(f"127.0.0.1:{fresh.rws_port}") as server:
        driven = Driven(tmp_path, fresh, server, *getattr(request, "param", ()))
        yield driven
        driven.close()


def test_driver_says_what_bringup_will_do_first_and_ends_within_5_s_before_a_controller_that_drips(
    driven: Driven,
) -> None:
    log = driven.driver.log.read_text()
    announced = (
        "Bring-up will: switch the motors on, move the program pointers to main, start the RAPID program, calibrate "
        "the right gripper (its fingers close), calibrate the left gripper (its fingers close)."
    )
    assert announced in log
    done = (
        "Bring-up: switch the motors on",
        "Bring-up: move the program pointers to main",
        "Bring-up: calibrate the right and left grippers",
    )
    places = [log.index(words) for words in (announced, *done)]
    assert places == sorted(places)
    begin_egm(driven.client)
    driven.server.attack = DRIP
    driven.client.until(lambda: driven.server.attacked > 0)
    assert driven.seconds_to_end(signal.SIGTERM) < ENDED
    assert "EGM could not be ended on the robot" in driven.driver.log.read_text()
    assert "Traceback" not in driven.driver.log.read_text()


@pytest.mark.parametrize("driven", [["--no-bringup"]], indirect=True, ids=["no-bringup"])
def test_driver_without_bringup_moves_the_robot_once_it_is_asked_to_and_ends_egm_and_itself_within_5_s(
    driven: Driven, fresh: Robot
) -> None:
    with RwsClient(f"127.0.0.1:{fresh.rws_port}") as client:
        assert client.controller_state() is ControllerState.MOTORS_OFF
        assert client.execution() is ExecutionState.STOPPED
        assert client.signal("hand_StatusCalibrated_R").value == 0
    begin_egm(driven.client)
    arm = ArmClient(driven.client, Side.RIGHT)
    arm.wait_for_command(TIMEOUT)
    start = arm.wait_for_state(TIMEOUT)
    goal = joints([*start[:6], start[6] + 0.1])
    arm.move(goal)
    driven.client.until(lambda: arm.error(goal) < 1e-3, what="the motion")
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
