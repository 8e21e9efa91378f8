"""A WebSocket to one controller."""

from __future__ import annotations

import errno
import logging
import socket
import threading
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from time import monotonic
from typing import Protocol

from abb_protocols.catalogue import message, said_by
from abb_protocols.errors import ControllerRefused, MissingPrerequisite, NoConnection
from abb_runtime.process.supervision import no_thread, start_thread

NO_DESCRIPTOR = (errno.EMFILE, errno.ENFILE)
"""The errors of an operating system that permits no further socket."""

_log = logging.getLogger(__name__)

_HEARTBEAT = 10.0
"""Time between two pings on a WebSocket [s]; without an answer within half of it, the connection is lost."""

_CLOSE_TIMEOUT = 0.3  # [s]; websockets waits so long for the peer, twice: its answer, then its end of the connection
_END_TIMEOUT = 0.5  # [s] a thread that has not ended by then is left to itself
_MAX_TEXT = 1024 * 1024


@dataclass(frozen=True, slots=True)
class Listener:
    """Receives what comes on a WebSocket, on the socket's thread.

    Attributes:
        protocol: the sub-protocol that is spoken.
        on_text: called with each message.
        on_lost: called once with the reason why nothing more will come; never after ``close``.
    """

    protocol: str
    on_text: Callable[[str], None]
    on_lost: Callable[[str], None]


class OpenWebSocket(Protocol):
    """An open WebSocket."""

    def close(self) -> None: ...


class WebSocket:
    """A WebSocket at ``address``, open once it is built; ``close`` it when done.

    Args:
        address: of the controller, for the handshake and for errors.
        connect: makes the connection; raises OSError where nothing answers.
        target: path of the WebSocket.
        cookies: of the session, or "".
        listener: receives what comes.
        timeout: until it is open [s].

    Raises:
        NoConnection: nothing answers at the address in time.
        ControllerRefused: what answers does not open a WebSocket.
        MissingPrerequisite: the operating system permits no further thread.
    """

    def __init__(
        self,
        address: str,
        connect: Callable[[], socket.socket],
        target: str,
        cookies: str,
        listener: Listener,
        timeout: float,
    ) -> None:
        from websockets.exceptions import InvalidStatus, WebSocketException  # noqa: PLC0415 - the server needs none
        from websockets.sync import client  # noqa: PLC0415
        from websockets.typing import Subprotocol  # noqa: PLC0415

        self._address = address
        self._listener = listener
        self._is_closed = False
        end: socket.socket | None = None
        try:
            begin, end = monotonic(), connect()
            end.settimeout(None)
            self._connection = ExitStack().enter_context(  # websockets demands a context; close() ends it
                client.connect(
                    f"ws://{address}{target}",
                    sock=end,  # which keeps it from following redirects
                    subprotocols=[Subprotocol(listener.protocol)],
                    additional_headers={"Cookie": cookies} if cookies else None,
                    compression=None,
                    proxy=None,
                    open_timeout=max(0.0, timeout - (monotonic() - begin)),
                    close_timeout=_CLOSE_TIMEOUT,
                    ping_interval=_HEARTBEAT,
                    ping_timeout=_HEARTBEAT / 2,
                    max_size=_MAX_TEXT,
                )
            )
        except Exception as error:
            if end is not None:
                end.close()
            refused = error.__cause__ if isinstance(error, ValueError) else error  # a redirect is a ValueError
            if isinstance(refused, InvalidStatus):
                status = refused.response.status_code
                said = message("websocket_refused", address=address, target=target, status=status)
                raise ControllerRefused(said, status=status) from error
            if isinstance(error, TimeoutError):
                raise NoConnection(message("websocket_not_opened", address=address, timeout=timeout)) from error
            if isinstance(error, OSError) and error.errno in NO_DESCRIPTOR:
                raise NoConnection(message("no_descriptor_for_websocket", address=address)) from error
            if isinstance(error, OSError | WebSocketException):
                raise NoConnection(message("websocket_not_reached", address=address, error=said_by(error))) from error
            if isinstance(error, RuntimeError):
                raise MissingPrerequisite(no_thread("the WebSocket", error)) from error
            raise
        self._thread = threading.Thread(target=self._receive, name="web-socket", daemon=True)
        try:
            start_thread(self._thread)
        except MissingPrerequisite:
            self._connection.close()
            raise

    def close(self) -> None:
        """End the connection; the listener is not called any more."""
        self._is_closed = True
        self._connection.close()
        if threading.current_thread() is not self._thread:
            self._thread.join(_END_TIMEOUT)

    def _receive(self) -> None:
        """Not started again when it fails: the owner hears of the loss, and opens another one."""
        from websockets.exceptions import ConnectionClosed  # noqa: PLC0415

        reason = message("websocket_broke", address=self._address)
        try:
            while True:
                text = self._connection.recv()
                if isinstance(text, str) and not self._is_closed:
                    self._listener.on_text(text)
        except ConnectionClosed as end:
            if end.rcvd is not None:
                reason = message("websocket_closed", address=self._address, number=int(end.rcvd.code))
        except Exception as error:
            _log.error("what listens to %s failed: %s", self._address, error, exc_info=error)
        self._connection.close()
        if not self._is_closed:
            self._is_closed = True
            self._listener.on_lost(str(reason))
