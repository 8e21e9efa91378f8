"""The driver with --no-bringup connects and reads alone; what it does once it is asked to: ``test_ros_shutdown``."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from abb_protocols.robot.joints import Side
from abb_runtime.process.command_process import CommandProcess
from abb_runtime.udp import free_port
from virtual_irc5.http_server import HttpServer
from virtual_irc5.rws.http import HttpReply, HttpRequest
from virtual_irc5.rws.rws_service import RwsService
from virtual_irc5.rws.subscriptions import Upgrade
from virtual_irc5.world import World, WorldSettings

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]
TIMEOUT = 60.0


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
        with CommandProcess("driver", "yumi", ["up", *options], tmp_path / "driver.log") as driver:
            driver.wait_until_ready(TIMEOUT)
        assert driver.exit_code == 0
    written = {f"{each.method} {each.target}" for each in requests if each.method != "GET"}
    assert {each for each in written if not each.split()[1].startswith("/subscription")} == set()
    assert any("opmode" in each.target for each in requests)
    log = (tmp_path / "driver.log").read_text()
    assert "Bring-up will" not in log
    assert "The robot is left as it is until start_egm, set_mode or recover is called." in log
