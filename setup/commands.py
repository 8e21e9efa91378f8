"""The commands that set-up runs: their output goes to a log, their failure becomes one sentence."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

UNREACHABLE = ("NewConnectionError", "ConnectTimeoutError", "ReadTimeoutError", "ProxyError", "SSLError", "Retrying (")
PACKAGES_PER_LINE = 40
MAKES_OWN = ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")


class InstallationFailed(Exception):
    """A step failed; the message says which, why, and where its output is."""


def say(sentence: str) -> None:
    """One line of progress."""
    print(f"setup: {sentence}", flush=True)


def pip_install(python: Path, arguments: list[str], log: Path) -> None:
    """Let the pip of `python` install; raises InstallationFailed."""
    command = [str(python), "-m", "pip", "install", "--no-input", "--progress-bar", "off", *arguments]
    run(command, log, "pip could not install the packages")


def run(command: list[str], log: Path, complaint: str) -> None:
    """Run a command, counting the packages that it fetches; raises InstallationFailed with `complaint`."""
    fetched = 0
    with log.open("w") as output, _started(command) as process:
        for line in process.stdout or ():
            output.write(line)
            fetched += line.startswith("Collecting ")
            if line.startswith("Collecting ") and fetched % PACKAGES_PER_LINE == 0:
                say(f"{fetched} packages fetched")
    if process.returncode != 0:
        raise InstallationFailed(f"{_reason(log.read_text(), complaint)}; its words are in {log}")


def _started(command: list[str]) -> subprocess.Popen[str]:
    return subprocess.Popen(
        command,
        env=environment(),
        text=True,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )


def environment() -> dict[str, str]:
    """The caller's, without make's own variables, and with pip kept to the virtual environment."""
    kept = {name: value for name, value in os.environ.items() if name not in MAKES_OWN}
    return kept | {"PIP_DISABLE_PIP_VERSION_CHECK": "1", "PIP_REQUIRE_VIRTUALENV": "1", "PIP_USER": "0"}


def _reason(words: str, complaint: str) -> str:
    if any(sign in words for sign in UNREACHABLE):
        return "pip cannot reach the package index; check the network, the proxy or PIP_INDEX_URL"
    if "No space left on device" in words:
        return f"{complaint}: the disk is full (about 1 GB is needed)"
    if "DO NOT MATCH THE HASHES" in words:
        return f"{complaint}: a file of the package index is not the one that constraints.txt has the hash of"
    return complaint
