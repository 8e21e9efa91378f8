"""Commands of the trajectory controllers: plan, tolerances, cancel and speed; and the report of a motion that ended."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum
from math import inf

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import TrajectoryRefused
from abb_protocols.robot.joints import ZERO_JOINTS, Joints, Side, joints
from yumi.control.motion.spline import Spline, TrajectoryPoint
from yumi.control.shared_state import Skew


class ResultCode(IntEnum):
    """How the motion along a trajectory ended; the numbers of control_msgs/action/FollowJointTrajectory."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


@dataclass(frozen=True, slots=True)
class ArmPlan:
    """One arm's part of a checked trajectory.

    Attributes:
        side: which arm.
        first: its first point, chain order.
        spline: the way from there on, seven joints in chain order.
        start: when it starts, on the machine's monotonic clock [s]; None is at once.
        left_out: the joints that the trajectory does not name.
        is_smoothed: whether its points came without velocities and got them here: an arm that cannot be at the first
            one in time may leave for a later one.
    """

    side: Side
    first: TrajectoryPoint
    spline: Spline
    start: float | None
    left_out: tuple[str, ...] = ()
    is_smoothed: bool = False


def trajectory_refused(said: Message, code: ResultCode = ResultCode.INVALID_GOAL) -> TrajectoryRefused:
    """The error for a trajectory that cannot be followed."""
    return TrajectoryRefused(said, code)


DEFAULT_TOLERANCE = 0.0
"""A tolerance that takes the controller's own value."""

UNLIMITED_TOLERANCE = -1.0
"""A tolerance that tolerates everything."""


@dataclass(frozen=True, slots=True)
class Tolerances:
    """How far an arm may be from its trajectory.

    Any value may be :data:`DEFAULT_TOLERANCE` or :data:`UNLIMITED_TOLERANCE`.

    As a controller applies them there is neither of both: infinity where there is no tolerance.

    Attributes:
        path: on the way [rad], (7,).
        path_velocity: on the way [rad/s], (7,).
        goal: at the end [rad], (7,).
        goal_velocity: at the end [rad/s], (7,).
        goal_time: how much later than planned the goal may be reached [s].
    """

    path: Joints = ZERO_JOINTS
    path_velocity: Joints = ZERO_JOINTS
    goal: Joints = ZERO_JOINTS
    goal_velocity: Joints = ZERO_JOINTS
    goal_time: float = DEFAULT_TOLERANCE

    @property
    def values(self) -> tuple[float, ...]:
        """All of them."""
        return (*self.path, *self.path_velocity, *self.goal, *self.goal_velocity, self.goal_time)

    def applied(self, own: Tolerances) -> Tolerances:
        """As a controller applies them that has its ``own``."""

        def choose(given: float, default: float) -> float:
            return default if given == DEFAULT_TOLERANCE else inf if given == UNLIMITED_TOLERANCE else given

        def choose_each(given: Joints, default: Joints) -> Joints:
            return joints(list(map(choose, given, default)))

        return Tolerances(
            choose_each(self.path, own.path),
            choose_each(self.path_velocity, own.path_velocity),
            choose_each(self.goal, own.goal),
            choose_each(self.goal_velocity, own.goal_velocity),
            choose(self.goal_time, own.goal_time),
        )


@dataclass(frozen=True, slots=True)
class FollowTrajectory:
    """A command: follow a trajectory, in place of whatever the arm does now.

    Attributes:
        plan: the arm's part of it.
        goal: number by which its end is reported; each command has its own.
        tolerances: what ends it.
    """

    plan: ArmPlan
    goal: int
    tolerances: Tolerances = Tolerances()


@dataclass(frozen=True, slots=True)
class CancelTrajectory:
    """A command: come to rest within the limits.

    Attributes:
        goal: which motion; another one goes on. None ends any.
    """

    goal: int | None = None


@dataclass(frozen=True, slots=True)
class ScaleSpeed:
    """A command: let time on the trajectory go by slower or faster than outside.

    Attributes:
        factor: of the speed, 0 to 1.
    """

    factor: float


class TrajectoryOutcome(Enum):
    """How a motion ended: the terminal states of a ROS action."""

    SUCCEEDED = "succeeded"
    ABORTED = "aborted"
    CANCELED = "canceled"


@dataclass(frozen=True, slots=True)
class TrajectoryEnded:
    """A report: a motion has ended.

    Attributes:
        goal: the number of its command.
        outcome: how.
        code: the result code that says so.
        said: the same for a person.
        skew: of the arms that followed it together; None for one arm.
    """

    goal: int
    outcome: TrajectoryOutcome
    code: ResultCode
    said: Message
    skew: Skew | None = None

    def __str__(self) -> str:
        return str(message("trajectory_ended", outcome=self.outcome.value, reason=self.said))
