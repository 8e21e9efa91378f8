"""Chunks of a policy, as scripts send them: ``with robot.follow_chunks() as chunks: chunks.send(yumi.Chunk(…))``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from math import inf
from threading import Condition, Thread
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from abb_protocols.catalogue import message, quoted, said_by
from abb_protocols.errors import CommandRefused, YumiError
from abb_protocols.robot.joints import JOINT_COUNT, JointLimits, Side
from abb_runtime.clock import Clock
from yumi.api.arm_access import ArmAccess
from yumi.control.chunk_commands import MOST_JUMP, ChunkTaken, FollowChunk
from yumi.control.hand_over import Commander
from yumi.control.loop_commands import Commands, ControllerCommand
from yumi.control.trajectory_commands import trajectory_refused
from yumi.driver.controller_names import TRAJECTORY_CONTROLLER
from yumi.driver.gripper_follower import GripperFollower
from yumi.planning.chunk_plan import LONGEST_PERIOD, SHORTEST_PERIOD, check_chunk_time, plan_chunk

_FARTHEST = 60.0  # [s] a start that lies further away was hardly read from time.monotonic()


@dataclass(frozen=True, slots=True, eq=False)
class Chunk:
    """The next points of a policy: 2 to 500, for one arm or both, and for their grippers.

    Attributes:
        period: time between two points, 0.002 to 1 [s].
        start: when the first point is due, as ``time.monotonic()`` has it [s]; None is now.
        right: positions of the right arm in chain order [rad], (n, 7); None leaves its path as it is.
        left: the same of the left arm.
        right_gripper: what the right gripper does at each point, from 0, open, to 1, which grips, (n,).
        left_gripper: the same of the left gripper.
    """

    period: float
    start: float | None = None
    right: Any = None
    left: Any = None
    right_gripper: Sequence[float] | None = None
    left_gripper: Sequence[float] | None = None


@dataclass(frozen=True, slots=True)
class ChunkState:
    """How far the chunks are that were sent.

    Times are as ``time.monotonic()`` has them [s].

    Attributes:
        sent: how many chunks were taken.
        refused: how many were not.
        executed: all points that were due before this time have been executed.
        until: when the last point is due; the arms brake from then on.
        late: how many points were dropped, since they were due before their chunk came, of the arm with most.
        replaced: how many points were replaced by newer ones before they were executed, of the arm with most.
        is_exhausted: whether the points are exhausted: the arms brake, or hold.
    """

    sent: int = 0
    refused: int = 0
    executed: float = -inf
    until: float = -inf
    late: int = 0
    replaced: int = 0
    is_exhausted: bool = True


class ChunkFollower:
    """Arms that follow chunks, from ``with`` on, which takes them over from standstill, to its end.

    What else takes an arm over ends that, for both arms: the other one brakes, and no chunk moves either of them before
    they are followed anew.

    Args:
        access: the arms.
        sides: which of them.
        limits: of the joints.
        grippers: of these arms.
        jump: a chunk is at most so far from where its arm is commanded to be [rad].
    """

    def __init__(
        self,
        access: ArmAccess,
        sides: tuple[Side, ...],
        limits: JointLimits,
        grippers: Mapping[Side, GripperFollower],
        jump: float = MOST_JUMP,
    ) -> None:
        self._access, self._limits, self._jump = access, limits, jump
        self._sides = sides
        self._activations: dict[Side, tuple[int, int]] = {}  # the session and activation that are followed
        self._state = ChunkState()
        self._grippers = _GripperSchedule(grippers, access.clock, lambda _: all(map(self._is_own, self._sides)))
        self._stack = ExitStack()

    def __enter__(self) -> ChunkFollower:
        for side in self._sides:
            self._access.check_follows(side)
        self._activations = self._access.take_for_trajectories(self._sides, Commander.POLICY, TRAJECTORY_CONTROLLER)
        self._stack.callback(self._activations.clear)
        self._stack.enter_context(self._grippers)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        own = [side for side in self._activations if self._is_own(side)]
        try:  # arms first: a gripper may take seconds
            with suppress(*() if kind is None else (YumiError,)):  # what ended the block is what a person must read
                self._access.bring_own_to_rest(own)
        finally:
            self._stack.close()

    def send(self, chunk: Chunk) -> Mapping[str, ChunkTaken]:
        """Have the arms follow a chunk in place of the points that they have not executed yet; none or all of them.

        It returns as soon as the control process has taken the chunk, which takes milliseconds.

        Returns:
            What each arm made of the chunk, by ``"right"`` and ``"left"``.

        Raises:
            CommandRefused: the chunk is impossible, too late, or too far from where an arm is; the points before count.
                Or something else has taken an arm over.
            RobotNotReady: an arm does not follow.
        """
        try:
            return self._send(chunk)
        except CommandRefused:
            self._state = replace(self._state, refused=self._state.refused + 1)
            raise

    def _send(self, chunk: Chunk) -> Mapping[str, ChunkTaken]:
        if not self._activations:
            raise trajectory_refused(message("chunks_ended"))
        now = self._access.clock.now()
        start = now if chunk.start is None else float(chunk.start)
        check_chunk_time("period", float(chunk.period), SHORTEST_PERIOD, LONGEST_PERIOD)
        check_chunk_time("start, from now on,", start - now, -_FARTHEST, _FARTHEST)
        points, values, count = self._checked(chunk)
        times = [number * float(chunk.period) for number in range(count)]
        number = self._state.sent + 1
        commands = []
        for side in self._sides:
            self._access.check_follows(side)
            if not self._is_own(side):
                raise trajectory_refused(message("chunks_taken_over", arm=side.word))
        for side, positions in points.items():
            spline = plan_chunk(side, times, positions, self._limits)
            command = FollowChunk(number, start, spline, self._jump, is_of_both=len(self._sides) > 1)
            commands.append(ControllerCommand(side, TRAJECTORY_CONTROLLER, command, self._activations[side][1]))
        taken: dict[Side, ChunkTaken] = {}
        if commands:
            made = self._access.control.call(Commands.take_commands, *commands).made
            taken = {side: each for side, each in made.items() if isinstance(each, ChunkTaken)}
        for side, each in values.items():
            self._grippers.replace(side, [start + time for time in times], each)
        state = self._state
        self._state = replace(
            state,
            sent=number,
            until=max((each.until for each in taken.values()), default=state.until),
            late=state.late + max((each.late for each in taken.values()), default=0),
            replaced=state.replaced + max((each.replaced for each in taken.values()), default=0),
        )
        return {side.word: each for side, each in taken.items()}

    @property
    def state(self) -> ChunkState:
        """How far the chunks are; calculated without asking anything of the robot."""
        now, state = self._access.clock.now(), self._state
        return replace(state, executed=min(now, state.until), is_exhausted=now >= state.until)

    def start_for(self, observed: float) -> float:
        """When a chunk is to begin that was inferred from an observation at that time [s].

        That is the time of the observation, as long as the arms had points to follow; it is later by as long as they
        have waited for points since, and have stood still.

        Args:
            observed: as ``time.monotonic()`` had it [s].
        """
        return observed + max(0.0, self._access.clock.now() - max(self._state.until, observed))

    def _is_own(self, side: Side) -> bool:
        """Whether no other client has taken an arm, or is about to switch its controller."""
        snapshot = self._access.snapshot(side)
        is_followed = snapshot.command_epoch == self._activations.get(side) and snapshot.is_commanded
        return is_followed and not self._access.control.hand_over.is_foreign(side)

    def _checked(self, chunk: Chunk) -> tuple[dict[Side, NDArray[np.float64]], dict[Side, list[float]], int]:
        """The positions and the gripper's values of each arm, and how many there are of each."""
        points: dict[Side, NDArray[np.float64]] = {}
        values: dict[Side, list[float]] = {}
        counts: dict[str, int] = {}
        for side, positions, gripper in (
            (Side.RIGHT, chunk.right, chunk.right_gripper),
            (Side.LEFT, chunk.left, chunk.left_gripper),
        ):
            if (positions is not None or gripper is not None) and side not in self._sides:
                arms = tuple(each.word for each in self._sides)
                raise trajectory_refused(message("chunk_arm_not_taken", arm=side.word, arms=arms))
            if positions is not None:
                points[side] = _positions(side, positions)
                counts[f"{side.word} arm"] = len(points[side])
            if gripper is not None:
                values[side] = _gripper_values(side, gripper)
                counts[f"{side.word} gripper"] = len(values[side])
        if not counts:
            raise trajectory_refused(message("chunk_without_arm"))
        (part, count), *rest = counts.items()
        for other, others in rest:
            if others != count:
                raise trajectory_refused(
                    message("chunk_counts_differ", points=count, part=part, others=others, other=other)
                )
        return points, values, count


def _positions(side: Side, given: Any) -> NDArray[np.float64]:
    try:
        positions = np.array(given, dtype=float)
    except (TypeError, ValueError) as error:
        raise trajectory_refused(
            message("chunk_points_malformed", arm=side.word, joints=JOINT_COUNT, error=said_by(error))
        ) from error
    if positions.ndim != 2 or positions.shape[1] != JOINT_COUNT or not np.isfinite(positions).all():
        said = f"shape {positions.shape}" if np.isfinite(positions).all() else "not finite"
        raise trajectory_refused(message("chunk_points_malformed", arm=side.word, joints=JOINT_COUNT, error=said))
    return positions


def _gripper_values(side: Side, given: Any) -> list[float]:
    try:
        values = [float(each) for each in given]
    except (TypeError, ValueError):
        values = []
    if not values or not all(0.0 <= each <= 1.0 for each in values):
        raise trajectory_refused(message("chunk_gripper_malformed", arm=side.word, given=quoted(given)))
    return values


class _GripperSchedule:
    """Gives grippers their goals when these are due, on a thread of its own: a gripper takes a while for each.

    Args:
        grippers: by arm.
        clock: of the goals' times.
        is_own: whether the chunks still command an arm.
    """

    _NOTABLE = 0.01  # a goal that differs less from the last one is the same

    def __init__(self, grippers: Mapping[Side, GripperFollower], clock: Clock, is_own: Callable[[Side], bool]) -> None:
        self._grippers, self._clock, self._is_own = grippers, clock, is_own
        self._changed = Condition()
        self._due: dict[Side, list[tuple[float, float]]] = {side: [] for side in grippers}
        self._last: dict[Side, float] = {}
        self._is_over = False
        self._thread = Thread(target=self._run, name="grippers of chunks")

    def __enter__(self) -> _GripperSchedule:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        with self._changed:
            self._is_over = True
            self._changed.notify()
        for each in self._grippers.values():
            each.forget()
        self._thread.join()

    def replace(self, side: Side, times: Sequence[float], values: Sequence[float]) -> None:
        """Goals at ``times`` [s] in place of those that are due from the first of them on."""
        with self._changed:
            kept = [each for each in self._due[side] if each[0] < times[0]]
            self._due[side] = [*kept, *zip(times, values, strict=True)]
            self._changed.notify()

    def _run(self) -> None:
        while (work := self._next()) is not None:
            work()

    def _next(self) -> Callable[[], None] | None:
        """What has to be done now, waited for; None at the end."""
        with self._changed:
            while not self._is_over:
                now = self._clock.now()
                for side, schedule in self._due.items():
                    if not self._is_own(side):  # its gripper is that of the client that has taken it over
                        self._due[side] = []
                        continue
                    passed = [value for time, value in schedule if time <= now]
                    if not passed:
                        continue
                    self._due[side] = schedule[len(passed) :]
                    if abs(passed[-1] - self._last.get(side, inf)) >= self._NOTABLE:
                        self._last[side] = passed[-1]
                        return self._grippers[side].take(passed[-1]) or _nothing
                nearest = min((schedule[0][0] for schedule in self._due.values() if schedule), default=inf)
                self._changed.wait(None if nearest == inf else max(0.0, nearest - now))
            return None


def _nothing() -> None:
    """The gripper's goals are given already."""
