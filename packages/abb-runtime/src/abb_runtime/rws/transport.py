"""The transport to one controller: HTTP, in which every exchange has one deadline for all that it does.

The timeouts of HTTP libraries are for each read, so that a peer which sends a byte now and then is waited for
endlessly. Here each operation on the socket gets what is left until the :class:`ExchangeDeadline` of the exchange. h11
makes bytes of requests and responses of bytes.
"""

from __future__ import annotations

import re
import socket
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from math import inf
from threading import Lock
from typing import Protocol
from urllib.parse import urlsplit

import h11
import httpx

from abb_protocols.catalogue import Message, message, said_by
from abb_protocols.errors import NoConnection, ProtocolError, SettingsError
from abb_runtime.clock import Clock, SystemClock
from abb_runtime.rws.web_socket import NO_DESCRIPTOR, Listener, OpenWebSocket, WebSocket

EXCHANGE_INTERVAL = 0.051
"""Mean time between two requests [s]; a controller wants fewer than twenty a second (reference/rws.md §1.1)."""

_HOST = re.compile(r"[0-9A-Za-z._-]+|[0-9a-f:.]+(%[\w.-]+)?")  # a name, IPv4, or IPv6
_KEEP_ALIVE = 280.0  # [s]; below the five minutes after which a controller forgets an idle session
_MAX_BODY = 64 * 1024 * 1024
_MAX_HEAD = 256 * 1024  # of a response, with all interim responses (1xx) before it
_MAX_LINES = 100 * 1024  # of one response's head; what is longer is no HTTP
_READ_AT_ONCE = 64 * 1024


class ConnectionLost(NoConnection):
    """The connection broke during an exchange; whether the request was carried out is unknown."""


class AnswerTimeout(NoConnection):
    """The peer took the connection, but its response did not come, or did not end, in time."""


@dataclass(frozen=True, slots=True)
class ExchangeDeadline:
    """When an exchange has to end; the extension ``deadline`` of its request.

    Attributes:
        end: at the latest [s].
        stall: what carries a file ends earlier when nothing of it goes or comes for so long [s].
    """

    end: float
    stall: float = inf

    def after(self, last: float) -> float:
        """When the next part has to have gone or come, after that of ``last`` [s]."""
        return min(self.end, last + self.stall)


class Transport(Protocol):
    """Carries two exchanges at a time; :class:`HttpTransport` is one."""

    @property
    def address(self) -> str: ...

    @property
    def request_interval(self) -> float:
        """Shortest mean time between two requests [s]; 0 is no limit."""

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        """The complete response; raises ConnectionLost, NoConnection or ProtocolError."""

    def open_socket(self, target: str, cookies: str, listener: Listener, timeout: float) -> OpenWebSocket:
        """A WebSocket on a connection of its own, within ``timeout`` [s]."""

    def close(self) -> None:
        """Close the connections, and end the exchanges under way."""


class HttpTransport(httpx.BaseTransport):
    """Keep-alive connections to ``address``, which is a host name or IP address, with ``:port`` if not 80.

    Nothing happens before the first exchange; ``close`` when done. Each exchange has a connection of its own; safe from
    any thread. A host name is looked up once: the address stays the same for the transport's life, as it does for EGM.
    No proxy of the environment is used, and no redirect is followed.

    Args:
        address: of the controller.
        clock: what deadlines are counted by.

    Raises:
        SettingsError: the address is not one.
    """

    request_interval = EXCHANGE_INTERVAL

    def __init__(self, address: str, clock: Clock | None = None) -> None:
        self.address = address
        check_address(address)
        self._clock = clock or SystemClock()
        self._hosts: list[str] = []
        self._lock = Lock()
        self._connections: set[_Connection] = set()
        self._idle: list[_Connection] = []  # the one used last at the end

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        """The complete response, at the deadline of the request at the latest.

        Raises:
            ConnectionLost: the connection broke after it was made.
            AnswerTimeout: the response did not end in time.
            NoConnection: nothing answers at the address in time.
            ProtocolError: what answers does not speak HTTP, or the request cannot be put into it.
        """
        deadline: ExchangeDeadline = request.extensions["deadline"]
        connection = self._idle_connection() or self._new_connection(request.url, deadline)
        try:
            return connection.exchange(request, deadline)
        finally:
            with self._lock:
                if connection.is_reusable and connection in self._connections:
                    self._idle.append(connection)
                else:
                    self._drop(connection)

    def open_socket(self, target: str, cookies: str, listener: Listener, timeout: float) -> WebSocket:
        """A WebSocket at the path ``target``, on a connection of its own.

        Raises:
            NoConnection: nothing answers at the address in time.
            ControllerRefused: what answers does not open a WebSocket.
        """
        url, end = httpx.URL(f"http://{self.address}"), self._clock.now() + timeout
        connect = partial(self._connect, url.host, url.port or 80, end)
        return WebSocket(self.address, connect, target, cookies, listener, timeout)

    def close(self) -> None:
        """Close the connections; exchanges under way end at once, another one opens a new connection."""
        with self._lock:
            self._idle.clear()
            for each in list(self._connections):
                self._drop(each)

    def _idle_connection(self) -> _Connection | None:
        with self._lock:
            while self._idle:
                connection = self._idle.pop()
                if connection.is_alive:
                    return connection
                self._drop(connection)
        return None

    def _new_connection(self, url: httpx.URL, deadline: ExchangeDeadline) -> _Connection:
        end = deadline.after(begin := self._clock.now())
        try:
            connected = self._connect(url.host, url.port or 80, end)
        except TimeoutError as error:
            raise NoConnection(message("nothing_at_address", address=self.address, timeout=end - begin)) from error
        except (OSError, UnicodeError) as error:
            raise NoConnection(_why_no_connection(self.address, error)) from error
        connection = _Connection(connected, self._clock, self.address)
        with self._lock:
            self._connections.add(connection)
        return connection

    def _connect(self, host: str, port: int, end: float) -> socket.socket:
        if not self._hosts:
            self._hosts = [str(place[0]) for *_, place in socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)]
        *others, last = self._hosts
        for number, each in enumerate(others):
            share = _left(end, self._clock) / (len(self._hosts) - number)  # all that an unreachable address may take
            with suppress(OSError):
                return socket.create_connection((each, port), share)
        return socket.create_connection((last, port), _left(end, self._clock))

    def _drop(self, connection: _Connection) -> None:
        self._connections.discard(connection)
        connection.close()


class _Connection:
    """One connection to a controller, for one exchange after the other."""

    def __init__(self, connected: socket.socket, clock: Clock, address: str) -> None:
        connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket = connected
        self._clock = clock
        self._address = address
        self._http = h11.Connection(h11.CLIENT, max_incomplete_event_size=_MAX_LINES)
        self._head_left = inf  # of a response, while it comes [bytes]
        self._used_at = clock.now()

    @property
    def is_reusable(self) -> bool:
        """Whether another exchange may follow on it."""
        return self._http.our_state is h11.IDLE

    @property
    def is_alive(self) -> bool:
        """Whether the peer has not closed it since, nor forgets it soon."""
        try:
            self._socket.settimeout(0.0)
            self._socket.recv(1, socket.MSG_PEEK)  # its end, or what was not asked for
        except BlockingIOError:
            return self._clock.now() - self._used_at < _KEEP_ALIVE
        except OSError:
            return False
        return False

    def exchange(self, request: httpx.Request, deadline: ExchangeDeadline) -> httpx.Response:
        """The complete response; raises what :meth:`HttpTransport.handle_request` does."""
        begin, head, body = self._clock.now(), None, bytearray()
        try:
            self._send(request, deadline)
            end, self._head_left = deadline.after(self._clock.now()), _MAX_HEAD
            while not isinstance(event := self._next_event(end), h11.Response):
                continue  # 1xx
            head, self._head_left = event, inf
            while isinstance(event := self._next_event(deadline.after(self._clock.now())), h11.Data):
                body += event.data
                if len(body) > _MAX_BODY:
                    raise ProtocolError(message("answer_too_long", address=self._address, most=_MAX_BODY))
            if self._http.our_state is self._http.their_state is h11.DONE:
                self._http.start_next_cycle()
        except TimeoutError as error:
            if head is not None:
                raise AnswerTimeout(message("answer_not_ended", address=self._address)) from error
            timeout = deadline.after(begin) - begin
            raise AnswerTimeout(message("no_answer_to_request", address=self._address, timeout=timeout)) from error
        except h11.LocalProtocolError as error:
            raise ProtocolError(message("request_not_http", address=self._address, error=said_by(error))) from error
        except h11.RemoteProtocolError as error:
            raise ProtocolError(message("no_http_spoken", address=self._address)) from error
        except OSError as error:
            raise ConnectionLost(message("no_http_answer", address=self._address)) from error
        self._used_at = self._clock.now()
        # A controller compresses nothing; what another peer compresses is left as it is, so that it cannot explode.
        headers = [(name, value) for name, value in head.headers if name != b"content-encoding"]
        return httpx.Response(head.status_code, headers=headers, content=bytes(body))

    def close(self) -> None:
        with suppress(OSError):  # the peer has closed it already
            self._socket.shutdown(socket.SHUT_RDWR)  # wakes a thread that reads, which closing alone does not do
        self._socket.close()

    def _send(self, request: httpx.Request, deadline: ExchangeDeadline) -> None:
        head = h11.Request(method=request.method, target=request.url.raw_path, headers=request.headers.raw)
        parts = (self._http.send(each) for each in (head, h11.Data(request.read()), h11.EndOfMessage()))
        rest = memoryview(b"".join(part or b"" for part in parts))
        while rest:  # sendall would give all of it the time of one part
            self._socket.settimeout(_left(deadline.after(self._clock.now()), self._clock))
            rest = rest[self._socket.send(rest) :]

    def _next_event(self, end: float) -> object:
        while (event := self._http.next_event()) is h11.NEED_DATA:
            self._socket.settimeout(_left(end, self._clock))
            data = self._socket.recv(_READ_AT_ONCE)
            if not data and self._http.their_state is h11.SEND_RESPONSE:
                raise ConnectionResetError("the peer hung up instead of answering")
            self._head_left -= len(data)
            if self._head_left < 0:
                raise ProtocolError(message("answer_head_too_long", address=self._address, most=_MAX_HEAD))
            self._http.receive_data(data)
        return event


def _left(end: float, clock: Clock) -> float:
    """The time until ``end`` [s]; raises TimeoutError when there is none."""
    left = end - clock.now()
    if left <= 0.0:
        raise TimeoutError("no time is left")
    return left


def _why_no_connection(address: str, error: OSError | UnicodeError) -> Message:
    if isinstance(error, socket.gaierror | UnicodeError):
        return message("address_unknown", address=address)
    if isinstance(error, ConnectionRefusedError):
        return message("connection_refused", address=address)
    if error.errno in NO_DESCRIPTOR:
        return message("no_descriptor_for_connection", address=address)
    return message("address_not_reached", address=address, error=said_by(error))


def check_address(address: str) -> None:
    """That it is a host with or without a port; raises SettingsError."""
    try:
        parts = urlsplit(f"//{address}")
        host, _ = parts.hostname, parts.port
        if host and _HOST.fullmatch(host) and parts.netloc == address and not parts.username:
            httpx.URL(f"http://{address}")
            return
    except (ValueError, httpx.InvalidURL):
        pass
    raise SettingsError(message("no_address", address=address))
