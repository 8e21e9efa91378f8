"""The snapshot: everything about one arm that the world outside the fast line may know, as numbers in a mailbox."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from math import isnan, nan

from yumi.control.goals import GoalKind
from yumi.control.mailbox import Mailbox, Values
from yumi.robot.joints import JOINT_COUNT, Joints, joints
from yumi.robot.values import ZERO

_SCALARS = 25
SNAPSHOT_SIZE = _SCALARS + 4 * JOINT_COUNT
"""Numbers in a snapshot mailbox."""


class Problem(IntEnum):
    """Why an arm holds whatever it is asked to do.

    NOT_FOLLOWING: the robot plans to stand although it is told to move.
    IMPLAUSIBLE: it reports positions that the arm cannot have reached.
    """

    NONE = 0
    NOT_FOLLOWING = 1
    IMPLAUSIBLE = 2


CAUSES = {
    Problem.NOT_FOLLOWING: (
        "the robot does not follow the references: its replies may be lost; check that this machine's firewall lets "
        "UDP out to the controller"
    ),
    Problem.IMPLAUSIBLE: (
        "the robot reports positions that the arm cannot have reached: datagrams are old, forged, or another arm's; "
        "check what else sends to this port, and the remote ports of the controller's UDPUC devices; or a joint stands "
        "out of its range: jog it back"
    ),
}
"""The likely cause of each problem, for a sentence."""


@dataclass(frozen=True, slots=True)
class Snapshot:
    """One arm after its last cycle.

    Attributes:
        time: when it was made, monotonic clock [s].
        session: EGM session, 0 before the first.
        is_streaming: whether the robot's datagrams arrive.
        is_running: whether the robot follows our commands.
        activation: number of the controller activation that commands the arm, 0 when none does.
        goal_kind: which goals the controllers take that command the arm.
        activity: counts every change of which controllers there are and of their and the hardware's states.
        position: measured positions [rad].
        velocity: measured velocities [rad/s].
        admitted: the command sent last [rad].
        reference: where the active controller is going [rad]; None when no controller commands.
        cycles: datagrams answered.
        missed: datagrams the robot sent that got no answer of their own.
        lost: datagrams that never arrived (gaps in the robot's sequence numbers).
        late: datagrams that waited together with a newer one, which was answered instead.
        stale: datagrams that arrived after a newer one was answered.
        repeated: datagrams that arrived before.
        malformed: datagrams that could not be read.
        foreign: datagrams from other addresses than the robot's.
        refused: commands with a value that is no finite number.
        position_limited: commands cut at a joint's range.
        slowed: commands that would have exceeded a speed, acceleration or jerk.
        interruptions: how often feedback stayed away for more than five cycles.
        implausible: positions reported that no arm can have reached.
        problem: why the arm holds whatever it is asked to do.
        jitter: mean difference of two datagrams' delays, in this session [s].
        worst_jitter: the largest such difference [s].
        drift_ppm: by how much the robot's clock is faster than ours [ppm].
        cycle_time: mean time between two datagrams the robot sent, by our clock [s].
    """

    time: float = 0.0
    session: int = 0
    is_streaming: bool = False
    is_running: bool = False
    activation: int = 0
    goal_kind: GoalKind = GoalKind.NONE
    activity: int = 0
    position: Joints = ZERO
    velocity: Joints = ZERO
    admitted: Joints = ZERO
    reference: Joints | None = None
    cycles: int = 0
    missed: int = 0
    lost: int = 0
    late: int = 0
    stale: int = 0
    repeated: int = 0
    malformed: int = 0
    foreign: int = 0
    refused: int = 0
    position_limited: int = 0
    slowed: int = 0
    interruptions: int = 0
    implausible: int = 0
    problem: Problem = Problem.NONE
    jitter: float = 0.0
    worst_jitter: float = 0.0
    drift_ppm: float = 0.0
    cycle_time: float = 0.0

    @property
    def is_commanded(self) -> bool:
        """Whether a controller that commands the arm is active."""
        return self.activation > 0


_NO_REFERENCE: Joints = (nan, nan, nan, nan, nan, nan, nan)


def put_snapshot(box: Mailbox, snapshot: Snapshot) -> None:
    """Replace what is known of the arm."""
    box.put(
        (
            snapshot.time,
            snapshot.session,
            snapshot.is_streaming,
            snapshot.is_running,
            snapshot.activation,
            snapshot.goal_kind,
            snapshot.activity,
            snapshot.cycles,
            snapshot.missed,
            snapshot.lost,
            snapshot.late,
            snapshot.stale,
            snapshot.repeated,
            snapshot.malformed,
            snapshot.foreign,
            snapshot.refused,
            snapshot.position_limited,
            snapshot.slowed,
            snapshot.interruptions,
            snapshot.implausible,
            snapshot.problem,
            snapshot.jitter,
            snapshot.worst_jitter,
            snapshot.drift_ppm,
            snapshot.cycle_time,
            *snapshot.position,
            *snapshot.velocity,
            *snapshot.admitted,
            *(snapshot.reference or _NO_REFERENCE),
        )
    )


def peek_snapshot(box: Mailbox) -> Snapshot:
    """What is known of the arm; the empty snapshot while nothing is."""
    letter = box.peek()
    return Snapshot() if letter is None else _from_values(letter[1])


def _from_values(values: Values) -> Snapshot:
    time, session, streaming, running, activation, goal_kind, activity, *numbers = values[:_SCALARS]
    jitter, worst_jitter, drift_ppm, cycle_time = numbers[-4:]
    counts = [int(number) for number in numbers[:-4]]
    cycles, missed, lost, late, stale, repeated, malformed, foreign = counts[:8]
    refused, position_limited, slowed, interruptions, implausible, problem = counts[8:]
    position, velocity, admitted, reference = (
        joints(values[start : start + JOINT_COUNT]) for start in range(_SCALARS, SNAPSHOT_SIZE, JOINT_COUNT)
    )
    return Snapshot(
        time=time,
        session=int(session),
        is_streaming=bool(streaming),
        is_running=bool(running),
        activation=int(activation),
        goal_kind=GoalKind(int(goal_kind)),
        activity=int(activity),
        position=position,
        velocity=velocity,
        admitted=admitted,
        reference=None if isnan(reference[0]) else reference,
        cycles=cycles,
        missed=missed,
        lost=lost,
        late=late,
        stale=stale,
        repeated=repeated,
        malformed=malformed,
        foreign=foreign,
        refused=refused,
        position_limited=position_limited,
        slowed=slowed,
        interruptions=interruptions,
        implausible=implausible,
        problem=Problem(problem),
        jitter=jitter,
        worst_jitter=worst_jitter,
        drift_ppm=drift_ppm,
        cycle_time=cycle_time,
    )
