"""Robot Web Services without sockets: requests go straight to the virtual controller, its messages straight back."""

from __future__ import annotations

from yumi.clock import Clock
from yumi.errors import ControllerRefused, NoConnection
from yumi.links.channel import Upgrade
from yumi.links.http import ConnectionLost, HttpReply, HttpRequest, Listener
from yumi.virtual.rws_adapter import RwsAdapter
from yumi.virtual.rws_port import Controller

PASSWORD = "robotics"


class MemoryChannel:
    """A WebSocket's two ends in one."""

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
        """The server's end goes in order."""
        self.abort()


class MemorySocket:
    """The client's end."""

    def __init__(self, channel: MemoryChannel) -> None:
        self._channel = channel

    def close(self) -> None:
        self._channel.has_left = self._channel.is_open
        self._channel.is_open = False


class MemoryHttp:
    """A link to ``controller``; call ``advance`` whenever time has passed.

    Attributes:
        adapter: the controller's end of it.
        is_there: whether there is a controller at all.
        resets: so many exchanges from now on end with a reset connection.
    """

    address = "memory"

    def __init__(self, controller: Controller, clock: Clock) -> None:
        self.adapter = RwsAdapter(controller, user="Default User", password=PASSWORD, hang_up=self._hang_up)
        self.is_there = True
        self.resets = 0
        self._clock = clock
        self._channels: list[MemoryChannel] = []

    def advance(self) -> None:
        self.adapter.advance(self._clock.now())

    def exchange(self, request: HttpRequest, timeout: float) -> HttpReply:
        reply = self._handled(request)
        if reply is None:
            raise ConnectionLost("memory closed the connection without an HTTP answer.")
        assert isinstance(reply, HttpReply)
        return reply

    def open_socket(self, request: HttpRequest, listener: Listener, timeout: float) -> MemorySocket:
        headers = (*request.headers, ("Upgrade", "websocket"), ("Sec-WebSocket-Protocol", listener.protocol))
        reply = self._handled(HttpRequest("GET", request.target, headers, peer="socket"))
        if not isinstance(reply, Upgrade):
            raise ControllerRefused("memory does not open a WebSocket.", status=reply.status if reply else 0)
        channel = MemoryChannel(listener)
        self._channels.append(channel)
        reply.attach(channel)
        return MemorySocket(channel)

    def close(self) -> None:
        """Nothing to close."""

    def _handled(self, request: HttpRequest) -> HttpReply | Upgrade | None:
        if not self.is_there:
            raise NoConnection("Nothing answers in this memory.")
        if self.resets:
            self.resets -= 1
            raise ConnectionLost("The connection was reset.")
        return self.adapter.handle(request, self._clock.now())

    def _hang_up(self) -> None:
        for channel in self._channels:
            channel.abort()
