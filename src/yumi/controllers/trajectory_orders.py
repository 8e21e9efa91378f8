"""What a trajectory controller is told, and what it tells: plain values that cross between processes."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from yumi.control.trajectory import ArmPlan, ResultCode
from yumi.control.trajectory_feedback import Skew
from yumi.robot.joints import Joints
from yumi.robot.values import ZERO

DEFAULT = 0.0
"""A tolerance that takes the controller's own value."""

UNLIMITED = -1.0
"""A tolerance that tolerates everything."""


@dataclass(frozen=True, slots=True)
class Tolerances:
    """How far an arm may be from its trajectory; :data:`DEFAULT` and :data:`UNLIMITED` in place of any value.

    Attributes:
        path: on the way [rad], (7,).
        path_velocity: on the way [rad/s], (7,).
        goal: at the end [rad], (7,).
        goal_velocity: at the end [rad/s], (7,).
        goal_time: how much later than planned the goal may be reached [s].
    """

    path: Joints = ZERO
    path_velocity: Joints = ZERO
    goal: Joints = ZERO
    goal_velocity: Joints = ZERO
    goal_time: float = DEFAULT

    @property
    def values(self) -> tuple[float, ...]:
        """All of them."""
        return (*self.path, *self.path_velocity, *self.goal, *self.goal_velocity, self.goal_time)


@dataclass(frozen=True, slots=True)
class FollowTrajectory:
    """An order: follow a trajectory, in place of whatever the arm does now.

    Attributes:
        plan: the arm's part of it.
        goal: number by which its end is told; each order has its own.
        tolerances: what ends it.
    """

    plan: ArmPlan
    goal: int
    tolerances: Tolerances = Tolerances()


@dataclass(frozen=True, slots=True)
class CancelTrajectory:
    """An order: come to rest within the limits.

    Attributes:
        goal: which motion; another one goes on. None ends any.
    """

    goal: int | None = None


@dataclass(frozen=True, slots=True)
class ScaleSpeed:
    """An order: let time on the trajectory go by slower or faster than outside.

    Attributes:
        factor: of the speed, 0 to 1.
    """

    factor: float


class Outcome(Enum):
    """How a motion ended: the terminal states of a ROS action."""

    SUCCEEDED = "succeeded"
    ABORTED = "aborted"
    CANCELED = "canceled"


@dataclass(frozen=True, slots=True)
class TrajectoryEnded:
    """A notice: a motion has ended.

    Attributes:
        goal: the number of its order.
        outcome: how.
        code: the result code that says so.
        sentence: the same for a person.
        skew: of the arms that followed it together; None for one arm.
    """

    goal: int
    outcome: Outcome
    code: ResultCode
    sentence: str
    skew: Skew | None = None

    def __str__(self) -> str:
        return f"{self.outcome.value}: {self.sentence}"
