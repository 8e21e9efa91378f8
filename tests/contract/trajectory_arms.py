"""An arm with a trajectory controller: the perfect arm in memory, and the virtual arm over the wire."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Joints, Side, home, joint_names
from abb_runtime.clock import ManualClock
from abb_runtime.parameters import Values
from controller_arms import LimitedArm, PerfectArm
from reported_limiter import ReportedLimiter
from yumi.control.controllers.joint_trajectory import JointTrajectoryController
from yumi.control.cycle import Cycle
from yumi.control.goals import MemoryBuffer
from yumi.control.loop import ArmLoop
from yumi.control.loop_events import ControllerReport, Event
from yumi.control.manager.controller_manager import ControllerManager
from yumi.control.shared_state import TrajectoryFeedback
from yumi.control.trajectory_commands import ArmPlan, FollowTrajectory, Tolerances, TrajectoryEnded
from yumi_evaluation.virtual_time import VirtualArmRig

NAME = "joint_trajectory_controller"
SIDE = Side.LEFT


class Loop(Protocol):
    """Cycles of one arm."""

    manager: ControllerManager
    line: ArmLoop
    clock: ManualClock
    cycles: list[Cycle]
    events: list[Event]

    def cycle(self) -> None: ...


class PerfectLoop:
    """A perfect arm in memory, as :class:`VirtualArmRig` is a virtual one."""

    def __init__(self, controller: JointTrajectoryController) -> None:
        self.clock = ManualClock(100.0)
        self.manager = ControllerManager(joint_names(SIDE))
        self.manager.load(NAME, controller)
        self.manager.configure(NAME)
        self.arm = PerfectArm(home(SIDE))
        limiter = ReportedLimiter(YUMI_LIMITS, gain=0.0)  # it has no position loop
        self.line = ArmLoop(SIDE, LimitedArm(self.arm, limiter), self.manager, limiter, MemoryBuffer())
        self.cycles: list[Cycle] = []
        self.events: list[Event] = []

    def cycle(self) -> None:
        self.clock.advance(CYCLE)
        cycle = self.line.run(self.clock.now())
        assert cycle is not None
        self.cycles.append(cycle)
        self.events += self.line.take_events()


class TrajectoryArm:
    """One arm, its controller active.

    Attributes:
        ended: what the controller told of ended motions.
    """

    def __init__(self, loop: Callable[[JointTrajectoryController], Loop], parameters: Values) -> None:
        self._feedback = MemoryBuffer()
        self.loop = loop(JointTrajectoryController(SIDE, self._feedback))
        self.set(parameters)
        self.run(0.05)
        self.loop.manager.switch((NAME,), (), self.loop.line.state)
        self.run(0.05)

    @property
    def ended(self) -> list[TrajectoryEnded]:
        notices = (event.report for event in self.loop.events if isinstance(event, ControllerReport))
        return [notice for notice in notices if isinstance(notice, TrajectoryEnded)]

    @property
    def position(self) -> Joints:
        return self.loop.cycles[-1].state.position

    @property
    def velocity(self) -> Joints:
        return self.loop.cycles[-1].state.velocity

    @property
    def now(self) -> float:
        return self.loop.cycles[-1].state.time

    @property
    def feedback(self) -> TrajectoryFeedback:
        letter = self._feedback.read()
        assert letter is not None
        return letter[1]

    @property
    def feedback_count(self) -> int:
        """How many there have been."""
        newest = self._feedback.read()
        return newest[0] if newest else 0

    def set(self, parameters: Values) -> None:
        self.loop.manager.set_parameters(NAME, parameters)

    def order(self, message: object) -> None:
        self.loop.manager.receive(NAME, message, self.loop.line.state)

    def follow(self, plan: ArmPlan, goal: int = 1, tolerances: Tolerances | None = None) -> None:
        self.order(FollowTrajectory(plan, goal, tolerances or Tolerances()))

    def run(self, seconds: float) -> list[Cycle]:
        first = len(self.loop.cycles)
        for _ in range(round(seconds / CYCLE)):
            self.loop.cycle()
        return self.loop.cycles[first:]

    def end(self, limit: float = 10.0) -> TrajectoryEnded:
        """The next end of a motion."""
        known = len(self.ended)
        for _ in range(round(limit / CYCLE)):
            if len(self.ended) > known:
                return self.ended[known]
            self.loop.cycle()
        raise AssertionError(f"no motion ended within {limit} s")


def perfect_arm() -> TrajectoryArm:
    """Its delay is one cycle."""
    return TrajectoryArm(PerfectLoop, {"lookahead": CYCLE})


def virtual_arm() -> TrajectoryArm:
    def loop(controller: JointTrajectoryController) -> Loop:
        arm = VirtualArmRig({NAME: controller}, side=SIDE)
        arm.start()
        return arm

    return TrajectoryArm(loop, {})
