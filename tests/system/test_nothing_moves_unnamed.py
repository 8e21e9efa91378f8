"""A real robot moves nothing that no call names: not by connecting, attaching, recovering or ending."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path

import pytest

from abb_protocols.catalogue import Message
from abb_protocols.errors import CommandRefused, RobotNotReady, YumiError
from abb_protocols.robot.joints import Joints, Side
from abb_protocols.rws.values import ControllerState
from abb_runtime.faults import Fault
from refusals import refused
from system.test_endpoint_in_virtual_time import Driver
from system.virtual_time_bench import System
from yumi.api.attach import attach
from yumi.api.connect import controllers_for, settings_for
from yumi.api.connection import Connection
from yumi.driver import wiring
from yumi.driver.gripper_setup import GripperSetup
from yumi.driver.robot_manager import RobotManager
from yumi.driver.speed_setting import FIRST_SPEED_SCALE
from yumi.driver.state_machine import RUN_RAPID_SIGNAL, START_JOINT_SIGNAL, WATCHDOG_MODULE
from yumi.driver.wiring import is_real

STEPS = ("switch the motors on", "move the program pointers to main", "start the RAPID program")
CREEP = 1e-4  # [rad] of the virtual robot under loads


class RealRobot(System):
    """A virtual robot that a driver takes for a real one, with the grippers' set-up.

    Attributes:
        complaints: of the set-up.
    """

    def __init__(self) -> None:
        super().__init__()
        self.complaints: list[Message] = []
        manager = self.manager
        manager.is_real = lambda: True
        setup = GripperSetup(
            self.grippers, manager.step, self.complaints.append, is_named=lambda: manager.may_calibrate
        )
        manager.when_ready(setup.run)

    @property
    def are_calibrated(self) -> list[bool]:
        return [gripper.is_calibrated() for gripper in self.grippers.values()]

    @property
    def measured(self) -> dict[Side, Joints]:
        return {side: self.control.snapshot(side).position for side in Side}


@pytest.fixture
def robot() -> RealRobot:
    return RealRobot()


@pytest.mark.parametrize(
    ("address", "given", "expected"),
    [
        ("192.168.125.1", None, False),
        ("192.168.125.1", True, True),
        ("192.168.125.1", False, False),
        ("127.0.0.1", None, True),
        ("127.0.0.1", False, False),
    ],
)
def test_real_robot_is_brought_up_only_where_that_is_named(address: str, given: bool | None, expected: bool) -> None:
    settings = settings_for(address, bringup=given)
    assert settings.robot.is_on_this_machine is (address == "127.0.0.1")
    assert settings.ros.brings_up(is_real=not settings.robot.is_on_this_machine) is expected


def test_robot_that_is_not_ready_is_left_as_it_is_where_bringup_is_not_named(robot: RealRobot) -> None:
    before = len(robot.client.events())
    with (
        refused(RobotNotReady, "bring_up_not_named", steps=STEPS),
        robot.manager.starting(brings_up=False),
    ):
        robot.manager.make_ready()
    assert (robot.steps, len(robot.client.events())) == ([], before)
    assert robot.client.controller_state() is ControllerState.MOTORS_OFF


def test_refused_start_leaves_the_watchdog_of_another_driver_armed(robot: RealRobot) -> None:
    robot.client.set_symbol("T_ROB_R", "TRobWatchdog", "active", "TRUE")
    with refused(RobotNotReady, "bring_up_not_named", steps=STEPS), robot.manager.starting(brings_up=False):
        robot.manager.make_ready()
    assert robot.client.symbol("T_ROB_R", "TRobWatchdog", "active") == "TRUE"


@pytest.mark.parametrize(
    ("is_here", "takes_faults", "answers", "expected"),
    [
        (True, True, True, False),
        (True, False, True, True),  # a tunnel begins here
        (True, False, False, True),
        (False, True, True, True),
    ],
)
def test_robot_is_real_unless_it_is_known_to_be_virtual_and_on_this_machine(
    monkeypatch: pytest.MonkeyPatch, is_here: bool, takes_faults: bool, answers: bool, expected: bool
) -> None:
    """A real one gets no more requests a second than any other."""
    system, lifted = System(), []
    system.client.connect()
    system.http.is_there = answers
    monkeypatch.setattr(wiring, "takes_faults", lambda address: takes_faults)
    monkeypatch.setattr(system.client, "lift_rate_limit", lambda: lifted.append(True))
    assert is_real(system.client, is_here=is_here) is expected
    assert lifted == [True] * (not expected)


def test_robot_is_taken_for_real_once_another_controller_answers_at_its_address(
    robot: RealRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    kinds = {"takes_faults": True}
    monkeypatch.setattr(wiring, "takes_faults", lambda address: kinds["takes_faults"])
    robot.manager.is_real = partial(is_real, robot.client, is_here=True)
    robot.manager.start_egm()
    assert robot.are_calibrated == [True, True]
    robot.manager.stop_egm()
    robot.manager.write_signal(RUN_RAPID_SIGNAL, 0)
    sessions = robot.manager.session_count
    kinds["takes_faults"] = False
    robot.adapter.expire_sessions()
    robot.faults.inject(Fault.GRIPPER_NOT_CALIBRATED)
    robot.wait(0.5)
    robot.manager.recover(lambda step: None)
    assert robot.are_calibrated == [False, False]
    with refused(CommandRefused, "rapid_signal_not_written"):
        robot.manager.write_signal(RUN_RAPID_SIGNAL, 0)
    assert robot.manager.session_count > sessions
    assert robot.manager.speed.value == FIRST_SPEED_SCALE


@pytest.mark.parametrize(("begins_as_real", "speed"), [(False, FIRST_SPEED_SCALE), (True, 1.0)])
def test_real_robot_begins_slowly_where_a_virtual_one_was_expected(begins_as_real: bool, speed: float) -> None:
    """As behind a tunnel; where the speed is named, or begins slowly, it is left as it is."""
    system = System()
    manager = RobotManager(system.bringup, system.control, system, is_real=lambda: True, begins_as_real=begins_as_real)
    with manager.starting(brings_up=True):
        manager.start_egm()
    assert manager.speed.value == speed


def test_robot_that_is_ready_gets_egm_alone_where_bringup_is_not_named(robot: RealRobot) -> None:
    robot.bringup.make_ready()
    robot.steps.clear()
    with robot.manager.starting(brings_up=False):
        robot.manager.make_ready()
        robot.manager.start_egm()
    assert robot.steps[0] == "start EGM on both arms"
    assert robot.are_calibrated == [False, False]


def test_fingers_close_only_in_a_bringup_that_is_named(robot: RealRobot) -> None:
    robot.manager.start_egm()
    robot.manager.stop_egm()
    robot.manager.recover(lambda step: None)
    assert robot.are_calibrated == [False, False]
    assert {said.values["reason"].code for said in robot.complaints} == {"calibration_not_named"}
    with robot.manager.starting(brings_up=True):
        robot.manager.make_ready()
    assert robot.are_calibrated == [True, True]


def test_arms_stand_through_start_recovery_and_end_of_egm(robot: RealRobot) -> None:
    robot.manager.start_egm()
    still = robot.measured
    robot.wait(0.5)
    robot.manager.stop_egm()
    robot.manager.recover(lambda step: None)
    robot.manager.start_egm()
    robot.wait(0.5)
    robot.manager.end_motion()
    robot.wait(0.5)
    for side, position in robot.measured.items():
        assert position == pytest.approx(still[side], abs=CREEP)


@pytest.fixture
def driver(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Driver]:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    driver = Driver(are_calibrated=True)
    driver.client.connect()
    driver.server.start()
    yield driver
    driver.server.stop()
    with suppress(YumiError):
        driver.client.close()


def test_attaching_and_detaching_changes_nothing(driver: Driver) -> None:
    events = len(driver.client.events())
    with attach() as attached:
        assert attached.state.arms["right"].command.who == "none"
    assert driver.client.controller_state() is ControllerState.MOTORS_OFF
    driver.start_egm()
    still = {side: driver.snapshot(side).sent for side in Side}
    events = len(driver.client.events())
    with attach() as attached:
        assert attached.state.arms["right"].command.who == "none"
        driver.wait(0.2)
    driver.wait(0.5)
    assert len(driver.client.events()) == events
    assert {side: driver.snapshot(side).sent for side in Side} == still


class ConnectionInMemory(Connection):
    """The connection of a script to a robot in memory, whose parts are there already."""

    def __init__(self, driver: Driver) -> None:
        settings = settings_for("127.0.0.1", bringup=False)
        super().__init__(settings, controllers_for(settings, 0.5, 0.5), tuple(Side))
        self._driver = driver

    def _start(self, stack: ExitStack) -> None:
        self.manager, self.grippers, self.executor = self._driver.manager, self._driver.grippers, self._driver.mover
        self._gripper_setup = GripperSetup(self.grippers, self.manager.step, lambda said: None)
        stack.callback(self.manager.stop)


def test_refused_connect_ends_neither_the_egm_nor_the_watchdog_of_another_program(driver: Driver) -> None:
    driver.manager.make_ready()
    driver.client.pulse_signal(START_JOINT_SIGNAL)
    driver.wait(1.0)
    assert all(driver.snapshot(side).is_running for side in Side)
    for side in Side:
        driver.client.set_symbol(side.task, WATCHDOG_MODULE, "active", "TRUE")
    done = list(driver.steps)
    with refused(RobotNotReady, "bring_up_not_named"):
        ConnectionInMemory(driver).open()
    driver.wait(0.5)
    assert driver.steps == done
    assert all(driver.snapshot(side).is_running for side in Side)
    for side in Side:
        assert driver.client.symbol(side.task, WATCHDOG_MODULE, "active") == "TRUE"
