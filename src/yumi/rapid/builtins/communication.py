"""RAPID's communication: bytes and bits, TCP and UDP sockets, message queues.

A rawbytes holds up to 1024 bytes, all 0 at first; its length is the last position that was written to.

Sockets have the limits and errors of the option PC Interface. Nothing here waits for the network: an instruction asks
its socket once per advance of the task until it is done or its time is over. A host closes the sockets of a socketdev
that goes: at PP to main, or with the routine it was declared in.

Each task has the message queue RMQ_ and its name; clients of RWS have theirs, too.
"""

from __future__ import annotations

import errno
import ipaddress
import math
import struct
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from typing import Any, TypeVar

from yumi.rapid.builtins.data import CONSTANTS
from yumi.rapid.devices import Message, MessageQueues, Socket
from yumi.rapid.library import Call, Library, Wait, whole_argument
from yumi.rapid.machine import ChangeOrder
from yumi.rapid.parser import format_value, parse_value
from yumi.rapid.types import (
    DNUM,
    LONGEST_STRING,
    STRING,
    RapidRuntimeError,
    RapidValueError,
    Type,
    is_numeric,
    resolved,
)

T = TypeVar("T")


# Bytes --------------------------------------------------------------------------------------------------------------

RAWBYTES = Library(CONSTANTS)
MOST_BYTES = 1024
ENCODING = "latin-1"
BITS_OF_DNUM = 52
_LARGEST_BYTE = 255

# inttypes by value: struct's letter for the integers of 1, 2, 4 and 8 bytes, negative where they have a sign.
INTEGERS = {1: "B", 2: "H", 4: "I", 8: "Q", -1: "b", -2: "h", -4: "i", -8: "q"}
for _name, _size in (
    *(("USINT", 1), ("UINT", 2), ("UDINT", 4), ("ULINT", 8)),
    *(("SINT", -1), ("INT", -2), ("DINT", -4), ("LINT", -8)),
):
    RAWBYTES.data(_name, "inttypes", _size)


class RawBytes:
    """What a rawbytes stands for."""

    __slots__ = ("data",)

    def __init__(self) -> None:
        self.data = bytearray()

    def put(self, start: int, content: bytes) -> None:
        """Write at a position from 0; raises ERR_OUTOFBND beyond 1024 bytes."""
        if start + len(content) > MOST_BYTES:
            sentence = f"{len(content)} bytes from position {start + 1} are more than the {MOST_BYTES} of a rawbytes."
            raise RapidRuntimeError("ERR_OUTOFBND", sentence)
        self.data.extend(bytes(max(0, start - len(self.data))))
        self.data[start : start + len(content)] = content

    def get(self, start: int, count: int) -> bytes:
        """Bytes from a position from 0; raises ERR_OUTOFBND beyond its length."""
        if start + count > len(self.data):
            sentence = f"{count} bytes from position {start + 1} are more than the {len(self.data)} that are there."
            raise RapidRuntimeError("ERR_OUTOFBND", sentence)
        return bytes(self.data[start : start + count])


RAWBYTES.object_type("rawbytes", RawBytes)


@RAWBYTES.instruction("ClearRawBytes", r"VAR rawbytes RawData, \num FromIndex")
def clear_raw_bytes(call: Call) -> None:
    raw: RawBytes = call["RawData"]
    del raw.data[whole_argument(call, "FromIndex", 1, MOST_BYTES, 1) - 1 :]


@RAWBYTES.function("RawBytesLen", "VAR rawbytes RawData", "num")
def raw_bytes_length(call: Call) -> float:
    return len(call["RawData"].data)


@RAWBYTES.instruction(
    "CopyRawBytes", r"VAR rawbytes FromRawData, num FromIndex, VAR rawbytes ToRawData, num ToIndex, \num NoOfBytes"
)
def copy_raw_bytes(call: Call) -> None:
    source: RawBytes = call["FromRawData"]
    start, to = whole_argument(call, "FromIndex", 1, MOST_BYTES) - 1, whole_argument(call, "ToIndex", 1, MOST_BYTES) - 1
    count = min(max(0, len(source.data) - start), MOST_BYTES - to)  # to the end, or to where there is no more room
    if call.present("NoOfBytes"):
        count = whole_argument(call, "NoOfBytes", 0, MOST_BYTES)
    call["ToRawData"].put(to, source.get(start, count))


_NUMBER_FORMATS = r"\switch Hex1 | \num IntX | \switch Float4 | \switch Float8"


@RAWBYTES.instruction(
    "PackRawBytes",
    rf"anyvalue Value, VAR rawbytes RawData, \switch Network, num StartIndex, {_NUMBER_FORMATS} | \switch ASCII",
)
def pack_raw_bytes(call: Call) -> None:
    raw: RawBytes = call["RawData"]
    start = whole_argument(call, "StartIndex", 1, len(raw.data) + 1) - 1
    value, type_ = call["Value"], call.reference("Value").type
    if call.present("ASCII"):
        content = value.encode(ENCODING, "replace") if resolved(type_) == STRING else bytes([_byte(call, value)])
        if len(content) > LONGEST_STRING:
            raise RapidRuntimeError("ERR_STRTOOLNG", f"PackRawBytes takes {LONGEST_STRING} characters.")
    elif call.present("Hex1"):
        content = bytes([_byte(call, value if is_numeric(type_) else _parsed_integer(call, value, 16))])
    else:
        if not is_numeric(type_):
            raise _wrong_type(call, type_)
        letter = _struct_letter(call, type_)
        if letter not in "fd" and value != int(value):
            raise RapidRuntimeError("ERR_INT_NOTVAL", f"PackRawBytes packs an integer with IntX, not {value:g}.")
        try:
            content = struct.pack(_byte_order(call) + letter, value if letter in "fd" else int(value))
        except (struct.error, OverflowError) as error:
            raise RapidRuntimeError("ERR_INT_MAXVAL", f"{value:g} does not fit into the bytes: {error}.") from error
    raw.put(start, content)


@RAWBYTES.instruction(
    "UnpackRawBytes",
    rf"VAR rawbytes RawData, \switch Network, num StartIndex, INOUT anytype Value, {_NUMBER_FORMATS} | \num ASCII",
)
def unpack_raw_bytes(call: Call) -> None:
    raw: RawBytes = call["RawData"]
    type_ = call.reference("Value").type
    start = whole_argument(call, "StartIndex", 1, MOST_BYTES) - 1
    if call.present("ASCII"):
        count = whole_argument(call, "ASCII", 0, LONGEST_STRING)
        content = raw.get(start, count)
        if resolved(type_) == STRING:
            call["Value"] = content.decode(ENCODING)
        elif is_numeric(type_) and count == 1:
            call["Value"] = content[0]
        else:
            raise _wrong_type(call, type_)
        return
    if call.present("Hex1"):
        number = raw.get(start, 1)[0]
        if not is_numeric(type_) and resolved(type_) != STRING:
            raise _wrong_type(call, type_)
        call["Value"] = number if is_numeric(type_) else f"{number:02X}"
        return
    if not is_numeric(type_):
        raise _wrong_type(call, type_)
    layout = _byte_order(call) + _struct_letter(call, type_)
    call["Value"] = struct.unpack(layout, raw.get(start, struct.calcsize(layout)))[0]


def _byte_order(call: Call) -> str:
    r"""Without \Network the byte of least weight comes first."""
    return ">" if call.present("Network") else "<"


def _struct_letter(call: Call, type_: Type) -> str:
    r"""The number's form: one of \IntX, \Float4 and \Float8 must be given."""
    if call.present("Float4"):
        return "f"
    if call.present("Float8"):
        return "d"
    if not call.present("IntX"):
        sentence = rf"{call.name} needs one of \Hex1, \IntX, \Float4, \Float8 and \ASCII."
        raise RapidRuntimeError("ERR_ARGVALERR", sentence)
    letter = INTEGERS.get(int(call["IntX"]))
    if letter is None:
        raise RapidRuntimeError("ERR_ARGVALERR", f"{call.name}: a {type_.name} is not an IntX of {call['IntX']:g}.")
    return letter


def _wrong_type(call: Call, type_: Type) -> RapidRuntimeError:
    return RapidRuntimeError("ERR_ARGVALERR", f"{call.name} does not take a {type_.name} in this form.")


@RAWBYTES.instruction("PackDNHeader", "string Service, string Path, VAR rawbytes RawData")
def pack_device_net_header(call: Call) -> None:
    """The header of a DeviceNet explicit message: format, service, size of the path, path.

    RAPID reference manual, PackDNHeader: the path is "size,bytes in hexadecimal form,...", as EDS files have it.
    """
    raw: RawBytes = call["RawData"]
    parts = call["Path"].split(",")
    text = parts[1] if len(parts) > 1 else parts[0]
    try:
        path = bytes.fromhex(text)
        header = bytes([0, int(call["Service"], 16), len(path)])
    except ValueError as error:
        sentence = f"PackDNHeader takes hexadecimal numbers, not '{call['Service']}' and '{text}'."
        raise RapidRuntimeError("ERR_ARGVALERR", sentence) from error
    raw.data.clear()
    raw.put(0, header + path)


# One byte and text ------------------------------------------------------------------------------------------------

_BASES = {"Hex": (16, "02X"), "Okt": (8, "03o"), "Bin": (2, "08b")}
_TEXT_FORMS = r"\switch Hex | \switch Okt | \switch Bin | \switch Char"


@RAWBYTES.function("ByteToStr", rf"byte BitData, {_TEXT_FORMS}", "string")
def byte_to_text(call: Call) -> str:
    value = _byte(call, call["BitData"])
    if call.present("Char"):
        return chr(value)
    return next((format(value, form) for name, (_, form) in _BASES.items() if call.present(name)), str(value))


@RAWBYTES.function("StrToByte", rf"string ConStr, {_TEXT_FORMS}", "byte")
def text_to_byte(call: Call) -> float:
    text: str = call["ConStr"]
    if call.present("Char"):
        if len(text) != 1:
            raise RapidRuntimeError("ERR_ARGVALERR", rf"StrToByte \Char takes one character, not '{text}'.")
        return float(ord(text) & _LARGEST_BYTE)
    base = next((base for name, (base, _) in _BASES.items() if call.present(name)), 10)
    return float(_byte(call, _parsed_integer(call, text, base)))


def _parsed_integer(call: Call, text: str, base: int) -> float:
    try:
        return float(int(text, base))
    except ValueError as error:
        raise RapidRuntimeError("ERR_ARGVALERR", f"{call.name}: '{text}' is no number of base {base}.") from error


def _byte(call: Call, value: Any) -> int:
    return _integer(call, value, _LARGEST_BYTE)


def _integer(call: Call, value: float, largest: int) -> int:
    if value != int(value):
        raise RapidRuntimeError("ERR_INT_NOTVAL", f"{call.name} takes an integer, not {value:g}.")
    if not 0 <= value <= largest:
        raise RapidRuntimeError("ERR_INT_MAXVAL", f"{call.name} takes 0 to {largest}, not {value:g}.")
    return int(value)


# Bits: each function for a byte (8 bits) and, with Dnum in its name, for a dnum (52 bits) ----------------------------


def _add_bits(suffix: str, type_name: str, bits: int) -> None:
    largest = (1 << bits) - 1

    def operands(call: Call) -> tuple[int, int]:
        return _integer(call, call["BitData1"], largest), _integer(call, call["BitData2"], largest)

    def combined(name: str, combine: Any) -> None:
        signature = f"{type_name} BitData1, {type_name} BitData2"
        RAWBYTES.function(f"Bit{name}{suffix}", signature, type_name)(lambda call: float(combine(*operands(call))))

    combined("And", lambda left, right: left & right)
    combined("Or", lambda left, right: left | right)
    combined("XOr", lambda left, right: left ^ right)

    def shifted(call: Call) -> float:
        value, steps = _integer(call, call["BitData"], largest), whole_argument(call, "ShiftSteps", 0, bits)
        mask = (1 << whole_argument(call, "Size", 1, bits, bits)) - 1 if suffix else largest
        return float((value << steps) & mask if "LSh" in call.name else value >> steps)

    size = r", \num Size" if suffix else ""
    for name in ("BitLSh", "BitRSh"):
        RAWBYTES.function(f"{name}{suffix}", f"{type_name} BitData, num ShiftSteps{size}", type_name)(shifted)

    @RAWBYTES.function(f"BitNeg{suffix}", f"{type_name} BitData{size}", type_name)
    def negated(call: Call) -> float:
        mask = (1 << whole_argument(call, "Size", 1, bits, bits)) - 1 if suffix else largest
        return float(~_integer(call, call["BitData"], largest) & mask)

    @RAWBYTES.function(f"BitCheck{suffix}", f"{type_name} BitData, num BitPos", "bool")
    def is_set(call: Call) -> bool:
        return bool(_integer(call, call["BitData"], largest) >> (whole_argument(call, "BitPos", 1, bits) - 1) & 1)


_add_bits("", "byte", 8)
_add_bits("Dnum", "dnum", BITS_OF_DNUM)


@RAWBYTES.instruction("BitSet", "INOUT anynum BitData, num BitPos")
@RAWBYTES.instruction("BitClear", "INOUT anynum BitData, num BitPos")
def change_bit(call: Call) -> None:
    bits = BITS_OF_DNUM if resolved(call.reference("BitData").type) == DNUM else 8
    value = _integer(call, call["BitData"], (1 << bits) - 1)
    bit = 1 << (whole_argument(call, "BitPos", 1, bits) - 1)
    call["BitData"] = float(value | bit if call.name == "BitSet" else value & ~bit)


# Sockets ------------------------------------------------------------------------------------------------------------

SOCKETS = Library(RAWBYTES)
SOCKET_TIMEOUT_S = 60.0  # of SocketAccept, SocketConnect and SocketReceive
WAIT_MAX_S = 9_999_999.0  # what WAIT_MAX holds: for ever, which message queues wait without a time
LARGEST_PORT = 65535


class SocketStatus(IntEnum):
    """What SocketGetStatus gives."""

    CREATED = 1
    CONNECTED = 2
    BOUND = 3
    LISTENING = 4
    CLOSED = 5


class SocketDevice:
    """What a socketdev stands for.

    Attributes:
        socket: the host's, None while it is closed.
        status: what the program made of it.
        is_datagram: whether it is UDP.
    """

    __slots__ = ("is_datagram", "socket", "status")

    def __init__(self) -> None:
        self.socket: Socket | None = None
        self.status = SocketStatus.CLOSED
        self.is_datagram = False

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


def _call_network(call: Call, device: SocketDevice, action: Callable[[], T]) -> T:
    """What the network answers; a connection that broke leaves a closed socketdev."""
    try:
        return action()
    except OSError as error:
        name = _SOCKET_ERRORS.get(error.errno or 0, "ERR_SOCK_UNSPEC")
        if name == "ERR_SOCK_CLOSED" and device.status is SocketStatus.CONNECTED:
            device.close()
        raise RapidRuntimeError(name, f"{call.name}: {error.strerror or error}.") from error


def _open_socket(call: Call, name: str = "Socket") -> tuple[SocketDevice, Socket]:
    """The socketdev and its socket; raises ERR_SOCK_CLOSED where it has none."""
    device: SocketDevice = call[name]
    if device.socket is None:
        variable = call.reference(name).name
        raise RapidRuntimeError("ERR_SOCK_CLOSED", f"{call.name}: {variable} is closed; SocketCreate makes a socket.")
    return device, device.socket


def _checked_address(call: Call, address: str, port_name: str) -> tuple[str, int]:
    """Address and port of an argument pair; raises ERR_SOCK_ADDR_INVALID."""
    port: float = call[port_name]
    try:
        ipaddress.IPv4Address(address)
    except ValueError as error:
        sentence = f"{call.name} takes an address such as 192.168.125.1, not '{address}'."
        raise RapidRuntimeError("ERR_SOCK_ADDR_INVALID", sentence) from error
    if port != int(port) or not 1 <= port <= LARGEST_PORT:
        sentence = f"{call.name} takes a port from 1 to {LARGEST_PORT}, not {port:g}."
        raise RapidRuntimeError("ERR_SOCK_ADDR_INVALID", sentence)
    return address, int(port)


def _deadline(call: Call) -> float:
    r"""The task time at which \Time is over [s]; infinite with WAIT_MAX."""
    time: float = call.get("Time", SOCKET_TIMEOUT_S)
    return math.inf if time >= WAIT_MAX_S else call.task.now + max(0.0, time)


def _wait_for(call: Call, end: float, ask: Callable[[], T | None]) -> Any:
    """Ask until there is an answer; raises ERR_SOCK_TIMEOUT at the end."""
    while (found := ask()) is None:
        if call.task.now >= end:
            raise RapidRuntimeError("ERR_SOCK_TIMEOUT", f"{call.name} has waited in vain.")
        yield None if math.isinf(end) else end
    return found


@SOCKETS.instruction("SocketCreate", r"VAR socketdev Socket, \switch UDP")
def create_socket(call: Call) -> None:
    device: SocketDevice = call["Socket"]
    if device.socket is not None:
        variable = call.reference("Socket").name
        raise RapidRuntimeError("ERR_SOCK_IS_CONN", f"SocketCreate: {variable} is open; SocketClose closes it.")
    network, is_datagram = call.task.host.devices.network, call.present("UDP")
    socket = _call_network(call, device, network.udp if is_datagram else network.tcp)
    device.opened(socket, SocketStatus.CREATED, is_datagram=is_datagram)


@SOCKETS.instruction("SocketClose", "VAR socketdev Socket")
def close_socket(call: Call) -> None:
    call["Socket"].close()


@SOCKETS.function("SocketGetStatus", "VAR socketdev Socket", "socketstatus")
def socket_status(call: Call) -> float:
    return float(call["Socket"].status)


@SOCKETS.instruction("SocketBind", "VAR socketdev Socket, string LocalAddress, num LocalPort")
def bind_socket(call: Call) -> None:
    device, socket = _open_socket(call)
    address, port = _checked_address(call, call["LocalAddress"], "LocalPort")
    if device.status is not SocketStatus.CREATED:
        raise RapidRuntimeError("ERR_SOCK_IS_BOUND", "SocketBind: the socket has an address already.")
    _call_network(call, device, lambda: socket.bind(address, port))
    device.status = SocketStatus.BOUND


@SOCKETS.instruction("SocketListen", "VAR socketdev Socket")
def listen_on_socket(call: Call) -> None:
    device, socket = _open_socket(call)
    if device.status is SocketStatus.CONNECTED:
        raise RapidRuntimeError("ERR_SOCK_IS_CONN", "SocketListen: the socket is connected.")
    if device.status is SocketStatus.CREATED or device.is_datagram:
        raise RapidRuntimeError("ERR_SOCK_NOT_BOUND", "SocketListen needs a TCP socket with an address: SocketBind.")
    _call_network(call, device, socket.listen)
    device.status = SocketStatus.LISTENING


@SOCKETS.instruction(
    "SocketAccept", r"VAR socketdev Socket, VAR socketdev ClientSocket, \VAR string ClientAddress, \num Time"
)
def accept_connection(call: Call) -> Wait:
    end = _deadline(call)

    def ask() -> tuple[Socket, str] | None:
        device, socket = _open_socket(call)
        if device.status is not SocketStatus.LISTENING:
            raise RapidRuntimeError("ERR_SOCK_NOT_BOUND", "SocketAccept needs a socket that listens: SocketListen.")
        return _call_network(call, device, socket.accept)

    connection, address = yield from _wait_for(call, end, ask)
    call["ClientSocket"].opened(connection, SocketStatus.CONNECTED)
    if call.present("ClientAddress"):
        call["ClientAddress"] = address


@SOCKETS.instruction("SocketConnect", r"VAR socketdev Socket, string Address, num Port, \num Time")
def connect_socket(call: Call) -> Wait:
    device, socket = _open_socket(call)
    address, port = _checked_address(call, call["Address"], "Port")
    if device.status in (SocketStatus.CONNECTED, SocketStatus.LISTENING):
        raise RapidRuntimeError("ERR_SOCK_IS_CONN", "SocketConnect: the socket is connected or listens.")
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
        content: bytes = call["Str"].encode(ENCODING, "replace")
    elif call.present("RawData"):
        content = bytes(call["RawData"].data)
    elif call.present("Data"):
        values = call["Data"]
        if any(value != int(value) or not 0 <= value <= _LARGEST_BYTE for value in values):
            raise RapidRuntimeError("ERR_INT_NOTVAL", f"{call.name} sends integers from 0 to {_LARGEST_BYTE}.")
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
        call["Str"] = content.decode(ENCODING)
    elif call.present("RawData"):
        raw: RawBytes = call["RawData"]
        raw.data[:] = content
    else:
        reference = call.reference("Data")
        values = list(reference.value)
        values[: len(content)] = [float(byte) for byte in content]
        reference.value = tuple(values)
    if call.present("NoRecBytes"):
        call["NoRecBytes"] = float(len(content))


@SOCKETS.instruction("SocketSend", rf"VAR socketdev Socket, {_SENT}")
def send_bytes(call: Call) -> Wait:
    content = _bytes_to_send(call)
    while content:
        device, socket = _connected_socket(call)
        content = content[_call_network(call, device, partial(socket.send, content)) :]
        if content:  # the other side does not read
            yield None


@SOCKETS.instruction(
    "SocketReceive", rf"VAR socketdev Socket, {_RECEIVED}, \num ReadNoOfBytes, \VAR num NoRecBytes, \num Time"
)
def receive_bytes(call: Call) -> Wait:
    room = _room(call)
    wanted = whole_argument(call, "ReadNoOfBytes", 1, room) if call.present("ReadNoOfBytes") else None
    end, got = _deadline(call), bytearray()

    def ask() -> bytes | None:
        device, socket = _connected_socket(call)
        found = _call_network(call, device, lambda: socket.receive((wanted or room) - len(got)))
        if found == b"":
            device.close()
            raise RapidRuntimeError("ERR_SOCK_CLOSED", "SocketReceive: the other side has closed the connection.")
        got.extend(found or b"")
        return bytes(got) if got and len(got) >= (wanted or 1) else None

    _write_received(call, (yield from _wait_for(call, end, ask)))


@SOCKETS.instruction("SocketSendTo", rf"VAR socketdev Socket, string RemoteAddress, num RemotePort, {_SENT}")
def send_datagram(call: Call) -> None:
    device, socket = _datagram_socket(call)
    address, port = _checked_address(call, call["RemoteAddress"], "RemotePort")
    content = _bytes_to_send(call)
    _call_network(call, device, lambda: socket.send_to(content, address, port))


@SOCKETS.instruction(
    "SocketReceiveFrom",
    rf"VAR socketdev Socket, {_RECEIVED}, \VAR num NoRecBytes, VAR string RemoteAddress, VAR num RemotePort, \num Time",
)
def receive_datagram(call: Call) -> Wait:
    room, end = _room(call), _deadline(call)

    def ask() -> tuple[bytes, str, int] | None:
        device, socket = _datagram_socket(call)
        return _call_network(call, device, lambda: socket.receive_from(room))

    content, address, port = yield from _wait_for(call, end, ask)
    _write_received(call, content)
    call["RemoteAddress"], call["RemotePort"] = address, float(port)


@SOCKETS.function("SocketPeek", "VAR socketdev Socket", "num")
def bytes_waiting(call: Call) -> float:
    device, socket = _open_socket(call)
    return float(_call_network(call, device, socket.waiting))


def _connected_socket(call: Call) -> tuple[SocketDevice, Socket]:
    device, socket = _open_socket(call)
    if device.status is not SocketStatus.CONNECTED:
        raise RapidRuntimeError("ERR_SOCK_NOT_CONN", f"{call.name}: the socket has no connection.")
    return device, socket


def _datagram_socket(call: Call) -> tuple[SocketDevice, Socket]:
    device, socket = _open_socket(call)
    if not device.is_datagram:
        raise RapidRuntimeError("ERR_SOCK_UNSPEC", rf"{call.name} needs a socket made with SocketCreate \UDP.")
    return device, socket


# Message queues -----------------------------------------------------------------------------------------------------

QUEUES = Library(CONSTANTS)


@dataclass(eq=False, slots=True)
class QueueSlot:
    """What an rmqslot stands for: the name of a queue."""

    name: str = ""


@dataclass(eq=False, slots=True)
class ReceivedMessage:
    """What an rmqmessage stands for."""

    message: Message | None = None


QUEUES.object_type("rmqslot", QueueSlot)
QUEUES.object_type("rmqmessage", ReceivedMessage)
QUEUES.record("rmqheader", {"datatype": "string", "ndim": "num", "dim1": "num", "dim2": "num", "dim3": "num"})


def _queues(call: Call) -> MessageQueues:
    """The controller's queues, with that of the task."""
    queues = call.task.host.devices.queues
    queues.open(_own_queue(call))
    for name in call.task.host.devices.tasks():
        queues.open(f"RMQ_{name}")
    return queues


def _own_queue(call: Call) -> str:
    return f"RMQ_{call.task.name}"


@QUEUES.instruction("RMQFindSlot", "VAR rmqslot Slot, string Name")
def find_slot(call: Call) -> None:
    call["Slot"].name = _queues(call).name(call["Name"])


@QUEUES.function("RMQGetSlotName", "VAR rmqslot Slot", "string")
def slot_name(call: Call) -> str:
    name: str = call["Slot"].name
    if not name:
        raise RapidRuntimeError("ERR_RMQ_INVALID", "RMQGetSlotName: the slot stands for no queue; see RMQFindSlot.")
    return name


def _message_to_send(call: Call) -> Message:
    type_ = call.reference("SendData").type
    sizes = getattr(resolved(type_), "sizes", ())
    text = format_value(type_, call["SendData"])
    return Message(type_.name, sizes, text, _own_queue(call), call.get("UserDef", 0.0))


@QUEUES.instruction("RMQSendMessage", r"VAR rmqslot Slot, anytype SendData, \num UserDef")
def send_message(call: Call) -> None:
    _queues(call).send(slot_name(call), _message_to_send(call))


@QUEUES.instruction(
    "RMQSendWait",
    r"VAR rmqslot Slot, anytype SendData, \num UserDef, VAR rmqmessage Message, anytype ReceiveDataType, "
    r"\num ReceiveUserDef, \num TimeOut",
)
def send_and_wait(call: Call) -> Wait:
    """Send, and wait for an answer of a type; what else comes meanwhile is lost (reference manual, RMQSendWait)."""
    queues, wanted = _queues(call), call.reference("ReceiveDataType").type.name
    queues.send(slot_name(call), _message_to_send(call))

    def fits(message: Message) -> bool:
        is_number_right = not call.present("ReceiveUserDef") or message.user_defined == call["ReceiveUserDef"]
        return message.type_name == wanted and is_number_right

    yield from _wait_for_message(call, fits)


@QUEUES.instruction("RMQReadWait", r"VAR rmqmessage Message, \num TimeOut")
def read_and_wait(call: Call) -> Wait:
    _queues(call)
    yield from _wait_for_message(call, lambda message: True)


def _wait_for_message(call: Call, fits: Callable[[Message], bool]) -> Wait:
    queues = call.task.host.devices.queues
    time: float = call.get("TimeOut", WAIT_MAX_S)
    end = math.inf if time >= WAIT_MAX_S else call.task.now + time
    while True:
        message = queues.take(_own_queue(call))
        if message is not None and fits(message):
            call["Message"].message = message
            return
        if message is None:
            if call.task.now >= end:
                raise RapidRuntimeError("ERR_RMQ_TIMEOUT", f"{call.name} has waited in vain.")
            yield None if math.isinf(end) else end


@QUEUES.instruction("RMQGetMessage", "VAR rmqmessage Message")
def get_message(call: Call) -> None:
    message = _queues(call).take(_own_queue(call))
    if message is None:
        raise RapidRuntimeError("ERR_RMQ_NOMSG", "RMQGetMessage: the queue of the task is empty.")
    call["Message"].message = message


def _received_message(call: Call) -> Message:
    message: Message | None = call["Message"].message
    if message is None:
        raise RapidRuntimeError("ERR_RMQ_INVMSG", f"{call.name}: nothing has been received into the message.")
    return message


@QUEUES.instruction("RMQGetMsgData", "VAR rmqmessage Message, INOUT anytype Data")
def message_data(call: Call) -> None:
    message, type_ = _received_message(call), call.reference("Data").type
    if message.type_name.lower() != type_.name.lower():
        sentence = f"The message is a {message.type_name}, not a {type_.name}."
        raise RapidRuntimeError("ERR_RMQ_VALUE", sentence)
    sizes = getattr(resolved(type_), "sizes", ())
    if len(sizes) != len(message.sizes):
        raise RapidRuntimeError("ERR_RMQ_DIM", f"The message has {len(message.sizes)} dimensions, not {len(sizes)}.")
    try:
        call["Data"] = parse_value(type_, message.text)
    except RapidValueError as error:
        raise RapidRuntimeError("ERR_RMQ_VALUE", str(error)) from error


@QUEUES.instruction(
    "RMQGetMsgHeader", r"VAR rmqmessage Message, \INOUT rmqheader Header, \VAR rmqslot SenderId, \INOUT num UserDef"
)
def message_header(call: Call) -> None:
    message = _received_message(call)
    if call.present("Header"):
        sizes = (*message.sizes, 0, 0, 0)[:3]
        call["Header"] = (message.type_name, len(message.sizes), *sizes)
    if call.present("SenderId"):
        call["SenderId"].name = message.sender
    if call.present("UserDef"):
        call["UserDef"] = message.user_defined


@QUEUES.instruction("IRMQMessage", "anytype InterruptDataType, VAR intnum Interrupt")
def order_message(call: Call) -> None:
    """An interrupt whenever a message of a type comes into the queue of the task."""
    queues, interrupts, number = _queues(call), call.task.interrupts, int(call["Interrupt"])
    wanted, order = call.reference("InterruptDataType").type.name, ChangeOrder(is_single=False)
    watchers = queues.watchers.setdefault(_own_queue(call).lower(), [])

    def arrived(message: Message) -> None:
        if not interrupts.is_ordered(number, order):  # deleted, or ordered anew
            watchers.remove(arrived)
        elif message.type_name == wanted:
            interrupts.occurred(number)

    interrupts.order(number, order)
    watchers.append(arrived)


@QUEUES.instruction("RMQEmptyQueue")
def empty_queue(call: Call) -> None:
    _queues(call).empty(_own_queue(call))
