"""A client's subscription: a group at the controller, its WebSocket, and the changes that come on it."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence

from yumi.errors import LoginRefused, NoConnection, ProtocolError, YumiError
from yumi.hardware.rws_session import RwsSession, Socket
from yumi.links.http import HttpReply, Listener
from yumi.rws import event_pages, requests
from yumi.rws.subscriptions import PROTOCOL, Change, Resource, read_changes

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
