"""Robot Web Services without sockets, to a controller that may be gone or break connections."""

from __future__ import annotations

from abb_protocols.errors import NoConnection
from abb_runtime.clock import Clock
from abb_runtime.rws.transport import ConnectionLost
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.rws.http import HttpReply, HttpRequest
from virtual_irc5.rws.subscriptions import Upgrade
from virtual_irc5.testing.memory_rws import MemoryChannel, MemoryRws, MemorySocket

__all__ = ["PASSWORD", "MemoryChannel", "MemoryHttp", "MemorySocket"]

PASSWORD = "robotics"


class MemoryHttp(MemoryRws):
    """A transport to ``controller``; call ``advance`` whenever time has passed.

    Attributes:
        is_there: whether there is a controller at all.
        resets: so many exchanges from now on end with a reset connection.
    """

    def __init__(self, controller: Irc5, clock: Clock, request_interval: float = 0.0) -> None:
        super().__init__(controller, clock)
        self.request_interval = request_interval
        self.is_there = True
        self.resets = 0

    def handle(self, request: HttpRequest) -> HttpReply | Upgrade | None:
        if not self.is_there:
            raise NoConnection("Nothing answers in this memory.")
        if self.resets:
            self.resets -= 1
            raise ConnectionLost("The connection was reset.")
        return super().handle(request)
