"""A trajectory for an inactive controller, which is activated where nothing else commands the arm; two kinds of arm."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import pytest
from trajectory_arms import NAME, SIDE, Loop

from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, home, joint_names, joints
from abb_runtime.clock import ManualClock
from controller_arms import LimitedArm, PerfectArm
from refusals import refused
from reported_limiter import ReportedLimiter
from trajectories import moved, swing
from yumi.control.controller import State
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.controllers.joint_trajectory import JointTrajectoryController
from yumi.control.cycle import Cycle
from yumi.control.goals import MemoryBuffer, write_goal
from yumi.control.loop import ArmLoop
from yumi.control.loop_commands import Commands, ControllerCommand
from yumi.control.loop_events import ControllerReport, Event
from yumi.control.manager.controller_manager import ControllerManager
from yumi.control.trajectory_commands import ArmPlan, FollowTrajectory, Tolerances, TrajectoryEnded, TrajectoryOutcome
from yumi_evaluation.virtual_time import VirtualArmRig

OTHER = "joint_position_controller"
HOME = home(SIDE)


class PerfectLoop:
    """A perfect arm in memory."""

    def __init__(self, controllers: dict[str, JointPositionController | JointTrajectoryController]) -> None:
        self.clock = ManualClock(100.0)
        self.manager = ControllerManager(joint_names(SIDE))
        for name, each in controllers.items():
            self.manager.load(name, each)
            self.manager.configure(name)
        self.arm = PerfectArm(HOME)
        limiter = ReportedLimiter(YUMI_LIMITS, gain=0.0)
        self.line = ArmLoop(SIDE, LimitedArm(self.arm, limiter), self.manager, limiter, MemoryBuffer())
        self.cycles: list[Cycle] = []
        self.events: list[Event] = []

    def cycle(self) -> None:
        self.clock.advance(CYCLE)
        cycle = self.line.run(self.clock.now())
        assert cycle is not None
        self.cycles.append(cycle)
        self.events += self.line.take_events()


def virtual_loop(controllers: dict[str, JointPositionController | JointTrajectoryController]) -> Loop:
    arm = VirtualArmRig(dict(controllers), side=SIDE)
    arm.start()
    return arm


class DeliveredArm:
    """One arm as after ``start_egm``: the position controller is active, the one for trajectories is not."""

    def __init__(self, make: Callable[[dict[str, JointPositionController | JointTrajectoryController]], Loop]) -> None:
        self.goals = MemoryBuffer()
        self.loop = make(
            {OTHER: JointPositionController(self.goals), NAME: JointTrajectoryController(SIDE, MemoryBuffer())}
        )
        self.commands = Commands({SIDE: self.loop.line}, self.loop.clock.now)
        self.run(0.2)
        self.commands.switch_controllers(SIDE, (OTHER,))
        self.run(0.2)

    def run(self, seconds: float) -> list[Cycle]:
        first = len(self.loop.cycles)
        for _ in range(round(seconds / CYCLE)):
            self.loop.cycle()
        return self.loop.cycles[first:]

    def stream(self, *goal: float) -> None:
        write_goal(self.goals, self.loop.cycles[-1].state.session, joints(goal))

    def send(self, plan: ArmPlan, *, takes_over: bool = True) -> dict[object, tuple[str, ...]]:
        message = FollowTrajectory(plan, 1, Tolerances())
        return dict(self.commands.send_commands(ControllerCommand(SIDE, NAME, message, takes_over=takes_over)))

    @property
    def active(self) -> set[str]:
        return {each.name for each in self.loop.manager.controllers() if each.state is State.ACTIVE}


@pytest.fixture(params=[PerfectLoop, virtual_loop], ids=["perfect arm", "virtual arm"])
def arm(request: pytest.FixtureRequest) -> DeliveredArm:
    return DeliveredArm(request.param)


def test_goal_activates_its_controller_where_the_active_one_moves_nothing(arm: DeliveredArm) -> None:
    assert arm.active == {OTHER}
    assert arm.send(swing(HOME, 0.5, 1.0)) == {SIDE: (OTHER,)}
    assert arm.active == {NAME}
    cycles = arm.run(3.0)
    ends = [each.report for each in arm.loop.events if isinstance(each, ControllerReport)]
    assert [each.outcome for each in ends if isinstance(each, TrajectoryEnded)] == [TrajectoryOutcome.SUCCEEDED]
    assert cycles[-1].state.position == pytest.approx(moved(HOME, 0.5), abs=0.005)
    for before, after in pairwise(cycle.sent.position for cycle in cycles):  # no step
        rows = zip(before, after, YUMI_LIMITS.velocity, strict=True)
        assert all(abs(new - old) <= 1.001 * top * CYCLE for old, new, top in rows)


def test_goal_whose_controller_is_active_switches_nothing(arm: DeliveredArm) -> None:
    arm.commands.switch_controllers(SIDE, (NAME,), (OTHER,))
    arm.run(0.2)
    assert arm.send(swing(HOME, 0.5, 1.0)) == {}


def test_goal_is_refused_while_a_stream_comes_though_the_arm_stands(arm: DeliveredArm) -> None:
    arm.stream(*HOME)
    arm.run(0.5)
    with refused(CommandRefused, "controller_inactive", controller=NAME, commanding=(OTHER,)):
        arm.send(swing(HOME, 0.5, 1.0))
    assert arm.active == {OTHER}
    arm.run(1.0)  # nothing comes any more
    assert arm.send(swing(HOME, 0.5, 1.0)) == {SIDE: (OTHER,)}


def test_goal_is_refused_while_another_one_moves_the_arm(arm: DeliveredArm) -> None:
    arm.stream(*moved(HOME, 1.0))
    arm.run(0.3)
    with refused(CommandRefused, "controller_inactive", controller=NAME, commanding=(OTHER,)):
        arm.send(swing(HOME, 0.5, 1.0))
    position = [cycle.state.position[6] for cycle in arm.run(2.0)]
    assert arm.active == {OTHER}
    assert position[-1] != pytest.approx(HOME[6], abs=0.1)  # and went on


def test_command_that_does_not_take_over_is_refused_as_ever(arm: DeliveredArm) -> None:
    with refused(CommandRefused, "controller_not_active", controller=NAME, state="inactive"):
        arm.send(swing(HOME, 0.5, 1.0), takes_over=False)
    assert arm.active == {OTHER}


def test_goal_that_its_controller_refuses_leaves_the_other_one_active(arm: DeliveredArm) -> None:
    late = swing(HOME, 0.5, 1.0, start=arm.loop.clock.now() - 5.0)
    with refused(CommandRefused, "trajectory_is_over"):
        arm.send(late)
    assert arm.active == {OTHER}


def test_goal_activates_nothing_after_what_commanded_the_arm_was_ended(arm: DeliveredArm) -> None:
    """A client that sends its goal again and again must not be who brings an arm back."""
    assert arm.loop.manager.deactivate_commanding() == (OTHER,)  # as where feedback is lost, or references are ignored
    arm.run(0.2)
    with refused(CommandRefused, "controllers_were_ended", controller=NAME):
        arm.send(swing(HOME, 0.5, 1.0))
    assert arm.active == set()
    arm.commands.switch_controllers(SIDE, (OTHER,))  # as recovery does
    arm.run(0.2)
    assert arm.send(swing(HOME, 0.5, 1.0)) == {SIDE: (OTHER,)}


def test_controller_whose_check_fails_leaves_the_other_one_active(
    arm: DeliveredArm, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("a fault of ours")

    monkeypatch.setattr(JointTrajectoryController, "check", fail)
    with pytest.raises(Exception, match="a fault of ours"):
        arm.send(swing(HOME, 0.5, 1.0))
    assert arm.active == {OTHER}
