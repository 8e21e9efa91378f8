"""RAPID's bytes and bits: rawbytes, conversions of bytes, and functions of bits.

A rawbytes holds up to 1024 bytes, all 0 at first; its length is the last position that was written to.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import Any

from virtual_irc5.rapid.builtins.data import DATA
from virtual_irc5.rapid.call import Call, whole_argument
from virtual_irc5.rapid.rapid_library import Library
from virtual_irc5.rapid.types import DNUM, LONGEST_STRING, STRING, RapidRuntimeError, Type, is_numeric, resolved_type

# Bytes --------------------------------------------------------------------------------------------------------------

RAWBYTES = Library(DATA)
MOST_BYTES = 1024
BYTES_ENCODING = "latin-1"
_BITS_OF_DNUM = 52
LARGEST_BYTE = 255

# inttypes by value: struct's letter for the integers of 1, 2, 4 and 8 bytes, negative where they have a sign.
_INTEGERS = {1: "B", 2: "H", 4: "I", 8: "Q", -1: "b", -2: "h", -4: "i", -8: "q"}
RAWBYTES.constants("inttypes", "USINT=1 UINT=2 UDINT=4 ULINT=8 SINT=-1 INT=-2 DINT=-4 LINT=-8")


@dataclass(eq=False, slots=True)
class RawBytes:
    """What a rawbytes stands for."""

    data: bytearray = field(default_factory=bytearray)

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
def _clear_raw_bytes(call: Call) -> None:
    raw: RawBytes = call["RawData"]
    del raw.data[whole_argument(call, "FromIndex", 1, MOST_BYTES, 1) - 1 :]


@RAWBYTES.function("RawBytesLen", "VAR rawbytes RawData", "num")
def _raw_bytes_length(call: Call) -> float:
    return len(call["RawData"].data)


@RAWBYTES.instruction(
    "CopyRawBytes", r"VAR rawbytes FromRawData, num FromIndex, VAR rawbytes ToRawData, num ToIndex, \num NoOfBytes"
)
def _copy_raw_bytes(call: Call) -> None:
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
def _pack_raw_bytes(call: Call) -> None:
    raw: RawBytes = call["RawData"]
    start = whole_argument(call, "StartIndex", 1, len(raw.data) + 1) - 1
    value, type_ = call["Value"], call.reference("Value").type
    if call.present("ASCII"):
        content = (
            value.encode(BYTES_ENCODING, "replace") if resolved_type(type_) == STRING else bytes([_byte(call, value)])
        )
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
def _unpack_raw_bytes(call: Call) -> None:
    raw: RawBytes = call["RawData"]
    type_ = call.reference("Value").type
    start = whole_argument(call, "StartIndex", 1, MOST_BYTES) - 1
    if call.present("ASCII"):
        count = whole_argument(call, "ASCII", 0, LONGEST_STRING)
        content = raw.get(start, count)
        if resolved_type(type_) == STRING:
            call["Value"] = content.decode(BYTES_ENCODING)
        elif is_numeric(type_) and count == 1:
            call["Value"] = content[0]
        else:
            raise _wrong_type(call, type_)
        return
    if call.present("Hex1"):
        number = raw.get(start, 1)[0]
        if not is_numeric(type_) and resolved_type(type_) != STRING:
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
    letter = _INTEGERS.get(int(call["IntX"]))
    if letter is None:
        raise call.error("ERR_ARGVALERR", f"a {type_.name} is not an IntX of {call['IntX']:g}.")
    return letter


def _wrong_type(call: Call, type_: Type) -> RapidRuntimeError:
    return RapidRuntimeError("ERR_ARGVALERR", f"{call.name} does not take a {type_.name} in this form.")


@RAWBYTES.instruction("PackDNHeader", "string Service, string Path, VAR rawbytes RawData")
def _pack_device_net_header(call: Call) -> None:
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
def _byte_to_text(call: Call) -> str:
    value = _byte(call, call["BitData"])
    if call.present("Char"):
        return chr(value)
    return next((format(value, form) for name, (_, form) in _BASES.items() if call.present(name)), str(value))


@RAWBYTES.function("StrToByte", rf"string ConStr, {_TEXT_FORMS}", "byte")
def _text_to_byte(call: Call) -> float:
    text: str = call["ConStr"]
    if call.present("Char"):
        if len(text) != 1:
            raise RapidRuntimeError("ERR_ARGVALERR", rf"StrToByte \Char takes one character, not '{text}'.")
        return float(ord(text) & LARGEST_BYTE)
    base = next((base for name, (base, _) in _BASES.items() if call.present(name)), 10)
    return float(_byte(call, _parsed_integer(call, text, base)))


def _parsed_integer(call: Call, text: str, base: int) -> float:
    try:
        return float(int(text, base))
    except ValueError as error:
        raise call.error("ERR_ARGVALERR", f"'{text}' is no number of base {base}.") from error


def _byte(call: Call, value: Any) -> int:
    return _integer(call, value, LARGEST_BYTE)


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
_add_bits("Dnum", "dnum", _BITS_OF_DNUM)


@RAWBYTES.instruction("BitSet", "INOUT anynum BitData, num BitPos")
@RAWBYTES.instruction("BitClear", "INOUT anynum BitData, num BitPos")
def _change_bit(call: Call) -> None:
    bits = _BITS_OF_DNUM if resolved_type(call.reference("BitData").type) == DNUM else 8
    value = _integer(call, call["BitData"], (1 << bits) - 1)
    bit = 1 << (whole_argument(call, "BitPos", 1, bits) - 1)
    call["BitData"] = float(value | bit if call.name == "BitSet" else value & ~bit)
