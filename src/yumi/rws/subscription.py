"""A client's subscription: a group at the controller, its WebSocket, and the changes that come on it.

The client's end of a WebSocket: a thread of its own hands over every text that comes.
"""

from __future__ import annotations

import asyncio
import logging
import socket
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import TypeAlias

import aiohttp

from yumi.errors import ControllerRefused, LoginRefused, NoConnection, ProtocolError, YumiError
from yumi.process.supervision import start_thread
from yumi.rws import requests
from yumi.rws import requests as event_pages
from yumi.rws.http import Headers, HttpReply, Listener
from yumi.rws.requests import PROTOCOL, Change, Resource, read_changes
from yumi.rws.session import RwsSession, Socket

OnChange = Callable[[Change], None]
OnLost = Callable[[str], None]

log = logging.getLogger(__name__)


class Subscription:
    """What ``RwsClient.subscribe`` gives; ``close`` it when it is no longer needed."""

    def __init__(
        self, session: RwsSession, resources: Sequence[Resource], on_change: OnChange, on_lost: OnLost
    ) -> None:
        self._session = session
        self._paths = tuple(resource.path for resource in resources)
        self._on_change = on_change
        self._on_lost = on_lost
        self._group: int | None = None
        self._socket: Socket | None = None

    def open(self, reply: HttpReply) -> None:
        """Pass on the values that ``reply`` holds, and open the WebSocket it names.

        Raises:
            NoConnection: the WebSocket cannot be reached.
            ControllerRefused: the controller does not open it.
            ProtocolError: the answer names none.
        """
        text = reply.body.decode("utf-8", "replace")
        self._group = event_pages.group_of(f"{reply.header('Location') or ''} {text}")
        if self._group is None:
            raise ProtocolError(f"The answer of {self._session.address} to a subscription names no WebSocket.")
        self._tell(text)
        listener = Listener(PROTOCOL, self._tell, self._on_lost)
        try:
            self._socket = self._session.open_socket(f"/poll/{self._group}", listener)
        except YumiError:
            self._end()
            raise

    def close(self) -> None:
        """End the subscription; nothing more is told. A controller that is gone is no reason to complain."""
        if self.hang_up():
            self._end()

    def hang_up(self) -> bool:
        """Leave the WebSocket, without a word to the controller; whether there was one."""
        socket, self._socket = self._socket, None
        if socket is not None:
            socket.close()
        return socket is not None

    def _end(self) -> None:
        try:
            self._session.exchange(requests.unsubscribe(self._group or 0))
        except (NoConnection, LoginRefused, ProtocolError) as error:
            log.debug("no end of a subscription: %s", error)

    def _tell(self, text: str) -> None:
        """Pass on what a message says; one that makes no sense ends nothing."""
        try:
            changes = read_changes(event_pages.read_event(text), self._paths)
        except YumiError as error:
            log.warning("a message of %s makes no sense: %s", self._session.address, error)
            return
        for change in changes:
            self._on_change(change)


HEARTBEAT = 10.0
"""The peer is asked so often whether it lives; without an answer within half of it, it is lost [s]."""

_CLOSE_TIMEOUT = 1.0
_DESCRIPTORS = 4  # of an event loop (three) and the connection
_END_TIMEOUT = 3.0  # [s] a thread that has not ended by then is left to itself
_MAX_TEXT = 1024 * 1024


_Socket: TypeAlias = "aiohttp.ClientWebSocketResponse[bool]"


class WebSocket:
    """A WebSocket at ``address``; ``open`` it once, ``close`` it when done.

    Args:
        address: host and port.
        target: path on it.
        headers: what the request carries beside those of the protocol.
        listener: who hears what comes.
    """

    def __init__(self, address: str, target: str, headers: Headers, listener: Listener) -> None:
        self._address = address
        self._target = target
        self._headers = headers
        self._listener = listener
        self._is_closed = False
        self._timeout = 0.0
        self._response: aiohttp.ClientResponse | None = None
        self._loop: Future[asyncio.AbstractEventLoop] = Future()
        self._ending = asyncio.Event()
        self._thread = threading.Thread(target=self._run, name="web-socket", daemon=True)

    def open(self, timeout: float) -> None:
        """Connect, within ``timeout`` [s].

        Raises:
            NoConnection: nothing answers at the address in time.
            ControllerRefused: what answers does not open a WebSocket.
        """
        self._timeout = timeout
        self._check_descriptors()
        start_thread(self._thread)
        self._loop.result()

    def close(self) -> None:
        """End the connection; the listener is told nothing more."""
        self._is_closed = True
        try:
            self._loop.result().call_soon_threadsafe(self._ending.set)
        except RuntimeError:
            return  # its thread has ended already
        if threading.current_thread() is not self._thread:
            self._thread.join(_END_TIMEOUT)

    def _check_descriptors(self) -> None:
        """An event loop that finds none complains at length, each time; see what it needs beforehand."""
        ends: list[socket.socket] = []
        try:
            for _ in range(_DESCRIPTORS // 2):
                ends += socket.socketpair()
        except OSError as error:
            raise NoConnection(
                f"No file descriptor is left for the WebSocket of {self._address}; raise the limit (ulimit -n)."
            ) from error
        finally:
            for end in ends:
                end.close()

    def _run(self) -> None:
        """Not begun again when it fails: who listens is told of the loss, and opens another one."""
        serving = self._serve()
        try:
            asyncio.run(serving)
        except Exception as error:
            serving.close()
            if not self._loop.done():  # there is no file descriptor left, for example
                self._loop.set_exception(self._why_not(error))
            else:
                log.error("what listens to %s failed: %s", self._address, error, exc_info=error)

    async def _serve(self) -> None:
        trace = aiohttp.TraceConfig()
        trace.on_request_end.append(self._keep_response)
        async with aiohttp.ClientSession(cookie_jar=aiohttp.DummyCookieJar(), trace_configs=[trace]) as session:
            try:
                socket = await asyncio.wait_for(self._connect(session), self._timeout)
            except Exception as error:  # whatever it is, somebody waits for it
                self._loop.set_exception(self._why_not(error))
                return
            self._loop.set_result(asyncio.get_running_loop())
            try:
                await self._hear(socket)
            finally:
                self._drop()
                if not self._is_closed:
                    self._is_closed = True
                    self._listener.on_lost(_why_lost(self._address, socket))

    def _drop(self) -> None:
        if self._response is not None:
            self._response.close()

    async def _keep_response(
        self, session: aiohttp.ClientSession, context: object, end: aiohttp.TraceRequestEndParams
    ) -> None:
        """Keep what holds the connection: aiohttp leaves it open when the peer breaks off."""
        self._response = end.response

    async def _connect(self, session: aiohttp.ClientSession) -> _Socket:
        return await session.ws_connect(
            f"http://{self._address}{self._target}",
            protocols=(self._listener.protocol,),
            headers=list(self._headers),
            timeout=aiohttp.ClientWSTimeout(ws_close=_CLOSE_TIMEOUT),
            heartbeat=HEARTBEAT,
            max_msg_size=_MAX_TEXT,
        )

    async def _hear(self, socket: _Socket) -> None:
        closing = asyncio.create_task(self._close_on_request(socket))
        try:
            async for message in socket:
                if message.type is aiohttp.WSMsgType.TEXT and not self._is_closed:
                    self._listener.on_text(message.data)
        finally:
            closing.cancel()

    async def _close_on_request(self, socket: _Socket) -> None:
        await self._ending.wait()
        await socket.close()

    def _why_not(self, error: Exception) -> Exception:
        if isinstance(error, aiohttp.WSServerHandshakeError):
            return ControllerRefused(
                f"{self._address} does not open a WebSocket at {self._target}: it answers HTTP {error.status}.",
                status=error.status,
            )
        if isinstance(error, asyncio.TimeoutError):
            return NoConnection(f"{self._address} did not open a WebSocket within {self._timeout:.1f} s.")
        if isinstance(error, aiohttp.ClientError | OSError):
            return NoConnection(f"The WebSocket of {self._address} cannot be reached ({error}).")
        return error


def _why_lost(address: str, socket: _Socket) -> str:
    if socket.exception() is None and socket.close_code not in (None, aiohttp.WSCloseCode.ABNORMAL_CLOSURE):
        return f"{address} has closed the WebSocket (code {socket.close_code})."
    return f"The WebSocket of {address} broke."
