"""Makes a release in a clone that is set up: `make release VERSION=0.1.0`.

    .venv/bin/python setup/release.py 0.1.0

The version is written into each file whose readers cannot derive it. Fragments of changelog.d/ become a section of
CHANGELOG.md, and dist/ gets the wheels and the sources of each package, and the notes. All are then installed in empty
environments, of two Pythons where there are two. Where a step fails, the files of the clone are as before. Commit, tag
and upload are left to a person; the last lines say how.
"""

from __future__ import annotations

import datetime
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[1]
SOURCE = "packages/yumi-ros2/src/yumi/__init__.py"
"""Where the version is."""

_VERSION = re.compile(r'^__version__ = "(.+)"$', re.MULTILINE)
_OF_MODULE = re.compile(r'(?<=^__version__ = ").+(?="$)', re.MULTILINE)
_NUMBERS = re.compile(r"(\d+)\.(\d+)\.(\d+)")
PACKAGES = ("abb-protocols", "abb-runtime", "abb-view", "virtual-irc5", "yumi-ros2", "yumi-evaluation")
"""The distributions: what each needs comes before it."""

_NEEDED = re.compile(
    f"(?:{'|'.join(f'(?<={re.escape(name)}==)' for name in (*PACKAGES, 'virtual-irc5[robotware7]'))})[\\d.]+"
)
COPIES = {
    **{
        f"packages/{name}/src/{name.replace('-', '_')}/__init__.py": _OF_MODULE
        for name in PACKAGES
        if name != "yumi-ros2"
    },
    **{f"packages/{name}/pyproject.toml": _NEEDED for name in PACKAGES[1:]},  # of each other
    "package.xml": re.compile(r"(?<=<version>)[^<]+(?=</version>)"),
    "interfaces/yumi_interfaces/package.xml": re.compile(r"(?<=<version>)[^<]+(?=</version>)"),
    "CITATION.cff": re.compile(r"(?<=^version: ).+$", re.MULTILINE),
}
"""The files whose readers take no version from elsewhere, and the place in them."""

WRITTEN = (SOURCE, *COPIES, "CHANGELOG.md", "changelog.d")
PYTHONS = ("python3.10", "python3.11", "python3.12", "python3.13", "python3.14")

IS_INSTALLED = """
import sys
from importlib.metadata import distribution
for name in sys.argv[2:]:
    installed = distribution(name)
    assert installed.version == sys.argv[1], installed.version
    (licence,) = (file for file in installed.files if file.match("*.dist-info/licenses/LICENSE"))
    assert "Apache License" in licence.read_text()
"""

MOVES_AN_ARM = """
import yumi
from pathlib import Path
from virtual_irc5.testing.controller_process import ControllerProcess
with ControllerProcess(Path("controller.log"), {"calibrated": True}) as controller:
    with yumi.connect(**controller.connect_options) as robot:
        goal = yumi.degrees(20, -110, -135, 30, 0, 40, 0)
        robot.right.move_to(goal)
        assert max(abs(a - b) for a, b in zip(goal, robot.right.position)) < 0.002
"""

TESTED = ("test_any_robot.py", "six_axes.mod")
"""Of examples/: what a user of the virtual controller tests, with the fixtures of pytest."""

STEPS_THROUGH_RAPID = f"""
import subprocess
from pathlib import Path
from abb_runtime.rws.client import RwsClient
from virtual_irc5.testing.controller_process import ControllerProcess
with ControllerProcess(Path("controller.log"), {{"model": "irb120", "program": "T_ROB1={TESTED[1]}"}}) as controller:
    with RwsClient(controller.address) as client:
        client.set_motors(True)
    debug = ["virtual-irc5", "debug", "T_ROB1", "--yes", "--robot", controller.address]
    done = subprocess.run(debug, input="main\\nstep\\nwhere\\nquit\\n", capture_output=True, text=True)
    assert "#0 Main/main, line 4" in done.stdout, done.stdout + done.stderr
"""

SHOWS_A_ROBOT = """
import urllib.request
from pathlib import Path
from abb_runtime.process.command_process import CommandProcess
from virtual_irc5.testing.controller_process import ControllerProcess
with ControllerProcess(Path("controller.log"), {"model": "irb120"}) as controller:
    options = ("view", "--robot", controller.address, "--port", "0")
    with CommandProcess("view", "virtual_irc5", options, Path("view.log")) as view:
        page = view.wait_until_ready(60.0)
        for name in ("", "static/app.js", "static/shell.css", "model.json", "meshes/base.stl"):
            assert urllib.request.urlopen(page + name).status == 200
"""


class ReleaseFailed(Exception):
    """The release was not made."""


def write_version(new: str, root: Path = ROOT) -> None:
    """Write the version into the sources and the copies."""
    _replace(root / SOURCE, _VERSION, f'__version__ = "{new}"')
    for name, place in COPIES.items():
        _replace(root / name, place, new)


def check_request(new: str, root: Path = ROOT) -> None:
    """Whether this version can be released from this clone.

    Raises:
        ReleaseFailed: the version is none, exists or is older, or the clone has changes that are not committed.
    """
    if not _NUMBERS.fullmatch(new):
        raise ReleaseFailed(f"{new!r} is not a version; write three numbers: make release VERSION=0.1.0")
    if _git(root, "status", "--porcelain"):
        raise ReleaseFailed("The clone has changes that are not committed; commit or stash them first.")
    tags = _git(root, "tag", "--list", "v*").split()
    released = sorted(tuple(map(int, found.groups())) for tag in tags if (found := _NUMBERS.fullmatch(tag[1:])))
    if released and _numbers(new) <= released[-1]:
        newest = ".".join(map(str, released[-1]))
        raise ReleaseFailed(f"{newest} has been released; the next version is higher than that, and {new} is not.")


def notes(changelog: str, new: str) -> str:
    """What CHANGELOG.md says about a version, up to the version before.

    Raises:
        ReleaseFailed: it says nothing.
    """
    _, heading, rest = changelog.partition(f"\n## {new} (")
    if not heading:
        raise ReleaseFailed(f"CHANGELOG.md has no section of {new}.")
    first, *lines = rest.splitlines()
    end = next((number for number, line in enumerate(lines) if re.match(r"## \d", line)), len(lines))
    return "\n".join([f"# yumi-ros2 {new} ({first}", *lines[:end]]).rstrip() + "\n"


def make(new: str, root: Path = ROOT) -> Path:
    """Write the files of the release into dist/ and check them.

    Returns:
        The folder.

    Raises:
        ReleaseFailed: a step failed; the files of the clone are as before.
    """
    check_request(new, root)
    dist = root / "dist"
    try:
        write_version(new, root)
        today = datetime.date.today().isoformat()
        _run("notes", [sys.executable, "-m", "towncrier", "build", "--yes", "--version", new, "--date", today], root)
        shutil.rmtree(dist, ignore_errors=True)
        dist.mkdir()
        text = (root / "CHANGELOG.md").read_text(encoding="utf-8")
        (dist / f"notes-{new}.md").write_text(notes(text, new), encoding="utf-8")
        build(dist, root)
        for name, check in checks(new, dist):
            print(f"release: {name}", flush=True)
            print(f"  {check()}", flush=True)
    except BaseException:
        _git(root, "reset", "--quiet", "HEAD", "--", *WRITTEN)
        _git(root, "checkout", "--quiet", "HEAD", "--", *WRITTEN)
        raise
    return dist


def build(dist: Path, root: Path = ROOT) -> None:
    """The sources of each package, and what `make wheels` makes."""
    for name in PACKAGES:
        build_sources = [sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", str(dist)]
        _run(f"sources of {name}", build_sources, root / "packages" / name)
    _run("make wheels", ["make", "wheels"], root)


def checks(new: str, dist: Path) -> Iterator[tuple[str, Callable[[], str]]]:
    """What is tried in empty environments, each with its name; a check returns the size of its environment."""
    (plain,) = dist.glob("yumi_ros2-*-py3-none-*.whl")
    (built,) = dist.glob("yumi_ros2-*-cp3*-cp3*.whl")
    pythons = other_pythons()
    if len(pythons) < 2:
        print(f"release: there is no other Python ({', '.join(PYTHONS)}): one is checked.", flush=True)

    def are_installed(*names: str) -> list[str]:
        return ["python", "-c", IS_INSTALLED, new, *names]

    moves = ["python", "-c", MOVES_AN_ARM]
    rapid = [["pytest", "-q", TESTED[0]], ["python", "-c", STEPS_THROUGH_RAPID]]
    everything = "yumi-ros2[virtual,evaluation]"
    tries: list[tuple[str, str, list[str], list[list[str]]]] = []  # name, Python, what is installed, commands
    for python in pythons:
        tries += [
            (
                "virtual-irc5 from wheels",
                python,
                ["virtual-irc5", "pytest"],
                [are_installed(*PACKAGES[:2], "virtual-irc5"), *rapid],
            ),
            (
                "virtual-irc5 with its view from wheels",
                python,
                ["virtual-irc5[page]"],
                [are_installed(*PACKAGES[:4]), ["python", "-c", SHOWS_A_ROBOT]],
            ),
            (
                "yumi-ros2 from wheels",
                python,
                [str(plain)],
                [are_installed(*PACKAGES[:3], "yumi-ros2"), ["yumi", "fault"]],
            ),
            (
                "all packages from wheels",
                python,
                [f"{plain}[virtual,evaluation]"],
                [are_installed(*PACKAGES), moves, ["yumi", "tune"]],
            ),
            (
                "all packages from sources",
                python,
                [everything, "pytest", *(f"--no-binary={name}" for name in PACKAGES)],
                [are_installed(*PACKAGES), *rapid, moves, ["yumi", "tune"]],
            ),
        ]
    demo = [are_installed(*PACKAGES[:5]), ["yumi", "demo"]]
    tries.append((built.name, sys.executable, [f"{built}[virtual,ros,record]"], demo))
    for name, python, installed, commands in tries:
        yield f"{name} on {python}", partial(try_out, python, dist, installed, commands)


def other_pythons() -> list[str]:
    """This Python, and the newest other one that is supported and installed."""
    here = f"python{sys.version_info.major}.{sys.version_info.minor}"
    others = [python for name in PYTHONS if name != here and (python := _executable(name))]
    return [sys.executable, *others[-1:]]


def _executable(name: str) -> str:
    """The program of a Python; empty where none starts. A command of pyenv starts the version that a variable names."""
    program = shutil.which(name)
    if program is None:
        return ""
    variables = {**os.environ, "PYENV_VERSION": name.removeprefix("python")}
    command = [program, "-c", "import sys; print(sys.executable)"]
    return subprocess.run(command, env=variables, capture_output=True, text=True, check=False).stdout.strip()


def try_out(python: str, dist: Path, installed: list[str], commands: list[list[str]]) -> str:
    """Install packages of dist/ in an empty environment, away from the clone, and run commands there.

    Args:
        python: whose environment.
        dist: the folder of the packages.
        installed: arguments of uv: requirements, files, options.
        commands: what is run, one after another.

    Returns:
        Size of the environment.

    Raises:
        ReleaseFailed: one of them fails; the message ends with what was printed.
    """
    with TemporaryDirectory(prefix="release-") as name:
        folder = Path(name)
        for file in TESTED:
            shutil.copy(ROOT / "examples" / file, folder)
        environment = folder / "venv"
        variables = {
            "PATH": f"{environment / 'bin'}:{os.environ['PATH']}",
            "PYTHONPATH": "",
            "VIRTUAL_ENV": str(environment),
            "UV_PYTHON_DOWNLOADS": "never",
        }
        uv = str(Path(sys.prefix) / "bin" / "uv")
        empty = [uv, "venv", "--no-project", "--python", python, str(environment)]
        _run("an empty environment", empty, folder, **variables)
        install = [uv, "pip", "install", "--find-links", str(dist), *installed]
        _run("the installation", install, folder, **variables)
        size = sum(file.stat().st_size for file in environment.rglob("*") if file.is_file() and not file.is_symlink())
        packages = len(list(environment.glob("lib/python*/site-packages/*.dist-info")))
        for command in commands:
            _run(" ".join(command[:2]), command, folder, **variables)
    return f"{size / 1e6:.0f} MB, {packages} packages"


def _run(what: str, command: list[str], folder: Path, **variables: str) -> None:
    environment = {**os.environ, **variables}
    program = shutil.which(command[0], path=environment["PATH"]) or command[0]
    done = subprocess.run(
        [program, *command[1:]],
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    if done.returncode:
        raise ReleaseFailed(f"{what} failed with status {done.returncode}:\n{done.stdout[-3000:]}")


def _git(root: Path, *arguments: str) -> str:
    return subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, check=True).stdout


def _numbers(text: str) -> tuple[int, ...]:
    return tuple(map(int, text.split(".")))


def _replace(file: Path, place: re.Pattern[str], text: str) -> None:
    before = file.read_text(encoding="utf-8")
    after, count = place.subn(lambda _: text, before)
    if not count:
        raise ReleaseFailed(f"{file.name} has no place for the version.")
    file.write_text(after, encoding="utf-8")


def main() -> None:
    """Make a release; one sentence where it cannot be made."""
    (new,) = sys.argv[1:] or [""]
    try:
        dist = make(new)
    except ReleaseFailed as error:
        sys.exit(f"release: {error}")
    for file in sorted(dist.iterdir()):
        print(f"  {file.relative_to(ROOT)}  {file.stat().st_size / 1e6:.1f} MB")
    print(
        f"Checked. Look at dist/notes-{new}.md and `git diff HEAD`, then:\n"
        f'  git commit -am "Release {new}"\n'
        f"  git tag --annotate --cleanup=whitespace --file dist/notes-{new}.md v{new}\n"
        "  git push --follow-tags"
    )


if __name__ == "__main__":
    main()
