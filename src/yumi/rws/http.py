"""One HTTP/1.1 connection to a controller, and the values that cross it in either direction.

The transport knows nothing of logins or cookies: whoever uses it puts them into the headers.
"""

from __future__ import annotations

import errno
import re
import socket
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import h11
import httpcore

from yumi.clock import Clock, SystemClock
from yumi.errors import NoConnection, ProtocolError, SettingsError

if TYPE_CHECKING:
    from yumi.rws.subscription import WebSocket

Headers = tuple[tuple[str, str], ...]

_HOST = re.compile(r"[0-9A-Za-z._-]+|[0-9a-f:.]+(%[\w.-]+)?")  # a name, IPv4, or IPv6
_KEEP_ALIVE = 280.0  # [s]; below the five minutes after which a controller forgets an idle session
_MAX_BODY = 64 * 1024 * 1024
_MAX_HEAD = 256 * 1024  # of an answer, with all interim answers (1xx) before it
_CONNECTIONS = 2


class ConnectionLost(NoConnection):
    """The connection broke during an exchange; whether the request was carried out is unknown."""


class AnswerTimeout(NoConnection):
    """The peer took the connection, but its answer did not come, or did not end, in time."""


@dataclass(frozen=True, slots=True)
class HttpRequest:
    """A request.

    Attributes:
        method: e.g. GET.
        target: path and query, exactly as on the request line.
        headers: names and values, in order; names may repeat.
        body: the content, empty for none.
        peer: the TCP connection it came on; empty at the client.
    """

    method: str
    target: str
    headers: Headers = ()
    body: bytes = b""
    peer: str = ""

    def header(self, name: str) -> str | None:
        """The first value of ``name`` in any case, or None."""
        return _first(self.headers, name)

    def header_values(self, name: str) -> tuple[str, ...]:
        """All values of ``name`` in any case."""
        return tuple(value for key, value in self.headers if key.lower() == name.lower())


@dataclass(frozen=True, slots=True)
class HttpReply:
    """An answer."""

    status: int
    headers: Headers = ()
    body: bytes = b""

    def header(self, name: str) -> str | None:
        """The first value of ``name`` in any case, or None."""
        return _first(self.headers, name)


@dataclass(frozen=True, slots=True)
class Listener:
    """Who hears what comes on a WebSocket; called on the socket's thread.

    Attributes:
        protocol: the sub-protocol that is spoken.
        on_text: told each message.
        on_lost: told once why nothing more will come; never after ``close``.
    """

    protocol: str
    on_text: Callable[[str], None]
    on_lost: Callable[[str], None]


class HttpLink:
    """Keep-alive connections to ``address``, which is a host name or IP address, with ``:port`` if not 80.

    Nothing happens before the first exchange; ``close`` when done. Two exchanges may be under way at once, each on a
    connection of its own; safe from any thread. A host name is looked up once: the address is the same as long as the
    link lives, as it is for EGM.

    Raises:
        SettingsError: the address is not one.
    """

    def __init__(self, address: str, clock: Clock | None = None) -> None:
        self.address = address
        self._url = _url(address)
        self._clock = clock or SystemClock()
        self._backend = _Backend(self._clock, address)
        self._pool = self._new_pool()

    def exchange(self, request: HttpRequest, timeout: float) -> HttpReply:
        """Send ``request`` and wait for its answer, at most ``timeout`` [s] in all, however slowly it comes.

        Raises:
            ConnectionLost: the connection broke after it was made.
            AnswerTimeout: the answer did not end in time.
            NoConnection: nothing answers at the address in time.
            ProtocolError: what answers does not speak HTTP, or the request cannot be put into it.
        """
        deadline = self._clock.now() + timeout
        with _converted_errors(self.address, timeout):
            response = self._pool.handle_request(self._outgoing(request, timeout, deadline))
            try:
                body = self._read(response)
            finally:
                response.close()
        headers = tuple((_text(name), _text(value)) for name, value in response.headers)
        return HttpReply(response.status, headers, body)

    def open_socket(self, request: HttpRequest, listener: Listener, timeout: float) -> WebSocket:
        """A WebSocket at the target of ``request``, on a connection of its own.

        Raises:
            NoConnection: nothing answers at the address in time.
            ControllerRefused: what answers does not open a WebSocket.
        """
        from yumi.rws.subscription import WebSocket  # noqa: PLC0415 - aiohttp takes as long to load as all the rest

        socket = WebSocket(self.address, request.target, request.headers, listener)
        socket.open(timeout)
        return socket

    def close(self) -> None:
        """Close the connections; exchanges under way end at once, another one opens a new connection."""
        pool, self._pool = self._pool, self._new_pool()
        pool.close()

    def _new_pool(self) -> httpcore.ConnectionPool:
        """Connections past any proxy of the environment; RWS 1.0 has no TLS."""
        return httpcore.ConnectionPool(
            max_connections=_CONNECTIONS, keepalive_expiry=_KEEP_ALIVE, network_backend=self._backend
        )

    def _outgoing(self, request: HttpRequest, timeout: float, deadline: float) -> httpcore.Request:
        # A client library would escape the target once more, and the digest is over exactly what is on the wire.
        target = request.target.encode("ascii")
        named = [(name.encode("ascii"), value.encode("utf-8")) for name, value in request.headers]
        return httpcore.Request(
            request.method,
            httpcore.URL(scheme=self._url.scheme, host=self._url.host, port=self._url.port, target=target),
            headers=[*_fixed_headers(self.address, request), *named],
            content=request.body,
            extensions={"timeout": {"connect": deadline, "read": deadline, "write": deadline, "pool": timeout}},
        )

    def _read(self, response: httpcore.Response) -> bytes:
        stream: _Stream = response.extensions["network_stream"]
        stream.head_left = None
        body = bytearray()
        try:
            for chunk in response.iter_stream():
                body += chunk
                if len(body) > _MAX_BODY:
                    raise ProtocolError(f"The answer of {self.address} is longer than {_MAX_BODY} bytes.")
        except httpcore.ReadTimeout as error:
            raise AnswerTimeout(f"{self.address} is too slow: its answer did not end in time.") from error
        return bytes(body)


class _Backend(httpcore.NetworkBackend):
    """Connects within a deadline: the ``timeout`` that httpcore passes on is the time at which the exchange ends.

    httpcore's own timeouts are for each read, so that a peer which sends a byte now and then is waited for endlessly.
    """

    def __init__(self, clock: Clock, address: str) -> None:
        self._clock = clock
        self._address = address
        self._system = httpcore.SyncBackend()
        self._hosts: tuple[str, ...] = ()

    def connect_tcp(
        self,
        host: str,
        port: int,
        timeout: float | None = None,
        local_address: str | None = None,
        socket_options: Iterable[Any] | None = None,
    ) -> _Stream:
        assert timeout is not None, "every exchange has a deadline"
        *others, last = self._hosts or self._look_up(host, port)
        for each in others:
            with suppress(httpcore.ConnectError, httpcore.ConnectTimeout):
                return self._connect(each, port, timeout)
        return self._connect(last, port, timeout)

    def _look_up(self, host: str, port: int) -> tuple[str, ...]:
        try:
            found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        except (OSError, UnicodeError) as error:  # an unknown name, or no file descriptor for asking
            raise httpcore.ConnectError(str(error)) from error
        self._hosts = tuple(str(place[0]) for *_, place in found)
        return self._hosts

    def _connect(self, host: str, port: int, deadline: float) -> _Stream:
        left = deadline - self._clock.now()
        if left <= 0.0:
            raise httpcore.ConnectTimeout("no time is left")
        return _Stream(self._system.connect_tcp(host, port, left), self._clock, self._address)


class _Stream(httpcore.NetworkStream):
    """A connection whose reads and writes end at a deadline, see :class:`_Backend`.

    Attributes:
        head_left: how long the head of the answer may still become [byte]; None once it is complete.
    """

    def __init__(self, stream: httpcore.NetworkStream, clock: Clock, address: str) -> None:
        self.head_left: int | None = None
        self._stream = stream
        self._socket: socket.socket = stream.get_extra_info("socket")
        self._clock = clock
        self._address = address

    def read(self, max_bytes: int, timeout: float | None = None) -> bytes:
        assert timeout is not None, "every exchange has a deadline"
        left = timeout - self._clock.now()
        if left <= 0.0:
            raise httpcore.ReadTimeout("no time is left")
        data = self._stream.read(max_bytes, left)
        if self.head_left is not None:
            self.head_left -= len(data)
            if self.head_left < 0:
                raise ProtocolError(f"The head of the answer of {self._address} is longer than {_MAX_HEAD} bytes.")
        return data

    def write(self, buffer: bytes, timeout: float | None = None) -> None:
        assert timeout is not None, "every exchange has a deadline"
        self.head_left = _MAX_HEAD
        rest = memoryview(buffer)
        try:
            while rest:
                left = timeout - self._clock.now()
                if left <= 0.0:
                    raise httpcore.WriteTimeout("no time is left")
                self._socket.settimeout(left)
                rest = rest[self._socket.send(rest) :]
        except TimeoutError as error:
            raise httpcore.WriteTimeout(str(error)) from error
        except OSError as error:
            raise httpcore.WriteError(str(error)) from error

    def close(self) -> None:
        with suppress(OSError):  # the peer has closed it already
            self._socket.shutdown(socket.SHUT_RDWR)  # a thread that reads is woken, which closing alone does not do
        self._stream.close()

    def get_extra_info(self, info: str) -> Any:
        return self._stream.get_extra_info(info)


@contextmanager
def _converted_errors(address: str, timeout: float) -> Iterator[None]:
    try:
        yield
    except httpcore.TimeoutException as error:
        raise _timed_out(address, timeout, error) from error
    except httpcore.ConnectError as error:
        raise NoConnection(_why_no_connection(address, error)) from error
    except httpcore.LocalProtocolError as error:
        raise ProtocolError(f"The request to {address} cannot be put into HTTP: {error}.") from error
    except (httpcore.NetworkError, httpcore.RemoteProtocolError) as error:
        if any(isinstance(each, h11.RemoteProtocolError) for each in _origins(error)):
            raise ProtocolError(
                f"Something answers at {address}, but it does not speak HTTP as a controller does; check the "
                "address and the port (a controller's is 80)."
            ) from error
        raise ConnectionLost(
            f"{address} closed the connection without an HTTP answer; try again, and check that a controller "
            "listens there (its port is 80)."
        ) from error


def _timed_out(address: str, timeout: float, error: httpcore.TimeoutException) -> NoConnection:
    if isinstance(error, httpcore.ConnectTimeout):
        return NoConnection(
            f"Nothing answers at {address} within {timeout:.1f} s; check the address, the cable and that the "
            "controller is switched on."
        )
    return AnswerTimeout(f"{address} accepted the connection but did not answer within {timeout:.1f} s.")


def _why_no_connection(address: str, error: httpcore.ConnectError) -> str:
    *_, root = _origins(error)
    if isinstance(root, socket.gaierror | UnicodeError):
        return f"No machine named {address} is known; check the address."
    if isinstance(root, ConnectionRefusedError):
        return (
            f"The machine at {address} refuses the connection: no controller listens there; check address "
            "and port, or start the virtual controller."
        )
    if isinstance(root, OSError) and root.errno in (errno.EMFILE, errno.ENFILE):
        return f"No file descriptor is left for a connection to {address}; raise the limit (ulimit -n)."
    return f"There is no way to {address} ({root}); check the address and the network."


def _origins(error: BaseException | None) -> Iterator[BaseException]:
    """The exception and all it was converted from."""
    while error is not None:
        yield error
        error = error.__cause__ or error.__context__


def _fixed_headers(address: str, request: HttpRequest) -> list[tuple[bytes, bytes]]:
    """What HTTP demands beside what the owner of the link has put into the request."""
    headers = [(b"Host", address.removesuffix(":80").encode("ascii"))]
    if request.body or request.method in ("POST", "PUT"):
        headers.append((b"Content-Length", str(len(request.body)).encode("ascii")))
    return headers


def _text(value: bytes) -> str:
    """A name or value of a header; what is not UTF-8 is Latin-1 by HTTP's rule."""
    try:
        return value.decode("utf-8")
    except UnicodeDecodeError:
        return value.decode("latin-1")


def _url(address: str) -> httpcore.URL:
    try:
        parts = urlsplit(f"//{address}")
        host, port = parts.hostname, parts.port or 80
        if host and _HOST.fullmatch(host) and parts.netloc == address and not parts.username:
            return httpcore.URL(scheme="http", host=host, port=port, target="/")
    except ValueError as error:
        raise SettingsError(_not_an_address(address)) from error
    raise SettingsError(_not_an_address(address))


def _not_an_address(address: str) -> str:
    return f"{address!r} is not an address; give a host name or IP address, with :port if not 80."


def _first(headers: Headers, name: str) -> str | None:
    return next((value for key, value in headers if key.lower() == name.lower()), None)
