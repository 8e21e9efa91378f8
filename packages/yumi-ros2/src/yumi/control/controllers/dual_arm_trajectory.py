"""The dual-arm trajectory controllers: each follows one arm's half of a motion of both."""

from __future__ import annotations

from math import inf

from abb_protocols.catalogue import Message, message
from abb_protocols.robot.joints import YUMI_LIMITS, ZERO_JOINTS, ArmState, JointLimits, Side
from yumi.control.controllers.joint_trajectory import JointTrajectoryController
from yumi.control.controllers.trajectory_goal import TrajectoryGoal, TrajectoryPhase
from yumi.control.goals import Buffer
from yumi.control.place import Place
from yumi.control.shared_state import Skew, TrajectoryFeedback
from yumi.control.speed_scale import SpeedScale
from yumi.control.trajectory_commands import CancelTrajectory, FollowTrajectory, ResultCode, TrajectoryOutcome

_OTHER_ARM_TIMEOUT = 0.250
"""An arm that has not followed the common trajectory for so long does not follow it any more [s]. What ends its motion
ends the other's at once; what remains is a robot whose datagrams do not come, which may be late by tens of ms."""


class DualArmTrajectoryController(JointTrajectoryController):
    """One arm's half of a motion of both arms; an end of one arm's motion ends the other's.

    Args:
        side: its arm.
        feedback: where others see how it follows.
        halves: of this controller that are active, by arm; shared by both.
        limits: what the joints may do.
        speed: the factor on the arm's speed.
    """

    kind = "yumi_controllers/DualArmTrajectoryController"

    def __init__(
        self,
        side: Side,
        feedback: Buffer[TrajectoryFeedback],
        halves: dict[Side, object],
        limits: JointLimits = YUMI_LIMITS,
        speed: SpeedScale | None = None,
    ) -> None:
        super().__init__(side, feedback, limits, speed, halves)
        self._worst_skew = self._start_skew = 0.0
        self._followed_together = -inf

    @classmethod
    def make(cls, place: Place) -> DualArmTrajectoryController:
        return cls(place.side, place.buffers.dual_trajectory, place.halves, place.limits, place.speed)

    def _time_at_once(self, state: ArmState) -> float:
        """Arms at rest take the newer of their datagrams as the start, so that they are in step from the first cycle.

        One that moves goes on from its own newest command.
        """
        other = self._other_half
        if other is None or other._state is None or self._source.setpoint(self._time).velocity is not ZERO_JOINTS:
            return 0.0
        return min(0.0, state.time - other._state.time)

    def _follow(self, command: FollowTrajectory) -> None:
        super()._follow(command)
        assert self._state is not None
        self._worst_skew = self._start_skew = 0.0
        self._followed_together = max(self._state.time, command.plan.start or -inf)

    def _cancel(self, command: CancelTrajectory) -> None:
        goal = self._goal
        super()._cancel(command)
        other = goal and self._other(goal)
        if goal is not None and other and goal.is_cancelled and not other._is_cancelled:
            other._cancel(CancelTrajectory(goal.number))

    def _compare_arms(self, goal: TrajectoryGoal, state: ArmState) -> None:
        other = self._other(goal)
        if other is not None and other._goal is not None and other._state is not None:
            theirs = other._goal
            self._followed_together = max(self._followed_together, other._state.time)
            is_under_way = self._pace == 1.0 or max(self._time, other._time) < goal.end  # waiting is not slowed down
            if is_under_way and not goal.is_cancelled and goal.first and theirs.first:
                self._start_skew = goal.first - theirs.first
                if self._pace > 0.0:
                    difference = (self._time - other._time) / self._pace - (state.time - other._state.time)
                    self._worst_skew = max(self._worst_skew, abs(difference))
        silence = state.time - self._followed_together
        if silence > _OTHER_ARM_TIMEOUT and not goal.is_cancelled:
            self._abort(ResultCode.INVALID_GOAL, message("other_arm_not_following", silence=silence))

    def _may_succeed(self, goal: TrajectoryGoal) -> bool:
        other = self._other(goal)
        return other is not None and other._goal is not None and other._goal.phase is TrajectoryPhase.REACHED

    def _end(self, outcome: TrajectoryOutcome, code: ResultCode, said: Message, *, is_replaced: bool = False) -> None:
        goal = self._goal
        super()._end(outcome, code, said, is_replaced=is_replaced)
        other = goal and self._other(goal)
        if not other:
            return
        if outcome is TrajectoryOutcome.SUCCEEDED:
            other._succeed()
        elif outcome is TrajectoryOutcome.ABORTED and not is_replaced:
            other._abort(code, message("other_arm_aborted"))

    @property
    def _skew(self) -> Skew:
        return Skew(self._start_skew, self._worst_skew)

    @property
    def _is_cancelled(self) -> bool:
        return self._goal is not None and self._goal.is_cancelled

    @property
    def _other_half(self) -> DualArmTrajectoryController | None:
        """The other arm's, while it is active."""
        half = self._halves.get(self._side.other)
        return half if isinstance(half, DualArmTrajectoryController) else None

    def _other(self, goal: TrajectoryGoal) -> DualArmTrajectoryController | None:
        """The other half, while it follows the same trajectory."""
        other = self._other_half
        return other if other and other._goal is not None and other._goal.number == goal.number else None
