"""The driver's topics: commands of the arms, joint states, state of the robot and diagnostics, frames and description.

A command becomes a checked goal, or a logged refusal. Each loaded forward controller has a command topic of its name.

================================ ========================== ===================================================
topic                            type                       for
================================ ========================== ===================================================
joint_commands                   sensor_msgs/JointState     joint_position_controller: positions, speeds if known
joint_velocity_commands          sensor_msgs/JointState     joint_velocity_controller: velocities
<controller>/commands            std_msgs/Float64MultiArray a forward controller: 7 positions or velocities by index
================================ ========================== ===================================================

Joint states are published per arm every cycle, and merged at a lower rate; while EGM is silent they are what the
monitor reads from the controller. ``egm_state`` of each arm, ``/diagnostics`` and ``~/state`` of the robot manager say
how the robot is, ``/tf``, ``/tf_static`` and ``tcp_pose`` of each arm where it is.

The node ``robot_state_publisher`` takes the place of ROS's own program of that name, with its parameters: tools read
``robot_description`` from it, as a latched topic or as a parameter. A controller manager waits for one that has its
arm.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Container, Iterator, Mapping
from contextlib import suppress
from functools import partial
from math import inf, nan
from threading import Event
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped, TransformStamped
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from tf2_msgs.msg import TFMessage
from yumi_interfaces.msg import RobotState as RobotStateMessage

from yumi.catalogue import message
from yumi.clock import Clock
from yumi.control.controllers.forward_command import FORWARDERS
from yumi.control.goals import GoalBuffer, GoalKind, write_goal, write_speeds
from yumi.control.loop_commands import Commands
from yumi.control.shared_state import PROBLEMS, JointStates, Problem, Snapshot
from yumi.driver.control_process import ArmBuffers, ControlProcess
from yumi.driver.readiness import RobotState
from yumi.driver.settings import RosSettings
from yumi.driver.stops import Cause, because
from yumi.errors import CommandRefused
from yumi.planning.tool_path import checked_pose
from yumi.process.supervision import Failures, SupervisedThread
from yumi.robot.joints import ZERO, Joints, Pose, Side, finger_names, joint_names, prefixed
from yumi.robot.kinematics import IDENTITY, compose, inverse, tool0_to_body
from yumi.robot.urdf import Frame, read_frames
from yumi.ros.controller_manager import MakeInterface
from yumi.ros.messages import (
    LATCHED,
    RefusalLog,
    Stamps,
    check_wait,
    egm_status,
    goal_of,
    goal_speeds_of,
    how_to_activate,
    joint_state,
    nanoseconds,
    positions_of,
    robot_state,
    robot_status,
    speeds_of,
    stamp,
    velocities_of,
    waited_for,
)
from yumi.ros.nodes import TimerThread

ROBOT_STATE_PUBLISHER = "robot_state_publisher"
"""Of the node that has the frames and the description."""

OLDEST_STAMP = 0.1
"""A goal whose stamp is older comes from a clock that is not ours [s]."""

STALE = 1.0
"""The position of an arm whose last state is older is not known [s]; without EGM one comes every 0.4 s."""

STATE_POLL = 0.05
"""How often the robot's state is compared with the last one [s]; that asks nothing of the robot itself."""

STATE_PERIOD = 1.0
"""The robot's state is published at least so often [s]."""

_EGM_STATE_PERIOD = 0.1  # [s]
_DIAGNOSTICS_PERIOD = 1.0  # [s]
_CYCLE_WAIT = 0.1  # [s] within which a publisher's thread ends

# Reliable, as ros2_control's command topics: a best-effort reader may miss the first message of a new publisher, and
# a goal is sent once. Several partial goals may come at once, hence the depth.
_COMMAND_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
_STATES_DEPTH = 10
_TF_QOS = QoSProfile(depth=100)  # as tf2's own broadcaster
_STATIC_QOS = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)  # as tf2's own listener

_LONGEST_CHAIN = 100  # frames from the root on; more are a loop
_HERE = Pose((0.0, 0.0, 0.0), IDENTITY)


class CommandTopic(ABC):
    """Commands for one arm; one that breaks a rule changes nothing, and the log says which.

    Args:
        node: the arm's controller manager node.
        side: which arm.
        box: where goals go.
        snapshot: what is known of the arm.
        now: the time on the machine's monotonic clock [s].
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
        box: GoalBuffer,
        snapshot: Callable[[], Snapshot],
        now: Callable[[], float] = lambda: nan,
    ) -> None:
        self._node = node
        self._refusals = RefusalLog(node.get_logger(), now)
        self._side = side
        self._box = box
        self._snapshot = snapshot
        self._now = now
        self._given_in = (0, 0)  # session and activation
        self.why_stopped: Callable[[], Cause] = Cause
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
    def put(self, received: Any, snapshot: Snapshot, time: float, *, is_new: bool) -> None:
        """Check ``received`` and write its command to the box.

        Args:
            received: of the topic's type.
            snapshot: of an arm that a matching controller commands.
            time: when it arrived [s].
            is_new: whether it is the first since the controller was activated.

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
            reason = message("arm_without_egm", arm=self._side.word)
            said = message("command_refused", noun=self.noun, reason=reason)
            raise CommandRefused(because(said, self.why_stopped()))
        if snapshot.problem is not Problem.NONE:
            reason = message(PROBLEMS[snapshot.problem], arm=self._side.word)
            raise CommandRefused(message("command_refused", noun=self.noun, reason=reason))
        if not self.is_for(snapshot.goal_kind):
            how = how_to_activate(self._node.get_namespace(), self._side, self.controller)
            reason = message("no_controller_for_topic", taker=self.taker, arm=self._side.word, how=how)
            raise CommandRefused(message("command_refused", noun=self.noun, reason=reason))
        return snapshot

    def _accept(self, received: Any, time: float) -> None:
        snapshot = self.check()
        now = (snapshot.session, snapshot.activation)
        self.put(received, snapshot, time, is_new=self._given_in != now)
        self._given_in = now


class JointCommandTopic(CommandTopic):
    """Positions by name; joints that are not named keep their goal."""

    name, type, noun = "joint_commands", JointState, "Goal"
    kind, taker, controller = GoalKind.POSITION, "position controller", "joint_position_controller"

    _goal: Joints = ZERO

    def _age(self, received: Any) -> float:
        """The stream's predictor uses the stamps where they can be true, else the times of arrival."""
        stamp = received.header.stamp
        if not stamp.sec:
            return 0.0
        made = nanoseconds(stamp, f"{self.noun} refused: header.stamp")
        age = (self._node.get_clock().now().nanoseconds - made) * 1e-9
        return age if 0.0 <= age <= OLDEST_STAMP else 0.0

    def put(self, received: Any, snapshot: Snapshot, time: float, *, is_new: bool) -> None:
        if is_new and snapshot.reference is None:
            reason = message("no_reference_yet", arm=self._side.word)
            raise CommandRefused(message("command_refused", noun=self.noun, reason=reason))
        base = snapshot.reference if is_new and snapshot.reference is not None else self._goal
        goal = goal_of(received, self._side, base)
        write_goal(self._box, snapshot.session, goal, goal_speeds_of(received, self._side), time)
        self._goal = goal


class JointVelocityTopic(CommandTopic):
    """Velocities by name; joints that are not named stop."""

    name, type, noun = "joint_velocity_commands", JointState, "Speed"
    kind, taker, controller = GoalKind.VELOCITY, "velocity controller", "joint_velocity_controller"

    def is_stop(self, received: Any) -> bool:
        return not any(received.velocity)

    def put(self, received: Any, snapshot: Snapshot, time: float, *, is_new: bool) -> None:
        write_speeds(self._box, snapshot.session, velocities_of(received, self._side), time)


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
    ) -> None:
        self.name = self.controller = controller
        self.name += "/commands"
        self._positions, self._speeds = buffers
        self._active = active
        self._known = (0, False)  # the activation, and whether the controller commands in it
        super().__init__(node, side, buffers[0], snapshot, now)

    def is_for(self, kind: GoalKind) -> bool:
        return bool(kind & (GoalKind.FORWARD_POSITION | GoalKind.FORWARD_VELOCITY))

    def is_stop(self, received: Any) -> bool:
        return GoalKind.FORWARD_VELOCITY in self._snapshot().goal_kind and not any(received.data)

    def put(self, received: Any, snapshot: Snapshot, time: float, *, is_new: bool) -> None:
        self._check_active(snapshot.activation)
        if GoalKind.FORWARD_VELOCITY in snapshot.goal_kind:
            write_speeds(self._speeds, snapshot.session, speeds_of(received, self._side), time)
        else:
            write_goal(self._positions, snapshot.session, positions_of(received, self._side), time=time)

    def on_event(self, event: object) -> None:
        """A forward controller has no events."""

    def _check_active(self, activation: int) -> None:
        if activation != self._known[0]:
            self._known = (activation, self.controller in self._active())
        if not self._known[1]:
            how = how_to_activate(self._node.get_namespace(), self._side, self.controller)
            reason = message("controller_inactive_on_arm", controller=self.controller, arm=self._side.word, how=how)
            raise CommandRefused(message("command_refused", noun="Command", reason=reason))


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
        )

    return {controller.kind: make for controller in FORWARDERS}


MeasuredState = Callable[[Side], JointStates | None]
"""The newest measured state of an arm; None where there has been none."""


def newest_state(buffers: ArmBuffers, polled: JointStates | None) -> JointStates | None:
    """The newer one of what EGM reported of an arm last, and what was read from the controller (``polled``)."""
    newest = buffers.states.read()
    if newest is None or (polled is not None and polled.time > newest[1].time):
        return polled
    return newest[1]


class JointStatePublisher:
    """Publishes ``joint_states`` of one arm after each control cycle, or as they are read while there is none.

    A thread of its own: the executor's threads may be busy with a service when the next state comes.

    Args:
        node: the arm's controller manager node.
        side: which arm.
        buffers: the state shared by the control process.
        clock: the clock of the states' times.
        polled: the arm as it was read from the controller last.
        frame: of the robot's base.
    """

    def __init__(
        self,
        node: Any,
        side: Side,
        buffers: ArmBuffers,
        clock: Clock,
        polled: MeasuredState = lambda side: None,
        frame: str = "",
    ) -> None:
        self._side = side
        self._polled = polled
        self._frame = frame
        self._published = -inf
        self._publisher = node.create_publisher(JointState, "joint_states", _STATES_DEPTH)
        self._stamps = Stamps.of(node, clock)
        self._names = joint_names(side)
        self._buffers = buffers
        self._is_over = Event()
        self._failures = Failures()
        self._topic = f"{side.value}/joint_states"
        self._thread = SupervisedThread(f"joint-states-{side.value}", self._run, self._is_over)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """End the thread; before the node is destroyed."""
        self._is_over.set()
        self._thread.join()

    def _run(self) -> None:
        last = 0
        while not self._is_over.is_set():
            has_cycle = self._buffers.cycle_done.acquire(timeout=_CYCLE_WAIT)
            read = None if has_cycle else self._polled(self._side)
            new = [] if read is None or read.time <= self._published else [(last, read)]
            for number, state in self._buffers.states.since(last) if has_cycle else new:
                last = number
                try:
                    self._publish(state)
                except Exception as error:  # of the middleware, such as after the clock was set: the next one may go
                    self._failures.note(f"Publishing {self._topic}", error)

    def _publish(self, state: JointStates) -> None:
        self._published = state.time
        message = joint_state(self._names, state.position, state.velocity, self._stamps.at(state.time), self._frame)
        self._publisher.publish(message)


class MergedJointStates:
    """Publishes ``joint_states`` of the whole robot: 7 right, 7 left, then the fingers as far as they are known.

    An arm without a state for :data:`STALE` is left out: its old position is no start for planning. The stamp is that
    of the oldest state that EGM reports; where EGM is silent, of the oldest one that was read from the controller.

    Args:
        node: the robot's node for topics.
        buffers: the state shared by the control process, per arm.
        fingers: position [m] and speed [m/s] of each gripper's fingers by side, as far as they are known.
        rate: [Hz].
        clock: the clock of the states' times.
        timers: keeps the rate.
        polled: an arm as it was read from the controller last.
        frame: of the robot's base.
    """

    def __init__(
        self,
        node: Any,
        buffers: Mapping[Side, ArmBuffers],
        fingers: Callable[[], Mapping[Side, tuple[float, float]]],
        rate: float,
        clock: Clock,
        timers: TimerThread,
        polled: MeasuredState = lambda side: None,
        frame: str = "",
    ) -> None:
        self._polled = polled
        self._frame = frame
        self._publisher = node.create_publisher(JointState, "joint_states", _STATES_DEPTH)
        self._stamps = Stamps.of(node, clock)
        self._clock = clock
        self._buffers = buffers
        self._fingers = fingers
        timers.every(1.0 / rate, "joint_states", self._publish)

    def _publish(self) -> None:
        names: list[str] = []
        position: list[float] = []
        velocity: list[float] = []
        now = self._clock.now()
        reported: list[float] = []
        read: list[float] = []
        for side, buffers in self._buffers.items():
            polled = self._polled(side)
            state = newest_state(buffers, polled)
            if state is not None and now - state.time < STALE:
                (read if state is polled else reported).append(state.time)
                names += joint_names(side)
                position += state.position
                velocity += state.velocity
        for side, (place, speed) in self._fingers().items():
            names += finger_names(side)
            position += (place, place)
            velocity += (speed, speed)
        if names:
            # An arm that stands must not make the states of one that moves look old.
            oldest = min(reported or read, default=now)
            self._publisher.publish(joint_state(names, position, velocity, self._stamps.at(oldest), self._frame))


class HealthTopics:
    """Publishes ``egm_state`` of each arm and the driver's ``/diagnostics``.

    Args:
        node: whose ``/diagnostics`` it is.
        streams: a node for the topics of each arm.
        snapshot: the state of an arm.
        robot: the state of the robot.
        grippers: both grippers' statuses for ``/diagnostics``.
        timers: keeps the rates.
        desired: the arms on which EGM is to run.
    """

    def __init__(
        self,
        node: Any,
        streams: Mapping[Side, Any],
        snapshot: Callable[[Side], Snapshot],
        robot: Callable[[], RobotState],
        grippers: Callable[[], list[DiagnosticStatus]],
        timers: TimerThread,
        desired: Callable[[], Container[Side]] = tuple,
    ) -> None:
        clock, root = node.get_clock(), node.get_namespace().strip("/")
        place = f"/{root}/" if root else ""
        diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", 1)

        def publish_arm(publisher: Any, side: Side) -> None:
            publisher.publish(egm_status(side, snapshot(side), is_desired=side in desired()))

        def publish_diagnostics() -> None:
            array = DiagnosticArray()
            array.header.stamp = stamp(clock.now().nanoseconds)
            arms = (egm_status(side, snapshot(side), is_desired=side in desired()) for side in Side)
            array.status = [robot_status(robot()), *arms, *grippers()]
            for status in array.status:  # those of several robots meet on /diagnostics
                status.name = f"{place}{status.name}"
            diagnostics.publish(array)

        for side, stream in streams.items():
            publisher = stream.create_publisher(DiagnosticStatus, "egm_state", 1)
            timers.every(_EGM_STATE_PERIOD, f"{side.value}/egm_state", partial(publish_arm, publisher, side))
        timers.every(_DIAGNOSTICS_PERIOD, "/diagnostics", publish_diagnostics)


class RobotStateTopic:
    """Publishes ``~/state`` of the robot manager, latched, on each change and once a second."""

    def __init__(
        self, node: Any, state: Callable[[], RobotState], clock: Clock, timers: TimerThread, frame: str = ""
    ) -> None:
        self._frame = frame
        self._publisher = node.create_publisher(RobotStateMessage, "~/state", LATCHED)
        self._ros_clock = node.get_clock()
        self._state = state
        self._clock = clock
        self._last: RobotState | None = None
        self._published = 0.0
        timers.every(STATE_POLL, "yumi_robot_manager/state", self.update)

    def update(self) -> None:
        """Publish a state that has changed, or was published long ago."""
        state, now = self._state(), self._clock.now()
        if state == self._last and now - self._published < STATE_PERIOD:
            return
        self._last, self._published = state, now
        self._publisher.publish(robot_state(state, self._ros_clock.now().nanoseconds, self._frame))


class FramePublisher:
    """Publishes the frames of ``urdf``, the tool in use as ``yumi_tcp_r`` and ``yumi_tcp_l``, and the description.

    Frames that a joint moves are published when that joint was measured anew, with the time of that. Frames of an arm
    that has not been measured for :data:`STALE` end.

    Args:
        node: the node ``robot_state_publisher``.
        streams: a node for the topics of each arm.
        urdf: the robot's description.
        settings: rates, and what stands before the frames' names.
        tcp: the tool in use of an arm, ``tool_to_tool0``.
        measured: the newest measured state of an arm.
        fingers: position [m] and speed [m/s] of each gripper's fingers by side, as far as they are known.
        clock: the clock of the states' times.
        timers: keeps the rate.
    """

    def __init__(
        self,
        node: Any,
        streams: Mapping[Side, Any],
        urdf: str,
        settings: RosSettings,
        tcp: Callable[[Side], Pose],
        measured: MeasuredState,
        fingers: Callable[[], Mapping[Side, tuple[float, float]]],
        clock: Clock,
        timers: TimerThread,
    ) -> None:
        self._settings = settings
        self._tcp = tcp
        self._tools = {side: tcp(side) for side in Side}
        self._measured = measured
        self._fingers = fingers
        self._clock = clock
        self._stamps = Stamps.of(node, clock)
        self._published = dict.fromkeys(Side, -inf)
        self._poses = {side: streams[side].create_publisher(PoseStamped, "tcp_pose", 10) for side in Side}

        parameters: Mapping[str, tuple[str | float, str]] = {
            "robot_description": (urdf, "The robot as URDF; the topic robot_description has it, too."),
            "frame_prefix": (settings.frames, "What stands before the name of each frame on /tf."),
            "publish_frequency": (settings.tf_rate, "Of /tf, at most [Hz]."),
        }
        for name, (value, text) in parameters.items():
            node.declare_parameter(name, value, ParameterDescriptor(description=text, read_only=True))
        topics = ("robot_description", *(f"{side.value}/robot_description" for side in Side))
        self._descriptions = [node.create_publisher(String, topic, LATCHED) for topic in topics]
        for publisher in self._descriptions:
            publisher.publish(String(data=urdf))

        timers.every(1.0 / settings.tf_rate, "tcp_pose and /tf", self._publish)
        self._moving: dict[Side, list[tuple[Frame, TransformStamped]]] = {}
        self._sliding: dict[Side, list[tuple[Frame, TransformStamped]]] = {}
        if not settings.publish_tf:
            return
        frames = read_frames(urdf)
        for side in Side:
            arm, finger_joints = frozenset(joint_names(side)), frozenset(finger_names(side))
            self._moving[side] = [(each, self._transform(each)) for each in frames if each.joint in arm]
            self._sliding[side] = [(each, self._transform(each)) for each in frames if each.joint in finger_joints]
        self._fixed = [each for each in frames if not each.joint]
        self._tf: Any = node.create_publisher(TFMessage, "/tf", _TF_QOS)
        self._static = node.create_publisher(TFMessage, "/tf_static", LATCHED)
        self._publish_fixed()

    def _publish(self) -> None:
        now, transforms = self._clock.now(), []
        fingers = self._fingers()
        tools = {side: self._tcp(side) for side in Side}
        if tools != self._tools:
            self._tools = tools
            if self._settings.publish_tf:
                self._publish_fixed()
        for side in Side:
            state = self._measured(side)
            if state is None or now - state.time >= STALE or state.time <= self._published[side]:
                continue
            self._published[side] = state.time
            time = stamp(self._stamps.at(state.time))
            message = PoseStamped()
            message.header.stamp, message.header.frame_id = time, self._settings.frames + prefixed("yumi_base")
            pose = tool0_to_body(side, state.position, self._tools[side])
            _fill(message.pose.position, message.pose.orientation, pose)
            self._poses[side].publish(message)
            positions = dict(zip(joint_names(side), state.position, strict=True))
            for frame, transform in self._moving.get(side, ()):
                transform.header.stamp = time
                pose = frame.to_parent(positions[frame.joint])
                _fill(transform.transform.translation, transform.transform.rotation, pose)
                transforms.append(transform)
        # The gripper's position has no time of its own; it comes by subscription, so what is known is current.
        time = stamp(self._stamps.at(now))
        for side in fingers:
            for frame, transform in self._sliding.get(side, ()):
                transform.header.stamp = time
                pose = frame.to_parent(fingers[side][0])
                _fill(transform.transform.translation, transform.transform.rotation, pose)
                transforms.append(transform)
        if transforms:
            self._tf.publish(TFMessage(transforms=transforms))

    def _publish_fixed(self) -> None:
        """Frames that no joint moves, and those of the tools: again when a tool has changed."""
        tools = [
            Frame(prefixed(f"yumi_tcp_{side.value}"), prefixed(f"yumi_tool0_{side.value}"), tool)
            for side, tool in self._tools.items()
        ]
        fixed = [self._transform(each) for each in (*self._fixed, *tools)]
        for transform in fixed:
            transform.header.stamp = stamp(self._stamps.at(self._clock.now()))
        self._static.publish(TFMessage(transforms=fixed))

    def _transform(self, frame: Frame) -> TransformStamped:
        before, transform = self._settings.frames, TransformStamped(child_frame_id=self._settings.frames + frame.name)
        transform.header.frame_id = before + frame.parent
        _fill(transform.transform.translation, transform.transform.rotation, frame.to_parent())
        return transform


class RobotFrames:
    """Where frames are in the robot's base: those of the robot, and those that others have fixed to them.

    Args:
        urdf: the robot's description.
        prefix: before the names of frames on ``/tf``.
        tcp: the tool in use of an arm.
        measured: the newest measured state of an arm; None where there has been none.
        fingers: position [m] and speed [m/s] of each gripper's fingers by side, as far as they are known.
        now: the time of the clock of the states' times [s].

    Attributes:
        urdf: as above, as ``tcp`` and ``measured``.
    """

    def __init__(
        self,
        urdf: str,
        prefix: str,
        tcp: Callable[[Side], Pose],
        measured: MeasuredState,
        fingers: Callable[[], Mapping[Side, tuple[float, float]]],
        now: Callable[[], float],
    ) -> None:
        self.urdf = urdf
        self._frames = {frame.name: frame for frame in read_frames(urdf)}
        self._root = prefixed("yumi_base_link")
        self._others: dict[str, Frame] = {}  # by the name on /tf
        self._prefix = prefix
        self.tcp = tcp
        self.measured = measured
        self._fingers = fingers
        self._now = now

    def listen(self, node: Any) -> None:
        """Know the frames that others publish on ``/tf_static``: work objects, tools on a flange, the robot's place."""
        node.create_subscription(TFMessage, "/tf_static", self.take, _STATIC_QOS)

    def take(self, message: Any) -> None:
        """Fixed frames of others. The robot's own are known; what is not a transform is left out."""
        for each in message.transforms:
            name, place, turn = self._name(each.child_frame_id), each.transform.translation, each.transform.rotation
            if name == self._root or self._own(name) is None:
                with suppress(CommandRefused):
                    origin = checked_pose(Pose((place.x, place.y, place.z), (turn.w, turn.x, turn.y, turn.z)))
                    self._others[name] = Frame(name, self._name(each.header.frame_id), origin)

    def _name(self, frame_id: str) -> str:
        """Without what stands before the names of this robot's frames."""
        return frame_id.lstrip("/").removeprefix(self._prefix)

    def _own(self, name: str) -> Frame | None:
        """A frame of the robot in its parent."""
        for side in Side:
            if name == prefixed(f"yumi_tcp_{side.value}"):
                return Frame(name, prefixed(f"yumi_tool0_{side.value}"), self.tcp(side))
        return self._frames.get(name)

    def _way_up(self, frame_id: str) -> Iterator[Frame]:
        """A frame in its parent, that in its own, and so on as far as they are known.

        Raises:
            CommandRefused: there is no such frame.
        """
        name = self._name(frame_id) or prefixed("yumi_base")
        others = list(self._others.values())
        if self._own(name) is None and name != self._root and not any(name in (it.name, it.parent) for it in others):
            known = {"base": prefixed("yumi_base"), "tool": prefixed("yumi_tcp_r")}
            raise CommandRefused(message("frame_unknown", frame=frame_id, **known))
        for _ in range(_LONGEST_CHAIN):  # others may publish a loop
            frame = self._own(name) or self._others.get(name)
            if frame is None:
                return
            yield frame
            name = frame.parent

    def to_base(self, frame_id: str) -> Pose:
        """Where a frame is now.

        Raises:
            CommandRefused: there is none, or what moves it has not been measured lately.
        """
        positions: dict[str, float] = {}
        for side in Side:
            state = self.measured(side)
            if state is not None and self._now() - state.time < STALE:
                positions.update(zip(joint_names(side), state.position, strict=True))
        for side, (place, _) in self._fingers().items():
            positions.update(dict.fromkeys(finger_names(side), place))

        def seen_from_above(name: str) -> dict[str, Pose]:
            pose, found = _HERE, {self._name(name) or prefixed("yumi_base"): _HERE}
            for frame in self._way_up(name):
                if frame.joint and frame.joint not in positions:
                    what = "gripper" if frame.slides else "arm"
                    raise CommandRefused(message("frame_not_located", frame=frame_id, what=what))
                pose = compose(frame.to_parent(positions.get(frame.joint, 0.0)), pose)
                found[frame.parent] = pose
            return found

        base = seen_from_above(self._root)
        for name, pose in seen_from_above(frame_id).items():
            if name in base:
                return compose(inverse(base[name]), pose)
        raise CommandRefused(message("frame_not_connected", frame=frame_id))

    def in_tool(self, side: Side, frame_id: str) -> Pose | None:
        """A frame that is fixed to an arm's flange, seen from its tool in use; None for any other frame.

        Raises:
            CommandRefused: there is no such frame.
        """

        def on_link(name: str) -> tuple[str, Pose]:
            pose = _HERE
            for frame in self._way_up(name):
                if frame.joint:
                    return frame.name, pose
                pose = compose(frame.to_parent(), pose)
            return "", pose

        tool_link, tool = on_link(prefixed(f"yumi_tcp_{side.value}"))
        link, pose = on_link(frame_id)
        return compose(inverse(tool), pose) if link == tool_link else None

    def tool(self, side: Side, frame_id: str) -> Pose:
        """A frame on an arm's flange in tool0; empty is the tool in use.

        Raises:
            CommandRefused: there is no such frame, or it is not fixed to the flange.
        """
        if not frame_id:
            return self.tcp(side)
        found = self.in_tool(side, frame_id)
        if found is None:
            example = prefixed(f"gripper_{side.value}_fingertips")
            raise CommandRefused(message("frame_not_on_flange", frame=frame_id, arm=side.word, example=example))
        return compose(self.tcp(side), found)


def _fill(position: Any, rotation: Any, pose: Pose) -> None:
    position.x, position.y, position.z = pose.position
    rotation.w, rotation.x, rotation.y, rotation.z = pose.orientation
