"""The command line of those who have the virtual controller alone: nothing in it names what they have not."""

from __future__ import annotations

import re

import click
import pytest
from click.testing import CliRunner

from virtual_irc5.commands.main import main


@pytest.mark.parametrize("name", ["", *sorted(main.commands)])
def test_help_has_examples_of_its_own_command_line(name: str) -> None:
    result = CliRunner().invoke(main, [*name.split(), "--help"], prog_name="virtual-irc5", terminal_width=100)
    text = " ".join(result.output.split())
    assert re.search(rf"Examples?: .*\bvirtual-irc5 {name}", text)
    assert not re.search(r"\byumi (?!ros2)\w+(?!\w|` of yumi-ros2)", text), "a command of another package"
    assert "{" not in text


def test_help_of_a_shared_command_names_the_command_line_that_shows_it() -> None:
    check = main.commands["check"]
    for program in ("virtual-irc5 check", "yumi rapid check"):
        assert f"{program} pick.mod" in check.get_help(click.Context(check, info_name=program))
