"""What the commands of the evaluation need is checked before they compute."""

from __future__ import annotations

import importlib.util

import pytest
from click.testing import CliRunner

from yumi.catalogue import message
from yumi.cli.main import main
from yumi.errors import missing_extra
from yumi_evaluation import cli


@pytest.mark.parametrize("command", ["evaluate", "tune", "bench"])
def test_missing_extra_is_named_before_anything_is_computed(monkeypatch: pytest.MonkeyPatch, command: str) -> None:
    missing = {"jinja2", "matplotlib"}
    monkeypatch.setattr(cli, "find_spec", lambda name: None if name in missing else importlib.util.find_spec(name))
    result = CliRunner().invoke(main, [command])
    assert result.exit_code == 1
    needs = message("command_needs_packages", packages=("jinja2", "matplotlib"))
    assert str(missing_extra(needs, "evaluation")) in result.output


def test_unknown_contender_and_wake_mode_are_refused_with_those_that_exist() -> None:
    contender = CliRunner().invoke(main, ["bench", "--only", "unknown"])
    assert (contender.exit_code, "There is no contender 'unknown'; there are: c_echo" in contender.output) == (2, True)
    wake = CliRunner().invoke(main, ["bench", "--wake", "never"])
    assert (wake.exit_code, "There is no wake mode 'never'; there are: blocking, auto." in wake.output) == (2, True)
