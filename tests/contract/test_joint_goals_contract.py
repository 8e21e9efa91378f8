"""What every arm must let the joint goal controller do: the perfect arm in memory and the virtual arm over the wire."""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Callable
from itertools import pairwise
from math import radians

import numpy as np
import pytest

from abb_protocols.catalogue import message
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, ArmCommand, Joints, Side, joint_names, joints
from controller_arms import LimitedArm, PerfectArm
from egm_loop import CONTROLLER, EgmLoop
from reported_limiter import ReportedLimiter
from trajectories import sent_beside_speeds
from yumi.control.controllers.joint_goal import GoalEnded, GoalOutcome, JointGoal, JointGoalController, StopMotion
from yumi.control.cycle import Cycle, run_cycle
from yumi.control.goals import MemoryBuffer
from yumi.control.loop_events import ControllerReport
from yumi.control.manager.controller_manager import ControllerManager
from yumi.control.stage_times import StageClock

NAME = "joint_goal_controller"
STEPS = (20.0, 10.0, 15.0, 5.0, 30.0, -20.0, 40.0)
FULL = {"speed_scale": 1.0, "acceleration_scale": 1.0}


class ArmUnderGoals(ABC):
    """An arm with a joint goal controller that commands it."""

    def __init__(self, manager: ControllerManager) -> None:
        self.manager = manager
        self.cycles: list[Cycle] = []
        self.notices: list[GoalEnded] = []

    @abstractmethod
    def next_cycle(self) -> Cycle | None: ...

    @abstractmethod
    def next_notices(self) -> list[object]: ...

    @property
    def position(self) -> Joints:
        return self.cycles[-1].state.position

    @property
    def commands(self) -> list[ArmCommand]:
        return [cycle.sent for cycle in self.cycles]

    def order(self, message: object) -> None:
        self.manager.receive(NAME, message, self.cycles[-1].state)

    def cycle(self) -> None:
        cycle = self.next_cycle()
        if cycle is not None:
            self.cycles.append(cycle)
        self.notices += [notice for notice in self.next_notices() if isinstance(notice, GoalEnded)]

    def until(self, is_so: Callable[[], bool], limit: float) -> float:
        """Let time pass until it is so; the time it took [s]."""
        for count in range(round(limit / CYCLE)):
            if is_so():
                return count * CYCLE
            self.cycle()
        raise AssertionError(f"not within {limit} s")


class PerfectArmUnderGoals(ArmUnderGoals):
    def __init__(self, start: Joints) -> None:
        manager = ControllerManager(joint_names(Side.RIGHT))
        manager.load(NAME, JointGoalController(MemoryBuffer()))
        manager.set_parameters(NAME, FULL)
        manager.configure(NAME)
        super().__init__(manager)
        self._arm, self._stages = LimitedArm(PerfectArm(start), ReportedLimiter(YUMI_LIMITS)), StageClock()
        self.cycle()
        manager.switch([NAME], [], self.cycles[-1].state)

    def next_cycle(self) -> Cycle | None:
        return run_cycle(self._arm, self.manager, len(self.cycles) * CYCLE, self._stages)

    def next_notices(self) -> list[object]:
        return [notice for _, notice in self.manager.take_reports()]


class VirtualArmUnderGoals(ArmUnderGoals):
    def __init__(self) -> None:
        self._loop = EgmLoop(Side.RIGHT)
        super().__init__(self._loop.manager)
        self.manager.load(NAME, JointGoalController(MemoryBuffer()))
        self.manager.set_parameters(NAME, FULL)
        self.manager.configure(NAME)
        self._loop.begin()
        self._loop.deactivate()
        self.until(lambda: len(self.cycles) > 50, 1.0)
        self.manager.switch([NAME], [], self._loop.line.state)

    def next_cycle(self) -> Cycle | None:
        before = len(self._loop.cycles)
        self._loop.cycle()
        return self._loop.cycles[-1] if len(self._loop.cycles) > before else None

    def next_notices(self) -> list[object]:
        events, self._loop.events = self._loop.events, []
        return [event.report for event in events if isinstance(event, ControllerReport)]


@pytest.fixture(params=["perfect arm", "virtual arm"])
def arm(request: pytest.FixtureRequest, middle: Joints) -> ArmUnderGoals:
    return PerfectArmUnderGoals(middle) if request.param == "perfect arm" else VirtualArmUnderGoals()


def moved(position: Joints, scale: float = 1.0) -> Joints:
    return joints([value + radians(scale * step) for value, step in zip(position, STEPS, strict=True)])


def test_arm_reaches_a_point_and_says_so_when_it_stands_there(arm: ArmUnderGoals) -> None:
    goal = moved(arm.position)
    arm.order(JointGoal(goal, 1))
    arm.until(lambda: bool(arm.notices), 2.0)
    assert arm.notices == [GoalEnded(1, GoalOutcome.REACHED, message("goal_reached"))]
    assert arm.position == pytest.approx(goal, abs=0.002)


def test_arm_does_not_overshoot_the_point(arm: ArmUnderGoals) -> None:
    start = arm.position
    goal = moved(start)
    arm.order(JointGoal(goal, 1))
    arm.until(lambda: bool(arm.notices), 2.0)
    for cycle in arm.cycles:
        ways = zip(cycle.state.position, start, goal, strict=True)
        assert all(min(old, new) - 1e-4 <= now <= max(old, new) + 1e-4 for now, old, new in ways)


def test_arm_follows_without_lag_beyond_the_transport_delay(arm: ArmUnderGoals) -> None:
    goal = moved(arm.position, 2.0)
    arm.order(JointGoal(goal, 1))
    planned = arm.until(lambda: arm.commands[-1].position == goal, 3.0)
    behind = arm.until(lambda: arm.position == pytest.approx(goal, abs=radians(0.5)), 1.0)
    assert behind <= 0.05
    assert planned < 1.5


def test_guard_has_nothing_to_slow_down_on_the_way(arm: ArmUnderGoals) -> None:
    arm.order(JointGoal(moved(arm.position), 1))
    arm.until(lambda: bool(arm.notices), 2.0)
    assert all(cycle.sent.velocity == pytest.approx(cycle.desired.velocity) for cycle in arm.cycles if cycle.desired)
    followed = [(cycle.desired.position, cycle.sent.position) for cycle in arm.cycles if cycle.desired]
    start = next(after for before, after in pairwise(arm.cycles) if after.desired).state.position
    sent = sent_beside_speeds([desired for desired, _ in followed], start)
    assert np.array([each for _, each in followed]) == pytest.approx(np.array(sent))


def test_arm_that_is_told_to_stop_decelerates_and_stands(arm: ArmUnderGoals) -> None:
    arm.order(JointGoal(moved(arm.position, 3.0), 1))
    arm.until(lambda: max(map(abs, arm.cycles[-1].state.velocity)) > 1.0, 2.0)
    arm.order(StopMotion(2))
    duration = arm.until(lambda: len(arm.notices) == 2, 1.0)
    assert [notice.outcome for notice in arm.notices] == [GoalOutcome.STOPPED, GoalOutcome.REACHED]
    assert duration < 0.4


def test_new_goal_in_mid_motion_makes_no_jump(arm: ArmUnderGoals) -> None:
    start = arm.position
    arm.order(JointGoal(moved(start, 3.0), 1))
    arm.until(lambda: max(map(abs, arm.cycles[-1].state.velocity)) > 1.0, 2.0)
    arm.order(JointGoal(start, 2))
    arm.until(lambda: len(arm.notices) == 2, 3.0)
    assert arm.position == pytest.approx(start, abs=0.002)
    for before, after in itertools.pairwise(arm.commands):
        limits = zip(before.position, after.position, YUMI_LIMITS.velocity, strict=True)
        assert all(abs(new - old) <= top * CYCLE * 1.001 for old, new, top in limits)


def test_arm_that_another_controller_moves_is_brought_to_rest_first() -> None:
    loop = EgmLoop(Side.RIGHT)
    loop.manager.load(NAME, JointGoalController(MemoryBuffer()))
    loop.manager.set_parameters(NAME, FULL)
    loop.manager.configure(NAME)
    loop.begin()
    loop.go(moved(loop.snapshot.position, 3.0))
    loop.run(0.35)
    speed = max(map(abs, loop.snapshot.velocity))
    loop.manager.switch([NAME], [CONTROLLER], loop.line.state)
    begun = len(loop.cycles)
    loop.run(0.5)
    speeds = [max(map(abs, cycle.state.velocity)) for cycle in loop.cycles[begun:]]
    assert speed > 1.0
    assert max(speeds) < 1.1 * speed + YUMI_LIMITS.acceleration[4] * 0.035  # what is under way until the hold arrives
    assert speeds[-1] < 0.01
