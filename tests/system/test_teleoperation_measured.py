"""From a device's frame to the robot's datagram, and to standstill after a loss: the whole driver, in real time."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import dist
from pathlib import Path
from statistics import median, quantiles

import pytest

import yumi
from abb_protocols.robot.joints import Side, joints
from abb_protocols.robot.kinematics import tool0_to_body
from abb_runtime.process.command_process import CommandProcess
from abb_runtime.udp import free_port
from soak import long, short, tell
from yumi.api.attach import RunningDriver
from yumi.control.flight_recorder import RecordedCycle
from yumi.driver.device_frame import DeviceFrame, DeviceHand, DeviceSettings, TeleoperationReport
from yumi.driver.motion_commands import Teleoperate
from yumi.driver.teleoperated_arm import DEVICE_LINK_LOST
from yumi.recording.reader import recorded_messages

RATE = 60.0
ROOM = (1.344, -1.222, -1.518, 0.733, -0.471, 0.192, 0.297)
"""From here the right tool goes 9 cm up and down, and no part of the arm comes near to anything [rad]."""
MOVING = 3e-4  # [m/s] of the tool, by the speeds that are sent; the elbow may still go on while the tool stands
FASTEST = 1e-2  # [rad/s] an arm that is slower stands


@contextmanager
def recorded_driver(folder: Path, record: Path | None, *, with_ros: bool = False) -> Iterator[RunningDriver]:
    """A driver with a virtual robot, in processes of their own, that records every cycle, if a file is given."""
    egm = ("--left-egm-port", str(free_port()), "--right-egm-port", str(free_port()))
    with CommandProcess(
        "controller", "yumi", ("controller", "--rws-port", "0", *egm), folder / "controller.log"
    ) as controller:
        host, _, rws = controller.wait_until_ready(60.0).rpartition("/")[2].partition(":")
        recording = () if record is None else ("--record", str(record))
        where = ("--robot", f"{host}:{rws}", *(() if with_ros else ("--no-ros",)), *recording, *egm)
        with CommandProcess("driver", "yumi", ("up", *where), folder / "driver.log") as driver:
            driver.wait_until_ready(60.0)
            with yumi.attach() as attached:
                attached.start_egm()
                attached.move_to(right=ROOM)
                yield attached


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("teleoperation") / "record.mcap"


@pytest.fixture(scope="module")
def driver(record: Path) -> Iterator[RunningDriver]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", str(record.parent))
        with recorded_driver(record.parent, record) as driver:
            yield driver


class Device:
    """A device of the right arm, whose hand is at a height and whose filter is off.

    Attributes:
        height: of the hand [m].
        sent_at: when its newest frame was sent, on the monotonic clock [s].
    """

    def __init__(self, driver: RunningDriver) -> None:
        self._driver = driver
        self.height = self.sent_at = 0.0
        self._due = time.monotonic()

    def send(self, *, clutch: bool = True) -> TeleoperationReport:
        """Send the next frame when it is due."""
        self._due = max(self._due + 1.0 / RATE, time.monotonic())
        time.sleep(max(0.0, self._due - time.monotonic()))
        self.sent_at = time.monotonic()
        hand = DeviceHand(clutch=clutch, pose=(0.0, 0.0, self.height, 1.0, 0.0, 0.0, 0.0))
        frame = DeviceFrame(time=self.sent_at, right=hand, settings=DeviceSettings(cutoff=0.0))
        return self._driver.call(Teleoperate(frame=frame))

    def send_for(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.send()

    def send_until(self, is_so: Callable[[TeleoperationReport], bool]) -> None:
        end = time.monotonic() + 10.0
        while not is_so(report := self.send()):
            assert time.monotonic() < end, report

    def engage(self) -> None:
        self.send(clutch=False)
        self.send_until(lambda report: report.right.clutch == "engaged")


@pytest.mark.alone
@pytest.mark.parametrize("steps", [short(8, pytest.mark.real_time, pytest.mark.timeout(60)), long(40, 180.0)])
def test_motion_of_a_hand_is_in_a_datagram_within_thirty_milliseconds(
    driver: RunningDriver, record: Path, steps: int
) -> None:
    device, moved_at = Device(driver), []
    device.engage()
    for step in range(steps):
        device.send_for(0.8 + 0.0037 * step)  # the arm stands, and the robot's cycle is anywhere
        device.height += 0.01 if step % 2 else -0.01
        device.send()
        moved_at.append(device.sent_at)
    device.send_for(0.2)
    device.send(clutch=False)
    check_delays("a frame", right_cycles(record, moved_at[0], moved_at[-1]), moved_at)


def check_delays(what: str, cycles: list[RecordedCycle], moved_at: list[float]) -> None:
    """Tell how long it took from times [s] until the first datagrams that move the arm, and whether that is soon."""
    delays = [first_motion(cycles, moved) for moved in moved_at]
    p95 = quantiles(delays, n=20, method="inclusive")[-1]
    tell(f"From {what} to the first datagram that moves: median {1e3 * median(delays):.1f} ms, p95 {1e3 * p95:.1f} ms.")
    assert p95 < 0.030


@pytest.mark.alone
@pytest.mark.parametrize("times", [short(1, pytest.mark.real_time, pytest.mark.timeout(60)), long(5, 180.0)])
def test_arm_of_a_device_that_falls_silent_or_is_gone_stands_soon(
    driver: RunningDriver, record: Path, times: int
) -> None:
    lost_at = []
    for is_gone in (False, True) * times:
        time.sleep(1.0)  # until another device may operate
        driver.give_back()
        driver.move_to(right=ROOM)
        with yumi.attach() as attached:
            device = Device(attached)
            device.engage()
            device.send_for(0.2)
            for _ in range(15):
                device.height += 0.002
                device.send()
            lost_at.append(device.sent_at)
            if not is_gone:
                time.sleep(DEVICE_LINK_LOST + 0.3)
                assert device.send().right.clutch == "inert"
    cycles = right_cycles(record, lost_at[0], lost_at[-1])
    stops = [standstill(cycles, lost) for lost in lost_at]
    tell(f"From the last frame to standstill: median {1e3 * median(stops):.0f} ms, at most {1e3 * max(stops):.0f} ms.")
    assert max(stops) < DEVICE_LINK_LOST + 0.2


def right_cycles(record: Path, begin: float, end: float) -> list[RecordedCycle]:
    """The right arm's cycles around two times [s] in a recording that goes on: what it writes comes in pieces."""
    last = time.monotonic() + 10.0
    while True:
        cycles = [value for topic, _, value in recorded_messages(record) if topic == "r/cycle"]
        if cycles[-1].time > end + 1.0:
            return [cycle for cycle in cycles if begin - 1.0 < cycle.time < end + 1.0]
        assert time.monotonic() < last, "the recording ends too early"
        time.sleep(0.5)


def first_motion(cycles: list[RecordedCycle], moved: float) -> float:
    """How long after a frame the first datagram left that moves the arm [s]."""
    near = [cycle for cycle in cycles if moved - 0.05 < cycle.time < moved + 0.5]
    moving = [cycle.time for cycle in near if _sent_tool_speed(cycle) > MOVING]
    assert min(moving) > moved, "the tool did not stand before"
    return min(moving) - moved


def _sent_tool_speed(cycle: RecordedCycle) -> float:
    """How fast the tool is sent [m/s]."""
    dt = 1e-3
    later = joints([at + dt * speed for at, speed in zip(cycle.sent, cycle.sent_velocity, strict=True)])
    return dist(*(tool0_to_body(Side.RIGHT, at).position for at in (cycle.sent, later))) / dt


def standstill(cycles: list[RecordedCycle], lost: float) -> float:
    """How long after ``lost`` the arm still moved [s]."""
    after = [cycle for cycle in cycles if lost - 0.05 < cycle.time < lost + 0.8]
    moving = [cycle.time for cycle in after if max(map(abs, cycle.velocity)) > FASTEST]
    assert moving, "the arm was not moved"
    return moving[-1] - lost
