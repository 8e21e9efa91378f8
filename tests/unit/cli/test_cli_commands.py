"""Commands of other packages are listed by their entry points, whether or not what they need is installed."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import EntryPoint

import pytest
from click.testing import CliRunner

from abb_protocols.catalogue import message
from abb_protocols.errors import missing_extra
from yumi.cli import main as cli


@pytest.fixture(autouse=True)
def _an_extra_that_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    entry_point = EntryPoint("study", "no_such_package.cli:study", "yumi.commands")
    installed = cli._entry_points()
    monkeypatch.setattr(cli, "_entry_points", lambda: {**installed, "study": entry_point})
    monkeypatch.setattr(cli.main, "commands", dict(cli.main.commands))


def test_help_lists_a_command_that_cannot_be_loaded() -> None:
    result = CliRunner().invoke(cli.main, ["--help"])
    assert result.exit_code == 0
    assert "study" in result.output
    assert "Not installed: No module named 'no_such_package'." in result.output
    assert all(name in result.output for name in ("controller", "demo", "doctor", "fault", "record", "up"))


@pytest.mark.parametrize("arguments", [(), ("--seconds", "3")])
def test_command_that_cannot_be_loaded_says_what_to_install(arguments: tuple[str, ...]) -> None:
    result = CliRunner().invoke(cli.main, ["study", *arguments])
    lacks = message("command_installed_in_part", command="study", reason="No module named 'no_such_package'")
    assert (result.exit_code, result.output) == (1, f"Error: {missing_extra(lacks, 'yumi-ros2', 'virtual')}\n")


def test_command_line_needs_neither_ros_nor_the_evaluation() -> None:
    code = (
        "import sys\n"
        "for name in ('rclpy', 'control_msgs', 'yumi_evaluation', 'virtual_irc5', 'matplotlib', 'jinja2'):\n"
        "    sys.modules[name] = None\n"
        "from yumi.cli.main import main\n"
        "main(['--help'])\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stderr
    assert "demo" in done.stdout
