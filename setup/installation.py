"""Brings .venv to what constraints.txt, pyproject.toml and interfaces/ say, doing only what has changed since."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from commands import environment, pip_install, run, say
from prerequisites import Machine

BROUGHT_BY_ROS = ("ros-", "numpy==", "catkin-pkg==", "cmake==", "empy==", "ninja==")
"""How the pins begin that a sourced ROS 2 has no need of, or must not get."""

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


def install(root: str, machine: Machine) -> None:
    """Bring .venv up to date; quick where it is. Raises InstallationFailed."""
    clone = Clone(Path(root))
    clone.logs.mkdir(parents=True, exist_ok=True)
    started = time.monotonic()
    with _alone(clone):
        done = [
            _step(clone, "venv", _venv_fingerprint(machine), lambda: _make_venv(clone, machine)),
            _step(clone, "packages", _packages_fingerprint(clone), lambda: _install_packages(clone, machine)),
            _step(clone, "clone", _clone_fingerprint(clone), lambda: _install_clone(clone)),
            _step(clone, "library", _library_fingerprint(clone), lambda: _compile_library(clone)),
            _step(clone, "activation", _activation_fingerprint(machine), lambda: _extend_activation(clone)),
        ]
        if not machine.sourced:
            done.append(_step(clone, "interfaces", _interfaces_fingerprint(clone), lambda: _build_interfaces(clone)))
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
    clone.record.write_text(json.dumps(_recorded(clone) | {name: fingerprint}, indent=1) + "\n")
    return True


def _recorded(clone: Clone) -> dict[str, str]:
    return dict(json.loads(clone.record.read_text())) if clone.record.exists() else {}


def _venv_fingerprint(machine: Machine) -> str:
    origin = f"the sourced ROS 2 {machine.sourced}" if machine.sourced else "ROS 2 from PyPI"
    return f"Python {'.'.join(map(str, machine.python))}, {origin}"


def _packages_fingerprint(clone: Clone) -> str:
    return _digest([clone.root / "constraints.txt"])


def _clone_fingerprint(clone: Clone) -> str:
    """Of what an installation copies and reads, of pyproject.toml some tables: a new lint rule installs nothing."""
    wanted, lines = False, []
    for line in (clone.root / "pyproject.toml").read_text().splitlines():
        if line.startswith("["):
            wanted = line.startswith(("[build-system]", "[project", "[tool.hatch"))
        if wanted:
            lines.append(line)
    copied = [file for name in COPIED for file in sorted(clone.root.glob(name)) if file.is_file()]
    return hashlib.sha256("\n".join([*lines, _digest(copied)]).encode()).hexdigest()


def _library_fingerprint(clone: Clone) -> str:
    return _digest(sorted(clone.root.glob("src/yumi/robot/collision*")))


def _activation_fingerprint(machine: Machine) -> str:
    """Of what is written to the activation, and of the environment, which is made anew with another one."""
    return hashlib.sha256((IN_DEACTIVATE + AT_THE_END + _venv_fingerprint(machine)).encode()).hexdigest()


def _interfaces_fingerprint(clone: Clone) -> str:
    folder = clone.root / "interfaces"
    return _digest(sorted(file for file in folder.rglob("*") if file.is_file() and "__pycache__" not in file.parts))


def _digest(files: list[Path]) -> str:
    digest = hashlib.sha256()
    for file in files:
        digest.update(str(file).encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()


def _make_venv(clone: Clone, machine: Machine) -> None:
    shutil.rmtree(clone.venv, ignore_errors=True)
    kind = ["--system-site-packages"] if machine.sourced else []
    say(f"making .venv: {_venv_fingerprint(machine)} ({sys.executable})")
    command = [sys.executable, "-m", "venv", *kind, str(clone.venv)]
    run(command, clone.logs / "venv.log", "no virtual environment could be made")


def _install_packages(clone: Clone, machine: Machine) -> None:
    """Install what constraints.txt pins: nothing is resolved, and pip refuses a file with another hash."""
    requirements = pins(clone)
    if machine.sourced:  # it brings ROS, and is built against the NumPy of its own machine
        say("installing the packages that ROS 2 does not bring")
        requirements = [each for each in requirements if not each.startswith(BROUGHT_BY_ROS)]
    else:
        say(f"installing {len(requirements)} packages: a minute or two the first time")
        # setuptools goes first, to build empy, which is no wheel.
        tools = [each for each in requirements if each.startswith("setuptools==")]
        _install_hashed(clone, tools, "setuptools")
    _install_hashed(clone, requirements, "packages")


def _install_hashed(clone: Clone, requirements: list[str], name: str) -> None:
    file = clone.logs / f"{name}.txt"
    file.write_text("\n".join(requirements) + "\n")
    hashed = ["--require-hashes", "--no-deps", "--no-build-isolation", "--requirement", str(file)]
    pip_install(clone.python, hashed, clone.logs / f"{name}.log")


def pins(clone: Clone) -> list[str]:
    """The lines of constraints.txt: each a pin with its hashes, which stand on lines of their own there."""
    lines = (clone.root / "constraints.txt").read_text().replace("\\\n", " ").splitlines()
    return [" ".join(line.split()) for line in lines if "==" in line]


def _install_clone(clone: Clone) -> None:
    arguments = ["--no-deps", "--no-build-isolation", "--editable", str(clone.root)]
    pip_install(clone.python, arguments, clone.logs / "clone.log")


def _compile_library(clone: Clone) -> None:
    command = [str(clone.python), "-m", "yumi.robot.collision_library"]
    run(command, clone.logs / "library.log", "the collision library could not be compiled")


def _extend_activation(clone: Clone) -> None:
    """Let `source .venv/bin/activate` set what ROS's tools look for packages by, and `deactivate` take it back."""
    script = clone.venv / "bin" / "activate"
    text = OWN_LINES.sub("\n", script.read_text())
    head, definition, body = text.partition("deactivate () {\n")
    script.write_text(f"{head}{definition}{IN_DEACTIVATE}{body.rstrip()}\n{AT_THE_END}")


def _build_interfaces(clone: Clone) -> None:
    log = clone.logs / "interfaces.log"
    command = [str(clone.python), str(clone.root / "interfaces" / "build.py"), "--log", str(log)]
    if subprocess.run(command, env=environment(), stdin=subprocess.DEVNULL, check=False).returncode != 0:
        sys.exit(1)  # build.py has said why
