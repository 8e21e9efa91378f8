"""HTTP and WebSockets to one controller; every exchange has one deadline for all that it does.

httpx and httpcore have timeouts for each read, so that a peer which sends a byte now and then is waited for endlessly.
Here the timeout of a request is the time at which its exchange ends (``until``), and each operation on the socket gets
what is left of it. A file may take as long as it needs: its deadline begins anew with each part that goes or comes.
"""

from __future__ import annotations

import errno
import logging
import re
import socket
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from time import monotonic
from typing import Any, Protocol
from urllib.parse import urlsplit

import h11
import httpcore
import httpx

from yumi.catalogue import Message, message, said_by
from yumi.clock import Clock, SystemClock
from yumi.errors import ControllerRefused, MissingPrerequisite, NoConnection, ProtocolError, SettingsError
from yumi.process.supervision import no_thread, start_thread

INTERVAL = 0.051
"""Mean time between two requests [s]; a controller wants fewer than twenty a second (reference/rws.md §1.1)."""

_HOST = re.compile(r"[0-9A-Za-z._-]+|[0-9a-f:.]+(%[\w.-]+)?")  # a name, IPv4, or IPv6
_KEEP_ALIVE = 280.0  # [s]; below the five minutes after which a controller forgets an idle session
_MAX_BODY = 64 * 1024 * 1024
_MAX_HEAD = 256 * 1024  # of a response, with all interim responses (1xx) before it
_CONNECTIONS = 2
_NO_DESCRIPTOR = (errno.EMFILE, errno.ENFILE)

log = logging.getLogger(__name__)


class ConnectionLost(NoConnection):
    """The connection broke during an exchange; whether the request was carried out is unknown."""


class AnswerTimeout(NoConnection):
    """The peer took the connection, but its response did not come, or did not end, in time."""


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


class Socket(Protocol):
    """An open WebSocket."""

    def close(self) -> None: ...


class TransferDeadline(float):
    """The end of an exchange that carries a file; it ends earlier when nothing goes or comes for ``stall`` [s]."""

    stall: float

    def __new__(cls, end: float, stall: float) -> TransferDeadline:
        deadline = super().__new__(cls, end)
        deadline.stall = stall
        return deadline


def until(deadline: float, timeout: float) -> dict[str, Any]:
    """The extensions of a request whose exchange must end at ``deadline``; it waits ``timeout`` [s] for its turn.

    With a :class:`TransferDeadline` the content of the request and of the response take as long as they need.
    """
    return {"timeout": {"connect": deadline, "read": deadline, "write": deadline, "pool": timeout}}


class HttpTransport(httpx.BaseTransport):
    """Keep-alive connections to ``address``, which is a host name or IP address, with ``:port`` if not 80.

    Nothing happens before the first exchange; ``close`` when done. Two exchanges may be under way at once, each on a
    connection of its own; safe from any thread. A host name is looked up once: the address stays the same for the
    transport's life, as it does for EGM. No proxy of the environment is used, and no redirect is followed.

    Args:
        address: of the controller.
        clock: what timeouts are counted by.
        request_interval: shortest mean time between two requests [s]; 0 is no limit.

    Raises:
        SettingsError: the address is not one.
    """

    def __init__(self, address: str, clock: Clock | None = None, request_interval: float = INTERVAL) -> None:
        self.address = address
        self.request_interval = request_interval
        _check_address(address)
        self._backend = _Backend(clock or SystemClock(), address)
        self._pool = self._new_pool()

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        """The complete response, at the time given by :func:`until` at the latest.

        Raises:
            ConnectionLost: the connection broke after it was made.
            AnswerTimeout: the response did not end in time.
            NoConnection: nothing answers at the address in time.
            ProtocolError: what answers does not speak HTTP, or the request cannot be put into it.
        """
        url = request.url
        with _converted_errors(self.address, request.extensions["timeout"]["pool"]):
            response = self._pool.handle_request(
                httpcore.Request(
                    request.method,
                    httpcore.URL(scheme=url.raw_scheme, host=url.raw_host, port=url.port or 80, target=url.raw_path),
                    headers=request.headers.raw,
                    content=request.read(),
                    extensions=request.extensions,
                )
            )
            stream: _Stream = response.extensions["network_stream"]
            stream.head_left = None  # the head is complete
            body = bytearray()
            try:
                for chunk in response.iter_stream():
                    body += chunk
                    if len(body) > _MAX_BODY:
                        raise ProtocolError(message("answer_too_long", address=self.address, most=_MAX_BODY))
            except httpcore.ReadTimeout as error:
                raise AnswerTimeout(message("answer_not_ended", address=self.address)) from error
            finally:
                response.close()
        # A controller compresses nothing; what another peer compresses is left as it is, so that it cannot explode.
        headers = [(name, value) for name, value in response.headers if name.lower() != b"content-encoding"]
        return httpx.Response(response.status, headers=headers, content=bytes(body))

    def open_socket(self, target: str, cookies: str, listener: Listener, timeout: float) -> WebSocket:
        """A WebSocket at the path ``target``, on a connection of its own.

        Raises:
            NoConnection: nothing answers at the address in time.
            ControllerRefused: what answers does not open a WebSocket.
        """
        return WebSocket(self.address, target, cookies, listener, timeout)

    def close(self) -> None:
        """Close the connections; exchanges under way end at once, another one opens a new connection."""
        pool, self._pool = self._pool, self._new_pool()
        pool.close()

    def _new_pool(self) -> httpcore.ConnectionPool:
        return httpcore.ConnectionPool(
            max_connections=_CONNECTIONS, keepalive_expiry=_KEEP_ALIVE, network_backend=self._backend
        )


class _Backend(httpcore.NetworkBackend):
    """Opens connections; the timeouts of their reads and writes are the deadline of the exchange."""

    def __init__(self, clock: Clock, address: str) -> None:
        self._clock = clock
        self._address = address
        self._system = httpcore.SyncBackend()
        self._hosts: list[str] = []

    def connect_tcp(
        self,
        host: str,
        port: int,
        timeout: float | None = None,
        local_address: str | None = None,
        socket_options: Iterable[Any] | None = None,
    ) -> _Stream:
        assert timeout is not None, "every exchange has a deadline"
        deadline = timeout
        if isinstance(timeout, TransferDeadline):
            deadline = min(timeout, self._clock.now() + timeout.stall)
        if not self._hosts:
            try:
                found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
            except (OSError, UnicodeError) as error:  # an unknown name, or no file descriptor for asking
                raise httpcore.ConnectError(str(error)) from error
            self._hosts = [str(place[0]) for *_, place in found]
        *others, last = self._hosts
        for each in others:
            with suppress(httpcore.ConnectError, httpcore.ConnectTimeout):
                return self._connect(each, port, deadline)
        return self._connect(last, port, deadline)

    def _connect(self, host: str, port: int, deadline: float) -> _Stream:
        left = deadline - self._clock.now()
        if left <= 0.0:
            raise httpcore.ConnectTimeout("no time is left")
        return _Stream(self._system.connect_tcp(host, port, left), self._clock, self._address)


class _Stream(httpcore.NetworkStream):
    """A connection whose reads and writes end at a deadline, see :class:`_Backend`.

    Attributes:
        head_left: how long the head of the response may still become [byte]; None once it is complete.
    """

    def __init__(self, stream: httpcore.NetworkStream, clock: Clock, address: str) -> None:
        self.head_left: int | None = None
        self._stream = stream
        self._socket: socket.socket = stream.get_extra_info("socket")
        self._clock = clock
        self._address = address
        self._sent_at = clock.now()

    def read(self, max_bytes: int, timeout: float | None = None) -> bytes:
        left = self._left(timeout, is_content=self.head_left is None)
        if left <= 0.0:
            raise httpcore.ReadTimeout("no time is left")
        data = self._stream.read(max_bytes, left)
        if self.head_left is not None:
            self.head_left -= len(data)
            if self.head_left < 0:
                raise ProtocolError(message("answer_head_too_long", address=self._address, most=_MAX_HEAD))
        return data

    def write(self, buffer: bytes, timeout: float | None = None) -> None:
        self.head_left = _MAX_HEAD
        rest = memoryview(buffer)
        try:
            while rest:  # httpcore's own stream would begin the timeout again with each part that is sent
                left = self._left(timeout, is_content=True)
                if left <= 0.0:
                    raise httpcore.WriteTimeout("no time is left")
                self._socket.settimeout(left)
                rest = rest[self._socket.send(rest) :]
                self._sent_at = self._clock.now()
        except TimeoutError as error:
            raise httpcore.WriteTimeout(str(error)) from error
        except OSError as error:
            raise httpcore.WriteError(str(error)) from error

    def _left(self, deadline: float | None, *, is_content: bool) -> float:
        """Time until an operation has to end [s]; the head of a response has one deadline however slowly it comes."""
        assert deadline is not None, "every exchange has a deadline"
        left = deadline - self._clock.now()
        if not isinstance(deadline, TransferDeadline):
            return left
        return min(left, deadline.stall if is_content else self._sent_at + deadline.stall - self._clock.now())

    def close(self) -> None:
        with suppress(OSError):  # the peer has closed it already
            self._socket.shutdown(socket.SHUT_RDWR)  # wakes a thread that reads, which closing alone does not do
        self._stream.close()

    def get_extra_info(self, info: str) -> Any:
        return self._stream.get_extra_info(info)


HEARTBEAT = 10.0
"""Time between two pings on a WebSocket [s]; without an answer within half of it, the connection is lost."""

_CLOSE_TIMEOUT = 0.3  # [s]; websockets waits so long for the peer, twice: its answer, then its end of the connection
_END_TIMEOUT = 0.5  # [s] a thread that has not ended by then is left to itself
_MAX_TEXT = 1024 * 1024


class WebSocket:
    """A WebSocket at ``address``, open once it is built; ``close`` it when done.

    Raises:
        NoConnection: nothing answers at the address in time.
        ControllerRefused: what answers does not open a WebSocket.
        MissingPrerequisite: the operating system permits no further thread.
    """

    def __init__(self, address: str, target: str, cookies: str, listener: Listener, timeout: float) -> None:
        from websockets.exceptions import InvalidStatus, WebSocketException  # noqa: PLC0415 - the server needs none
        from websockets.sync.client import connect  # noqa: PLC0415
        from websockets.typing import Subprotocol  # noqa: PLC0415

        self._address = address
        self._listener = listener
        self._is_closed = False
        end: socket.socket | None = None
        try:
            begin, url = monotonic(), httpx.URL(f"http://{address}")
            end = socket.create_connection((url.host, url.port or 80), timeout)
            end.settimeout(None)
            self._connection = ExitStack().enter_context(  # websockets demands a context; close() ends it
                connect(
                    f"ws://{address}{target}",
                    sock=end,  # which keeps it from following redirects
                    subprotocols=[Subprotocol(listener.protocol)],
                    additional_headers={"Cookie": cookies} if cookies else None,
                    compression=None,
                    proxy=None,
                    open_timeout=max(0.0, timeout - (monotonic() - begin)),
                    close_timeout=_CLOSE_TIMEOUT,
                    ping_interval=HEARTBEAT,
                    ping_timeout=HEARTBEAT / 2,
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
            if isinstance(error, OSError) and error.errno in _NO_DESCRIPTOR:
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
            log.error("what listens to %s failed: %s", self._address, error, exc_info=error)
        self._connection.close()
        if not self._is_closed:
            self._is_closed = True
            self._listener.on_lost(str(reason))


@contextmanager
def _converted_errors(address: str, timeout: float) -> Iterator[None]:
    try:
        yield
    except httpcore.ConnectTimeout as error:
        raise NoConnection(message("nothing_at_address", address=address, timeout=timeout)) from error
    except httpcore.TimeoutException as error:
        raise AnswerTimeout(message("no_answer_to_request", address=address, timeout=timeout)) from error
    except httpcore.ConnectError as error:
        raise NoConnection(_why_no_connection(address, error)) from error
    except httpcore.LocalProtocolError as error:
        raise ProtocolError(message("request_not_http", address=address, error=said_by(error))) from error
    except (httpcore.NetworkError, httpcore.RemoteProtocolError) as error:
        if any(isinstance(each, h11.RemoteProtocolError) for each in _origins(error)):
            raise ProtocolError(message("no_http_spoken", address=address)) from error
        raise ConnectionLost(message("no_http_answer", address=address)) from error


def _why_no_connection(address: str, error: httpcore.ConnectError) -> Message:
    *_, root = _origins(error)
    if isinstance(root, socket.gaierror | UnicodeError):
        return message("address_unknown", address=address)
    if isinstance(root, ConnectionRefusedError):
        return message("connection_refused", address=address)
    if isinstance(root, OSError) and root.errno in _NO_DESCRIPTOR:
        return message("no_descriptor_for_connection", address=address)
    return message("address_not_reached", address=address, error=said_by(root))


def _origins(error: BaseException | None) -> Iterator[BaseException]:
    """The exception and all it was converted from."""
    while error is not None:
        yield error
        error = error.__cause__ or error.__context__


def _check_address(address: str) -> None:
    try:
        parts = urlsplit(f"//{address}")
        host, _ = parts.hostname, parts.port
        if host and _HOST.fullmatch(host) and parts.netloc == address and not parts.username:
            httpx.URL(f"http://{address}")
            return
    except (ValueError, httpx.InvalidURL):
        pass
    raise SettingsError(message("no_address", address=address))
