from __future__ import annotations

import pytest

from yumi.errors import SettingsError
from yumi.links.http import HttpReply
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
