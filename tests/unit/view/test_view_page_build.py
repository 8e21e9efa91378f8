"""The page is built once, again when its sources change, and a machine that cannot build it reads what to do."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

import pytest

from abb_protocols.catalogue.actions import ACTIONS
from abb_protocols.errors import MissingPrerequisite
from abb_runtime.faults import Fault
from abb_view import page_build
from abb_view.page_build import CONTROLLER_PAGE, PAGE_SHELL, PageSources
from refusals import refused
from yumi.driver.commands import COMMANDS
from yumi.web.page_build import ROBOT_PAGE

ROOT = Path(__file__).resolve().parents[3]


BOTH = pytest.mark.parametrize("page", [CONTROLLER_PAGE, ROBOT_PAGE], ids=["controller", "robot"])


@BOTH
@pytest.mark.timeout(180)
def test_state_of_the_page_and_what_is_shown_of_it(page: PageSources) -> None:
    """The tests of what is not drawing run in Node.js."""
    printed = page_build.run_script(page, "test")
    assert "\n# fail 0\n" in printed or "ℹ fail 0\n" in printed
    assert "# pass 0\n" not in printed


@BOTH
def test_built_page_has_the_licence_of_what_is_in_it_and_no_address_of_another_machine(page: PageSources) -> None:
    folder = page_build.page_folder(page)
    own = {"style.css"} if page is ROBOT_PAGE else set()
    assert {file.name for file in folder.iterdir()} == {"index.html", "shell.css", "app.js", "LICENSE-three"} | own
    assert "three.js authors" in (folder / "LICENSE-three").read_text()
    assert "SPDX-License-Identifier: MIT" in (folder / "app.js").read_text()
    markup = (folder / "index.html").read_text()
    assert "//" not in markup.replace("<!doctype html>", "")


def test_repository_has_neither_foreign_nor_built_code_of_the_page() -> None:
    folders = ("packages/abb-view/src/abb_view", "packages/yumi-ros2/src/yumi/web")
    listed = subprocess.run(["git", "ls-files", *folders], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("not a clone")
    suffixes = {Path(name).suffix for name in listed.stdout.split()}
    assert suffixes == {".py", ".ts", ".html", ".css", ".json", ".stl"}


def test_every_fault_of_the_virtual_robot_has_words_on_the_page() -> None:
    words = (PAGE_SHELL / "faults.ts").read_text()
    without = [each.value.name for each in Fault if not any(f"{q}{each.value.name}{q}:" in words for q in ('"', ""))]
    assert without == []


def test_button_that_a_sentence_of_the_page_names_is_there_by_that_name() -> None:
    folders = (PAGE_SHELL, ROBOT_PAGE.sources / "src")
    sources = [ROBOT_PAGE.sources / "index.html", *(file for folder in folders for file in folder.glob("*.ts"))]
    of_commands = [f'"{kind.button}"' for kind in COMMANDS]  # their buttons are made from the table
    markup = "\n".join([*(each.read_text() for each in sources), *of_commands])
    words = [ACTIONS[action][front_end] for action in ACTIONS for front_end in ("page", "virtual_page")]
    said = "\n".join([markup, *(f"{each.do}; {each.name}" for each in words)])
    named = set(re.findall("“([^“”]+)”", said))
    assert {"Start EGM", "Stop (ends EGM)", "Recover…", "Calibrate grippers"} <= named
    assert [name for name in sorted(named) if not re.search(rf"[>\"]{re.escape(name)}[<\"]", markup)] == []


class Copied(NamedTuple):
    """A folder with a page outside of a clone."""

    folder: Path
    page: PageSources


@pytest.fixture
def copied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Copied:
    """Sources outside of a clone, whose page is built in the user's cache, by programs that a test writes."""
    sources = tmp_path / "lib" / "yumi" / "web" / "page"
    shutil.copytree(ROBOT_PAGE.sources, sources)
    shell = tmp_path / "lib" / "abb_view" / "shell"
    shutil.copytree(PAGE_SHELL, shell)
    monkeypatch.setattr(page_build, "PAGE_SHELL", shell)
    monkeypatch.setattr(page_build, "_of_the_environment", lambda: None)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    program(tmp_path / "node", "echo v22.1.0")
    builds = (
        "mkdir -p site node_modules/three; echo app > site/app.js; echo MIT > node_modules/three/LICENSE; "
        f'echo "$1" >> {tmp_path}/asked'
    )
    program(tmp_path / "npm", builds)
    return Copied(tmp_path, PageSources(sources, sources.with_name("static")))


def program(file: Path, script: str) -> None:
    file.write_text(f"#!/bin/sh\n{script}\n")
    file.chmod(0o755)


def test_page_is_built_once_and_again_when_a_source_changes(copied: Copied) -> None:
    told: list[str] = []
    first = page_build.built(copied.page, told.append)
    assert first.parent == copied.folder / "cache" / "abb-view"
    assert (first / "app.js").read_text() == "app\n"
    assert len(told) == 2
    assert told[0].startswith("The page is built once for this installation: ")
    assert page_build.built(copied.page, told.append) == first
    assert (copied.folder / "asked").read_text().split() == ["ci", "run"]

    (copied.page.sources / "style.css").write_text("body { color: red; }\n")
    second = page_build.built(copied.page, told.append)
    assert second != first
    assert (second / "style.css").read_text() == "body { color: red; }\n"
    assert (copied.folder / "asked").read_text().split() == ["ci", "run", "run"]  # the packages are the same
    (page_build.PAGE_SHELL / "package-lock.json").write_text("{}\n")
    page_build.built(copied.page, told.append)
    assert (copied.folder / "asked").read_text().split()[3:] == ["ci", "run"]
    third = page_build.built(copied.page)
    (page_build.PAGE_SHELL / "dom.ts").write_text("export {};\n")
    assert page_build.built(copied.page) != third


def test_machine_without_node_reads_what_to_install(copied: Copied) -> None:
    program(copied.folder / "node", "echo v18.20.0")  # too old
    with refused(MissingPrerequisite, "page_without_node", oldest=20):
        page_build.built(copied.page)
    (copied.folder / "node").unlink()
    os.environ["PATH"] = str(copied.folder)
    with refused(MissingPrerequisite, "page_without_node", oldest=20):
        page_build.built(copied.page)


def test_machine_that_does_not_reach_npm_reads_so_and_tries_again_the_next_time(copied: Copied) -> None:
    works = (copied.folder / "npm").read_text()
    program(copied.folder / "npm", 'echo "npm error network request to registry failed"; exit 1')
    with refused(MissingPrerequisite, "page_not_fetched", output="npm error network request to registry failed"):
        page_build.built(copied.page)
    (copied.folder / "npm").write_text(works)
    assert (page_build.built(copied.page) / "index.html").exists()


def test_page_that_does_not_build_is_not_taken_for_one_that_does(copied: Copied) -> None:
    program(copied.folder / "npm", '[ "$1" = ci ] || { echo "main.ts:1: error"; exit 1; }')
    for _ in range(2):
        with pytest.raises(MissingPrerequisite, match=r"main.ts:1: error"):
            page_build.built(copied.page)
