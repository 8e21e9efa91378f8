"""One motion along a trajectory, and what is judged of it in every cycle: tolerances, arrival, the partner."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, inf

from yumi.control.spline import Spline, Walk
from yumi.control.trajectory import ResultCode
from yumi.control.trajectory_partner import PARTNER_SILENCE, PartnerReport, Phase, SkewWatch
from yumi.controllers.trajectory_parameters import Bounds
from yumi.robot.values import ArmState

Violation = tuple[ResultCode, str]
"""Why a motion must end: the result code and a sentence."""


class TrajectoryGoal:
    """A motion that somebody waits for.

    Args:
        number: of its order.
        names: of the joints, for sentences.
        spline: the whole way.
        bounds: what ends it.
        start: when it starts, on the machine's monotonic clock [s].

    Attributes:
        number: as above.
        begin: when the way begins, on its own clock [s].
        end: when it ends, on the same clock [s].
        phase: how far it is.
        first: when the first cycle came in which the arm was told to move [s]; 0 before.
        skew: between the partners.
    """

    def __init__(self, number: int, names: Sequence[str], spline: Spline, bounds: Bounds, start: float) -> None:
        self.number = number
        self.begin = spline.begin
        self.phase = Phase.RUNNING
        self.first = 0.0
        self.skew = SkewWatch()
        self._names = names
        self._walk = Walk(spline)
        self.end = spline.end
        self._bounds = bounds
        self._watches_velocity = min(bounds.path_velocity) < inf
        self._heard = start

    @property
    def is_cancelled(self) -> bool:
        """Whether the arm comes to rest because somebody wants it."""
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

    def compare(self, ours: PartnerReport, theirs: PartnerReport | None, rate: float) -> Violation | None:
        """What is wrong with the partner."""
        if theirs is not None and theirs.goal == self.number:
            if theirs.phase is Phase.ABORTED:
                return ResultCode(theirs.code), "The other arm's part of the motion was aborted; both arms stop."
            self._heard = max(self._heard, theirs.time)
            is_under_way = rate == 1.0 or max(ours.progress, theirs.progress) < self.end  # waiting is not slowed down
            if not self.is_cancelled and is_under_way and theirs.phase in (Phase.RUNNING, Phase.REACHED):
                self.skew.note(ours, theirs, rate)
            if theirs.phase in (Phase.SUCCEEDED, Phase.CANCELED):
                return None
        silence = ours.time - self._heard
        if silence > PARTNER_SILENCE and not self.is_cancelled:
            return ResultCode.INVALID_GOAL, (
                f"The other arm has not followed the trajectory for {silence * 1e3:.0f} ms; both arms stop."
            )
        return None

    def _judge_way(self, time: float, state: ArmState, pace: float | None) -> Violation | None:
        bounds, desired = self._bounds, self._walk.position(time)
        for index, (wanted, actual, bound) in enumerate(zip(desired, state.position, bounds.path, strict=True)):
            if not -bound <= actual - wanted <= bound:
                return ResultCode.PATH_TOLERANCE_VIOLATED, (
                    f"{self._names[index]} was {degrees(actual - wanted):+.2f}° from the trajectory at {time:.3f} s; "
                    f"its path tolerance is {degrees(bound):.2f}°."
                )
        return None if pace is None or not self._watches_velocity else self._judge_speed(time, state, pace)

    def _judge_speed(self, time: float, state: ArmState, pace: float) -> Violation | None:
        desired = [pace * speed for speed in self._walk.motion(time)[1]]
        for index, (wanted, actual, bound) in enumerate(
            zip(desired, state.velocity, self._bounds.path_velocity, strict=True)
        ):
            if not -bound <= actual - wanted <= bound:
                return ResultCode.PATH_TOLERANCE_VIOLATED, (
                    f"{self._names[index]} was {actual - wanted:+.3f} rad/s off the planned speed at {time:.3f} s; "
                    f"its path tolerance is {bound:.3f} rad/s."
                )
        return None

    def _has_arrived(self, state: ArmState) -> bool:
        goal, bounds = self._walk.position(self.end), self._bounds
        return all(
            -bound <= actual - wanted <= bound
            for wanted, actual, bound in zip(goal, state.position, bounds.goal, strict=True)
        ) and all(-bound <= speed <= bound for speed, bound in zip(state.velocity, bounds.goal_velocity, strict=True))

    def _missed_goal(self, time: float, state: ArmState) -> str:
        goal, late = self._walk.position(self.end), time - self.end
        for index, (wanted, actual, bound) in enumerate(zip(goal, state.position, self._bounds.goal, strict=True)):
            if not -bound <= actual - wanted <= bound:
                return (
                    f"{self._names[index]} was still {degrees(actual - wanted):+.2f}° from the goal {late:.2f} s after "
                    f"the end of the trajectory; its goal tolerance is {degrees(bound):.2f}°."
                )
        return f"The arm still moved {late:.2f} s after the end of the trajectory."
