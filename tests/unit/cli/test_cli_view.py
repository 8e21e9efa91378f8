"""``yumi view`` refuses options that would have no effect."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from fake_driver import ROBOT, FakeDriver
from yumi.catalogue import FrontEnd, message, sentence
from yumi.cli.main import main


def test_settings_are_refused_where_a_driver_of_the_robot_runs_with_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    config = tmp_path / "boxes.yaml"
    config.write_text("collision: {}\n")
    driver = FakeDriver()
    driver.server.start()
    try:
        result = CliRunner().invoke(main, ["view", "--port", "0", "--robot", ROBOT, "--config", str(config)])
    finally:
        driver.server.stop()
    assert result.exit_code == 2
    assert sentence(message("driver_of_robot_runs", robot=ROBOT), FrontEnd.SHELL) in result.output
