"""Operations on the controller's disk (``/fileservice``) and their calls; paths as in RAPID (``HOME:/pick.mod``)."""

from __future__ import annotations

from dataclasses import dataclass, replace

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.rws.operations.operation import delete, get, post, put
from abb_protocols.rws.operations.service import OnProgress, Service
from abb_protocols.rws.values import Grant

_PATH = "/fileservice/{path:.+}"
_NOT_FOUND = (400, 404)  # which of the two differs by version


def file_path(path: str) -> str:
    """Where RAPID's ``HOME:/pick.mod`` is on the network; the device's name stands behind ``$`` there."""
    device, _, rest = path.partition(":")
    return f"/fileservice/${device.lower()}/{rest.lstrip('/')}"


@dataclass(frozen=True, slots=True)
class FileInfo:
    """One entry of a directory; ``size`` [byte] is None for a directory."""

    name: str
    size: int | None


@dataclass(frozen=True, slots=True)
class Volume:
    """A device of the controller, such as ``HOME``; its sizes [byte]."""

    name: str
    total: int
    free: int
    is_read_only: bool


DISKS = get("/fileservice", grant=Grant.FTP_READ)
FILE = get(_PATH, grant=Grant.FTP_READ)
HEAD_FILE = post(_PATH, method="HEAD", grant=Grant.FTP_READ)
PUT_FILE = put(_PATH, grant=Grant.FTP_WRITE)
CHANGE_FILE = post(
    _PATH, None, "fs-action=create|copy|rename, fs-newname, fs-overwrite=true|false", grant=Grant.FTP_WRITE
)
DELETE_FILE = delete(_PATH, grant=Grant.FTP_WRITE)


class FilesService(Service):
    """``/fileservice``; the content of a file takes as long as it needs, as long as it goes on."""

    def write_file(self, path: str, content: bytes) -> None:
        """Create or replace a file such as ``HOME:/logo.png``."""
        self._sent(f"writing {path}", PUT_FILE, replace(PUT_FILE.request(_place(path)), content=content))

    def read_file(self, path: str) -> bytes:
        """Content of a file such as ``HOME:/pick.mod``."""
        return self._call(f"reading {path}", FILE, _place(path)).content

    def read_tree(self, path: str, on_progress: OnProgress = lambda text: None) -> dict[str, bytes]:
        """Every file in a directory and those below it, by its path behind ``path``."""
        found: dict[str, bytes] = {}
        folders = [""]
        while folders:
            folder = folders.pop()
            for entry in self.files(f"{path}{folder}"):
                name = f"{folder}/{entry.name}"
                if entry.size is None:
                    folders.append(name)
                else:
                    found[name.lstrip("/")] = self.read_file(f"{path}{name}")
                    on_progress(f"{path}{name}")
        return found

    def make_directory(self, path: str) -> None:
        """Create a directory such as ``HOME:/yumi``; the one above it must be there."""
        above, _, name = path.rstrip("/").rpartition("/")
        place = _place(f"{above}/").rstrip("/")
        self._call(f"creating {path}", CHANGE_FILE, place, fs_action="create", fs_newname=name)

    def copy_file(self, path: str, name: str, *, replace: bool = False) -> None:
        """Copy a file within its directory, to the name ``name``."""
        how = {"fs_action": "copy", "fs_newname": name, "fs_overwrite": replace}
        self._call(f"copying {path}", CHANGE_FILE, _place(path), **how)

    def rename_file(self, path: str, name: str) -> None:
        """Give a file or directory another name in its directory."""
        self._call(f"renaming {path}", CHANGE_FILE, _place(path), fs_action="rename", fs_newname=name)

    def upload(self, path: str, text: str) -> None:
        """Create or replace a file such as ``HOME:/pick.mod``; RAPID's files are Latin-1.

        Raises:
            CommandRefused: the text has characters that such a file cannot hold.
        """
        try:
            content = text.encode("latin-1")
        except UnicodeEncodeError as error:
            wrong = text[error.start]
            raise CommandRefused(message("file_not_latin_1", path=path, character=wrong)) from error
        self.write_file(path, content)

    def download(self, path: str) -> str:
        """Content of a file such as ``HOME:/pick.mod``."""
        return self.read_file(path).decode("latin-1")

    def files(self, path: str) -> tuple[FileInfo, ...]:
        """What is in a directory such as ``HOME:/yumi``."""
        states = self._listed(f"listing {path}", FILE, _place(path.rstrip("/") + "/"))
        return tuple(
            FileInfo(state.title, state.whole("fs-size") if state.type == "fs-file" else None)
            for state in states
            if state.type in ("fs-dir", "fs-file")
        )

    def delete_file(self, path: str) -> None:
        """Remove a file, or a directory with all that is in it."""
        self._call(f"removing {path}", DELETE_FILE, _place(path))

    def volumes(self) -> tuple[Volume, ...]:
        """The devices on which there are files."""
        return tuple(
            Volume(
                state.title.lstrip("$").upper(),
                state.whole("fs-total-space"),
                state.whole("fs-free-space"),
                state.flag("fs-readonly"),
            )
            for state in self._listed("reading the devices", DISKS)
            if state.type == "fs-device"
        )

    def has_file(self, path: str) -> bool:
        """Whether there is a file or directory."""
        reply = self._exchange(HEAD_FILE.request(_place(path)))
        if reply.status_code in _NOT_FOUND:
            return False
        self._accepted(reply, f"looking for {path}")
        return True


def _place(path: str) -> str:
    """Where a file is below ``/fileservice``."""
    return file_path(path).removeprefix("/fileservice/")
