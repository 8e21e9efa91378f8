"""The examples as they are, against the driver and a virtual robot; ``docs/test_docs_run`` runs those of pages."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from ros_bench import Client

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]
EXAMPLES = Path(__file__).parents[2] / "examples"
NAMES = ("bad_goal.py", "grip.py", "move_one_joint.py", "recover.py")
QUICK = """
import runpy, sys
from rclpy.action import ActionClient
from rclpy.client import Client

for kind, name in ((Client, "wait_for_service"), (ActionClient, "wait_for_server")):
    setattr(kind, name, lambda self, timeout_sec, wait=getattr(kind, name): wait(self, 0.5))
runpy.run_path(sys.argv[1], run_name="__main__")
"""


def test_recovery_does_what_it_says(idle: Client) -> None:
    example = [sys.executable, EXAMPLES / "recover.py"]
    done = subprocess.run(example, capture_output=True, text=True, check=False, timeout=90)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "left arm RUN_EGM_ROUTINE, right arm IDLE" in done.stdout


def test_example_that_is_stopped_ends_egm_and_says_so_in_a_word(idle: Client) -> None:
    with subprocess.Popen(
        [sys.executable, "-u", EXAMPLES / "move_one_joint.py"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as example:
        assert example.stdout is not None
        assert example.stdout.readline() == "EGM runs on both arms, the controllers are active\n"
        example.send_signal(signal.SIGINT)
        assert example.communicate(timeout=30)[0].splitlines() == ["EGM has ended on both arms", "Stopped."]
    assert example.returncode == 1


@pytest.mark.parametrize("name", NAMES)
def test_example_without_a_driver_says_so_in_a_sentence(name: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", QUICK, EXAMPLES / name],
        capture_output=True,
        text=True,
        check=False,
        timeout=90,
        env={**os.environ, "ROS_DOMAIN_ID": "231"},
    )
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith("Error: The")
    assert line.endswith("; start the driver with `yumi up`.")


@pytest.mark.parametrize("name", NAMES)
def test_example_of_ros_needs_nothing_of_ours(name: str) -> None:
    """What users copy works with every driver that has these topics, services and actions."""
    text = (EXAMPLES / name).read_text(encoding="utf-8")
    assert "from yumi." not in text
    assert "import yumi\n" not in text
