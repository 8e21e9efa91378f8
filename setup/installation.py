"""Brings .venv to what uv.lock, pyproject.toml and interfaces/ say, doing only what has changed since."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import uv
from commands import InstallationFailed, finish, run, say, start
from prerequisites import Machine

TABLE = "dependency-groups"
"""Of pyproject.toml: the parts, which are installed by name."""

ALWAYS = ("products", "build", "record")
"""The parts of every clone: without the last one, a stop of the robot leaves no flight record."""

WITHOUT_ROS = ("interfaces", "ros")
"""The parts where no ROS 2 is sourced."""

_OF_THE_CORE = ("abb-protocols", "yumi-ros2")
"""The packages that compile the core, before anything is installed."""

COPIED = ("package.xml", "launch/*", "resource/*")
"""What an editable installation copies to the ament index instead of leading to it."""

DISTRIBUTION = "jazzy"
"""The ROS 2 that PyPI's wheels are of."""

IN_DEACTIVATE = """\
    # >>> ROS 2 of yumi-ros2
    if [ -n "${_OLD_AMENT_PREFIX_PATH+set}" ] ; then
        AMENT_PREFIX_PATH="$_OLD_AMENT_PREFIX_PATH"
        ROS_DISTRO="$_OLD_ROS_DISTRO"
        [ -n "$AMENT_PREFIX_PATH" ] || unset AMENT_PREFIX_PATH
        [ -n "$ROS_DISTRO" ] || unset ROS_DISTRO
        unset _OLD_AMENT_PREFIX_PATH _OLD_ROS_DISTRO
    fi
    # <<< ROS 2 of yumi-ros2
"""
AT_THE_END = f"""
# >>> ROS 2 of yumi-ros2
_OLD_AMENT_PREFIX_PATH="${{AMENT_PREFIX_PATH:-}}"
_OLD_ROS_DISTRO="${{ROS_DISTRO:-}}"
export AMENT_PREFIX_PATH="$VIRTUAL_ENV${{AMENT_PREFIX_PATH:+:$AMENT_PREFIX_PATH}}"
export ROS_DISTRO="${{ROS_DISTRO:-{DISTRIBUTION}}}"
# <<< ROS 2 of yumi-ros2
"""
OWN_LINES = re.compile(r"\n *# >>> ROS 2 of yumi-ros2\n.*?# <<< ROS 2 of yumi-ros2\n", re.DOTALL)


@dataclass(frozen=True)
class Clone:
    """The folders of one clone that set-up reads and writes."""

    root: Path

    @property
    def venv(self) -> Path:
        """The virtual environment: the only place anything is installed in."""
        return self.root / ".venv"

    @property
    def python(self) -> Path:
        """The Python of the virtual environment."""
        return self.venv / "bin" / "python"

    @property
    def logs(self) -> Path:
        """Where the long outputs go."""
        return self.root / "build" / "setup"

    @property
    def record(self) -> Path:
        """What has been installed: the fingerprint of each step that succeeded."""
        return self.venv / "yumi-setup.json"


def install(root: str, machine: Machine, parts: Sequence[str] = ()) -> None:
    """Bring .venv up to date; quick where it is. Raises InstallationFailed.

    Args:
        root: the clone.
        machine: where it is.
        parts: the groups of pyproject.toml that are wanted beside those that .venv has.
    """
    clone = Clone(Path(root))
    known = set(parts_of(clone.root / "pyproject.toml"))
    for part in parts:
        if part not in known:
            raise InstallationFailed(f"there is no part '{part}'; there are: {', '.join(sorted(known))}")
    clone.logs.mkdir(parents=True, exist_ok=True)
    started = time.monotonic()
    with _alone(clone):
        had = set(_recorded(clone).get("parts", "").split()) & known  # the environment may be made anew
        wanted = sorted({*ALWAYS, *([] if machine.sourced else WITHOUT_ROS), *had, *parts})
        with _compiling(clone, Path(sys.executable), "collision", "egm"):  # .venv is being made meanwhile
            done = [
                _step(clone, "environment", _venv_fingerprint(machine), lambda: _make_venv(clone, machine)),
                _step(
                    clone, "packages", _packages_fingerprint(clone, wanted), lambda: _install(clone, machine, wanted)
                ),
                _step(clone, "activation", _activation_fingerprint(machine), lambda: _extend_activation(clone)),
            ]
            _record(clone, "parts", " ".join(wanted))
        with _compiling(clone, clone.python):
            if not machine.sourced:
                _build_interfaces(clone)
    if any(done):
        say(f"done in {time.monotonic() - started:.0f} s")


@contextlib.contextmanager
def _alone(clone: Clone) -> Iterator[None]:
    """Let one set-up at a time work on this clone."""
    with (clone.logs / "lock").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            say("waiting for another set-up of this clone")
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _step(clone: Clone, name: str, fingerprint: str, act: Callable[[], None]) -> bool:
    """Act unless the record says that it was done for the same inputs; whether it acted."""
    if clone.python.exists() and _recorded(clone).get(name) == fingerprint:
        return False
    act()
    _record(clone, name, fingerprint)
    return True


def _record(clone: Clone, name: str, value: str) -> None:
    clone.record.write_text(json.dumps(_recorded(clone) | {name: value}, indent=1) + "\n")


def _recorded(clone: Clone) -> dict[str, str]:
    return dict(json.loads(clone.record.read_text())) if clone.record.exists() else {}


def _venv_fingerprint(machine: Machine) -> str:
    origin = f"the sourced ROS 2 {machine.sourced}" if machine.sourced else "ROS 2 from PyPI"
    return f"Python {'.'.join(map(str, machine.python))}, {origin}, uv {uv.VERSION}"


def _packages_fingerprint(clone: Clone, parts: Sequence[str]) -> str:
    """Of what is installed; of pyproject.toml some tables: a new lint rule installs nothing."""
    wanted, lines = False, []
    for line in (clone.root / "pyproject.toml").read_text().splitlines():
        if line.startswith("["):
            wanted = line.startswith((f"[{TABLE}]", "[tool.uv"))
        if wanted:
            lines.append(line)
    copied = [file for name in COPIED for file in sorted(clone.root.glob(name)) if file.is_file()]
    packages = sorted(clone.root.glob("packages/*/pyproject.toml"))
    files = _digest([clone.root / "uv.lock", *packages, *copied])
    return hashlib.sha256("\n".join([*lines, files, *parts]).encode()).hexdigest()


def _activation_fingerprint(machine: Machine) -> str:
    """Of what is written to the activation, and of the environment, which is made anew with another one."""
    return hashlib.sha256((IN_DEACTIVATE + AT_THE_END + _venv_fingerprint(machine)).encode()).hexdigest()


def _digest(files: list[Path]) -> str:
    digest = hashlib.sha256()
    for file in files:
        digest.update(str(file).encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()


def _uv(clone: Clone, program: Path, command: list[str], name: str, complaint: str) -> None:
    """Run uv for this clone's environment, with the Python that is there and none that uv would fetch."""
    variables = {
        "UV_PROJECT_ENVIRONMENT": str(clone.venv),
        "UV_PYTHON_DOWNLOADS": "never",
        "VIRTUAL_ENV": str(clone.venv),
    }
    run([str(program), *command, "--no-progress"], clone.logs / f"{name}.log", complaint, variables)


def _make_venv(clone: Clone, machine: Machine) -> None:
    """Make the environment, with uv in it: a person installs with uv there, too, since it has no pip."""
    program = uv.bring(clone.root / "build" / "uv")
    kind = ["--system-site-packages"] if machine.sourced else []
    say(f"making .venv: {_venv_fingerprint(machine)} ({sys.executable})")
    command = ["venv", "--no-project", "--clear", "--python", sys.executable, *kind, str(clone.venv)]
    _uv(clone, program, command, "venv", "no virtual environment could be made")
    (clone.venv / "bin" / "uv").hardlink_to(program)


def _install(clone: Clone, machine: Machine, parts: Sequence[str]) -> None:
    """Install what uv.lock pins for these parts: nothing is resolved, and uv refuses a file with another hash."""
    say(f"installing the packages ({', '.join(parts)})")
    selected = [f"--only-group={part}" for part in parts]
    # A sourced ROS 2 is built against the NumPy of its own machine.
    left_out = ["--no-install-package=numpy"] if machine.sourced else []
    # What a person has installed beside stays.
    command = ["sync", "--frozen", "--inexact", "--project", str(clone.root), *selected]
    _uv(clone, clone.venv / "bin" / "uv", [*command, *left_out], "packages", "uv could not install the packages")


def parts_of(file: Path, table: str = TABLE) -> list[str]:
    """The names in a table of pyproject.toml, which Python before 3.11 cannot read."""
    _, _, text = file.read_text().partition(f"\n[{table}]\n")
    return re.findall(r"^([\w-]+) = ", text.partition("\n[")[0], re.MULTILINE)


@contextlib.contextmanager
def _compiling(clone: Clone, python: Path, *units: str) -> Iterator[None]:
    """Compile the core, or some of its units alone, while the rest goes on, where this edition was not compiled before.

    Args:
        clone: whose core.
        python: with Ruckig where the whole core is compiled; what needs no package any Python compiles.
        units: names of ``yumi.core.library``.
    """
    log = clone.logs / "core.log"
    command = [str(python), "-m", "yumi.core.library", *units]
    process = start(
        command,
        log,
        {"PYTHONPATH": os.pathsep.join(str(clone.root / "packages" / name / "src") for name in _OF_THE_CORE)},
    )
    try:
        yield
        try:
            process.wait(1.0)
        except subprocess.TimeoutExpired:
            say("compiling the core")
        finish(process, log, "the core could not be compiled")
    finally:
        process.kill()


def _extend_activation(clone: Clone) -> None:
    """Let `source .venv/bin/activate` set what ROS's tools look for packages by, and `deactivate` take it back."""
    script = clone.venv / "bin" / "activate"
    text = OWN_LINES.sub("\n", script.read_text())
    head, definition, body = text.partition("deactivate () {\n")
    script.write_text(f"{head}{definition}{IN_DEACTIVATE}{body.rstrip()}\n{AT_THE_END}")


def _build_interfaces(clone: Clone) -> None:
    """Let the folder's own script build the message packages; it knows what it has built, and from what."""
    log = clone.logs / "interfaces.log"
    command = [str(clone.python), str(clone.root / "interfaces" / "build.py"), "--log", str(log)]
    if subprocess.run(command, stdin=subprocess.DEVNULL, check=False).returncode != 0:
        sys.exit(1)  # build.py has said why
