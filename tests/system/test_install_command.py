"""``yumi install`` and ``yumi uninstall`` as commands, on a controller behind loopback that does not advance."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from abb_protocols.catalogue import Message, message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.rws.values import OperatingMode
from system.test_doctor import served
from virtual_irc5.controller.file_store import DISK_CAPACITY
from virtual_irc5.controller.installed_system import ROBOTS, factory_system
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.world import World, WorldSettings
from yumi.cli.main import main
from yumi.driver.commissioning.contents import Contents
from yumi.driver.commissioning.installation import Installation, InstallationPlan


@pytest.fixture
def controller() -> Irc5:
    return World(WorldSettings(system=factory_system())).controller


@pytest.fixture
def where(controller: Irc5) -> Iterator[list[str]]:
    with served(controller) as what:
        yield ["--robot", f"127.0.0.1:{what.port}"]


@pytest.fixture
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return tmp_path


def run(command: str, *arguments: str, answer: str = "") -> Result:
    return CliRunner().invoke(main, [command, *arguments], input=answer)


def in_shell(code: str, **values: str) -> str:
    return sentence(Message(code, values), FrontEnd.SHELL)


def test_dry_run_shows_the_plan_as_json_and_changes_nothing(where: list[str], state: Path, controller: Irc5) -> None:
    result = run("install", *where, "--dry-run", "--json")
    report = json.loads(result.stdout)
    assert result.exit_code == 0
    assert report["outcome"] == "48 changes; nothing was changed."
    assert "+ module TRobMain in T_ROB_R" in report["changes"]
    assert any(line.startswith("+ SIO COM_TRP ROB_L: Type UDPUC, RemoteAdress 127.0.0.1") for line in report["changes"])
    assert not list(state.rglob("*.json"))
    assert "HOME:/yumi" not in [file.path for file in controller.files.entries("HOME:")]


def test_plan_is_asked_about_and_no_means_no(where: list[str], state: Path, controller: Irc5) -> None:
    result = run("install", *where, answer="n\n")
    assert result.exit_code == 1
    assert "Make these 48 changes; it restarts [y/N]: n" in result.stdout
    assert not list(state.rglob("*.json"))
    assert all([module.name for module in task.modules] == ["user"] for task in controller.tasks.values())


def test_no_to_the_streams_leaves_a_complete_installation(
    where: list[str], state: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Installation, "install", lambda *_, **__: None)
    result = run("install", *where, answer="y\nn\n")
    assert result.exit_code == 0
    assert "48 changes made and verified." in result.stdout


def test_obstacle_is_said_and_nothing_is_asked(where: list[str], state: Path, controller: Irc5) -> None:
    controller.mode = OperatingMode.MANUAL_REDUCED
    result = run("install", *where)
    assert result.exit_code == 1
    assert str(message("not_possible_now", reason=message("not_in_auto", mode="MANR"))) in result.stdout
    assert "[y/N]" not in result.stdout


def test_json_does_not_ask(where: list[str], state: Path) -> None:
    result = run("install", *where, "--json")
    assert result.exit_code == 2
    assert "--json cannot ask" in result.output


def test_nothing_to_roll_back_is_said(where: list[str], state: Path) -> None:
    result = run("install", *where, "--roll-back", "--yes")
    assert result.exit_code == 1
    record = re.search(rf"{re.escape(str(state))}\S+/record\.json", result.stderr)
    assert record is not None
    assert result.stderr == f"Error: {in_shell('nothing_to_roll_back', file=record[0])}\n"


def test_dry_run_of_a_roll_back_shows_it_and_changes_nothing(where: list[str], state: Path, controller: Irc5) -> None:
    controller.files["BACKUP:/full"] = "x" * (DISK_CAPACITY - 2000)
    run("install", *where, "--yes", "--no-backup")
    (record,) = state.rglob("record.json")
    there = [file.path for file in controller.files.entries("HOME:")]
    result = run("install", *where, "--roll-back", "--dry-run", "--yes")
    assert result.exit_code == 0
    assert "changes; nothing was changed." in result.stdout
    assert [file.path for file in controller.files.entries("HOME:")] == there
    assert record.is_file()


def test_failure_says_how_to_go_on_and_back(where: list[str], state: Path, controller: Irc5) -> None:
    controller.files["BACKUP:/full"] = "x" * (DISK_CAPACITY - 2000)
    result = run("install", *where, "--yes", "--no-backup")
    assert result.exit_code == 1
    assert "`yumi install --roll-back` makes all as it was" in result.output
    assert list(state.rglob("record.json"))


def test_removal_of_what_is_not_there_changes_nothing(where: list[str], state: Path) -> None:
    result = run("uninstall", *where, "--dry-run")
    assert result.exit_code == 0
    assert "0 changes; nothing was changed." in result.stdout


def test_removal_says_that_nothing_is_there(where: list[str], state: Path) -> None:
    result = run("uninstall", *where, "--yes")
    assert (result.exit_code, result.stdout.splitlines()[-1]) == (0, "Nothing of this package is there.")


def test_restart_that_was_due_is_said(where: list[str], state: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        Installation, "plan", lambda *_, **__: InstallationPlan((), Contents(), Contents(), is_restart_due=True)
    )
    monkeypatch.setattr(Installation, "install", lambda *_, **__: None)
    result = run("install", *where, "--yes", "--no-stream")
    assert result.stdout.splitlines()[-1] == "Restarted; everything is there."


@pytest.mark.parametrize("command", ["install", "uninstall"])
def test_another_robot_is_refused_by_its_name(command: str, state: Path) -> None:
    with served(World(WorldSettings(system=factory_system(ROBOTS["irb120"]))).controller) as what:
        result = run(command, "--robot", f"127.0.0.1:{what.port}", "--yes")
        assert {request.method for request in what.requests} == {"GET"}
    assert result.exit_code == 1
    robot = "an IRB 120 (mechanical unit ROB_1), not a YuMi"
    assert result.stderr == f"Error: {in_shell('not_a_yumi', address=f'127.0.0.1:{what.port}', robot=robot)}\n"
    assert not list(state.rglob("*.json"))
