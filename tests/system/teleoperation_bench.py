"""A person with a device who teleoperates a driver and a virtual robot in memory; time goes by between two frames."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from math import radians

import pytest

from abb_protocols.errors import YumiError
from abb_protocols.robot.joints import Side, Vector
from abb_protocols.robot.kinematics import quaternion_of
from cartesian_bench import Shares
from system.test_endpoint_in_virtual_time import Driver
from unit.robot.test_robot_kinematics import rad
from yumi.driver.device_frame import DeviceFrame, DeviceHand, DeviceSettings, TeleoperationReport
from yumi.driver.teleoperation import Teleoperation

RATE = 60.0  # [Hz] of the device
RIGHT = Side.RIGHT
START = rad((20, -90, -110, 10, 30, 60, 10))  # of the right arm, away from the body
LEFT_START = rad((-20, -90, 110, 10, -30, 60, -10))
HAND: Vector = (0.3, 0.1, 1.2)  # where it is at first
WITHIN = Shares(*[1.0 + 1e-5] * 3)  # the last digits of differences
RELEASED = DeviceHand()
EXACT = (1e-4, radians(0.1))  # 0.1 mm, 0.1 degrees


class Fingers:
    """A gripper's goals, taken in no time."""

    def __init__(self) -> None:
        self.goals: list[float] = []
        self.refusal = None

    def take(self, closed: float) -> None:
        self.goals.append(closed)

    def forget(self) -> None:
        """Nothing waits."""


class Operator:
    """A person with a device, and what the driver answered last; time goes by between two frames."""

    def __init__(self, driver: Driver, elsewhere: ThreadPoolExecutor) -> None:
        self.driver = driver
        self.settings = DeviceSettings(cutoff=0.0)
        self.report = TeleoperationReport()
        self.fingers = {side: Fingers() for side in Side}
        self.teleoperation = Teleoperation(driver.mover, driver.control, self.fingers)  # type: ignore[arg-type]
        self._elsewhere = elsewhere
        self._pending: set[Future[None]] = set()

    def send(
        self,
        hand: DeviceHand,
        time: float | None = None,
        *,
        left: DeviceHand = RELEASED,
        who: object = None,
        seen: float | None = None,
    ) -> None:
        """A frame of the right hand, made at ``time`` [s], else now; the device had ``seen`` a time by then."""
        made_at = self.driver.now() if time is None else time
        frame = DeviceFrame(time=made_at, seen=seen, right=hand, left=left, settings=self.settings)
        frame.check()
        self.report = self.teleoperation.take(frame, who or self, self._begin)
        if self._pending:  # else time goes by here faster than there
            self._pending = wait(self._pending, 0.003).not_done

    def _begin(self, work: Callable[[], None]) -> None:
        self._pending.add(self._elsewhere.submit(work))

    def hold(self, seconds: float, hand: Callable[[float], DeviceHand], rate: float = RATE) -> None:
        """Send frames, with what ``hand`` gives for each time since now [s]."""
        begin = self.driver.now()
        while (time := self.driver.now() - begin) < seconds:
            self.send(hand(time))
            self.driver.wait(1.0 / rate)

    def engage(self, hand: DeviceHand) -> None:
        """Press the clutch until the arm follows; another thread takes it over meanwhile."""
        self.release(1.0 / RATE)
        for _ in range(1000):
            self.hold(1.0 / RATE, lambda time: hand)
            if self.clutch == "engaged":
                return
        raise AssertionError(self.report)

    def release(self, seconds: float = 0.5) -> None:
        self.hold(seconds, lambda time: DeviceHand())

    @property
    def is_taking_over(self) -> bool:
        """Whether another thread takes an arm over, which lasts longer there than here."""
        return not all(work.done() for work in self._pending)

    @property
    def clutch(self) -> str:
        return self.report.right.clutch

    @property
    def why(self) -> str:
        """The code of why it is inert."""
        return "" if self.report.right.why is None else self.report.right.why.code


def at(x: float = 0.0, y: float = 0.0, z: float = 0.0, turn: Vector = (0.0, 0.0, 0.0)) -> DeviceHand:
    """The hand, moved from where it is at first, with the clutch held."""
    a, b, c = HAND
    return DeviceHand(clutch=True, pose=(a + x, b + y, c + z, *quaternion_of(turn)))


@contextmanager
def driver_in_egm() -> Iterator[Driver]:
    """A driver whose arms stand away from the body, with EGM on both."""
    driver = Driver(are_calibrated=True)
    driver.client.connect()
    for side, start in ((RIGHT, START), (Side.LEFT, LEFT_START)):
        driver.world.arms[side].strike(start)  # it stands there from the beginning
    driver.start_egm()
    driver.mover.move({RIGHT: START, Side.LEFT: LEFT_START}, 1.0, None)
    driver.wait(0.2)
    assert driver.snapshot(RIGHT).sent == pytest.approx(START, abs=1e-9)
    for arm in driver.arms.values():
        arm.admitted.clear()
    yield driver
    with suppress(YumiError):
        driver.client.close()


@contextmanager
def operator_of(driver: Driver) -> Iterator[Operator]:
    """A person with a device of this driver."""
    with ThreadPoolExecutor(2) as elsewhere:
        yield Operator(driver, elsewhere)
