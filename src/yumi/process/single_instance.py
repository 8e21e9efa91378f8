"""A lock, so that a program runs once for this user on this machine; a second one learns which process has it."""

from __future__ import annotations

import os
import re
import stat
import sys
import tempfile
from pathlib import Path

from yumi.errors import RobotNotReady

if sys.platform != "win32":
    import fcntl

_NO_FILE_NAME = re.compile(r"[^\w.:-]")


class Only:
    """The lock ``name``, held from ``claim`` to ``release`` or the end of the process.

    It is a locked file in a folder that only this user may enter, so that no other user can take its place first. The
    file stays: removing it could take away the lock of a process that has just opened it.

    Args:
        name: what may run once.
        refusal: the message when another process has the lock; ``{owner}`` in it becomes that process.
    """

    def __init__(self, name: str, refusal: str) -> None:
        self._name = f"{_NO_FILE_NAME.sub('_', name)}.lock"
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
            owner = f"process {number}" if number else "it is starting"
            raise RobotNotReady(self._refusal.format(owner=owner)) from error
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
        raise _no_lock(folder, "it is not this user's own, or open to others")
    return folder


def _no_lock(folder: Path, reason: str | None) -> RobotNotReady:
    return RobotNotReady(
        f"No lock against a second driver can be made in {folder}: {reason}; set XDG_RUNTIME_DIR to a folder that only "
        "you may enter."
    )
