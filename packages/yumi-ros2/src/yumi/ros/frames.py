"""The frames of the robot in ROS: ``/tf``, ``/tf_static``, ``tcp_pose``, the description, and where others' frames are.

The node ``robot_state_publisher`` takes the place of ROS's own program of that name, with its parameters: tools read
``robot_description`` from it, as a latched topic or as a parameter. A controller manager waits for one that has its
arm.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from math import inf
from typing import Any

from geometry_msgs.msg import PoseStamped, TransformStamped
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import ORIGIN_POSE, Pose, Side, finger_names, joint_names, prefixed
from abb_protocols.robot.kinematics import compose_poses, inverse_pose, tool0_to_body
from abb_protocols.robot.urdf import UrdfFrame, read_frames
from abb_runtime.clock import Clock
from yumi.driver.settings import RosSettings
from yumi.planning.tool_path import checked_pose
from yumi.ros.messages import LATCHED_QOS, Stamps, fill_pose, stamp
from yumi.ros.nodes import TimerThread
from yumi.ros.state_topics import STALE_STATE, MeasuredState

ROBOT_STATE_PUBLISHER = "robot_state_publisher"
"""Of the node that has the frames and the description."""

_TF_QOS = QoSProfile(depth=100)  # as tf2's own broadcaster
_STATIC_QOS = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)  # as tf2's own listener

_LONGEST_CHAIN = 100  # frames from the root on; more are a loop


class FramePublisher:
    """Publishes the frames of ``urdf``, the tool in use as ``yumi_tcp_r`` and ``yumi_tcp_l``, and the description.

    Frames that a joint moves are published when that joint was measured anew, with the time of that. Frames of an arm
    that has not been measured for :data:`STALE_STATE` end.

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
        self._descriptions = [node.create_publisher(String, topic, LATCHED_QOS) for topic in topics]
        for publisher in self._descriptions:
            publisher.publish(String(data=urdf))

        timers.every(1.0 / settings.tf_rate, "tcp_pose and /tf", self._publish)
        self._moving: dict[Side, list[tuple[UrdfFrame, TransformStamped]]] = {}
        self._sliding: dict[Side, list[tuple[UrdfFrame, TransformStamped]]] = {}
        if not settings.publish_tf:
            return
        frames = read_frames(urdf)
        for side in Side:
            arm, finger_joints = frozenset(joint_names(side)), frozenset(finger_names(side))
            self._moving[side] = [(each, self._transform(each)) for each in frames if each.joint in arm]
            self._sliding[side] = [(each, self._transform(each)) for each in frames if each.joint in finger_joints]
        self._fixed = [each for each in frames if not each.joint]
        self._tf: Any = node.create_publisher(TFMessage, "/tf", _TF_QOS)
        self._static = node.create_publisher(TFMessage, "/tf_static", LATCHED_QOS)
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
            if state is None or now - state.time >= STALE_STATE or state.time <= self._published[side]:
                continue
            self._published[side] = state.time
            time = stamp(self._stamps.at(state.time))
            message = PoseStamped()
            message.header.stamp, message.header.frame_id = time, self._settings.frames + prefixed("yumi_base")
            pose = tool0_to_body(side, state.position, self._tools[side])
            fill_pose(message.pose.position, message.pose.orientation, pose)
            self._poses[side].publish(message)
            positions = dict(zip(joint_names(side), state.position, strict=True))
            for frame, transform in self._moving.get(side, ()):
                transform.header.stamp = time
                pose = frame.to_parent(positions[frame.joint])
                fill_pose(transform.transform.translation, transform.transform.rotation, pose)
                transforms.append(transform)
        # The gripper's position has no time of its own; it comes by subscription, so what is known is current.
        time = stamp(self._stamps.at(now))
        for side in fingers:
            for frame, transform in self._sliding.get(side, ()):
                transform.header.stamp = time
                pose = frame.to_parent(fingers[side][0])
                fill_pose(transform.transform.translation, transform.transform.rotation, pose)
                transforms.append(transform)
        if transforms:
            self._tf.publish(TFMessage(transforms=transforms))

    def _publish_fixed(self) -> None:
        """Frames that no joint moves, and those of the tools: again when a tool has changed."""
        tools = [
            UrdfFrame(prefixed(f"yumi_tcp_{side.value}"), prefixed(f"yumi_tool0_{side.value}"), tool)
            for side, tool in self._tools.items()
        ]
        fixed = [self._transform(each) for each in (*self._fixed, *tools)]
        for transform in fixed:
            transform.header.stamp = stamp(self._stamps.at(self._clock.now()))
        self._static.publish(TFMessage(transforms=fixed))

    def _transform(self, frame: UrdfFrame) -> TransformStamped:
        before, transform = self._settings.frames, TransformStamped(child_frame_id=self._settings.frames + frame.name)
        transform.header.frame_id = before + frame.parent
        fill_pose(transform.transform.translation, transform.transform.rotation, frame.to_parent())
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
        self._others: dict[str, UrdfFrame] = {}  # by the name on /tf
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
                    self._others[name] = UrdfFrame(name, self._name(each.header.frame_id), origin)

    def _name(self, frame_id: str) -> str:
        """Without what stands before the names of this robot's frames."""
        return frame_id.lstrip("/").removeprefix(self._prefix)

    def _own(self, name: str) -> UrdfFrame | None:
        """A frame of the robot in its parent."""
        for side in Side:
            if name == prefixed(f"yumi_tcp_{side.value}"):
                return UrdfFrame(name, prefixed(f"yumi_tool0_{side.value}"), self.tcp(side))
        return self._frames.get(name)

    def _way_up(self, frame_id: str) -> Iterator[UrdfFrame]:
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
            if state is not None and self._now() - state.time < STALE_STATE:
                positions.update(zip(joint_names(side), state.position, strict=True))
        for side, (place, _) in self._fingers().items():
            positions.update(dict.fromkeys(finger_names(side), place))

        def seen_from_above(name: str) -> dict[str, Pose]:
            pose, found = ORIGIN_POSE, {self._name(name) or prefixed("yumi_base"): ORIGIN_POSE}
            for frame in self._way_up(name):
                if frame.joint and frame.joint not in positions:
                    what = "gripper" if frame.slides else "arm"
                    raise CommandRefused(message("frame_not_located", frame=frame_id, what=what))
                pose = compose_poses(frame.to_parent(positions.get(frame.joint, 0.0)), pose)
                found[frame.parent] = pose
            return found

        base = seen_from_above(self._root)
        for name, pose in seen_from_above(frame_id).items():
            if name in base:
                return compose_poses(inverse_pose(base[name]), pose)
        raise CommandRefused(message("frame_not_connected", frame=frame_id))

    def in_tool(self, side: Side, frame_id: str) -> Pose | None:
        """A frame that is fixed to an arm's flange, seen from its tool in use; None for any other frame.

        Raises:
            CommandRefused: there is no such frame.
        """

        def on_link(name: str) -> tuple[str, Pose]:
            pose = ORIGIN_POSE
            for frame in self._way_up(name):
                if frame.joint:
                    return frame.name, pose
                pose = compose_poses(frame.to_parent(), pose)
            return "", pose

        tool_link, tool = on_link(prefixed(f"yumi_tcp_{side.value}"))
        link, pose = on_link(frame_id)
        return compose_poses(inverse_pose(tool), pose) if link == tool_link else None

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
        return compose_poses(self.tcp(side), found)
