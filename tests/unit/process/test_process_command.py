"""Commands of ours as child processes: where their secrets go, and which line says that they serve."""

from __future__ import annotations

from io import StringIO
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from abb_protocols.errors import RobotNotReady
from abb_runtime.process import command_process
from abb_runtime.process.command_process import CONTROLLER_READY, DRIVER_READY, DRIVER_RUNNING, CommandProcess


class Child:
    """A process that prints and ends."""

    def __init__(self, arguments: list[str], env: dict[str, str], **options: Any) -> None:
        started.append((arguments, env))
        self.pid = 1
        self.stdin, self.stdout = StringIO(), StringIO("".join(f"{line}\n" for line in OUTPUT))

    def wait(self, timeout: float | None = None) -> int:
        return 0

    def poll(self) -> int:
        return 0


started: list[tuple[list[str], dict[str, str]]] = []
OUTPUT: list[str] = []


@pytest.fixture(autouse=True)
def _children(monkeypatch: pytest.MonkeyPatch) -> None:
    started.clear()
    OUTPUT.clear()
    monkeypatch.setattr(command_process, "subprocess", SimpleNamespace(Popen=Child, PIPE=-1, STDOUT=-2))


def test_secrets_reach_the_child_by_its_environment_and_not_by_its_arguments(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("KEPT", "yes")
    with CommandProcess("driver", "yumi", ("up",), tmp_path / "log", {"YUMI_PASSWORD": "s3cret"}):
        pass
    ((arguments, environment),) = started
    assert "s3cret" not in " ".join(arguments)
    assert (environment["YUMI_PASSWORD"], environment["KEPT"]) == ("s3cret", "yes")
    assert "s3cret" not in (tmp_path / "log").read_text()


@pytest.mark.parametrize("ready", [CONTROLLER_READY, DRIVER_READY, DRIVER_RUNNING])
def test_ready_line_is_taken_and_the_lines_before_it_are_passed_on(tmp_path: Path, ready: str) -> None:
    OUTPUT[:] = ["first", "second", f"{ready}http://127.0.0.1:1", "after"]
    lines: list[str] = []
    with CommandProcess("it", "yumi", ("up",), tmp_path / "log") as it:
        assert it.wait_until_ready(5.0, on_line=lines.append) == "http://127.0.0.1:1"
    assert lines == ["first", "second"]


def test_error_of_a_command_is_raised_and_not_passed_on_too(tmp_path: Path) -> None:
    OUTPUT[:] = ["first", "Error: No robot is there.", "INFO one line more"]
    lines: list[str] = []
    with (
        CommandProcess("it", "yumi", ("up",), tmp_path / "log") as it,
        pytest.raises(RobotNotReady, match=r"^No robot is there\.$"),
    ):
        it.wait_until_ready(5.0, on_line=lines.append)
    assert lines == ["first", "INFO one line more"]
