"""The HTTP server of the virtual controller, with its WebSockets: it owns the port and asks a function for answers."""

from __future__ import annotations

import asyncio
import re
import socket
import ssl
import struct
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from functools import partial
from threading import Thread

from aiohttp import WSCloseCode, web

from abb_protocols.errors import SettingsError
from virtual_irc5.rws.http import HttpReply, HttpRequest
from virtual_irc5.rws.subscriptions import Upgrade

_Handler = Callable[[HttpRequest], HttpReply | Upgrade | None]
"""Answers with a reply, with a WebSocket, or with None: the connection is broken without an answer."""

_PING = 30.0
"""Period of the WebSocket's pings (reference/rws.md §14.2) [s]."""

_BodyLimit = Callable[[HttpRequest], int]
"""How long the body of a request may be [bytes], decided from its head; 0 leaves it unread."""

_BackgroundWork = Callable[[HttpRequest], "Future[object] | None"]
"""Begins long work that a request needs; the handler is called when it is done. None for none."""

_ORIGIN = re.compile(r"https?://[^/?]*", re.IGNORECASE)
_MAX_BODY = 64 * 1024 * 1024
_KEEP_ALIVE = 300.0  # [s]
_HANG_UP_DELAY = 0.02  # [s]
_GRACE = 0.2  # [s] an answer under way may take when the server stops


class HttpServer:
    """Serves ``handler`` at ``host:port`` in a ``with`` block, once.

    The handler is called on the server's thread, one request at a time; it must answer at once. Port 0 lets
    the system choose: read ``port`` in the block.

    Args:
        handler: answers.
        port: to listen on.
        host: address to listen on.
        body_limit: asked before a body is read; a longer one is answered with 413.
        prepare: called before the handler.
        tls: of HTTPS; None for HTTP.

    Raises:
        SettingsError: the port is not free or not allowed, when the block begins; choose another.
    """

    def __init__(
        self,
        handler: _Handler,
        port: int,
        host: str = "127.0.0.1",
        *,
        body_limit: _BodyLimit = lambda request: _MAX_BODY,
        prepare: _BackgroundWork = lambda request: None,
        tls: ssl.SSLContext | None = None,
    ) -> None:
        self.port = port
        self._handler = handler
        self._body_limit = body_limit
        self._prepare = prepare
        self._host = host
        self._tls = tls
        self._listening: Future[tuple[asyncio.AbstractEventLoop, asyncio.Event]] = Future()
        self._thread = Thread(target=lambda: asyncio.run(self._serve()), name="http-server", daemon=True)

    @property
    def address(self) -> str:
        """Host and port, as a client gives them."""
        return f"{self._host}:{self.port}"

    def __enter__(self) -> HttpServer:
        self._thread.start()
        try:
            self._listening.result()
        except (OSError, OverflowError) as error:
            self._thread.join()
            reason = (isinstance(error, OSError) and error.strerror) or error
            raise SettingsError(
                f"Port {self.port} on {self._host} cannot be opened ({reason}); choose another port."
            ) from error
        return self

    def __exit__(self, *_: object) -> None:
        loop, ending = self._listening.result()
        loop.call_soon_threadsafe(ending.set)
        self._thread.join()

    def hang_up(self) -> None:
        """Break all connections, as a machine does that goes down; the port stays open.

        An answer that is under way is still sent.
        """
        loop, _ = self._listening.result()
        loop.call_soon_threadsafe(loop.call_later, _HANG_UP_DELAY, self._abort_all)

    async def _serve(self) -> None:
        ending = asyncio.Event()
        self._calls = _HttpServerCalls()
        # Without aiohttp's application, whose routes, middlewares and signals cost time in each request.
        server = web.Server(self._answer, access_log=None, keepalive_timeout=_KEEP_ALIVE)
        runner = web.ServerRunner(server, shutdown_timeout=_GRACE)
        self._runner = runner
        try:
            await runner.setup()
            site = web.TCPSite(runner, self._host, self.port, ssl_context=self._tls, reuse_address=True)
            await site.start()
            self.port = runner.addresses[0][1]
            self._listening.set_result((asyncio.get_running_loop(), ending))
            await ending.wait()
        except Exception as error:  # __enter__ raises it
            self._listening.set_exception(error)
        finally:
            await runner.cleanup()

    async def _answer(self, request: web.BaseRequest) -> web.StreamResponse:
        # Only the head is read so far: a request that may not enter is answered without its body.
        headers = tuple(request.headers.items())
        if "Host" not in request.headers:  # of HTTP/1.0; documents name the address that was asked
            headers += (("Host", _address(request, "sockname")),)
        target = request.raw_path
        if not target.startswith("/"):  # through a proxy: the whole URL
            target = _ORIGIN.sub("", target) or "/"
        incoming = HttpRequest(request.method, target, headers, b"", _address(request, "peername"))
        if request.can_read_body:
            incoming = replace(incoming, body=await _body(request, self._body_limit(incoming)))
        preparation = self._prepare(incoming)
        if preparation is not None:
            await asyncio.wrap_future(preparation)
        answer = self._handler(incoming)
        if isinstance(answer, Upgrade):
            websocket = web.WebSocketResponse(protocols=(answer.protocol,), heartbeat=_PING, compress=False)
            for name, value in answer.headers:
                websocket.headers.add(name, value)
            channel = _SocketChannel(websocket, request, self._calls)
            answer.attach(channel)  # before the client sees it open: it gets every event from then on
            await channel.serve()
            return websocket
        if answer is None:
            _cut_off(request.transport)
            return web.Response()
        connection = "Keep-Alive" if request.keep_alive else "close"  # said in both cases, as a controller does
        headers = (*answer.headers, ("Connection", connection))
        return web.Response(status=answer.status, body=answer.body or None, headers=headers)

    def _abort_all(self) -> None:
        server = self._runner.server
        for connection in server.connections if server is not None else ():
            _cut_off(connection.transport)


def _address(request: web.BaseRequest, end: str) -> str:
    """Host and port of one end of a request's connection: ``peername`` or ``sockname``."""
    transport = request.transport
    host, port, *_ = (transport.get_extra_info(end) if transport is not None else None) or ("", 0)
    return f"{host}:{port}"


async def _body(request: web.BaseRequest, limit: int) -> bytes:
    """The body, if it is within the limit; the server discards what is not read.

    A client that waits for permission to send it (``Expect: 100-continue``) gets it only if the body is wanted.

    Raises:
        HTTPRequestEntityTooLarge: it is longer.
    """
    if limit == 0:
        return b""
    body, length = bytearray(), request.content_length or 0
    if length <= limit and request.headers.get("Expect", "").lower() == "100-continue":
        await request.writer.write(b"HTTP/1.1 100 Continue\r\n\r\n")
        request.writer.output_size = 0  # that was not the answer
    while length <= limit:
        part = await request.content.readany()
        if not part:
            return bytes(body)
        body += part
        length = max(length, len(body))
    raise web.HTTPRequestEntityTooLarge(limit, length, text=f"A body may have {limit} bytes here.")


def _cut_off(transport: asyncio.BaseTransport | None) -> None:
    """Break a connection with a reset; what is under way on it is lost."""
    if isinstance(transport, asyncio.Transport):
        end = transport.get_extra_info("socket")
        if end is not None:
            end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        transport.abort()


class _HttpServerCalls:
    """Calls from other threads to the event loop; so many as come together wake it once, since that takes longest."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._waiting: deque[Callable[[], None]] = deque()
        self._is_woken = False

    def submit(self, call: Callable[[], None]) -> None:
        """Have it called soon, after all that were submitted before."""
        self._waiting.append(call)
        if not self._is_woken:
            self._is_woken = True
            self._loop.call_soon_threadsafe(self._run)

    def _run(self) -> None:
        self._is_woken = False  # first: what is submitted from now on wakes the loop again
        while self._waiting:
            self._waiting.popleft()()


class _SocketChannel:
    """The server's end of a WebSocket; messages from before it is open wait until it is."""

    def __init__(self, response: web.WebSocketResponse, request: web.BaseRequest, calls: _HttpServerCalls) -> None:
        self._calls = calls
        self._response = response
        self._request = request
        self._outbox: asyncio.Queue[str | None] = asyncio.Queue()
        self.is_open = True
        self.has_left = False

    def send(self, text: str) -> None:
        self._submit(partial(self._outbox.put_nowait, text))

    def close(self) -> None:
        self._submit(partial(self._outbox.put_nowait, None))

    def abort(self) -> None:
        self._submit(partial(_cut_off, self._request.transport))

    async def serve(self) -> None:
        """Open the WebSocket and send messages until it ends; messages of the client are ignored."""
        try:
            await self._response.prepare(self._request)
            sending = asyncio.create_task(self._send_all())
            try:
                async for _ in self._response:
                    continue
            finally:
                self.has_left = self._response.close_code not in (None, WSCloseCode.ABNORMAL_CLOSURE)
                sending.cancel()
        finally:
            self.is_open = False

    async def _send_all(self) -> None:
        while (text := await self._outbox.get()) is not None:
            try:
                await self._response.send_str(text)
            except ConnectionError:
                return  # the client has gone; the receiving side ends too
        await self._response.close()

    def _submit(self, call: Callable[[], None]) -> None:
        if self.is_open:
            self._calls.submit(call)
