"""A client's subscription: a group at the controller, its WebSocket, and the changes that come on it."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence

import httpx

from yumi.errors import LoginRefused, NoConnection, ProtocolError, YumiError
from yumi.rws.events import PROTOCOL, Change, Resource, group_of, read_changes, read_event
from yumi.rws.session import Request, RwsSession
from yumi.rws.transport import Listener, Socket

OnChange = Callable[[Change], None]
OnLost = Callable[[str], None]

log = logging.getLogger(__name__)


class Subscription:
    """What ``RwsClient.subscribe`` returns; ``close`` it when it is no longer needed."""

    def __init__(
        self, session: RwsSession, resources: Sequence[Resource], on_change: OnChange, on_lost: OnLost
    ) -> None:
        self._session = session
        self._paths = tuple(resource.path for resource in resources)
        self._on_change = on_change
        self._on_lost = on_lost
        self._group = 0
        self._socket: Socket | None = None

    def open(self, reply: httpx.Response) -> None:
        """Pass on the values that ``reply`` holds, and open the WebSocket it names.

        Raises:
            NoConnection: the WebSocket cannot be reached.
            ControllerRefused: the controller does not open it.
            ProtocolError: the reply names none.
        """
        text = reply.content.decode("utf-8", "replace")
        group = group_of(f"{reply.headers.get('Location', '')} {text}")
        if group is None:
            raise ProtocolError(f"The answer of {self._session.address} to a subscription names no WebSocket.")
        self._group = group
        self._pass_on(text)
        try:
            self._socket = self._session.open_socket(f"/poll/{group}", Listener(PROTOCOL, self._pass_on, self._on_lost))
        except YumiError:
            self._unsubscribe()
            raise

    def close(self) -> None:
        """End the subscription; no callback is called any more. A controller that is gone is not an error."""
        if self.disconnect():
            self._unsubscribe()

    def disconnect(self) -> bool:
        """Close the WebSocket without a request to the controller; whether there was one."""
        socket, self._socket = self._socket, None
        if socket is not None:
            socket.close()
        return socket is not None

    def _unsubscribe(self) -> None:
        try:
            self._session.exchange(Request("DELETE", f"/subscription/{self._group}"))
        except (NoConnection, LoginRefused, ProtocolError) as error:
            log.debug("no end of a subscription: %s", error)

    def _pass_on(self, text: str) -> None:
        """Report the changes in a message; one that cannot be read ends nothing."""
        try:
            changes = read_changes(read_event(text), self._paths)
        except YumiError as error:
            log.warning("a message of %s cannot be read: %s", self._session.address, error)
            return
        for change in changes:
            self._on_change(change)
