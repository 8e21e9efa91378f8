"""Robot Web Services of a virtual controller in memory: between a client and the controller is no socket."""

from __future__ import annotations

from threading import RLock

import httpx

from abb_protocols.catalogue import message
from abb_protocols.errors import ControllerRefused
from abb_runtime.clock import Clock
from abb_runtime.rws.client import DEFAULT_PASSWORD, DEFAULT_USER
from abb_runtime.rws.transport import ConnectionLost
from abb_runtime.rws.web_socket import Listener
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.rws.http import HttpReply, HttpRequest
from virtual_irc5.rws.rws_service import RwsService
from virtual_irc5.rws.subscriptions import Upgrade


class MemoryChannel:
    """The controller's end of a WebSocket."""

    def __init__(self, listener: Listener) -> None:
        self.is_open = True
        self.has_left = False
        self._listener = listener

    def send(self, text: str) -> None:
        if self.is_open:
            self._listener.on_text(text)

    def abort(self) -> None:
        if self.is_open:
            self.is_open = False
            self._listener.on_lost("The WebSocket of memory broke.")

    def close(self) -> None:
        """The controller's end goes in order."""
        self.abort()


class MemorySocket:
    """The client's end."""

    def __init__(self, channel: MemoryChannel) -> None:
        self._channel = channel

    def close(self) -> None:
        self._channel.has_left = self._channel.is_open
        self._channel.is_open = False


class MemoryRws:
    """A transport to ``controller``; call ``advance`` whenever time has passed.

    Args:
        controller: the virtual one.
        clock: of both ends.

    Attributes:
        adapter: the controller's end of it.
        lock: held while the controller answers, to one thread after another; who lets time go by on the controller
            beside other threads holds it for each cycle, too.
    """

    address = "memory"
    request_interval = 0.0

    def __init__(self, controller: Irc5, clock: Clock) -> None:
        self.adapter = RwsService(controller, user=DEFAULT_USER, password=DEFAULT_PASSWORD, hang_up=self.hang_up)
        self._clock = clock
        self._channels: list[MemoryChannel] = []
        self.lock = RLock()

    def advance(self) -> None:
        """Send what has changed to the subscribers."""
        with self.lock:
            self.adapter.advance(self._clock.now())

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        """The response, at once; raises ConnectionLost when there is none."""
        target = request.url.raw_path.decode("ascii")
        reply = self.handle(HttpRequest(request.method, target, tuple(request.headers.items()), request.read()))
        if not isinstance(reply, HttpReply):
            raise ConnectionLost(message("memory_gave_no_answer"))
        headers = httpx.Headers(list(reply.headers), encoding="utf-8")
        return httpx.Response(reply.status, headers=headers, content=reply.body)

    def open_socket(self, target: str, cookies: str, listener: Listener, timeout: float) -> MemorySocket:
        """A WebSocket; raises ControllerRefused when the controller opens none."""
        headers = (("Cookie", cookies), ("Upgrade", "websocket"), ("Sec-WebSocket-Protocol", listener.protocol))
        reply = self.handle(HttpRequest("GET", target, headers, peer="socket"))
        if not isinstance(reply, Upgrade):
            raise ControllerRefused(message("memory_opened_no_websocket"), status=reply.status if reply else 0)
        channel = MemoryChannel(listener)
        self._channels.append(channel)
        reply.attach(channel)
        return MemorySocket(channel)

    def handle(self, request: HttpRequest) -> HttpReply | Upgrade | None:
        """What the controller makes of a request; None closes the connection."""
        with self.lock:
            return self.adapter.handle(request, self._clock.now())

    def hang_up(self) -> None:
        """The controller breaks all WebSockets."""
        for channel in self._channels:
            channel.abort()

    def close(self) -> None:
        """Nothing to close."""
