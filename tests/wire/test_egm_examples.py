"""The examples of the EGM server, each with a robot on the other end of a socket."""

from __future__ import annotations

import re
import runpy
from collections.abc import Iterator
from math import degrees, pi
from pathlib import Path
from typing import Any

import pytest
from egm_robots import GuidedArm, ObedientRobot, Wired

from yumi import EgmServer
from yumi.virtual.egm_settings import EgmRun

EXAMPLES = Path(__file__).parents[2] / "examples"


def example(name: str) -> dict[str, Any]:
    return runpy.run_path(str(EXAMPLES / f"egm_{name}.py"))


@pytest.fixture
def server() -> Iterator[EgmServer]:
    with EgmServer(0, host="127.0.0.1", timeout=5.0, silence=2.0) as server:
        yield server


def test_joint_example_swings_the_last_axis_and_comes_back(server: EgmServer) -> None:
    arm = GuidedArm(EgmRun(cond_time=1e6))
    start = arm.arm.position
    with Wired(server.port, arm.cycle):
        example("joint")["swing"](server, 4.0)
    swung = [degrees(value - start[-1]) for value in arm.reached]
    assert max(swung) == pytest.approx(5.0, abs=0.6)  # EGM's own loop follows 0.2 s behind
    assert min(swung) > -0.1
    assert arm.arm.position[:-1] == pytest.approx(start[:-1], abs=1e-4)


def test_pose_example_leads_the_tool_round_and_back(server: EgmServer) -> None:
    robot = ObedientRobot()
    with Wired(server.port, robot.cycle):
        example("pose")["circle"](server, 1)
    _, y, z = zip(*(pose.position for pose in robot.poses), strict=True)
    assert (max(y), min(y)) == (pytest.approx(0.12, abs=1e-4), pytest.approx(0.08, abs=1e-4))
    assert max(z) == pytest.approx(0.74, abs=1e-4)
    assert robot.heard[-1].tool_position == pytest.approx((0.5, 0.1, 0.7))
    assert all(told.position is None for told in robot.heard)


def test_velocity_example_turns_the_last_axis_and_stops(server: EgmServer) -> None:
    arm = GuidedArm(EgmRun(cond_time=1e6, pos_corr_gain=0.0))
    start = arm.arm.position[-1]
    with Wired(server.port, arm.cycle):
        example("velocity")["turn"](server, 4.0)
    turned = [degrees(value - start) for value in arm.reached]
    assert max(turned) == pytest.approx(5.0 * 4.0 / pi, abs=0.2)  # the integral of half a period
    assert turned[-1] == pytest.approx(0.0, abs=0.2)


def test_stream_example_shows_where_the_robot_is_and_says_nothing(server: EgmServer) -> None:
    arm, lines = GuidedArm(None), []

    def show(line: str) -> None:
        lines.append(line)
        if len(lines) == 3:
            server.stop()

    with Wired(server.port, arm.cycle, patience=0.001):
        example("stream")["watch"](server, show)
    assert len(lines) == 3
    shown = [float(value) for value in lines[0].split("s")[1].split()]
    assert shown == pytest.approx([degrees(value) for value in arm.arm.position], abs=0.01)


def test_guide_shows_nothing_but_what_the_examples_do() -> None:
    guide = (EXAMPLES.parent / "docs" / "how-to" / "guide-any-abb-robot.md").read_text()
    examples = "".join(path.read_text() for path in EXAMPLES.glob("egm_*.py"))
    snippets = re.findall(r"^```python\n(.*?)^```", guide, re.DOTALL | re.MULTILINE)
    assert len(snippets) == 5
    assert [snippet for snippet in snippets if snippet not in examples] == []
