"""The Cartesian controllers in ROS: lines to poses, and streams of poses and velocities of the tool.

======================== ========================== ================================================================
topic                    type                       what it does
======================== ========================== ================================================================
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
from functools import partial
from itertools import count
from math import inf, isfinite
from typing import Any

from geometry_msgs.msg import PoseStamped, TwistStamped

from yumi.control.controller import GoalKind
from yumi.control.controllers.cartesian import CartesianController, pose_goal, twist_goal
from yumi.control.controllers.joint_trajectory import CancelTrajectory, FollowTrajectory, Outcome, TrajectoryEnded
from yumi.control.loop import Commands, ControllerCommand
from yumi.control.motion import STANDING
from yumi.control.shared_state import INTERRUPTED, JointStates, Snapshot
from yumi.control.tool_path import Waypoint, check_pose, plan_path
from yumi.driver.control_process import ControlProcess
from yumi.errors import CommandRefused, YumiError
from yumi.robot.frames import read_frames
from yumi.robot.joints import JointLimits, Pose, Side, Vector, joint_names, joints, prefixed
from yumi.robot.kinematics import IDENTITY, compose, inverse, rotate
from yumi.ros.controllers import MakeInterface
from yumi.ros.messages import pose_of
from yumi.ros.topics import CommandTopic
from yumi.settings import number

_BASE = Pose((0.0, 0.0, 0.0), IDENTITY)
_FIRST_NUMBER = 2**41  # numbers of these motions, beside those of actions and scripts
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
    _numbers = count(_FIRST_NUMBER)
    limits: JointLimits

    def put(self, message: Any, snapshot: Snapshot, time: float, *, is_new: bool) -> None:
        side, target = self._side, self._pose(message)
        call = self._control.call
        values = {it.parameter.name: it.value for it in call(Commands.list_parameters, side, self.controller)}
        if max(map(abs, snapshot.velocity)) > STANDING:
            # The line begins where the arm stands: what it follows now ends first.
            call(Commands.send_commands, ControllerCommand(side, self.controller, CancelTrajectory()))
            raise CommandRefused(
                f"Target refused: the {side.word} arm still moved; it stops now. Send the target again when it stands, "
                "or a stream to servo_pose."
            )
        start = call(Commands.commanded_positions, side)[side]
        plan = plan_path(
            side,
            start,
            [Waypoint(target)],
            self.limits,
            tool=self._frames.tcp(side),
            speed=number(values, "line.speed"),
            turning=number(values, "line.turning"),
            acceleration=number(values, "line.acceleration"),
        )
        if self._snapshot().command_epoch != snapshot.command_epoch:  # planning takes a while
            raise CommandRefused(f"Target refused: {INTERRUPTED.format(side.word)}")
        call(
            Commands.send_commands,
            ControllerCommand(side, self.controller, FollowTrajectory(plan, next(self._numbers))),
        )


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
        if not all(isfinite(value) for vector in vectors for value in vector):
            raise CommandRefused("Velocity refused: a value is not finite.")
        try:
            of_tool = self._frames.tool_frame(side, frame)
            seen_from = self._frames.to_base(frame) if of_tool is None else of_tool
        except CommandRefused as error:
            raise CommandRefused(f"Velocity refused: {error}") from error
        turned = [rotate(seen_from.orientation, vector) for vector in vectors]
        twist = joints([*turned[0], *turned[1], 0.0])
        tool = self._frames.tcp(side)
        self._goals.write(twist_goal(snapshot.session, twist, tool, is_in_tool=of_tool is not None, time=time))


class CartesianTopics:
    """All topics of one Cartesian controller; the ends of its lines are logged."""

    def __init__(self, node: Any, topics: tuple[_ToolTopic, ...]) -> None:
        self._log = node.get_logger()
        self._topics = topics

    def on_event(self, event: Any) -> None:
        if isinstance(event, TrajectoryEnded):
            (self._log.info if event.outcome is Outcome.SUCCEEDED else self._log.warning)(str(event))

    def destroy(self) -> None:
        for topic in self._topics:
            topic.destroy()


def cartesian_interfaces(
    streams: Mapping[Side, Any],
    control: ControlProcess,
    now: Callable[[], float],
    frames: RobotFrames,
    limits: JointLimits,
) -> Mapping[str, MakeInterface]:
    """What Cartesian controllers offer, by their type; ``streams`` are nodes for streams alone."""

    def make(node: Any, side: Side, name: str) -> CartesianTopics:
        target = TargetPoseTopic(node, side, control, now, name, frames)
        target.limits = limits
        streamed = (kind(streams[side], side, control, now, name, frames) for kind in (ServoPoseTopic, ServoTwistTopic))
        return CartesianTopics(node, (target, *streamed))

    return {CartesianController.kind: make}
