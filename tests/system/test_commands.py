"""The commands for a running driver, against ``yumi up`` and a virtual robot, each in a process of its own."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner
from script_bench import TIMEOUT, VirtualRobot

import yumi
from abb_protocols.catalogue import message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import RobotNotReady
from abb_protocols.robot.joints import YUMI_LIMITS, Side, named_pose
from abb_runtime.faults import Fault
from abb_runtime.process.command_process import CommandProcess
from refusals import refused
from yumi.cli import graph
from yumi.cli.main import main
from yumi.cli.robot_commands import DRIVER_COMMANDS

pytestmark = [pytest.mark.real_time, pytest.mark.timeout(180)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("commands")


@pytest.fixture(scope="module")
def robot(folder: Path) -> Iterator[VirtualRobot]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", str(folder))
        patch.setenv("ROS_LOG_DIR", str(folder))
        patch.setenv("ROS_DOMAIN_ID", "97")
        robot = VirtualRobot(folder)
        robot.start()
        yield robot
        robot.stop()


@pytest.fixture(scope="module")
def driver(robot: VirtualRobot, folder: Path, request: pytest.FixtureRequest) -> Iterator[CommandProcess]:
    """One for all tests that leave it running; another one where its options are others."""
    host, _, port = robot.address.partition(":")
    options = {key: value for key, value in robot.options.items() if key != "address"}
    arguments = ["up", "--robot", f"{host}:{port}"]
    arguments += [text for key, value in options.items() for text in (f"--{key.replace('_', '-')}", str(value))]
    with CommandProcess(
        "driver", "yumi", [*arguments, *getattr(request, "param", ["--no-ros"])], folder / "driver.log"
    ) as driver:
        driver.wait_until_ready(TIMEOUT)
        yield driver


def run(*arguments: str) -> str:
    """What a command prints; it succeeds."""
    result = CliRunner().invoke(main, arguments, catch_exceptions=False)
    assert result.exit_code == 0, f"{arguments}: {result.output}"
    return result.stdout


def refusal(*arguments: str) -> str:
    """Why a command is refused."""
    result = CliRunner().invoke(main, arguments, catch_exceptions=False)
    assert result.exit_code != 0, f"{arguments}: {result.output}"
    return result.stderr


def in_shell(code: str, **values: Any) -> str:
    """What the shell says of a message."""
    return sentence(message(code, **values), FrontEnd.SHELL)


def state() -> Mapping[str, Any]:
    found: Mapping[str, Any] = json.loads(run("state", "--json"))
    return found


def test_script_is_seen_and_asked_while_it_drives(robot: VirtualRobot) -> None:
    """The first one: no driver runs yet."""
    steps: list[str] = []
    with yumi.connect(**robot.options, on_step=steps.append) as connected:
        assert "right arm: EGM running, holding" in run("state")
        motion = connected.right.move_to("ready", wait=False)
        shown = (motion.progress, motion.remaining)
        said = in_shell("arm_moves_commanded_by", arm="right", controllers=("joint_goal_controller",))
        assert said in refusal("move", "right", "home")
        motion.wait(TIMEOUT)
        assert "stands at the goal" in run("move", "right", "home")
        report = connected.right.state
        connected.right.move_to("ready")
    assert any("motors" in step for step in steps)
    assert 0.0 <= shown[0] < 1.0
    assert shown[1] is not None
    assert shown[1] > 0.0
    assert motion.progress == 1.0
    assert motion.remaining == 0.0
    assert report.egm is not None
    assert report.planned is not None
    assert (report.egm.motion, report.egm.rapid) == ("running", "running")
    assert in_shell("no_driver_runs") in refusal("state")


def test_robot_is_used_by_commands_without_ros(driver: CommandProcess, robot: VirtualRobot) -> None:
    assert "can move" in run("state")
    without_egm = message("arm_without_egm", arm="right")
    assert in_shell("goal_refused", reason=without_egm) in refusal("move", "right", "home")
    assert "EGM runs on both arms" in run("start")
    before = state()
    assert before["robot"] == robot.address
    assert before["arms"]["right"]["egm"]["motors"] == "on"
    assert "stands at the goal" in run("move", "right", "ready")
    moved = state()["arms"]["right"]["position"]
    assert moved == pytest.approx(named_pose(Side.RIGHT, "ready"), abs=0.003)
    run("move", "right", "j1=0", "--degrees")
    assert state()["arms"]["right"]["position"][0] == pytest.approx(0.0, abs=0.003)
    values = {"position": 4.0, "lower": YUMI_LIMITS.lower[1], "upper": YUMI_LIMITS.upper[1]}
    said = in_shell("goal_joint_out_of_range", joint="yumi_joint_2_l", **values)
    assert said in refusal("move", "left", "j2=4")
    run("grip", "left", "open")
    assert json.loads(run("grip", "left", "close", "--json")) == {
        "arm": "left",
        "outcome": "holding",
        "width": pytest.approx(0.02, abs=0.001),
    }
    assert "joint_trajectory_controller" in run("controllers")
    run("switch", "right", "joint_trajectory_controller")
    commanding = [it["name"] for it in json.loads(run("controllers", "--json"))["right"] if it["commands"]]
    assert commanding == ["joint_trajectory_controller"]
    assert "speed_scale is 0.5" in run("speed-scale", "0.5")
    run("speed-scale", "1")
    assert "EGM" in refusal("calibrate", "right")
    run("mode", "motors_off")
    assert state()["motors"] == "motoroff"
    assert "motoroff" in run("mode")
    with (
        refused(RobotNotReady, "robot_driven_by_another"),
        yumi.connect(**robot.options),
    ):
        pytest.fail("there are two drivers")


def examples_of(commands: Sequence[click.Command]) -> Iterator[list[str]]:
    """The commands under "Examples" in the help of commands, without those that run until Ctrl-C."""
    for command in commands:
        _, _, examples = (command.help or "").partition("Examples:\n")
        for line in examples.splitlines():
            words = shlex.split(re.split(r"\s{2,}", line.strip())[0])
            if words and "--watch" not in words:
                yield words[1:]


def test_examples_of_help_work(driver: CommandProcess) -> None:
    ran = []
    for words in examples_of(DRIVER_COMMANDS):
        if words[0] in ("move", "retreat", "switch"):
            run("start")
        ran.append(run(*words))
    assert len(ran) > 15


def test_stop_is_confirmed_by_its_id(driver: CommandProcess, robot: VirtualRobot) -> None:
    run("start")
    robot.inject(Fault.COLLISION)
    with yumi.attach() as attached:
        states = attached.watch(20.0)
        stopped = next(each for each in states if each.stop)
    assert "50204" in stopped.cause
    assert f"yumi recover --confirm {stopped.stop}" in refusal("recover")
    assert stopped.stop in refusal("start")
    assert "50204" in run("recover", "--confirm", stopped.stop)
    assert state()["arms"]["right"]["mode"] == "holding"
    events = [event["said"]["sentence"] for event in state()["events"]]
    assert any("50204" in event for event in events)


RUN = """
import json, sys
from click.testing import CliRunner
from yumi.cli.main import main

def run(words):
    result = CliRunner().invoke(main, words)
    return result.exit_code, result.stdout, result.stderr

json.dump([run(words) for words in json.load(sys.stdin)], sys.stdout)
"""


def apart(*commands: Sequence[str]) -> list[tuple[int, str, str]]:
    """Exit codes, outputs and errors, in another process: here tests before it may have a ROS context."""
    done = subprocess.run(
        [sys.executable, "-c", RUN], input=json.dumps(commands), capture_output=True, text=True, timeout=150, check=True
    )
    return [tuple(each) for each in json.loads(done.stdout)]


@pytest.mark.ros
@pytest.mark.skipif(find_spec("rclpy") is None, reason="ROS 2 is not installed")
@pytest.mark.parametrize("driver", [[]], indirect=True)
def test_commands_see_the_ros_graph_and_the_driver(driver: CommandProcess) -> None:
    assert "EGM runs" in run("start")
    assert "stands at the goal" in run("move", "left", "ready", "--speed-scale", "1")
    examples = list(examples_of((graph.topics, graph.echo, graph.call, graph.param)))
    assert len(examples) > 5
    node = "r/joint_position_controller"
    right = [
        ["topics"],
        ["echo", "r/joint_states", "--once", "--json"],
        ["call", "yumi_robot_manager/robot_is_ready", "--json"],
        ["param", "set", node, "p", "1.3", "--json"],
    ]
    wrong = [
        ["call", "r/nothing"],
        ["call", "yumi_robot_manager/set_speed_ratio", "{percents: 3}"],
        ["param", node, "p", "-1.0"],
    ]
    results = apart(*right, *wrong, *examples)
    done, refused = [*results[:4], *results[7:]], results[4:7]
    assert [each for each in done if each[0] != 0] == []
    topics, states, ready, gain = (output for _, output, _ in done[:4])
    assert "/r/joint_states" in topics
    assert json.loads(states)["name"][0] == "yumi_joint_1_r"
    assert json.loads(ready)["success"] is True
    assert json.loads(gain) == {"p": 1.3}
    for (code, _, error), words in zip(
        refused, ("no service /r/nothing", "There is no field 'percents'", "was not set"), strict=True
    ):
        assert code != 0
        assert words in error
