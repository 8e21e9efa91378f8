"""Passwords: from a file, a prompt or the environment; never on a command line, never shown."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner, Result

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import SettingsError
from abb_runtime.options import password_options
from refusals import refused
from yumi.cli.main import main
from yumi.driver.settings import RobotSettings, Settings, override, read_settings

SECRET = "pass-4711"


@click.command()
@password_options
def log_in(password: str | None) -> None:
    click.echo(f"got {password!r}")


def run(*arguments: str, **options: Any) -> Result:
    return CliRunner().invoke(log_in, arguments, **options)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    file = tmp_path / "password"
    file.write_text(f"{SECRET}\nsecond line\n")
    file.chmod(0o600)
    return file


@pytest.fixture(autouse=True)
def _no_password_in_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("YUMI_PASSWORD", raising=False)


def test_password_is_the_first_line_of_the_file(file: Path) -> None:
    assert run("--password-file", str(file)).output == f"got {SECRET!r}\n"


def test_password_of_the_environment_counts_where_no_option_is_given(file: Path) -> None:
    environment = {"YUMI_PASSWORD": "other"}
    assert run(env=environment).output == "got 'other'\n"
    assert run("--password-file", str(file), env=environment).output == f"got {SECRET!r}\n"
    assert run(env={"YUMI_PASSWORD": ""}).output == "got None\n"


def test_prompt_does_not_show_what_is_typed() -> None:
    result = run("--ask-password", input=f"{SECRET}\n")
    assert result.stdout == f"got {SECRET!r}\n"
    assert result.stderr == "Password: \n"


def test_file_that_others_can_read_is_refused_without_its_content(file: Path) -> None:
    file.chmod(0o644)
    error = run("--password-file", str(file)).exception
    assert isinstance(error, SettingsError)
    assert error.said == message("password_file_open_to_others", file=str(file))


@pytest.mark.parametrize(
    ("content", "code", "reason"),
    [
        (None, "password_file_unreadable", "No such file or directory"),
        (b"\n", "password_file_empty", None),
        (b"\xff\xfe\n", "password_file_unreadable", message("not_utf8_text")),
    ],
)
def test_file_without_a_password_is_refused(
    tmp_path: Path, content: bytes | None, code: str, reason: Message | str | None
) -> None:
    file = tmp_path / "password"
    if content is not None:
        file.write_bytes(content)
        file.chmod(0o600)
    values = {"file": str(file)} | ({} if reason is None else {"reason": reason})
    with refused(SettingsError, code, **values):
        CliRunner().invoke(log_in, ["--password-file", str(file)], catch_exceptions=False)


def test_two_ways_at_once_are_refused(file: Path) -> None:
    with refused(SettingsError, "password_given_twice"):
        CliRunner().invoke(log_in, ["--password-file", str(file), "--ask-password"], catch_exceptions=False)


@pytest.mark.parametrize("command", ["up", "demo", "doctor", "evaluate", "controller"])
def test_no_command_takes_a_password_as_an_argument(command: str) -> None:
    found = main.get_command(click.Context(main), command)
    assert found is not None
    names = {name for option in found.params for name in option.opts}
    assert {"--password-file", "--ask-password"} <= names
    assert "--password" not in names


@pytest.mark.parametrize("text", ["robot: {password: 13371337}", "robot: {password: [13371337]}"])
def test_password_that_is_no_text_is_refused_without_being_shown(tmp_path: Path, text: str) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    with pytest.raises(SettingsError) as refusal:
        read_settings(file)
    assert refusal.value.said == message("secret_is_no_text", place="mine.yaml: robot: password")
    assert "13371337" not in str(refusal.value)


@pytest.mark.parametrize("value", [f'"{SECRET}', f"*{SECRET}", f"@{SECRET}"])
def test_broken_settings_file_is_refused_with_its_place_and_without_its_text(tmp_path: Path, value: str) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(f"robot:\n  password: {value}")
    with refused(SettingsError, "settings_not_yaml_at", file=str(file)) as refusal:
        read_settings(file)
    assert SECRET not in str(refusal.value)
    assert refusal.value.__cause__ is None  # nor does a traceback quote it
    assert refusal.value.__suppress_context__


def test_settings_do_not_show_their_password() -> None:
    settings = override(Settings(), {"robot": {"password": SECRET}}, "test")
    assert settings.robot.password == SECRET
    assert SECRET not in repr(settings)
    assert "password" not in repr(RobotSettings())
