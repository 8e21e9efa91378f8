"""The examples as they are, against the driver and a virtual robot."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from ros_bench import Client

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]
EXAMPLES = Path(__file__).parents[2] / "examples"
EXPECTED = {
    "move_one_joint.py": "EGM has ended on both arms",
    "grip.py": "left gripper: holding at 10.0 mm",
    "recover.py": "left arm RUN_EGM_ROUTINE, right arm IDLE",
}


@pytest.mark.parametrize("name", sorted(EXPECTED))
def test_example_does_what_it_says(idle: Client, name: str) -> None:
    done = subprocess.run([sys.executable, EXAMPLES / name], capture_output=True, text=True, check=False, timeout=90)
    assert done.returncode == 0, done.stdout + done.stderr
    assert EXPECTED[name] in done.stdout
