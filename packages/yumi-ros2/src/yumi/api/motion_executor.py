"""The motion executor: sends goals, trajectories and tool paths of one arm or both to their controllers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from math import dist

from abb_protocols.catalogue import message, quoted
from abb_protocols.errors import CommandRefused, RobotNotReady
from abb_protocols.robot.joints import JOINT_COUNT, YUMI_LIMITS, JointLimits, Joints, Pose, Side, joint_names, joints
from abb_protocols.robot.kinematics import compose_poses, inverse_pose, tool0_to_body
from abb_runtime.clock import Clock
from yumi.api.joint_positions import Position, TimedPosition, checked_goal, timed_points
from yumi.api.motion_registry import Motion, MotionRegistry, MotionWay
from yumi.api.poses import pose_from
from yumi.api.postures import posture_for
from yumi.api.streams import ArmStreams
from yumi.control.controllers.joint_goal import JointGoal
from yumi.control.hand_over import Commander
from yumi.control.loop_commands import Commands, ControllerCommand
from yumi.control.motion.point_motion import PointMotion, point_travel
from yumi.control.motion.robot_response import STANDING
from yumi.control.motion.setpoint import Setpoint
from yumi.control.speed_scale import FULL_SPEED
from yumi.control.tool_limits import ToolLimits
from yumi.control.trajectory_commands import ArmPlan, FollowTrajectory, Tolerances
from yumi.driver.control_process import ControlProcess
from yumi.driver.controller_names import CARTESIAN_CONTROLLER, GOAL_CONTROLLER, TRAJECTORY_CONTROLLER
from yumi.planning.common_time import started_together
from yumi.planning.tool_path import TOOL_SPEED, TOOL_TURNING, LineWaypoint, ToolMotion, plan_tool_motions
from yumi.planning.trajectory_request import JointTrajectory, plan_trajectory

_PLAN_TOLERANCE = 0.02
"""So far may a joint have moved since a plan was made that is executed [rad]."""

RETREAT_SPEED_SCALE = 0.1
"""Of the joints' speeds, with which arms are led out of each other's way."""

_ARRIVAL = Tolerances(goal=joints([0.002] * JOINT_COUNT), goal_velocity=joints([STANDING] * JOINT_COUNT), goal_time=2.0)
"""When a trajectory's last point is reached: the same as for single points."""

_PLACE = 3  # numbers of a pose without an orientation


class MotionExecutor(ArmStreams):
    """Sends goals to the arms of one robot.

    Args:
        control: the control process.
        motions: those under way.
        arms: those on which EGM runs.
        limits: what a trajectory may ask of the joints.
        clock: of the trajectories' starts, which the control process shares.
        speed_scale: the factor on all speeds now.
        tool_limits: what tools keep on lines.

    Attributes:
        limits: as above.
        tool_limits: as above.
    """

    def __init__(
        self,
        control: ControlProcess,
        motions: MotionRegistry,
        arms: tuple[Side, ...],
        limits: JointLimits,
        clock: Clock,
        speed_scale: Callable[[], float] = lambda: FULL_SPEED,
        tool_limits: ToolLimits = ToolLimits(),  # noqa: B008 - it is frozen
    ) -> None:
        super().__init__(control, motions, arms, clock)
        self.limits, self.tool_limits = limits, tool_limits
        self._speed_scale = speed_scale

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
            self.check_follows(side)
        self.control.hand_over.take_all(checked, Commander.TRAJECTORY, None)
        self.activate(checked, GOAL_CONTROLLER)
        limits = {side: self._limits_of_goals(side, speed_scale, acceleration) for side in checked}
        check()
        motions = {side: self.motions.begin(side) for side in checked}
        commands = [
            ControllerCommand(side, GOAL_CONTROLLER, JointGoal(goal, motions[side].identity, speed_scale, acceleration))
            for side, goal in checked.items()
        ]
        sent = self.send(commands, tuple(motions.values()))
        for side, goal in checked.items():
            plan = None
            with suppress(CommandRefused):  # a way that bends, as the arm moved when it got its goal
                plan = point_travel(Setpoint(starts[side]), goal, limits[side])
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
            targets = {side: compose_poses(pose, inverse_pose(tools[side])) for side, pose in poses.items()}
            positions: dict[Side, Position] = {
                side: posture_for(side, tool0, None, None, starts[side], YUMI_LIMITS) for side, tool0 in targets.items()
            }
            return self.move(positions, speed_scale, acceleration, check=check)
        scale = _checked_scale("speed_scale", speed_scale) or 1.0
        paths = {
            side: ToolMotion(
                tools[side],
                (LineWaypoint(pose),),
                scale * (line_speed or TOOL_SPEED),
                scale * TOOL_TURNING,
                acceleration=acceleration or 1.0,
            )
            for side, pose in poses.items()
        }
        return self.follow_path(paths, check)

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
            snapshot = self.control.snapshot(side)
            if not snapshot.is_streaming:  # it may have been led away since its last datagram
                raise RobotNotReady(message("plan_without_position", arm=side.word))
            away = max(abs(b - a) for a, b in zip(then, snapshot.position, strict=True))
            if not away <= _PLAN_TOLERANCE:
                raise CommandRefused(message("arm_moved_since_plan", arm=side.word, distance=away))
        plans = {
            side: plan_trajectory(JointTrajectory(joint_names(side), timed_points(side, points)), (side,), self.limits)[
                side
            ]
            for side, points in trajectories.items()
        }
        kind = Commander.TRAJECTORY if start is None else Commander.PLANNER
        return self._follow_plans(kind, TRAJECTORY_CONTROLLER, tuple(plans), lambda _: plans, check)

    def follow_path(
        self, paths: Mapping[Side, ToolMotion], check: Callable[[], None] = lambda: None
    ) -> tuple[Motion, ...]:
        """Have arms follow paths of their tools that are planned from where they stand; they begin and end together.

        What moves when it is called comes to rest first.

        Raises:
            CommandRefused: a path is impossible; nothing moves, but what moved has come to rest.
            RobotNotReady: an arm does not follow.
            GoalNotReached: an arm that moved did not come to rest.
        """
        for side in paths:
            self.check_has(side, CARTESIAN_CONTROLLER)

        def plan(starts: Mapping[Side, Joints]) -> Mapping[Side, ArmPlan]:
            return plan_tool_motions(paths, starts, self.limits, self.tool_limits)

        return self._follow_plans(Commander.TRAJECTORY, CARTESIAN_CONTROLLER, tuple(paths), plan, check, from_rest=True)

    def _follow_plans(
        self,
        kind: Commander,
        name: str,
        sides: Sequence[Side],
        plan: Callable[[Mapping[Side, Joints]], Mapping[Side, ArmPlan]],
        check: Callable[[], None],
        *,
        from_rest: bool = False,
    ) -> tuple[Motion, ...]:
        """Have a controller of each arm follow what ``plan`` makes of where the arms stand, else as taken for it."""
        for side in sides:
            self.check_follows(side)
        before = self.take_for_trajectories(sides, kind, name, from_rest=from_rest)
        try:
            plans = plan(self.control.call(Commands.commanded_positions, *sides))
        except CommandRefused:  # found only now, where the arms stand: other clients need not wait for nothing
            for side in sides:
                self.control.hand_over.let_go(side)
            raise
        check()
        for side, epoch in before.items():  # planning takes a while
            if self.control.snapshot(side).command_epoch != epoch:
                reason = message("interrupted_while_planned", arm=side.word)
                raise CommandRefused(message("goal_refused", reason=reason))
        motions = {side: self.motions.begin(side) for side in plans}
        commands = [
            ControllerCommand(side, name, FollowTrajectory(each, motions[side].identity, _ARRIVAL), before[side][1])
            for side, each in started_together(plans, self.clock.now()).items()
        ]
        for side, each in plans.items():
            motions[side].follow_way(partial(self._way_on_trajectory, motions[side], each.spline.end))
        return self.send(commands, tuple(motions.values()))

    def _limits_of_goals(self, side: Side, speed_scale: float | None, acceleration: float | None) -> JointLimits:
        """What the controller of single points keeps on an arm."""
        values = {
            it.parameter.name: it.value
            for it in self.control.call(Commands.list_parameters, side, GOAL_CONTROLLER)
            if isinstance(it.value, float)
        }
        scales = speed_scale or values["speed_scale"], acceleration or values["acceleration_scale"]
        return YUMI_LIMITS.slower(*scales, values["top_speed"])

    def _way_to_goal(self, side: Side, start: Joints, goal: Joints, motion: PointMotion | None) -> MotionWay:
        """By how far the arm is on the straight way, whose times are those of a motion that begins at rest."""
        whole = dist(start, goal)
        progress = 1.0 - min(1.0, dist(self.control.snapshot(side).position, goal) / whole) if whole else 1.0
        if motion is None:
            return MotionWay(progress, None)
        # Distances on the way grow with time: the time at which it is as far as the arm is now.
        early, late = 0.0, motion.duration
        for _ in range(20):  # to a millionth
            middle = 0.5 * (early + late)
            if dist(start, motion.setpoint(middle).position) < progress * whole:
                early = middle
            else:
                late = middle
        return MotionWay(progress, (motion.duration - late) / self._speed_scale())

    def _way_on_trajectory(self, motion: Motion, duration: float) -> MotionWay:
        newest = next((it for it in self.trajectories(motion.side) if it.goal == motion.identity), None)
        if newest is None:
            return MotionWay(0.0, None)
        time, scale = min(max(newest.progress, 0.0), duration), newest.scale
        return MotionWay(time / duration if duration else 1.0, (duration - time) / scale if scale > 0.0 else None)


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
