"""Whoever takes over from whom, at random: no command steps, nothing resumes by itself, nothing moves without a clutch.

Both arms of a driver in memory, in virtual time. A policy and a script try to move them again and again; two hands
press and release clutches, and what they send comes late, early, or not at all; a person gives arms back now and then.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from math import sin
from pathlib import Path

import numpy as np
import pytest

from abb_protocols.errors import CommandRefused, YumiError
from abb_protocols.robot.joints import Joints, Side, joints
from cartesian_bench import shares
from refusals import refused
from soak import HAND_OVERS, SEED, long, short, tell
from system.teleoperation_bench import (
    LEFT_START,
    RATE,
    RELEASED,
    RIGHT,
    START,
    WITHIN,
    Operator,
    at,
    driver_in_egm,
    operator_of,
)
from system.test_endpoint_in_virtual_time import Driver
from system.test_teleoperation_at_random import STILL, Hand
from yumi.control.controller import CONTROLLER_IDLE_TIME
from yumi.control.hand_over import Commander, requested_by
from yumi.control.loop_events import CommanderChanged, Event
from yumi.driver.device_frame import DeviceHand, DeviceSettings
from yumi.driver.teleoperated_arm import DEVICE_LINK_LOST

LEFT = Side.LEFT
HOLDS = 1e-4  # [rad] as near as the limiter brings a command back to the arm
SETTLES = 1e-3  # [rad] by so much the arm still goes to its command then, by the law of its position loop
COMMAND_STILL = 0.5  # [s] after which the command of an arm that was let go at full speed stands, too
STARTS = {RIGHT: START, LEFT: LEFT_START}
REFUSED = {"arm_commanded_by_another", "arm_reserved_for_person"}
BUSY = {"goal_not_reached", "stream_begins_elsewhere", "interrupted_while_planned", "goal_refused"}
"""What else a program may hear that is interrupted."""


class Program:
    """A program that moves one arm whenever it may; its attempts wait on another thread.

    Attributes:
        refusals: the codes of those that were refused, in order.
        granted: how many were not.
    """

    def __init__(self, who: Commander | None, client: Hashable, pool: ThreadPoolExecutor) -> None:
        self.refusals: list[str] = []
        self.granted = 0
        self._who, self._client, self._pool = who, client, pool
        self._running: Future[None] | None = None

    def attempt(self, motion: Callable[[], object]) -> None:
        """Move, unless the attempt before is not over."""
        if self._running is None or self._running.done():
            self._running = self._pool.submit(self._try, motion)
        wait([self._running], 0.002)  # else time goes by here faster than there

    def wait(self, pass_time: Callable[[], None]) -> None:
        """Until its attempt is over."""
        while self._running is not None and not self._running.done():
            pass_time()
            wait([self._running], 0.002)

    def _try(self, motion: Callable[[], object]) -> None:
        with requested_by(self._who, self._client, str(self._client)):
            try:
                motion()
            except YumiError as error:
                self.refusals.append(error.said.code)
            else:
                self.granted += 1


class Scene:
    """Both arms, those who want to command them, and what must hold at each moment.

    Attributes:
        hand_overs: by who commanded before and after.
    """

    def __init__(
        self, driver: Driver, operator: Operator, generator: np.random.Generator, pool: ThreadPoolExecutor
    ) -> None:
        self.hand_overs: dict[tuple[str, str], int] = {}
        self._driver, self._operator, self._random = driver, operator, generator
        self._hands = {side: Hand(generator) for side in Side}
        self.policies = {side: Program(Commander.POLICY, "policy", pool) for side in Side}
        self.scripts = {side: Program(None, "script", pool) for side in Side}
        self._late: list[tuple[float, DeviceHand, DeviceHand]] = []
        self._silent_until = 0.0
        self._reserved_since: dict[Side, float] = {}
        self._let_go: dict[Side, float] = {}  # when it was seen first with nothing that takes it over
        self._still: dict[tuple[Side, float], Joints] = {}
        driver.hand_over._on_event = self._note

    def _note(self, event: Event) -> None:
        if isinstance(event, CommanderChanged):
            key = (event.before, event.who)
            self.hand_overs[key] = self.hand_overs.get(key, 0) + 1

    def run(self, steps: int) -> None:
        """Go on for so many frames; then all hands let go, and the arms are given back."""
        is_mixed = False
        for step in range(steps):
            if step % 20 == 0:
                for hand in self._hands.values():
                    held = ["stay"] * 6 + ["release"] * 4 + ["jump"]
                    hand.act(str(self._random.choice(held if hand.frame.clutch else ["stay"] * 2 + ["press"] * 3)))
                silence = float(self._random.choice([0.0] * 8 + [0.1, 0.15, DEVICE_LINK_LOST + 0.1]))
                self._silent_until = self._driver.now() + silence
                is_mixed = bool(self._random.uniform() < 0.3)
            self._send(is_mixed=is_mixed)
            self._move_programs(step)
            if self._random.uniform() < 0.01:
                self._give_back()
            self._driver.wait(1.0 / RATE)
            for side in Side:
                self._check_holds(side, step)
        for hand in self._hands.values():
            hand.act("release")
        self._silent_until = 0.0
        for _ in range(int((DEVICE_LINK_LOST + STILL) * RATE)):
            self._send(is_mixed=False)
            self._driver.wait(1.0 / RATE)

    def _check_holds(self, side: Side, step: int) -> None:
        """See that an arm that a person has let go stays where it has come to rest.

        While its joints follow a leader an arm is sent ahead of where it is, 18 mrad at 0.24 rad/s, 0.2 rad at 1 rad/s,
        and a stop brings the command back to the arm, which stands meanwhile. No program that was granted the arm
        before, and is late, stops it once more. The stop of a person who has pressed and let go at once is waited for:
        it comes from a thread that has less time than the robot here.
        """
        command, snapshot = self._driver.hand_over.of(side), self._driver.snapshot(side)
        is_held = command.who is Commander.NONE and command.is_reserved and not self._operator.is_taking_over
        if not is_held or command.since != self._reserved_since.get(side):
            self._reserved_since[side], self._let_go[side] = command.since, self._driver.now()
            for after in (STILL, COMMAND_STILL):
                self._still.pop((side, after), None)
        for after, where, by in ((STILL, snapshot.position, SETTLES), (COMMAND_STILL, snapshot.sent, HOLDS)):
            if self._driver.now() - self._let_go[side] > after:
                assert where == pytest.approx(self._still.setdefault((side, after), where), abs=by), (step, side)

    def _send(self, *, is_mixed: bool) -> None:
        for hand in self._hands.values():
            if hand.frame.clutch:
                hand.move(1.0 / RATE)
        now = self._driver.now()
        self._late.append((now, self._hands[RIGHT].frame, self._hands[LEFT].frame))
        if now < self._silent_until:
            return
        order = self._random.permutation(len(self._late)) if is_mixed else range(len(self._late))
        for each in order:
            made_at, right, left = self._late[int(each)]
            self._operator.send(right, made_at, left=left)
        self._late.clear()

    def _move_programs(self, step: int) -> None:
        for side in Side:
            if self._random.uniform() < 0.5:  # a policy's goals come with a jitter
                goal = policy_goal(side, self._driver.now())
                self.policies[side].attempt(lambda side=side, goal=goal: stream_to(self._driver, side, goal))
            if self._random.uniform() < 0.02:
                way = self._random.uniform(-0.2, 0.2, 7)
                there = joints([a + b for a, b in zip(STARTS[side], way.tolist(), strict=True)])
                self.scripts[side].attempt(
                    lambda side=side, there=there: self._driver.mover.move({side: there}, 1.0, None)
                )

    def _give_back(self) -> None:
        for side in Side:
            if not self._driver.hand_over.of(side).who.is_person:
                self._driver.hand_over.give_back((side,))


def stream_to(driver: Driver, side: Side, goal: Joints) -> None:
    """The next point of a policy's stream."""
    driver.mover.stream({side: goal}, blend=0.5)


def policy_goal(side: Side, time: float) -> Joints:
    """Where a smooth policy has an arm at ``time`` [s]."""
    return joints([a + 0.15 * sin(1.5 * time + index) for index, a in enumerate(STARTS[side])])


@pytest.fixture
def driver(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Driver]:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with driver_in_egm() as driver:
        yield driver


@pytest.fixture
def operator(driver: Driver) -> Iterator[Operator]:
    with operator_of(driver) as operator:
        yield operator


@pytest.fixture
def pool() -> Iterator[ThreadPoolExecutor]:
    with ThreadPoolExecutor(4) as pool:
        yield pool


@pytest.mark.parametrize("count", [short(2, pytest.mark.timeout(60)), long(HAND_OVERS, 10800.0)])
def test_no_hand_over_steps_and_nothing_resumes_by_itself(
    driver: Driver, operator: Operator, pool: ThreadPoolExecutor, count: int
) -> None:
    generator = np.random.default_rng((70, SEED))
    scene, worst = Scene(driver, operator, generator, pool), np.zeros(3)
    for number in range(1, 1 + count):
        operator.settings = DeviceSettings(cutoff=float(generator.choice([0.0, 3.0])), speed=0.3)
        scene.run(240)
        for program in (*scene.policies.values(), *scene.scripts.values()):
            program.wait(lambda: driver.wait(1.0 / RATE))
            assert set(program.refusals) <= REFUSED | BUSY, program.refusals
        for side in Side:
            worst = np.maximum(worst, shares(np.array(driver.arms[side].admitted)))
            del driver.arms[side].admitted[:-5]
        assert worst.max() <= max(WITHIN), (number, worst)
        driver.hand_over.give_back(tuple(Side))
        driver.wait(1.1 * CONTROLLER_IDLE_TIME)  # the policy's stream is over
        driver.mover.move(STARTS, 1.0, None)
        driver.until(lambda: not any(driver.mover.is_moving(side) for side in Side), 10.0)
        if count > 2 and number % 10 == 0:
            tell(f"{number} sequences: hand-overs {scene.hand_overs}; shares of the limits {worst}")
    taken = sum(times for (_, after), times in scene.hand_overs.items() if after != "none")
    assert taken >= 2 * count, scene.hand_overs
    assert any(code in REFUSED for policy in scene.policies.values() for code in policy.refusals)
    assert all(policy.granted for policy in scene.policies.values())


@pytest.mark.timeout(120)
def test_policy_goes_on_after_twenty_take_overs_only_when_it_is_given_the_arms_back(
    driver: Driver, operator: Operator, pool: ThreadPoolExecutor
) -> None:
    policies = {side: Program(Commander.POLICY, "policy", pool) for side in Side}

    def let_policy_try(seconds: float, hand: DeviceHand) -> None:
        for _ in range(int(seconds * RATE)):
            for side, policy in policies.items():
                goal = policy_goal(side, driver.now())
                policy.attempt(lambda side=side, goal=goal: stream_to(driver, side, goal))
            operator.send(hand, left=hand)
            driver.wait(1.0 / RATE)

    for number in range(20):
        let_policy_try(0.7, RELEASED)
        assert {driver.hand_over.of(side).who for side in Side} == {Commander.POLICY}, number
        for _ in range(200):  # the person presses while the arms move
            let_policy_try(1.0 / RATE, at())
            if {arm.clutch for arm in operator.report.arms.values()} == {"engaged"}:
                break
        assert {driver.hand_over.of(side).who for side in Side} == {Commander.DEVICE}, operator.report
        let_policy_try(0.2, at(0.02))
        let_policy_try(STILL, RELEASED)
        still = {side: driver.snapshot(side).sent for side in Side}
        let_policy_try(0.3, RELEASED)
        for side in Side:
            assert driver.snapshot(side).sent == pytest.approx(still[side], abs=1e-9)
            assert policies[side].refusals[-1] == "arm_reserved_for_person"
        with refused(CommandRefused, "arm_reserved_for_person"):
            driver.mover.move({RIGHT: START}, 1.0, None)
        driver.hand_over.give_back(tuple(Side))
    for side in Side:
        assert max(shares(np.array(driver.arms[side].admitted))) <= max(WITHIN)
