"""The launch file gives commands that exist; ROS's launch is played by stand-ins, since no registry has it."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import click
import pytest

from yumi.cli import main as cli

FILE = Path(__file__).parents[2] / "launch" / "yumi.launch.py"


class Configuration:
    """Looks its name up where the test says."""

    def __init__(self, name: str) -> None:
        self.name = name

    def perform(self, context: dict[str, str]) -> str:
        return context[self.name]


@pytest.fixture
def launch_file(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    names = {
        "launch": ("LaunchDescription",),
        "launch.actions": ("DeclareLaunchArgument", "OpaqueFunction", "RegisterEventHandler", "Shutdown"),
        "launch.event_handlers": ("OnProcessIO",),
        "launch.substitutions": (),
        "launch_ros": (),
        "launch_ros.actions": ("Node",),
    }
    for module, members in names.items():
        made = ModuleType(module)
        for member in members:
            setattr(made, member, lambda *values, **fields: SimpleNamespace(values=values, **fields))
        monkeypatch.setitem(sys.modules, module, made)
    sys.modules["launch.substitutions"].LaunchConfiguration = Configuration  # type: ignore[attr-defined]
    return runpy.run_path(str(FILE))


def start(launch_file: dict[str, Any], **given: str) -> list[Any]:
    defaults = {name: value for name, value, _ in launch_file["ARGUMENTS"]}
    started: list[Any] = launch_file["_start"]({**defaults, **given})
    return started


def command_of(name: str) -> click.Command:
    command = cli.main.get_command(click.Context(cli.main), name)
    assert command is not None
    return command


def parse(node: Any) -> dict[str, Any]:
    """What the command line makes of it; raises where that knows no such option."""
    command = command_of(node.arguments[0])
    return command.make_context(node.arguments[0], list(node.arguments[1:]), parent=click.Context(cli.main)).params


def test_every_argument_is_declared_with_a_default_and_a_sentence(launch_file: dict[str, Any]) -> None:
    description = launch_file["generate_launch_description"]()
    declared = description.values[0][:-1]
    assert [each.values[0] for each in declared] == [name for name, _, _ in launch_file["ARGUMENTS"]]
    assert all(each.description.endswith((".", "error.")) for each in declared)


def test_driver_is_started_with_what_was_given(launch_file: dict[str, Any], tmp_path: Path) -> None:
    (driver,) = start(launch_file, robot="192.0.2.1:8081", wait="30", config=str(tmp_path), bringup="false")
    assert (driver.package, driver.executable) == ("yumi_ros2", "yumi")
    options = parse(driver)
    assert (options["robot"], options["wait"], options["bringup"]) == ("192.0.2.1:8081", 30.0, False)
    assert options["config"] == tmp_path


def test_every_option_of_the_driver_is_an_argument(launch_file: dict[str, Any]) -> None:
    options = {parameter.name for parameter in command_of("up").params if parameter.name != "help"}
    without_a_terminal = options - {"ask_password", "until_stdin_closes", "with_ros"}
    assert without_a_terminal <= {name for name, _, _ in launch_file["ARGUMENTS"]}


def test_names_and_ports_reach_driver_and_virtual_robot(launch_file: dict[str, Any]) -> None:
    given = {"namespace": "cell1", "prefix": "a_", "left_egm_port": "7001", "right_egm_port": "7002"}
    handler, controller = start(launch_file, virtual="true", **given)
    ports = {"left_egm_port": 7001, "right_egm_port": 7002}
    assert {name: parse(controller)[name] for name in ports} == ports
    (driver,) = handler.values[0].on_stdout(SimpleNamespace(text=b"Virtual controller ready: x"))
    options = parse(driver)
    assert {name: options[name] for name in ports} == ports
    assert (options["namespace"], options["prefix"]) == ("cell1", "a_")


def test_driver_decides_about_bringup_and_is_local_unless_told_otherwise(launch_file: dict[str, Any]) -> None:
    (driver,) = start(launch_file)
    assert [parse(driver)[name] for name in ("bringup", "network")] == [None, False]
    (driver,) = start(launch_file, bringup="false", network="true")
    assert [parse(driver)[name] for name in ("bringup", "network")] == [False, True]


def test_virtual_robot_is_started_first_and_then_its_driver_once(launch_file: dict[str, Any]) -> None:
    handler, controller = start(launch_file, virtual="true")
    assert parse(controller)["rws_port"] == 8080
    told = handler.values[0]
    assert told.target_action is controller
    assert told.on_stdout(SimpleNamespace(text=b"INFO something else")) is None
    (driver,) = told.on_stdout(SimpleNamespace(text=b"Virtual controller ready: http://127.0.0.1:8080"))
    assert parse(driver)["robot"] == "127.0.0.1:8080"
    assert told.on_stdout(SimpleNamespace(text=b"Virtual controller ready: again")) is None


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        (["up", "--robot", "a", "--ros-args", "--log-level", "warn"], ["up", "--robot", "a"]),
        (["up", "--ros-args", "-r", "a:=b", "--", "--robot", "a"], ["up", "--robot", "a"]),
        (["up", "--ros-args"], ["up"]),
        (["up", "--"], ["up", "--"]),
    ],
)
def test_arguments_of_ros_are_left_to_ros(given: list[str], kept: list[str]) -> None:
    assert cli._split_ros_arguments(given)[0] == kept
