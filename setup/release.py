"""Makes a release in a clone that is set up: `make release VERSION=0.1.0`.

    .venv/bin/python setup/release.py 0.1.0

The version is written into each file whose readers cannot derive it. Fragments of changelog.d/ become a section of
CHANGELOG.md, and dist/ gets both wheels, the sources and the notes. Each is then installed in an empty environment, of
two Pythons where there are two. Where a step fails, the files of the clone are as before. Commit, tag and upload are
left to a person; the last lines say how.
"""

from __future__ import annotations

import datetime
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCE = "packages/yumi-ros2/src/yumi/__init__.py"
"""Where the version is."""

_VERSION = re.compile(r'^__version__ = "(.+)"$', re.MULTILINE)
_OF_MODULE = re.compile(r'(?<=^__version__ = ").+(?="$)', re.MULTILINE)
_NUMBERS = re.compile(r"(\d+)\.(\d+)\.(\d+)")
PACKAGES = ("abb-protocols", "abb-runtime", "virtual-irc5", "yumi-ros2", "yumi-evaluation")
"""The distributions: what each needs comes before it."""

_NEEDED = re.compile(r"(?<=~=)[\d.]+")
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

MOVES_AN_ARM = """
import sys, yumi
from pathlib import Path
from yumi.testing.virtual_yumi import ControllerProcess
assert yumi.__version__ == sys.argv[1], yumi.__version__
with ControllerProcess(Path("controller.log"), {"calibrated": True}) as controller:
    with yumi.connect(**controller.connect_options) as robot:
        goal = yumi.degrees(20, -110, -135, 30, 0, 40, 0)
        robot.right.move_to(goal)
        assert max(abs(a - b) for a, b in zip(goal, robot.right.position)) < 0.002
"""


CHECKS_RAPID = """
import sys, virtual_irc5
from pathlib import Path
from virtual_irc5.commands.check import check_program
assert virtual_irc5.__version__ == sys.argv[1], virtual_irc5.__version__
file = Path("main.mod")
move = "MoveAbsJ [[20,10,-10,15,40,25],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,fine,tool0;"
file.write_text(f"MODULE Main\\nPROC main()\\n{move}\\nENDPROC\\nENDMODULE\\n")
assert check_program([file], robot="irb120") == []
file.write_text(file.read_text().replace("fine", "unknown_zone"))
assert len(check_program([file], robot="irb120")) == 1
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
            check()
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


def checks(new: str, dist: Path) -> Iterator[tuple[str, Callable[[], None]]]:
    """What is tried in empty environments, each with its name."""
    (sources,) = dist.glob("yumi_ros2-*.tar.gz")
    (plain,) = dist.glob("yumi_ros2-*-py3-none-*.whl")
    (built,) = dist.glob("yumi_ros2-*-cp3*-cp3*.whl")
    (virtual,) = dist.glob("virtual_irc5-*.whl")
    pythons = other_pythons()
    if len(pythons) < 2:
        print(f"release: there is no other Python ({', '.join(PYTHONS)}): one is checked.", flush=True)
    moves, rapid = ["python", "-c", MOVES_AN_ARM, new], ["python", "-c", CHECKS_RAPID, new]
    for python in pythons:
        yield f"{virtual.name} on {python} checks RAPID", lambda python=python: try_out(python, virtual, "", rapid)  # type: ignore[misc]
        yield f"{plain.name} on {python} moves an arm", lambda python=python: try_out(python, plain, "[virtual]", moves)  # type: ignore[misc]
    yield f"{sources.name} moves an arm", lambda: try_out(sys.executable, sources, "[virtual]", moves)
    yield (
        f"{built.name} runs the demonstration",
        lambda: try_out(sys.executable, built, "[virtual,ros,record]", ["yumi", "demo"]),
    )


def other_pythons() -> list[str]:
    """This Python, and the newest other one that is supported and installed."""
    here = f"python{sys.version_info.major}.{sys.version_info.minor}"
    others = [python for name in PYTHONS if name != here and (python := shutil.which(name)) and _runs(python)]
    return [sys.executable, *others[-1:]]


def try_out(python: str, package: Path, extras: str, command: list[str]) -> None:
    """Install a package of dist/ in an empty environment, away from the clone, and run a command there.

    Raises:
        ReleaseFailed: one of them fails; the message ends with what was printed.
    """
    folder = ROOT / "build" / "release"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    environment = folder / "venv"
    variables = {"PATH": f"{environment / 'bin'}:{os.environ['PATH']}", "PYTHONPATH": ""}
    _run("an empty environment", [python, "-m", "venv", str(environment)], folder)
    own = ["--find-links", str(package.parent)]  # the other packages of this release
    _run("its installation", ["pip", "install", "--quiet", *own, f"{package}{extras}"], folder, **variables)
    _run(" ".join(command[:2]), command, folder, **variables)


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


def _runs(python: str) -> bool:
    """Whether it is a Python: pyenv has commands of Pythons that it does not start."""
    return subprocess.run([python, "-c", ""], capture_output=True, check=False).returncode == 0


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
