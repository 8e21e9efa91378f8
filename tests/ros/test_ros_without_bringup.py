"""The driver with --no-bringup: it connects and reads, and leaves the robot as it is until it is asked for more."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from yumi.egm.udp import free_port
from yumi.process.supervision import Command
from yumi.robot.joints import Side
from yumi.rws.client import RwsClient
from yumi.rws.types import ControllerState, ExecutionState
from yumi.virtual.rws.http import HttpReply, HttpRequest
from yumi.virtual.rws.service import RwsService
from yumi.virtual.rws.subscriptions import Upgrade
from yumi.virtual.server import HttpServer
from yumi.virtual.world import World, WorldSettings

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]
TIMEOUT = 60.0
EXAMPLE = Path(__file__).parents[2] / "examples" / "move_one_joint.py"


@pytest.fixture(autouse=True)
def _domain_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(1 + (int(os.environ["ROS_DOMAIN_ID"]) + 29) % 100))


@pytest.fixture
def ports() -> list[str]:
    return [text for side in Side for text in (f"--{side.word}-egm-port", str(free_port()))]


def test_driver_without_bringup_sends_nothing_but_reads_and_subscriptions(tmp_path: Path, ports: list[str]) -> None:
    world, requests = World(WorldSettings(egm_ports={Side.LEFT: int(ports[1]), Side.RIGHT: int(ports[3])})), []
    adapter = RwsService(world.controller, user="Default User", password="robotics")

    def handle(request: HttpRequest) -> HttpReply | Upgrade | None:
        requests.append(request)
        adapter.advance(time.monotonic())
        return adapter.handle(request, time.monotonic())

    with HttpServer(handle, port=0) as server:
        options = ["--robot", f"127.0.0.1:{server.port}", *ports, "--no-bringup"]
        with Command("driver", ["up", *options], tmp_path / "driver.log") as driver:
            driver.wait_until_ready(TIMEOUT)
        assert driver.exit_code == 0
    written = {f"{each.method} {each.target}" for each in requests if each.method != "GET"}
    assert {each for each in written if not each.split()[1].startswith("/subscription")} == set()
    assert any("opmode" in each.target for each in requests)
    log = (tmp_path / "driver.log").read_text()
    assert "Bring-up will" not in log
    assert "The robot is left as it is until start_egm, set_mode or recover is called." in log


def test_driver_without_bringup_moves_the_robot_once_it_is_asked_to(tmp_path: Path, ports: list[str]) -> None:
    with Command("virtual controller", ["controller", "--rws-port", "0", *ports], tmp_path / "controller.log") as robot:
        port = robot.wait_until_ready(TIMEOUT).rpartition(":")[2]
        options = ["--robot", f"127.0.0.1:{port}", *ports, "--no-bringup"]
        with Command("driver", ["up", *options], tmp_path / "driver.log") as driver:
            driver.wait_until_ready(TIMEOUT)
            with RwsClient(f"127.0.0.1:{port}") as client:
                assert client.controller_state() is ControllerState.MOTORS_OFF
                assert client.execution() is ExecutionState.STOPPED
                assert client.signal("hand_StatusCalibrated_R").value == 0
            done = subprocess.run(
                [sys.executable, str(EXAMPLE)], capture_output=True, text=True, check=False, timeout=60
            )
            assert done.returncode == 0, done.stderr + (tmp_path / "driver.log").read_text()


def test_driver_says_what_bringup_will_do_before_it_does_the_first_of_it(tmp_path: Path, ports: list[str]) -> None:
    with Command("virtual controller", ["controller", "--rws-port", "0", *ports], tmp_path / "controller.log") as robot:
        port = robot.wait_until_ready(TIMEOUT).rpartition(":")[2]
        with Command("driver", ["up", "--robot", f"127.0.0.1:{port}", *ports], tmp_path / "log") as driver:
            driver.wait_until_ready(TIMEOUT)
    log = (tmp_path / "log").read_text()
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
