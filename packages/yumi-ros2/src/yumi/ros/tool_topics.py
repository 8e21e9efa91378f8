"""Topics of the Cartesian controllers: target poses, and streams of poses and velocities of the tool.

====================== =========================== ================================================================
topic                  type                        what it does
====================== =========================== ================================================================
…/target_pose          geometry_msgs/PoseStamped   moves the tool there on a straight line; the arm comes to rest
                                                   first
…/servo_pose           geometry_msgs/PoseStamped   the next pose of a stream
…/servo_twist          geometry_msgs/TwistStamped  the next velocity of a stream; without one the tool stops
====================== =========================== ================================================================

``…`` is the controller, such as ``r/cartesian_controller``. The tool is the one in use (``set_tool``; tool0 where none
was set). ``frame_id`` is any frame of the robot, as on ``/tf``, or one that others fix to it on ``/tf_static``; empty
is the robot's base. A velocity is seen from its frame; one in a frame on this arm's flange turns with it. What comes on
a stream with a stamp older than the parameter ``twist.timeout`` is refused; without a stamp it is new.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import count
from math import inf, isfinite
from threading import Lock
from typing import Any, NamedTuple

from geometry_msgs.msg import PoseStamped, TwistStamped

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import CommandRefused, YumiError
from abb_protocols.robot.joints import JointLimits, Joints, Pose, Side, Vector, joints, rotate
from abb_protocols.robot.kinematics import compose_poses
from abb_runtime.parameters import number
from yumi.control.goals import GoalKind
from yumi.control.loop_commands import Commands, ControllerCommand
from yumi.control.motion.robot_response import STANDING
from yumi.control.motion.setpoint import largest_difference
from yumi.control.shared_state import Snapshot
from yumi.control.tool_goal import check_tool_near, check_twist, pose_goal, twist_goal
from yumi.control.tool_limits import ToolLimits
from yumi.control.trajectory_commands import ArmPlan, CancelTrajectory, FollowTrajectory
from yumi.driver.control_process import ControlProcess
from yumi.planning.tool_path import TOOL_ZONE, LineWaypoint, checked_pose, plan_path
from yumi.ros.command_topics import CommandTopic
from yumi.ros.frames import RobotFrames
from yumi.ros.messages import nanoseconds, pose_of_ros_message
from yumi.ros.topic_refusals import command_refused

line_numbers = count(2**41)  # of these motions, beside those of trajectories and scripts

_HELD = 0.02  # [rad] an arm that is sent no further than this from where it is commanded to be is not held

_YOUNG = 0.01  # [s] no timeout is shorter
_ASKED_FOR = 1.0  # [s] for so long a timeout that was asked for is believed


class ToolTopic(CommandTopic):
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
        goals, snapshot = control.buffers[side].goals, partial(control.snapshot, side)
        super().__init__(node, side, goals, snapshot, now, control.hand_over)

    def _pose(self, received: Any) -> Pose:
        """The pose of a PoseStamped in the robot's base."""
        try:
            # In its own frame the pose is what was sent: an orientation of another length must not move its place.
            return compose_poses(
                self._frames.to_base(received.header.frame_id), checked_pose(pose_of_ros_message(received.pose))
            )
        except CommandRefused as error:
            raise command_refused(self.noun, error.said) from error

    def take(self, received: Any, waited: float = 0.0) -> None:
        try:
            super().take(received, waited)
        except YumiError as error:  # the control process has ended
            self._refusals.warn(error.said)


class _StreamTopic(ToolTopic):
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
            raise command_refused(self.noun, reason)


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
                raise target_refused(message(code, name=name, value=value))


class TargetPoseTopic(ToolTopic):
    """Poses to move to on straight lines."""

    topic, type, noun = "target_pose", PoseStamped, "Target"
    limits: JointLimits
    within = ToolLimits()

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.turn = Lock()  # one goal of an action at a time is planned

    def checked(self, received: Any, snapshot: Snapshot, time: float) -> Callable[[], None]:
        if max(map(abs, snapshot.velocity)) > STANDING:
            self._pose(received)
            return self._end_motion
        line = FollowTrajectory(self.plan(LineGoal((received,))), next(line_numbers))
        return partial(self.command, line, snapshot.activation)

    def _end_motion(self) -> None:
        """The line begins where the arm stands: what it follows now ends first."""
        self.command(CancelTrajectory())
        raise target_refused(message("arm_still_moved", arm=self._side.word))

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
            [*map(LineWaypoint, targets[:-1]), LineWaypoint(targets[-1], goal.arm_angle)],
            self.limits,
            tool=goal.tool or self._frames.tcp(side),
            speed=goal.speed or number(values, "line.speed"),
            turning=number(values, "line.turning"),
            zone=goal.zone or TOOL_ZONE,
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
                raise target_refused(message("arm_held_from_command", **known))
            raise target_refused(message("arm_held_from_command_by", limited=now.limited.said, **known))

    def commanded(self) -> Joints:
        """Where the arm is commanded to be [rad], (7,)."""
        return self._control.call(Commands.commanded_positions, self._side)[self._side]

    def command(self, message: FollowTrajectory | CancelTrajectory, activation: int = 0) -> None:
        """Have the controller take a command, as long as that ``activation`` lasts; raises CommandRefused."""
        self._control.call(Commands.send_commands, ControllerCommand(self._side, self.controller, message, activation))


class ServoPoseTopic(_StreamTopic):
    """Poses of a stream."""

    topic, type, noun = "servo_pose", PoseStamped, "Pose"

    def check_begin(self, received: Any, snapshot: Snapshot) -> None:
        try:
            goal = pose_goal(snapshot.session, self._pose(received), self._frames.tcp(self._side))
            check_tool_near(self._side, snapshot.sent, goal)
        except CommandRefused as error:
            raise command_refused(self.noun, error.said) from error

    def checked(self, received: Any, snapshot: Snapshot, time: float) -> Callable[[], None]:
        self._check_age(received, time)
        tool = self._frames.tcp(self._side)
        return partial(self._goals.write, pose_goal(snapshot.session, self._pose(received), tool, time=time))


class ServoTwistTopic(_StreamTopic):
    """Velocities of a stream."""

    topic, type, noun = "servo_twist", TwistStamped, "Velocity"

    def checked(self, received: Any, snapshot: Snapshot, time: float) -> Callable[[], None]:
        self._check_age(received, time)
        side, frame = self._side, received.header.frame_id
        linear, angular = received.twist.linear, received.twist.angular
        vectors: list[Vector] = [(linear.x, linear.y, linear.z), (angular.x, angular.y, angular.z)]
        check_twist([value for vector in vectors for value in vector])
        try:
            of_tool = self._frames.in_tool(side, frame)
            seen_from = self._frames.to_base(frame) if of_tool is None else of_tool
        except CommandRefused as error:
            raise command_refused(self.noun, error.said) from error
        turned = [rotate(seen_from.orientation, vector) for vector in vectors]
        twist = joints([*turned[0], *turned[1], 0.0])
        tool = self._frames.tcp(side)
        goal = twist_goal(snapshot.session, twist, tool, is_in_tool=of_tool is not None, time=time)
        return partial(self._goals.write, goal)


def target_refused(reason: Message) -> CommandRefused:
    """The refusal of a target pose, or of a line."""
    return command_refused("Target", reason)
