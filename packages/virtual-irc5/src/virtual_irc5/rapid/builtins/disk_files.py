r"""RAPID's files and directories on the controller's disk; serial channels do not exist here, which Open reports.

An iodev holds the whole file: what a program writes goes to the disk when it closes the file, or when so much waits
that copying it costs little beside what was written. An iodev that goes (PP to main, the end of its routine) closes.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from weakref import WeakKeyDictionary, WeakSet

from virtual_irc5.rapid.builtins.rawbytes import BYTES_ENCODING, MOST_BYTES, RAWBYTES, RawBytes
from virtual_irc5.rapid.builtins.strings import PRINTED, printed_text
from virtual_irc5.rapid.call import Call, RunningTask, whole_argument
from virtual_irc5.rapid.devices import Disk, DiskEntry
from virtual_irc5.rapid.literals import format_value, parse_value
from virtual_irc5.rapid.rapid_library import Library
from virtual_irc5.rapid.types import LONGEST_STRING, RapidRuntimeError, RapidValueError, raised_as

FILES = Library(RAWBYTES)
_EOF_NUM = 9.998e36
_EOF_BIN = -1.0
_EOF_TEXT = "EOF"
_MOST_OPEN = 10  # files of a task
_LARGEST_FILE = 16 * 1024 * 1024  # bytes
_WAITING_BYTES = 4096  # that are kept back at least before a file is written
_SERIAL = ("com1:", "com2:", "com3:", "sio1:", "term1:")
for _name, _value in (("EOF", _EOF_TEXT), ("diskhome", "HOME:"), ("disktemp", "TEMP:"), ("diskram", "RAMDISK:")):
    FILES.data(_name, "string", _value)
for _number in range(1, 11):
    FILES.data(f"usbdisk{_number}", "string", f"BAY{_number}:")
FILES.data("EOF_BIN", "num", _EOF_BIN)
FILES.data("EOF_NUM", "num", _EOF_NUM)


@dataclass(eq=False)
class OpenFile:
    """What an iodev stands for: a file that is open, its content and the place where reading goes on.

    Attributes:
        path: of the file, "" while it is closed.
        content: all of it.
        position: where the next byte is read.
        is_readable, is_writable: what Open has asked for.
    """

    path: str = ""
    content: bytearray = field(default_factory=bytearray)
    position: int = 0
    is_readable: bool = False
    is_writable: bool = False
    _disk: Disk | None = None
    _unwritten: int = 0

    def open(self, disk: Disk, path: str, content: bytes) -> None:
        self._disk, self.path, self.content, self.position = disk, path, bytearray(content), 0

    def put(self, data: bytes) -> None:
        """Write at the end."""
        if len(self.content) + len(data) > _LARGEST_FILE:
            raise OSError(f"a file has up to {_LARGEST_FILE} bytes.")
        self.content += data
        self._unwritten += len(data)
        if self._unwritten > max(_WAITING_BYTES, len(self.content) // 8):
            self.flush()

    def flush(self) -> None:
        """Bring what waits to the disk."""
        if self._disk is not None and self._unwritten:
            self._unwritten = 0
            self._disk.write(self.path, bytes(self.content))

    def take(self, count: int) -> bytes:
        """The next bytes, fewer at the end of the file."""
        found = bytes(self.content[self.position : self.position + count])
        self.position += len(found)
        return found

    @property
    def is_at_end(self) -> bool:
        return self.position >= len(self.content)

    def close(self) -> None:
        try:
            self.flush()
        finally:
            self._disk, self.path, self.content = None, "", bytearray()

    def __del__(self) -> None:
        with suppress(OSError):
            self.close()


@dataclass(eq=False, slots=True)
class OpenDirectory:
    """What a dir stands for: the names of a directory that are still to be read; None while it is closed."""

    names: list[str] | None = None


FILES.object_type("iodev", OpenFile)
FILES.object_type("dir", OpenDirectory)


@contextmanager
def _disk_errors(call: Call) -> Iterator[Disk]:
    """The disk; what it refuses becomes RAPID's error."""
    before = f"{call.name}: "
    with raised_as("ERR_FILEACC", OSError, before=before), raised_as("ERR_FILEEXIST", FileExistsError, before=before):
        yield call.task.host.devices.disk


def _full_path(path: str, file: str = "") -> str:
    r"""A path with its device; without one it is in HOME:, and `\` stands for `/`."""
    path = f"{path.rstrip('/')}/{file}" if file else path
    path = path.replace("\\", "/")
    device, colon, rest = path.partition(":")
    return f"{device}:/{rest.strip('/')}".rstrip("/") if colon else f"HOME:/{path.strip('/')}".rstrip("/")


def _path(call: Call, name: str = "Path") -> str:
    return _full_path(call[name])


def _file(call: Call, *, to_read: bool = False, to_write: bool = False) -> OpenFile:
    """The open file; raises ERR_FILEACC where it is closed or opened for something else."""
    file: OpenFile = call["IODevice"]
    if not file.path:
        raise call.error("ERR_FILEACC", f"the file {call.reference('IODevice').name} is closed; Open opens it.")
    if (to_read and not file.is_readable) or (to_write and not file.is_writable):
        raise call.error("ERR_FILEACC", f"{file.path} was not opened for this.")
    return file


# Opening and closing ----------------------------------------------------------------------------------------------

_opened: WeakKeyDictionary[RunningTask, WeakSet[OpenFile]] = WeakKeyDictionary()
"""What each task has opened; closed ones have no path."""


@FILES.instruction(
    "Open",
    r"string Object, \string File, VAR iodev IODevice, \switch Read | \switch Write | \switch Append, \switch Bin",
)
def _open_file(call: Call) -> None:
    r"""With \Read, \Write (a new file) or \Append, and \Bin; text for reading and writing without them.

    Raises:
        RapidRuntimeError: ERR_FILEOPEN.
    """
    file: OpenFile = call["IODevice"]
    name: str = call["Object"]
    path = _full_path(name, call.get("File", ""))
    if name.lower() in _SERIAL:
        sentence = f"there are no serial channels on this controller, as '{name}' is; files are on HOME:."
        raise call.error("ERR_FILEOPEN", sentence)
    if file.path:
        raise call.error("ERR_FILEOPEN", f"{call.reference('IODevice').name} is open; Close closes it.")
    opened = _opened.setdefault(call.task, WeakSet())
    if sum(bool(each.path) for each in opened) >= _MOST_OPEN:
        raise call.error("ERR_FILEOPEN", f"the task has {_MOST_OPEN} files open already; Close closes one.")
    disk = call.task.host.devices.disk
    is_reading = call.present("Read")
    is_new = call.present("Write") or not (is_reading or call.present("Append"))
    with raised_as("ERR_FILEOPEN", OSError, before="Open: "):
        if is_new:
            disk.write(path, b"")
        content = disk.read(path) if is_reading or _exists(disk, path) else b""
        if call.present("Append"):
            disk.write(path, content)
    file.open(disk, path, content)
    opened.add(file)
    file.is_readable = not (call.present("Write") or (call.present("Append") and not call.present("Bin")))
    file.is_writable = not is_reading


@FILES.instruction("Close", "VAR iodev IODevice")
def _close_file(call: Call) -> None:
    with _disk_errors(call):
        call["IODevice"].close()


@FILES.instruction("Rewind", "VAR iodev IODevice")
def _rewind(call: Call) -> None:
    file = _file(call)
    with _disk_errors(call):
        file.flush()
    file.position = 0


@FILES.instruction("ClearIOBuff", "VAR iodev IODevice")
def _clear_buffer(call: Call) -> None:
    """What a serial channel has received and was not read; a file has nothing of the kind, so that it is refused."""
    raise RapidRuntimeError("ERR_FILEACC", f"ClearIOBuff is for serial channels, not for {_file(call).path}.")


# Writing ----------------------------------------------------------------------------------------------------------


@FILES.instruction("Write", rf"VAR iodev IODevice, {PRINTED}, \switch NoNewLine")
def _write_line(call: Call) -> None:
    text = printed_text(call) + ("" if call.present("NoNewLine") else "\n")
    _put(call, text.encode(BYTES_ENCODING, "replace"))


@FILES.instruction("WriteBin", "VAR iodev IODevice, num Buffer{*}, num NChar")
def _write_bytes(call: Call) -> None:
    values = call["Buffer"]
    count = whole_argument(call, "NChar", 1, len(values))
    _put(call, bytes(int(value) & 0xFF for value in values[:count]))


@FILES.instruction("WriteStrBin", "VAR iodev IODevice, string Str")
def _write_text_bytes(call: Call) -> None:
    _put(call, call["Str"].encode(BYTES_ENCODING, "replace"))


@FILES.instruction("WriteRawBytes", r"VAR iodev IODevice, VAR rawbytes RawData, \num NoOfBytes")
def _write_raw_bytes(call: Call) -> None:
    raw: RawBytes = call["RawData"]
    count = whole_argument(call, "NoOfBytes", 1, MOST_BYTES, len(raw.data) or 1)
    _put(call, raw.get(0, count) if count <= len(raw.data) else bytes(raw.data))


@FILES.instruction("WriteAnyBin", "VAR iodev IODevice, anytype Data")
def _write_any_to_file(call: Call) -> None:
    """The value as ReadAnyBin reads it back: its length, its type, then its literal."""
    type_ = call.reference("Data").type
    literal = format_value(type_, call["Data"]).encode(BYTES_ENCODING, "replace")
    name = type_.name.encode("ascii")
    _put(call, struct.pack(">HB", len(literal), len(name)) + name + literal)


def _put(call: Call, data: bytes) -> None:
    file = _file(call, to_write=True)
    with _disk_errors(call):
        file.put(data)


# Reading ----------------------------------------------------------------------------------------------------------


@FILES.function(
    "ReadStr",
    r"VAR iodev IODevice, \string Delim, \switch RemoveCR, \switch DiscardHeaders, \num Time",
    "string",
)
def _read_line(call: Call) -> str:
    r"""Up to the line feed, which is not part of it, or a character of \Delim; EOF at the end of the file.

    \RemoveCR leaves out a trailing carriage return, \DiscardHeaders delimiters before the text (RAPID reference
    manual, ReadStr). A line of more than 80 characters comes in pieces.
    """
    file = _file(call, to_read=True)
    delimiters = {10, *call.get("Delim", "").encode(BYTES_ENCODING, "replace")}
    if call.present("DiscardHeaders"):
        while not file.is_at_end and file.content[file.position] in delimiters:
            file.position += 1
    if file.is_at_end:
        return _EOF_TEXT
    end, last = file.position, min(len(file.content), file.position + LONGEST_STRING)
    while end < last and file.content[end] not in delimiters:
        end += 1
    line = file.take(end - file.position)
    if not file.is_at_end and file.content[file.position] in delimiters:
        file.position += 1
    text = line.decode(BYTES_ENCODING)
    return text.removesuffix("\r") if call.present("RemoveCR") else text


@FILES.function("ReadNum", r"VAR iodev IODevice, \string Delim, \num Time", "num")
def _read_number(call: Call) -> float:
    """The number of the next line; EOF_NUM at the end, ERR_RCVDATA where it is none."""
    text = _read_line(call)
    if text == _EOF_TEXT and _file(call).is_at_end:
        return _EOF_NUM
    try:
        return float(text.strip())
    except ValueError as error:
        raise call.error("ERR_RCVDATA", f"'{text}' is not a number.") from error


@FILES.function("ReadBin", r"VAR iodev IODevice, \num Time", "num")
def _read_byte(call: Call) -> float:
    found = _file(call, to_read=True).take(1)
    return float(found[0]) if found else _EOF_BIN


@FILES.function("ReadStrBin", r"VAR iodev IODevice, num NoOfChars, \num Time", "string")
def _read_text_bytes(call: Call) -> str:
    file = _file(call, to_read=True)
    count = whole_argument(call, "NoOfChars", 1, LONGEST_STRING)
    return _EOF_TEXT if file.is_at_end else file.take(count).decode(BYTES_ENCODING)


@FILES.instruction("ReadRawBytes", r"VAR iodev IODevice, VAR rawbytes RawData, \num NoOfBytes, \num Time")
def _read_raw_bytes(call: Call) -> None:
    """Up to 1024 bytes; ERR_RANYBIN_EOF where fewer than NoOfBytes are left."""
    file = _file(call, to_read=True)
    count = whole_argument(call, "NoOfBytes", 1, MOST_BYTES, MOST_BYTES)
    found = file.take(count)
    if not found or (call.present("NoOfBytes") and len(found) < count):
        raise call.error("ERR_RANYBIN_EOF", f"{file.path} has no {count} more bytes.")
    call["RawData"].data[:] = found


@FILES.instruction("ReadAnyBin", r"VAR iodev IODevice, INOUT anytype Data, \num Time")
def _read_any_from_file(call: Call) -> None:
    """What WriteAnyBin wrote; ERR_RANYBIN_EOF at the end, ERR_RANYBIN_CHK for a value of another type."""
    file, type_ = _file(call, to_read=True), call.reference("Data").type
    header = file.take(3)
    if len(header) < 3:
        raise call.error("ERR_RANYBIN_EOF", f"{file.path} has nothing more.")
    length, name_length = struct.unpack(">HB", header)
    name, literal = file.take(name_length), file.take(length).decode(BYTES_ENCODING)
    try:
        if name.decode("ascii", "replace") != type_.name:
            raise RapidValueError(f"it is a {name.decode('ascii', 'replace')}.")
        call["Data"] = parse_value(type_, literal)
    except RapidValueError as error:
        raise call.error("ERR_RANYBIN_CHK", f"no {type_.name} can be read: {error}") from error


# Directories and files as a whole ---------------------------------------------------------------------------------


@FILES.instruction("OpenDir", "VAR dir Dev, string Path")
def _open_directory(call: Call) -> None:
    with _disk_errors(call) as disk:
        call["Dev"].names = [".", "..", *(entry.name for entry in disk.entries(_path(call)))]


@FILES.function("ReadDir", "VAR dir Dev, VAR string FileName", "bool")
def _read_directory(call: Call) -> bool:
    names = call["Dev"].names
    if names is None:
        raise call.error("ERR_FILEACC", "the directory is closed; OpenDir opens it.")
    if not names:
        return False
    call["FileName"] = names.pop(0)[:LONGEST_STRING]
    return True


@FILES.instruction("CloseDir", "VAR dir Dev")
def _close_directory(call: Call) -> None:
    call["Dev"].names = None


@FILES.instruction("MakeDir", "string Path")
def _make_directory(call: Call) -> None:
    with _disk_errors(call) as disk:
        disk.make_directory(_path(call))


@FILES.instruction("RemoveDir", "string Path")
def _remove_directory(call: Call) -> None:
    with _disk_errors(call) as disk:
        if not disk.entry(_path(call)).is_directory:
            raise NotADirectoryError(f"{_path(call)} is a file.")
        if disk.entries(_path(call)):
            raise PermissionError(f"{_path(call)} is not empty.")
        disk.remove(_path(call))


@FILES.instruction("RemoveFile", "string Path")
def _remove_file(call: Call) -> None:
    with _disk_errors(call) as disk:
        if disk.entry(_path(call)).is_directory:
            raise IsADirectoryError(f"{_path(call)} is a directory.")
        disk.remove(_path(call))


@FILES.instruction("RenameFile", "string OldPath, string NewPath")
def _rename_file(call: Call) -> None:
    with _disk_errors(call) as disk:
        disk.rename(_path(call, "OldPath"), _path(call, "NewPath"))


@FILES.instruction("CopyFile", "string OldPath, string NewPath")
def _copy_file(call: Call) -> None:
    with _disk_errors(call) as disk:
        if _exists(disk, _path(call, "NewPath")):
            raise FileExistsError(f"{call['NewPath']} exists already.")
        disk.copy(_path(call, "OldPath"), _path(call, "NewPath"))


_KINDS = r"\switch Directory | \switch Fifo | \switch RegFile | \switch BlockSpec | \switch CharSpec"


@FILES.function("IsFile", rf"string Path, {_KINDS}", "bool")
def _is_file(call: Call) -> bool:
    """Whether there is a file or directory, or one of the kind that is asked for."""
    try:
        entry = call.task.host.devices.disk.entry(_path(call))
    except OSError:
        return False
    if call.present("Directory") or call.present("RegFile"):
        return entry.is_directory == call.present("Directory")
    return not any(call.present(kind) for kind in ("Fifo", "BlockSpec", "CharSpec"))


@FILES.function("FileSize", "string Path", "num")
def _file_size(call: Call) -> float:
    return float(_entry(call).size)


@FILES.function(
    "FileTime", r"string Path, \switch ModifyTime | \switch AccessTime | \switch StatCTime, \dnum TimeStamp", "num"
)
@FILES.function("FileTimeDnum", r"string Path, \switch ModifyTime | \switch AccessTime | \switch StatCTime", "dnum")
def _file_time(call: Call) -> float:
    """When the file was written, seconds since 1970, whatever of the three times is asked for."""
    return float(int(_entry(call).changed))


def _entry(call: Call) -> DiskEntry:
    with _disk_errors(call) as disk:
        return disk.entry(_path(call))


def _exists(disk: Disk, path: str) -> bool:
    try:
        disk.entry(path)
    except OSError:
        return False
    return True


@FILES.function("FSSize", r"string Name, \switch Total | \switch Free", "num")
def _file_system_size(call: Call) -> float:
    r"""Bytes of the disk, those that are free without \Total."""
    with _disk_errors(call) as disk:
        disk.entry(_path(call, "Name"))
        total, free = disk.space()
    return float(total if call.present("Total") else free)
