"""Whatever two hands and their link do, at random: no command is beyond the limits, and nothing moves by itself."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from abb_protocols.robot.joints import Side
from abb_protocols.robot.kinematics import quaternion_of
from cartesian_bench import shares
from soak import HAND_OVERS, SEED, long, short, tell
from system.teleoperation_bench import (
    LEFT_START,
    RATE,
    RELEASED,
    RIGHT,
    START,
    WITHIN,
    Operator,
    driver_in_egm,
    operator_of,
)
from system.test_endpoint_in_virtual_time import Driver
from yumi.driver.device_frame import DeviceHand, DeviceSettings
from yumi.driver.teleoperated_arm import DEVICE_LINK_LOST

STILL = 0.3  # [s] after which an arm that was let go stands


class Hand:
    """A hand that does at random what hands do: it takes hold, moves, stands, jumps and lets go.

    Attributes:
        frame: what the device reports of it now.
    """

    def __init__(self, generator: np.random.Generator) -> None:
        self._random = generator
        self._place, self._velocity, self._way = np.zeros(3), np.zeros(3), np.zeros(3)
        self._kind = "pose"
        self.frame = RELEASED

    def act(self, what: str) -> None:
        if what == "press" and not self.frame.clutch:
            self._kind = str(self._random.choice(["pose", "pose", "pose", "twist", "joints"]))
            self._place, self._velocity = self._random.uniform(-1.0, 1.0, 3), np.zeros(3)
            self.move(0.0)
        elif what == "release":
            self.frame = RELEASED
        elif what == "jump" and self.frame.clutch:
            self._place = self._place + 1.0
            self.move(0.0)

    def move(self, dt: float) -> None:
        """Go on with the clutch held, by not too far from where the arm was at first."""
        self._velocity = 0.9 * self._velocity + self._random.normal(size=3) * 0.04 - 0.2 * self._way
        self._way = self._way + dt * self._velocity
        self._place = self._place + dt * self._velocity
        (x, y, z), (u, v, w) = self._place.tolist(), self._velocity.tolist()
        if self._kind == "pose":
            turn = quaternion_of((0.5 * x, 0.5 * y, 0.5 * z))
            self.frame = DeviceHand(clutch=True, pose=(x, y, z, *turn), elbow=0.3 * x, gripper=min(1.0, abs(x)))
        elif self._kind == "twist":
            self.frame = DeviceHand(clutch=True, twist=(u, v, w, 0.5 * w, 0.5 * u, 0.5 * v), elbow=0.3 * v)
        else:
            self.frame = DeviceHand(clutch=True, joints=(x, y, z, x, y, z, x))


class RandomTeleoperation:
    """Both hands, and a link that delays, reorders and loses what they send.

    Attributes:
        engaged: frames for which an arm followed.
    """

    def __init__(self, driver: Driver, operator: Operator, generator: np.random.Generator) -> None:
        self._driver, self._operator, self._random = driver, operator, generator
        self._hands = {side: Hand(generator) for side in Side}
        self._late: list[tuple[float, DeviceHand, DeviceHand]] = []
        self.engaged = 0

    def run(self) -> None:
        """A sequence of what happens, and both hands let go at its end."""
        self._operator.settings = DeviceSettings(
            cutoff=float(self._random.choice([0.0, 2.0, 10.0])), scale=float(self._random.uniform(0.2, 1.0)), speed=0.3
        )
        for _ in range(12):
            for hand in self._hands.values():
                held = ["stay"] * 7 + ["release"] * 5 + ["jump"]
                hand.act(str(self._random.choice(held if hand.frame.clutch else ["stay"] + ["press"] * 4)))
            silence = float(self._random.choice([0.0] * 14 + [0.1, 0.15, DEVICE_LINK_LOST + 0.1]))
            self._send_for(float(self._random.uniform(0.1, 0.7)), silence, is_mixed=bool(self._random.uniform() < 0.3))
        for hand in self._hands.values():
            hand.act("release")
        self._send_for(DEVICE_LINK_LOST + STILL, 0.0, is_mixed=False)

    def _send_for(self, seconds: float, silence: float, *, is_mixed: bool) -> None:
        """Move the hands; nothing of it arrives for ``silence`` [s], then all at once, perhaps in another order."""
        begin = self._driver.now()
        while (time := self._driver.now()) - begin < max(seconds, silence):
            for hand in self._hands.values():
                if hand.frame.clutch:
                    hand.move(1.0 / RATE)
            self._late.append((time, self._hands[RIGHT].frame, self._hands[Side.LEFT].frame))
            if time - begin >= silence:
                order = self._random.permutation(len(self._late)) if is_mixed else range(len(self._late))
                for each in order:
                    made_at, right, left = self._late[int(each)]
                    self._operator.send(right, made_at, left=left)
                self._late.clear()
                self.engaged += sum(arm.clutch == "engaged" for arm in self._operator.report.arms.values())
            self._driver.wait(1.0 / RATE)


@pytest.fixture
def driver(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Driver]:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with driver_in_egm() as driver:
        yield driver


@pytest.fixture
def operator(driver: Driver) -> Iterator[Operator]:
    with operator_of(driver) as operator:
        yield operator


@pytest.mark.parametrize("count", [short(3), long(HAND_OVERS, 7200.0)])
def test_no_command_is_beyond_the_limits_and_nothing_moves_without_a_clutch(
    driver: Driver, operator: Operator, count: int
) -> None:
    teleoperation = RandomTeleoperation(driver, operator, np.random.default_rng((34, SEED)))
    worst = np.zeros(3)
    for number in range(1, 1 + count):
        teleoperation.run()
        assert all(driver.snapshot(side).is_running for side in Side), driver.world.controller.events
        still = {side: driver.snapshot(side).sent for side in Side}
        operator.hold(0.5, lambda time: RELEASED)
        for side in Side:
            assert driver.snapshot(side).sent == pytest.approx(still[side], abs=1e-9), (number, side)
            sent = np.array(driver.arms[side].admitted)
            worst = np.maximum(worst, shares(sent))
            del driver.arms[side].admitted[:-5]
        assert worst.max() <= max(WITHIN), number
        driver.hand_over.give_back(tuple(Side))
        driver.mover.move({RIGHT: START, Side.LEFT: LEFT_START}, 1.0, None)
        driver.until(lambda: not any(driver.mover.is_moving(side) for side in Side), 10.0)
        if count > 3 and number % 10 == 0:
            tell(f"{number} sequences: engaged for {teleoperation.engaged / RATE:.0f} s; shares of the limits {worst}")
    assert teleoperation.engaged > 100 * count
