"""The goal judge: whether an arm keeps to its trajectory within the tolerances, and whether it has arrived."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum, auto
from math import inf

from abb_protocols.catalogue import Message, message
from abb_protocols.robot.joints import ZERO_JOINTS, ArmState
from yumi.control.motion.spline import Spline, SplineSampler
from yumi.control.trajectory_commands import ResultCode, Tolerances


class TrajectoryPhase(Enum):
    """How far an arm is with a trajectory."""

    RUNNING = auto()
    REACHED = auto()
    CANCELED = auto()


_ELSEWHERE = 0.05  # [rad] an arm that is so far from its goal has not reached it, where any distance is tolerated

_Violation = tuple[ResultCode, Message]
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
        self.phase = TrajectoryPhase.RUNNING
        self.first = 0.0
        self._names = names
        self._sampler = SplineSampler(spline)
        self.end = spline.end
        self._bounds = tolerances
        self._goal_bounds = [_ELSEWHERE if each == inf else each for each in tolerances.goal]
        self._watches_velocity = min(tolerances.path_velocity) < inf

    @property
    def is_cancelled(self) -> bool:
        """Whether the arm comes to rest because it was cancelled."""
        return self.phase is TrajectoryPhase.CANCELED

    def judge(self, time: float, state: ArmState, pace: float | None = 1.0) -> _Violation | None:
        """What is wrong with an arm that should be where the trajectory was at ``time`` [s]; notes its arrival.

        ``pace`` is how fast time goes by on the trajectory; None while that changes, which leaves speeds unjudged.
        """
        if time < self.begin:
            return None
        if time < self.end:
            return self._judge_way(time, state, pace)
        if self.phase is not TrajectoryPhase.RUNNING:
            return None
        late, goal = time - self.end, self._sampler.position(self.end)
        off = _first_beyond(goal, state.position, self._goal_bounds)
        if off is None and _first_beyond(ZERO_JOINTS, state.velocity, self._bounds.goal_velocity) is None:
            self.phase = TrajectoryPhase.REACHED
        elif late > self._bounds.goal_time:
            if off is None:
                return ResultCode.GOAL_TOLERANCE_VIOLATED, message("arm_moved_after_trajectory", late=late)
            index, distance, bound = off
            return ResultCode.GOAL_TOLERANCE_VIOLATED, message(
                "joint_off_goal", joint=self._names[index], distance=distance, late=late, tolerance=bound
            )
        return None

    def _judge_way(self, time: float, state: ArmState, pace: float | None) -> _Violation | None:
        off = _first_beyond(self._sampler.position(time), state.position, self._bounds.path)
        if off is not None:
            index, distance, bound = off
            return ResultCode.PATH_TOLERANCE_VIOLATED, message(
                "joint_off_trajectory", joint=self._names[index], distance=distance, time=time, tolerance=bound
            )
        if pace is None or not self._watches_velocity:
            return None
        speeds = [pace * speed for speed in self._sampler.motion(time)[1]]
        off = _first_beyond(speeds, state.velocity, self._bounds.path_velocity)
        if off is not None:
            index, difference, bound = off
            return ResultCode.PATH_TOLERANCE_VIOLATED, message(
                "joint_off_speed", joint=self._names[index], difference=difference, time=time, tolerance=bound
            )
        return None


def _first_beyond(
    desired: Sequence[float], actual: Sequence[float], bounds: Sequence[float]
) -> tuple[int, float, float] | None:
    """The first joint that is beyond its bound, by how much it differs, and the bound; a NaN is beyond any."""
    for index, (wanted, value, bound) in enumerate(zip(desired, actual, bounds, strict=True)):
        if not -bound <= value - wanted <= bound:
            return index, value - wanted, bound
    return None
