"""Refuses a change that users can notice and that brings no fragment for the changelog; `make check` runs it.

    .venv/bin/python setup/check_changes.py

The commits of the branch are compared with `main`, without a network. A commit that users cannot notice says so in a
line of its message: `Changelog: none`. (`towncrier check` wants a branch of a remote, and a fragment for a change of
tests, too.)
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDER = "changelog.d"
CHANGELOG = "CHANGELOG.md"
NOTICED = ("packages/", "config/", "launch/", "interfaces/")
"""A change of these is one that users can notice."""

BASES = ("origin/main", "main")
UNNOTICED = "Changelog: none"
LONGEST = 300  # characters of a fragment: what, for whom; the rest belongs to the documentation

_NAME = re.compile(r"(\d+|\+[a-z0-9-]+)\.([a-z]+)(\.\d+)?\.md")
_FRAGMENT = re.compile(rf"{FOLDER}/{_NAME.pattern}")


def kinds(root: Path = ROOT) -> list[str]:
    """The kinds of changes that pyproject.toml declares."""
    table = (root / "pyproject.toml").read_text(encoding="utf-8").partition("[tool.towncrier]")[2].partition("\n[")[0]
    return re.findall(r'directory = "(\w+)", name', table)


def unfit_fragments(root: Path = ROOT) -> list[str]:
    """What is wrong with the fragments, a sentence each."""
    allowed, found = kinds(root), []
    for file in sorted((root / FOLDER).iterdir()):
        if file.name in {"README.md", ".gitignore"}:
            continue
        name = _NAME.fullmatch(file.name)
        text = file.read_text(encoding="utf-8").strip()
        if name is None or name[2] not in allowed:
            found.append(f"{FOLDER}/{file.name}: name it NUMBER.KIND.md or +WORDS.KIND.md; KIND is {_one_of(allowed)}.")
        elif not text or text.startswith(("-", "#")):
            found.append(f"{FOLDER}/{file.name}: write one or two sentences, without a heading or a dash.")
        elif len(text) > LONGEST:
            found.append(
                f"{FOLDER}/{file.name}: {len(text)} characters; a line of the changelog has at most {LONGEST}, the "
                "rest belongs to docs/."
            )
    return found


def missing_fragment(root: Path = ROOT) -> str:
    """Why the commits of the branch need a fragment; empty where they do not."""
    start = next((name for name in BASES if _git(root, "rev-parse", "--verify", "--quiet", name)), "")
    if not start:
        return ""  # an archive, or a clone without main: there is nothing to compare with
    noticed: list[str] = []
    for message, files in _commits(root, f"{start}..HEAD"):
        if any(status != "D" and (file == CHANGELOG or _FRAGMENT.fullmatch(file)) for status, file in files):
            return ""
        if UNNOTICED not in message.splitlines():
            noticed += [file for _, file in files if file.startswith(NOTICED)]
    if not noticed:
        return ""
    return (
        f"{noticed[0]} has changed since {start}, and {FOLDER}/ has no new fragment. Write {FOLDER}/NUMBER.KIND.md "
        f"(KIND is {_one_of(kinds(root))}), or put the line “{UNNOTICED}” into the message of a commit that users "
        "cannot notice."
    )


def _commits(root: Path, commits: str) -> Iterator[tuple[str, list[tuple[str, str]]]]:
    """The messages of the commits and the files of each, with git's letter for what has become of the file."""
    listed = _git(root, "log", "--no-merges", "--no-renames", "--name-status", "--format=%x00%B%x01", commits)
    for each in listed.split("\0")[1:]:
        message, _, lines = each.partition("\1")
        files = [line.split("\t") for line in lines.splitlines() if line]
        yield message, [(status, file) for status, file in files]


def _git(root: Path, *arguments: str) -> str:
    """What git prints; nothing where it fails."""
    done = subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, check=False)
    return done.stdout if done.returncode == 0 else ""


def _one_of(names: list[str]) -> str:
    return f"{', '.join(names[:-1])} or {names[-1]}"


def main() -> int:
    """Print every finding; 1 where there is one."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    found = [*unfit_fragments(), missing_fragment()]
    sys.stdout.write("".join(f"{line}\n" for line in found if line))
    return 1 if any(found) else 0


if __name__ == "__main__":
    sys.exit(main())
