"""``yumi view``: options that would have no effect, and what it prints for a page on another machine."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from abb_protocols.catalogue import message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_runtime.process.command_process import CommandProcess
from fake_driver import ROBOT, FakeDriver
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


@pytest.mark.parametrize("listen", ["127.0.0.1", "0.0.0.0"])
def test_page_over_https_prints_its_certificate_and_a_code_where_other_machines_reach_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, listen: str
) -> None:
    pytest.importorskip("cryptography", reason="the part robotware7 is not installed")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    log = tmp_path / "view.log"
    with CommandProcess(
        "yumi view", "yumi", ("view", "--operate", "--https", "--listen", listen, "--port", "0"), log
    ) as view:
        assert re.match(r"https://.+:\d+/#token=.{24}$", view.wait_until_ready(60.0))
    printed = log.read_text()
    assert re.search(r"SHA-256 ([0-9A-F]{2}:){31}[0-9A-F]{2}\nIt was made now, for a year: ", printed)
    codes = re.findall(r"Code for a page on another machine, for one page: \d{6}\n", printed)
    assert len(codes) == (listen == "0.0.0.0")
    assert (tmp_path / "yumi" / "certificate.pem").stat().st_mode & 0o077 == 0
