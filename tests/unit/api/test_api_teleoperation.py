"""Teleoperation over the local endpoint: one device at a time, and the end of its connection."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from abb_protocols.errors import CommandRefused
from abb_protocols.robot.gripper_values import GripDirection, grip
from abb_protocols.robot.joints import Side
from fake_driver import WAIT, FakeDriver
from refusals import refused
from yumi.api.attach import RunningDriver, attach
from yumi.control.loop_commands import ControllerCommand
from yumi.control.tool_goal import ToolGoal
from yumi.control.trajectory_commands import CancelTrajectory
from yumi.driver.controller_names import CARTESIAN_CONTROLLER
from yumi.driver.device_frame import DeviceFrame, DeviceHand, TeleoperatedArmReport
from yumi.driver.motion_commands import Teleoperate
from yumi.driver.teleoperated_arm import DEVICE_LINK_LOST
from yumi.driver.teleoperation import Teleoperation


@pytest.fixture
def driver(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[FakeDriver]:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    driver = FakeDriver()
    driver.robot.control.on_command = driver.robot.rest
    driver.server.start()
    yield driver
    driver.server.stop()


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """The driver takes no link for lost by its own clock."""
    monkeypatch.setattr(Teleoperation, "lasts", lambda teleoperation: 60.0)


class Device:
    """A device whose frames come a sixtieth of a second after each other, on the driver's clock."""

    def __init__(self, driver: FakeDriver, attached: RunningDriver) -> None:
        self._driver, self._attached = driver, attached

    def send(self, x: float = 0.0, gripper: float | None = None, *, clutch: bool = True) -> TeleoperatedArmReport:
        self._driver.robot.clock.advance(1.0 / 60.0)
        hand = DeviceHand(clutch=clutch, pose=(x, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0), gripper=gripper)
        frame = DeviceFrame(time=self._driver.robot.clock.now(), right=hand)
        return self._attached.call(Teleoperate(frame=frame)).right

    def engage(self) -> None:
        assert self.send(clutch=False).clutch == "released"
        self.until(lambda: self.send(gripper=0.0).clutch == "engaged")

    @staticmethod
    def until(is_so: Callable[[], bool]) -> None:
        deadline = threading.Event()
        for _ in range(500):
            if is_so():
                return
            deadline.wait(0.005)
        raise AssertionError


def newest(driver: FakeDriver) -> ToolGoal:
    written = driver.robot.tool_goals[Side.RIGHT].read()
    assert written is not None
    goal: ToolGoal = written[1]
    return goal


def brakes(driver: FakeDriver) -> list[ControllerCommand]:
    return [each for each in driver.robot.control.commands if isinstance(each.message, CancelTrajectory)]


@pytest.mark.usefixtures("patient")
def test_frames_become_goals_of_the_cartesian_controller(driver: FakeDriver) -> None:
    with attach() as attached:
        device = Device(driver, attached)
        device.engage()
        assert len(driver.changes) == 1  # of its controllers
        begin = newest(driver).pose
        for _ in range(60):
            device.send(0.1)
        assert newest(driver).pose[0] - begin[0] == pytest.approx(0.1, abs=1e-3)
        assert newest(driver).pose[1:] == pytest.approx(begin[1:])
        assert [each.activate for each in driver.robot.control.switches][-1] == (CARTESIAN_CONTROLLER,)
        assert device.send(clutch=False).clutch == "released"
        activation = driver.robot.control.snapshot(Side.RIGHT).activation
        assert brakes(driver) == [ControllerCommand(Side.RIGHT, CARTESIAN_CONTROLLER, CancelTrajectory(), activation)]


@pytest.mark.usefixtures("patient")
def test_second_device_is_refused_while_one_operates(driver: FakeDriver) -> None:
    with attach() as first, attach() as second:
        Device(driver, first).engage()
        with refused(CommandRefused, "teleoperated_by_another"):
            Device(driver, second).send()
        assert Device(driver, first).send().clutch == "engaged"


@pytest.mark.usefixtures("patient")
def test_arm_brakes_when_the_connection_of_its_device_ends(driver: FakeDriver) -> None:
    with attach() as attached:
        Device(driver, attached).engage()
        assert brakes(driver) == []
    Device.until(lambda: len(brakes(driver)) == 1)


@pytest.mark.usefixtures("patient")
def test_arm_brakes_when_no_frame_comes_any_more(driver: FakeDriver, monkeypatch: pytest.MonkeyPatch) -> None:
    with attach() as attached:
        device = Device(driver, attached)
        device.engage()
        monkeypatch.setattr(Teleoperation, "lasts", lambda teleoperation: DEVICE_LINK_LOST)
        device.send()
        Device.until(lambda: len(brakes(driver)) == 1)
        report = device.send()
        assert report.clutch == "inert"
        assert report.why is not None
        assert report.why.code == "teleoperation_link_lost"


@pytest.mark.usefixtures("patient")
def test_gripper_gets_its_goal_while_frames_go_on(driver: FakeDriver) -> None:
    gripper, waits = driver.grippers[Side.RIGHT], threading.Event()

    def wait() -> None:
        assert waits.wait(WAIT)

    gripper.on_begin = wait
    with attach() as attached:
        device = Device(driver, attached)
        device.engage()
        for value in (0.5, 0.8, 1.0):
            assert device.send(gripper=value).clutch == "engaged"  # although the first goal is not taken yet
        waits.set()
        Device.until(lambda: len(gripper.goals) == 2)
    assert gripper.goals[-1] == grip(GripDirection.INWARDS, 10.0)
