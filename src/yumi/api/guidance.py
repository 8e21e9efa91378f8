"""Guides the arms on behalf of a script: who commands them, and which orders they get."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol, SupportsFloat

from yumi.api.motions import LAST_STOP, Motion, MotionBook
from yumi.clock import Clock
from yumi.control.calming import STANDING
from yumi.control.goals import check_position, put_goal
from yumi.control.mailbox import Mailbox
from yumi.control.requests import Done, ListControllers, Order, Request, SendOrders, SwitchControllers
from yumi.control.snapshot import CAUSES, Problem, Snapshot
from yumi.control.spline import TrajectoryPoint
from yumi.control.trajectory import TOGETHER, ArmPlan, JointTrajectory, plan_trajectory
from yumi.controllers.joint_goal import JointGoal, StopMotion
from yumi.controllers.trajectory_orders import FollowTrajectory, Tolerances
from yumi.errors import CommandRefused, RobotNotReady, YumiError
from yumi.robot.joints import JOINT_COUNT, Joints, Side, joint_names, joints
from yumi.robot.limits import JointLimits

GOAL_CONTROLLER = "joint_goal_controller"
"""Takes an arm to single points."""

STREAM_CONTROLLER = "joint_position_controller"
"""Follows a stream of points."""

TRAJECTORY_CONTROLLER = "joint_trajectory_controller"
"""Follows points with times."""

ARRIVAL = Tolerances(goal=joints([0.002] * JOINT_COUNT), goal_velocity=joints([STANDING] * JOINT_COUNT), goal_time=2.0)
"""When a trajectory's last point is reached: the same as for single points."""

Position = Sequence[SupportsFloat]
"""Seven joint positions in chain order (axes 1, 2, 7, 3, 4, 5, 6) [rad]: a list, a tuple, an array."""


TimedPosition = Sequence[Any]
"""A time since the begin [s], the joint positions then [rad], and, if wanted, velocities [rad/s] and accelerations."""


class FastLine(Protocol):
    """What is needed of the fast line."""

    def snapshot(self, side: Side) -> Snapshot:
        """What is known of an arm."""

    def ask(self, request: Request) -> Done:
        """Have ``request`` served between two cycles."""


class Guidance:
    """Orders for the arms of one robot.

    Args:
        fast_line: where the controllers live.
        goals: where each arm's stream of goals goes.
        book: of the motions under way.
        arms: those that are guided.
        limits: what a trajectory may ask of the joints.
        clock: of the trajectories' begins, which the fast line shares.
    """

    def __init__(
        self,
        fast_line: FastLine,
        goals: Mapping[Side, Mailbox],
        book: MotionBook,
        arms: tuple[Side, ...],
        limits: JointLimits,
        clock: Clock,
    ) -> None:
        self.arms = arms
        self._limits = limits
        self._clock = clock
        self._fast_line = fast_line
        self._goals = goals
        self._book = book
        self._streaming: dict[Side, tuple[int, int]] = {}  # session and activation of the stream's controller

    def snapshot(self, side: Side) -> Snapshot:
        """What is known of an arm.

        Raises:
            RobotNotReady: it is not one of those that are guided.
        """
        if side not in self.arms:
            raise RobotNotReady(f"The {side.word} arm is not guided; name it in connect(arms=...).")
        return self._fast_line.snapshot(side)

    def fault(self, side: Side) -> str | None:
        """What stopped the arm, in a sentence; None when nothing did."""
        return self._book.fault(side)

    def move(
        self, goals: Mapping[Side, Position], speed: float | None, acceleration: float | None
    ) -> tuple[Motion, ...]:
        """Send arms to goals, both in the same cycle period, or none of them.

        Args:
            goals: where each arm shall go.
            speed: share of the joints' speeds, above 0 up to 1; None takes the connection's.
            acceleration: the same for accelerations and jerks.

        Raises:
            CommandRefused: a goal is impossible; nothing moves.
            RobotNotReady: an arm does not follow.
        """
        checked = {side: checked_goal(side, goal) for side, goal in goals.items()}
        speed, acceleration = checked_scale("speed", speed), checked_scale("acceleration", acceleration)
        self._lead(checked)
        motions = {side: self._book.begin(side) for side in checked}
        orders = [
            Order(side, GOAL_CONTROLLER, JointGoal(goal, motions[side].identity, speed, acceleration))
            for side, goal in checked.items()
        ]
        return self._send(orders, tuple(motions.values()))

    def follow(self, trajectories: Mapping[Side, Sequence[TimedPosition]]) -> tuple[Motion, ...]:
        """Have arms follow trajectories that begin at the same moment, or none of them.

        Raises:
            CommandRefused: a trajectory is impossible; nothing moves, but what moved has come to rest.
            RobotNotReady: an arm does not follow.
            GoalNotReached: an arm that moved did not come to rest.
        """
        plans = {side: self._plan(side, _timed_points(points)) for side, points in trajectories.items()}
        for side in plans:
            self._check_follows(side)
        for side in plans:
            self._take_over(side, TRAJECTORY_CONTROLLER)
        start = self._clock.now() + TOGETHER if len(plans) > 1 else None
        motions = {side: self._book.begin(side) for side in plans}
        orders = [
            Order(
                side,
                TRAJECTORY_CONTROLLER,
                FollowTrajectory(replace(plan, start=start), motions[side].identity, ARRIVAL),
            )
            for side, plan in plans.items()
        ]
        return self._send(orders, tuple(motions.values()))

    def stop(self, sides: Iterable[Side]) -> tuple[Motion, ...]:
        """Have arms come to rest, as fast as their joints may; those that do not follow stand already.

        Returns:
            The motions to standstill.
        """
        moving = [side for side in sides if self._fast_line.snapshot(side).is_commanded]
        self._activate(moving, GOAL_CONTROLLER)
        motions = tuple(self._book.begin(side) for side in moving)
        return self._send([Order(each.side, GOAL_CONTROLLER, StopMotion(each.identity)) for each in motions], motions)

    def stream(self, side: Side, goal: Position) -> None:
        """Let an arm follow a stream of goals, of which this is the next.

        Raises:
            CommandRefused: the goal is impossible; the arm keeps the one before.
            RobotNotReady: the arm does not follow.
            GoalNotReached: an arm that moved did not come to rest.
        """
        checked = checked_goal(side, goal)
        snapshot = self.snapshot(side)
        if self._streaming.get(side) != (snapshot.session, snapshot.activation) or not snapshot.is_commanded:
            self._check_follows(side)
            self._take_over(side, STREAM_CONTROLLER)
            snapshot = self._fast_line.snapshot(side)
            self._streaming[side] = (snapshot.session, snapshot.activation)
        put_goal(self._goals[side], snapshot.session, checked)

    def _plan(self, side: Side, points: tuple[TrajectoryPoint, ...]) -> ArmPlan:
        return plan_trajectory(JointTrajectory(joint_names(side), points), (side,), self._limits)[side]

    def _take_over(self, side: Side, name: str) -> None:
        """From standstill: the controllers lead an arm by different laws."""
        if self._commanding(side) == (name,):
            return
        for motion in self.stop((side,)):
            motion.wait(LAST_STOP)
        self._activate([side], name)

    def _lead(self, sides: Iterable[Side]) -> None:
        for side in sides:
            self._check_follows(side)
        self._activate(sides, GOAL_CONTROLLER)

    def _check_follows(self, side: Side) -> None:
        snapshot, fault = self.snapshot(side), self._book.fault(side)
        if fault is not None:
            raise RobotNotReady(f"The {side.word} arm was stopped and waits for robot.recover(). {fault}")
        if snapshot.problem is not Problem.NONE:
            raise RobotNotReady(f"Goal refused: {side.word} arm: {CAUSES[snapshot.problem]}.")
        if not snapshot.is_running:
            raise RobotNotReady(f"EGM is not running on the {side.word} arm; call robot.recover().")

    def _activate(self, sides: Iterable[Side], name: str) -> None:
        """Give the arms to a controller; what commands one until then gives way in the same switch."""
        for side in sides:
            commanding = self._commanding(side)
            if commanding != (name,):
                self._streaming.pop(side, None)
                self._fast_line.ask(SwitchControllers(side, activate=(name,), deactivate=commanding))

    def _commanding(self, side: Side) -> tuple[str, ...]:
        infos = self._fast_line.ask(ListControllers(side)).controllers
        return tuple(info.name for info in infos if info.claimed)

    def _send(self, orders: Sequence[Order], motions: tuple[Motion, ...]) -> tuple[Motion, ...]:
        if not orders:
            return ()
        try:
            self._fast_line.ask(SendOrders(tuple(orders)))
        except YumiError:
            self._book.forget(motions)
            raise
        return motions


def _timed_points(points: Sequence[TimedPosition]) -> tuple[TrajectoryPoint, ...]:
    try:
        return tuple(
            TrajectoryPoint(float(time), *(tuple(float(value) for value in each) for each in values))
            for time, *values in points
        )
    except (TypeError, ValueError) as error:
        raise CommandRefused(
            "Trajectory refused: each of its points is a time and seven positions, and no more than velocities and "
            f"accelerations besides ({error})."
        ) from error


def checked_goal(side: Side, goal: Position) -> Joints:
    """``goal`` [rad] in chain order, when an arm can be there.

    Raises:
        CommandRefused: not seven numbers, or one of them is impossible.
    """
    try:
        values = [float(value) for value in goal]
    except (TypeError, ValueError) as error:
        raise CommandRefused(f"Goal refused: {goal!r} is no list of numbers; give seven angles in radians.") from error
    if len(values) != JOINT_COUNT:
        raise CommandRefused(
            f"Goal refused: it has {len(values)} positions; an arm has {JOINT_COUNT} joints: "
            f"{', '.join(joint_names(side))}."
        )
    for index, (name, value) in enumerate(zip(joint_names(side), values, strict=True)):
        check_position(name, index, value)
    return joints(values)


def checked_scale(name: str, value: object) -> float | None:
    """A share of the joints' limits as a plain number, which another process can read; None stays.

    Raises:
        CommandRefused: no number.
    """
    if value is None:
        return None
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError) as error:
        raise CommandRefused(f"Goal refused: {name} is {value!r}; give a number above 0 up to 1.") from error
