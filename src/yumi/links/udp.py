"""UDP sockets for EGM: our end, which listens and answers, and the robot's end, which speaks first."""

from __future__ import annotations

import errno
import socket
from types import TracebackType

from yumi.errors import NoConnection

_BUFFER_SIZE = 2048


class UdpServer:
    """Listens on one port and answers whoever spoke last; never waits.

    Attributes:
        foreign: datagrams of other addresses than the remote's.
        newest: the datagram received last.

    Args:
        host: local address to listen on.
        port: local port, 0 for any free one.
        remote: only datagrams from this address are taken; None takes all.

    Raises:
        NoConnection: the port is taken or the address is not this machine's.
    """

    def __init__(self, host: str, port: int, *, remote: str | None = None) -> None:
        self.foreign = 0
        self.newest: bytes | None = None
        self._remote = remote
        self._peer: tuple[str, int] | None = None
        self._socket = _bound(host, port)
        self._receive = self._socket.recvfrom

    def __enter__(self) -> UdpServer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        self._socket.close()

    @property
    def host(self) -> str:
        return str(self._socket.getsockname()[0])

    @property
    def port(self) -> int:
        return int(self._socket.getsockname()[1])

    def fileno(self) -> int:
        return self._socket.fileno()

    def receive_next(self) -> bytes | None:
        """The oldest datagram that waits; None when there is none, or what waits counts for nothing."""
        try:
            datagram, peer = self._receive(_BUFFER_SIZE)
        except OSError:  # nothing waits, or an ICMP error of an earlier send
            return None
        if self._remote is not None and peer[0] != self._remote:
            self.foreign += 1
            return None
        self._peer, self.newest = peer, datagram
        return datagram

    def receive(self) -> list[bytes]:
        """All datagrams that wait, oldest first."""
        datagrams: list[bytes] = []
        while True:
            try:
                datagram, peer = self._receive(_BUFFER_SIZE)
            except BlockingIOError:
                return datagrams
            except OSError:  # an ICMP error of an earlier send; it says nothing about what waits here
                continue
            if self._remote is not None and peer[0] != self._remote:
                self.foreign += 1
                continue
            self._peer, self.newest = peer, datagram
            datagrams.append(datagram)

    def send(self, datagram: bytes) -> None:
        """Answer the sender of the datagram received last; a reply that cannot leave is lost, as on any network."""
        if self._peer is None:
            return
        _send(self._socket, datagram, self._peer)


class UdpClient:
    """Speaks to one address and reads what it answers; never waits.

    Raises:
        NoConnection: the host's name is unknown.
    """

    def __init__(self, host: str, port: int) -> None:
        self._address = (resolve(host), port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def close(self) -> None:
        self._socket.close()

    def fileno(self) -> int:
        return self._socket.fileno()

    def send(self, datagram: bytes) -> None:
        _send(self._socket, datagram, self._address)

    def receive(self) -> list[bytes]:
        """All datagrams of the address that wait, oldest first."""
        datagrams: list[bytes] = []
        while True:
            try:
                datagram, peer = self._socket.recvfrom(_BUFFER_SIZE)
            except BlockingIOError:
                return datagrams
            except OSError:  # as above: nobody listens there at the moment
                continue
            if peer[0] == self._address[0]:
                datagrams.append(datagram)


def address_towards(host: str, port: int = 80) -> str:
    """This machine's own address on the way to ``host``; nothing is sent.

    Raises:
        NoConnection: ``host`` is no address, or there is no way to it.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((host, port))
        except OSError as error:
            raise NoConnection(f"There is no way to {host!r}: {error.strerror or error}; check the address.") from error
        return str(probe.getsockname()[0])


def resolve(host: str) -> str:
    """The IPv4 address of ``host``.

    Raises:
        NoConnection: the name is unknown.
    """
    try:
        return socket.gethostbyname(host)
    except (OSError, UnicodeError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or error
        raise NoConnection(f"The name {host!r} is not known: {reason}; give an address.") from error


def free_port() -> int:
    """A UDP port that is free at this moment."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _bound(host: str, port: int) -> socket.socket:
    server = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    server.setblocking(False)
    try:
        server.bind((host, port))
    except OSError as error:
        server.close()
        raise NoConnection(_why_not_bound(host, port, error)) from error
    return server


def _why_not_bound(host: str, port: int, error: OSError) -> str:
    if error.errno == errno.EADDRINUSE:
        return f"UDP port {port} is taken: another driver may be running; stop it or choose another EGM port."
    return f"Cannot listen for EGM on {host}:{port}: {error.strerror}."


def _send(sender: socket.socket, datagram: bytes, address: tuple[str, int]) -> None:
    try:
        sender.sendto(datagram, address)
    except BlockingIOError:
        return  # the send buffer is full: UDP may lose a datagram anywhere, the next one follows in 4 ms
    except OSError as error:
        if error.errno not in {errno.ECONNREFUSED, errno.ENETUNREACH, errno.EHOSTUNREACH, errno.ENETDOWN}:
            raise
