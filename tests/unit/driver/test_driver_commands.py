"""The table of commands: what each front end makes of it."""

from __future__ import annotations

import dataclasses
from concurrent.futures import ThreadPoolExecutor
from threading import Event, Lock
from typing import Any

import click
import msgspec
import pytest

from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import CommandRefused, GoalNotReached
from abb_protocols.robot.gripper_values import GripOutcome
from abb_protocols.robot.joints import ZERO_JOINTS, Side
from fake_driver import WAIT, FakeDriver
from refusals import refused
from yumi.api.streams import OLDEST_JOG
from yumi.cli.from_table import command_from
from yumi.cli.main import sections
from yumi.cli.robot_commands import DRIVER_COMMANDS
from yumi.control.controllers.joint_goal import GoalOutcome
from yumi.control.hand_over import Commander
from yumi.control.loop_commands import ControllerCommand
from yumi.driver.command import Caller, Command, Lane
from yumi.driver.commands import COMMANDS, Calibrate, Grip, StartEgm, carry_out, offered_to
from yumi.driver.endpoint_server import decode_request
from yumi.driver.motion_commands import JOG_HOLDS, Jog, JogTool, Move
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
    assert names <= {*sections()["Operate"]}


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


JOGS = pytest.mark.parametrize(
    "jog", [Jog(arm="right", speeds=(0.1, *ZERO_JOINTS[1:])), JogTool(arm="right", elbow=0.1)]
)
PAGE = Caller(client="page", front_end=FrontEnd.PAGE)


def at(jog: Jog | JogTool, driver: FakeDriver, age: float = 0.0) -> Jog | JogTool:
    """It was asked for so long ago [s]."""
    return msgspec.structs.replace(jog, time=driver.robot.clock.now() - age)


def written(driver: FakeDriver) -> list[tuple[float, ...]]:
    """The newest velocities of the right arm that its controllers were sent: of joints, and of the tool."""
    speeds, goal = driver.robot.speeds[Side.RIGHT].read(), driver.robot.tool_goals[Side.RIGHT].read()
    return ([speeds[1].velocity] if speeds else []) + ([goal[1].twist] if goal else [])


@JOGS
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


class MoveOfAProgram:
    """A move of the right arm that a program asks for, and that goes on until something ends it.

    The arm takes 0.5 s to come to rest.
    """

    def __init__(self, driver: FakeDriver, pool: ThreadPoolExecutor) -> None:
        self._driver, self._begun = driver, Event()
        driver.robot.control.on_command = self._note
        move = Move(right="home")
        self.end = pool.submit(carry_out, move, driver.server._robot, Caller(client="script"))
        assert self._begun.wait(WAIT)

    def _note(self, command: ControllerCommand) -> None:
        move, *stops = self._driver.robot.control.commands
        if not stops:
            self._begun.set()
            return
        if len(stops) == 1:  # of later ones it stands already
            self._driver.robot.clock.advance(0.5)
            self._driver.robot.end(move, GoalOutcome.STOPPED)
        self._driver.robot.rest(command)


@JOGS
def test_first_jog_of_a_person_takes_the_arm_from_a_programs_move_and_the_next_one_moves_it(
    jog: Jog | JogTool,
) -> None:
    driver = FakeDriver()
    with ThreadPoolExecutor(1) as pool:
        move = MoveOfAProgram(driver, pool)
        carry_out(at(jog, driver), driver.server._robot, PAGE)
        with pytest.raises(GoalNotReached):
            move.end.result(WAIT)
    assert driver.robot.control.hand_over.of(Side.RIGHT).who is Commander.PAGE
    assert written(driver) == []
    carry_out(at(jog, driver), driver.server._robot, PAGE)
    assert written(driver) == [jog.speeds if isinstance(jog, Jog) else (*ZERO_JOINTS[:6], jog.elbow)]


@JOGS
def test_jog_that_was_asked_for_too_long_ago_leaves_a_programs_move_alone(jog: Jog | JogTool) -> None:
    driver = FakeDriver()
    with ThreadPoolExecutor(1) as pool:
        move = MoveOfAProgram(driver, pool)
        with refused(CommandRefused, "jog_too_old"):
            carry_out(at(jog, driver, 0.2), driver.server._robot, PAGE)
        assert driver.robot.control.hand_over.of(Side.RIGHT).who is Commander.TRAJECTORY
        (command,) = driver.robot.control.commands
        driver.robot.end(command)
        move.end.result(WAIT)


class HeldForAMoment:
    """A lock that another thread holds, as a point of a stream does; who waits for it has it after a time [s]."""

    def __init__(self, driver: FakeDriver, time: float) -> None:
        self._driver, self._time, self._lock = driver, time, Lock()
        self.is_held = False

    def acquire(self, blocking: bool = True, timeout: float = -1.0) -> bool:
        if self.is_held:
            if not blocking or timeout == 0.0:
                return False
            assert self._time < timeout
            self._driver.robot.clock.advance(self._time)
            self.is_held = False
        return self._lock.acquire(blocking=False)

    def release(self) -> None:
        self._lock.release()


@JOGS
@pytest.mark.parametrize("wait", [0.01, 0.15])
@pytest.mark.parametrize("is_own", [True, False])
def test_jog_of_a_person_waits_for_a_point_of_a_programs_stream_and_moves_the_arm_only_while_it_is_new(
    jog: Jog | JogTool, wait: float, *, is_own: bool
) -> None:
    driver = FakeDriver()
    driver.robot.control.on_command = driver.robot.rest
    lock = HeldForAMoment(driver, wait)
    robot = dataclasses.replace(driver.server._robot, moving=lock)  # type: ignore[arg-type]
    for _ in range(2):
        carry_out(at(jog, driver), robot, PAGE)
    (before,) = written(driver)
    if not is_own:  # the key was let go
        driver.robot.executor.end_jog(Side.RIGHT, PAGE.client)
        driver.robot.clock.advance(1.0)
        assert driver.robot.control.hand_over.of(Side.RIGHT).who is Commander.NONE
    lock.is_held = True
    faster = msgspec.structs.replace(
        jog, **({"speeds": (0.2, *ZERO_JOINTS[1:])} if isinstance(jog, Jog) else {"elbow": 0.2})
    )
    if is_own and wait > OLDEST_JOG:
        with refused(CommandRefused, "jog_too_old"):
            carry_out(at(faster, driver), robot, PAGE)
        assert written(driver) == [before]
    else:  # the first one of a press takes the arm over only
        carry_out(at(faster, driver), robot, PAGE)
        assert written(driver) == [tuple(2.0 * value for value in before) if is_own else ZERO_JOINTS]
        carry_out(at(faster, driver), robot, PAGE)
        assert written(driver) == [tuple(2.0 * value for value in before)]
    assert not lock.is_held
