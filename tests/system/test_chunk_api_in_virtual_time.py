"""Chunks as a script sends them: both arms of a driver and a virtual robot in memory follow them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from queue import Queue
from threading import Event
from typing import Any

import numpy as np
import pytest
from teleoperation_bench import LEFT_START, START, WITHIN, driver_in_egm

from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import YUMI_LIMITS, Side, joint_names
from abb_runtime.clock import ManualClock
from cartesian_bench import shares
from refusals import refused
from system.test_endpoint_in_virtual_time import Driver
from yumi.api.chunks import Chunk, ChunkFollower, _GripperSchedule
from yumi.control.controller import CONTROLLER_IDLE_TIME
from yumi.control.controllers.joint_trajectory import JointTrajectoryController
from yumi.control.hand_over import Commander, requested_by
from yumi.control.loop_commands import Commands
from yumi.driver.controller_names import GOAL_CONTROLLER, TRAJECTORY_CONTROLLER

PERIOD = 0.05
HOLD = 1.0 - np.cos(np.arange(40) * PERIOD)  # of a wave that begins at rest


@pytest.fixture(scope="module")
def driver() -> Iterator[Driver]:
    with driver_in_egm() as driver:
        halves: dict[Side, Any] = {}
        for side, arm in driver.arms.items():
            controller = JointTrajectoryController(side, driver.buffers[side].trajectory, halves=halves)
            arm.line.manager.load(TRAJECTORY_CONTROLLER, controller)
            arm.line.manager.configure(TRAJECTORY_CONTROLLER)
        yield driver


def while_time_goes_by(driver: Driver, call: Callable[..., Any], *args: Any) -> None:
    with ThreadPoolExecutor(1) as other:
        running = other.submit(call, *args)
        while not running.done():
            driver.wait(0.02)
        running.result()


@pytest.fixture
def chunks(driver: Driver) -> Iterator[ChunkFollower]:
    chunks = ChunkFollower(driver.mover, tuple(Side), YUMI_LIMITS, {})
    while_time_goes_by(driver, chunks.__enter__)
    for arm in driver.arms.values():
        arm.admitted.clear()
    yield chunks
    while_time_goes_by(driver, lambda: chunks.__exit__(None, None, None))


def points(driver: Driver, side: Side, count: int = 20, first: int = 0, size: float = 0.1) -> np.ndarray:
    wave = HOLD[first : first + count] - HOLD[first]
    return np.array(driver.snapshot(side).sent) + size * wave[:, None]


def test_both_arms_follow_chunks_and_hold_when_they_have_none(driver: Driver, chunks: ChunkFollower) -> None:
    assert chunks.state.is_exhausted
    begin, right, left = driver.now(), points(driver, Side.RIGHT, 40), points(driver, Side.LEFT, 40)
    taken = chunks.send(Chunk(PERIOD, begin, right[:20], left[:20]))
    assert set(taken) == {"right", "left"}
    assert taken["right"].until == pytest.approx(begin + 0.95)
    driver.wait(0.5)
    state = chunks.state
    assert (state.sent, state.refused, state.replaced, state.is_exhausted) == (1, 0, 0, False)
    assert state.executed == pytest.approx(driver.now())
    taken = chunks.send(Chunk(PERIOD, begin + 0.5, right[10:30], left[10:30]))
    assert taken["left"].replaced == 9
    assert chunks.state.replaced == 9
    assert chunks.state.until == pytest.approx(begin + 1.45)
    driver.wait(0.4)
    for side, path in ((Side.RIGHT, right), (Side.LEFT, left)):
        where = [np.interp(driver.now() - begin, np.arange(40) * PERIOD, path[:, joint]) for joint in range(7)]
        assert driver.snapshot(side).position == pytest.approx(where, abs=3e-3)
    driver.wait(1.5)
    assert chunks.state.is_exhausted
    assert chunks.state.executed == chunks.state.until
    for side in Side:
        assert max(map(abs, driver.snapshot(side).velocity)) < 1e-3
        assert shares(np.array(driver.arms[side].admitted)) <= WITHIN


def test_chunk_of_one_arm_leaves_the_other_on_its_points(driver: Driver, chunks: ChunkFollower) -> None:
    begin, left = driver.now(), points(driver, Side.LEFT)
    chunks.send(Chunk(PERIOD, begin, points(driver, Side.RIGHT), left))
    driver.wait(0.3)
    assert set(chunks.send(Chunk(PERIOD, right=points(driver, Side.RIGHT)))) == {"right"}
    driver.wait(0.3)
    assert driver.snapshot(Side.LEFT).position == pytest.approx(left[12], abs=3e-3)
    driver.wait(1.5)


def test_chunk_after_a_wait_begins_where_the_arms_stand(driver: Driver, chunks: ChunkFollower) -> None:
    observed = driver.now()
    driver.wait(0.8)  # inference
    assert chunks.start_for(observed) == pytest.approx(driver.now())
    chunks.send(Chunk(PERIOD, chunks.start_for(observed), points(driver, Side.RIGHT)))
    driver.wait(0.5)
    observed = driver.now()
    assert chunks.start_for(observed) == observed
    driver.wait(0.8)  # the points are exhausted after 0.45 s of it
    assert chunks.start_for(observed) == pytest.approx(observed + 0.35, abs=0.01)
    driver.wait(0.5)


class BusyGripper:
    """A gripper that takes its goal until a test lets it end."""

    def __init__(self) -> None:
        self.is_busy, self.may_end = Event(), Event()

    def take(self, closed: float) -> Callable[[], None]:
        def work() -> None:
            self.is_busy.set()
            assert self.may_end.wait(10.0)

        return work

    def forget(self) -> None:
        """Nothing waits."""


def test_arms_stand_before_the_end_of_a_block_waits_for_a_gripper(driver: Driver) -> None:
    gripper = BusyGripper()
    chunks = ChunkFollower(driver.mover, tuple(Side), YUMI_LIMITS, {Side.RIGHT: gripper})  # type: ignore[dict-item]
    while_time_goes_by(driver, chunks.__enter__)
    wave = 0.1 * (1.0 - np.cos(0.25 * np.arange(240) * PERIOD))  # for 12 s no joint stands
    path = np.array(driver.snapshot(Side.RIGHT).sent) + wave[:, None]
    chunks.send(Chunk(PERIOD, right=path, right_gripper=[1.0] * len(path)))
    driver.wait(2.0)
    assert gripper.is_busy.wait(10.0)
    assert max(map(abs, driver.snapshot(Side.RIGHT).velocity)) > 5e-3
    with ThreadPoolExecutor(1) as other:
        ending = other.submit(chunks.__exit__, None, None, None)
        driver.until(lambda: max(map(abs, driver.snapshot(Side.RIGHT).velocity)) < 1e-4, 8.0)
        assert driver.now() < chunks.state.until  # it was stopped; its points are not exhausted
        assert not ending.done()
        gripper.may_end.set()
        while not ending.done():
            driver.wait(0.02)
        ending.result()


def test_arm_that_something_else_has_taken_over_follows_no_chunk(driver: Driver, chunks: ChunkFollower) -> None:
    chunks.send(Chunk(PERIOD, right=points(driver, Side.RIGHT)))
    driver.wait(0.2)
    while_time_goes_by(driver, lambda: driver.mover.bring_to_rest((Side.RIGHT,)))
    with refused(CommandRefused, "chunks_taken_over", arm="right"):
        chunks.send(Chunk(PERIOD, right=points(driver, Side.RIGHT)))
    driver.call(Commands.switch_controllers, Side.RIGHT, (TRAJECTORY_CONTROLLER,), driver.mover.commanding(Side.RIGHT))
    with refused(CommandRefused, "chunks_taken_over", arm="right"):  # before a person follows chunks anew
        chunks.send(Chunk(PERIOD, right=points(driver, Side.RIGHT)))
    assert chunks.state.refused == 2


def test_other_arm_of_a_policy_brakes_when_one_is_taken_over_and_no_chunk_moves_either(
    driver: Driver, chunks: ChunkFollower
) -> None:
    long = 0.3 * (1.0 - np.cos(0.5 * np.arange(240) * PERIOD))  # 12 s
    paths = {side: np.array(driver.snapshot(side).sent) + long[:, None] for side in Side}
    chunks.send(Chunk(PERIOD, right=paths[Side.RIGHT], left=paths[Side.LEFT]))
    driver.wait(1.5)
    assert min(max(map(abs, driver.snapshot(side).velocity)) for side in Side) > 0.05
    while_time_goes_by(driver, lambda: driver.mover.bring_to_rest((Side.RIGHT,)))
    driver.wait(0.5)
    still = {side: driver.snapshot(side).sent for side in Side}
    for chunk in (Chunk(PERIOD, right=points(driver, Side.RIGHT)), Chunk(PERIOD, left=points(driver, Side.LEFT))):
        with refused(CommandRefused, "chunks_taken_over", arm="right"):
            chunks.send(chunk)
    driver.wait(1.0)
    for side in Side:
        assert driver.snapshot(side).sent == pytest.approx(still[side], abs=1e-6)
        assert shares(np.array(driver.arms[side].admitted)) <= WITHIN


def test_chunk_for_one_arm_is_refused_in_the_cycle_in_which_the_other_one_is_taken_over(
    driver: Driver, chunks: ChunkFollower, monkeypatch: pytest.MonkeyPatch
) -> None:
    call = driver.call

    def take_right_over_first(command: Callable[..., Any], *args: Any) -> Any:
        monkeypatch.undo()
        call(Commands.switch_controllers, Side.RIGHT, (GOAL_CONTROLLER,), (TRAJECTORY_CONTROLLER,))
        return call(command, *args)

    chunks.send(Chunk(PERIOD, right=points(driver, Side.RIGHT), left=points(driver, Side.LEFT)))
    driver.wait(0.3)
    monkeypatch.setattr(driver, "call", take_right_over_first)
    with refused(CommandRefused, "chunks_taken_over", arm="right"):
        chunks.send(Chunk(PERIOD, left=points(driver, Side.LEFT)))
    driver.wait(0.5)
    still = driver.snapshot(Side.LEFT).sent
    driver.wait(0.5)
    assert driver.snapshot(Side.LEFT).sent == pytest.approx(still, abs=1e-6)
    assert shares(np.array(driver.arms[Side.LEFT].admitted)) <= WITHIN


def test_policy_takes_no_arm_from_another_one_and_keeps_those_that_it_moves(
    driver: Driver, chunks: ChunkFollower
) -> None:
    def stream() -> None:
        driver.mover.stream({Side.RIGHT: driver.snapshot(Side.RIGHT).sent})

    chunks.send(Chunk(PERIOD, right=points(driver, Side.RIGHT, size=0.5)))
    driver.wait(0.5)
    assert driver.hand_over.of(Side.RIGHT).who is Commander.POLICY
    with requested_by(client="another program"), refused(CommandRefused, "arm_commanded_by_another", who="policy"):
        stream()
    driver.wait(1.5)  # the points are exhausted, and the arm stands
    with requested_by(client="another program"):
        while_time_goes_by(driver, copy_context().run, stream)
    others = ChunkFollower(driver.mover, tuple(Side), YUMI_LIMITS, {})
    with refused(CommandRefused, "arm_commanded_by_another", who="stream"):
        others.__enter__()
    with refused(CommandRefused, "chunks_taken_over", arm="right"):
        chunks.send(Chunk(PERIOD, right=points(driver, Side.RIGHT)))
    driver.wait(1.1 * CONTROLLER_IDLE_TIME)


def test_chunks_end_where_another_client_lets_the_arm_follow_a_trajectory(
    driver: Driver, chunks: ChunkFollower
) -> None:
    """By the same controller, which would take the next chunk."""
    chunks.send(Chunk(PERIOD, right=points(driver, Side.RIGHT)))
    driver.wait(2.5)  # the points are exhausted, and the arm stands
    goal = driver.snapshot(Side.RIGHT).sent
    with requested_by(client="another program"):
        while_time_goes_by(driver, copy_context().run, lambda: driver.mover.follow({Side.RIGHT: [(1.0, goal)]}))
    driver.wait(2.0)
    for chunk in (Chunk(PERIOD, right=points(driver, Side.RIGHT)), Chunk(PERIOD, right_gripper=[0.5] * 8)):
        with refused(CommandRefused, "chunks_taken_over", arm="right"):
            chunks.send(chunk)


GOOD = [START] * 8


@pytest.mark.parametrize(
    ("chunk", "code"),
    [
        (Chunk(PERIOD), "chunk_without_arm"),
        (Chunk(PERIOD, right="ready"), "chunk_points_malformed"),
        (Chunk(PERIOD, right=[START[:6]] * 8), "chunk_points_malformed"),
        (Chunk(PERIOD, right=[(float("nan"), *START[1:])] * 8), "chunk_points_malformed"),
        (Chunk(PERIOD, right=[START]), "chunk_point_count"),
        (Chunk(PERIOD, right=[START] * 501), "chunk_point_count"),
        (Chunk(PERIOD, right=[(3.5, *START[1:])] * 8), "goal_joint_out_of_range"),
        (Chunk(PERIOD, right=GOOD, left=[LEFT_START] * 9), "chunk_counts_differ"),
        (Chunk(PERIOD, right=GOOD, right_gripper=[0.5] * 7), "chunk_counts_differ"),
        (Chunk(PERIOD, right=GOOD, right_gripper=[1.5] * 8), "chunk_gripper_malformed"),
        (Chunk(0.001, right=GOOD), "chunk_time_out_of_range"),
        (Chunk(PERIOD, -100.0, right=GOOD), "chunk_time_out_of_range"),
        (Chunk(PERIOD, right=[START, [each + 0.3 for each in START]] * 4), "chunk_beyond_limit"),
    ],
)
def test_chunk_with_a_fault_is_refused(driver: Driver, chunks: ChunkFollower, chunk: Chunk, code: str) -> None:
    with refused(CommandRefused, code):
        chunks.send(chunk)
    assert (chunks.state.sent, chunks.state.refused) == (0, 1)


def test_chunk_for_an_arm_that_is_not_followed_is_refused(driver: Driver) -> None:
    chunks = ChunkFollower(driver.mover, (Side.LEFT,), YUMI_LIMITS, {})
    while_time_goes_by(driver, chunks.__enter__)
    with refused(CommandRefused, "chunk_arm_not_taken", arm="right", arms=("left",)):
        chunks.send(Chunk(PERIOD, right=GOOD))
    while_time_goes_by(driver, lambda: chunks.__exit__(None, None, None))
    with refused(CommandRefused, "chunks_ended"):
        chunks.send(Chunk(PERIOD, left=[LEFT_START] * 8))


def test_chunk_that_is_elsewhere_names_the_joint(driver: Driver, chunks: ChunkFollower) -> None:
    with refused(CommandRefused, "chunk_jumps", joint=joint_names(Side.RIGHT)[0], most=0.2):
        chunks.send(Chunk(PERIOD, right=points(driver, Side.RIGHT) + np.array([0.5, *[0.0] * 6])))


def test_grippers_of_both_arms_keep_their_goals_when_one_arm_is_taken_over(driver: Driver) -> None:
    fingers = {side: Fingers() for side in Side}
    chunks = ChunkFollower(driver.mover, tuple(Side), YUMI_LIMITS, fingers)  # type: ignore[arg-type]
    while_time_goes_by(driver, chunks.__enter__)
    right, left = (points(driver, side, 2) for side in (Side.RIGHT, Side.LEFT))
    chunks.send(Chunk(0.5, driver.now(), right, left, right_gripper=[0.2, 1.0], left_gripper=[0.2, 1.0]))
    assert {each.goals.get(timeout=5.0) for each in fingers.values()} == {0.2}
    while_time_goes_by(driver, lambda: driver.mover.bring_to_rest((Side.RIGHT,)))
    driver.wait(1.0)
    chunks._grippers.replace(Side.LEFT, [driver.now()], [0.7])  # what the schedule looks at next
    while_time_goes_by(driver, lambda: chunks.__exit__(None, None, None))
    assert all(each.goals.empty() for each in fingers.values())


def test_grippers_get_no_goal_from_the_moment_on_in_which_a_person_takes_an_arm(driver: Driver) -> None:
    fingers = {side: Fingers() for side in Side}
    chunks = ChunkFollower(driver.mover, tuple(Side), YUMI_LIMITS, fingers)  # type: ignore[arg-type]
    while_time_goes_by(driver, chunks.__enter__)
    with requested_by(Commander.PAGE, "person"):
        driver.hand_over.take(Side.RIGHT, Commander.PAGE)  # its controller is switched a while later
        chunks._grippers.replace(Side.LEFT, [driver.now()], [0.7])
        with requested_by(), refused(CommandRefused, "chunks_taken_over", arm="right"):
            chunks.send(Chunk(PERIOD, right=points(driver, Side.RIGHT)))
    while_time_goes_by(driver, lambda: chunks.__exit__(None, None, None))
    assert all(each.goals.empty() for each in fingers.values())
    with requested_by(Commander.PAGE, "person"):
        driver.hand_over.let_go(Side.RIGHT)
        driver.hand_over.give_back((Side.RIGHT,))


class Fingers:
    """A gripper's goals, taken in no time."""

    def __init__(self) -> None:
        self.goals: Queue[float] = Queue()

    def take(self, closed: float) -> None:
        self.goals.put(closed)

    def forget(self) -> None:
        """Nothing waits."""


def test_grippers_get_the_newest_goal_that_is_due() -> None:
    fingers, clock = Fingers(), ManualClock(10.0)
    with _GripperSchedule({Side.RIGHT: fingers}, clock, lambda side: True) as schedule:  # type: ignore[dict-item]
        schedule.replace(Side.RIGHT, [9.0, 9.5, 20.0], [0.0, 0.3, 1.0])
        assert fingers.goals.get(timeout=5.0) == 0.3
        clock.advance(11.0)
        schedule.replace(Side.RIGHT, [20.5, 20.8, 30.0], [0.3, 0.6, 0.0])
        assert fingers.goals.get(timeout=5.0) == 0.6
        schedule.replace(Side.RIGHT, [20.9, 30.0], [0.6, 0.0])  # no other goal than before
        clock.advance(11.0)
        schedule.replace(Side.RIGHT, [40.0], [1.0])
        assert fingers.goals.get(timeout=5.0) == 0.0
    assert fingers.goals.empty()  # what was due later is not done any more


def test_gripper_of_an_arm_that_was_taken_over_gets_no_goal() -> None:
    fingers, others, clock = Fingers(), Fingers(), ManualClock(10.0)
    own = {Side.LEFT}
    grippers = {Side.RIGHT: fingers, Side.LEFT: others}
    with _GripperSchedule(grippers, clock, own.__contains__) as schedule:  # type: ignore[arg-type]
        schedule.replace(Side.RIGHT, [9.0], [1.0])
        schedule.replace(Side.LEFT, [9.0], [1.0])
        assert others.goals.get(timeout=5.0) == 1.0  # the schedule has looked at both
        own.add(Side.RIGHT)
        schedule.replace(Side.LEFT, [9.5], [0.0])
        assert others.goals.get(timeout=5.0) == 0.0
    assert fingers.goals.empty()
