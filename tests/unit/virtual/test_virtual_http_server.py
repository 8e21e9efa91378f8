"""The HTTP server that carries Robot Web Services: what reaches the handler, its port, and its WebSockets."""

from __future__ import annotations

import socket
import tracemalloc
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import ExitStack, closing
from http.client import HTTPConnection
from select import select

import httpx
import pytest

from abb_protocols.errors import ControllerRefused, NoConnection, SettingsError
from abb_runtime.clock import ManualClock
from abb_runtime.rws.transport import ConnectionLost, ExchangeDeadline, HttpTransport
from abb_runtime.rws.web_socket import Listener
from refusals import refused
from virtual_irc5.http_server import HttpServer
from virtual_irc5.rws.http import HttpReply, HttpRequest
from virtual_irc5.rws.subscriptions import SubscriptionChannel, Upgrade


def heard(target: str, body: bytes = b"", method: str = "POST") -> HttpRequest:
    """What the handler gets when a client sends this."""
    requests: list[HttpRequest] = []

    def handle(request: HttpRequest) -> HttpReply:
        requests.append(request)
        return HttpReply(204)

    with HttpServer(handle, port=0) as server:
        connection = HTTPConnection(server.address, timeout=5.0)
        connection.request(method, target, body=body, headers={"X-Twice": "a"})
        assert connection.getresponse().status == 204
        connection.close()
    return requests[0]


@pytest.mark.parametrize(
    "target",
    [
        "/rw/rapid/symbol/data/RAPID/T/M/S%7B1%7D?action=set",
        "/fileservice/$home/a%2Fb;state?x=%20&y",
        "//rw//panel",
        "/rw/x{1}",
    ],
)
def test_target_arrives_as_it_was_sent(target: str) -> None:
    assert heard(target).target == target


def test_body_arrives_as_it_was_sent() -> None:
    body = b'value=[[1,2,3],"a+b%"]\r\n\x00\xff'
    assert heard("/", body).body == body


def test_body_may_be_as_long_as_a_program() -> None:
    assert len(heard("/", b"x" * 5_000_000, method="PUT").body) == 5_000_000


def test_body_that_is_too_long_is_refused_unread() -> None:
    with HttpServer(lambda _: HttpReply(204), port=0, body_limit=lambda _: 1000) as server:
        assert answered(server, b"x" * 1000) == 204
        assert answered(server, b"x" * 1001) == 413
        assert answered(server, iter([b"x" * 600] * 2)) == 413  # in chunks, its length untold


def answered(server: HttpServer, body: bytes | Iterator[bytes]) -> int:
    with closing(HTTPConnection(server.address, timeout=5.0)) as connection:
        connection.request("PUT", "/", body=body)
        return connection.getresponse().status


def test_client_without_login_is_answered_before_the_body_has_come() -> None:
    bodies: list[bytes] = []

    def handle(request: HttpRequest) -> HttpReply:
        bodies.append(request.body)
        return HttpReply(401)

    with (
        HttpServer(handle, port=0, body_limit=lambda _: 0) as server,
        socket.create_connection(("127.0.0.1", server.port), timeout=5.0) as end,
    ):
        end.sendall(b"PUT / HTTP/1.1\r\nHost: x\r\nContent-Length: 60000000\r\n\r\n" + b"x" * 100_000)
        assert end.recv(100).startswith(b"HTTP/1.1 401 ")
    assert bodies == [b""]


def test_unfinished_bodies_without_login_take_no_memory() -> None:
    head = b"PUT / HTTP/1.1\r\nHost: x\r\nContent-Length: 60000000\r\n\r\n"
    with HttpServer(lambda _: HttpReply(401), port=0, body_limit=lambda _: 0) as server, ExitStack() as stack:
        tracemalloc.start()
        for _ in range(5):
            end = stack.enter_context(socket.create_connection(("127.0.0.1", server.port), timeout=5.0))
            end.sendall(head + b"x" * 10_000_000)
            assert end.recv(100).startswith(b"HTTP/1.1 401 ")
        used, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert used < 20_000_000  # of 50 that were sent, and 10 of them are the test's


def test_answer_waits_for_its_preparation_while_others_are_answered() -> None:
    pending: Future[object] = Future()
    with (
        HttpServer(
            lambda request: HttpReply(204),
            port=0,
            prepare=lambda request: pending if request.target == "/long" else None,
        ) as server,
        closing(HTTPConnection(server.address, timeout=5.0)) as slow,
    ):
        slow.request("POST", "/long")
        assert answered(server, b"") == 204
        pending.set_result(None)
        assert slow.getresponse().status == 204


def test_header_is_found_in_any_case() -> None:
    request = heard("/")
    assert request.header("x-twice") == "a"
    assert request.header("X-Missing") is None


def test_reply_keeps_repeated_headers_in_order() -> None:
    reply = HttpReply(200, (("Set-Cookie", "a=1"), ("Set-Cookie", "b=2"), ("Content-Type", "text/html")), b"hi")
    with HttpServer(lambda request: reply, port=0) as server:
        connection = HTTPConnection(server.address, timeout=5.0)
        connection.request("GET", "/")
        response = connection.getresponse()
        assert response.headers.get_all("Set-Cookie") == ["a=1", "b=2"]
        assert response.headers["Content-Type"] == "text/html"
        assert response.read() == b"hi"
        connection.close()


def test_port_that_is_taken_is_refused_with_a_sentence() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        sentence = rf"Port {port} on 127\.0\.0\.1 cannot be opened .*; choose another"
        with pytest.raises(SettingsError, match=sentence), HttpServer(lambda request: HttpReply(204), port):
            pytest.fail("It listens.")


def test_port_is_free_again_after_the_stop() -> None:
    with HttpServer(lambda request: HttpReply(204), port=0) as server:
        port = server.port
    with HttpServer(lambda request: HttpReply(204), port) as server:
        assert server.address == f"127.0.0.1:{port}"


def test_stop_does_not_wait_for_clients_that_stay_connected() -> None:
    with HttpServer(lambda request: HttpReply(204), port=0) as server:
        idle = HTTPConnection(server.address, timeout=5.0)
        idle.request("GET", "/")
        assert idle.getresponse().status == 204
    assert idle.sock.recv(1) == b""
    idle.close()


@pytest.mark.parametrize(("port", "host"), [(99999, "127.0.0.1"), (0, "no-such-host.invalid")])
def test_server_that_cannot_listen_says_so(port: int, host: str) -> None:
    sentence = f"Port {port} on {host} cannot be opened .*; choose another port"
    with pytest.raises(SettingsError, match=sentence), HttpServer(lambda _: HttpReply(200), port, host):
        pytest.fail("It listens.")


def test_request_without_an_answer_ends_the_connection() -> None:
    with HttpServer(lambda _: None, 0) as server:
        transport = HttpTransport(server.address, ManualClock())
        with refused(ConnectionLost, "no_http_answer", address=server.address):
            extensions = {"deadline": ExchangeDeadline(5.0)}
            transport.handle_request(httpx.Request("GET", f"http://{server.address}/", extensions=extensions))
        transport.close()


def test_web_socket_that_is_not_granted_is_refused() -> None:
    listener = Listener("robapi2_subscription", lambda text: None, lambda sentence: None)
    with HttpServer(lambda _: HttpReply(404), 0) as server:
        address = server.address
        with refused(ControllerRefused, "websocket_refused", address=address, target="/poll/1", status=404):
            HttpTransport(server.address).open_socket("/poll/1", "", listener, 5.0)
    with refused(NoConnection, "websocket_not_reached", address=address):
        HttpTransport(address).open_socket("/poll/1", "", listener, 5.0)


def test_web_socket_does_not_follow_a_redirect() -> None:
    """The session's cookies belong to the controller."""
    listener = Listener("robapi2_subscription", lambda text: None, lambda sentence: None)
    asked: list[HttpRequest] = []
    with (
        HttpServer(lambda request: asked.append(request) or HttpReply(404), 0) as other,
        HttpServer(lambda _: HttpReply(302, (("Location", f"ws://{other.address}/poll/1"),)), 0) as server,
        refused(ControllerRefused, "websocket_refused", address=server.address, status=302),
    ):
        HttpTransport(server.address).open_socket("/poll/1", "-http-session-=1", listener, 5.0)
    assert asked == []


HANDSHAKE = (
    b"GET /poll/1 HTTP/1.1\r\nHost: x\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: p\r\n\r\n"
)


def connected(server: HttpServer) -> socket.socket:
    return socket.create_connection(("127.0.0.1", server.port), timeout=5.0)


def test_web_socket_is_attached_before_its_client_sees_it_open() -> None:
    is_told: list[bool] = []

    def attach(channel: SubscriptionChannel) -> None:
        is_told.append(bool(select([end], [], [], 0.0)[0]))
        channel.send("at once")

    with (
        HttpServer(lambda _: Upgrade("p", attach), 0) as server,
        connected(server) as end,
        end.makefile("rb") as stream,
    ):
        end.sendall(HANDSHAKE)
        head = list(iter(stream.readline, b"\r\n"))
        assert (head[0].split()[1], stream.read(9), is_told) == (b"101", b"\x81\x07at once", [False])


def test_web_socket_whose_handshake_is_wrong_is_not_open() -> None:
    channels: list[SubscriptionChannel] = []
    with HttpServer(lambda _: Upgrade("p", channels.append), 0) as server, connected(server) as end:
        end.sendall(HANDSHAKE.replace(b"Sec-WebSocket-Key", b"Sec-Key"))
        assert end.recv(4096).startswith(b"HTTP/1.1 400 ")
    assert [channel.is_open for channel in channels] == [False]


GET = b"GET /rw HTTP/1.1\r\nHost: robot\r\n"
POST = b"POST /rw HTTP/1.1\r\nHost: robot\r\n"


def echoed(request: HttpRequest) -> HttpReply:
    """What was understood of a request."""
    text = f"{request.method} {request.target} {request.header('host')} {request.body.decode()}"
    return HttpReply(200, (("Content-Type", "text/plain"),), text.encode())


def received(*parts: bytes, until: bytes = b"", limit: int = 1000) -> bytes:
    """What the server sends until these bytes or the end; each part is sent when the one before has been answered."""
    with HttpServer(echoed, port=0, body_limit=lambda request: limit) as server, closing(connected(server)) as client:
        client.settimeout(5.0)
        data = b""
        for part in parts:
            client.sendall(part)
            while part is not parts[-1] and b"\r\n\r\n" not in data:
                data += client.recv(4096)
        while not (until and until in data):
            more = client.recv(4096)
            if not more:
                break
            data += more
        return data.replace(server.address.encode(), b"ADDRESS")


@pytest.mark.parametrize(
    ("request_line", "header", "connection"),
    [
        (GET, b"Connection: close\r\n", b"close"),
        (GET, b"connection: X-Hop, close\r\n", b"close"),
        (GET, b"", b"Keep-Alive"),
        (b"GET /rw HTTP/1.0\r\nHost: robot\r\n", b"", b"close"),
        (b"GET /rw HTTP/1.0\r\nHost: robot\r\n", b"Connection: keep-alive\r\n", b"Keep-Alive"),
    ],
)
def test_answer_says_whether_the_connection_stays(request_line: bytes, header: bytes, connection: bytes) -> None:
    stays = connection == b"Keep-Alive"
    data = received(request_line + header + b"\r\n", until=b"GET /rw robot" if stays else b"")
    assert data.count(b"Connection: " + connection + b"\r\n") == 1
    assert data.lower().count(b"connection:") == 1


def test_client_of_http_1_0_without_host_is_told_the_address_it_has_called() -> None:
    assert received(b"GET /rw HTTP/1.0\r\n\r\n").endswith(b"GET /rw ADDRESS ")


def test_target_may_be_a_whole_url_as_proxies_send_it() -> None:
    data = received(GET.replace(b"/rw", b"http://robot:80/rw/panel?json=1") + b"\r\n", until=b"robot ")
    assert data.endswith(b"GET /rw/panel?json=1 robot ")


def test_client_that_waits_for_permission_to_send_its_body_gets_it() -> None:
    head = POST + b"Content-Length: 5\r\nExpect: 100-continue\r\n\r\n"
    data = received(head, b"value", until=b"robot value")
    assert data.startswith(b"HTTP/1.1 100 Continue\r\n\r\nHTTP/1.1 200 OK\r\n")


def test_body_that_is_not_wanted_is_not_asked_for() -> None:
    data = received(POST + b"Content-Length: 5\r\nExpect: 100-continue\r\n\r\n", until=b"robot ", limit=0)
    assert b"100 Continue" not in data


def test_body_may_come_in_chunks() -> None:
    chunks = b"2\r\nva\r\n3\r\nlue\r\n0\r\n\r\n"
    data = received(POST + b"Transfer-Encoding: chunked\r\n\r\n" + chunks, until=b"robot value")
    assert data.endswith(b"POST /rw robot value")


def test_requests_may_come_before_the_answers_to_earlier_ones() -> None:
    targets = [b"/rw/panel", b"/rw/rapid", b"/rw/cfg"]
    data = received(b"".join(GET.replace(b"/rw", each) + b"\r\n" for each in targets), until=b"/rw/cfg robot ")
    places = [data.index(b"GET " + each) for each in targets]
    assert places == sorted(places)
