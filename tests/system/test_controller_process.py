"""``yumi controller`` as a process: it tells subscribers, takes faults, and comes back after a restart."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from queue import Queue

import pytest
from click.testing import CliRunner

from yumi.cli import main
from yumi.errors import LoginRefused, NoConnection
from yumi.hardware.rws_client import RwsClient
from yumi.links.command import Command
from yumi.rws.states import ControllerState
from yumi.rws.subscriptions import CONTROLLER_STATE, Change

PATIENCE = 20.0  # [s]


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    log = tmp_path_factory.mktemp("controller") / "log"
    with Command("controller", ["controller", "--rws-port", "0"], Path(log)) as command:
        yield command.wait_until_ready(PATIENCE).rpartition("/")[2]


def test_controller_takes_its_password_from_the_environment_and_neither_shows_nor_tells_it(tmp_path: Path) -> None:
    log, secret = tmp_path / "log", "s3cret-4711"
    with Command("controller", ["controller", "--rws-port", "0"], log, {"YUMI_PASSWORD": secret}) as command:
        address = command.wait_until_ready(PATIENCE).rpartition("/")[2]
        assert secret.encode() not in Path(f"/proc/{command.pid}/cmdline").read_bytes()
        with RwsClient(address, password=secret) as client:
            assert client.controller_state() is ControllerState.MOTORS_OFF
        with pytest.raises(LoginRefused, match="does not accept user 'Default User'"):
            RwsClient(address).connect()
    assert secret not in log.read_text()


@pytest.fixture
def client(address: str) -> Iterator[RwsClient]:
    with RwsClient(address) as client:
        yield client


@pytest.fixture
def told(client: RwsClient) -> Queue[Change | str]:
    """What a subscriber to the motors is told, from now on."""
    queue: Queue[Change | str] = Queue()
    client.set_motors(True)
    client.subscribe([CONTROLLER_STATE], queue.put, queue.put)
    while not queue.empty():
        queue.get()
    return queue


def fault(address: str, *arguments: str) -> str:
    return CliRunner().invoke(main, ["fault", *arguments, "--rws-port", address.rpartition(":")[2]]).output


def state_as_soon_as_it_is_back(client: RwsClient) -> ControllerState | None:
    """The motors once the controller answers; the client's pace makes the attempts last some seconds."""
    for _ in range(200):
        with suppress(NoConnection):
            return client.controller_state()
    return None


def test_running_controller_takes_a_fault_and_tells_of_it(address: str, told: Queue[Change | str]) -> None:
    assert fault(address, "motors-off") == "motors-off: done\n"
    assert told.get(timeout=PATIENCE) == Change(CONTROLLER_STATE.path, {"ctrlstate": "motoroff"})


def test_running_controller_comes_back_after_a_restart(
    address: str, client: RwsClient, told: Queue[Change | str]
) -> None:
    fault(address, "warm-restart", "--duration", "1")
    assert told.get(timeout=PATIENCE) == f"The WebSocket of {address} broke."
    assert state_as_soon_as_it_is_back(client) is ControllerState.MOTORS_OFF
