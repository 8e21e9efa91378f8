"""Teleoperation with the whole driver and a virtual robot in memory: clutches, losses, bursts, one operator."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from math import radians
from pathlib import Path

import numpy as np
import pytest

from system.test_endpoint_in_virtual_time import Driver
from yumi.control.motion.one_euro import distance_between
from yumi.driver.device_frame import DeviceFrame, DeviceHand, DeviceSettings, TeleoperationReport
from yumi.driver.teleoperation import Teleoperation
from yumi.errors import YumiError
from yumi.robot.description import FINGERTIPS
from yumi.robot.joints import Pose, Side, Vector, named_pose
from yumi.robot.kinematics import compose, multiply, quaternion_of, tool0_to_body

RATE = 60.0  # [Hz] of the device
RIGHT = Side.RIGHT


class Operator:
    """A person with a device: its frames, and what the driver answered last; time goes by between two frames."""

    def __init__(self, driver: Driver, elsewhere: ThreadPoolExecutor) -> None:
        self.driver = driver
        self.settings = DeviceSettings(cutoff=0.0)
        self.report = TeleoperationReport()
        self.teleoperation = Teleoperation(driver.mover, driver.control, {side: Gripper() for side in Side})
        self._elsewhere = elsewhere

    def send(self, time: float | None = None, **hands: DeviceHand) -> None:
        frame = DeviceFrame(time=self.driver.now() if time is None else time, settings=self.settings, **hands)
        frame.check()
        self.report = self.teleoperation.take(frame, self, self._elsewhere.submit)

    def hold(self, seconds: float, hand: Callable[[float], DeviceHand]) -> None:
        """Send frames, with what ``hand`` gives for the right arm for each time since now [s]."""
        begin = self.driver.now()
        while (time := self.driver.now() - begin) < seconds:
            self.send(right=hand(time))
            self.driver.wait(1.0 / RATE)

    def engage(self, hand: DeviceHand) -> None:
        self.hold_until(lambda: self.report.right.clutch == "engaged", hand)

    def hold_until(self, is_so: Callable[[], bool], hand: DeviceHand) -> None:
        """Send the same again and again, also while another thread takes the arm over."""
        for _ in range(1000):
            self.hold(1.0 / RATE, lambda time: hand)
            if is_so():
                return
        raise AssertionError(self.report)

    def release(self) -> None:
        self.hold(0.5, lambda time: DeviceHand())


class Gripper:
    """A gripper that takes no goals."""

    refusal = None

    def take(self, closed: float) -> None:
        raise AssertionError(closed)

    def forget(self) -> None:
        """There is none."""


@pytest.fixture
def driver(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Driver]:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    driver = Driver(are_calibrated=True)
    driver.client.connect()
    driver.start_egm()
    driver.mover.move({side: named_pose(side, "ready") for side in Side}, 1.0, None)
    driver.wait(4.0)
    yield driver
    with suppress(YumiError):
        driver.client.close()


@pytest.fixture
def operator(driver: Driver) -> Iterator[Operator]:
    with ThreadPoolExecutor(2) as elsewhere:
        yield Operator(driver, elsewhere)


def tip(driver: Driver, side: Side = RIGHT) -> Pose:
    """Where the fingertips are sent."""
    return compose(tool0_to_body(side, driver.snapshot(side).sent), FINGERTIPS)


def at(x: float = 0.0, y: float = 0.0, z: float = 0.0, turn: Vector = (0.0, 0.0, 0.0)) -> DeviceHand:
    """The hand, moved from where it is at first, with the clutch held."""
    a, b, c = 0.3, 0.1, 1.2
    return DeviceHand(clutch=True, pose=(a + x, b + y, c + z, *quaternion_of(turn)))


def test_tool_moves_by_what_the_hand_moves(driver: Driver, operator: Operator) -> None:
    before = tip(driver)
    operator.engage(at())
    assert distance_between(before, tip(driver)) < (1e-4, radians(0.1))
    operator.hold(2.0, lambda time: at(0.05, -0.04, 0.03, (0.0, 0.0, 0.2)))
    after = tip(driver)
    assert np.subtract(after.position, before.position) == pytest.approx((0.05, -0.04, 0.03), abs=1e-4)
    way = distance_between(Pose(after.position, multiply(quaternion_of((0.0, 0.0, 0.2)), before.orientation)), after)
    assert way[1] < radians(0.1)
