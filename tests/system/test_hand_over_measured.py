"""Twenty times from a program to a person and back, on both arms of a whole driver, in real time."""

from __future__ import annotations

import asyncio
import time
from collections import Counter
from collections.abc import Callable
from math import sin
from pathlib import Path
from threading import Event as Flag
from threading import Thread

import numpy as np
import pytest

import yumi
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import CYCLE, Joints, joints
from cartesian_bench import shares
from soak import long, short, tell
from system.test_teleoperation_measured import RATE, recorded_driver
from yumi.api.attach import RunningDriver
from yumi.control.flight_recorder import RecordedCycle
from yumi.driver.command import ArmName
from yumi.driver.device_frame import DeviceFrame, DeviceHand, DeviceSettings, TeleoperationReport
from yumi.driver.motion_commands import Jog, Teleoperate
from yumi.driver.reports import CommandingReport
from yumi.recording.message_types import EVENTS_TOPIC
from yumi.recording.reader import recorded_messages
from yumi.web.driver_link import DriverLink

ARMS: tuple[ArmName, ...] = ("right", "left")
WITHIN = 1.0 + 1e-4  # of the limits: a recording has rounded times


def wrist(speed: float) -> Joints:
    """Speeds of a wrist that turns [rad/s]."""
    return joints([0.0] * 6 + [speed])


class Policy:
    """A program that turns both wrists back and forth whenever it may, over a connection of its own.

    Attributes:
        refusals: how often it was refused, by the code.
    """

    def __init__(self) -> None:
        self.refusals: Counter[str] = Counter()
        self._is_over = Flag()
        self._thread = Thread(target=self._run)

    def __enter__(self) -> Policy:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._is_over.set()
        self._thread.join()

    def _run(self) -> None:
        with yumi.attach() as driver:
            while not self._is_over.wait(0.02):
                for arm in ARMS:
                    try:
                        driver.jog(arm, wrist(0.3 * sin(3.0 * time.monotonic())))
                    except CommandRefused as error:
                        self.refusals[error.said.code] += 1


def commanding(driver: RunningDriver) -> list[CommandingReport]:
    arms = driver.state.arms
    return [arms[arm].command for arm in ARMS]


def wait_for(driver: RunningDriver, who: str, *, act: Callable[[], object] = lambda: time.sleep(0.02)) -> None:
    """Until ``who`` commands both arms."""
    end = time.monotonic() + 10.0
    while {each.who for each in commanding(driver)} != {who}:
        assert time.monotonic() < end, commanding(driver)
        act()


def sent(driver: RunningDriver) -> list[Joints]:
    """Where both arms are sent; nothing is known while a busy machine has had no time for their datagrams."""
    end = time.monotonic() + 2.0
    while True:
        positions = [driver.state.arms[arm].sent for arm in ARMS]
        known = [each for each in positions if each is not None]
        if len(known) == len(positions):
            return known
        assert time.monotonic() < end, driver.state.arms
        time.sleep(0.004)


def at_rest(driver: RunningDriver) -> list[Joints]:
    """What both arms are sent, once it is the same for a while; how soon: ``test_teleoperation_measured``."""
    end, seen = time.monotonic() + 2.0, [sent(driver)]
    while len(seen) < 11 or any(each != seen[-1] for each in seen[-11:]):
        assert time.monotonic() < end, "an arm does not come to rest"
        time.sleep(0.02)
        seen.append(sent(driver))
    return seen[-1]


def teleoperate(driver: RunningDriver, turn: float = 0.2) -> None:
    """Take both arms with a device, turn the hands a little [rad/s], and let go."""

    def send(*, clutch: bool, turn: float = 0.0) -> TeleoperationReport:
        time.sleep(1.0 / RATE)
        hand = DeviceHand(clutch=clutch, twist=(0.0, 0.0, 0.0, 0.0, 0.0, turn))
        frame = DeviceFrame(time=time.monotonic(), right=hand, left=hand, settings=DeviceSettings(cutoff=0.0))
        return driver.call(Teleoperate(frame=frame))

    def press() -> None:
        """And again, where a busy machine had no time for frames: a link that was lost makes the clutch inert."""
        if "inert" in {arm.clutch for arm in send(clutch=True).arms.values()}:
            send(clutch=False)

    send(clutch=False)
    wait_for(driver, "device", act=press)
    for _ in range(30):
        send(clutch=True, turn=turn)
    send(clutch=False)


async def jog_at_the_page() -> None:
    link = await DriverLink.open(is_page=True)
    try:
        for _ in range(30):
            for arm in ARMS:
                await link.ask(Jog(arm=arm, speeds=wrist(0.2)))
            await asyncio.sleep(0.02)
    finally:
        await link.close()


@pytest.mark.alone
@pytest.mark.parametrize("times", [short(4, pytest.mark.real_time, pytest.mark.timeout(90)), long(20, 300.0)])
def test_no_take_over_of_both_arms_steps_and_none_resumes_by_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, times: int
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    record = tmp_path / "take_overs.mcap"
    with recorded_driver(tmp_path, record) as driver, Policy() as policy:
        for number in range(times):
            wait_for(driver, "stream")
            time.sleep(0.3)
            if number % 2:
                asyncio.run(jog_at_the_page())
            else:
                teleoperate(driver)
            wait_for(driver, "none")
            assert all(each.is_reserved for each in commanding(driver))
            still = at_rest(driver)
            time.sleep(0.3)  # in which a stream, or what a person did before, would go on
            assert sent(driver) == still
            driver.give_back()
    assert policy.refusals["arm_reserved_for_person"] > 10 * times
    values = list(recorded_messages(record))
    kinds = Counter(value.kind for topic, _, value in values if topic == EVENTS_TOPIC)
    assert kinds["CommanderChanged"] >= 2 * 2 * times
    assert kinds["ArmGivenBack"] == 2 * times
    worst = np.zeros(3)
    for topic in ("r/cycle", "l/cycle"):
        for way in unbroken([value for name, _, value in values if name == topic]):
            worst = np.maximum(worst, shares(way))
    tell(f"{times} take-overs of both arms: shares of the limits {worst}")
    assert worst.max() <= WITHIN


def unbroken(cycles: list[RecordedCycle]) -> list[np.ndarray]:
    """What was sent in runs of cycles of which none was missed."""
    runs: list[list[Joints]] = [[]]
    for cycle in cycles:
        if abs(cycle.dt - CYCLE) > 0.1 * CYCLE:
            runs.append([])
        runs[-1].append(cycle.sent)
    return [np.array(run) for run in runs if len(run) > 4]
