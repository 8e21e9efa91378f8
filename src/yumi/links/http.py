"""One HTTP/1.1 connection to a controller, and the values that cross it in either direction.

The transport knows nothing of logins or cookies: whoever uses it puts them into the headers.
"""

from __future__ import annotations

import re
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import h11
import httpx

from yumi.clock import Clock, SystemClock
from yumi.errors import NoConnection, ProtocolError, SettingsError

if TYPE_CHECKING:
    from yumi.links.web_socket import WebSocket

Headers = tuple[tuple[str, str], ...]

_HOST = re.compile(r"[0-9A-Za-z._-]+|[0-9a-f:.]+(%[\w.-]+)?")  # a name, IPv4, or IPv6
_KEEP_ALIVE = 280.0  # [s]; below the five minutes after which a controller forgets an idle session
_MAX_BODY = 64 * 1024 * 1024


class ConnectionLost(NoConnection):
    """The connection broke during an exchange; whether the request was carried out is unknown."""


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
    """A keep-alive connection to ``address``, which is a host name or IP address, with ``:port`` if not 80.

    Nothing happens before the first exchange; ``close`` when done. One exchange at a time: the owner locks.

    Raises:
        SettingsError: the address is not one.
    """

    def __init__(self, address: str, clock: Clock | None = None) -> None:
        self.address = address
        self._url = _url(address)
        self._clock = clock or SystemClock()
        self._transport = _transport()

    def exchange(self, request: HttpRequest, timeout: float) -> HttpReply:
        """Send ``request`` and wait for its answer, at most ``timeout`` [s] in all.

        Raises:
            ConnectionLost: the connection broke after it was made.
            NoConnection: nothing answers at the address in time.
            ProtocolError: what answers does not speak HTTP, or the request cannot be put into it.
        """
        deadline = self._clock.now() + timeout
        with _converted_errors(self.address, timeout):
            response = self._transport.handle_request(self._outgoing(request, timeout))
            try:
                body = self._read(response, deadline)
            finally:
                response.close()
        return HttpReply(response.status_code, tuple(response.headers.multi_items()), body)

    def open_socket(self, request: HttpRequest, listener: Listener, timeout: float) -> WebSocket:
        """A WebSocket at the target of ``request``, on a connection of its own.

        Raises:
            NoConnection: nothing answers at the address in time.
            ControllerRefused: what answers does not open a WebSocket.
        """
        from yumi.links.web_socket import WebSocket  # noqa: PLC0415 - aiohttp takes as long to load as all the rest

        socket = WebSocket(self.address, request.target, request.headers, listener)
        socket.open(timeout)
        return socket

    def close(self) -> None:
        """Close the connection; another exchange opens a new one."""
        self._transport.close()
        self._transport = _transport()

    def _outgoing(self, request: HttpRequest, timeout: float) -> httpx.Request:
        # httpx would escape the target once more, and the digest is over exactly what is on the wire.
        return httpx.Request(
            request.method,
            self._url,
            headers=[(name.encode("ascii"), value.encode("utf-8")) for name, value in request.headers],
            content=request.body,
            extensions={
                "target": request.target.encode("ascii"),
                "timeout": {"connect": timeout, "read": timeout, "write": timeout, "pool": timeout},
            },
        )

    def _read(self, response: httpx.Response, deadline: float) -> bytes:
        body = bytearray()
        for chunk in response.iter_raw():
            body += chunk
            if self._clock.now() > deadline:
                raise NoConnection(f"{self.address} is too slow: its answer did not end in time.")
            if len(body) > _MAX_BODY:
                raise ProtocolError(f"The answer of {self.address} is longer than {_MAX_BODY} bytes.")
        return bytes(body)


@contextmanager
def _converted_errors(address: str, timeout: float) -> Iterator[None]:
    try:
        yield
    except httpx.TimeoutException as error:
        raise _timed_out(address, timeout, error) from error
    except httpx.ConnectError as error:
        raise NoConnection(_why_no_connection(address, error)) from error
    except httpx.LocalProtocolError as error:
        raise ProtocolError(f"The request to {address} cannot be put into HTTP: {error}.") from error
    except (httpx.NetworkError, httpx.RemoteProtocolError) as error:
        if any(isinstance(each, h11.RemoteProtocolError) for each in _origins(error)):
            raise ProtocolError(
                f"Something answers at {address}, but it does not speak HTTP as a controller does; check the "
                "address and the port (a controller's is 80)."
            ) from error
        raise ConnectionLost(
            f"{address} closed the connection without an HTTP answer; try again, and check that a controller "
            "listens there (its port is 80)."
        ) from error


def _timed_out(address: str, timeout: float, error: httpx.TimeoutException) -> NoConnection:
    if isinstance(error, httpx.ConnectTimeout):
        return NoConnection(
            f"Nothing answers at {address} within {timeout:.1f} s; check the address, the cable and that the "
            "controller is switched on."
        )
    return NoConnection(f"{address} accepted the connection but did not answer within {timeout:.1f} s.")


def _why_no_connection(address: str, error: httpx.ConnectError) -> str:
    *_, root = _origins(error)
    if isinstance(root, socket.gaierror):
        return f"No machine named {address} is known; check the address."
    if isinstance(root, ConnectionRefusedError):
        return (
            f"The machine at {address} refuses the connection: no controller listens there; check address "
            "and port, or start the virtual controller."
        )
    return f"There is no way to {address} ({root}); check the address and the network."


def _origins(error: BaseException | None) -> Iterator[BaseException]:
    """The exception and all it was converted from."""
    while error is not None:
        yield error
        error = error.__cause__ or error.__context__


def _transport() -> httpx.HTTPTransport:
    """One connection, past any proxy of the environment; RWS 1.0 has no TLS, so no certificates load."""
    limits = httpx.Limits(max_connections=1, max_keepalive_connections=1, keepalive_expiry=_KEEP_ALIVE)
    return httpx.HTTPTransport(verify=False, trust_env=False, limits=limits)


def _url(address: str) -> httpx.URL:
    try:
        parts = urlsplit(f"//{address}")
        host, port = parts.hostname, parts.port or 80
        if host and _HOST.fullmatch(host) and parts.netloc == address and not parts.username:
            return httpx.URL(scheme="http", host=host, port=port, path="/")
    except (ValueError, httpx.InvalidURL) as error:
        raise SettingsError(_not_an_address(address)) from error
    raise SettingsError(_not_an_address(address))


def _not_an_address(address: str) -> str:
    return f"{address!r} is not an address; give a host name or IP address, with :port if not 80."


def _first(headers: Headers, name: str) -> str | None:
    return next((value for key, value in headers if key.lower() == name.lower()), None)
