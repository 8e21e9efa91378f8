"""The Cartesian controllers in ROS: lines to poses, and streams of poses and velocities of the tool.

========================= =========================== =================================================================
topic, action or service  type                        what it does
========================= =========================== =================================================================
…/move_linear             MoveLinear                  moves the tool on straight lines, and says how that ended
…/target_pose             geometry_msgs/PoseStamped   moves the tool there on a straight line; the arm comes to rest
                                                      first
…/servo_pose              geometry_msgs/PoseStamped   the next pose of a stream
…/servo_twist             geometry_msgs/TwistStamped  the next velocity of a stream; without one the tool stops
…/inverse_kinematics      InverseKinematics           all postures of a pose
…/jacobian                Jacobian                    how the tool moves with the joints
dual_arm_cartesian_       MoveBothLinear              moves both tools as one motion
controller/move_linear
========================= =========================== =================================================================

``…`` is the controller, such as ``r/cartesian_controller``; types without a package are of ``yumi_interfaces``. The
tool is the one in use (``set_tool``; tool0 where none was set), or what ``tool_frame`` names. ``frame_id`` is any frame
of the robot, as on ``/tf``, or one that others fix to it on ``/tf_static``; empty is the robot's base. A velocity is
seen from its frame; one in a frame on this arm's flange turns with it. What comes on a stream with a stamp older than
the parameter ``twist.timeout`` is refused; without a stamp it is new.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from itertools import count
from math import inf, isfinite
from threading import Event as Flag
from threading import Lock
from time import monotonic
from typing import Any, NamedTuple

from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from sensor_msgs.msg import JointState
from yumi_interfaces.action import MoveBothLinear, MoveLinear
from yumi_interfaces.srv import InverseKinematics, Jacobian

from yumi.catalogue import Message, message
from yumi.clock import SystemClock
from yumi.control.controller import GoalKind
from yumi.control.controllers.cartesian import CartesianController, check_twist, pose_goal, twist_goal
from yumi.control.controllers.joint_trajectory import CancelTrajectory, FollowTrajectory, Outcome, TrajectoryEnded
from yumi.control.loop import Commands, ControllerCommand
from yumi.control.motion import STANDING, largest_difference
from yumi.control.shared_state import ControlProcessEnded, ReportsDropped, Snapshot
from yumi.control.tool_path import ZONE, ToolLimited, ToolLimits, Waypoint, checked_pose, plan_path
from yumi.control.trajectory import ArmPlan, stretched, time_to_start
from yumi.driver.control_process import ENDED, ControlProcess
from yumi.errors import CommandRefused, RobotNotReady, YumiError
from yumi.robot.inverse_kinematics import arm_angle, jacobian, postures, unreachable
from yumi.robot.joints import (
    JOINT_COUNT,
    YUMI_LIMITS,
    JointLimits,
    Joints,
    Pose,
    Side,
    Vector,
    joint_names,
    joints,
    rotate,
)
from yumi.robot.kinematics import compose, inverse, tool0_to_body
from yumi.ros.command_topics import CommandTopic
from yumi.ros.controller_manager import MakeInterface
from yumi.ros.frames import RobotFrames
from yumi.ros.messages import SERVICES, nanoseconds, pose_of, say_why
from yumi.ros.nodes import is_cancelled
from yumi.settings import number

CARTESIAN_CONTROLLER = "cartesian_controller"
"""Name of the arms' controllers that the action of both arms uses."""

_numbers = count(2**41)  # of these motions, beside those of trajectories and scripts
_FEEDBACK_PERIOD = 0.1  # [s]
_STANDS_FOR = 0.02  # [s] an arm whose command does not change for so long stands
_LAST_STOP = 5.0  # [s] an arm has come to rest by then; it takes a tenth of it
_HELD = 0.02  # [rad] an arm that is sent no further than this from where it is commanded to be is not held
_REPORTED_WITHIN = 1.0  # [s] the end of a line is reported by then, if at all
_YOUNG = 0.01  # [s] no timeout is shorter
_ASKED_FOR = 1.0  # [s] for so long a timeout that was asked for is believed


class _ToolTopic(CommandTopic):
    """A topic of one Cartesian controller.

    Args:
        node: where it is.
        side: which arm.
        control: the control process.
        now: the time on the machine's monotonic clock [s].
        controller: its name.
        frames: of the robot.
    """

    kind, taker = GoalKind.TOOL, "Cartesian controller"
    topic: str

    def __init__(
        self,
        node: Any,
        side: Side,
        control: ControlProcess,
        now: Callable[[], float],
        controller: str,
        frames: RobotFrames,
    ) -> None:
        self.controller = controller
        self.name = f"{controller}/{self.topic}"
        self._frames = frames
        self._control = control
        self._goals = control.buffers[side].tool_goals
        super().__init__(node, side, control.buffers[side].goals, partial(control.snapshot, side), now)

    def _pose(self, received: Any) -> Pose:
        """The pose of a PoseStamped in the robot's base."""
        try:
            # In its own frame the pose is what was sent: an orientation of another length must not move its place.
            return compose(self._frames.to_base(received.header.frame_id), checked_pose(pose_of(received.pose)))
        except CommandRefused as error:
            raise CommandRefused(message("command_refused", noun=self.noun, reason=error.said)) from error

    def take(self, received: Any, waited: float = 0.0) -> None:
        try:
            super().take(received, waited)
        except YumiError as error:  # the control process has ended
            self._refusals.warn(error.said)


class _StreamTopic(_ToolTopic):
    """A stream, of which a message that is too old is refused."""

    _timeout, _asked_at = 0.0, -inf

    def _check_age(self, received: Any, time: float) -> None:
        """Refuse what has been under way for longer than a velocity counts."""
        stamp = received.header.stamp
        if not (stamp.sec or stamp.nanosec):
            return
        made = nanoseconds(stamp, f"{self.noun} refused: header.stamp")
        age = (self._node.get_clock().now().nanoseconds - made) * 1e-9
        if age <= _YOUNG:
            return
        if not abs(time - self._asked_at) < _ASKED_FOR:
            infos = self._control.call(Commands.list_parameters, self._side, self.controller)
            self._timeout = number({it.parameter.name: it.value for it in infos}, "twist.timeout")
            self._asked_at = time
        if age > self._timeout:
            reason = message("stamp_too_old", age=age, longest=self._timeout)
            raise CommandRefused(message("command_refused", noun=self.noun, reason=reason))


class LineGoal(NamedTuple):
    """What one arm's tool does in a goal.

    Attributes:
        poses: PoseStamped each; the last is the goal.
        speed: of the tool at most [m/s]; 0 takes the controller's.
        arm_angle: of the elbow at the end [rad]; None keeps it where that is possible.
        zone: corners are rounded from so far before them [m]; 0 is the usual one.
        tool: what is moved, in tool0; None is the tool in use.
    """

    poses: Sequence[Any]
    speed: float = 0.0
    arm_angle: float | None = None
    zone: float = 0.0
    tool: Pose | None = None

    def check(self) -> None:
        """See that its numbers can be meant; raises CommandRefused."""
        for name, value in (("speed", self.speed), ("zone", self.zone), ("arm_angle", self.arm_angle or 0.0)):
            if not isfinite(value) or (name != "arm_angle" and value < 0.0):
                code = "number_not_finite" if name == "arm_angle" else "number_negative"
                raise _target_refused(message(code, name=name, value=value))


class TargetPoseTopic(_ToolTopic):
    """Poses to move to on straight lines."""

    topic, type, noun = "target_pose", PoseStamped, "Target"
    limits: JointLimits
    within = ToolLimits()

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.turn = Lock()  # one goal of an action at a time is planned

    def put(self, received: Any, snapshot: Snapshot, time: float, *, is_new: bool) -> None:
        side = self._side
        if max(map(abs, snapshot.velocity)) > STANDING:
            # The line begins where the arm stands: what it follows now ends first.
            self.command(CancelTrajectory())
            raise _target_refused(message("arm_still_moved", arm=side.word))
        plan = self.plan(LineGoal((received,)))
        self.command(FollowTrajectory(plan, next(_numbers)), snapshot.activation)

    def plan(self, goal: LineGoal) -> ArmPlan:
        """Lines through poses, from where the arm stands.

        Raises:
            CommandRefused: a pose is none, or cannot be reached on a line; the arm is held elsewhere than it is
                commanded to be.
        """
        self._check_not_held()
        side, targets, call = self._side, [self._pose(each) for each in goal.poses], self._control.call
        values = {it.parameter.name: it.value for it in call(Commands.list_parameters, side, self.controller)}
        return plan_path(
            side,
            self.commanded(),
            [*map(Waypoint, targets[:-1]), Waypoint(targets[-1], goal.arm_angle)],
            self.limits,
            tool=goal.tool or self._frames.tcp(side),
            speed=goal.speed or number(values, "line.speed"),
            turning=number(values, "line.turning"),
            zone=goal.zone or ZONE,
            acceleration=number(values, "line.acceleration"),
            within=self.within,
        )

    def _check_not_held(self) -> None:
        """A line begins where the controller commands the arm to be: refuse one where the arm does not come to."""
        now = self._snapshot()
        held = 0.0 if now.reference is None else largest_difference(now.reference, now.sent)
        if held > _HELD:
            known = {"arm": self._side.word, "distance": held, "controller": self.controller}
            if now.limited is None:
                raise _target_refused(message("arm_held_from_command", **known))
            raise _target_refused(message("arm_held_from_command_by", limited=now.limited.said, **known))

    def commanded(self) -> Joints:
        """Where the arm is commanded to be [rad], (7,)."""
        return self._control.call(Commands.commanded_positions, self._side)[self._side]

    def command(self, message: FollowTrajectory | CancelTrajectory, activation: int = 0) -> None:
        """Have the controller take a command, as long as that ``activation`` lasts; raises CommandRefused."""
        self._control.call(Commands.send_commands, ControllerCommand(self._side, self.controller, message, activation))


class ServoPoseTopic(_StreamTopic):
    """Poses of a stream."""

    topic, type, noun = "servo_pose", PoseStamped, "Pose"

    def put(self, received: Any, snapshot: Snapshot, time: float, *, is_new: bool) -> None:
        self._check_age(received, time)
        tool = self._frames.tcp(self._side)
        self._goals.write(pose_goal(snapshot.session, self._pose(received), tool, time=time))


class ServoTwistTopic(_StreamTopic):
    """Velocities of a stream."""

    topic, type, noun = "servo_twist", TwistStamped, "Velocity"

    def put(self, received: Any, snapshot: Snapshot, time: float, *, is_new: bool) -> None:
        self._check_age(received, time)
        side, frame = self._side, received.header.frame_id
        linear, angular = received.twist.linear, received.twist.angular
        vectors: list[Vector] = [(linear.x, linear.y, linear.z), (angular.x, angular.y, angular.z)]
        check_twist([value for vector in vectors for value in vector])
        try:
            of_tool = self._frames.in_tool(side, frame)
            seen_from = self._frames.to_base(frame) if of_tool is None else of_tool
        except CommandRefused as error:
            raise CommandRefused(message("command_refused", noun="Velocity", reason=error.said)) from error
        turned = [rotate(seen_from.orientation, vector) for vector in vectors]
        twist = joints([*turned[0], *turned[1], 0.0])
        tool = self._frames.tcp(side)
        self._goals.write(twist_goal(snapshot.session, twist, tool, is_in_tool=of_tool is not None, time=time))


class _Line:
    """A goal of the action that has not ended.

    Attributes:
        number: of its motion.
        is_over: set when it has ended, or must.
        is_cancelled: whether its client wants no more of it.
        ends: how the controllers ended it, as far as they have.
        reason: why it has ended, where they have not reported it.
        sides: the arms that follow it.
        tools: what is moved, in tool0, where that is not the tool in use.
    """

    def __init__(self) -> None:
        self.number = next(_numbers)
        self.is_over = Flag()
        self.is_cancelled = False
        self.ends: dict[Side, TrajectoryEnded] = {}
        self.reason = message("line_ended_unloaded")
        self.sides: frozenset[Side] = frozenset()
        self.tools: Mapping[Side, Pose] = {}


def _target_refused(reason: Message) -> CommandRefused:
    return CommandRefused(message("command_refused", noun="Target", reason=reason))


class _Cancelled(Exception):
    """The client has cancelled the goal before anything moved."""


class _LineAction(ABC):
    """Serves an action that moves tools on straight lines.

    A goal that cannot be met is not rejected, since a rejection has no text: it is aborted at once, with the reason. A
    newer goal takes the place of one that is under way. Tools of both arms begin and end together; where one ends
    elsewhere, the other one stops.

    Args:
        node: where it is.
        name: of the action.
        control: the control process.
        now: the time of its clock [s].
        targets: plan the lines of each arm; may change.
        frames: of the robot.
        base: the name of its base on ``/tf``.
    """

    type: Any

    def __init__(
        self,
        node: Any,
        name: str,
        control: ControlProcess,
        now: Callable[[], float],
        targets: Mapping[Side, TargetPoseTopic],
        frames: RobotFrames,
        base: str,
    ) -> None:
        self._targets, self._frames, self._base = targets, frames, base
        self._control, self._now = control, now
        self._ros_clock, self._log = node.get_clock(), node.get_logger()
        self._lock = Lock()
        self._open: dict[Any, _Line] = {}  # by the goal's id
        self._server = ActionServer(
            node,
            self.type,
            name,
            execute_callback=self._execute,
            cancel_callback=self._cancel,
            callback_group=ReentrantCallbackGroup(),
        )

    @abstractmethod
    def _goals(self, request: Any) -> Mapping[Side, LineGoal]:
        """What each arm does; raises CommandRefused."""

    @abstractmethod
    def _fill(self, message: Any, line: _Line) -> None:
        """Put the tools' poses into a result or feedback."""

    def _tool(self, side: Side, frame: str) -> Pose | None:
        """The frame that a goal names in tool0; None for the tool in use. Raises CommandRefused."""
        try:
            return self._frames.tool(side, frame) if frame else None
        except CommandRefused as error:
            raise _target_refused(error.said) from error

    def on_arm_event(self, side: Side, event: object) -> bool:
        """An event of an arm's controller; whether it was about a goal of the action."""
        with self._lock:
            if isinstance(event, ControlProcessEnded | ReportsDropped):
                for line in self._open.values():
                    if line.sides:  # else what it asks for is refused, with the reason
                        line.reason = ENDED if isinstance(event, ControlProcessEnded) else event.said
                        line.is_over.set()
            if not isinstance(event, TrajectoryEnded):
                return False
            for line in self._open.values():
                if line.number == event.goal:
                    line.ends[side] = event
                    if line.sides <= set(line.ends) or event.outcome is not Outcome.SUCCEEDED:
                        line.is_over.set()
                    return True
        return False

    def destroy(self) -> None:
        """End; goals that are open are aborted."""
        self.end_open_goals()
        self._server.destroy()

    def end_open_goals(self) -> None:
        """No controller will report their end any more."""
        with self._lock:
            for line in self._open.values():
                line.is_over.set()

    def _cancel(self, handle: Any) -> Any:
        line = self._line(handle)  # also of a goal that was accepted and is not executed yet
        line.is_cancelled = True
        self._stop(line)
        return CancelResponse.ACCEPT

    def _line(self, handle: Any) -> _Line:
        with self._lock:
            return self._open.setdefault(bytes(handle.goal_id.uuid), _Line())

    def _stop(self, line: _Line) -> None:
        """Have its arms come to rest; arms that have another goal meanwhile go on with that."""
        for side in line.sides:
            try:
                self._targets[side].command(CancelTrajectory(line.number))
            except (YumiError, KeyError) as error:  # it ends as the arm does
                self._log.info(f"The line of the {side.word} arm could not be cancelled: {error}")

    def _execute(self, handle: Any) -> Any:
        line = self._line(handle)
        result = self.type.Result()
        try:
            with ExitStack() as turns:
                plans, epochs = self._begin(handle, line, turns)
            while not line.is_over.wait(_FEEDBACK_PERIOD):
                if any(self._control.snapshot(side).command_epoch != epoch for side, epoch in epochs.items()):
                    self._end_unreported(line, epochs)
                self._report(handle, line, max(plan.spline.end for plan in plans.values()))
            self._finish(handle, line, result)
        except _Cancelled:
            result.message = "Cancelled before the arm moved."
            self._end_cancelled(handle)
        except YumiError as error:
            say_why(result, error)
            self._log.warning(result.message)
            handle.abort()
        finally:
            with self._lock:
                del self._open[bytes(handle.goal_id.uuid)]
        self._fill(result, line)
        return result

    def _begin(
        self, handle: Any, line: _Line, turns: ExitStack
    ) -> tuple[Mapping[Side, ArmPlan], Mapping[Side, tuple[int, int]]]:
        """Plan a goal from where the arms come to rest, and have it followed; with their session and activation."""
        goals = self._goals(handle.request)
        for goal in goals.values():
            goal.check()
        line.tools = {side: goal.tool for side, goal in goals.items() if goal.tool is not None}
        try:
            targets = {side: self._targets[side] for side in sorted(goals, key=lambda side: side.value)}
        except KeyError as error:
            reason = message("controller_not_loaded", arm=error.args[0].word, controller=CARTESIAN_CONTROLLER)
            raise _target_refused(reason) from error
        # Its turn and planning take a while: a stop meanwhile drops the goal, also where the arms follow again.
        snapshots = {side: target.check() for side, target in targets.items()}
        for target in targets.values():
            turns.enter_context(target.turn)
        if line.is_cancelled:  # while it waited for its turn
            raise _Cancelled
        self._bring_to_rest(line, targets, snapshots)
        plans = {side: target.plan(goals[side]) for side, target in targets.items()}
        longest = max(plan.spline.end for plan in plans.values())
        if line.is_cancelled:
            raise _Cancelled
        start = None  # at once
        if len(plans) > 1:
            start = self._now() + time_to_start(max(len(each.spline.segments) + 1 for each in plans.values()))
        line.sides = frozenset(targets)
        commands = [
            FollowTrajectory(replace(stretched(plan, longest), start=start), line.number) for plan in plans.values()
        ]
        self._control.call(
            Commands.send_commands,
            *(
                ControllerCommand(side, target.controller, command, snapshots[side].activation)
                for (side, target), command in zip(targets.items(), commands, strict=True)
            ),
        )
        if line.is_cancelled:  # between the two
            self._stop(line)
        return plans, {side: snapshot.command_epoch for side, snapshot in snapshots.items()}

    def _bring_to_rest(
        self, line: _Line, targets: Mapping[Side, TargetPoseTopic], snapshots: Mapping[Side, Snapshot]
    ) -> None:
        """Raises CommandRefused where an arm goes on moving."""

        def commanded() -> Mapping[Side, Joints]:
            return {side: target.commanded() for side, target in targets.items()}

        deadline, before = monotonic() + _LAST_STOP, commanded()
        while line.is_over.wait(_STANDS_FOR) or before != (now := commanded()):
            if line.is_cancelled:  # what others have asked for goes on
                raise _Cancelled
            if line.is_over.is_set() or monotonic() > deadline:
                raise _target_refused(message("arm_not_at_rest", arms=tuple(side.word for side in targets)))
            for side, target in targets.items():
                target.command(CancelTrajectory(), snapshots[side].activation)
            before = now

    def _end_unreported(self, line: _Line, epochs: Mapping[Side, tuple[int, int]]) -> None:
        """Another session or activation ends a line, and events can be dropped: its goal must end all the same.

        Raises:
            RobotNotReady: its end was not reported.
        """
        is_over = line.is_over.wait(_REPORTED_WITHIN)
        others = [side for side, epoch in epochs.items() if self._control.snapshot(side).command_epoch != epoch]
        if is_over or not others:
            return
        self._stop(line)  # nothing is known of it: it must not go on
        raise RobotNotReady(message("line_ended_unreported", arms=tuple(side.word for side in others)))

    def _report(self, handle: Any, line: _Line, duration: float) -> None:
        newest = [self._control.buffers[side].tool_path.read() for side in line.sides]
        ways = [each[1] for each in newest if each is not None and each[1].goal == line.number]
        if len(ways) < len(newest) or not handle.is_active:
            return
        time = min(max(min(way.progress for way in ways), 0.0), duration)
        scale = min(way.scale for way in ways)
        feedback = self.type.Feedback(progress=time / duration if duration else 1.0)
        feedback.remaining = (duration - time) / scale if scale > 0.0 else inf
        self._fill(feedback, line)
        handle.publish_feedback(feedback)

    def _finish(self, handle: Any, line: _Line, result: Any) -> None:
        failed = [(side, end) for side, end in line.ends.items() if end.outcome is not Outcome.SUCCEEDED]
        if not failed and not line.sides <= set(line.ends):
            raise RobotNotReady(line.reason)
        if not failed:
            result.message, result.success = str(next(iter(line.ends.values())).said), True
            handle.succeed()
            return
        if len(line.sides) > 1:
            self._stop(line)
        side, end = failed[0]
        said, held = end.said, self._control.snapshot(side).limited
        if held is not None:
            said = message("goal_not_reached_limited", arm=side.word, reason=end.said, limited=held.said)
        elif len(line.sides) > 1:
            said = message("goal_not_reached", arm=side.word, reason=end.said)
        result.message, result.code = str(said), said.code
        if end.outcome is Outcome.CANCELED and line.is_cancelled:
            self._end_cancelled(handle)
        else:
            handle.abort()

    def _end_cancelled(self, handle: Any) -> None:
        (handle.canceled if is_cancelled(handle, SystemClock()) else handle.abort)()

    def _pose(self, side: Side, line: _Line) -> Any:
        """Of what is moved, in the robot's base; empty where it is not known."""
        message, state = PoseStamped(), self._frames.measured(side)
        if state is not None:
            message.header.frame_id, message.header.stamp = self._base, self._ros_clock.now().to_msg()
            pose = tool0_to_body(side, state.position, line.tools.get(side) or self._frames.tcp(side))
            place, turn = message.pose.position, message.pose.orientation
            place.x, place.y, place.z = pose.position
            turn.w, turn.x, turn.y, turn.z = pose.orientation
        return message


class MoveLinearAction(_LineAction):
    """Serves ``<controller>/move_linear`` of one arm; the arguments as above, and ``side``, which arm."""

    type = MoveLinear

    def __init__(self, side: Side, *args: Any) -> None:
        self._side = side
        super().__init__(*args)

    def _goals(self, request: Any) -> Mapping[Side, LineGoal]:
        poses = [*request.through, request.target_pose]
        angle = request.arm_angle if request.turn_elbow else None
        tool = self._tool(self._side, request.tool_frame)
        return {self._side: LineGoal(poses, request.speed, angle, request.zone, tool)}

    def _fill(self, message: Any, line: _Line) -> None:
        message.pose = self._pose(self._side, line)


class MoveBothLinearAction(_LineAction):
    """Serves ``dual_arm_cartesian_controller/move_linear`` of both arms."""

    type = MoveBothLinear

    def _goals(self, request: Any) -> Mapping[Side, LineGoal]:
        if not (len(request.right) and len(request.left)):
            raise _target_refused(message("one_arm_without_pose", controller=CARTESIAN_CONTROLLER))
        return {
            side: LineGoal(poses, request.speed, None, request.zone, self._tool(side, frame))
            for side, poses, frame in (
                (Side.RIGHT, request.right, request.right_tool_frame),
                (Side.LEFT, request.left, request.left_tool_frame),
            )
        }

    def _fill(self, message: Any, line: _Line) -> None:
        message.right, message.left = self._pose(Side.RIGHT, line), self._pose(Side.LEFT, line)


class KinematicsServices:
    """Serves ``<controller>/inverse_kinematics`` and ``<controller>/jacobian`` of one arm.

    Args:
        node: the controller's.
        side: which arm.
        controller: its name.
        frames: of the robot.
    """

    def __init__(self, node: Any, side: Side, controller: str, frames: RobotFrames) -> None:
        self._node, self._side, self._frames = node, side, frames
        self._services = [
            node.create_service(kind, f"{controller}/{name}", partial(_answered, answer), qos_profile=SERVICES)
            for kind, name, answer in (
                (InverseKinematics, "inverse_kinematics", self._postures),
                (Jacobian, "jacobian", self._jacobian),
            )
        ]

    def destroy(self) -> None:
        """Serve no longer."""
        for service in self._services:
            self._node.destroy_service(service)

    def _now(self) -> Joints:
        state = self._frames.measured(self._side)
        if state is None:
            raise RobotNotReady(message("position_unknown", arm=self._side.word))
        return state.position

    def _postures(self, request: Any, response: Any) -> None:
        side, pose = self._side, request.target_pose
        target = compose(self._frames.to_base(pose.header.frame_id), checked_pose(pose_of(pose.pose)))
        tool0 = compose(target, inverse(self._frames.tool(side, request.tool_frame)))
        now = self._now()
        angle = request.arm_angle if request.turn_elbow else arm_angle(side, now)
        if not isfinite(angle):
            raise CommandRefused(message("arm_angle_not_finite", value=angle))
        found = sorted(postures(side, tool0, angle, YUMI_LIMITS), key=lambda each: largest_difference(each, now))
        response.postures = [JointState(name=joint_names(side), position=each) for each in found]
        response.success = bool(found)
        if not found:
            reason = message("no_posture_with_arm_angle", arm=side.word)
            say_why(response, unreachable(side, tool0, reason, now))

    def _jacobian(self, request: Any, response: Any) -> None:
        position = request.position if len(request.position) else self._now()
        if len(position) != JOINT_COUNT or not all(map(isfinite, position)):
            raise CommandRefused(message("no_joint_positions", joints=JOINT_COUNT))
        tool = self._frames.tool(self._side, request.tool_frame)
        response.jacobian = jacobian(self._side, joints(position), tool).ravel()
        response.success = True


def _answered(answer: Callable[[Any, Any], None], request: Any, response: Any) -> Any:
    """A response that says why where a request is refused."""
    try:
        answer(request, response)
    except YumiError as error:
        say_why(response, error)
    return response


class CartesianTopics:
    """All topics of one Cartesian controller, and its action; the ends of other lines are logged."""

    def __init__(
        self,
        node: Any,
        side: Side,
        actions: tuple[_LineAction, ...],
        parts: tuple[_LineAction | _ToolTopic | KinematicsServices, ...],
        on_end: Callable[[], None],
    ) -> None:
        self._log = node.get_logger()
        self._side, self._actions, self._parts, self._on_end = side, actions, parts, on_end

    def on_event(self, event: Any) -> None:
        is_known = [each.on_arm_event(self._side, event) for each in self._actions]
        if not any(is_known) and isinstance(event, TrajectoryEnded):
            (self._log.info if event.outcome is Outcome.SUCCEEDED else self._log.warning)(str(event))
        if isinstance(event, ToolLimited):
            self._log.info(str(event))

    def destroy(self) -> None:
        self._on_end()
        for part in self._parts:
            part.destroy()


def cartesian_interfaces(
    dual: Any,
    streams: Mapping[Side, Any],
    control: ControlProcess,
    now: Callable[[], float],
    frames: RobotFrames,
    limits: JointLimits,
    base: str,
    within: ToolLimits,
) -> Mapping[str, MakeInterface]:
    """What Cartesian controllers offer, by their type.

    ``dual`` is the node of the action of both arms, ``streams`` are nodes for streams alone, ``base`` is a frame. Lines
    keep ``limits`` of the joints, and are planned ``within`` those of the tool.
    """
    targets: dict[Side, TargetPoseTopic] = {}
    frames.listen(dual)
    both = MoveBothLinearAction(
        dual, f"dual_arm_{CARTESIAN_CONTROLLER}/move_linear", control, now, targets, frames, base
    )

    def make(node: Any, side: Side, name: str) -> CartesianTopics:
        target = TargetPoseTopic(node, side, control, now, name, frames)
        target.limits, target.within = limits, within
        streamed = (kind(streams[side], side, control, now, name, frames) for kind in (ServoPoseTopic, ServoTwistTopic))
        action = MoveLinearAction(side, node, f"{name}/move_linear", control, now, {side: target}, frames, base)
        services = KinematicsServices(node, side, name, frames)
        if name == CARTESIAN_CONTROLLER:
            targets[side] = target

        def end() -> None:
            if targets.get(side) is target:
                del targets[side]
                both.end_open_goals()

        return CartesianTopics(node, side, (action, both), (action, target, *streamed, services), end)

    return {CartesianController.kind: make}
