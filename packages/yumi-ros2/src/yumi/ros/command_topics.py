"""The topics of commands for an arm: a message becomes a checked goal, or a logged refusal.

Each loaded forward controller has a command topic of its name.

================================ ========================== ===================================================
topic                            type                       for
================================ ========================== ===================================================
joint_commands                   sensor_msgs/JointState     joint_position_controller: positions, speeds if known
joint_velocity_commands          sensor_msgs/JointState     joint_velocity_controller: velocities
<controller>/commands            std_msgs/Float64MultiArray a forward controller: 7 positions or velocities by index
================================ ========================== ===================================================

Beside them, in the robot's namespace, ``joint_commands`` takes points of a stream for both arms and the grippers.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Container, Mapping
from functools import partial
from math import nan
from typing import Any

from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import ZERO_JOINTS, Joints, Side, finger_names, joint_names
from yumi.control.controllers.forward_command import FORWARDERS
from yumi.control.goals import CONFIGURED_DELAY, GoalBuffer, GoalKind, write_goal, write_speeds
from yumi.control.hand_over import Commander, HandOver
from yumi.control.loop_commands import Commands
from yumi.control.motion.setpoint import largest_difference
from yumi.control.motion.stream_begin import FARTHEST_STREAM_BEGIN
from yumi.control.shared_state import ARM_PROBLEM_CODES, ArmProblem, Snapshot
from yumi.driver.control_process import ControlProcess
from yumi.driver.controller_names import STREAM_CONTROLLER
from yumi.driver.gripper_follower import closed_of
from yumi.driver.stops import Cause, because
from yumi.ros.controller_manager_node import MakeInterface
from yumi.ros.messages import (
    goal_of_ros_message,
    goal_speeds_of,
    how_to_activate,
    nanoseconds,
    positions_of,
    speeds_of,
    velocities_of,
)
from yumi.ros.topic_refusals import RefusalLog, check_wait, command_refused, waited_for

_OLDEST_STAMP = 0.1
"""A goal whose stamp is older comes from a clock that is not ours [s]."""

# Reliable, as ros2_control's command topics: a best-effort reader may miss the first message of a new publisher, and
# a goal is sent once. Several partial goals may come at once, hence the depth.
_COMMAND_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)


class CommandTopic(ABC):
    """Commands for one arm; one that breaks a rule changes nothing, and the log says which.

    Args:
        node: the arm's controller manager node.
        side: which arm.
        buffer: where goals go.
        snapshot: what is known of the arm.
        now: the time on the machine's monotonic clock [s].
        hand_over: who commands the arm; None where nothing else does.
    """

    name: str
    type: Any
    noun: str
    kind: GoalKind
    taker: str
    controller: str

    def __init__(
        self,
        node: Any,
        side: Side,
        buffer: GoalBuffer,
        snapshot: Callable[[], Snapshot],
        now: Callable[[], float] = lambda: nan,
        hand_over: HandOver | None = None,
    ) -> None:
        self._node = node
        self._refusals = RefusalLog(node.get_logger(), now)
        self._side = side
        self._buffer = buffer
        self._snapshot = snapshot
        self._now = now
        self.why_stopped: Callable[[], Cause] = Cause
        self._hand_over = hand_over or HandOver(now)
        self._subscription = node.create_subscription(self.type, self.name, self._receive, _COMMAND_QOS)

    def destroy(self) -> None:
        """Take no more commands."""
        self._node.destroy_subscription(self._subscription)

    def _receive(self, received: Any, info: Mapping[str, Any]) -> None:
        waited = waited_for(info)
        try:
            check_wait(self.noun, waited)
        except CommandRefused as error:
            if not self.is_stop(received):
                self._refusals.warn(error.said)
                return
        self.take(received, waited)

    def take(self, received: Any, waited: float = 0.0) -> None:
        """Pass on a command that was received ``waited`` [s] ago, or say why not."""
        time = self._now() - waited
        try:
            self._accept(received, time - self._age(received))
        except CommandRefused as error:
            self._refusals.warn(error.said)

    def is_stop(self, received: Any) -> bool:
        """Whether a command does nothing but end a motion, and is never too late."""
        return False

    @abstractmethod
    def checked(self, received: Any, snapshot: Snapshot, time: float) -> Callable[[], None]:
        """Check a command before the arm is taken for it: one that is refused takes none.

        Args:
            received: of the topic's type.
            snapshot: of an arm that a matching controller commands.
            time: when it arrived [s].

        Returns:
            What writes the command, once the arm is taken.

        Raises:
            CommandRefused: it breaks a rule.
        """

    def is_for(self, kind: GoalKind) -> bool:
        """Whether a controller that takes goals of ``kind`` takes these."""
        return self.kind in kind

    def _age(self, received: Any) -> float:
        """How long ago the sender made ``received`` [s]; 0 where its stamp does not say."""
        return 0.0

    def check(self) -> Snapshot:
        """See that a matching controller commands the arm; what is known of it. Raises CommandRefused."""
        snapshot = self._snapshot()
        if not snapshot.is_running:
            refusal = command_refused(self.noun, message("arm_without_egm", arm=self._side.word))
            raise CommandRefused(because(refusal.said, self.why_stopped()))
        if snapshot.problem is not ArmProblem.NONE:
            raise command_refused(self.noun, message(ARM_PROBLEM_CODES[snapshot.problem], arm=self._side.word))
        if not self.is_for(snapshot.goal_kind):
            how = how_to_activate(self._node.get_namespace(), self._side, self.controller)
            reason = message("no_controller_for_topic", taker=self.taker, arm=self._side.word, how=how)
            raise command_refused(self.noun, reason)
        return snapshot

    def check_begin(self, received: Any, snapshot: Snapshot) -> None:
        """Refuse what sets out elsewhere than the arm is sent, after a person or another client has led the arm."""

    def check_near(self, goal: Joints, snapshot: Snapshot) -> None:
        """Refuse a position at which no stream begins now."""
        distance = largest_difference(goal, snapshot.sent)
        if distance > FARTHEST_STREAM_BEGIN:
            said = message(
                "stream_begins_elsewhere", arm=self._side.word, distance=distance, most=FARTHEST_STREAM_BEGIN
            )
            raise command_refused(self.noun, said)

    def _is_interrupted(self) -> bool:
        """Whether a person, or another client, has led the arm since the last command."""
        return not self._hand_over.is_own(self._side) and self._hand_over.was_of_another(self._side)

    def _accept(self, received: Any, time: float) -> None:
        snapshot = self.check()
        self._hand_over.check(self._side, Commander.STREAM)
        if self._is_interrupted():
            self.check_begin(received, snapshot)
        write = self.checked(received, snapshot, time)
        with self._hand_over.writing((self._side,), Commander.STREAM):
            write()


class JointCommandTopic(CommandTopic):
    """Positions by name; joints that are not named keep their goal."""

    name, type, noun = "joint_commands", JointState, "Goal"
    kind, taker, controller = GoalKind.POSITION, "position controller", STREAM_CONTROLLER

    _goal: Joints = ZERO_JOINTS
    _given_in = (0, 0)  # the session and activation of the goal

    def _age(self, received: Any) -> float:
        """The stream's predictor uses the stamps where they can be true, else the times of arrival."""
        stamp = received.header.stamp
        if not stamp.sec:
            return 0.0
        made = nanoseconds(stamp, f"{self.noun} refused: header.stamp")
        age = (self._node.get_clock().now().nanoseconds - made) * 1e-9
        return age if 0.0 <= age <= _OLDEST_STAMP else 0.0

    def checked(self, received: Any, snapshot: Snapshot, time: float) -> Callable[[], None]:
        return self._checked(received, snapshot, time, nan)

    def point(self, received: Any, time: float) -> Callable[[], None]:
        """What writes the next point of a stream, which arrived at ``time`` [s] and was checked; raises CommandRefused.

        The arm follows it by its stamp, as the controller's ``stream.delay`` says.
        """
        return self._checked(received, self.check(), time - self._age(received), CONFIGURED_DELAY)

    def _checked(self, received: Any, snapshot: Snapshot, time: float, delay: float) -> Callable[[], None]:
        base = self._goal
        if self._given_in != snapshot.command_epoch:  # the first goal since the controller was activated
            if snapshot.reference is None:
                raise command_refused(self.noun, message("no_reference_yet", arm=self._side.word))
            base = snapshot.reference
        goal, speeds = goal_of_ros_message(received, self._side, base), goal_speeds_of(received, self._side)
        self._hand_over.check(self._side, Commander.STREAM)
        # A single goal may be far away, but no stream begins there, and none goes on there that a person interrupted.
        begins = delay == CONFIGURED_DELAY and not self._hand_over.is_own(self._side)
        if begins or self._is_interrupted():
            self.check_near(goal, snapshot)

        def write() -> None:
            write_goal(self._buffer, snapshot.session, goal, speeds, time, delay)
            self._goal, self._given_in = goal, snapshot.command_epoch

        return write


class JointStreamTopic:
    """Points of a stream for both arms and the grippers, by the names of joints and fingers, in one message.

    All arms that it names follow it, or none; joints that are not named keep their goal. The position of a finger
    [m] is that of its gripper, which grips at 0.

    Args:
        node: of the robot.
        arms: the topics of the arms.
        follow: has grippers go to widths, from 0, open, to 1, closed; does not wait for them.
        now: the time on the machine's monotonic clock [s].
        hand_over: who commands the arms.
    """

    noun = "Stream"

    def __init__(
        self,
        node: Any,
        arms: Mapping[Side, JointCommandTopic],
        follow: Callable[[Mapping[Side, float]], None],
        now: Callable[[], float],
        hand_over: HandOver,
    ) -> None:
        self._node, self._arms, self._follow, self._now = node, arms, follow, now
        self._hand_over = hand_over
        self._refusals = RefusalLog(node.get_logger(), now)
        self._subscription = node.create_subscription(JointState, "joint_commands", self._receive, _COMMAND_QOS)

    def destroy(self) -> None:
        """Take no more commands."""
        self._node.destroy_subscription(self._subscription)

    def _receive(self, received: Any, info: Mapping[str, Any]) -> None:
        waited = waited_for(info)
        try:
            check_wait(self.noun, waited)
            self.take(received, waited)
        except CommandRefused as error:
            self._refusals.warn(error.said)

    def take(self, received: Any, waited: float = 0.0) -> None:
        """Pass on a point that was received ``waited`` [s] ago; raises CommandRefused, and nothing was changed."""
        time, (parts, closed) = self._now() - waited, _split(received)
        self._hand_over.check_all(closed, Commander.STREAM)
        writes = [self._arms[side].point(part, time) for side, part in parts.items()]
        with self._hand_over.writing(parts, Commander.STREAM):
            for write in writes:
                write()
        if closed:
            self._follow(closed)


def _split(received: Any) -> tuple[dict[Side, Any], dict[Side, float]]:
    """The part of a point for each arm that it names, and how far grippers are to be closed."""
    has_speeds = len(received.velocity) > 0
    counts = {len(received.name), len(received.position), len(received.velocity) if has_speeds else len(received.name)}
    if len(counts) != 1:
        raise CommandRefused(
            message("stream_counts_differ", names=len(received.name), positions=len(received.position))
        )
    parts: dict[Side, Any] = {}
    closed: dict[Side, float] = {}
    for index, name in enumerate(received.name):
        side = next((it for it in Side if name in (*joint_names(it), *finger_names(it))), None)
        if side is None:
            raise CommandRefused(message("stream_joint_unknown", joint=name))
        if name in finger_names(side):
            closed[side] = closed_of(side.word, 2.0 * received.position[index])
            continue
        part = parts.setdefault(side, JointState(header=received.header))
        part.name.append(name)
        part.position.append(received.position[index])
        if has_speeds:
            part.velocity.append(received.velocity[index])
    return parts, closed


class JointVelocityTopic(CommandTopic):
    """Velocities by name; joints that are not named stop."""

    name, type, noun = "joint_velocity_commands", JointState, "Speed"
    kind, taker, controller = GoalKind.VELOCITY, "velocity controller", "joint_velocity_controller"

    def is_stop(self, received: Any) -> bool:
        return not any(received.velocity)

    def checked(self, received: Any, snapshot: Snapshot, time: float) -> Callable[[], None]:
        return partial(write_speeds, self._buffer, snapshot.session, velocities_of(received, self._side), time)


class ForwardTopic(CommandTopic):
    """Values by index for one controller, on ``<controller>/commands``: positions or velocities, as it forwards.

    Args:
        node: the arm's node for topics alone.
        side: which arm.
        buffers: where positions go, and where velocities.
        snapshot: what is known of the arm.
        now: the time on the machine's monotonic clock [s].
        controller: its name.
        active: which controllers command the arm; asked after each activation.
        hand_over: who commands the arm.
    """

    type, noun, taker = Float64MultiArray, "Command", "forward controller"
    kind = GoalKind.NONE

    def __init__(
        self,
        node: Any,
        side: Side,
        buffers: tuple[GoalBuffer, GoalBuffer],
        snapshot: Callable[[], Snapshot],
        now: Callable[[], float],
        controller: str,
        active: Callable[[], Container[str]],
        hand_over: HandOver | None = None,
    ) -> None:
        self.name = self.controller = controller
        self.name += "/commands"
        self._positions, self._speeds = buffers
        self._active = active
        self._known = (0, False)  # the activation, and whether the controller commands in it
        super().__init__(node, side, buffers[0], snapshot, now, hand_over)

    def is_for(self, kind: GoalKind) -> bool:
        return bool(kind & (GoalKind.FORWARD_POSITION | GoalKind.FORWARD_VELOCITY))

    def is_stop(self, received: Any) -> bool:
        return GoalKind.FORWARD_VELOCITY in self._snapshot().goal_kind and not any(received.data)

    def check_begin(self, received: Any, snapshot: Snapshot) -> None:
        if GoalKind.FORWARD_VELOCITY not in snapshot.goal_kind:
            self.check_near(positions_of(received, self._side), snapshot)

    def checked(self, received: Any, snapshot: Snapshot, time: float) -> Callable[[], None]:
        self._check_active(snapshot.activation)
        if GoalKind.FORWARD_VELOCITY in snapshot.goal_kind:
            return partial(write_speeds, self._speeds, snapshot.session, speeds_of(received, self._side), time)
        return partial(write_goal, self._positions, snapshot.session, positions_of(received, self._side), time=time)

    def on_event(self, event: object) -> None:
        """A forward controller has no events."""

    def _check_active(self, activation: int) -> None:
        if activation != self._known[0]:
            self._known = (activation, self.controller in self._active())
        if not self._known[1]:
            how = how_to_activate(self._node.get_namespace(), self._side, self.controller)
            reason = message("controller_inactive_on_arm", controller=self.controller, arm=self._side.word, how=how)
            raise command_refused(self.noun, reason)


def forward_interfaces(
    nodes: Mapping[Side, Any], control: ControlProcess, now: Callable[[], float]
) -> Mapping[str, MakeInterface]:
    """What forward controllers offer, by their type."""

    def active(side: Side) -> frozenset[str]:
        infos = control.call(Commands.list_controllers, side)
        return frozenset(info.name for info in infos if info.claimed)

    def make(_: Any, side: Side, name: str) -> ForwardTopic:
        buffers = control.buffers[side]
        return ForwardTopic(
            nodes[side],
            side,
            (buffers.forward_positions, buffers.forward_speeds),
            partial(control.snapshot, side),
            now,
            name,
            partial(active, side),
            control.hand_over,
        )

    return {controller.kind: make for controller in FORWARDERS}
