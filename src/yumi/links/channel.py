"""The server's end of a WebSocket, for whoever has something to say on it, from any thread."""

from __future__ import annotations

import asyncio
import socket
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeVar

from aiohttp import WSCloseCode, web

_T = TypeVar("_T")


class Channel(Protocol):
    """Carries texts to one client."""

    @property
    def is_open(self) -> bool: ...

    @property
    def has_left(self) -> bool:
        """Whether the client has ended the connection in order."""

    def send(self, text: str) -> None:
        """Send a message; it is lost when the channel is closed."""

    def close(self) -> None:
        """End the connection in order."""

    def abort(self) -> None:
        """Cut the connection off."""


@dataclass(frozen=True, slots=True)
class Upgrade:
    """The answer to a request that opens a WebSocket.

    Attributes:
        protocol: the sub-protocol that is spoken.
        attach: gets the channel before the client is told that it is open, on the server's thread.
        headers: names and values beside those of the protocol.
    """

    protocol: str
    attach: Callable[[Channel], None]
    headers: tuple[tuple[str, str], ...] = ()


def cut_off(transport: asyncio.BaseTransport | None) -> None:
    """Cut a connection off with a reset; what is under way on it is lost."""
    if isinstance(transport, asyncio.Transport):
        end = transport.get_extra_info("socket")
        if end is not None:
            end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        transport.abort()


class SocketChannel:
    """A WebSocket of a running server: takes what there is to say before it is open already, and sends it then.

    Args:
        response: the WebSocket, not prepared yet.
        request: which asks for it.
    """

    def __init__(self, response: web.WebSocketResponse, request: web.Request) -> None:
        self._loop = asyncio.get_running_loop()
        self._response = response
        self._request = request
        self._outbox: asyncio.Queue[str | None] = asyncio.Queue()
        self.is_open = True
        self.has_left = False

    def send(self, text: str) -> None:
        self._on_loop(self._outbox.put_nowait, text)

    def close(self) -> None:
        self._on_loop(self._outbox.put_nowait, None)

    def abort(self) -> None:
        self._on_loop(cut_off, self._request.transport)

    async def serve(self) -> None:
        """Open the WebSocket and send what there is to send until it ends; what the client says means nothing."""
        try:
            await self._response.prepare(self._request)
            await self._talk()
        finally:
            self.is_open = False

    async def _talk(self) -> None:
        sending = asyncio.create_task(self._send_all())
        try:
            async for _ in self._response:
                continue
        finally:
            self.has_left = self._response.close_code not in (None, WSCloseCode.ABNORMAL_CLOSURE)
            sending.cancel()

    async def _send_all(self) -> None:
        while (text := await self._outbox.get()) is not None:
            try:
                await self._response.send_str(text)
            except ConnectionError:
                return  # the client has gone, which the receiving side notices, too
        await self._response.close()

    def _on_loop(self, call: Callable[[_T], None], argument: _T) -> None:
        if self.is_open:
            self._loop.call_soon_threadsafe(call, argument)
