"""A program that runs once for a user on a machine, by a lock; a second one learns which process does."""

from __future__ import annotations

import os
import re
import stat
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import RobotNotReady

if sys.platform != "win32":
    import fcntl

_NOT_IN_FILE_NAMES = re.compile(r"[^\w.:-]")


class SingleInstance:
    """A lock, so that a program runs once for this user on this machine; a second one learns which process has it.

    It is held from ``claim`` to ``release`` or the end of the process: a locked file in a folder that only this user
    may enter, so that no other user can take its place first. The file stays: removing it could take away the lock of
    a process that has just opened it.

    Args:
        name: what may run once.
        refusal: what is said when another process has the lock, which it is given.
    """

    def __init__(self, name: str, refusal: Callable[[Message], Message]) -> None:
        self._name = f"{_NOT_IN_FILE_NAMES.sub('_', name)}.lock"
        self._refusal = refusal
        self._file: int | None = None

    def claim(self) -> None:
        """Take the lock.

        Raises:
            RobotNotReady: another process has it, whose number the message has; or there is no folder for the lock.
        """
        if sys.platform == "win32":
            return
        folder = lock_folder()
        try:
            file = os.open(folder / self._name, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
        except OSError as error:
            raise _no_lock(folder, error.strerror) from error
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            number = os.read(file, 32).decode("ascii", "replace").strip()
            os.close(file)
            owner = message("owner_process", process=number) if number else message("owner_starting")
            raise RobotNotReady(self._refusal(owner)) from error
        os.truncate(file, 0)
        os.write(file, f"{os.getpid()}\n".encode("ascii"))
        self._file = file

    def release(self) -> None:
        """Let another process take the lock."""
        if self._file is not None:
            os.close(self._file)
            self._file = None


def lock_folder() -> Path:
    """The folder for locks: the user's own of this login, else one in the folder for temporary files.

    Raises:
        RobotNotReady: it cannot be made, or others may enter it.
    """
    for runtime in (os.environ.get("XDG_RUNTIME_DIR"), f"/run/user/{os.getuid()}"):
        if runtime and os.access(runtime, os.W_OK | os.X_OK):
            return Path(runtime)
    folder = Path(tempfile.gettempdir()) / f"yumi-{os.getuid()}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError as error:
        raise _no_lock(folder, error.strerror) from error
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o077:
        raise RobotNotReady(message("lock_folder_open_to_others", folder=str(folder)))
    return folder


def _no_lock(folder: Path, reason: str | None) -> RobotNotReady:
    return RobotNotReady(message("no_lock", folder=str(folder), reason=reason or ""))
