"""What the commands of the evaluation need is checked before they compute."""

from __future__ import annotations

import importlib.util

import pytest
from click.testing import CliRunner

from abb_protocols.catalogue import message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import missing_extra
from yumi.cli.main import main
from yumi_evaluation import cli
from yumi_evaluation.bench.contenders import WAKE_MODES, contenders


@pytest.mark.parametrize("command", ["evaluate", "tune", "bench"])
def test_missing_extra_is_named_before_anything_is_computed(monkeypatch: pytest.MonkeyPatch, command: str) -> None:
    missing = {"jinja2", "matplotlib"}
    monkeypatch.setattr(cli, "find_spec", lambda name: None if name in missing else importlib.util.find_spec(name))
    result = CliRunner().invoke(main, [command])
    assert result.exit_code == 1
    needs = message("command_needs_packages", packages=("jinja2", "matplotlib"))
    assert str(missing_extra(needs, "yumi-ros2", "evaluation")) in result.output


def test_unknown_contender_and_wake_mode_are_refused_with_those_that_exist() -> None:
    contender = CliRunner().invoke(main, ["bench", "--only", "unknown"])
    names = tuple(each.name for each in contenders(WAKE_MODES))
    assert names[0] == "c_echo"
    no_contender = message("contender_unknown", name="unknown", known=names)
    assert (contender.exit_code, contender.output) == (2, f"Error: {sentence(no_contender, FrontEnd.SHELL)}\n")
    wake = CliRunner().invoke(main, ["bench", "--wake", "never"])
    no_mode = message("wake_mode_unknown", mode="never", known=("blocking", "auto"))
    assert (wake.exit_code, wake.output) == (2, f"Error: {sentence(no_mode, FrontEnd.SHELL)}\n")


def test_soak_with_a_server_of_the_user_is_refused_before_anything_is_compiled() -> None:
    result = CliRunner().invoke(main, ["bench", "--soak", "1", "--server", "./server"])
    refused = message("server_has_no_soak")
    assert (result.exit_code, result.output) == (2, f"Error: {sentence(refused, FrontEnd.SHELL)}\n")
