"""Sockets of RAPID programs: real TCP and UDP sockets that never wait.

Unless the user allows another address, nothing leaves this machine: whatever address of its cell a program binds or
connects to, it means this machine, as the UDPUC devices of ``SIO.cfg`` do (docs/explanation/decisions/0036).
"""

from __future__ import annotations

import errno
import os
import socket
import weakref

from abb_runtime.udp import is_loopback

_LOOPBACK = "127.0.0.1"

_MOST_SOCKETS = 32
"""Sockets that are open at a time (RAPID reference manual, SocketCreate)."""

_PEEKED = 65536  # bytes


class ProgramNetwork:
    """Makes the sockets of all tasks.

    Args:
        address: this machine's, which programs may use; 127.0.0.1 keeps them on this machine, 0.0.0.0 allows all.

    Attributes:
        count: how many sockets are open.
    """

    def __init__(self, address: str = _LOOPBACK) -> None:
        self.address = address
        self.count = 0

    @property
    def is_local(self) -> bool:
        """Whether nothing leaves this machine."""
        return is_loopback(self.address)

    def tcp(self) -> ProgramSocket:
        """A TCP socket."""
        return self._made(socket.SOCK_STREAM)

    def udp(self) -> ProgramSocket:
        """A UDP socket."""
        return self._made(socket.SOCK_DGRAM)

    def _made(self, kind: socket.SocketKind) -> ProgramSocket:
        self.check_room()
        return ProgramSocket(self, socket.socket(socket.AF_INET, kind))

    def check_room(self) -> None:
        """Raise OSError where there are too many sockets."""
        if self.count >= _MOST_SOCKETS:
            raise OSError(errno.ENOBUFS, f"{_MOST_SOCKETS} sockets are open already")

    def remote(self, address: str, port: int) -> tuple[str, int]:
        """Where a program's address leads to."""
        return (self.address if self.is_local else address), port


class ProgramSocket:
    """A socket of this machine that never waits; see :class:`virtual_irc5.rapid.devices.Socket`."""

    def __init__(self, network: ProgramNetwork, made: socket.socket) -> None:
        self._network = network
        self._socket = made
        network.count += 1
        # Also closed when nothing refers to it any more: the program pointer went to main, a routine ended.
        self._close = weakref.finalize(self, _close_and_count, network, made)
        made.setblocking(False)
        if made.type == socket.SOCK_STREAM:
            made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def bind(self, address: str, port: int) -> None:
        """Take a port of the address this controller may use."""
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, self._socket.type == socket.SOCK_STREAM)
        self._socket.bind((self._network.address, port))

    def listen(self) -> None:
        """Let others connect."""
        self._socket.listen()

    def accept(self) -> tuple[ProgramSocket, str] | None:
        """The next connection with the other side's address."""
        self._network.check_room()
        try:
            connection, (address, _) = self._socket.accept()
        except BlockingIOError:
            return None
        return ProgramSocket(self._network, connection), address

    def connect(self, address: str, port: int) -> None:
        """Begin to connect."""
        failure = self._socket.connect_ex(self._network.remote(address, port))
        if failure not in (0, errno.EINPROGRESS):
            raise OSError(failure, os.strerror(failure))

    def is_connected(self) -> bool:
        """Whether the connection is there."""
        failure = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if failure:
            raise OSError(failure, os.strerror(failure))
        try:
            self._socket.getpeername()
        except OSError as error:
            if error.errno == errno.ENOTCONN:
                return False
            raise
        return True

    def send(self, data: bytes) -> int:
        """Send what the other side takes."""
        try:
            return self._socket.send(data, socket.MSG_NOSIGNAL)
        except BlockingIOError:
            return 0

    def receive(self, size: int) -> bytes | None:
        """What is there."""
        try:
            return self._socket.recv(size)
        except BlockingIOError:
            return None

    def send_to(self, data: bytes, address: str, port: int) -> None:
        """Send a datagram."""
        self._socket.sendto(data, self._network.remote(address, port))

    def receive_from(self, size: int) -> tuple[bytes, str, int] | None:
        """The next datagram and its sender."""
        try:
            data, (address, port) = self._socket.recvfrom(size)
        except BlockingIOError:
            return None
        return data, address, port

    def waiting(self) -> int:
        """How much can be received at once."""
        try:
            found = self._socket.recv(_PEEKED, socket.MSG_PEEK)
        except BlockingIOError:
            return 0
        if not found and self._socket.type == socket.SOCK_STREAM:
            raise ConnectionResetError(errno.ECONNRESET, "the other side has closed the connection")
        return len(found)

    def close(self) -> None:
        """Close it; nothing happens where it is closed."""
        self._close()


def _close_and_count(network: ProgramNetwork, made: socket.socket) -> None:
    network.count -= 1
    made.close()
