"""Who sees the driver's ROS 2 graph, and which names its nodes may not be given."""

from __future__ import annotations

import os
from pathlib import Path
from threading import Event
from typing import Any
from unittest.mock import MagicMock

import pytest
from click.testing import CliRunner

from abb_protocols.catalogue import Message, message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.robot.joints import Side
from yumi.api.motion_registry import MotionRegistry
from yumi.cli import demo
from yumi.cli.driver_options import limit_discovery
from yumi.cli.main import main
from yumi.cli.up import _commanded_robot
from yumi.driver.endpoint_server import EndpointServer
from yumi.driver.settings import override, read_settings

VARIABLES = ("ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS", "ROS_LOCALHOST_ONLY", "ROS_DISCOVERY_SERVER")


@pytest.fixture(autouse=True)
def _ros_says_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (*VARIABLES, "ROS_DOMAIN_ID"):
        monkeypatch.setenv(name, "")  # so that what is set in the test is taken back
        monkeypatch.delenv(name)


def test_ros_is_visible_on_this_machine_only_unless_the_network_is_opened() -> None:
    assert limit_discovery() == "ROS 2 is visible on this machine only; --network opens it to the subnet."
    assert os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"


def test_network_leaves_the_range_to_ros_and_says_who_can_move_the_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    said = limit_discovery(is_open=True)
    assert said == "ROS 2 is open to the subnet: every machine with ROS_DOMAIN_ID=7 in it can move the robot."
    assert "ROS_AUTOMATIC_DISCOVERY_RANGE" not in os.environ


@pytest.mark.parametrize("name", VARIABLES)
@pytest.mark.parametrize("is_open", [False, True])
def test_variables_of_ros_win(monkeypatch: pytest.MonkeyPatch, name: str, is_open: bool) -> None:
    monkeypatch.setenv(name, "0")
    assert limit_discovery(is_open=is_open) == f"ROS 2 discovery is as the environment says: {name}=0."
    assert [each for each in VARIABLES if each in os.environ] == [name]


OPEN = "ROS 2 is open to the subnet: every machine with ROS_DOMAIN_ID=0 in it can move the robot."


@pytest.mark.parametrize(
    ("options", "visible", "said"),
    [
        ((), "LOCALHOST", "ROS 2 is visible on this machine only; --network opens it to the subnet."),
        (("--network",), None, OPEN),
        (("--no-ros",), None, ""),
    ],
)
def test_driver_is_visible_on_this_machine_only_before_it_starts_ros(
    monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...], visible: str | None, said: str
) -> None:
    monkeypatch.setattr("yumi.cli.up.demand_ros", lambda for_driver: None)
    monkeypatch.setattr("yumi.cli.up.end_flag", lambda until_stdin_closes: Event())
    monkeypatch.setattr("yumi.cli.up.end_by_force", lambda is_over: None)
    ranges: list[str | None] = []
    monkeypatch.setattr("yumi.cli.up.run_driver", lambda *_, **__: ranges.append(os.environ.get(VARIABLES[0])))
    result = CliRunner().invoke(main, ["up", "--robot", "127.0.0.1", *options])
    assert result.exit_code == 0, result.output
    assert (result.output.strip(), ranges) == (said, [visible])


def test_demonstration_is_visible_on_this_machine_only_before_it_starts_anything(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))
    monkeypatch.setenv("MPLCONFIGDIR", str(tmp_path))
    monkeypatch.setattr(demo, "demand_ros", lambda: None)
    monkeypatch.setattr(demo, "_can_draw", lambda is_asked: False)
    ranges: list[str | None] = []

    def run_demo(*_: object) -> dict[Side, Any]:
        ranges.append(os.environ.get(VARIABLES[0]))
        return {}

    monkeypatch.setattr(demo, "run_demo", run_demo)
    result = CliRunner().invoke(main, ["demo", "--logs", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert ranges == ["LOCALHOST"]


NAMES = ["yumi_robot_manager:__ns:=/lab", "__node:=driver", "__name:=driver", "/r/arm:__ns:=/x"]


@pytest.mark.parametrize("flag", ["-r", "--remap"])
@pytest.mark.parametrize(
    ("command", "rule"),
    [*((("up",), rule) for rule in NAMES), (("demo",), "__ns:=/lab"), (("evaluate",), "__ns:=/lab")],
)
def test_name_for_all_nodes_is_refused_since_it_would_merge_both_arms(
    command: tuple[str, ...], flag: str, rule: str
) -> None:
    result = CliRunner().invoke(main, [*command, "--ros-args", flag, rule])
    assert result.exit_code == 2
    assert result.output == f"Error: {sentence(message('nodes_would_merge', rule=rule), FrontEnd.SHELL)}\n"


@pytest.mark.parametrize("flag", ["-r", "--remap"])
def test_namespace_of_ros_is_that_of_the_robot_and_not_left_to_rcl(monkeypatch: pytest.MonkeyPatch, flag: str) -> None:
    monkeypatch.setattr("yumi.cli.up.demand_ros", lambda for_driver: None)
    monkeypatch.setattr("yumi.cli.up.end_flag", lambda until_stdin_closes: Event())
    monkeypatch.setattr("yumi.cli.up.end_by_force", lambda is_over: None)
    driven: list[tuple[Any, ...]] = []
    monkeypatch.setattr("yumi.cli.up.run_driver", lambda *values, with_ros: driven.append(values))
    rules = ["--ros-args", "-r", "joint_states:=all", flag, "__ns:=/cell1", "-p", "x:=1"]
    result = CliRunner().invoke(main, ["up", "--robot", "127.0.0.1", *rules])
    assert result.exit_code == 0, result.output
    ((settings, *_, ros_arguments),) = driven
    assert settings.ros.root == "/cell1"
    assert ros_arguments == ["--ros-args", "-r", "joint_states:=all", "-p", "x:=1"]


def test_virtual_controller_takes_the_namespace_that_a_launch_file_gives_to_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    result = CliRunner().invoke(main, ["controller", "--rws-port", "-1", "--ros-args", "-r", "__ns:=/cell1"])
    would_merge = sentence(message("nodes_would_merge", rule="__ns:=/cell1"), FrontEnd.SHELL)
    assert would_merge not in result.output
    assert "'--rws-port'" in result.output  # it came to its own options


def test_two_namespaces_are_refused() -> None:
    result = CliRunner().invoke(main, ["up", "--namespace", "a", "--ros-args", "-r", "__ns:=/b"])
    assert result.exit_code == 2
    assert "--namespace and __ns:= both name the namespace; give one of them." in result.output


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--namespace", "cell 1"], message("namespace_not_of_ros", setting="ros: namespace", value="cell 1")),
        (["--namespace", "1"], message("namespace_not_of_ros", setting="ros: namespace", value="1")),
        (["--prefix", "a-"], message("prefix_not_of_ros", setting="ros: prefix", value="a-")),
    ],
)
def test_names_that_ros_does_not_know_are_refused(
    monkeypatch: pytest.MonkeyPatch, options: list[str], said: Message
) -> None:
    monkeypatch.setattr("yumi.cli.up.demand_ros", lambda for_driver: None)
    result = CliRunner().invoke(main, ["up", *options])
    assert result.exit_code == 2
    assert f"Error: {sentence(said, FrontEnd.SHELL)}\n" in result.output


@pytest.mark.parametrize("rule", ["joint_states:=robot/joint_states", "a__ns:=b", "r/joint_commands:=goals"])
def test_names_of_topics_may_be_remapped(rule: str) -> None:
    result = CliRunner().invoke(main, ["record", "list", "--folder", "none", "--ros-args", "-r", rule])
    assert (result.exit_code, result.output) == (0, "There are no records in none.\n")


def test_demo_refuses_a_port_without_a_robot() -> None:
    result = CliRunner().invoke(main, ["demo", "--left-egm-port", "6521"])
    assert result.exit_code == 1
    assert sentence(message("option_needs_robot", option="--left-egm-port"), FrontEnd.SHELL) in result.output


@pytest.mark.parametrize(
    ("namespace", "name"), [("", "127.0.0.1:80.sock"), ("lab/cell1", "lab_cell1@127.0.0.1:80.sock")]
)
def test_socket_of_a_driver_in_a_namespace_is_named_after_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, namespace: str, name: str
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    settings = override(read_settings(), {"robot": {"address": "127.0.0.1"}, "ros": {"namespace": namespace}}, "test")
    parts = MagicMock()
    parts.control.buffers = {}
    front = MagicMock(serve_commands=lambda robot: robot)
    server = EndpointServer(_commanded_robot(parts, settings, MotionRegistry(is_script=False), front))
    server.start()
    server.stop()
    assert server.path.name == name
