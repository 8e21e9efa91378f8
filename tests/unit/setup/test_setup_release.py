"""A release: the version is one, the request is checked, and nothing is left of a release that fails."""

from __future__ import annotations

import runpy
import subprocess
import sys
import tarfile
from pathlib import Path
from shutil import copy
from types import SimpleNamespace

import pytest
import release
from hatchling.builders.sdist import SdistBuilder

import yumi

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    for name in (*release.WRITTEN[:-1], "changelog.d/README.md"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        copy(ROOT / name, tmp_path / name)
    git(tmp_path, "init", "--quiet")
    git(tmp_path, "add", "--all")
    git(tmp_path, "commit", "--quiet", "--message", "Begin")
    return tmp_path


def git(root: Path, *arguments: str) -> str:
    identity = ("-c", "user.name=Test", "-c", "user.email=test@example.org")
    return subprocess.run(["git", *identity, *arguments], cwd=root, check=True, capture_output=True, text=True).stdout


def version(root: Path) -> str:
    return str(runpy.run_path(str(root / release.SOURCE))["__version__"])


@pytest.mark.parametrize("name", release.COPIES)
def test_copy_of_the_version_agrees_with_the_sources(name: str) -> None:
    found = release.COPIES[name].search((ROOT / name).read_text(encoding="utf-8"))
    assert found is not None
    assert found[0] == yumi.__version__


def test_version_is_written_into_every_copy(clone: Path) -> None:
    release.write_version("1.20.3", clone)
    assert version(clone) == "1.20.3"
    assert all(place.search((clone / name).read_text())[0] == "1.20.3" for name, place in release.COPIES.items())  # type: ignore[index]
    changed = [line.split() for line in git(clone, "diff", "--numstat").splitlines()]
    assert {name for _, _, name in changed} == {release.SOURCE, *release.COPIES}
    assert all(added == removed for added, removed, _ in changed)


@pytest.mark.parametrize("new", ["", "1.0", "v1.0.0", "1.0.0rc1"])
def test_version_that_is_none_is_refused(clone: Path, new: str) -> None:
    with pytest.raises(release.ReleaseFailed, match="is not a version; write three numbers"):
        release.check_request(new, clone)


@pytest.mark.parametrize("new", ["0.9.0", "0.10.0"])
def test_version_that_is_not_higher_than_the_released_ones_is_refused(clone: Path, new: str) -> None:
    for tag in ("v0.9.0", "v0.10.0", "v0.2.0", "vendor"):
        git(clone, "tag", tag)
    with pytest.raises(release.ReleaseFailed, match=f"0.10.0 has been released; .* and {new} is not"):
        release.check_request(new, clone)
    release.check_request("0.11.0", clone)


def test_clone_with_changes_is_refused(clone: Path) -> None:
    (clone / "new.txt").write_text("")
    with pytest.raises(release.ReleaseFailed, match="changes that are not committed"):
        release.check_request("9.0.0", clone)


def test_files_are_as_before_when_a_step_fails(clone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(what: str, command: list[str], folder: Path) -> None:
        assert version(clone) == "9.0.0"
        (clone / "CHANGELOG.md").write_text("half")
        git(clone, "rm", "--quiet", "changelog.d/README.md")
        raise release.ReleaseFailed(what)

    monkeypatch.setattr(release, "_run", fails)
    with pytest.raises(release.ReleaseFailed, match="notes"):
        release.make("9.0.0", clone)
    assert git(clone, "status", "--porcelain") == ""


CHANGELOG = """# Changelog

## 0.2.0 (2026-02-01)

### Added

- A gripper.

## Before the first release

Arms.

## 0.1.0 (2026-01-01)

- Nothing.
"""


def test_notes_are_the_section_of_the_version() -> None:
    text = "# yumi-ros2 0.2.0 (2026-02-01)\n\n### Added\n\n- A gripper.\n\n## Before the first release\n\nArms.\n"
    assert release.notes(CHANGELOG, "0.2.0") == text
    assert release.notes(CHANGELOG, "0.1.0") == "# yumi-ros2 0.1.0 (2026-01-01)\n\n- Nothing.\n"
    with pytest.raises(release.ReleaseFailed, match=r"CHANGELOG.md has no section of 0\.3\.0"):
        release.notes(CHANGELOG, "0.3.0")


def test_command_that_fails_ends_with_what_was_printed(tmp_path: Path) -> None:
    with pytest.raises(release.ReleaseFailed, match=r"(?s)its installation failed with status 3.*no such wheel"):
        release._run("its installation", ["sh", "-c", "echo no such wheel; exit 3"], tmp_path)


def test_python_that_does_not_start_is_not_chosen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A manager of Pythons has commands of all, and each starts only where its version is chosen."""
    for name, script in (
        ("python3.10", '[ "$PYENV_VERSION" = 3.10 ] && echo /opt/3.10/bin/python'),
        ("python3.14", "exit 127"),
    ):
        (tmp_path / name).write_text(f"#!/bin/sh\n{script}\n")
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/bin")
    monkeypatch.setenv("PYENV_VERSION", "3.11")
    monkeypatch.setattr(release.sys, "version_info", SimpleNamespace(major=3, minor=11))
    assert release.other_pythons() == [sys.executable, "/opt/3.10/bin/python"]


@pytest.mark.parametrize("name", release.PACKAGES)
def test_licence_is_a_file_in_the_sources_of_each_package(name: str, tmp_path: Path) -> None:
    licence = (ROOT / "LICENSE").read_bytes()
    assert not (ROOT / "packages" / name / "LICENSE").is_symlink()
    assert (ROOT / "packages" / name / "LICENSE").read_bytes() == licence
    (archive,) = SdistBuilder(str(ROOT / "packages" / name)).build(directory=str(tmp_path))
    with tarfile.open(archive) as files:
        (found,) = (each for each in files.getmembers() if each.name.endswith("/LICENSE"))
        assert found.isfile()
        assert found.size == len(licence)
