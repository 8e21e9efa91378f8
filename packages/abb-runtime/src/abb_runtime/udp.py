"""UDP sockets for EGM, links in memory in their place, a poller of both; addresses, hosts, ports and network cards."""

from __future__ import annotations

import ctypes
import errno
import fcntl
import os
import select
import socket
import struct
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path
from random import SystemRandom
from typing import Protocol
from urllib.parse import urlsplit

from abb_protocols.catalogue import message
from abb_protocols.errors import NoConnection

_BUFFER_SIZE = 2048
_SIOCGIFADDR, _SIOCGIFNETMASK = 0x8915, 0x891B  # of Linux
_MOST = 256  # datagrams read at once: whatever arrives, the caller goes on after some milliseconds

LOST_ON_THE_WAY = {errno.EAGAIN, errno.ECONNREFUSED, errno.ENETUNREACH, errno.EHOSTUNREACH, errno.ENETDOWN}
"""Why a datagram did not leave that UDP may lose anywhere; the next one follows in 4 ms."""

_libc = ctypes.CDLL(None, use_errno=True)

_Address = tuple[str, int]


class UdpServer:
    """Listens on one port and answers one sender; never waits.

    Until a sender is pinned, :meth:`receive` returns what one sender sent, and at the next call what another one did.
    Pinned, the socket is connected to the sender, address and port: the system drops what comes from any other, so
    that nothing of it fills the socket's buffer.

    Attributes:
        foreign: datagrams of other addresses than the remote's, and of other senders that waited when one was pinned.
            What comes while a sender is pinned never gets here, and is not counted.
        is_pinned: whether only one sender is heard.

    Args:
        host: local address to listen on.
        port: local port, 0 for any free one.
        remote: only datagrams from this address are taken; None takes all.

    Raises:
        NoConnection: the port is taken or the address is not this machine's.
    """

    def __init__(self, host: str, port: int, *, remote: str | None = None) -> None:
        self.foreign = 0
        self.is_pinned = False
        self._remote = remote
        self._peer: _Address | None = None
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            if error.errno == errno.EADDRINUSE:
                raise NoConnection(message("udp_port_taken", port=port)) from error
            said = message("udp_port_not_opened", host=host, port=port, error=str(error.strerror))
            raise NoConnection(said) from error
        self._own: _Address = self._socket.getsockname()
        self._receive = self._socket.recvfrom

    def __enter__(self) -> UdpServer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._socket.close()

    @property
    def host(self) -> str:
        return self._own[0]

    @property
    def port(self) -> int:
        return self._own[1]

    def fileno(self) -> int:
        return self._socket.fileno()

    def receive(self) -> list[bytes]:
        """The datagrams of one sender that wait, oldest first; of the pinned one, if there is one."""
        datagrams: list[bytes] = []
        for _ in range(_MOST):
            try:
                if datagrams and not self.is_pinned and self._receive(1, socket.MSG_PEEK)[1] != self._peer:
                    break  # left for the next call
                datagram, peer = self._receive(_BUFFER_SIZE)
            except BlockingIOError:
                break
            except OSError:  # an ICMP error of an earlier send; it says nothing about what waits here
                continue
            if peer == self._peer or self._is_taken(peer):
                self._peer = peer
                datagrams.append(datagram)
        return datagrams

    def pin(self) -> None:
        """From now on hear only the sender of what was handed out last."""
        if self._peer is None or self.is_pinned:
            return
        try:
            self._socket.connect(self._peer)
        except OSError:  # no way there at the moment; the next datagram of a session pins its sender
            return
        self.is_pinned = True

    def release(self) -> None:
        """From now on hear every sender again."""
        if not self.is_pinned:
            return
        self.is_pinned = False
        # connect(2): an address of the family AF_UNSPEC dissolves the association. Python's connect takes none.
        nowhere = ctypes.create_string_buffer(struct.pack("=H14x", socket.AF_UNSPEC), 16)
        if _libc.connect(self._socket.fileno(), nowhere, 16) != 0:
            error = ctypes.get_errno()
            raise OSError(error, os.strerror(error))
        if self._socket.getsockname() != self._own:  # Linux keeps a port that was asked for, and gives up any other
            self._socket.bind(self._own)

    def send(self, datagram: bytes) -> None:
        """Answer the sender of what was handed out last; a reply that cannot leave is lost, as on any network."""
        if self._peer is not None:
            _send(self._socket, datagram, None if self.is_pinned else self._peer)

    def _is_taken(self, peer: _Address) -> bool:
        """Whether what a sender sent is handed out; else it is counted."""
        # What waited when a sender was pinned may be of others.
        is_taken = not self.is_pinned and (self._remote is None or peer[0] == self._remote)
        self.foreign += not is_taken
        return is_taken


class UdpClient:
    """Speaks to one address and reads what it answers; never waits.

    Raises:
        NoConnection: the host's name is unknown.
    """

    def __init__(self, host: str, port: int) -> None:
        self._address = (address_of_host(host), port)
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
            except OSError:  # as above: no socket listens there at the moment
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
            said = message("host_not_routed", host=host, error=error.strerror or str(error))
            raise NoConnection(said) from error
        return str(probe.getsockname()[0])


@dataclass(frozen=True, slots=True)
class NetworkCard:
    """One network card with an IPv4 address.

    Attributes:
        name: such as ``enp3s0``.
        address, mask: of IPv4.
        mtu: largest packet [byte].
        is_up: whether it is connected.
        is_wireless: whether it is a radio link.
        is_tunnel: whether a program stands behind it, as of a VPN.
    """

    name: str
    address: str
    mask: str
    mtu: int
    is_up: bool
    is_wireless: bool
    is_tunnel: bool


def network_cards() -> tuple[NetworkCard, ...]:
    """This machine's network cards that have an address, the loopback among them."""
    found = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asked:
        for _, name in socket.if_nameindex():
            request = struct.pack("256s", name.encode()[:15])
            try:
                address, mask = (
                    socket.inet_ntoa(fcntl.ioctl(asked.fileno(), number, request)[20:24])
                    for number in (_SIOCGIFADDR, _SIOCGIFNETMASK)
                )
            except OSError:  # it has no address
                continue
            card = Path("/sys/class/net") / name
            found.append(
                NetworkCard(
                    name=name,
                    address=address,
                    mask=mask,
                    mtu=int((card / "mtu").read_text()),
                    is_up=(card / "operstate").read_text().strip() != "down",
                    is_wireless=(card / "wireless").exists(),
                    is_tunnel=(card / "tun_flags").exists(),
                )
            )
    return tuple(found)


def address_of_host(host: str) -> str:
    """The IPv4 address of ``host``.

    Raises:
        NoConnection: the name is unknown.
    """
    try:
        return socket.gethostbyname(host)
    except (OSError, UnicodeError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or str(error)
        raise NoConnection(message("host_unknown", host=host, error=reason)) from error


def free_port(kind: socket.SocketKind = socket.SOCK_DGRAM) -> int:
    """A free port, below those that the system gives away: none takes it by chance before it is used."""
    while True:
        port = SystemRandom().randrange(10_000, 32_000)  # Linux gives away 32768 to 60999
        with socket.socket(socket.AF_INET, kind) as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError as error:
                if error.errno != errno.EADDRINUSE:
                    raise
            else:
                return port


def is_loopback(host: str) -> bool:
    """Whether a host name or address means this machine; no name but ``localhost`` does, and none is looked up."""
    try:
        return host.lower() == "localhost" or ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def host_of_url(url: str) -> str:
    """The host that a URL names; empty where the text is no URL."""
    try:
        return urlsplit(url).hostname or ""
    except ValueError:
        return ""


def _send(sender: socket.socket, datagram: bytes, address: _Address | None) -> None:
    """Send to ``address``; None: where the socket is connected to."""
    try:
        if address is None:
            sender.send(datagram)
        else:
            sender.sendto(datagram, address)
    except OSError as error:
        if error.errno not in LOST_ON_THE_WAY:
            raise


_MS = 1e3


class HasFileno(Protocol):
    """Anything the operating system can wait for."""

    def fileno(self) -> int:
        """Its descriptor."""


class Poller:
    """Calls a handler per readable thing; one thread only.

    It stands between a datagram and its reply, with cold caches: hence ``poll`` itself, not the layers of a selector.
    """

    def __init__(self) -> None:
        self._poll = select.poll()
        self._handlers: dict[int, Callable[[], None]] = {}

    def close(self) -> None:
        for descriptor in tuple(self._handlers):
            self._forget(descriptor)

    def watch(self, thing: HasFileno, handler: Callable[[], None]) -> None:
        self._handlers[thing.fileno()] = handler
        self._poll.register(thing, select.POLLIN)

    def forget(self, thing: HasFileno) -> None:
        self._forget(thing.fileno())

    def wait(self, timeout: float) -> bool:
        """Wait until something is readable, at most ``timeout`` [s] in whole milliseconds, and call its handlers.

        Returns:
            Whether anything was readable.
        """
        ready = self._poll.poll(timeout * _MS)
        for descriptor, _ in ready:
            self._handlers[descriptor]()
        return bool(ready)

    def _forget(self, descriptor: int) -> None:
        self._poll.unregister(descriptor)
        del self._handlers[descriptor]


class MemoryLink:
    """One end; make both with :func:`memory_links`."""

    foreign = 0  # there is one sender only
    is_pinned = True

    def __init__(self, inbox: deque[bytes], outbox: deque[bytes]) -> None:
        self._inbox = inbox
        self._outbox = outbox

    def fileno(self) -> int:
        """No socket."""
        return -1

    def send(self, datagram: bytes) -> None:
        self._outbox.append(datagram)

    def pin(self) -> None:
        """It always is."""

    def release(self) -> None:
        """There is no other sender."""

    @property
    def has_datagram(self) -> bool:
        return bool(self._inbox)

    def receive(self) -> list[bytes]:
        """All datagrams that wait, oldest first."""
        datagrams = list(self._inbox)
        self._inbox.clear()
        return datagrams


def memory_links() -> tuple[MemoryLink, MemoryLink]:
    """Two connected ends."""
    there: deque[bytes] = deque()
    back: deque[bytes] = deque()
    return MemoryLink(there, back), MemoryLink(back, there)
