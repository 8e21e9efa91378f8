"""The doctor in a network namespace: a packet filter drops one arm's datagrams on their way from the robot."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from abb_runtime.process.command_process import CONTROLLER_READY

pytestmark = pytest.mark.real_time
ROBOT, HERE = "10.77.18.1", "10.77.18.2"
ROBOT_SPACE, HERE_SPACE = f"yumi-robot-{os.getpid()}", f"yumi-here-{os.getpid()}"
YUMI = [sys.executable, "-m", "yumi"]


def run(*command: str) -> None:
    subprocess.run(command, check=True, capture_output=True, text=True, timeout=10.0)


@pytest.fixture
def spaces() -> Iterator[None]:
    """Two machines with a cable between them."""
    with ExitStack() as undo:
        try:
            for space in (ROBOT_SPACE, HERE_SPACE):
                run("ip", "netns", "add", space)
                undo.callback(run, "ip", "netns", "del", space)
            cable = ("type", "veth", "peer", "here0", "netns", HERE_SPACE)
            run("ip", "link", "add", "robot0", "netns", ROBOT_SPACE, *cable)
            for space, card, address in ((ROBOT_SPACE, "robot0", ROBOT), (HERE_SPACE, "here0", HERE)):
                run("ip", "-n", space, "addr", "add", f"{address}/24", "dev", card)
                for each in (card, "lo"):
                    run("ip", "-n", space, "link", "set", each, "up")
        except (OSError, subprocess.CalledProcessError) as error:
            pytest.skip(f"network namespaces are not permitted here: {getattr(error, 'stderr', error)}")
        yield


def drop(port: int) -> None:
    """Drop what comes to a UDP port, and nothing that goes; it needs neither nft nor iptables."""
    rules = ("ip", "-n", HERE_SPACE, "rule")
    try:
        run(*rules, "add", "priority", "100", "lookup", "local")  # after the rule, not before it
        run(*rules, "del", "priority", "0")
        run(*rules, "add", "priority", "50", "ipproto", "udp", "dport", str(port), "blackhole")
    except (OSError, subprocess.CalledProcessError) as error:
        pytest.skip(f"packet filters are not permitted here: {getattr(error, 'stderr', error)}")


def test_doctor_names_the_arm_whose_datagrams_a_filter_drops(spaces: None, tmp_path: Path) -> None:
    drop(6512)
    inside = ("ip", "netns", "exec", ROBOT_SPACE)
    options = ("controller", "--listen", ROBOT, "--rws-port", "8080", "--egm-host", HERE)
    command = [*inside, *YUMI, *options]
    with (
        (tmp_path / "log").open("w+") as log,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True) as controller,
    ):
        try:
            assert controller.stdout is not None
            assert any(CONTROLLER_READY in line for line in controller.stdout)
            doctor = (*YUMI, "doctor", "--robot", f"{ROBOT}:8080", "--stream", "--yes", "--json", "-")
            done = subprocess.run(
                ["ip", "netns", "exec", HERE_SPACE, *doctor], capture_output=True, text=True, check=False, timeout=60.0
            )
        finally:
            controller.terminate()
            controller.wait(10.0)
    found = {each["requirement"]: each for each in json.loads(done.stdout)["findings"]}
    assert found["EGM left"]["verdict"] == "ok", done.stdout + done.stderr
    assert found["EGM right"]["verdict"] == "problem"
    assert found["EGM right"]["code"] == "stream_dropped"
    assert f"{HERE}:6512" in found["EGM right"]["found"]
    assert "6512" in found["EGM right"]["remedy"]
