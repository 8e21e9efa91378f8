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

from abb_protocols.catalogue import Message, message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import LoginRefused, NoConnection
from abb_protocols.robot.joints import Side
from abb_runtime.udp import address_of_host
from refusals import refused
from yumi.cli.driver_options import settings_of
from yumi.cli.main import main
from yumi.cli.up import DEFAULT_WAIT, run_driver, wait_for_controller
from yumi.control.loop_events import SessionLost
from yumi.driver.settings import RobotSettings, Settings, override, read_settings
from yumi.driver.speed_setting import SpeedSetting


def run(*arguments: str) -> Result:
    return CliRunner().invoke(main, arguments)


NO_PORT = message(
    "setting_refused",
    place="command line: robot",
    reason=message("value_out_of_range", parameter="rws_port", value="0", lowest=1, highest=65535),
)


@pytest.mark.parametrize(
    ("arguments", "words"),
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
        (("up", "--robot", "127.0.0.1:0"), f"Error: {sentence(NO_PORT, FrontEnd.SHELL)}\n"),
        (("up", "--speed-scale", "0"), "0.0 is not in the range 0.01<=x<=1.0"),
        (("up", "--speed-scale", "nan"), "'nan' is not a factor"),
        (("demo", "--speed-scale", "2"), "2.0 is not in the range 0.01<=x<=1.0"),
        (("up", "--left-egm-port", "99999"), "99999 is not in the range 1<=x<=65535"),
    ],
)
def test_option_out_of_range_is_refused(arguments: tuple[str, ...], words: str) -> None:
    result = run(*arguments)
    assert result.exit_code == 2
    assert words in result.output


@pytest.mark.parametrize("name", ["no-such-host.invalid", "x" * 70])
def test_virtual_controller_says_that_a_name_is_unknown(name: str) -> None:
    result = run("controller", "--rws-port", "0", "--egm-host", name)
    assert result.exit_code == 1
    with refused(NoConnection, "host_unknown", host=name) as refusal:
        address_of_host(name)
    assert result.output == f"Error: {sentence(refusal.value.said, FrontEnd.SHELL)}\n"


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (OSError(errno.EMFILE, "Too many open files"), "[Errno 24] Too many open files"),
        (OSError(errno.ENOSPC, "No space left on device"), "[Errno 28] No space left on device"),
        (MemoryError(), message("no_memory")),
    ],
)
def test_what_the_machine_does_not_give_is_said_in_one_sentence(
    error: Exception, reason: Message | str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> NoReturn:
        raise error

    monkeypatch.setattr("virtual_irc5.server.VirtualController.run", refuse)
    result = run("controller", "--rws-port", "0")
    assert result.exit_code == 1
    said = message("machine_gives_too_little", reason=reason)
    assert result.output == f"Error: {sentence(said, FrontEnd.SHELL)}\n"


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


NOT_READY_YET = message("not_ready_yet", reason=message("motors_off"))


@pytest.mark.parametrize(
    ("reason", "line"),
    [
        (None, "Driver ready: serving the robot at 127.0.0.1:8080"),
        (
            message("motors_off"),
            f"Driver running, robot not ready: {sentence(NOT_READY_YET, FrontEnd.ROS)}",
        ),
    ],
)
def test_driver_says_that_it_is_ready_only_when_the_robot_is(
    monkeypatch: pytest.MonkeyPatch, reason: Message | None, line: str
) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setattr("yumi.cli.up.demand_ros", lambda for_driver: None)
    monkeypatch.setattr("yumi.cli.up.end_flag", lambda until_stdin_closes: Event())
    monkeypatch.setattr("yumi.cli.up.end_by_force", lambda is_over: None)
    monkeypatch.setattr("yumi.cli.up.run_driver", lambda *given, with_ros: given[3](reason))
    result = run("up", "--robot", "127.0.0.1:8080")
    assert (result.exit_code, result.output.splitlines()[-1]) == (0, line)


@pytest.mark.parametrize(
    ("options", "value", "level"),
    [
        ((), 0.1, "INFO"),
        (("--speed-scale", "1"), 1.0, "DEBUG"),
    ],
)
def test_driver_says_at_its_start_how_fast_it_may_move_and_how_to_change_that(
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    options: tuple[str, ...],
    value: float,
    level: str,
) -> None:
    order: list[tuple[str, str]] = []

    def make_parts(settings: Settings, *_: Any, **__: Any) -> Mock:
        parts = Mock()
        parts.manager.speed = SpeedSetting(settings.robot.first_speed_scale)
        parts.bringup.check_controller.return_value = None
        parts.control.started_as = "the control process has started"
        return parts

    def bring_up(*_: Any, **__: Any) -> None:
        order.extend((record.levelname, record.getMessage()) for record in caplog.records)

    over = Event()
    over.set()
    parts_of_driver = ("Recorder", "RobotConnection", "_commanded_robot", "EndpointServer", "set_up_grippers")
    for name in (*parts_of_driver, "SupervisedThread", "settle_memory", "release_process"):
        monkeypatch.setattr(f"yumi.cli.up.{name}", Mock())
    monkeypatch.setattr("yumi.cli.up.make_parts", make_parts)
    monkeypatch.setattr("yumi.cli.up.start_robot", bring_up)
    monkeypatch.setattr("yumi.cli.up.end_flag", lambda until_stdin_closes: over)
    monkeypatch.setattr("yumi.cli.up.end_by_force", lambda is_over: None)
    with caplog.at_level("DEBUG", logger="yumi"):
        result = run("up", "--robot", "192.0.2.1", "--no-ros", *options)
    assert result.exit_code == 0, result.output
    assert ("DEBUG", "the control process has started") in order
    said = sentence(message("speed_scale_in_force", value=value), FrontEnd.SHELL)
    how = "Change it with yumi speed-scale or the setting robot.speed_scale."
    assert [line for line in order if said in line[1]] == [(level, f"{said} {how}")]


def test_event_reaches_all_who_take_it_although_the_first_one_fails(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    parts, over = Mock(), Event()
    parts.manager.speed = SpeedSetting()
    parts.control.started_as = "the control process has started"
    over.set()
    for name in ("RobotConnection", "set_up_grippers", "SupervisedThread", "settle_memory", "release_process"):
        monkeypatch.setattr(f"yumi.cli.up.{name}", Mock())
    records, motions, endpoint = Mock(), Mock(), Mock()
    records.on_event.side_effect = ValueError("a fault of ours")
    make_parts = Mock(return_value=parts)
    event = SessionLost(Side.LEFT, 0.08, ())
    monkeypatch.setattr("yumi.cli.up.Recorder", lambda *_: records)
    monkeypatch.setattr("yumi.cli.up.MotionRegistry", lambda **_: motions)
    monkeypatch.setattr("yumi.cli.up._commanded_robot", Mock())
    monkeypatch.setattr("yumi.cli.up.EndpointServer", lambda *_: endpoint)
    monkeypatch.setattr("yumi.cli.up.make_parts", make_parts)
    monkeypatch.setattr("yumi.cli.up.start_robot", lambda *_, **__: make_parts.call_args.args[2](event) or "")
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


class Controllers:
    """What a client meets at each of its attempts; the clients that were made."""

    def __init__(self, *answers: Exception | None) -> None:
        self.answers = list(answers)
        self.addresses: list[str] = []

    def client(self, address: str, **_: object) -> Controllers:
        self.addresses.append(address)
        return self

    def connect(self) -> None:
        answer = self.answers.pop(0)
        if answer is not None:
            raise answer

    def close(self) -> None:
        """Nothing is open."""


NOBODY = NoConnection("no controller listens there")


def wait(controllers: Controllers, monkeypatch: pytest.MonkeyPatch, timeout: float, is_over: Event) -> bool:
    monkeypatch.setattr("yumi.driver.settings.RwsClient", controllers.client)
    monkeypatch.setattr("yumi.cli.up._WAIT_PERIOD", 0.0)
    return wait_for_controller(RobotSettings(address="127.0.0.1", rws_port=8080), timeout, is_over)


def test_driver_waits_until_a_controller_answers_and_says_so_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    controllers = Controllers(NOBODY, NOBODY, None)
    assert wait(controllers, monkeypatch, 30.0, Event())
    assert controllers.addresses == ["127.0.0.1:8080"] * 3
    assert capsys.readouterr().out == "Waiting up to 30 s for a controller at 127.0.0.1:8080.\n"


def test_driver_that_has_waited_long_enough_says_why_there_is_no_connection(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(NoConnection, match="no controller listens there"):
        wait(Controllers(NOBODY), monkeypatch, 0.0, Event())


def test_driver_does_not_wait_for_a_controller_that_refuses_the_user(monkeypatch: pytest.MonkeyPatch) -> None:
    controllers = Controllers(LoginRefused("no"), None)
    with pytest.raises(LoginRefused):
        wait(controllers, monkeypatch, 30.0, Event())
    assert len(controllers.addresses) == 1


def test_driver_that_is_ended_while_it_waits_is_not_started(monkeypatch: pytest.MonkeyPatch) -> None:
    over = Event()
    controllers = Controllers(NOBODY, None)
    monkeypatch.setattr(controllers, "connect", lambda: (over.set(), controllers.answers.pop(0)) and _raise(NOBODY))
    assert not wait(controllers, monkeypatch, 30.0, over)
    assert len(controllers.addresses) == 1


def _raise(error: Exception) -> NoReturn:
    raise error


@pytest.mark.parametrize(
    ("option", "timeout"),
    [((), None), (("--wait",), DEFAULT_WAIT), (("--wait", "5"), 5.0), (("--wait", "--no-ros"), 60.0)],
)
def test_wait_may_have_a_time(monkeypatch: pytest.MonkeyPatch, option: tuple[str, ...], timeout: float | None) -> None:
    waits: list[float] = []
    monkeypatch.setattr("yumi.cli.up.demand_ros", lambda for_driver: None)
    monkeypatch.setattr("yumi.cli.up.end_by_force", lambda is_over: None)
    monkeypatch.setattr("yumi.cli.up.run_driver", lambda *_, **__: None)
    monkeypatch.setattr("yumi.cli.up.wait_for_controller", lambda robot, time, is_over: waits.append(time) or True)
    result = run("up", "--robot", "127.0.0.1", *option)
    assert (result.exit_code, waits) == (0, [] if timeout is None else [timeout]), result.output


@pytest.mark.parametrize(
    ("robot", "address", "port"),
    [("192.0.2.1", "192.0.2.1", 80), ("192.0.2.1:8081", "192.0.2.1", 8081), ("127.0.0.1", "127.0.0.1", 8080)],
)
def test_robot_is_the_address_of_a_controller_with_its_port(robot: str, address: str, port: int) -> None:
    found = settings_of(None, {"robot": robot}).robot
    assert (found.address, found.rws_port) == (address, port)


def test_robot_that_is_no_address_is_refused() -> None:
    result = run("up", "--no-ros", "--robot", "192.0.2.1:http")
    assert (
        result.exit_code,
        sentence(message("no_address", address="192.0.2.1:http"), FrontEnd.SHELL) in result.output,
    ) == (2, True)
