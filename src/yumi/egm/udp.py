"""UDP sockets for EGM: our end, which listens and answers, the robot's end, which sends first, and waiting for both."""

from __future__ import annotations

import ctypes
import errno
import fcntl
import select
import socket
import struct
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path
from types import TracebackType
from typing import Protocol

from yumi.catalogue import message
from yumi.errors import NoConnection

_BUFFER_SIZE = 2048
_SIOCGIFADDR, _SIOCGIFNETMASK = 0x8915, 0x891B  # of Linux
_WAITING = 256  # datagrams of other senders that are kept while it is open which of them is the robot
_MOST = 256  # datagrams read at once: whatever arrives, the caller goes on after some milliseconds
_FLOOD = 32  # datagrams of others since the last of the one that is pinned: more than answering it leaves time for
_SO_ATTACH_FILTER, _SO_DETACH_FILTER = 26, 27  # of Linux

_Address = tuple[str, int]


class UdpServer:
    """Listens on one port and answers one sender at a time; never waits.

    Who that is, address and port, can be pinned: then nothing of any other sender is handed out. As long as it is not,
    :meth:`receive` returns what one sender sent, and at the next call what another one did.

    Others that send faster than the one that is pinned would fill the socket's buffer, where its datagrams are lost. So
    after some of theirs the system drops them before they get there, until the sender is released.

    Attributes:
        foreign: datagrams of other addresses than the remote's, and of other senders than the one that is pinned; but
            for those that the system has dropped.
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
        self._in_a_row = 0  # datagrams of others since the last of the one that is pinned
        self._is_filtered = False
        self._others: deque[tuple[bytes, _Address]] = deque(maxlen=_WAITING)
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
        if peer != self._peer and (self.is_pinned or not self._is_from_remote(peer)):
            self._leave_aside()
            return None
        self._peer = peer
        self._in_a_row = 0
        return datagram

    def receive(self) -> list[bytes]:
        """The datagrams of one sender that wait, oldest first; of the pinned one, if there is one."""
        datagrams: list[bytes] = []
        for _ in range(_MOST):
            try:
                datagram, peer = self._receive(_BUFFER_SIZE)
            except BlockingIOError:
                break
            except OSError:  # an ICMP error of an earlier send; it says nothing about what waits here
                continue
            if peer == self._peer:
                datagrams.append(datagram)
                self._in_a_row = 0
            elif self.is_pinned or not self._is_from_remote(peer):
                self._leave_aside()
            else:
                self._others.append((datagram, peer))
        if not datagrams and self._others:
            peer = self._peer = self._others[0][1]
            datagrams = [each for each, sender in self._others if sender == peer]
            self._others = deque([each for each in self._others if each[1] != peer], maxlen=_WAITING)
        return datagrams

    def pin(self) -> None:
        """From now on hear only the sender of what was handed out last."""
        self.is_pinned = True
        self.foreign += len(self._others)
        self._others.clear()

    def release(self) -> None:
        """From now on hear every sender again."""
        self.is_pinned = False
        self._in_a_row = 0
        if self._is_filtered:
            self._is_filtered = False
            self._socket.setsockopt(socket.SOL_SOCKET, _SO_DETACH_FILTER, 0)

    def _leave_aside(self) -> None:
        """Count a datagram that is none of the sender's; of too many, have the system drop those that follow."""
        self.foreign += 1
        self._in_a_row += 1
        if self._in_a_row != _FLOOD or not self.is_pinned or self._peer is None:
            return
        host, port = self._peer
        source = int.from_bytes(socket.inet_aton(host), "big")
        # Classic BPF, (code, jump if true, jump if false, value): what another address or port sent is dropped.
        program = (
            (0x20, 0, 0, 0xFFF0000C),  # load the source address, from the IP header
            (0x15, 0, 3, source),
            (0x28, 0, 0, 0),  # load the source port, with which the UDP header begins
            (0x15, 0, 1, port),
            (0x06, 0, 0, 0xFFFF),  # keep it whole
            (0x06, 0, 0, 0),  # drop it
        )
        code = ctypes.create_string_buffer(b"".join(struct.pack("HBBI", *each) for each in program))
        where = struct.pack("HP", len(program), ctypes.addressof(code))
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, _SO_ATTACH_FILTER, where)
        except OSError:  # a system without such filters; all are read, and counted
            return
        self._is_filtered = True

    def send(self, datagram: bytes) -> None:
        """Answer the sender of what was handed out last; a reply that cannot leave is lost, as on any network."""
        if self._peer is None:
            return
        _send(self._socket, datagram, self._peer)

    def _is_from_remote(self, peer: _Address) -> bool:
        return self._remote is None or peer[0] == self._remote


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


def resolve(host: str) -> str:
    """The IPv4 address of ``host``.

    Raises:
        NoConnection: the name is unknown.
    """
    try:
        return socket.gethostbyname(host)
    except (OSError, UnicodeError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or str(error)
        raise NoConnection(message("host_unknown", host=host, error=reason)) from error


def free_port() -> int:
    """A UDP port that is free at this moment."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def is_loopback(host: str) -> bool:
    """Whether a host name or address means this machine; no name but ``localhost`` does, and none is looked up."""
    try:
        return host.lower() == "localhost" or ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def _send(sender: socket.socket, datagram: bytes, address: tuple[str, int]) -> None:
    try:
        sender.sendto(datagram, address)
    except BlockingIOError:
        return  # the send buffer is full: UDP may lose a datagram anywhere, the next one follows in 4 ms
    except OSError as error:
        if error.errno not in {errno.ECONNREFUSED, errno.ENETUNREACH, errno.EHOSTUNREACH, errno.ENETDOWN}:
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

    def send(self, datagram: bytes) -> None:
        self._outbox.append(datagram)

    def pin(self) -> None:
        """It always is."""

    def release(self) -> None:
        """There is no other sender."""

    @property
    def has_datagram(self) -> bool:
        return bool(self._inbox)

    def receive_next(self) -> bytes | None:
        """The oldest datagram that waits."""
        return self._inbox.popleft() if self._inbox else None

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
