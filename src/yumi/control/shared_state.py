"""The snapshot: everything about one arm that the world outside the fast line may know, as numbers in a mailbox.

Mailboxes in shared memory, and bells that ring across processes: how the fast line meets the rest.

A version counter before and after each letter tells a reader that the letter changed while it looked; it then looks
again, a few times, and takes the letter it read before if the writer has died in the middle of one. Nobody ever waits.

How an arm follows its trajectory, as it lies in a mailbox: what is desired, what is, and the arms' skew.
"""

from __future__ import annotations

import ctypes
import multiprocessing
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import IntEnum
from math import isnan, nan
from multiprocessing.context import SpawnContext
from multiprocessing.sharedctypes import RawArray
from typing import NamedTuple, Protocol

from yumi.control.commands import GoalKind, Mailbox, Values
from yumi.errors import MissingPrerequisite
from yumi.robot.joints import JOINT_COUNT, ZERO, Joints, joints

_SCALARS = 25
SNAPSHOT_SIZE = _SCALARS + 4 * JOINT_COUNT
"""Numbers in a snapshot mailbox."""


class Problem(IntEnum):
    """Why an arm holds whatever it is asked to do.

    REFERENCES_IGNORED: the robot plans to stand although it is told to move.
    IMPLAUSIBLE: it reports positions that the arm cannot have reached.
    """

    NONE = 0
    REFERENCES_IGNORED = 1
    IMPLAUSIBLE = 2


CAUSES = {
    Problem.REFERENCES_IGNORED: (
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
        sent: the position sent last [rad].
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
    sent: Joints = ZERO
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
            *snapshot.sent,
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
    position, velocity, sent, reference = (
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
        sent=sent,
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


PROCESSES: SpawnContext = multiprocessing.get_context("spawn")
"""How processes are made: spawned, since a fork would copy threads and locks of ROS."""

_LOOKS = 10  # a writer on another processor is done by then; one that we took the processor from never will be
_HEAD = 2  # begun, finished: equal and not 0 when the letter is whole


SharedNumbers = ctypes.Array[ctypes.c_double]
"""A block of numbers that two processes see."""


def shared_numbers(count: int) -> SharedNumbers:
    """``count`` zeros of 8 bytes; hand them to the child when it is spawned. Who writes and reads how is theirs.

    Raises:
        MissingPrerequisite: the machine has no shared memory left.
    """
    with _from_the_system():
        return RawArray(ctypes.c_double, count)


class SharedMailbox:
    """A mailbox for ``size`` numbers between two processes; hand it to the child when it is spawned."""

    def __init__(self, size: int) -> None:
        self._size = size
        with _from_the_system():
            self._memory = RawArray("d", _HEAD + size)
        self._read_last: tuple[int, tuple[float, ...]] | None = None

    def put(self, values: tuple[float, ...]) -> None:
        """Replace what is in the box; one process only may put."""
        if len(values) != self._size:
            raise ValueError(f"this mailbox holds {self._size} numbers, got {len(values)}")
        memory = self._memory
        version = memory[0] + 1.0
        memory[0] = version
        memory[_HEAD:] = values
        memory[1] = version

    def peek(self) -> tuple[int, tuple[float, ...]] | None:
        """The number of the letter, from 1, and its values; None while nothing was ever put."""
        memory, before = self._memory, self._read_last
        if before is not None and memory[0] == memory[1] == before[0]:
            return before  # the fast line looks in every cycle; a new letter is rare
        for _ in range(_LOOKS):
            finished = memory[1]
            values = tuple(memory[_HEAD:])
            if memory[0] == finished:
                self._read_last = (int(finished), values) if finished else None
                break
        return self._read_last


class SharedHistory:
    """The last ``depth`` letters of ``size`` numbers each: a reader that was busy for a moment misses none."""

    def __init__(self, size: int, depth: int) -> None:
        self._slots = tuple(SharedMailbox(1 + size) for _ in range(depth))
        self._newest = shared_numbers(1)

    def put(self, values: tuple[float, ...]) -> None:
        """Add a letter; the oldest one makes room. One process only may put."""
        number = int(self._newest[0]) + 1
        self._slots[number % len(self._slots)].put((float(number), *values))
        self._newest[0] = float(number)

    def peek(self) -> tuple[int, tuple[float, ...]] | None:
        """The newest letter with its number, from 1; None while nothing was ever put."""
        letters = self.since(int(self._newest[0]) - 1)
        return letters[-1] if letters else None

    def since(self, number: int) -> list[tuple[int, tuple[float, ...]]]:
        """The letters after ``number`` that are still there, oldest first."""
        newest = int(self._newest[0])
        numbers = range(max(number, newest - len(self._slots)) + 1, newest + 1)
        letters = ((wanted, self._slots[wanted % len(self._slots)].peek()) for wanted in numbers)
        # A letter that was replaced while we looked bears another number: it comes with the next look.
        return [(wanted, letter[1][1:]) for wanted, letter in letters if letter and letter[1][0] == wanted]


class Bell(Protocol):
    """Wakes whoever waits in another process."""

    def release(self) -> None:
        """Ring once; never waits."""

    def acquire(self, block: bool = True, timeout: float | None = None) -> bool:
        """Wait for a ring; tells whether there was one in time."""


def new_bell() -> Bell:
    """A bell for a process that will be spawned; raises MissingPrerequisite as :func:`shared_numbers`."""
    with _from_the_system():
        return PROCESSES.Semaphore(0)


@contextmanager
def _from_the_system() -> Iterator[None]:
    try:
        yield
    except (OSError, MemoryError) as error:
        why = error.strerror if isinstance(error, OSError) else "out of memory"
        raise MissingPrerequisite(
            f"The operating system gives no shared memory ({why}); see that /dev/shm exists and has some MB left "
            "(df /dev/shm), and that the limits of this program are not too low (ulimit -n, ulimit -v)."
        ) from error


FEEDBACK_SIZE = 6 + 4 * JOINT_COUNT
"""Numbers in a feedback mailbox."""


class Skew(NamedTuple):
    """How far apart in time two arms were that follow one trajectory.

    Attributes:
        start: between their first cycles [s].
        worst: largest difference of where they were told to be on it [s].
    """

    start: float = 0.0
    worst: float = 0.0


class TrajectoryFeedback(NamedTuple):
    """One look at an arm that a trajectory controller commands.

    Attributes:
        goal: number of the order it follows, 0 while it holds.
        time: of the state, on the machine's monotonic clock [s].
        progress: the desired time on the trajectory [s].
        scale: how fast time goes by on the trajectory.
        skew: of the arms that follow it together; zeros for one arm.
        desired: where it should be [rad], (7,).
        desired_velocity: [rad/s], (7,).
        actual: where it is [rad], (7,).
        actual_velocity: [rad/s], (7,).
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


def put_feedback(box: Mailbox, feedback: TrajectoryFeedback) -> None:
    """Let others see ``feedback``."""
    goal, time, progress, scale, skew, *rows = feedback
    numbers = (float(goal), time, progress, scale, skew.start, skew.worst)
    box.put((*numbers, *(value for row in rows for value in row)))


def peek_feedback(box: Mailbox) -> tuple[int, TrajectoryFeedback] | None:
    """The number of the newest feedback, and the feedback; None before the first."""
    letter = box.peek()
    if letter is None:
        return None
    number, (goal, time, progress, scale, start, worst, *values) = letter
    rows = [joints(values[begin : begin + JOINT_COUNT]) for begin in range(0, len(values), JOINT_COUNT)]
    return number, TrajectoryFeedback(int(goal), time, progress, scale, Skew(start, worst), *rows)
