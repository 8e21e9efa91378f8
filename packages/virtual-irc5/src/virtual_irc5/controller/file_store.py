"""The controller's disk; files are known by the path RAPID gives them, such as ``HOME:/yumi/TRobMain.mod``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, MutableMapping
from dataclasses import dataclass, replace

from virtual_irc5.controller_log import RefusalReason, Refused

DISK_DEVICES = ("HOME", "TEMP", "BACKUP", "RAMDISK")
FILE_ENCODING = "latin-1"
"""Of RAPID's files, unless they are UTF-8."""

DISK_CAPACITY = 64 * 1024 * 1024
"""Of all devices together [bytes]."""

MOST_FILES = 1000
"""Files and directories of all devices together."""

LONGEST_PATH = 1000
"""Characters."""


def decoded_file_text(content: bytes) -> str:
    """The text of a file: UTF-8 when it is, Latin-1 otherwise; RobotStudio writes either."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode(FILE_ENCODING)


def _encoded(text: str) -> bytes:
    """A file with the text: Latin-1 where it has the characters, UTF-8 otherwise."""
    try:
        return text.encode(FILE_ENCODING)
    except UnicodeEncodeError:
        return text.encode("utf-8")


@dataclass(frozen=True, slots=True)
class File:
    """One file or directory.

    Attributes:
        path: as it was written first.
        content: its bytes; None for a directory.
        changed: when it was written, on the controller's clock [s].
    """

    path: str
    content: bytes | None
    changed: float

    @property
    def name(self) -> str:
        """The last part of the path."""
        return self.path.rpartition("/")[2]

    @property
    def size(self) -> int:
        """Of its content [bytes]."""
        return len(self.content or b"")


class FileStore(MutableMapping[str, str]):
    """Files, found in any letter case; as a mapping it shows their texts.

    Args:
        files: texts or contents by path.
        now: the controller's clock [s].
    """

    def __init__(self, files: Mapping[str, str] | Mapping[str, bytes], now: Callable[[], float] = lambda: 0.0) -> None:
        self._now = now
        self._files: dict[str, File] = {}
        for device in DISK_DEVICES:
            self._put(f"{device}:", None)
        for path, given in files.items():
            self.write(path, given if isinstance(given, bytes) else _encoded(given))

    def __getitem__(self, path: str) -> str:
        content = self._files[_key(path)].content
        if content is None:
            raise KeyError(path)
        return decoded_file_text(content)

    def __setitem__(self, path: str, text: str) -> None:
        self.write(path, _encoded(text))

    def __delitem__(self, path: str) -> None:
        del self._files[_key(path)]

    def __iter__(self) -> Iterator[str]:
        return (file.path for file in tuple(self._files.values()) if file.content is not None)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    @property
    def used(self) -> int:
        """Of the capacity [bytes]."""
        return sum(file.size for file in self._files.values())

    def get_file(self, path: str) -> File:
        """A file or directory.

        Raises:
            Refused: NO_FILE.
        """
        found = self._files.get(_key(path))
        if found is None:
            raise Refused(RefusalReason.NO_FILE, f"there is no file {path}.")
        return found

    def entries(self, path: str) -> tuple[File, ...]:
        """What is in a directory, by name.

        Raises:
            Refused: NO_FILE.
        """
        place = _key(self.get_file(path).path)
        inside = (file for key, file in self._files.items() if key.rpartition("/")[0] == place)
        return tuple(sorted(inside, key=lambda file: file.name.lower()))

    def write(self, path: str, content: bytes) -> bool:
        """Create or replace a file; whether it is new. Directories on the way come into being.

        Raises:
            Refused: NO_FILE for an unknown device, BAD_VALUE where a directory has the name, NO_SPACE.
        """
        known = self._files.get(_key(path))
        if known is not None and known.content is None:
            raise Refused(RefusalReason.BAD_VALUE, f"{path} is a directory.")
        if known is None:
            self._check_space(len(content))
        else:
            self._check_space(len(content) - known.size, files=0)
        self.make_directory(clean_path(path).rpartition("/")[0])
        self._put(path, content)
        return known is None

    def make_directory(self, path: str) -> None:
        """Create a directory and those above it; nothing happens when it is there.

        Raises:
            Refused: NO_FILE for an unknown device, BAD_VALUE where a file has the name, NO_SPACE.
        """
        found = self._files.get(_key(path))
        if found is not None and found.content is not None:
            raise Refused(RefusalReason.BAD_VALUE, f"{path} is a file.")
        if found is None:
            above = clean_path(path).rpartition("/")[0]
            if not above:
                raise Refused(RefusalReason.NO_FILE, f"there is no device {path!r}.")
            self.make_directory(above)
            self._put(path, None)

    def remove(self, path: str) -> None:
        """Remove a file, or a directory with what is in it.

        Raises:
            Refused: NO_FILE, READ_ONLY for a device.
        """
        place = _key(self.get_file(path).path)
        if "/" not in place:
            raise Refused(RefusalReason.READ_ONLY, f"the device {path} cannot be removed.")
        for key in [key for key in self._files if key == place or key.startswith(f"{place}/")]:
            del self._files[key]

    def copy(self, path: str, to: str) -> None:
        """Copy a file or a directory with what is in it, over what has the name.

        Raises:
            Refused: NO_FILE, NO_SPACE.
        """
        source, target = clean_path(self.get_file(path).path), clean_path(to)
        inside = [file for key, file in self._files.items() if f"{key}/".startswith(f"{_key(source)}/")]
        self._check_space(sum(file.size for file in inside), len(inside))
        for file in inside:
            moved = f"{target}{clean_path(file.path)[len(source) :]}"
            self._files[_key(moved)] = replace(file, path=moved, changed=self._now())

    def _check_space(self, more: int, files: int = 1) -> None:
        used = self.used
        if used + more > DISK_CAPACITY or len(self._files) + files > MOST_FILES:
            raise Refused(
                RefusalReason.NO_SPACE,
                f"the disk is full: it has {DISK_CAPACITY} bytes and {MOST_FILES} files, {used} and {len(self._files)} "
                "are in use; delete some.",
            )

    def _put(self, path: str, content: bytes | None) -> None:
        if len(path) > LONGEST_PATH:
            raise Refused(RefusalReason.BAD_VALUE, f"a path has up to {LONGEST_PATH} characters, not {len(path)}.")
        if content is None and self._files.get(_key(path)) is None:
            self._check_space(0)
        self._files[_key(path)] = File(clean_path(path), content, self._now())


def clean_path(path: str) -> str:
    """The path as the store has it: ``$HOME/x`` and ``HOME:x`` are ``HOME:/x``."""
    path = path.rstrip("/")
    if path.startswith("$"):
        device, slash, rest = path[1:].partition("/")
        path = f"{device.upper().rstrip(':')}:{slash}{rest}"
    device, colon, rest = path.partition(":")
    return f"{device}:/{rest}" if colon and rest and not rest.startswith("/") else path


def _key(path: str) -> str:
    return clean_path(path).lower()
