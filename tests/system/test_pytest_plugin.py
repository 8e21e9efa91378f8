"""The pytest plug-in as a third party meets it: installed, found by pytest, and leaving nothing behind."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from abb_protocols.errors import CommandRefused, RobotNotReady
from abb_protocols.rws.values import ControllerState
from abb_runtime.faults import Fault
from abb_runtime.rws.client import RwsClient
from soak import CONTROLLERS, long, short, tell
from virtual_irc5.testing.controller_process import ControllerProcess

pytestmark = pytest.mark.real_time

THIRD_PARTY = """
import pytest
from abb_runtime.rws.client import RwsClient
from abb_protocols.rws.values import ControllerState

@pytest.mark.abb_controller(calibrated=True)
def test_motors_go_on(abb_controller):
    with RwsClient(abb_controller.address) as client:
        client.set_motors(True)
        assert client.controller_state() is ControllerState.MOTORS_ON
"""


def run_pytest(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run pytest in a folder of somebody else, where nothing of this repository's configuration holds."""
    command = [sys.executable, "-m", "pytest", "--strict-markers", "-W", "error", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=60.0)


def test_test_of_a_third_party_needs_ten_lines_and_one_fixture_and_passes(tmp_path: Path) -> None:
    """One that moves an arm is run by ``docs/how-to/test-against-a-virtual-robot.md``."""
    (tmp_path / "test_arm.py").write_text(THIRD_PARTY)
    assert len([line for line in THIRD_PARTY.splitlines() if line.strip()]) <= 10
    done = run_pytest(tmp_path)
    assert done.returncode == 0, done.stdout
    assert "1 passed" in done.stdout


def test_fixtures_are_listed_with_what_they_give(tmp_path: Path) -> None:
    listed = run_pytest(tmp_path, "--fixtures", "--markers").stdout
    assert "abb_controller(**options)" in listed
    assert "virtual_yumi(**settings)" in listed


def test_option_that_does_not_exist_is_said_by_the_fixture(tmp_path: Path) -> None:
    with pytest.raises(RobotNotReady, match=r"No such option.*--weight"):
        ControllerProcess(tmp_path / "log", {"weight": 7}).start()


@pytest.fixture(scope="module")
def controller(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ControllerProcess]:
    with ControllerProcess(tmp_path_factory.mktemp("controller") / "log", {}) as controller:
        yield controller


def test_only_the_thread_that_advances_the_robot_runs_in_real_time(controller: ControllerProcess) -> None:
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except PermissionError:
        pytest.skip("this machine does not permit real-time priority")
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    threads = [int(path.name) for path in Path(f"/proc/{controller.pid}/task").iterdir()]
    assert len(threads) >= 3  # the robot, the server, the background
    in_real_time = [each for each in threads if os.sched_getscheduler(each) & os.SCHED_FIFO]
    assert in_real_time == [controller.pid]


def test_controller_takes_faults_by_their_names(controller: ControllerProcess) -> None:
    controller.inject(Fault.EMERGENCY_STOP)
    with RwsClient(controller.address) as client:
        assert client.controller_state() is ControllerState.EMERGENCY_STOP
    controller.inject("warm-restart", duration=0.5)
    with pytest.raises(CommandRefused, match="There is no fault 'warm'"):
        controller.inject("warm")


@pytest.mark.alone  # else another test may get a port that has just become free
@pytest.mark.parametrize("count", [short(2), long(CONTROLLERS, 900.0)])
def test_controllers_one_after_another_leave_no_process_port_or_file(
    count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    descriptors = len(os.listdir("/proc/self/fd"))
    begin = time.monotonic()
    for _ in range(count):
        with ControllerProcess(tmp_path / "log", {"user": "tester"}) as controller:
            ports = [controller.rws_port, *controller.egm_ports.values()]
            with socket.create_connection(("127.0.0.1", controller.rws_port)):
                assert Path(f"/proc/{controller.pid}").exists()
        assert not Path(f"/proc/{controller.pid}").exists()
        for port in ports:
            with socket.socket() as listener, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
                listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as a server that starts again
                listener.bind(("127.0.0.1", port))
                receiver.bind(("127.0.0.1", port))
    tell(f"{count} controllers in {time.monotonic() - begin:.0f} s")
    assert len(os.listdir("/proc/self/fd")) == descriptors
    assert list(folder.iterdir()) == []
    assert sorted(path.name for path in tmp_path.iterdir()) == ["log", "temporary"]
