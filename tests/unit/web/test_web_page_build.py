"""The page is built once, again when its sources change, and a machine that cannot build it reads what to do."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from abb_protocols.catalogue.actions import ACTIONS
from abb_protocols.errors import MissingPrerequisite
from abb_runtime.faults import Fault
from refusals import refused
from yumi.driver.commands import COMMANDS
from yumi.web import page_build

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.timeout(180)
def test_state_of_the_page_and_what_is_shown_of_it() -> None:
    """The tests of what is not drawing run in Node.js."""
    printed = page_build.run_script("test")
    assert "\n# fail 0\n" in printed or "ℹ fail 0\n" in printed
    assert "# pass 0\n" not in printed


def test_built_page_has_the_licence_of_what_is_in_it_and_no_address_of_another_machine() -> None:
    folder = page_build.page_folder()
    assert {file.name for file in folder.iterdir()} == {"index.html", "style.css", "app.js", "LICENSE-three"}
    assert "three.js authors" in (folder / "LICENSE-three").read_text()
    assert "SPDX-License-Identifier: MIT" in (folder / "app.js").read_text()
    page = (folder / "index.html").read_text()
    assert "//" not in page.replace("<!doctype html>", "")


def test_repository_has_neither_foreign_nor_built_code_of_the_page() -> None:
    listed = subprocess.run(
        ["git", "ls-files", "packages/yumi-ros2/src/yumi/web"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if listed.returncode:
        pytest.skip("not a clone")
    suffixes = {Path(name).suffix for name in listed.stdout.split()}
    assert suffixes == {".py", ".ts", ".html", ".css", ".json"}


def test_every_fault_of_the_virtual_robot_has_words_on_the_page() -> None:
    words = (page_build.SOURCES / "src" / "faults.ts").read_text()
    without = [each.value.name for each in Fault if not any(f"{q}{each.value.name}{q}:" in words for q in ('"', ""))]
    assert without == []


def test_button_that_a_sentence_of_the_page_names_is_there_by_that_name() -> None:
    sources = [page_build.SOURCES / "index.html", *(page_build.SOURCES / "src").glob("*.ts")]
    of_commands = [f'"{kind.button}"' for kind in COMMANDS]  # their buttons are made from the table
    markup = "\n".join([*(each.read_text() for each in sources), *of_commands])
    words = [ACTIONS[action][front_end] for action in ACTIONS for front_end in ("page", "virtual_page")]
    said = "\n".join([markup, *(f"{each.do}; {each.name}" for each in words)])
    named = set(re.findall("“([^“”]+)”", said))
    assert {"Start EGM", "Stop (ends EGM)", "Recover…", "Calibrate grippers"} <= named
    assert [name for name in sorted(named) if not re.search(rf"[>\"]{re.escape(name)}[<\"]", markup)] == []


@pytest.fixture
def copied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Sources outside of a clone, whose page is built in the user's cache, by programs that a test writes."""
    sources = tmp_path / "lib" / "yumi" / "web" / "page"
    shutil.copytree(page_build.SOURCES, sources)
    monkeypatch.setattr(page_build, "SOURCES", sources)
    monkeypatch.setattr(page_build, "_of_the_environment", lambda: None)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    program(tmp_path / "node", "echo v22.1.0")
    builds = (
        "mkdir -p site node_modules/three; echo app > site/app.js; echo MIT > node_modules/three/LICENSE; "
        f'echo "$1" >> {tmp_path}/asked'
    )
    program(tmp_path / "npm", builds)
    return tmp_path


def program(file: Path, script: str) -> None:
    file.write_text(f"#!/bin/sh\n{script}\n")
    file.chmod(0o755)


def test_page_is_built_once_and_again_when_a_source_changes(copied: Path) -> None:
    told: list[str] = []
    first = page_build.built(told.append)
    assert first.parent == copied / "cache" / "yumi-ros2"
    assert (first / "app.js").read_text() == "app\n"
    assert len(told) == 2
    assert told[0].startswith("The page is built once for this installation: ")
    assert page_build.built(told.append) == first
    assert (copied / "asked").read_text().split() == ["ci", "run"]

    (page_build.SOURCES / "style.css").write_text("body { color: red; }\n")
    second = page_build.built(told.append)
    assert second != first
    assert (second / "style.css").read_text() == "body { color: red; }\n"
    assert (copied / "asked").read_text().split() == ["ci", "run", "run"]  # the packages are the same
    (page_build.SOURCES / "package-lock.json").write_text("{}\n")
    page_build.built(told.append)
    assert (copied / "asked").read_text().split()[3:] == ["ci", "run"]


def test_machine_without_node_reads_what_to_install(copied: Path) -> None:
    program(copied / "node", "echo v18.20.0")  # too old
    with refused(MissingPrerequisite, "page_without_node", oldest=20):
        page_build.built()
    (copied / "node").unlink()
    os.environ["PATH"] = str(copied)
    with refused(MissingPrerequisite, "page_without_node", oldest=20):
        page_build.built()


def test_machine_that_does_not_reach_npm_reads_so_and_tries_again_the_next_time(copied: Path) -> None:
    works = (copied / "npm").read_text()
    program(copied / "npm", 'echo "npm error network request to registry failed"; exit 1')
    with refused(MissingPrerequisite, "page_not_fetched", output="npm error network request to registry failed"):
        page_build.built()
    (copied / "npm").write_text(works)
    assert (page_build.built() / "index.html").exists()


def test_page_that_does_not_build_is_not_taken_for_one_that_does(copied: Path) -> None:
    program(copied / "npm", '[ "$1" = ci ] || { echo "main.ts:1: error"; exit 1; }')
    for _ in range(2):
        with pytest.raises(MissingPrerequisite, match=r"main.ts:1: error"):
            page_build.built()
