"""Starts of a driver that are refused."""

from __future__ import annotations

import subprocess
import sys

YUMI = [sys.executable, "-m", "yumi"]


def up(*options: str) -> tuple[int, str]:
    """Exit code and standard error of the driver, which ends by itself."""
    done = subprocess.run(
        [*YUMI, "up", *options], capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL, timeout=60.0
    )
    return done.returncode, done.stderr.strip()


def expect_one_sentence(outcome: tuple[int, str], part: str) -> None:
    """What else can be wrong with an address, and how soon it is said: ``contract/test_rws_client_connection``."""
    code, error = outcome
    assert code == 1
    assert part in error
    assert error.startswith("Error: ")
    assert len(error.splitlines()) == 1
