from __future__ import annotations

import pytest

from yumi.clock import ManualClock
from yumi.errors import ControllerRefused, NoConnection, SettingsError
from yumi.links.http import ConnectionLost, HttpLink, HttpReply, HttpRequest, Listener
from yumi.links.http_server import HttpServer


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


def test_request_nobody_answers_ends_the_connection() -> None:
    with HttpServer(lambda _: None, 0) as server:
        link = HttpLink(server.address, ManualClock())
        with pytest.raises(ConnectionLost, match="closed the connection without an HTTP answer"):
            link.exchange(HttpRequest("GET", "/"), 5.0)
        link.close()


def test_web_socket_that_is_not_granted_is_refused() -> None:
    listener = Listener("robapi2_subscription", lambda text: None, lambda sentence: None)
    with HttpServer(lambda _: HttpReply(404), 0) as server:
        link, sentence = HttpLink(server.address), f"{server.address} does not open a WebSocket at /poll/1"
        with pytest.raises(ControllerRefused, match=f"{sentence}: it answers HTTP 404"):
            link.open_socket(HttpRequest("GET", "/poll/1"), listener, 5.0)
    with pytest.raises(NoConnection, match=f"The WebSocket of {server.address} cannot be reached"):
        link.open_socket(HttpRequest("GET", "/poll/1"), listener, 5.0)
