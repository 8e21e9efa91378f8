"""The frames of the robot: ``/tf``, ``/tf_static``, ``tcp_pose`` of each arm and ``robot_description``.

The node ``robot_state_publisher`` takes the place of ROS's own program of that name, with its parameters: tools read
``robot_description`` from it, as a latched topic or as a parameter.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf
from typing import Any

from geometry_msgs.msg import PoseStamped, TransformStamped
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.qos import QoSProfile
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from yumi.clock import Clock
from yumi.driver.settings import RosSettings
from yumi.robot.description import Frame, read_frames
from yumi.robot.joints import Pose, Side, finger_names, joint_names, prefixed
from yumi.robot.kinematics import tool0_to_body
from yumi.ros.executors import TimerThread
from yumi.ros.messages import LATCHED, Stamps, stamp
from yumi.ros.topics import STALE, MeasuredState

NAME = "robot_state_publisher"
_TF = QoSProfile(depth=100)  # as tf2's own broadcaster


class FramePublisher:
    """Publishes the frames of ``urdf``, the tool in use as ``yumi_tcp_r`` and ``yumi_tcp_l``, and the description.

    Frames that a joint moves are published when that joint was measured anew, with the time of that. Frames of an arm
    that has not been measured for :data:`~yumi.ros.topics.STALE` end.

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
        self._tf: Any = node.create_publisher(TFMessage, "/tf", _TF)
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


def _fill(position: Any, rotation: Any, pose: Pose) -> None:
    position.x, position.y, position.z = pose.position
    rotation.w, rotation.x, rotation.y, rotation.z = pose.orientation
