"""The state of an arm, as shared memory holds it for the driver: snapshots, joint states, feedback of trajectories."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple, Protocol

from abb_protocols.catalogue import Message, clause, message
from abb_protocols.robot.joints import ZERO_JOINTS, Joints, Side
from yumi.control.counters import LimiterCounters, WireCounters
from yumi.control.goals import Buffer, GoalKind
from yumi.control.motion.setpoint import largest_difference
from yumi.control.motion.standstill import STANDSTILL_TOLERANCE


class ArmProblem(IntEnum):
    """Why an arm holds whatever it is asked to do.

    REFERENCES_IGNORED: the robot plans to stand although it is commanded to move.
    IMPLAUSIBLE: it reports positions that the arm cannot have reached.
    """

    NONE = 0
    REFERENCES_IGNORED = 1
    IMPLAUSIBLE = 2


ARM_PROBLEM_CODES = {
    ArmProblem.REFERENCES_IGNORED: "references_ignored",
    ArmProblem.IMPLAUSIBLE: "feedback_implausible",
}
"""The code of each problem in the catalogue; its value is the arm."""

_UNDECIDED = 0.05
"""Parts further apart than this limit an arm only where it was not calculated in time that they do not [m]."""


@dataclass(frozen=True, slots=True)
class Limited:
    """What limits an arm.

    Attributes:
        part: of the arm, e.g. ``right gripper``.
        other: of the other arm, ``body``, or a box by its name.
        distance: between them now [m].
    """

    part: str
    other: str
    distance: float

    @property
    def said(self) -> Message:
        """The two parts and how near they are."""
        if self.distance < _UNDECIDED:
            return message("parts_near", part=self.part, other=self.other, distance=self.distance)
        # What needs more distances than a cycle has counts as too near, wherever it is.
        return message("parts_not_compared", part=self.part, other=self.other, distance=self.distance)

    def __str__(self) -> str:
        return clause(self.said)


class Snapshot(NamedTuple):
    """One arm after its last cycle.

    Attributes:
        time: when it was made, monotonic clock [s].
        is_streaming: whether the robot's datagrams arrive.
        is_running: whether the robot follows our commands.
        activation: number of the controller activation that commands the arm, 0 when none does.
        goal_kind: which goals the controllers take that command the arm.
        activity: counts every change of which controllers there are and of their and the hardware's states.
        position: measured positions [rad].
        velocity: measured velocities [rad/s].
        sent: the position sent last [rad].
        reference: where the active controller is going [rad]; None when no controller commands.
        cycles: datagrams answered.
        wire: what its connection has received.
        limiter: what its limiter has changed.
        limited_part: the part of the arm that is kept apart from ``limited_other``; empty 0.2 s after it was.
        limited_other: a part of the other arm, ``body``, or a box by its name.
        limited_distance: between the two [m].
        speed_cap: no speed scale is above this, whatever is set: less than 1 while parts may touch.
        interruptions: how often feedback stayed away for more than five cycles.
        problem: why the arm holds whatever it is asked to do.
    """

    time: float = 0.0
    is_streaming: bool = False
    is_running: bool = False
    activation: int = 0
    goal_kind: GoalKind = GoalKind.NONE
    activity: int = 0
    position: Joints = ZERO_JOINTS
    velocity: Joints = ZERO_JOINTS
    sent: Joints = ZERO_JOINTS
    reference: Joints | None = None
    cycles: int = 0
    wire: WireCounters = WireCounters()
    limiter: LimiterCounters = LimiterCounters()
    limited_part: str = ""
    limited_other: str = ""
    limited_distance: float = 0.0
    speed_cap: float = 1.0
    interruptions: int = 0
    problem: ArmProblem = ArmProblem.NONE

    @property
    def session(self) -> int:
        """EGM session, 0 before the first."""
        return self.wire.session

    @property
    def is_commanded(self) -> bool:
        """Whether a controller that commands the arm is active."""
        return self.activation > 0

    @property
    def command_epoch(self) -> tuple[int, int]:
        """What changes when EGM begins anew or another controller commands: session and activation."""
        return self.session, self.activation

    @property
    def is_on_way(self) -> bool:
        """Whether a goal sends the arm elsewhere than it is, however slowly, or while it is held; not of a stream."""
        is_stream = self.goal_kind != GoalKind.NONE
        return (
            not is_stream
            and self.reference is not None
            and largest_difference(self.reference, self.sent) > STANDSTILL_TOLERANCE
        )

    @property
    def limited(self) -> Limited | None:
        """What the arm is kept apart from; None while it is not."""
        return Limited(self.limited_part, self.limited_other, self.limited_distance) if self.limited_part else None

    @property
    def limited_by(self) -> str:
        """The same in words; empty while it is not."""
        return str(self.limited or "")


class Snapshots(Protocol):
    """Has the snapshots of the control loop."""

    def snapshot(self, side: Side) -> Snapshot:
        """An arm after its last cycle."""


def read_snapshot(buffer: Buffer[Snapshot]) -> Snapshot:
    """What is known of the arm; the empty snapshot while nothing is."""
    newest = buffer.read()
    return Snapshot() if newest is None else newest[1]


class JointStates(NamedTuple):
    """One measured state.

    Attributes:
        time: when it arrived, monotonic clock [s].
        position: [rad], (7,).
        velocity: [rad/s], (7,).
    """

    time: float
    position: Joints
    velocity: Joints


class Skew(NamedTuple):
    """How far apart in time two arms were that follow one trajectory.

    Attributes:
        start: between their first cycles [s].
        worst: largest difference of where they were commanded to be on it [s].
    """

    start: float = 0.0
    worst: float = 0.0


class TrajectoryFeedback(NamedTuple):
    """One look at an arm that a trajectory controller commands.

    Attributes:
        goal: number of the command it follows, 0 while it holds.
        time: of the state, on the machine's monotonic clock [s].
        progress: the desired time on the trajectory [s].
        scale: how fast time goes by on the trajectory.
        skew: of the arms that follow it together; zeros for one arm.
        desired: where it should be [rad], (7,).
        desired_velocity: [rad/s], (7,).
        actual: where it is [rad], (7,).
        actual_velocity: [rad/s], (7,).
        output: where it is commanded to be, ahead of ``desired`` by the arm's delay [rad], (7,).
        output_velocity: the speed commanded beside it [rad/s], (7,).
        monitor_period: the action's feedback is given so often [s].
    """

    goal: int
    time: float
    progress: float
    scale: float
    skew: Skew
    desired: Joints
    desired_velocity: Joints
    actual: Joints
    actual_velocity: Joints
    output: Joints
    output_velocity: Joints
    monitor_period: float


class SharedDeadline(NamedTuple):
    """Until when the one who commands an arm must be heard again.

    Attributes:
        heard: when it was heard last, on the machine's monotonic clock [s].
        silence: for so long it may be silent then [s].
        activation: of the controllers that it commands; any later one is another client's.
    """

    heard: float
    silence: float
    activation: int
