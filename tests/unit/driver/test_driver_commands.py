"""The table of commands: what each front end makes of it."""

from __future__ import annotations

from typing import Any

import click
import msgspec
import pytest

from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.gripper_values import GripOutcome
from abb_protocols.robot.joints import ZERO, Side
from fake_driver import FakeDriver
from refusals import refused
from yumi.cli.from_table import command_from
from yumi.cli.main import SECTIONS
from yumi.cli.robot_commands import DRIVER_COMMANDS
from yumi.driver.command import Caller, Command, Lane
from yumi.driver.commands import COMMANDS, Calibrate, Grip, StartEgm, carry_out, offered_to
from yumi.driver.endpoint_server import decode_request
from yumi.driver.motion_commands import JOG_HOLDS, Jog, JogTool
from yumi.driver.reports import GripReport
from yumi.web.page_messages import Ask

ENDPOINT = offered_to(FrontEnd.SCRIPT, FrontEnd.SHELL, FrontEnd.PAGE)
REQUIRED = {
    "set_mode": {"mode": "ready"},
    "set_speed_scale": {"speed_scale": 0.5},
    "grip": {"arm": "right", "action": "open"},
    "follow": {"start": {}},
    "jog": {"arm": "right", "speeds": [0.0] * 7},
    "jog_tool": {"arm": "right"},
    "teleoperate": {"frame": {"time": 1.0}},
    "switch_controllers": {"arm": "right"},
    "allow_collision": {"part": "a", "other": "b", "seconds": 1.0},
}
"""Arguments without a default."""


def document(kind: type[Command[Any]]) -> dict[str, Any]:
    return {"method": kind.method(), **REQUIRED.get(kind.method(), {})}


def test_every_command_has_a_name_of_its_own_and_says_what_it_does() -> None:
    assert len({kind.method() for kind in COMMANDS}) == len(COMMANDS)
    assert [kind for kind in COMMANDS if not kind.summary()] == []


@pytest.mark.parametrize("kind", ENDPOINT)
def test_endpoint_takes_the_commands_that_a_client_may_give(kind: type[Command[Any]]) -> None:
    assert isinstance(decode_request(msgspec.json.encode(document(kind))), kind)


@pytest.mark.parametrize("kind", [kind for kind in COMMANDS if kind not in ENDPOINT])
def test_endpoint_refuses_commands_of_ros_alone(kind: type[Command[Any]]) -> None:
    with pytest.raises(msgspec.ValidationError, match="Invalid value"):
        decode_request(msgspec.json.encode(document(kind)))


@pytest.mark.parametrize("kind", ENDPOINT)
def test_page_asks_for_what_is_offered_to_it_and_no_more(kind: type[Command[Any]]) -> None:
    asked = msgspec.json.encode({"type": "ask", "id": 1, "request": document(kind)})
    if FrontEnd.PAGE in kind.front_ends:
        assert isinstance(msgspec.json.decode(asked, type=Ask).request, kind)
    else:
        with pytest.raises(msgspec.ValidationError, match="Invalid value"):
            msgspec.json.decode(asked, type=Ask)


def test_command_line_has_each_command_that_is_offered_to_it() -> None:
    names = {each.name for each in DRIVER_COMMANDS}
    assert {kind.shell_name or kind.method().replace("_", "-") for kind in offered_to(FrontEnd.SHELL)} <= names
    assert names <= {*SECTIONS["Operate"]}


def test_arguments_on_the_command_line_are_those_of_the_command() -> None:
    made = {param.name: param for param in command_from(Grip).params}
    assert isinstance(made["arm"], click.Argument)
    assert isinstance(made["action"].type, click.Choice)
    assert list(made["action"].type.choices) == ["open", "close"]
    assert isinstance(made["width"].type, click.FloatRange)
    assert (made["width"].type.min, made["width"].type.max, made["width"].default) == (0.0, 0.05, None)
    (arm,) = (param for param in command_from(StartEgm).params if param.name == "arm")
    assert (arm.required, arm.default) == (False, None)


def test_result_of_a_command_has_its_type() -> None:
    assert Grip.result_type() is GripReport
    assert Calibrate.result_type() is str
    assert str(GripReport(GripOutcome.OPEN, 0.05, "left")) == "The left gripper is open."


def test_stop_waits_for_nothing() -> None:
    stops = {kind.method() for kind in COMMANDS if kind.lane is Lane.STOP}
    assert stops == {"stop_egm", "motors_off", "stop_rapid"}


@pytest.mark.parametrize("jog", [Jog(arm="right", speeds=(0.1, *ZERO[1:])), JogTool(arm="right", elbow=0.1)])
def test_jog_that_is_refused_ends_the_one_before_at_once(jog: Jog | JogTool) -> None:
    driver, held = FakeDriver(), list[float | None]()
    driver.robot.control.on_command = driver.robot.rest
    page = Caller(client="page", front_end=FrontEnd.PAGE, hold=lambda name, end, after: held.append(after))
    for _ in range(2):
        carry_out(jog, driver.server._robot, page)
    old = msgspec.structs.replace(jog, time=driver.robot.clock.now() - 1.0)
    with refused(CommandRefused, "jog_too_old"):
        carry_out(old, driver.server._robot, page)
    assert held == [JOG_HOLDS, JOG_HOLDS, 0.0]
    assert driver.robot.control.hand_over.of(Side.RIGHT).who.is_person
