"""The programs of ours that start a driver hand the password on by the environment, which only its user can read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from yumi.cli import demo
from yumi.cli.main import main
from yumi.ros.move_and_grab import GRAB_GOALS
from yumi_evaluation import networked
from yumi_evaluation.experiments import Mode
from yumi_evaluation.networked import NetworkedPlan, start_driver, start_robot

pytestmark = [pytest.mark.ros, pytest.mark.timeout(60)]
SECRET = "s3cret-4711"


class Noted:
    """A child that is ready at once."""

    started: list[tuple[Sequence[str], Mapping[str, str]]]

    def __init__(
        self, name: str, module: str, arguments: Sequence[str], log: Path, environment: Mapping[str, str]
    ) -> None:
        self.started.append((arguments, environment))

    def __enter__(self) -> Noted:
        return self

    def __exit__(self, *error: object) -> None:
        """It has ended."""

    def wait_until_ready(self, *_: Any) -> str:
        return "http://127.0.0.1:8080"


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Sequence[str], Mapping[str, str]]]:
    Noted.started = []
    for module in (networked, demo):
        monkeypatch.setattr(module, "CommandProcess", Noted)
    return Noted.started


@pytest.mark.parametrize("robot", [None, "192.0.2.1"])
def test_evaluation_passes_the_password_on_by_the_environment_alone(
    tmp_path: Path, started: list[tuple[Sequence[str], Mapping[str, str]]], robot: str | None
) -> None:
    plan = NetworkedPlan(10, tmp_path, robot, password=SECRET)
    with ExitStack() as stack:
        where = start_robot(plan, stack, lambda: None)
        with start_driver(plan, where, Mode.FULLSPEED, lambda: None):
            pass
    assert len(started) == (1 if robot else 2)
    assert [environment["YUMI_PASSWORD"] for _, environment in started] == [SECRET] * len(started)
    assert SECRET not in " ".join(text for arguments, _ in started for text in arguments)
    assert SECRET not in repr(plan)


def test_demonstration_passes_robot_speed_and_password_on_to_its_driver(
    tmp_path: Path, started: list[tuple[Sequence[str], Mapping[str, str]]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(demo, "_run_application", lambda *_, approaches: {})
    monkeypatch.setattr(demo, "read_positions", lambda robot: GRAB_GOALS)
    monkeypatch.setattr("yumi.recording.pictures.draw_joint_paths", lambda paths, picture: None)
    secret = tmp_path / "password"
    secret.write_text(SECRET)
    secret.chmod(0o600)
    where = ["--robot", "127.0.0.1:8080", "--user", "me"]
    speed = ["--speed-scale", "0.5"]
    options = [*where, *speed, "--yes", "--password-file", str(secret), "--logs", str(tmp_path / "logs")]
    result = CliRunner().invoke(main, ["demo", *options], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    assert started == [(("up", *where, *speed, "--bringup"), {"YUMI_PASSWORD": SECRET})]  # named by the demonstration
    assert SECRET not in result.output
    assert "(speed_scale 0.5)" in result.output
