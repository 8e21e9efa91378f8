"""``yumi controller`` as a process: it tells subscribers, takes faults, and comes back after a restart."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from http.client import HTTPConnection
from pathlib import Path
from queue import Queue

import pytest
from click.testing import CliRunner

from abb_protocols.catalogue import message
from abb_protocols.errors import ControllerRefused, LoginRefused, NoConnection
from abb_protocols.rws.values import ControllerState, RwsCode
from abb_runtime.faults import takes_faults
from abb_runtime.process.command_process import CONTROLLER_READY, CommandProcess
from abb_runtime.rws.client import CONTROLLER_STATE, Change, RwsClient
from refusals import refused
from yumi.cli.main import main

PATIENCE = 20.0  # [s]


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Of a controller whose user may write no signals."""
    log = tmp_path_factory.mktemp("controller") / "log"
    arguments = ["controller", "--rws-port", "0", "--without-grant", "UAS_IO_WRITE"]
    with CommandProcess("controller", "yumi", arguments, Path(log)) as command:
        yield command.wait_until_ready(PATIENCE).rpartition("/")[2]


def test_controller_takes_its_password_from_the_environment_and_neither_shows_nor_tells_it(tmp_path: Path) -> None:
    log, secret = tmp_path / "log", "s3cret-4711"
    with CommandProcess(
        "controller", "yumi", ["controller", "--rws-port", "0"], log, {"YUMI_PASSWORD": secret}
    ) as command:
        address = command.wait_until_ready(PATIENCE).rpartition("/")[2]
        assert secret.encode() not in Path(f"/proc/{command.pid}/cmdline").read_bytes()
        with RwsClient(address, password=secret) as client:
            assert client.controller_state() is ControllerState.MOTORS_OFF
        with refused(LoginRefused, "login_refused", user="Default User"):
            RwsClient(address).connect()
    assert secret not in log.read_text()


@pytest.fixture
def client(address: str) -> Iterator[RwsClient]:
    with RwsClient(address) as client:
        yield client


def test_controller_refuses_what_its_user_was_not_granted(client: RwsClient) -> None:
    assert "UAS_IO_WRITE" not in client.grants()
    with refused(ControllerRefused, "rws_refused", reason=message("rws_uas_reject")):
        client.set_signal("custom_DO_0", 1)
    client.set_motors(True)


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
    return CliRunner().invoke(main, ["fault", *arguments, "--robot", f"127.0.0.1:{address.rpartition(':')[2]}"]).output


def state_as_soon_as_it_is_back(client: RwsClient) -> ControllerState | None:
    """The motors once the controller answers; the client's rate limit makes the attempts last some seconds."""
    for _ in range(200):
        with suppress(NoConnection):
            return client.controller_state()
    return None


def test_running_controller_takes_a_fault_and_tells_of_it(address: str, told: Queue[Change | str]) -> None:
    assert fault(address, "motors-off") == "motors-off: done\n"
    assert told.get(timeout=PATIENCE) == Change(CONTROLLER_STATE.path, {"ctrlstate": "motoroff"})


def test_stranger_is_answered_before_the_body_has_come(address: str) -> None:
    with closing(HTTPConnection(address, timeout=PATIENCE)) as stranger:
        stranger.putrequest("PUT", "/fileservice/$home/x.mod")
        stranger.putheader("Content-Length", "60000000")
        stranger.endheaders(b"x" * 100_000)
        assert stranger.getresponse().status == 401


def test_upload_is_limited_and_the_connection_goes_on(address: str, client: RwsClient) -> None:
    client.upload("HOME:/large.mod", "!" * 1_000_000)
    with pytest.raises(ControllerRefused, match="413"):
        client.upload("HOME:/larger.mod", "!" * 17_000_000)
    assert client.controller_state() in ControllerState


def test_long_upload_whose_session_has_expired_is_made_with_a_new_one(address: str, client: RwsClient) -> None:
    """The first attempt is a stranger's, whose body is not read but let go by."""
    fault(address, "rws-sessions-expired")
    client.upload("HOME:/large.mod", "!" * 5_000_000)
    assert len(client.download("HOME:/large.mod")) == 5_000_000


def test_controller_is_known_by_the_faults_that_it_takes(address: str) -> None:
    assert takes_faults(address)


def test_fault_under_a_strange_name_is_refused(address: str) -> None:
    with closing(HTTPConnection(address, timeout=PATIENCE)) as page:
        page.request("POST", "/virtual/faults/emergency-stop", headers={"Host": "evil.example"})
        assert page.getresponse().status == 403


@pytest.mark.parametrize("value", ["-" * 5000 + "1", "1+" * 5000 + "1"])
def test_value_that_is_nested_too_deeply_is_refused(client: RwsClient, value: str) -> None:
    with pytest.raises(ControllerRefused, match="400"):
        client.set_symbol("T_ROB_L", "TRobMain", "idle_counter", value)


def test_module_that_is_nested_too_deeply_is_refused(client: RwsClient) -> None:
    client.upload("HOME:/deep.mod", f"MODULE deep PROC d() {'IF TRUE THEN ' * 2000}{'ENDIF ' * 2000} ENDPROC ENDMODULE")
    with refused(ControllerRefused, "rws_refused", status=400) as refusal:
        client.load_module("T_ROB_L", "HOME:/deep.mod")
    assert refusal.value.code == RwsCode.SYNTAX


def test_controller_that_has_moved_ends_without_a_word(tmp_path: Path) -> None:
    """Not with the complaints of libraries about what was frozen for the collector and never freed."""
    log = tmp_path / "log"
    with CommandProcess("controller", "yumi", ["controller", "--rws-port", "0"], log) as command:
        address = command.wait_until_ready(PATIENCE).rpartition("/")[2]
        with RwsClient(address) as client:
            client.set_motors(True)
            client.move_pp_to_main()
            client.start_rapid()
            asked_until(lambda: client.symbol("T_ROB_R", "TRobMain", "current_state") == "0")
            before = client.joint_target("ROB_R")
            client.set_symbol("T_ROB_R", "TRobRAPID", "move_jointtarget_input", BENT)
            client.set_symbol("T_ROB_R", "TRobRAPID", "routine_name_input", '"runMoveAbsJ"')
            client.pulse_signal("RUN_RAPID_ROUTINE")
            asked_until(lambda: client.joint_target("ROB_R") != before)
    assert command.exit_code == 0
    assert log.read_text().splitlines() == [f"{CONTROLLER_READY}http://{address}"]


BENT = "[[20,-120,30,0,40,0],[-130,9E9,9E9,9E9,9E9,9E9]]"


def asked_until(condition: Callable[[], bool]) -> None:
    """Ask again and again; the client's rate limit makes the attempts last some seconds."""
    assert any(condition() for _ in range(200))


def test_running_controller_comes_back_after_a_restart(
    address: str, client: RwsClient, told: Queue[Change | str]
) -> None:
    fault(address, "warm-restart", "--duration", "1")
    assert told.get(timeout=PATIENCE) == str(message("websocket_broke", address=address))
    assert state_as_soon_as_it_is_back(client) is ControllerState.MOTORS_OFF
