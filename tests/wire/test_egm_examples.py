"""The examples of the EGM server, each with a robot on the other end of a socket."""

from __future__ import annotations

import re
import runpy
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from math import degrees, pi
from pathlib import Path
from threading import Event
from typing import Any

import pytest
from egm_robots import ObedientRobot, VirtualArmRig, Wired

from abb_protocols.catalogue import message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_runtime.udp import free_port
from virtual_irc5.mechanics.egm_motion import EgmRun
from yumi import EgmServer

EXAMPLES = Path(__file__).parents[2] / "examples"


def example(name: str) -> dict[str, Any]:
    return runpy.run_path(str(EXAMPLES / f"egm_{name}.py"))


@pytest.fixture
def server() -> Iterator[EgmServer]:
    with EgmServer(0, host="127.0.0.1", timeout=5.0, silence=2.0) as server:
        yield server


def test_joint_example_swings_the_last_axis_and_comes_back(server: EgmServer) -> None:
    arm = VirtualArmRig(EgmRun(cond_time=1e6))
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
    arm = VirtualArmRig(EgmRun(cond_time=1e6, pos_corr_gain=0.0))
    start = arm.arm.position[-1]
    with Wired(server.port, arm.cycle):
        example("velocity")["turn"](server, 4.0)
    turned = [degrees(value - start) for value in arm.reached]
    assert max(turned) == pytest.approx(5.0 * 4.0 / pi, abs=0.2)  # the integral of half a period
    assert turned[-1] == pytest.approx(0.0, abs=0.2)


def test_stream_example_shows_where_the_robot_is_and_says_nothing(server: EgmServer) -> None:
    arm, lines = VirtualArmRig(None), []

    def show(line: str) -> None:
        lines.append(line)
        if len(lines) == 3:
            server.stop()

    with Wired(server.port, arm.cycle, patience=0.001):
        example("stream")["watch"](server, show)
    assert len(lines) == 3
    shown = [float(value) for value in lines[0].split("s")[1].split()]
    assert shown == pytest.approx([degrees(value) for value in arm.arm.position], abs=0.01)


@pytest.mark.parametrize("name", ["joint", "pose", "velocity", "stream"])
def test_example_ends_in_order_on_ctrl_c(name: str) -> None:
    script = str(EXAMPLES / f"egm_{name}.py")
    code = "import sys, runpy, signal\n"
    code += "real = signal.signal\n"
    code += "signal.signal = lambda *each: (real(*each), print('ready', flush=True))\n"
    code += f"sys.argv = [{script!r}, '{free_port()}']\nrunpy.run_path({script!r}, run_name='__main__')"
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as example:
        assert example.stdout is not None
        assert example.stdout.readline() == "ready\n"
        example.send_signal(signal.SIGINT)
        assert example.communicate(timeout=10)[0] == ""
    assert example.returncode == 0


def test_example_whose_port_is_taken_says_so_in_a_sentence(server: EgmServer) -> None:
    command = [sys.executable, str(EXAMPLES / "egm_joint.py"), str(server.port)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == f"Error: {sentence(message('udp_port_taken', port=server.port), FrontEnd.SCRIPT)}\n"


def test_velocity_example_tells_the_robot_to_stand_when_it_is_stopped(server: EgmServer) -> None:
    robot, stands = ObedientRobot(), Event()

    def cycle(inbox: Sequence[bytes]) -> bytes:
        datagram = robot.cycle(inbox)
        if len(robot.heard) == 200:
            server.stop()
        if len(robot.heard) > 200 and not any(robot.heard[-1].velocity):
            stands.set()
        return datagram

    with Wired(server.port, cycle, patience=0.01):
        example("velocity")["turn"](server, 1000.0)
        assert stands.wait(5.0)


def test_guide_shows_nothing_but_what_the_examples_do() -> None:
    guide = (EXAMPLES.parent / "docs" / "how-to" / "control-any-abb-robot.md").read_text()
    examples = "".join(path.read_text() for path in EXAMPLES.glob("egm_*.py"))
    snippets = re.findall(r"^```python\n(.*?)^```", guide, re.DOTALL | re.MULTILINE)
    assert len(snippets) == 5
    assert [snippet for snippet in snippets if snippet not in examples] == []
