"""The goal judge: whether an arm keeps to its trajectory within the tolerances, and whether it has arrived."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum, auto
from math import inf

from yumi.catalogue import Message, message
from yumi.control.motion.spline import Spline, SplineSampler
from yumi.control.trajectory_commands import ResultCode, Tolerances
from yumi.robot.joints import ArmState


class Phase(Enum):
    """How far an arm is with a trajectory."""

    RUNNING = auto()
    REACHED = auto()
    CANCELED = auto()


Violation = tuple[ResultCode, Message]
"""Why a motion must end: the result code, and the same for a person."""


class TrajectoryGoal:
    """A motion along one trajectory.

    Args:
        number: of its command.
        names: of the joints, for sentences.
        spline: the whole way.
        tolerances: as they are applied; what ends it.

    Attributes:
        number: as above.
        begin: when the way begins, on its own clock [s].
        end: when it ends, on the same clock [s].
        phase: how far it is.
        first: when the first cycle came in which the arm was commanded to move [s]; 0 before.
    """

    def __init__(self, number: int, names: Sequence[str], spline: Spline, tolerances: Tolerances) -> None:
        self.number = number
        self.begin = spline.begin
        self.phase = Phase.RUNNING
        self.first = 0.0
        self._names = names
        self._walk = SplineSampler(spline)
        self.end = spline.end
        self._bounds = tolerances
        self._watches_velocity = min(tolerances.path_velocity) < inf

    @property
    def is_cancelled(self) -> bool:
        """Whether the arm comes to rest because it was cancelled."""
        return self.phase is Phase.CANCELED

    def judge(self, time: float, state: ArmState, pace: float | None = 1.0) -> Violation | None:
        """What is wrong with an arm that should be where the trajectory was at ``time`` [s]; notes its arrival.

        ``pace`` is how fast time goes by on the trajectory; None while that changes, which leaves speeds unjudged.
        """
        if time < self.begin:
            return None
        if time < self.end:
            return self._judge_way(time, state, pace)
        if self.phase is Phase.RUNNING and self._has_arrived(state):
            self.phase = Phase.REACHED
        if self.phase is Phase.RUNNING and time - self.end > self._bounds.goal_time:
            return ResultCode.GOAL_TOLERANCE_VIOLATED, self._missed_goal(time, state)
        return None

    def _judge_way(self, time: float, state: ArmState, pace: float | None) -> Violation | None:
        bounds, desired = self._bounds, self._walk.position(time)
        for index, (wanted, actual, bound) in enumerate(zip(desired, state.position, bounds.path, strict=True)):
            if not -bound <= actual - wanted <= bound:
                return ResultCode.PATH_TOLERANCE_VIOLATED, message(
                    "joint_off_trajectory",
                    joint=self._names[index],
                    distance=actual - wanted,
                    time=time,
                    tolerance=bound,
                )
        if pace is None or not self._watches_velocity:
            return None
        speeds = [pace * speed for speed in self._walk.motion(time)[1]]
        for index, (wanted, actual, bound) in enumerate(zip(speeds, state.velocity, bounds.path_velocity, strict=True)):
            if not -bound <= actual - wanted <= bound:
                return ResultCode.PATH_TOLERANCE_VIOLATED, message(
                    "joint_off_speed",
                    joint=self._names[index],
                    difference=actual - wanted,
                    time=time,
                    tolerance=bound,
                )
        return None

    def _has_arrived(self, state: ArmState) -> bool:
        goal, bounds = self._walk.position(self.end), self._bounds
        return all(
            abs(actual - wanted) <= (_ELSEWHERE if bound == inf else bound)
            for wanted, actual, bound in zip(goal, state.position, bounds.goal, strict=True)
        ) and all(-bound <= speed <= bound for speed, bound in zip(state.velocity, bounds.goal_velocity, strict=True))

    def _missed_goal(self, time: float, state: ArmState) -> Message:
        goal, late = self._walk.position(self.end), time - self.end
        for index, (wanted, actual, any_bound) in enumerate(zip(goal, state.position, self._bounds.goal, strict=True)):
            bound = _ELSEWHERE if any_bound == inf else any_bound
            if not -bound <= actual - wanted <= bound:
                return message(
                    "joint_off_goal", joint=self._names[index], distance=actual - wanted, late=late, tolerance=bound
                )
        return message("arm_moved_after_trajectory", late=late)


_ELSEWHERE = 0.05  # [rad] an arm that is so far from its goal has not reached it, where any distance is tolerated
