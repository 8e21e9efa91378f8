"""The file service: files and directories of the controller, paths as in RAPID (``HOME:/pick.mod``)."""

from __future__ import annotations

from dataclasses import dataclass

from yumi.errors import CommandRefused
from yumi.rws.replies import FileInfo
from yumi.rws.session import OnProgress, Request, Requests, file_path, get

_NOT_FOUND = (400, 404)  # which of the two differs by version


@dataclass(frozen=True, slots=True)
class Volume:
    """A device of the controller, such as ``HOME``; its sizes [byte]."""

    name: str
    total: int
    free: int
    is_read_only: bool


class Files(Requests):
    """``/fileservice``; the content of a file takes as long as it needs, as long as it goes on."""

    def write_file(self, path: str, content: bytes) -> None:
        """Create or replace a file such as ``HOME:/logo.png``."""
        self._do(Request("PUT", file_path(path), content=content), f"writing {path}")

    def read_file(self, path: str) -> bytes:
        """Content of a file such as ``HOME:/pick.mod``."""
        reply = self._session.exchange(get(file_path(path)))
        self._accepted(reply, f"reading {path}")
        return reply.content

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
        form = (("fs-action", "create"), ("fs-newname", name))
        self._do(Request("POST", file_path(f"{above}/").rstrip("/"), form=form), f"creating {path}")

    def copy_file(self, path: str, name: str, *, replace: bool = False) -> None:
        """Copy a file within its directory, to the name ``name``."""
        form = (("fs-action", "copy"), ("fs-newname", name), ("fs-overwrite", "true" if replace else "false"))
        self._do(Request("POST", file_path(path), form=form), f"copying {path}")

    def rename_file(self, path: str, name: str) -> None:
        """Give a file or directory another name in its directory."""
        form = (("fs-action", "rename"), ("fs-newname", name))
        self._do(Request("POST", file_path(path), form=form), f"renaming {path}")

    def upload(self, path: str, text: str) -> None:
        """Create or replace a file such as ``HOME:/pick.mod``; RAPID's files are Latin-1.

        Raises:
            CommandRefused: the text has characters that such a file cannot hold.
        """
        try:
            content = text.encode("latin-1")
        except UnicodeEncodeError as error:
            wrong = text[error.start]
            raise CommandRefused(f"RAPID files hold Latin-1 only; {path} cannot have {wrong!r} in it.") from error
        self.write_file(path, content)

    def download(self, path: str) -> str:
        """Content of a file such as ``HOME:/pick.mod``."""
        return self.read_file(path).decode("latin-1")

    def files(self, path: str) -> tuple[FileInfo, ...]:
        """What is in a directory such as ``HOME:/yumi``."""
        states = self._states(f"listing {path}", file_path(path.rstrip("/") + "/"))
        return tuple(
            FileInfo(state.title, state.whole("fs-size") if state.type == "fs-file" else None)
            for state in states
            if state.type in ("fs-dir", "fs-file")
        )

    def delete_file(self, path: str) -> None:
        """Remove a file, or a directory with all that is in it."""
        self._do(Request("DELETE", file_path(path)), f"removing {path}")

    def volumes(self) -> tuple[Volume, ...]:
        """The devices on which there are files."""
        return tuple(
            Volume(
                state.title.lstrip("$").upper(),
                state.whole("fs-total-space"),
                state.whole("fs-free-space"),
                state.flag("fs-readonly"),
            )
            for state in self._states("reading the devices", "/fileservice")
            if state.type == "fs-device"
        )

    def has_file(self, path: str) -> bool:
        """Whether there is a file or directory."""
        reply = self._session.exchange(Request("HEAD", file_path(path)))
        if reply.status_code in _NOT_FOUND:
            return False
        self._accepted(reply, f"looking for {path}")
        return True
