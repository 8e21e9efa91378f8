"""Both virtual arms with their halves of the dual-arm controller, in virtual time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import radians

from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Joints, Side, joints
from yumi.control.controllers.dual_arm_trajectory import DualArmTrajectoryController
from yumi.control.goals import MemoryBuffer
from yumi.control.loop_events import ControllerReport
from yumi.control.shared_state import TrajectoryFeedback
from yumi.control.speed_scale import SpeedScale
from yumi.control.trajectory_commands import FollowTrajectory, Tolerances, TrajectoryEnded
from yumi.planning.trajectory_request import JointTrajectory, plan_trajectory
from yumi_evaluation.virtual_time import VirtualArmRig

NAME = "dual_arm_trajectory_controller"
HALF_A_DEGREE = Tolerances(path=joints([radians(0.5)] * 7), goal=joints([radians(0.5)] * 7), goal_time=1.0)


class DualArms:
    """Two arms that take turns in each cycle.

    Attributes:
        scales: where each arm's factor on its speeds is put.
        arms: each with its controller active.
        ended: what each controller told when a motion ended.
    """

    def __init__(self) -> None:
        self.scales = {side: MemoryBuffer() for side in Side}
        self._halves: dict[Side, object] = {}
        self._feedback = {side: MemoryBuffer() for side in Side}
        self.arms: Mapping[Side, VirtualArmRig] = {side: self._arm(side) for side in Side}
        self.ended: dict[Side, list[TrajectoryEnded]] = {side: [] for side in Side}
        for arm in self.arms.values():
            arm.start()
            arm.switch_to(NAME)

    def _arm(self, side: Side) -> VirtualArmRig:
        speed = SpeedScale(self.scales[side])
        half = DualArmTrajectoryController(side, self._feedback[side], self._halves, speed=speed)
        return VirtualArmRig({NAME: half}, side=side, speed=speed)

    @property
    def now(self) -> float:
        return max(arm.clock.now() for arm in self.arms.values())

    def positions(self) -> dict[Side, Joints]:
        return {side: arm.snapshot.position for side, arm in self.arms.items()}

    def feedback(self, side: Side) -> TrajectoryFeedback:
        letter = self._feedback[side].read()
        assert letter is not None
        return letter[1]

    def send(
        self,
        trajectory: JointTrajectory,
        goal: int = 1,
        tolerances: Tolerances = HALF_A_DEGREE,
        *,
        is_at_once: bool = False,
    ) -> None:
        """Both arms check their half before either takes it; it starts a dozen cycles from now, or at once."""
        start = None if is_at_once else self.now + 12 * CYCLE
        plans = plan_trajectory(replace(trajectory, start=start), tuple(Side), YUMI_LIMITS)
        orders = {side: FollowTrajectory(plan, goal, tolerances) for side, plan in plans.items()}
        for side, arm in self.arms.items():
            arm.manager.check(NAME, orders[side], arm.line.state)
        self.order(orders)

    def order(self, orders: Mapping[Side, object]) -> None:
        """Have the named arms take an order each."""
        for side, order in orders.items():
            arm = self.arms[side]
            arm.manager.receive(NAME, order, arm.line.state)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / CYCLE)):
            self.cycle()

    def run_until(self, is_so: Callable[[], bool], limit: float) -> None:
        for _ in range(round(limit / CYCLE)):
            if is_so():
                return
            self.cycle()
        raise AssertionError(f"not within {limit} s")

    def cycle(self) -> None:
        for side, arm in self.arms.items():
            seen = len(arm.events)
            arm.cycle()
            notices = (event.report for event in arm.events[seen:] if isinstance(event, ControllerReport))
            self.ended[side] += [notice for notice in notices if isinstance(notice, TrajectoryEnded)]

    @property
    def is_over(self) -> bool:
        """Whether both arms have told an end."""
        return all(self.ended.values())
