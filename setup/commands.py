"""The commands that set-up runs: their output goes to a log, their failure becomes one sentence."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

UNREACHABLE = ("error sending request", "dns error", "tcp connect error", "operation timed out", "Network connectivity")
"""What uv prints where it reaches no package index."""

MAKES_OWN = ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")


class InstallationFailed(Exception):
    """A step failed; the message says which, why, and where its output is."""


def say(sentence: str) -> None:
    """One line of progress."""
    print(f"setup: {sentence}", flush=True)


def run(command: list[str], log: Path, complaint: str, variables: dict[str, str]) -> None:
    """Run a command to its end; raises InstallationFailed with `complaint`."""
    finish(start(command, log, variables), log, complaint)


def start(command: list[str], log: Path, variables: dict[str, str]) -> subprocess.Popen[bytes]:
    """Start a command that prints to `log`, in the caller's environment without make's own, with `variables`."""
    kept = {name: value for name, value in os.environ.items() if name not in MAKES_OWN}
    with log.open("w") as output:
        return subprocess.Popen(
            command, env=kept | variables, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT
        )


def finish(process: subprocess.Popen[bytes], log: Path, complaint: str) -> None:
    """Wait for a command's end; raises InstallationFailed with `complaint`."""
    try:
        code = process.wait()
    finally:
        process.kill()  # Ctrl-C has ended the waiting alone
    if code != 0:
        raise InstallationFailed(f"{_reason(log.read_text(), complaint)}; see {log}")


def _reason(words: str, complaint: str) -> str:
    if any(sign in words for sign in UNREACHABLE):
        return (
            "the package index cannot be reached; check the network and the proxy; with an index of your own, "
            "UV_DEFAULT_INDEX=… make lock"
        )
    if "No space left on device" in words:
        return f"{complaint}: the disk is full (about 1 GB is needed)"
    if "Hash mismatch" in words:
        return f"{complaint}: a file of the package index is not the one that uv.lock has the hash of"
    return complaint
