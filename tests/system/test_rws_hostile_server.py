"""The client before a web server that drips, floods, breaks off and lies: it gives up in time and works again after."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from time import monotonic

import pytest

from abb_protocols.errors import NoConnection, ProtocolError, YumiError
from abb_runtime.rws.client import SPEED_RATIO, RwsClient
from contract.rws_bench import PlainController, serving
from hostile_server import ATTACKS, HostileServer, dripping, hostile_before
from refusals import assert_says, refused
from stalls import waited_for_a_processor

pytestmark = pytest.mark.real_time

TIMEOUT = 0.5
LONG = 10.0
MARGIN = 2.0  # [s] a machine shared with others may stand still for some time, beside what this process waits for it
DRIP = dripping(b"HTTP/1.1 200 OK\r\nX-Drop: ")


@pytest.fixture
def controller() -> PlainController:
    return PlainController()


@pytest.fixture
def server(controller: PlainController) -> Iterator[HostileServer]:
    with serving(controller) as address, hostile_before(address) as server:
        yield server


@pytest.fixture
def client(server: HostileServer) -> Iterator[RwsClient]:
    with RwsClient(server.address, timeout=TIMEOUT) as client:
        yield client
        server.attack = None


def logins(controller: PlainController) -> int:
    return len([request for request in controller.requests if request.header("Authorization")])


@pytest.mark.parametrize("name", ATTACKS)
def test_attack_ends_in_time_and_leaves_nothing_behind(
    name: str, server: HostileServer, client: RwsClient, controller: PlainController
) -> None:
    threads = set(threading.enumerate())
    for _ in range(2):
        server.attack = ATTACKS[name]
        begin, waited = monotonic(), waited_for_a_processor(os.getpid())
        with pytest.raises(YumiError):
            client.speed_ratio()
        taken = monotonic() - begin
        assert taken - (waited_for_a_processor(os.getpid()) - waited) < TIMEOUT + MARGIN
        server.attack = None
        assert client.speed_ratio() == 100
    assert logins(controller) == 1
    assert {thread for thread in threading.enumerate() if thread.name == "web-socket"} <= threads


@pytest.mark.parametrize(
    ("name", "timeout", "code", "values"),
    [
        ("headers drip", TIMEOUT, "no_answer_to_request", {"timeout": pytest.approx(TIMEOUT, abs=0.05)}),
        ("102 Processing drips", TIMEOUT, "no_answer_to_request", {"timeout": pytest.approx(TIMEOUT, abs=0.05)}),
        ("102 Processing floods", LONG, "answer_head_too_long", {"most": 262144}),
        ("body drips", TIMEOUT, "answer_not_ended", {}),
        ("1000 nested lists", LONG, "document_nested_too_deeply", {"most": 32}),
        ("300 nested states", LONG, "answer_not_xhtml", {"kind": "application/json"}),
        ("100000 nested states", LONG, "answer_not_xhtml", {"kind": "application/json"}),
    ],
)
def test_attack_is_named(
    name: str, timeout: float, code: str, values: dict[str, object], server: HostileServer
) -> None:
    with RwsClient(server.address, timeout=timeout) as client:
        server.attack = ATTACKS[name]
        with pytest.raises((NoConnection, ProtocolError)) as caught:
            client.speed_ratio()
        server.attack = None
    assert_says(caught.value.said, code, **values)


def test_request_whose_answer_drips_keeps_no_other_one_waiting(server: HostileServer) -> None:
    timeout = 3.0
    with RwsClient(server.address, timeout=timeout) as client, ThreadPoolExecutor(1) as other:
        server.targets, server.attack = "/rw/rapid/execution", DRIP
        begin = monotonic()
        hung = other.submit(client.execution)
        while not server.attacked:
            assert monotonic() - begin < timeout
        answers = [client.speed_ratio() for _ in range(5)]
        assert answers == [100] * 5
        assert monotonic() - begin < 0.8 * timeout
        assert not hung.done()
        assert isinstance(hung.exception(), NoConnection)
        assert timeout - 0.1 < monotonic() - begin < timeout + MARGIN
        server.attack = None


@pytest.mark.parametrize("name", ["status line drips", "headers drip", "headers flood", "nothing", "reset"])
def test_web_socket_that_does_not_open_is_given_up_in_time(name: str, server: HostileServer, client: RwsClient) -> None:
    server.targets, server.attack = "/poll/", ATTACKS[name]
    threads = set(threading.enumerate())
    begin = monotonic()
    with pytest.raises(NoConnection):
        client.subscribe([SPEED_RATIO], lambda change: None, lambda reason: None)
    assert monotonic() - begin < TIMEOUT + MARGIN
    assert client.speed_ratio() == 100
    new = {thread.name for thread in threading.enumerate() if thread not in threads}
    assert not [each for each in new if "web-socket" in each or "recv_events" in each]


def test_several_requests_to_a_server_that_drips_all_end(server: HostileServer, client: RwsClient) -> None:
    server.attack = DRIP
    begin = monotonic()
    with ThreadPoolExecutor(6) as others:
        errors = [call.exception() for call in [others.submit(client.speed_ratio) for _ in range(6)]]
    assert all(isinstance(error, NoConnection) for error in errors)
    assert monotonic() - begin < 2.0 * TIMEOUT + 0.5 + MARGIN
    server.attack = None
    assert client.speed_ratio() == 100


def test_abandoned_client_ends_what_hangs_and_asks_no_more(server: HostileServer) -> None:
    client = RwsClient(server.address, timeout=60.0)
    client.connect()
    server.attack = DRIP
    with ThreadPoolExecutor(3) as others:
        calls = [others.submit(client.speed_ratio) for _ in range(3)]
        begin = monotonic()
        with pytest.raises(TimeoutError):
            calls[0].exception(timeout=0.2)
        client.abandon()
        assert all(isinstance(call.exception(timeout=MARGIN), NoConnection) for call in calls)
    with refused(NoConnection, "client_abandoned", address=client.address):
        client.speed_ratio()
    client.close()
    assert monotonic() - begin < MARGIN


def test_requests_while_another_one_logs_in_open_no_second_session(
    server: HostileServer, controller: PlainController
) -> None:
    with RwsClient(server.address, timeout=5.0) as client, ThreadPoolExecutor(4) as others:
        calls = [others.submit(client.speed_ratio) for _ in range(4)]
        assert [call.result() for call in calls] == [100] * 4
    assert logins(controller) == 1


@pytest.mark.parametrize(
    "cookie", [b"tracker=" + b"x" * 150, b"-http-session-=" + b"x" * 5000], ids=["of another", "as ours"]
)
def test_cookies_of_others_are_not_kept(cookie: bytes, client: RwsClient, server: HostileServer) -> None:
    server.injected = b"Set-Cookie: " + cookie + b"; path=/\r\n"
    assert client.speed_ratio() == 100
    server.injected = b""
    assert client.speed_ratio() == 100


def test_50_cookies_in_each_answer_make_no_request_longer(
    client: RwsClient, server: HostileServer, controller: PlainController
) -> None:
    for number in range(10):
        lines = (b"Set-Cookie: c%d-%d=%s; path=/\r\n" % (number, index, b"x" * 150) for index in range(50))
        server.injected = b"".join(lines)
        assert client.speed_ratio() == 100
    assert {len(request.header("Cookie") or "") for request in controller.requests[-5:]} == {
        len(controller.requests[-1].header("Cookie") or "")
    }
    assert len(controller.requests[-1].header("Cookie") or "") < 256
    assert logins(controller) == 1


def test_session_cookie_that_a_stranger_has_set_is_replaced_by_a_new_login(
    client: RwsClient, server: HostileServer
) -> None:
    server.injected = b"Set-Cookie: -http-session-=forged; path=/\r\nSet-Cookie: ABBCX=1; path=/\r\n"
    assert client.speed_ratio() == 100
    server.injected = b""
    assert client.speed_ratio() == 100
