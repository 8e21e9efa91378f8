"""Motions of a script: how arms get their goals, how each motion ends, and how a script waits for it.

A wait that ends for any other reason than the motions' ends, be it an error or Ctrl-C, leaves no arm moving.

Joint positions in degrees, by ABB's axis numbers or by joint name; all else is in radians and in chain order.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import FIRST_EXCEPTION, Future
from concurrent.futures import TimeoutError as NotInTime
from concurrent.futures import wait as wait_for_futures
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import count
from math import degrees as _degrees_of
from math import dist, isfinite, radians
from threading import Lock
from typing import Any, NamedTuple, Protocol, SupportsFloat

from yumi.api.tool import ToolMotion, pose_from, posture_for, tool_planner
from yumi.catalogue import Message, message, quoted, said_by
from yumi.clock import Clock
from yumi.control.controller import Buffer, GoalBuffer, check_position, write_goal, write_speeds
from yumi.control.controllers.cartesian import ToolGoal, check_twist, twist_goal
from yumi.control.controllers.joint_goal import GoalEnded, GoalOutcome, JointGoal, StopMotion
from yumi.control.controllers.joint_trajectory import (
    CancelTrajectory,
    FollowTrajectory,
    Outcome,
    Tolerances,
    TrajectoryEnded,
)
from yumi.control.loop import CommandPort, Commands, ControllerCommand
from yumi.control.motion import STANDING, PointMotion, Setpoint, slower, travel
from yumi.control.shared_state import (
    ControllerReport,
    Event,
    Limited,
    RobotStoppedFollowing,
    SessionLost,
    SessionStarted,
    Snapshot,
    TrajectoryFeedback,
    is_fault,
)
from yumi.control.speed_scale import FULL
from yumi.control.tool_path import SPEED, TURNING, ToolLimited, ToolLimits, Waypoint
from yumi.control.trajectory import (
    ArmPlan,
    JointTrajectory,
    TrajectoryPoint,
    check_count,
    plan_trajectory,
    time_to_start,
)
from yumi.driver.readiness import why_arm_does_not_follow
from yumi.driver.stops import Cause, explained
from yumi.errors import CommandRefused, GoalNotReached, RobotNotReady, YumiError
from yumi.robot.joints import (
    CHAIN_AXES,
    JOINT_COUNT,
    YUMI_LIMITS,
    ZERO,
    JointLimits,
    Joints,
    Pose,
    Side,
    chain_from_abb,
    joint_names,
    joints,
    named_pose,
)
from yumi.robot.kinematics import compose, inverse, tool0_to_body


def degrees(*angles: SupportsFloat | Sequence[SupportsFloat]) -> Joints:
    """Joint positions given in degrees, as radians: ``yumi.degrees(0, -130, -135, 30, 0, 40, 0)``.

    Seven angles, or one sequence of them, in chain order (axes 1, 2, 7, 3, 4, 5, 6), not the FlexPendant's: for J1 to
    J7 as the FlexPendant shows them take :func:`abb_degrees`. Raises ValueError when they are not seven.
    """
    return joints([radians(value) for value in _flat(angles)])


def abb_degrees(
    j1: SupportsFloat,
    j2: SupportsFloat,
    j3: SupportsFloat,
    j4: SupportsFloat,
    j5: SupportsFloat,
    j6: SupportsFloat,
    *,
    j7: SupportsFloat,
) -> Joints:
    """Joint positions as the FlexPendant and RobotStudio show them, by ABB's numbers of the axes.

    ::

        robot.right.move_to(yumi.abb_degrees(0, -130, 30, 0, 40, 0, j7=-135))

    Axis 7 (``eax_a`` in RAPID) sits between axes 2 and 3. It has to be named, so that seven
    numbers in chain order are never taken for ABB's.

    Returns:
        Radians in chain order (axes 1, 2, 7, 3, 4, 5, 6), (7,).
    """
    return joints(
        [
            radians(float(value))
            for value in chain_from_abb([float(each) for each in (j1, j2, j3, j4, j5, j6)], float(j7))
        ]
    )


def in_degrees(position: Sequence[SupportsFloat]) -> Joints:
    """Joint positions [rad], (7,), in degrees; raises ValueError when they are not seven."""
    return joints([_degrees_of(value) for value in _flat((position,))])


def _flat(angles: Sequence[Any]) -> list[float]:
    """Seven angles as they are, or the one sequence of them: a list, a tuple, an array."""
    values = angles[0] if len(angles) == 1 and hasattr(angles[0], "__iter__") else angles
    return [float(value) for value in values]


def _in_chain_order(
    side: Side, values: Mapping[str, Any] | Sequence[Any], others: Joints | None = None
) -> Sequence[Any]:
    """Values of all joints of an arm in chain order: a mapping by joint name, or a sequence that is in this order.

    A joint is named as in ROS (``yumi_joint_7_r``), or by ABB's number of its axis (``joint_7``, ``j7``). Joints that a
    mapping leaves out are taken from ``others``; with None it must name all. A string is the name of a pose of
    :data:`yumi.robot.joints.POSES`.

    Raises:
        CommandRefused: a name is not one of this arm's joints, comes twice, or is missing.
    """
    if isinstance(values, str):
        return named_pose(side, values)
    if not isinstance(values, Mapping):
        return values
    found: dict[int, Any] = {}
    for name, value in values.items():
        index = _index(side, name)
        if index in found:
            raise CommandRefused(
                message("goal_refused", reason=message("joint_named_twice", name=joint_names(side)[index]))
            )
        found[index] = value
    missing = [name for index, name in enumerate(joint_names(side)) if index not in found]
    if missing and others is None:
        raise CommandRefused(message("trajectory_point_without_joints", missing=tuple(missing), joints=JOINT_COUNT))
    return [found[index] if index in found else others[index] for index in range(JOINT_COUNT)]  # type: ignore[index]


def _index(side: Side, name: object) -> int:
    """Place of a named joint in the chain."""
    names = joint_names(side)
    if name in joint_names(side.other):
        raise CommandRefused(message("goal_joint_of_other_arm", joint=name, arm=side.word, other=side.other.word))
    for index, (full, axis) in enumerate(zip(names, CHAIN_AXES, strict=True)):
        if name in (full, f"joint_{axis}", f"j{axis}"):
            return index
    raise CommandRefused(message("goal_joint_unknown", joint=str(name), arm=side.word, joints=names, count=JOINT_COUNT))


_PLACE = 3  # numbers of a pose without an orientation
_JOG_GAP = 0.3  # [s] jogs that follow each other within this time belong to one press of a key
_FRESH = 1.5  # [s] a controller says at least once a second how it follows a trajectory

RETREAT_SPEED_SCALE = 0.1
"""Of the joints' speeds, with which arms are led out of each other's way."""

LAST_STOP = 5.0
"""An arm must have come to rest within this time [s]; it takes a tenth of it."""

log = logging.getLogger(__name__)


class Way(NamedTuple):
    """How far a motion is: from 0 to 1, and the time it still takes [s], None where that is unknown."""

    progress: float
    remaining: float | None


class Motion:
    """One motion of one arm; ``future`` is done when it has ended, and raises what :meth:`wait` raises."""

    def __init__(self, side: Side, identity: int) -> None:
        self.side = side
        self.identity = identity
        self.future: Future[None] = Future()
        self.future.set_running_or_notify_cancel()  # a wait that is given up does not end the motion
        self._way: Callable[[], Way] = lambda: Way(0.0, None)
        self._last = 0.0  # progress when it was asked for last

    def __repr__(self) -> str:
        way = "ended" if self.is_done else f"under way, {self.progress:.0%}"
        return f"<yumi.Motion {self.identity} of the {self.side.word} arm: {way}>"

    def follow_way(self, way: Callable[[], Way]) -> None:
        """Know from now on how far it is, until it ends."""
        self._way = way
        # It leads to Ruckig, which lists on standard error what is left of it at the program's end.
        self.future.add_done_callback(self._forget_way)

    def _forget_way(self, _: object) -> None:
        self._way = lambda: Way(self._last, None)

    @property
    def way(self) -> Way:
        """How far it is: :attr:`progress` and :attr:`remaining` at the same moment."""
        if not self.is_done:
            way = self._way()
            self._last = way.progress
            return way
        return Way(1.0 if self.future.exception() is None else self._last, 0.0)

    @property
    def progress(self) -> float:
        """How much of its way the arm has covered, 0 to 1; stays where a motion that ended elsewhere was seen last."""
        return self.way.progress

    @property
    def remaining(self) -> float | None:
        """How long it still takes at the present ``speed_scale`` [s]; 0 when it has ended, None when it is unknown."""
        return self.way.remaining

    @property
    def is_done(self) -> bool:
        """Whether it has ended, at its goal or elsewhere."""
        return self.future.done()

    def wait(self, timeout: float | None = None) -> None:
        """Wait until the arm stands at its goal; waiting longer than ``timeout`` [s] does not stop the arm.

        Raises:
            GoalNotReached: the motion ended elsewhere, or its time is up; the message says why.
        """
        try:
            self.future.result(timeout)
        except NotInTime:
            raise GoalNotReached(message("goal_not_reached_yet", arm=self.side.word, timeout=timeout)) from None


PLAN_TOLERANCE = 0.02
"""So far may a joint have moved since a plan was made that is executed [rad]."""

Explain = Callable[[Callable[[Cause], None]], None]
"""Calls back with what stopped the robot, once that is known."""


class MotionRegistry:
    """All motions under way, and what has gone wrong since the last recovery; safe from any thread.

    Args:
        is_script: whether it is a script's: a fault is logged, and an arm that had one takes no goal before
            ``robot.recover()``. A driver with ROS logs events by itself, and recovers on several ways.

    Attributes:
        explain: a fault ends motions with the cause that it calls back with.
        limited_by: what an arm is kept apart from now, which may be why it does not arrive.
    """

    def __init__(self, *, is_script: bool = True) -> None:
        self.explain: Explain = lambda then: then(Cause())
        self.limited_by: Callable[[Side], Limited | None] = lambda side: None
        self._is_script = is_script
        self._log = log.log if is_script else _no_log
        self._recoveries = 0
        self._numbers = count(1)  # people read them; those of ROS are far beyond
        self._open: dict[int, Motion] = {}
        self._faults: dict[Side, tuple[Message, str]] = {}  # and the stop that a person must confirm
        self._lock = Lock()

    def begin(self, side: Side) -> Motion:
        """A new motion, to be sent under its number."""
        with self._lock:
            motion = Motion(side, next(self._numbers))
            self._open[motion.identity] = motion
        return motion

    def forget(self, motions: Iterable[Motion]) -> None:
        """They were refused: no arm moves."""
        with self._lock:
            for motion in motions:
                self._open.pop(motion.identity, None)

    def is_open(self, side: Side) -> bool:
        """Whether a motion of the arm has not ended."""
        with self._lock:
            return any(motion.side is side for motion in self._open.values())

    def fault(self, side: Side) -> Message | None:
        """What stopped the arm; None when nothing did."""
        fault = self._faults.get(side) if self._is_script else None
        return fault[0] if fault else None

    def stop(self, side: Side) -> str:
        """Id of the stop that a person must confirm before the arm moves again; empty where there is none."""
        fault = self._faults.get(side)
        return fault[1] if fault else ""

    def clear_faults(self) -> None:
        """The robot is ready again."""
        with self._lock:
            self._recoveries += 1
            self._faults.clear()

    def note(self, event: Event) -> None:
        """Take an event of the control process."""
        if isinstance(event, ControllerReport):
            self._note_report(event)
            return
        if not is_fault(event):
            self._log(logging.INFO, event.said)
            return
        # The motions of the arm have failed: whatever else is reported of them does not count any more.
        with self._lock:
            self._faults[event.side] = (event.said, "")
            failed = [motion for motion in self._open.values() if motion.side is event.side]
            for motion in failed:
                del self._open[motion.identity]
            recoveries = self._recoveries

        def end(cause: Cause) -> None:
            said = explained(event, cause)
            self._log(logging.WARNING, said)
            with self._lock:
                if self._recoveries == recoveries:
                    self._faults[event.side] = (said, cause.stop)
            for motion in failed:
                motion.future.set_exception(GoalNotReached(said, cause.stop))

        if isinstance(event, SessionLost | SessionStarted | RobotStoppedFollowing):
            self.explain(end)  # EGM's end arrives before the controller's event that says why
        else:
            end(Cause())

    def _note_report(self, event: ControllerReport) -> None:
        report = event.report
        if isinstance(report, GoalEnded):
            self._end(report.identity, report.outcome is GoalOutcome.REACHED, report.said)
        elif isinstance(report, TrajectoryEnded):
            self._end(report.goal, report.outcome is Outcome.SUCCEEDED, report.said)
        elif isinstance(report, ToolLimited):
            self._log(logging.INFO, f"{event.side.word.capitalize()} arm: {report}")

    def _end(self, identity: int, is_reached: bool, reason: Message) -> None:
        with self._lock:
            motion = self._open.pop(identity, None)
        if motion is None:
            return
        if is_reached:
            motion.future.set_result(None)
        else:
            held = self.limited_by(motion.side)
            if held is None:
                said = message("goal_not_reached", arm=motion.side.word, reason=reason)
            else:
                said = message("goal_not_reached_limited", arm=motion.side.word, reason=reason, limited=held.said)
            motion.future.set_exception(GoalNotReached(said))


def _no_log(level: int, said: Message | str) -> None:
    """Who has the events logs them."""


GOAL_CONTROLLER = "joint_goal_controller"
"""Takes an arm to single points."""

STREAM_CONTROLLER = "joint_position_controller"
"""Follows a stream of points."""

JOG_CONTROLLER = "joint_velocity_controller"
"""Follows speeds, and stops where none come."""

TRAJECTORY_CONTROLLER = "joint_trajectory_controller"
"""Follows points with times."""

CARTESIAN_CONTROLLER = "cartesian_controller"
"""Moves the tool on straight lines and after streams."""

ARRIVAL = Tolerances(goal=joints([0.002] * JOINT_COUNT), goal_velocity=joints([STANDING] * JOINT_COUNT), goal_time=2.0)
"""When a trajectory's last point is reached: the same as for single points."""

Position = Sequence[SupportsFloat] | Mapping[str, SupportsFloat] | str
"""Joint positions [rad]: a list, a tuple or an array of all seven in chain order (axes 1, 2, 7, 3, 4, 5, 6); a mapping
by joint name (``yumi_joint_7_r``, ``joint_7`` or ``j7``), in which joints that are left out stay where they are; or the
name of a pose (``"home"``)."""


TimedPosition = Sequence[Any]
"""A time since the begin [s], the joint positions then [rad], and, if wanted, velocities [rad/s] and accelerations."""


class ArmControl(CommandPort, Protocol):
    """What is needed of the control process."""

    def snapshot(self, side: Side) -> Snapshot:
        """An arm after its last cycle."""


class MotionExecutor:
    """Sends goals to the arms of one robot.

    Args:
        control: the control process.
        goals: the buffer of each arm's stream of goals.
        motions: those under way.
        arms: those on which EGM runs.
        limits: what a trajectory may ask of the joints.
        clock: of the trajectories' starts, which the control process shares.
        feedback: the buffers of the controllers that follow trajectories on each arm; without them the progress of
            trajectories is unknown.
        speed_scale: the factor on all speeds now.
        tool_goals: the buffer of each arm's stream of poses and velocities of its tool.
        speeds: the buffer of each arm's speeds; without them no arm can be jogged.
        tool_limits: what tools keep on lines.
    """

    def __init__(
        self,
        control: ArmControl,
        goals: Mapping[Side, GoalBuffer],
        motions: MotionRegistry,
        arms: tuple[Side, ...],
        limits: JointLimits,
        clock: Clock,
        feedback: Mapping[Side, Sequence[Buffer[TrajectoryFeedback]]] | None = None,
        speed_scale: Callable[[], float] = lambda: FULL,
        tool_goals: Mapping[Side, Buffer[ToolGoal]] | None = None,
        speeds: Mapping[Side, GoalBuffer] | None = None,
        tool_limits: ToolLimits = ToolLimits(),  # noqa: B008 - it is frozen
    ) -> None:
        self.arms = arms
        self.limits, self.tool_limits = limits, tool_limits
        self._tool_goals = tool_goals or {}
        self._speeds = speeds or {}
        self._feedback = feedback or {}
        self._speed_scale = speed_scale
        self._clock = clock
        self._control = control
        self._goals = goals
        self._motions = motions
        motions.limited_by = lambda side: control.snapshot(side).limited
        self._streaming: dict[Side, tuple[str, int, int]] = {}  # controller of a stream, its session and activation
        self._jogs: dict[Side, _Jog] = {}
        self._jog_locks = {side: Lock() for side in Side}  # held briefly: the end of a jog waits for it

    def snapshot(self, side: Side) -> Snapshot:
        """An arm after its last cycle.

        Raises:
            RobotNotReady: it is not one of those on which EGM runs.
        """
        if side not in self.arms:
            raise RobotNotReady(message("arm_not_named_to_connect", arm=side.word))
        return self._control.snapshot(side)

    def is_moving(self, side: Side) -> bool:
        """Whether a motion of the arm is under way, it follows a trajectory however slowly, or moves otherwise."""
        now = self._clock.now()
        return (
            self._motions.is_open(side)
            or any(each.goal and now - each.time < _FRESH for each in self._trajectories(side))
            or max(map(abs, self._control.snapshot(side).velocity)) > STANDING
        )

    def _trajectories(self, side: Side) -> list[TrajectoryFeedback]:
        """What the controllers that follow trajectories on an arm have said last."""
        newest = (buffer.read() for buffer in self._feedback.get(side, ()))
        return [each[1] for each in newest if each is not None]

    def fault(self, side: Side) -> Message | None:
        """What stopped the arm; None when nothing did."""
        return self._motions.fault(side)

    def move(
        self,
        goals: Mapping[Side, Position],
        speed_scale: float | None,
        acceleration: float | None,
        *,
        check: Callable[[], None] = lambda: None,
    ) -> tuple[Motion, ...]:
        """Send arms to goals, both in the same cycle period, or none of them.

        ``speed_scale`` and ``acceleration`` are fractions of the joints' limits, above 0 up to 1; None takes the
        connection's. Joints that a goal by name leaves out stay where they were sent last.
        ``check`` is called right before the motion is sent, and raises where it is not wanted any more.

        Raises:
            CommandRefused: a goal is impossible; nothing moves.
            RobotNotReady: an arm does not follow.
        """
        speed_scale = _checked_scale("speed_scale", speed_scale)
        acceleration = _checked_scale("acceleration", acceleration)
        starts = {side: self.snapshot(side).sent for side in goals}
        checked = {side: checked_goal(side, goal, starts[side]) for side, goal in goals.items()}
        for side in checked:
            self._check_follows(side)
        self._activate(checked, GOAL_CONTROLLER)
        limits = {side: self._limits_of_goals(side, speed_scale, acceleration) for side in checked}
        check()
        motions = {side: self._motions.begin(side) for side in checked}
        commands = [
            ControllerCommand(side, GOAL_CONTROLLER, JointGoal(goal, motions[side].identity, speed_scale, acceleration))
            for side, goal in checked.items()
        ]
        sent = self._send(commands, tuple(motions.values()))
        for side, goal in checked.items():
            plan = None
            with suppress(CommandRefused):  # a way that bends, as the arm moved when it got its goal
                plan = travel(Setpoint(starts[side]), goal, limits[side])
            motions[side].follow_way(partial(self._way_to_goal, side, starts[side], goal, plan))
        return sent

    def move_tools(
        self,
        goals: Mapping[Side, Position],
        tools: Mapping[Side, Pose],
        speed_scale: float | None,
        acceleration: float | None,
        line_speed: float | None,
        *,
        is_linear: bool,
        check: Callable[[], None] = lambda: None,
    ) -> tuple[Motion, ...]:
        """Send tools to poses in the body, as x, y, z [m] and, where the orientation does not stay, w, x, y, z.

        On a line ``speed_scale`` is a factor on the tool's ``line_speed`` [m/s] and on its turning.

        Raises:
            CommandRefused: a pose is impossible; nothing moves.
            RobotNotReady: an arm does not follow.
        """
        starts = {side: self.snapshot(side).sent for side in goals}
        poses = {}
        for side, goal in goals.items():
            given = goal if isinstance(goal, str | Mapping) else tuple(goal)
            if not isinstance(given, str) and len(given) == _PLACE:
                given = (*given, *tool0_to_body(side, starts[side], tools[side]).orientation)
            poses[side] = pose_from(given)  # type: ignore[arg-type]
        if not is_linear:
            targets = {side: compose(pose, inverse(tools[side])) for side, pose in poses.items()}
            positions: dict[Side, Position] = {
                side: posture_for(side, tool0, None, None, starts[side], YUMI_LIMITS) for side, tool0 in targets.items()
            }
            return self.move(positions, speed_scale, acceleration, check=check)
        scale = _checked_scale("speed_scale", speed_scale) or 1.0
        paths = {
            side: ToolMotion(
                tools[side],
                (Waypoint(pose),),
                scale * (line_speed or SPEED),
                scale * TURNING,
                acceleration=acceleration or 1.0,
            )
            for side, pose in poses.items()
        }
        return self.follow_path(tuple(paths), tool_planner(paths, self.limits, self.tool_limits), check)

    def follow(
        self,
        trajectories: Mapping[Side, Sequence[TimedPosition]],
        start: Mapping[Side, Joints] | None = None,
        check: Callable[[], None] = lambda: None,
    ) -> tuple[Motion, ...]:
        """Have arms follow trajectories that begin at the same moment, or none of them.

        Where they were planned from a ``start`` [rad], also of an arm that does not move, the arms must still be there.

        Raises:
            CommandRefused: a trajectory is impossible; nothing moves, but what moved has come to rest.
            RobotNotReady: an arm does not follow, or where an arm of ``start`` is, is not known.
            GoalNotReached: an arm that moved did not come to rest.
        """
        for side, then in (start or {}).items():
            snapshot = self._control.snapshot(side)
            if not snapshot.is_streaming:  # it may have been led away since its last datagram
                raise RobotNotReady(message("plan_without_position", arm=side.word))
            away = max(abs(b - a) for a, b in zip(then, snapshot.position, strict=True))
            if not away <= PLAN_TOLERANCE:
                raise CommandRefused(message("arm_moved_since_plan", arm=side.word, distance=away))
        plans = {
            side: plan_trajectory(
                JointTrajectory(joint_names(side), _timed_points(side, points)), (side,), self.limits
            )[side]
            for side, points in trajectories.items()
        }
        return self._follow_plans(TRAJECTORY_CONTROLLER, tuple(plans), lambda starts: plans, check)

    def follow_path(
        self,
        sides: Sequence[Side],
        plan: Callable[[Mapping[Side, Joints]], Mapping[Side, ArmPlan]],
        check: Callable[[], None] = lambda: None,
    ) -> tuple[Motion, ...]:
        """Have arms follow paths of their tools that are planned from where they stand, beginning at the same moment.

        What moves when it is called comes to rest first.

        Raises:
            CommandRefused: a path is impossible; nothing moves, but what moved has come to rest.
            RobotNotReady: an arm does not follow.
            GoalNotReached: an arm that moved did not come to rest.
        """
        for side in sides:
            self._check_has(side, CARTESIAN_CONTROLLER)
        moving = [side for side in sides if self.is_moving(side)]
        for motion in self.stop(moving):
            motion.wait(LAST_STOP)
        return self._follow_plans(CARTESIAN_CONTROLLER, sides, plan, check)

    def _follow_plans(
        self,
        name: str,
        sides: Sequence[Side],
        plan: Callable[[Mapping[Side, Joints]], Mapping[Side, ArmPlan]],
        check: Callable[[], None] = lambda: None,
    ) -> tuple[Motion, ...]:
        """Have a controller of each arm follow what ``plan`` makes of where the arms stand."""
        for side in sides:
            self._check_follows(side)
        for side in sides:
            self._take_over(side, name)
            self._streaming.pop(side, None)
        before = {side: self._control.snapshot(side).command_epoch for side in sides}
        plans = plan(self._control.call(Commands.commanded_positions, *sides))
        check()
        for side, epoch in before.items():  # planning takes a while
            if self._control.snapshot(side).command_epoch != epoch:
                reason = message("interrupted_while_planned", arm=side.word)
                raise CommandRefused(message("goal_refused", reason=reason))
        most = max(len(each.spline.segments) + 1 for each in plans.values())
        start = self._clock.now() + time_to_start(most) if len(plans) > 1 else None
        motions = {side: self._motions.begin(side) for side in plans}
        commands = [
            ControllerCommand(
                side,
                name,
                FollowTrajectory(replace(each, start=start), motions[side].identity, ARRIVAL),
                before[side][1],
            )
            for side, each in plans.items()
        ]
        for side, each in plans.items():
            motions[side].follow_way(partial(self._way_on_trajectory, motions[side], each.spline.end))
        return self._send(commands, tuple(motions.values()))

    def stop(self, sides: Iterable[Side]) -> tuple[Motion, ...]:
        """Have arms come to rest, as fast as their joints may; those that do not follow stand already.

        Returns:
            The motions to standstill.
        """
        moving = [side for side in sides if self._control.snapshot(side).is_commanded]
        self._activate(moving, GOAL_CONTROLLER)
        motions = tuple(self._motions.begin(side) for side in moving)
        return self._send(
            [ControllerCommand(each.side, GOAL_CONTROLLER, StopMotion(each.identity)) for each in motions], motions
        )

    def stream(self, side: Side, goal: Position) -> None:
        """Have an arm follow a stream of goals, of which this is the next.

        Raises:
            CommandRefused: the goal is impossible; the arm keeps the one before.
            RobotNotReady: the arm does not follow.
            GoalNotReached: an arm that moved did not come to rest.
        """
        checked = checked_goal(side, goal, self.snapshot(side).sent)
        session, _ = self._begin_stream(side, STREAM_CONTROLLER)
        write_goal(self._goals[side], session, checked)

    def jog(self, side: Side, speeds: Sequence[float], owner: object) -> bool:
        """Have an arm move with joint speeds [rad/s], (7,), until its controller's timeout or :meth:`end_jog`.

        The first call only takes the arm over, which may last seconds; the next one moves it, if it still comes. Until
        the jogs of one ``owner`` end, or have not come for 0.3 s, those of another one are refused.

        Returns:
            Whether its controllers were switched for it.

        Raises:
            CommandRefused: the speeds are no seven finite numbers, or another owner or motion moves the arm.
            RobotNotReady: the arm does not follow.
        """
        if side not in self._speeds:
            raise RobotNotReady(message("jog_controller_missing", arm=side.word, controller=JOG_CONTROLLER))
        if len(speeds) != JOINT_COUNT or not all(map(isfinite, speeds)):
            raise CommandRefused(message("jog_speeds_malformed", count=JOINT_COUNT, given=str(list(speeds)[:8])))
        buffer = self._speeds[side]

        def write(session: int, values: Joints) -> None:
            write_speeds(buffer, session, values)

        return self._jog(side, JOG_CONTROLLER, buffer, write, joints(speeds), owner)

    def jog_tool(self, side: Side, twist: Sequence[float], tool: Pose, owner: object, *, is_in_tool: bool) -> bool:
        """Have a tool move with a velocity until its controller's timeout or :meth:`end_jog`, as :meth:`jog`.

        Args:
            side: the arm.
            twist: velocity [m/s], angular velocity and that of the arm angle [rad/s], (7,).
            tool: its frame in tool0.
            owner: who jogs.
            is_in_tool: whether it is seen from the tool, else from the body.
        """
        if len(twist) != JOINT_COUNT:
            raise CommandRefused(message("jog_twist_malformed", count=JOINT_COUNT, given=str(list(twist)[:8])))
        check_twist(twist)
        buffer = self._tool_goals[side]

        def write(session: int, values: Joints) -> None:
            buffer.write(twist_goal(session, values, tool, is_in_tool=is_in_tool))

        return self._jog(side, CARTESIAN_CONTROLLER, buffer, write, joints(twist), owner)

    def _jog(
        self,
        side: Side,
        controller: str,
        buffer: Buffer[Any],
        write: Callable[[int, Joints], None],
        values: Joints,
        owner: object,
    ) -> bool:
        self._check_owner(side, owner)
        session, is_new = self._begin_stream(side, controller, is_jog=True)  # may last seconds, so without the lock
        with self._jog_locks[side]:
            self._check_owner(side, owner)
            last = self._jogs.get(side)
            is_first = is_new or last is None or last.controller != controller
            if last is not None and not is_first:
                if _number(buffer) != last.number:  # a ROS topic: two streams must not alternate
                    self._streaming.pop(side, None)
                    raise CommandRefused(message("jog_streamed_by_another", controller=controller, arm=side.word))
                write(session, values)
            self._jogs[side] = _Jog(controller, self._clock.now(), _number(buffer), buffer, write, owner)
        return is_first

    def _check_owner(self, side: Side, owner: object) -> None:
        last = self._jogs.get(side)
        if last is None or last.owner in (None, owner) or self._clock.now() - last.time >= _JOG_GAP:
            return
        raise CommandRefused(message("jogged_by_another", arm=side.word))

    def end_jog(self, side: Side, owner: object) -> None:
        """Have an arm stop that ``owner`` jogged last; one that something else commands meanwhile is left alone."""
        with self._jog_locks[side]:
            last = self._jogs.get(side)
            if last is None or last.owner is not owner:
                return
            last = self._jogs[side] = last._replace(owner=None)
            snapshot, known = self._control.snapshot(side), self._streaming.get(side)
            is_commanding = known == (last.controller, snapshot.session, snapshot.activation)
            if is_commanding and _number(last.buffer) == last.number:
                if last.controller == CARTESIAN_CONTROLLER:
                    # By joints: a stream slows down along its line, which takes longer, and braking begins anew then.
                    stop = ControllerCommand(side, CARTESIAN_CONTROLLER, CancelTrajectory())
                    with suppress(YumiError):
                        self._control.call(Commands.send_commands, stop)
                        return
                last.write(snapshot.session, ZERO)
                self._jogs[side] = last._replace(number=_number(last.buffer))

    def _begin_stream(self, side: Side, controller: str, *, is_jog: bool = False) -> tuple[int, bool]:
        """The session of an arm that ``controller`` commands, taken over from standstill; whether it is newly so."""
        snapshot = self.snapshot(side)
        known = (controller, snapshot.session, snapshot.activation)
        if is_jog and self._motions.is_open(side):
            self._check_follows(side)
            raise _other_motion(side)
        if self._streaming.get(side) == known and snapshot.is_commanded:
            return snapshot.session, False
        if controller == CARTESIAN_CONTROLLER:
            self._check_has(side, controller)
        self._check_follows(side)
        last = self._streaming.get(side, ("", 0, 0))
        jog = self._jogs.get(side)
        if (
            is_jog
            and jog
            and self._clock.now() - jog.time < _JOG_GAP
            and last[0] == jog.controller
            and last[1:] != known[1:]
        ):
            self._streaming.pop(side, None)  # the next press of a key may take the arm back
            raise CommandRefused(message("jog_switched_by_another", arm=side.word))
        is_jogged = last[0] in (JOG_CONTROLLER, CARTESIAN_CONTROLLER) and last[1:] == known[1:]
        if is_jog and not is_jogged and self.is_moving(side):
            raise _other_motion(side)
        self._take_over(side, controller)
        snapshot = self._control.snapshot(side)
        self._streaming[side] = (controller, snapshot.session, snapshot.activation)
        return snapshot.session, True

    def stream_tool(self, side: Side, goal: Callable[[int], ToolGoal]) -> None:
        """Have an arm's tool follow a stream, of which ``goal`` of the EGM session is the next message.

        Raises:
            CommandRefused: the driver has no Cartesian controller.
            RobotNotReady: the arm does not follow.
            GoalNotReached: an arm that moved did not come to rest.
        """
        session, _ = self._begin_stream(side, CARTESIAN_CONTROLLER)
        self._tool_goals[side].write(goal(session))

    def _check_has(self, side: Side, name: str) -> None:
        if all(info.name != name for info in self._control.call(Commands.list_controllers, side)):
            raise CommandRefused(message("cartesian_controller_missing", arm=side.word, controller=name))

    def _limits_of_goals(self, side: Side, speed_scale: float | None, acceleration: float | None) -> JointLimits:
        """What the controller of single points keeps on an arm."""
        values = {
            it.parameter.name: it.value
            for it in self._control.call(Commands.list_parameters, side, GOAL_CONTROLLER)
            if isinstance(it.value, float)
        }
        scales = speed_scale or values["speed_scale"], acceleration or values["acceleration_scale"]
        return slower(YUMI_LIMITS, *scales, values["top_speed"])

    def _way_to_goal(self, side: Side, start: Joints, goal: Joints, motion: PointMotion | None) -> Way:
        """By how far the arm is on the straight way, whose times are those of a motion that begins at rest."""
        whole = dist(start, goal)
        progress = 1.0 - min(1.0, dist(self._control.snapshot(side).position, goal) / whole) if whole else 1.0
        if motion is None:
            return Way(progress, None)
        # Distances on the way grow with time: the time at which it is as far as the arm is now.
        early, late = 0.0, motion.duration
        for _ in range(20):  # to a millionth
            middle = 0.5 * (early + late)
            if dist(start, motion.at(middle).position) < progress * whole:
                early = middle
            else:
                late = middle
        return Way(progress, (motion.duration - late) / self._speed_scale())

    def _way_on_trajectory(self, motion: Motion, duration: float) -> Way:
        newest = next((it for it in self._trajectories(motion.side) if it.goal == motion.identity), None)
        if newest is None:
            return Way(0.0, None)
        time, scale = min(max(newest.progress, 0.0), duration), newest.scale
        return Way(time / duration if duration else 1.0, (duration - time) / scale if scale > 0.0 else None)

    def _take_over(self, side: Side, name: str) -> None:
        """From standstill: the controllers plan their motions differently."""
        if self.commanding(side) == (name,):
            return
        for motion in self.stop((side,)):
            motion.wait(LAST_STOP)
        self._activate([side], name)

    def _check_follows(self, side: Side) -> None:
        snapshot, fault = self.snapshot(side), self._motions.fault(side)
        if fault is not None:
            stop = self._motions.stop(side)
            raise RobotNotReady(message("arm_waits_for_recovery", arm=side.word, fault=fault), stop)
        reason = why_arm_does_not_follow(side, snapshot)
        if reason is not None:
            raise RobotNotReady(message("goal_refused", reason=reason))

    def _activate(self, sides: Iterable[Side], name: str) -> None:
        """Switch the arms to a controller; what commands one until then is deactivated in the same switch."""
        for side in sides:
            commanding = self.commanding(side)
            if commanding != (name,):
                self._streaming.pop(side, None)
                self._control.call(Commands.switch_controllers, side, (name,), commanding)

    def commanding(self, side: Side) -> tuple[str, ...]:
        """The controllers that command an arm."""
        infos = self._control.call(Commands.list_controllers, side)
        return tuple(info.name for info in infos if info.claimed)

    def _send(self, commands: Sequence[ControllerCommand], motions: tuple[Motion, ...]) -> tuple[Motion, ...]:
        if not commands:
            return ()
        try:
            self._control.call(Commands.send_commands, *commands)
        except YumiError:
            self._motions.forget(motions)
            raise
        return motions


class _Jog(NamedTuple):
    """The last jog of an arm.

    Attributes:
        controller: that carries it out.
        time: when it was asked for [s].
        number: of its message in the buffer.
        buffer: of the controller.
        write: writes a message for an EGM session.
        owner: who asked for it; None once it was ended.
    """

    controller: str
    time: float
    number: int
    buffer: Buffer[Any]
    write: Callable[[int, Joints], None]
    owner: object


def _number(buffer: Buffer[Any]) -> int:
    newest = buffer.read()
    return newest[0] if newest else 0


def _other_motion(side: Side) -> CommandRefused:
    return CommandRefused(message("jog_while_moving", arm=side.word))


def _timed_points(side: Side, points: Sequence[TimedPosition]) -> tuple[TrajectoryPoint, ...]:
    try:
        check_count(len(points))
        return tuple(
            TrajectoryPoint(float(time), *(tuple(map(float, _in_chain_order(side, each))) for each in values))
            for time, *values in points
        )
    except (TypeError, ValueError) as error:
        raise CommandRefused(message("trajectory_points_malformed", error=said_by(error))) from error


def checked_goal(side: Side, goal: Position, others: Joints) -> Joints:
    """``goal`` [rad] in chain order; raises CommandRefused when it is not seven joints within their ranges.

    It may be the name of a pose, too, or some joints by name: those that it leaves out are taken from ``others``.
    """
    try:
        values = [float(value) for value in _in_chain_order(side, goal, others)]
    except (TypeError, ValueError) as error:
        raise CommandRefused(message("goal_not_angles", given=quoted(goal))) from error
    if len(values) != JOINT_COUNT:
        raise CommandRefused(
            message("goal_joint_count_of_arm", count=len(values), joints=JOINT_COUNT, names=joint_names(side))
        )
    for index, (name, value) in enumerate(zip(joint_names(side), values, strict=True)):
        check_position(name, index, value)
    return joints(values)


def _checked_scale(name: str, value: object) -> float | None:
    """A fraction of the joints' limits as a plain number, which another process can read; None stays."""
    if value is None:
        return None
    try:
        scale = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError) as error:
        raise CommandRefused(message("goal_scale_no_number", name=name, given=quoted(value))) from error
    if not 0.0 < scale <= 1.0:  # NaN too; before controllers are switched for it
        raise CommandRefused(message("goal_scale_out_of_range", name=name, value=scale))
    return scale


def wait_for(motions: Sequence[Motion], timeout: float | None, executor: MotionExecutor) -> None:
    """Wait until all ``motions`` are at their goals, at most ``timeout`` [s]; else those that still move are stopped.

    Raises:
        GoalNotReached: a motion ended elsewhere, or its time was up.
    """
    try:
        wait_for_futures([motion.future for motion in motions], timeout, FIRST_EXCEPTION)
        check_ended(motions, timeout)
    except BaseException:  # Ctrl-C too
        halt(motions, executor)
        raise


def check_ended(motions: Iterable[Motion], timeout: float | None) -> None:
    """See how motions ended that were waited for; raises GoalNotReached when one ended elsewhere, or is not over."""
    for motion in [each for each in motions if each.is_done]:
        motion.future.result()
    late = tuple(motion.side.word for motion in motions if not motion.is_done)
    if late:
        raise GoalNotReached(message("goal_not_reached_in_time", arms=late, timeout=timeout))


def halt(motions: Iterable[Motion], executor: MotionExecutor) -> None:
    """Stop the arms of those motions that are under way, and wait until they stand."""
    with suppress(YumiError):  # what ended the wait is what a person must read; the control process holds what it can
        for stopping in executor.stop([motion.side for motion in motions if not motion.is_done]):
            stopping.wait(LAST_STOP)
