"""RAPID's sockets, TCP and UDP, with the limits and errors of the option PC Interface.

Nothing here waits for the network: an instruction asks its socket once per advance of the task until it is done or its
time is over. A host closes the sockets of a socketdev that goes: at PP to main, or with the routine it was declared in.
"""

from __future__ import annotations

import errno
import ipaddress
import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from typing import Any, TypeVar

from virtual_irc5.rapid.builtins.rawbytes import BYTES_ENCODING, LARGEST_BYTE, MOST_BYTES, RAWBYTES, RawBytes
from virtual_irc5.rapid.call import Call, Wait, whole_argument
from virtual_irc5.rapid.devices import Socket
from virtual_irc5.rapid.rapid_library import Library
from virtual_irc5.rapid.types import LONGEST_STRING, RapidRuntimeError

_T = TypeVar("_T")
SOCKETS = Library(RAWBYTES)
_SOCKET_TIMEOUT_S = 60.0  # of SocketAccept, SocketConnect and SocketReceive
WAIT_MAX_S = 9_999_999.0  # what WAIT_MAX holds: for ever, which message queues wait without a time
_LARGEST_PORT = 65535


class SocketStatus(IntEnum):
    """What SocketGetStatus gives."""

    CREATED = 1
    CONNECTED = 2
    BOUND = 3
    LISTENING = 4
    CLOSED = 5


@dataclass(eq=False, slots=True)
class SocketDevice:
    """What a socketdev stands for.

    Attributes:
        socket: the host's, None while it is closed.
        status: what the program made of it.
        is_datagram: whether it is UDP.
    """

    socket: Socket | None = None
    status: SocketStatus = SocketStatus.CLOSED
    is_datagram: bool = False

    def opened(self, socket: Socket, status: SocketStatus, *, is_datagram: bool = False) -> None:
        self.close()
        self.socket, self.status, self.is_datagram = socket, status, is_datagram

    def close(self) -> None:
        """Close it; nothing happens where it is closed."""
        socket, self.socket, self.status = self.socket, None, SocketStatus.CLOSED
        if socket is not None:
            with suppress(OSError):
                socket.close()


SOCKETS.object_type("socketdev", SocketDevice)
SOCKETS.alias("socketstatus", "num")
for _status in SocketStatus:
    SOCKETS.data(f"SOCKET_{_status.name}", "socketstatus", _status)
SOCKETS.data("WAIT_MAX", "num", WAIT_MAX_S)

_SOCKET_ERRORS = {
    errno.EADDRINUSE: "ERR_SOCK_ADDR_INUSE",
    errno.EADDRNOTAVAIL: "ERR_SOCK_ADDR_INVALID",
    errno.EACCES: "ERR_SOCK_ADDR_INVALID",
    errno.ENETUNREACH: "ERR_SOCK_NET_UNREACH",
    errno.EHOSTUNREACH: "ERR_SOCK_NET_UNREACH",
    errno.ETIMEDOUT: "ERR_SOCK_TIMEOUT",
    errno.EISCONN: "ERR_SOCK_IS_CONN",
    errno.ENOTCONN: "ERR_SOCK_NOT_CONN",
    **dict.fromkeys(
        (errno.ECONNRESET, errno.ECONNABORTED, errno.ECONNREFUSED, errno.EPIPE, errno.EBADF), "ERR_SOCK_CLOSED"
    ),
}


def _call_network(call: Call, device: SocketDevice, action: Callable[[], _T]) -> _T:
    """What the network answers; a connection that broke leaves a closed socketdev."""
    try:
        return action()
    except OSError as error:
        name = _SOCKET_ERRORS.get(error.errno or 0, "ERR_SOCK_UNSPEC")
        if name == "ERR_SOCK_CLOSED" and device.status is SocketStatus.CONNECTED:
            device.close()
        raise call.error(name, f"{error.strerror or error}.") from error


def _open_socket(call: Call) -> tuple[SocketDevice, Socket]:
    """The socketdev and its socket; raises ERR_SOCK_CLOSED where it has none."""
    device: SocketDevice = call["Socket"]
    if device.socket is None:
        variable = call.reference("Socket").name
        raise call.error("ERR_SOCK_CLOSED", f"{variable} is closed; SocketCreate makes a socket.")
    return device, device.socket


def _checked_address(call: Call, address: str, port_name: str) -> tuple[str, int]:
    """Address and port of an argument pair; raises ERR_SOCK_ADDR_INVALID."""
    port: float = call[port_name]
    try:
        ipaddress.IPv4Address(address)
    except ValueError as error:
        sentence = f"{call.name} takes an address such as 192.168.125.1, not '{address}'."
        raise RapidRuntimeError("ERR_SOCK_ADDR_INVALID", sentence) from error
    if port != int(port) or not 1 <= port <= _LARGEST_PORT:
        sentence = f"{call.name} takes a port from 1 to {_LARGEST_PORT}, not {port:g}."
        raise RapidRuntimeError("ERR_SOCK_ADDR_INVALID", sentence)
    return address, int(port)


def _deadline(call: Call) -> float:
    r"""The task time at which \Time is over [s]; infinite with WAIT_MAX."""
    time: float = call.get("Time", _SOCKET_TIMEOUT_S)
    return math.inf if time >= WAIT_MAX_S else call.task.now + max(0.0, time)


def _wait_for(call: Call, end: float, ask: Callable[[], _T | None]) -> Any:
    """Ask until there is an answer; raises ERR_SOCK_TIMEOUT at the end."""
    while (found := ask()) is None:
        if call.task.now >= end:
            raise RapidRuntimeError("ERR_SOCK_TIMEOUT", f"{call.name} has waited in vain.")
        yield None if math.isinf(end) else end
    return found


@SOCKETS.instruction("SocketCreate", r"VAR socketdev Socket, \switch UDP")
def _create_socket(call: Call) -> None:
    device: SocketDevice = call["Socket"]
    if device.socket is not None:
        variable = call.reference("Socket").name
        raise call.error("ERR_SOCK_IS_CONN", f"{variable} is open; SocketClose closes it.")
    network, is_datagram = call.task.host.devices.network, call.present("UDP")
    socket = _call_network(call, device, network.udp if is_datagram else network.tcp)
    device.opened(socket, SocketStatus.CREATED, is_datagram=is_datagram)


@SOCKETS.instruction("SocketClose", "VAR socketdev Socket")
def _close_socket(call: Call) -> None:
    call["Socket"].close()


@SOCKETS.function("SocketGetStatus", "VAR socketdev Socket", "socketstatus")
def _socket_status(call: Call) -> float:
    return float(call["Socket"].status)


@SOCKETS.instruction("SocketBind", "VAR socketdev Socket, string LocalAddress, num LocalPort")
def _bind_socket(call: Call) -> None:
    device, socket = _open_socket(call)
    address, port = _checked_address(call, call["LocalAddress"], "LocalPort")
    if device.status is not SocketStatus.CREATED:
        raise call.error("ERR_SOCK_IS_BOUND", "the socket has an address already.")
    _call_network(call, device, lambda: socket.bind(address, port))
    device.status = SocketStatus.BOUND


@SOCKETS.instruction("SocketListen", "VAR socketdev Socket")
def _listen_on_socket(call: Call) -> None:
    device, socket = _open_socket(call)
    if device.status is SocketStatus.CONNECTED:
        raise call.error("ERR_SOCK_IS_CONN", "the socket is connected.")
    if device.status is SocketStatus.CREATED or device.is_datagram:
        raise RapidRuntimeError("ERR_SOCK_NOT_BOUND", "SocketListen needs a TCP socket with an address: SocketBind.")
    _call_network(call, device, socket.listen)
    device.status = SocketStatus.LISTENING


@SOCKETS.instruction(
    "SocketAccept", r"VAR socketdev Socket, VAR socketdev ClientSocket, \VAR string ClientAddress, \num Time"
)
def _accept_connection(call: Call) -> Wait:
    end = _deadline(call)

    def ask() -> tuple[Socket, str] | None:
        device, socket = _open_socket(call)
        if device.status is not SocketStatus.LISTENING:
            raise RapidRuntimeError("ERR_SOCK_NOT_BOUND", "SocketAccept needs a socket that listens: SocketListen.")
        return _call_network(call, device, socket.accept)

    connection, address = yield from _wait_for(call, end, ask)
    call["ClientSocket"].opened(connection, SocketStatus.CONNECTED)
    call.give("ClientAddress", address)


@SOCKETS.instruction("SocketConnect", r"VAR socketdev Socket, string Address, num Port, \num Time")
def _connect_socket(call: Call) -> Wait:
    device, socket = _open_socket(call)
    address, port = _checked_address(call, call["Address"], "Port")
    if device.status in (SocketStatus.CONNECTED, SocketStatus.LISTENING):
        raise call.error("ERR_SOCK_IS_CONN", "the socket is connected or listens.")
    end = _deadline(call)
    _call_network(call, device, lambda: socket.connect(address, port))
    # A socket whose connection is refused stays open.
    yield from _wait_for(call, end, lambda: _call_network(call, device, socket.is_connected) or None)
    device.status = SocketStatus.CONNECTED


# Data: one of \Str, \RawData and \Data -----------------------------------------------------------------------------

_SENT = r"\string Str | \VAR rawbytes RawData | \byte Data{*}, \num NoOfBytes"
_RECEIVED = r"\INOUT string Str | \VAR rawbytes RawData | \INOUT byte Data{*}"


def _bytes_to_send(call: Call) -> bytes:
    """The bytes to send; raises ERR_ARGVALERR where there are none, or NoOfBytes is more than there is."""
    if call.present("Str"):
        content: bytes = call["Str"].encode(BYTES_ENCODING, "replace")
    elif call.present("RawData"):
        content = bytes(call["RawData"].data)
    elif call.present("Data"):
        values = call["Data"]
        if any(value != int(value) or not 0 <= value <= LARGEST_BYTE for value in values):
            raise RapidRuntimeError("ERR_INT_NOTVAL", f"{call.name} sends integers from 0 to {LARGEST_BYTE}.")
        content = bytes(int(value) for value in values)[:MOST_BYTES]
    else:
        raise RapidRuntimeError("ERR_ARGVALERR", rf"{call.name} needs \Str, \RawData or \Data.")
    if call.present("NoOfBytes"):
        content = content[: whole_argument(call, "NoOfBytes", 1, max(1, len(content)))]
    if not content:
        raise RapidRuntimeError("ERR_ARGVALERR", f"{call.name} has no bytes to send.")
    return content


def _room(call: Call) -> int:
    """How many bytes the datum takes; raises ERR_ARGVALERR where there is none."""
    if call.present("Str"):
        return LONGEST_STRING
    if call.present("RawData"):
        return MOST_BYTES
    if call.present("Data"):
        return min(MOST_BYTES, len(call["Data"]))
    raise RapidRuntimeError("ERR_ARGVALERR", rf"{call.name} needs \Str, \RawData or \Data.")


def _write_received(call: Call, content: bytes) -> None:
    if call.present("Str"):
        call["Str"] = content.decode(BYTES_ENCODING)
    elif call.present("RawData"):
        raw: RawBytes = call["RawData"]
        raw.data[:] = content
    else:
        reference = call.reference("Data")
        values = list(reference.value)
        values[: len(content)] = [float(byte) for byte in content]
        reference.value = tuple(values)
    call.give("NoRecBytes", float(len(content)))


@SOCKETS.instruction("SocketSend", rf"VAR socketdev Socket, {_SENT}")
def _send_bytes(call: Call) -> Wait:
    content = _bytes_to_send(call)
    while content:
        device, socket = _connected_socket(call)
        content = content[_call_network(call, device, partial(socket.send, content)) :]
        if content:  # the other side does not read
            yield None


@SOCKETS.instruction(
    "SocketReceive", rf"VAR socketdev Socket, {_RECEIVED}, \num ReadNoOfBytes, \VAR num NoRecBytes, \num Time"
)
def _receive_bytes(call: Call) -> Wait:
    room = _room(call)
    wanted = whole_argument(call, "ReadNoOfBytes", 1, room) if call.present("ReadNoOfBytes") else None
    end, got = _deadline(call), bytearray()

    def ask() -> bytes | None:
        device, socket = _connected_socket(call)
        found = _call_network(call, device, lambda: socket.receive((wanted or room) - len(got)))
        if found == b"":
            device.close()
            raise call.error("ERR_SOCK_CLOSED", "the other side has closed the connection.")
        got.extend(found or b"")
        return bytes(got) if got and len(got) >= (wanted or 1) else None

    _write_received(call, (yield from _wait_for(call, end, ask)))


@SOCKETS.instruction("SocketSendTo", rf"VAR socketdev Socket, string RemoteAddress, num RemotePort, {_SENT}")
def _send_datagram(call: Call) -> None:
    device, socket = _datagram_socket(call)
    address, port = _checked_address(call, call["RemoteAddress"], "RemotePort")
    content = _bytes_to_send(call)
    _call_network(call, device, lambda: socket.send_to(content, address, port))


@SOCKETS.instruction(
    "SocketReceiveFrom",
    rf"VAR socketdev Socket, {_RECEIVED}, \VAR num NoRecBytes, VAR string RemoteAddress, VAR num RemotePort, \num Time",
)
def _receive_datagram(call: Call) -> Wait:
    room, end = _room(call), _deadline(call)

    def ask() -> tuple[bytes, str, int] | None:
        device, socket = _datagram_socket(call)
        return _call_network(call, device, lambda: socket.receive_from(room))

    content, address, port = yield from _wait_for(call, end, ask)
    _write_received(call, content)
    call["RemoteAddress"], call["RemotePort"] = address, float(port)


@SOCKETS.function("SocketPeek", "VAR socketdev Socket", "num")
def _bytes_waiting(call: Call) -> float:
    device, socket = _open_socket(call)
    return float(_call_network(call, device, socket.waiting))


def _connected_socket(call: Call) -> tuple[SocketDevice, Socket]:
    device, socket = _open_socket(call)
    if device.status is not SocketStatus.CONNECTED:
        raise call.error("ERR_SOCK_NOT_CONN", "the socket has no connection.")
    return device, socket


def _datagram_socket(call: Call) -> tuple[SocketDevice, Socket]:
    device, socket = _open_socket(call)
    if not device.is_datagram:
        raise RapidRuntimeError("ERR_SOCK_UNSPEC", rf"{call.name} needs a socket made with SocketCreate \UDP.")
    return device, socket
