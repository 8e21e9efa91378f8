"""`yumi controller --robotware 7` as a process."""

from __future__ import annotations

from pathlib import Path

import httpx
import pytest

from abb_runtime.faults import takes_faults
from virtual_irc5.rws.version_2 import FORM_2, HAL_2
from virtual_irc5.testing.controller_process import ControllerProcess

pytest.importorskip("cryptography", reason="needs yumi-ros2[robotware7]")

pytestmark = pytest.mark.real_time


def test_controller_with_robotware_7_runs_a_program_and_takes_faults(tmp_path: Path) -> None:
    with (
        ControllerProcess(tmp_path / "log", {"robotware": "7"}) as controller,
        httpx.Client(
            base_url=f"https://{controller.address}",
            auth=(controller.user, controller.password),
            headers={"Accept": HAL_2},
            verify=False,
            trust_env=False,
        ) as client,
    ):

        def post(path: str, text: str = "") -> int:
            return client.post(path, content=text, headers={"Content-Type": FORM_2}).status_code

        def state(path: str) -> dict[str, str]:
            return dict(client.get(path).json()["state"][0])

        assert state("/rw/system")["major"] == "7"
        assert post("/rw/panel/ctrl-state", "ctrl-state=motoron") == 204
        assert post("/rw/rapid/execution/resetpp?mastership=implicit") == 204
        started = "regain=continue&execmode=continue&cycle=forever&condition=none&stopatbp=disabled&alltaskbytsp=false"
        assert post("/rw/rapid/execution/start", started) == 204
        assert state("/rw/rapid/execution")["ctrlexecstate"] == "running"
        assert takes_faults(controller.address)
        controller.inject("program-stop")
        assert state("/rw/rapid/execution")["ctrlexecstate"] == "stopped"
    assert "Virtual controller ready: https://" in (tmp_path / "log").read_text()
