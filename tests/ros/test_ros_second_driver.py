"""A second driver beside the one that the tests share."""

from __future__ import annotations

import pytest
from refused_starts import expect_one_sentence, up
from ros_bench import Robot

from abb_runtime.process.command_process import CommandProcess

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]


def test_second_driver_refuses_and_names_the_first(robot: Robot, driver: CommandProcess) -> None:
    outcome = up("--robot", f"127.0.0.1:{robot.rws_port}", "--namespace", "cell2")
    expect_one_sentence(
        outcome, f"is driven by another program (process {driver.pid}); end it first, or have that one move the robot"
    )


def test_driver_of_another_robot_refuses_the_names_of_the_first(driver: CommandProcess) -> None:
    outcome = up("--robot", "127.0.0.2")
    expect_one_sentence(
        outcome,
        f"Another driver runs on this machine in the same ROS domain without a namespace (process {driver.pid}); stop "
        "it, or give one of the two another --namespace.",
    )
