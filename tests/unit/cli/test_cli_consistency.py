"""All commands at once: one option for one thing, an example in each help, summaries that fit, and ``--json``."""

from __future__ import annotations

import json
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner

from abb_protocols.errors import SettingsError
from abb_runtime.options import JsonOutput, json_option, with_json_targets
from refusals import refused
from yumi.cli.main import main, sections

NO_REPORT = {
    "completion": "prints a program for the shell",
    "controller": "serves",
    "moveit-config": "writes files",
    "rapid debug": "is typed at",
    "record export": "writes a file",
    "rws put": "writes a file on the controller",
    "rws set": "writes a value on the controller",
    "shell": "is typed at",
    "up": "serves",
    "view": "serves",
}
"""Commands without ``--json``, and why."""


def walk(group: click.Group, *before: str) -> Iterator[tuple[str, click.Command]]:
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        yield " ".join((*before, name)), command
        if isinstance(command, click.Group):
            yield from walk(command, *before, name)


COMMANDS = dict(walk(main))
LEAVES = {name: each for name, each in COMMANDS.items() if not isinstance(each, click.Group)}


def options_of(command: click.Command) -> dict[str, click.Option]:
    """The options by each of their names."""
    found = [each for each in command.params if isinstance(each, click.Option)]
    return {name: each for each in found for name in (*each.opts, *each.secondary_opts)}


def test_there_are_commands_of_every_kind() -> None:
    assert {"up", "state", "rws get", "rapid check", "record show", "evaluate", "measure"} <= LEAVES.keys()


def test_option_of_one_name_means_the_same_in_all_commands() -> None:
    meanings: dict[str, dict[tuple[Any, ...], list[str]]] = defaultdict(lambda: defaultdict(list))
    for name, command in LEAVES.items():
        for option, each in options_of(command).items():
            meaning = (each.help, type(each.type).__name__, each.metavar, each.is_flag, each.multiple)
            meanings[option][meaning].append(name)
    several = {option: dict(found) for option, found in meanings.items() if len(found) > 1}
    assert several == {}


def test_every_option_says_what_it_is() -> None:
    silent = [
        f"{name} {option}" for name, each in LEAVES.items() for option, it in options_of(each).items() if not it.help
    ]
    assert silent == []


def test_no_option_is_another_name_of_what_one_option_is_for() -> None:
    """``--robot`` has the port with it; the arm is ARM or ``--arm``; folders of results are ``--output``."""
    given = {option for command in LEAVES.values() for option in options_of(command)}
    assert (
        given & {"--side", "--rws-address", "--address", "--out", "--folder-out", "--histograms", "--speed-factor"}
        == set()
    )
    assert [name for name, each in LEAVES.items() if "--rws-port" in options_of(each)] == ["controller"]


def test_egm_ports_are_options_of_what_receives_or_sends_egm() -> None:
    having = {name for name, each in LEAVES.items() if "--left-egm-port" in options_of(each)}
    assert having == {"controller", "demo", "doctor", "install", "measure", "shell", "uninstall", "up"}
    assert having == {name for name, each in LEAVES.items() if "--right-egm-port" in options_of(each)}


def test_arm_to_act_on_is_an_argument_of_that_name() -> None:
    arms = {
        name: each.name
        for name, command in LEAVES.items()
        for each in command.params
        if isinstance(each, click.Argument) and isinstance(each.type, click.Choice) and "right" in each.type.choices
    }
    assert arms.keys() == {"start", "give-back", "calibrate", "grip", "move", "switch", "measure"}
    assert set(arms.values()) == {"arm"}


@pytest.mark.parametrize("name", sorted(LEAVES))
def test_command_that_reports_takes_json(name: str) -> None:
    assert ("--json" in options_of(LEAVES[name])) is (name not in NO_REPORT)


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_help_has_an_example_and_reads_as_text(name: str) -> None:
    text = COMMANDS[name].get_help(click.Context(COMMANDS[name], info_name=f"yumi {name}", max_content_width=80))
    assert re.search(rf"Examples?:\n.*\byumi {name.split(maxsplit=1)[0]}\b", text, re.DOTALL)
    assert "``" not in text
    assert not re.search(r"(?<![\w/])(src|docs|examples|tests)/", text), "a path of the clone"


@pytest.mark.parametrize("group", [main, *(each for each in COMMANDS.values() if isinstance(each, click.Group))])
def test_no_summary_is_cut_at_80_columns(group: click.Group) -> None:
    text = CliRunner().invoke(group, ["--help"], terminal_width=80).output
    assert not re.search(r"^  .*\.\.\.$", text, re.MULTILINE)
    assert max(map(len, text.splitlines())) <= 80


def test_every_command_is_under_a_heading() -> None:
    named = [name for section in sections().values() for name in section]
    assert len(named) == len(set(named))
    assert set(named) == set(main.list_commands(click.Context(main)))
    text = CliRunner().invoke(main, ["--help"]).output
    assert [text.index(f"\n{heading}:\n") for heading in sections()] == sorted(
        text.index(f"\n{heading}:\n") for heading in sections()
    )


@click.command()
@json_option
@click.argument("words", nargs=-1)
def said(json_output: JsonOutput, words: tuple[str, ...]) -> None:
    for word in words:
        json_output.write(json.dumps(word))
        json_output.say(f"text {word}")


def run(*arguments: str) -> str:
    result = CliRunner().invoke(said, with_json_targets(arguments))
    assert result.exit_code == 0, result.output
    return result.output


def test_json_without_a_file_is_all_that_is_printed() -> None:
    assert run("a") == "text a\n"
    assert run("a", "--json") == run("a", "--json", "-") == run("--json", "-", "a") == run("--json=-", "a") == '"a"\n'


def test_json_in_a_file_comes_beside_the_text_and_replaces_what_was_there(tmp_path: Path) -> None:
    file = tmp_path / "new" / "figures.json"
    assert run("a", "b", "--json", str(file)) == "text a\ntext b\n"
    assert file.read_text() == '"a"\n"b"\n'
    assert run("c", f"--json={file}") == "text c\n"
    assert file.read_text() == '"c"\n'


def test_json_takes_no_argument_that_is_not_a_json_file(tmp_path: Path) -> None:
    module = tmp_path / "pick.mod"
    module.write_text("MODULE pick\nENDMODULE\n")
    result = CliRunner().invoke(main, ["rapid", "check", "--json", str(module)])
    assert (result.exit_code, json.loads(result.output)) == (0, [])
    assert module.read_text() == "MODULE pick\nENDMODULE\n"
    assert with_json_targets([]) == []
    assert with_json_targets(["call", "--", "--json", "x"]) == ["call", "--", "--json", "x"]


def test_file_that_cannot_be_written_is_refused_in_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("")
    with refused(SettingsError, "json_not_writable", file=str(tmp_path / "a" / "x.json")):
        JsonOutput(str(tmp_path / "a" / "x.json")).write("1")
