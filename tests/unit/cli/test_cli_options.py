from __future__ import annotations

import errno
import re
import subprocess
import sys
from collections.abc import Iterator
from threading import Event
from typing import Any, NoReturn
from unittest.mock import Mock

import click
import pytest
from click.testing import CliRunner, Result

from yumi.cli.main import main
from yumi.cli.up import run_driver
from yumi.control.shared_state import SessionLost
from yumi.driver.settings import Settings, override, read_settings
from yumi.driver.state_machine import SpeedSetting
from yumi.driver.wiring import first_speed_scale
from yumi.robot.joints import Side


def run(*arguments: str) -> Result:
    return CliRunner().invoke(main, arguments)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("controller", "--rws-port", "99999"), "99999 is not in the range 0<=x<=65535"),
        (("controller", "--left-egm-port", "99999"), "99999 is not in the range 1<=x<=65535"),
        (("controller", "--right-egm-port", "0"), "0 is not in the range 1<=x<=65535"),
        (("controller", "--left-object", "5"), "5.0 is not in the range 0.0<x<=0.05"),
        (("controller", "--right-object", "0"), "0.0 is not in the range 0.0<x<=0.05"),
        (("controller", "--right-object", "nan"), "'nan' is not a width"),
        (("controller", "--left-leak", "nan"), "'nan' is not a leak"),
        (("controller", "--right-leak", "1.5"), "1.5 is not in the range 0.0<=x<=1.0"),
        (("controller", "--left-gripper", "hook"), "'hook' is not one of 'servo', 'servo+vision', 'servo+vacuum'"),
        (("param", "get", "r/node", "p", "1.3"), "get takes NODE NAME, not r/node p 1.3."),
        (("param", "list", "r/node", "p", "1.3"), "list takes NODE, not r/node p 1.3."),
        (("param", "set", "r/node", "p"), "set takes NODE NAME VALUE, not r/node p."),
        (("param", "list"), "list takes NODE, not nothing."),
        (("up", "--rws-port", "0"), "0 is not in the range 1<=x<=65535"),
        (("up", "--speed-scale", "0"), "0.0 is not in the range 0.01<=x<=1.0"),
        (("up", "--speed-scale", "nan"), "'nan' is not a factor"),
        (("demo", "--speed-scale", "2"), "2.0 is not in the range 0.01<=x<=1.0"),
        (("up", "--left-egm-port", "99999"), "99999 is not in the range 1<=x<=65535"),
    ],
)
def test_option_out_of_range_is_refused(arguments: tuple[str, ...], sentence: str) -> None:
    result = run(*arguments)
    assert result.exit_code == 2
    assert sentence in result.output


@pytest.mark.parametrize("name", ["no-such-host.invalid", "x" * 70])
def test_virtual_controller_says_that_a_name_is_unknown(name: str) -> None:
    result = run("controller", "--rws-port", "0", "--egm-host", name)
    assert result.exit_code == 1
    assert f"Error: The name '{name}' is not known" in result.output


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (OSError(errno.EMFILE, "Too many open files"), "[Errno 24] Too many open files"),
        (OSError(errno.ENOSPC, "No space left on device"), "[Errno 28] No space left on device"),
        (MemoryError(), "no memory"),
    ],
)
def test_what_the_machine_does_not_give_is_said_in_one_sentence(
    error: Exception, reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> NoReturn:
        raise error

    monkeypatch.setattr("yumi.virtual.server.VirtualController.run", refuse)
    result = run("controller", "--rws-port", "0")
    assert result.exit_code == 1
    assert result.output == (
        f"Error: this machine gives the program too little: {reason}; see its limits (ulimit -a) and that no disk is "
        "full (df).\n"
    )


HANGS = """
from threading import Event, Thread
from yumi.cli import up

up.END = 0.1
is_over, never = Event(), Event()
up.end_by_force(is_over)
Thread(target=never.wait, name="answers-pool").start()
is_over.set()
never.wait()
"""


def test_driver_that_does_not_end_is_ended_by_force_and_says_what_hung() -> None:
    done = subprocess.run([sys.executable, "-c", HANGS], capture_output=True, text=True, timeout=30.0, check=False)
    assert done.returncode == 1
    assert done.stderr == (
        "Error: the driver did not end within 0.1 s and is ended by force; these threads had not ended: answers-pool.\n"
    )


@pytest.mark.parametrize(
    ("reason", "line"),
    [
        ("", "Driver ready: serving the robot at 127.0.0.1:8080"),
        (
            "Motors are off.",
            "Driver running, robot not ready: Motors are off. When that is done, call recover.",
        ),
    ],
)
def test_driver_says_that_it_is_ready_only_when_the_robot_is(
    monkeypatch: pytest.MonkeyPatch, reason: str, line: str
) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setattr("yumi.cli.up.demand_ros", lambda otherwise: None)
    monkeypatch.setattr("yumi.cli.up.end_flag", lambda until_stdin_closes: Event())
    monkeypatch.setattr("yumi.cli.up.end_by_force", lambda is_over: None)
    monkeypatch.setattr("yumi.cli.up.run_driver", lambda *given, with_ros: given[3](reason))
    result = run("up", "--robot", "127.0.0.1", "--rws-port", "8080")
    assert (result.exit_code, result.output.splitlines()[-1]) == (0, line)


@pytest.mark.parametrize(
    ("options", "value"), [((), "0.1: every controller moves with at most 10%"), (("--speed-scale", "1"), "1: every")]
)
def test_driver_says_at_its_start_how_fast_it_may_move_and_how_to_change_that(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, options: tuple[str, ...], value: str
) -> None:
    order: list[str] = []

    def make_parts(settings: Settings, *_: Any, **__: Any) -> Mock:
        parts = Mock()
        parts.manager.speed = SpeedSetting(first_speed_scale(settings))
        parts.bringup.check_controller.return_value = None
        parts.control.started_as = "the control process has started"
        return parts

    def bring_up(*_: Any, **__: Any) -> str:
        order.extend(record.getMessage() for record in caplog.records)
        return ""

    over = Event()
    over.set()
    for name in ("Recorder", "RobotConnection", "_endpoint_of", "GripperSetup", "SupervisedThread", "settle_memory"):
        monkeypatch.setattr(f"yumi.cli.up.{name}", Mock())
    monkeypatch.setattr("yumi.cli.up.make_parts", make_parts)
    monkeypatch.setattr("yumi.cli.up.bring_up", bring_up)
    monkeypatch.setattr("yumi.cli.up.end_flag", lambda until_stdin_closes: over)
    monkeypatch.setattr("yumi.cli.up.end_by_force", lambda is_over: None)
    with caplog.at_level("INFO", logger="yumi"):
        result = run("up", "--robot", "192.0.2.1", "--no-ros", *options)
    assert result.exit_code == 0, result.output
    (said,) = [line for line in order if line.startswith("speed_scale is ")]
    assert said.startswith(f"speed_scale is {value}")
    assert said.endswith("Change it with yumi speed-scale or the setting robot.speed_scale.")


def test_event_reaches_all_who_take_it_although_the_first_one_fails(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    parts, over = Mock(), Event()
    parts.manager.speed = SpeedSetting()
    parts.control.started_as = "the control process has started"
    over.set()
    for name in ("RobotConnection", "GripperSetup", "SupervisedThread", "settle_memory"):
        monkeypatch.setattr(f"yumi.cli.up.{name}", Mock())
    records, motions, endpoint = Mock(), Mock(), Mock()
    records.on_event.side_effect = ValueError("a fault of ours")
    make_parts = Mock(return_value=parts)
    event = SessionLost(Side.LEFT, 0.08, ())
    monkeypatch.setattr("yumi.cli.up.Recorder", lambda *_: records)
    monkeypatch.setattr("yumi.cli.up.MotionRegistry", lambda **_: motions)
    monkeypatch.setattr("yumi.cli.up._endpoint_of", lambda *_: endpoint)
    monkeypatch.setattr("yumi.cli.up.make_parts", make_parts)
    monkeypatch.setattr("yumi.cli.up.bring_up", lambda *_, **__: make_parts.call_args.args[2](event) or "")
    with caplog.at_level("ERROR", logger="yumi"):
        settings = override(read_settings(), {"robot": {"address": "192.0.2.1"}}, "test")
        run_driver(settings, {}, over, print, with_ros=False)
    for listener in (parts.manager.note, motions.note, endpoint.note_event):
        listener.assert_called_once_with(event)
    assert caplog.messages == ["Handling SessionLost of the left arm failed with ValueError: a fault of ours"]


def commands(group: click.Group) -> Iterator[click.Command]:
    """All commands, with those of groups and of other packages."""
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        yield command
        if isinstance(command, click.Group):
            yield from commands(command)


def test_examples_of_every_help_are_a_line_each() -> None:
    helps = {str(command.name): command.get_help(click.Context(command)) for command in commands(main)}
    assert {"bench", "evaluate", "tune", "up", "show"} <= helps.keys()
    for name, text in helps.items():
        assert "\\b" not in text, name  # click's mark for lines that stay as they are
        assert not re.search(r"Examples?: +yumi", text), name
