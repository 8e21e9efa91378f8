"""The Cartesian controllers in ROS: lines to poses, and streams of poses and velocities of the tool.

======================== ========================== ================================================================
topic or action          type                       what it does
======================== ========================== ================================================================
<controller>/move_linear yumi_interfaces/MoveLinear moves the tool there on a straight line, and says how that ended
<controller>/target_pose geometry_msgs/PoseStamped  moves the tool there on a straight line; the arm comes to rest first
<controller>/servo_pose  geometry_msgs/PoseStamped  the next pose of a stream
<controller>/servo_twist geometry_msgs/TwistStamped the next velocity of a stream; without one the tool stops
======================== ========================== ================================================================

The tool is the one in use (``set_tool``; tool0 where none was set). ``frame_id`` is any frame of the robot, as on
``/tf``; empty is the robot's base. A velocity is seen from its frame; one in a frame of this arm's tool turns with it.
What comes on a stream with a stamp older than the parameter ``twist.timeout`` is refused; without a stamp it is new.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from itertools import count
from math import inf, isfinite
from threading import Event as Flag
from threading import Lock
from time import monotonic
from typing import Any

from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from yumi_interfaces.action import MoveLinear

from yumi.clock import SystemClock
from yumi.control.controller import GoalKind
from yumi.control.controllers.cartesian import CartesianController, check_twist, pose_goal, twist_goal
from yumi.control.controllers.joint_trajectory import CancelTrajectory, FollowTrajectory, Outcome, TrajectoryEnded
from yumi.control.events import ControlProcessEnded
from yumi.control.loop import Commands, ControllerCommand
from yumi.control.motion import STANDING, largest_difference
from yumi.control.shared_state import INTERRUPTED, JointStates, Snapshot
from yumi.control.tool_limits import ToolLimited, ToolLimits
from yumi.control.tool_path import Waypoint, check_pose, plan_path
from yumi.control.trajectory import ArmPlan
from yumi.driver.control_process import ControlProcess
from yumi.errors import CommandRefused, RobotNotReady, YumiError
from yumi.robot.description import read_frames
from yumi.robot.joints import JointLimits, Joints, Pose, Side, Vector, joint_names, joints, prefixed
from yumi.robot.kinematics import IDENTITY, compose, inverse, rotate, tool0_to_body
from yumi.ros.controllers import MakeInterface
from yumi.ros.executors import is_cancelled
from yumi.ros.messages import pose_of
from yumi.ros.topics import CommandTopic
from yumi.settings import number

_BASE = Pose((0.0, 0.0, 0.0), IDENTITY)
_numbers = count(2**41)  # of these motions, beside those of trajectories and scripts
_FEEDBACK_PERIOD = 0.1  # [s]
_STANDS_FOR = 0.02  # [s] an arm whose command does not change for so long stands
_LAST_STOP = 5.0  # [s] an arm has come to rest by then; it takes a tenth of it
_HELD = 0.02  # [rad] an arm that is sent no further than this from where it is commanded to be is not held
_REPORTED_WITHIN = 1.0  # [s] the end of a line is reported by then, if at all
_YOUNG = 0.01  # [s] no timeout is shorter
_ASKED_FOR = 1.0  # [s] for so long a timeout that was asked for is believed


class RobotFrames:
    """Where the frames of the robot are, in its base.

    Args:
        urdf: the robot's description.
        prefix: before the names of frames on ``/tf``.
        tcp: the tool in use of an arm.
        measured: the newest measured state of an arm; None where there has been none.

    Attributes:
        urdf: as above, as ``tcp`` and ``measured``.
    """

    def __init__(
        self,
        urdf: str,
        prefix: str,
        tcp: Callable[[Side], Pose],
        measured: Callable[[Side], JointStates | None],
    ) -> None:
        self.urdf = urdf
        self._frames = {frame.name: frame for frame in read_frames(urdf)}
        self._prefix = prefix
        self.tcp = tcp
        self.measured = measured

    def named(self, frame_id: str) -> str:
        """The frame's name in the description; raises CommandRefused where it has none."""
        name = frame_id.lstrip("/").removeprefix(self._prefix) or prefixed("yumi_base")
        tools = [prefixed(f"yumi_tcp_{side.value}") for side in Side]
        root = prefixed("yumi_base_link")
        if name in self._frames or name == root or name in tools:
            return name
        raise CommandRefused(
            f"there is no frame {frame_id[:60]!r}; take {prefixed('yumi_base')}, {tools[0]}, or another frame of the "
            "robot."
        )

    def to_base(self, frame_id: str) -> Pose:
        """Where a frame is now.

        Raises:
            CommandRefused: there is none, or what moves it has not been measured.
        """
        name, pose = self.named(frame_id), _BASE
        for side in Side:
            if name == prefixed(f"yumi_tcp_{side.value}"):
                name, pose = prefixed(f"yumi_tool0_{side.value}"), self.tcp(side)
        positions: dict[str, float] = {}
        for side in Side:
            state = self.measured(side)
            if state is not None:
                positions.update(zip(joint_names(side), state.position, strict=True))
        while name in self._frames:
            frame = self._frames[name]
            if frame.joint and frame.joint not in positions and not frame.slides:
                raise CommandRefused(f"where frame {frame_id[:60]!r} is, is not known: its arm is not heard.")
            pose = compose(frame.to_parent(positions.get(frame.joint, 0.0)), pose)
            name = frame.parent
        return pose

    def tool_frame(self, side: Side, frame_id: str) -> Pose | None:
        """A frame of this arm's tool, seen from its tool in use; None for any other frame."""
        name = self.named(frame_id)
        to_tool = inverse(self.tcp(side))
        if name == prefixed(f"yumi_tcp_{side.value}"):
            return _BASE
        return to_tool if name == prefixed(f"yumi_tool0_{side.value}") else None


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

    def _pose(self, message: Any) -> Pose:
        """The pose of a PoseStamped in the robot's base."""
        try:
            pose = compose(self._frames.to_base(message.header.frame_id), pose_of(message.pose))
            check_pose(pose)
        except CommandRefused as error:
            raise CommandRefused(f"{self.noun} refused: {error}") from error
        return pose

    def take(self, message: Any) -> None:
        try:
            super().take(message)
        except YumiError as error:  # the control process has ended
            self._refusals.warn(str(error))


class _StreamTopic(_ToolTopic):
    """A stream, of which a message that is too old is refused."""

    _timeout, _asked_at = 0.0, -inf

    def _check_age(self, message: Any, time: float) -> None:
        """Refuse what has been under way for longer than a velocity counts."""
        stamp = message.header.stamp
        if not (stamp.sec or stamp.nanosec):
            return
        age = self._node.get_clock().now().nanoseconds * 1e-9 - (stamp.sec + stamp.nanosec * 1e-9)
        if age <= _YOUNG:
            return
        if not abs(time - self._asked_at) < _ASKED_FOR:
            infos = self._control.call(Commands.list_parameters, self._side, self.controller)
            self._timeout = number({it.parameter.name: it.value for it in infos}, "twist.timeout")
            self._asked_at = time
        if age > self._timeout:
            raise CommandRefused(
                f"{self.noun} refused: its stamp is {age:.2f} s old, and twist.timeout is {self._timeout:g} s; compare "
                "the clocks of the machines, or leave the stamp empty."
            )


class TargetPoseTopic(_ToolTopic):
    """Poses to move to on straight lines."""

    topic, type, noun = "target_pose", PoseStamped, "Target"
    limits: JointLimits
    within = ToolLimits()

    def put(self, message: Any, snapshot: Snapshot, time: float, *, is_new: bool) -> None:
        side = self._side
        if max(map(abs, snapshot.velocity)) > STANDING:
            # The line begins where the arm stands: what it follows now ends first.
            self.command(CancelTrajectory())
            raise CommandRefused(
                f"Target refused: the {side.word} arm still moved; it stops now. Send the target again when it stands, "
                "or a stream to servo_pose."
            )
        self.command(FollowTrajectory(self.plan(message, snapshot), next(_numbers)))

    def plan(self, message: Any, snapshot: Snapshot, speed: float = 0.0, angle: float | None = None) -> ArmPlan:
        """A line to a PoseStamped, from where the arm stands.

        Args:
            message: where to.
            snapshot: of the arm, which must not have been stopped since.
            speed: of the tool at most [m/s]; 0 takes the controller's.
            angle: of the elbow at the end [rad]; None keeps it where that is possible.

        Raises:
            CommandRefused: the pose is none, or cannot be reached on a line; the arm is held elsewhere than it is
                commanded to be; or it was stopped meanwhile.
        """
        self._check_not_held()
        side, target, call = self._side, self._pose(message), self._control.call
        values = {it.parameter.name: it.value for it in call(Commands.list_parameters, side, self.controller)}
        plan = plan_path(
            side,
            self.commanded(),
            [Waypoint(target, angle)],
            self.limits,
            tool=self._frames.tcp(side),
            speed=speed or number(values, "line.speed"),
            turning=number(values, "line.turning"),
            acceleration=number(values, "line.acceleration"),
            within=self.within,
        )
        if self._snapshot().command_epoch != snapshot.command_epoch:  # planning takes a while
            raise CommandRefused(f"Target refused: {INTERRUPTED.format(side.word)}")
        return plan

    def _check_not_held(self) -> None:
        """A line begins where the controller commands the arm to be: refuse one where the arm does not come to."""
        now = self._snapshot()
        held = 0.0 if now.reference is None else largest_difference(now.reference, now.sent)
        if held > _HELD:
            why = f" ({now.limited_by})" if now.limited_by else ""
            raise CommandRefused(
                f"Target refused: the {self._side.word} arm is held {held:.2f} rad from where {self.controller} "
                f"commands it to be{why}; deactivate that controller and activate it again: it begins where the arm is."
            )

    def commanded(self) -> Joints:
        """Where the arm is commanded to be [rad], (7,)."""
        return self._control.call(Commands.commanded_positions, self._side)[self._side]

    def command(self, message: FollowTrajectory | CancelTrajectory) -> None:
        """Have the controller take a command; raises CommandRefused."""
        self._control.call(Commands.send_commands, ControllerCommand(self._side, self.controller, message))


class ServoPoseTopic(_StreamTopic):
    """Poses of a stream."""

    topic, type, noun = "servo_pose", PoseStamped, "Pose"

    def put(self, message: Any, snapshot: Snapshot, time: float, *, is_new: bool) -> None:
        self._check_age(message, time)
        tool = self._frames.tcp(self._side)
        self._goals.write(pose_goal(snapshot.session, self._pose(message), tool, time=time))


class ServoTwistTopic(_StreamTopic):
    """Velocities of a stream."""

    topic, type, noun = "servo_twist", TwistStamped, "Velocity"

    def put(self, message: Any, snapshot: Snapshot, time: float, *, is_new: bool) -> None:
        self._check_age(message, time)
        side, frame = self._side, message.header.frame_id
        linear, angular = message.twist.linear, message.twist.angular
        vectors: list[Vector] = [(linear.x, linear.y, linear.z), (angular.x, angular.y, angular.z)]
        check_twist([value for vector in vectors for value in vector])
        try:
            of_tool = self._frames.tool_frame(side, frame)
            seen_from = self._frames.to_base(frame) if of_tool is None else of_tool
        except CommandRefused as error:
            raise CommandRefused(f"Velocity refused: {error}") from error
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
        end: how the controller ended it; None as long as it has not.
    """

    def __init__(self) -> None:
        self.number = next(_numbers)
        self.is_over = Flag()
        self.is_cancelled = False
        self.end: TrajectoryEnded | None = None


class _Cancelled(Exception):
    """The client has cancelled the goal before anything moved."""


class MoveLinearAction:
    """Serves ``<controller>/move_linear``.

    A goal that cannot be met is not rejected, since a rejection has no text: it is aborted at once, with the reason. A
    newer goal takes the place of one that is under way.

    Args:
        node: the controller's.
        side: which arm.
        control: the control process.
        target: plans the lines.
        frames: of the robot.
        base: the name of its base on ``/tf``.
    """

    def __init__(
        self, node: Any, side: Side, control: ControlProcess, target: TargetPoseTopic, frames: RobotFrames, base: str
    ) -> None:
        self._side, self._target, self._frames, self._base = side, target, frames, base
        self._feedback = control.buffers[side].tool_path
        self._snapshot = partial(control.snapshot, side)
        self._ros_clock, self._log = node.get_clock(), node.get_logger()
        self._lock = Lock()
        self._open: dict[Any, _Line] = {}  # by the goal's id
        self._turn = Lock()  # one goal at a time is planned
        self._server = ActionServer(
            node,
            MoveLinear,
            f"{target.controller}/move_linear",
            execute_callback=self._execute,
            cancel_callback=self._cancel,
            callback_group=ReentrantCallbackGroup(),
        )

    def on_event(self, event: object) -> bool:
        """An event of the controller; whether it was about a goal of the action."""
        with self._lock:
            if isinstance(event, ControlProcessEnded):
                for line in self._open.values():
                    line.is_over.set()
            if not isinstance(event, TrajectoryEnded):
                return False
            for line in self._open.values():
                if line.number == event.goal:
                    line.end = event
                    line.is_over.set()
                    return True
        return False

    def destroy(self) -> None:
        """End; goals that are open are aborted."""
        with self._lock:
            for line in self._open.values():
                line.is_over.set()
        self._server.destroy()

    def _cancel(self, handle: Any) -> Any:
        line = self._line(handle)  # also of a goal that was accepted and is not executed yet
        line.is_cancelled = True
        try:
            self._target.command(CancelTrajectory(line.number))
        except YumiError as error:  # it ends as the arm does
            self._log.info(f"The line could not be cancelled: {error}")
        return CancelResponse.ACCEPT

    def _line(self, handle: Any) -> _Line:
        with self._lock:
            return self._open.setdefault(bytes(handle.goal_id.uuid), _Line())

    def _execute(self, handle: Any) -> Any:
        line = self._line(handle)
        result = MoveLinear.Result()
        try:
            with self._turn:
                plan, epoch = self._begin(handle, line)
            while not line.is_over.wait(_FEEDBACK_PERIOD):
                if self._snapshot().command_epoch != epoch:
                    self._end_unreported(line, epoch)
                self._report(handle, line, plan.spline.end)
            self._finish(handle, line, result)
        except _Cancelled:
            result.message = "Cancelled before the arm moved."
            self._end_cancelled(handle)
        except YumiError as error:
            result.message = str(error)
            self._log.warning(result.message)
            handle.abort()
        finally:
            with self._lock:
                del self._open[bytes(handle.goal_id.uuid)]
        result.pose = self._pose()
        return result

    def _begin(self, handle: Any, line: _Line) -> tuple[ArmPlan, tuple[int, int]]:
        """Plan a goal from where the arm comes to rest, and have it followed; with the session and activation of it."""
        target, ask = self._target, handle.request
        if line.is_cancelled:  # while it waited for its turn
            raise _Cancelled
        target.check()
        for name, value in (("speed", ask.speed), ("arm_angle", ask.arm_angle)):
            if not isfinite(value) or (name == "speed" and value < 0.0):
                raise CommandRefused(f"Target refused: {name} is {value:g}; give a finite number, a speed above 0.")
        deadline, before = monotonic() + _LAST_STOP, target.commanded()
        while line.is_over.wait(_STANDS_FOR) or before != (now := target.commanded()):
            if line.is_cancelled:  # what others have asked for goes on
                raise _Cancelled
            if line.is_over.is_set() or monotonic() > deadline:
                raise CommandRefused(f"Target refused: the {self._side.word} arm did not come to rest.")
            target.command(CancelTrajectory())
            before = now
        snapshot = target.check()
        plan = target.plan(ask.target_pose, snapshot, ask.speed, ask.arm_angle if ask.turn_elbow else None)
        if line.is_cancelled:
            raise _Cancelled
        target.command(FollowTrajectory(plan, line.number))
        if line.is_cancelled:  # between the two
            target.command(CancelTrajectory(line.number))
        return plan, snapshot.command_epoch

    def _end_unreported(self, line: _Line, epoch: tuple[int, int]) -> None:
        """Another session or activation ends a line, and events can be dropped: its goal must end all the same.

        Raises:
            RobotNotReady: its end was not reported.
        """
        if line.is_over.wait(_REPORTED_WITHIN) or self._snapshot().command_epoch == epoch:
            return
        with suppress(YumiError):  # nothing is known of it: it must not go on
            self._target.command(CancelTrajectory(line.number))
        raise RobotNotReady(
            f"The line was ended: the {self._side.word} arm was stopped, or another controller took it over; how the "
            "line ended was not reported."
        )

    def _report(self, handle: Any, line: _Line, duration: float) -> None:
        newest = self._feedback.read()
        if newest is None or newest[1].goal != line.number or not handle.is_active:
            return
        time, scale = min(max(newest[1].progress, 0.0), duration), newest[1].scale
        feedback = MoveLinear.Feedback(pose=self._pose(), progress=time / duration if duration else 1.0)
        feedback.remaining = (duration - time) / scale if scale > 0.0 else inf
        handle.publish_feedback(feedback)

    def _finish(self, handle: Any, line: _Line, result: Any) -> None:
        end = line.end
        if end is None:
            raise RobotNotReady("The line was ended: the controller was unloaded, or the control process has ended.")
        result.message, result.success = end.sentence, end.outcome is Outcome.SUCCEEDED
        if result.success:
            handle.succeed()
        elif end.outcome is Outcome.CANCELED and line.is_cancelled:
            self._end_cancelled(handle)
        else:
            handle.abort()

    def _end_cancelled(self, handle: Any) -> None:
        (handle.canceled if is_cancelled(handle, SystemClock()) else handle.abort)()

    def _pose(self) -> Any:
        """Of the tool, in the robot's base; empty where it is not known."""
        message, state = PoseStamped(), self._frames.measured(self._side)
        if state is not None:
            message.header.frame_id, message.header.stamp = self._base, self._ros_clock.now().to_msg()
            pose = tool0_to_body(self._side, state.position, self._frames.tcp(self._side))
            place, turn = message.pose.position, message.pose.orientation
            place.x, place.y, place.z = pose.position
            turn.w, turn.x, turn.y, turn.z = pose.orientation
        return message


class CartesianTopics:
    """All topics of one Cartesian controller, and its action; the ends of other lines are logged."""

    def __init__(self, node: Any, action: MoveLinearAction, topics: tuple[_ToolTopic, ...]) -> None:
        self._log = node.get_logger()
        self._action = action
        self._topics = topics

    def on_event(self, event: Any) -> None:
        if not self._action.on_event(event) and isinstance(event, TrajectoryEnded):
            (self._log.info if event.outcome is Outcome.SUCCEEDED else self._log.warning)(str(event))
        if isinstance(event, ToolLimited):
            self._log.info(str(event))

    def destroy(self) -> None:
        self._action.destroy()
        for topic in self._topics:
            topic.destroy()


def cartesian_interfaces(
    streams: Mapping[Side, Any],
    control: ControlProcess,
    now: Callable[[], float],
    frames: RobotFrames,
    limits: JointLimits,
    base: str,
    within: ToolLimits,
) -> Mapping[str, MakeInterface]:
    """What Cartesian controllers offer, by their type; ``streams`` are nodes for streams alone, ``base`` a frame.

    Lines keep ``limits`` of the joints, and are planned ``within`` those of the tool.
    """

    def make(node: Any, side: Side, name: str) -> CartesianTopics:
        target = TargetPoseTopic(node, side, control, now, name, frames)
        target.limits, target.within = limits, within
        streamed = (kind(streams[side], side, control, now, name, frames) for kind in (ServoPoseTopic, ServoTwistTopic))
        action = MoveLinearAction(node, side, control, target, frames, base)
        return CartesianTopics(node, action, (target, *streamed))

    return {CartesianController.kind: make}
