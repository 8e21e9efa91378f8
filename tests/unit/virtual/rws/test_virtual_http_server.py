from __future__ import annotations

import socket
from select import select

import httpx
import pytest

from yumi.clock import ManualClock
from yumi.errors import ControllerRefused, NoConnection, SettingsError
from yumi.rws.transport import ConnectionLost, HttpTransport, Listener, WebSocket, until
from yumi.virtual.rws.http import HttpReply, HttpRequest
from yumi.virtual.rws.http_server import Channel, HttpServer, Upgrade


@pytest.mark.parametrize(("port", "host"), [(99999, "127.0.0.1"), (0, "no-such-host.invalid")])
def test_server_that_cannot_listen_says_so(port: int, host: str) -> None:
    server = HttpServer(lambda _: HttpReply(200), port, host)
    with pytest.raises(SettingsError, match=f"Port {port} on {host} cannot be opened .*; choose another port"):
        server.start()


def test_taken_port_is_refused() -> None:
    with HttpServer(lambda _: HttpReply(200), 0) as first:
        second = HttpServer(lambda _: HttpReply(200), first.port)
        with pytest.raises(SettingsError, match=f"Port {first.port} on 127.0.0.1 cannot be opened"):
            second.start()


def test_request_without_an_answer_ends_the_connection() -> None:
    with HttpServer(lambda _: None, 0) as server:
        transport = HttpTransport(server.address, ManualClock())
        with pytest.raises(ConnectionLost, match="closed the connection without an HTTP answer"):
            transport.handle_request(httpx.Request("GET", f"http://{server.address}/", extensions=until(5.0, 5.0)))
        transport.close()


def test_web_socket_that_is_not_granted_is_refused() -> None:
    listener = Listener("robapi2_subscription", lambda text: None, lambda sentence: None)
    with HttpServer(lambda _: HttpReply(404), 0) as server:
        sentence = f"{server.address} does not open a WebSocket at /poll/1"
        with pytest.raises(ControllerRefused, match=f"{sentence}: it answers HTTP 404"):
            WebSocket(server.address, "/poll/1", "", listener, 5.0)
    with pytest.raises(NoConnection, match=f"The WebSocket of {server.address} cannot be reached"):
        WebSocket(server.address, "/poll/1", "", listener, 5.0)


def test_web_socket_does_not_follow_a_redirect() -> None:
    """The session's cookies belong to the controller."""
    listener = Listener("robapi2_subscription", lambda text: None, lambda sentence: None)
    asked: list[HttpRequest] = []
    with (
        HttpServer(lambda request: asked.append(request) or HttpReply(404), 0) as other,
        HttpServer(lambda _: HttpReply(302, (("Location", f"ws://{other.address}/poll/1"),)), 0) as server,
        pytest.raises(ControllerRefused, match="it answers HTTP 302"),
    ):
        WebSocket(server.address, "/poll/1", "-http-session-=1", listener, 5.0)
    assert asked == []


HANDSHAKE = (
    b"GET /poll/1 HTTP/1.1\r\nHost: x\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: p\r\n\r\n"
)


def connected(server: HttpServer) -> socket.socket:
    return socket.create_connection(("127.0.0.1", server.port), timeout=5.0)


def test_web_socket_is_attached_before_its_client_sees_it_open() -> None:
    is_told: list[bool] = []

    def attach(channel: Channel) -> None:
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
    channels: list[Channel] = []
    with HttpServer(lambda _: Upgrade("p", channels.append), 0) as server, connected(server) as end:
        end.sendall(HANDSHAKE.replace(b"Sec-WebSocket-Key", b"Sec-Key"))
        assert end.recv(4096).startswith(b"HTTP/1.1 400 ")
    assert [channel.is_open for channel in channels] == [False]
