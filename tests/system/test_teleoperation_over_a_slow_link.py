"""Teleoperation over a link that is slow both ways, in virtual time: no arm moves by a frame that is too old."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from math import inf, sin
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from abb_protocols.robot.joints import CYCLE, Side
from soak import long, short
from system.teleoperation_bench import RATE, RELEASED, RIGHT, Operator, at, driver_in_egm, operator_of
from system.test_endpoint_in_virtual_time import Driver
from yumi.driver.device_frame import DeviceHand
from yumi.driver.teleoperated_arm import DEVICE_LINK_LOST
from yumi.web.live import PAGE_STATE_RATE as STATES

STANDS = 0.2  # [s] after the link counts as lost the arm stands
FASTEST = 1e-2  # [rad/s] an arm that is slower stands, as at the end of a jog
AHEAD, RUNS = 731.5, 1.0 + 1e-4  # how the device's clock goes


class Sent(NamedTuple):
    """A message on its way: when it arrives, when it was made, and the frame's ``seen`` and hand."""

    arrives: float
    made: float
    seen: float = 0.0
    hand: DeviceHand = RELEASED


class Page:
    """A page on another machine: states come late, frames go late, in order, as over TCP.

    Attributes:
        delay: of each message, one way [s].
        jitter: the most that is added to it [s].
        ages: how old each frame was by which an arm was moved [s].
        is_cut: whether what is sent gets lost.
    """

    def __init__(self, driver: Driver, operator: Operator, generator: np.random.Generator) -> None:
        self.delay, self.jitter, self.is_cut = 0.0, 0.0, False
        self.ages: list[float] = []
        self._driver, self._operator, self._random = driver, operator, generator
        self._states, self._frames = deque[Sent](), deque[Sent]()
        self._next_state = self._next_frame = 0.0
        self._seen, self._taken = -inf, 0.0  # the newest state's time, and when the frame was made that is taken now
        follow = driver.mover.follow_device

        def noted(side: Side, *goal: Any) -> None:
            self.ages.append(driver.now() - self._taken)
            follow(side, *goal)

        driver.mover.follow_device = noted  # type: ignore[method-assign]

    def hold(self, seconds: float, hand: Callable[[float], DeviceHand]) -> None:
        """Show states and send frames, with what ``hand`` gives for each time since now [s]."""
        begin = self._driver.now()
        while (now := self._driver.now()) - begin < seconds:
            if now >= self._next_state:
                self._next_state = now + 1.0 / STATES
                self._send(self._states, Sent(self._arrival(now), now))
            while self._states and self._states[0].arrives <= now:
                self._seen = self._states.popleft().made
            if now >= self._next_frame and self._seen > -inf:
                self._next_frame = now + 1.0 / RATE
                self._send(self._frames, Sent(self._arrival(now), now, self._seen, hand(now - begin)))
            while self._frames and self._frames[0].arrives <= now:
                frame = self._frames.popleft()
                self._taken = frame.made
                self._operator.send(frame.hand, AHEAD + RUNS * frame.made, seen=frame.seen)
            self._driver.wait(CYCLE)

    def _arrival(self, now: float) -> float:
        return now + self.delay + float(self._random.uniform(0.0, self.jitter))

    def _send(self, way: deque[Sent], message: Sent) -> None:
        if not self.is_cut:
            behind = way[-1].arrives if way else -inf
            way.append(message._replace(arrives=max(message.arrives, behind)))

    def engage(self) -> bool:
        """Press the clutch until the arm follows; whether it does."""
        for _ in range(3):
            self.hold(0.5, lambda time: RELEASED)
            for _ in range(15):
                self.hold(0.1, lambda time: at())
                if self._operator.clutch == "engaged":
                    return True
        return False


@pytest.fixture
def driver(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Driver]:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with driver_in_egm() as driver:
        yield driver


@pytest.fixture
def operator(driver: Driver) -> Iterator[Operator]:
    with operator_of(driver) as operator:
        yield operator


def sway(time: float) -> DeviceHand:
    """A hand that is never still, where the arm has room."""
    return at(0.03 * sin(6.0 * time), 0.02 * sin(5.0 * time))


def standstill(driver: Driver, since: int) -> float:
    """How long after the cycle ``since`` the right arm's command stood [s]."""
    steps = np.abs(np.diff(np.array(driver.arms[RIGHT].admitted)[since:], axis=0)).max(axis=1)
    moving = np.nonzero(steps / CYCLE > FASTEST)[0]
    return 0.0 if not len(moving) else float(moving[-1] + 1) * CYCLE


@pytest.mark.parametrize(("delay", "jitter"), [(0.0, 0.0), (0.02, 0.06), (0.05, 0.03)])
def test_arm_over_a_link_that_is_fast_enough_follows_and_stands_soon_after_a_loss(
    driver: Driver, operator: Operator, delay: float, jitter: float
) -> None:
    page = Page(driver, operator, np.random.default_rng(1))
    page.delay, page.jitter = delay, jitter
    for _ in range(3):
        assert page.engage()
        page.hold(0.7, sway)
        assert operator.clutch == "engaged"
        cut = len(driver.arms[RIGHT].admitted)
        assert standstill(driver, cut - 50) > 0.19  # it moves until then
        page.is_cut = True
        page.hold(DEVICE_LINK_LOST + STANDS + 0.2, sway)
        page.is_cut = False
        assert standstill(driver, cut) < DEVICE_LINK_LOST + STANDS
        still = driver.snapshot(RIGHT).sent
        page.hold(0.5, sway)  # the link is back, and the clutch held still
        assert operator.clutch == "inert"
        assert driver.snapshot(RIGHT).sent == still
    assert delay <= max(page.ages) <= DEVICE_LINK_LOST


@pytest.mark.parametrize(("delay", "jitter"), [(0.1, 0.1), (0.15, 0.0), (0.8, 0.2)])
def test_arm_over_a_link_that_is_too_slow_is_not_moved(
    driver: Driver, operator: Operator, delay: float, jitter: float
) -> None:
    page = Page(driver, operator, np.random.default_rng(2))
    page.delay, page.jitter = delay, jitter
    for _ in range(3):
        page.hold(0.5, lambda time: RELEASED)
        page.hold(1.0, sway)
    assert (operator.clutch, operator.why) == ("inert", "teleoperation_link_slow")
    assert np.ptp(np.array(driver.arms[RIGHT].admitted), axis=0).max() == 0.0
    assert operator.report.dropped > 100


@pytest.mark.parametrize("delay", [0.25, 0.6])
def test_arm_stands_soon_after_its_link_has_become_slow(driver: Driver, operator: Operator, delay: float) -> None:
    page = Page(driver, operator, np.random.default_rng(3))
    page.delay = 0.02
    assert page.engage()
    page.hold(0.7, sway)
    since = len(driver.arms[RIGHT].admitted)
    page.delay = delay  # of what is sent from now on: no frame is lost
    page.hold(2.0, lambda time: sway(0.7 + time))
    assert (operator.clutch, operator.why) == ("inert", "teleoperation_link_slow")
    assert standstill(driver, since) < DEVICE_LINK_LOST + STANDS
    assert max(page.ages) <= DEVICE_LINK_LOST


@pytest.mark.parametrize("times", [short(6), long(300, 3600.0)])
def test_no_arm_moves_by_a_frame_that_is_too_old_whatever_the_link_does(
    driver: Driver, operator: Operator, times: int
) -> None:
    generator = np.random.default_rng(34)
    page, engaged = Page(driver, operator, generator), 0
    for _ in range(times):
        page.delay, page.jitter, page.is_cut = 0.01, 0.02, False
        engaged += page.engage()
        for _ in range(6):
            page.delay = float(generator.choice([0.0, 0.02, 0.05, 0.1, 0.2, 0.5]))
            page.jitter = float(generator.choice([0.0, 0.02, 0.1, 0.3]))
            page.is_cut = bool(generator.uniform() < 0.1)
            page.hold(float(generator.uniform(0.05, 0.5)), sway)
        since = len(driver.arms[RIGHT].admitted)
        page.is_cut = True
        page.hold(1.0, sway)
        assert standstill(driver, since) < DEVICE_LINK_LOST + STANDS
    assert engaged == times
    assert max(page.ages) <= DEVICE_LINK_LOST
