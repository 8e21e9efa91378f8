"""The connection of the page to a driver, where both come and go."""

from __future__ import annotations

import asyncio
import socket
from threading import Event

import pytest

from yumi.web import driver_link
from yumi.web.driver_link import DriverLink


def test_page_that_ends_while_it_connects_leaves_no_socket_open(monkeypatch: pytest.MonkeyPatch) -> None:
    here, there = socket.socketpair()
    begun, ended = Event(), Event()

    def connect_slowly(path: object) -> socket.socket:
        begun.set()
        assert ended.wait(10.0)
        return here

    monkeypatch.setattr(driver_link, "find_driver", lambda robot: robot)
    monkeypatch.setattr(driver_link, "connect_driver", connect_slowly)

    async def connect() -> None:
        try:
            await DriverLink.open()
        finally:
            ended.set()

    async def page() -> None:
        connecting = asyncio.create_task(connect())
        await asyncio.to_thread(begun.wait)
        assert not connecting.done()

    with there:
        asyncio.run(page())
        assert here.fileno() == -1
