"""The ROS side of the driver: which nodes exist, and which topics, services and actions each one has.

====================== ============================================================================
node                   what it has
====================== ============================================================================
r/controller_manager   joint_states, joint_commands, egm_state (and the same for l)
r/gripper              gripper_cmd (and the same for l)
yumi_robot_manager     start_egm, stop_egm, robot_is_ready, get_state, joint_states (merged),
                       robot_description, /diagnostics
====================== ============================================================================
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from threading import Event as Flag
from threading import Thread
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import String

from yumi.clock import Clock
from yumi.control.requests import Event, is_fault
from yumi.errors import YumiError
from yumi.hardware.fast_lines import FastLines
from yumi.hardware.gripper import Gripper, calibrate
from yumi.hardware.robot_manager import RobotManager
from yumi.robot.joints import Side
from yumi.robot.model import robot_description
from yumi.ros.command_topics import JointCommandTopic
from yumi.ros.conversions import egm_status, stamp
from yumi.ros.gripper_action import GripperAction
from yumi.ros.joint_state_topics import JointStatePublisher, MergedJointStates
from yumi.ros.robot_manager import RobotManagerServices

_THREADS = 4
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_EGM_STATE_PERIOD = 0.1  # [s]
_DIAGNOSTICS_PERIOD = 1.0  # [s]
_FINGER_PERIOD = 0.5  # [s]; there are few requests a second for everybody (yumi.hardware.rws_pace)


class RosDriver:
    """All nodes of the driver in one process, spun by one executor.

    Args:
        fast_lines: both arms'.
        manager: the robot manager.
        grippers: both hands.
        force: gripper force where a goal names none [N].
        merged_rate: of the merged joint states [Hz].
        clock: the machine's clock.
    """

    def __init__(
        self,
        fast_lines: FastLines,
        manager: RobotManager,
        grippers: Mapping[Side, Gripper],
        force: float,
        merged_rate: float,
        clock: Clock,
    ) -> None:
        self._boxes = fast_lines.boxes
        self._snapshot = fast_lines.snapshot
        self._manager = manager
        self._grippers = grippers
        self._fingers: dict[Side, float] = {}
        self._is_over = Flag()
        self._manager_node = rclpy.create_node("yumi_robot_manager")
        self._arm_nodes = {side: rclpy.create_node("controller_manager", namespace=side.value) for side in Side}
        self._gripper_nodes = {side: rclpy.create_node("gripper", namespace=side.value) for side in Side}
        self._states = [
            JointStatePublisher(node, side, self._boxes[side], clock) for side, node in self._arm_nodes.items()
        ]
        self._actions = [
            GripperAction(node, grippers[side], force, ReentrantCallbackGroup())
            for side, node in self._gripper_nodes.items()
        ]
        self._commands = [
            JointCommandTopic(node, side, self._boxes[side].goals, partial(fast_lines.snapshot, side))
            for side, node in self._arm_nodes.items()
        ]
        self._services = RobotManagerServices(self._manager_node, manager, MutuallyExclusiveCallbackGroup())
        self._merged = MergedJointStates(self._manager_node, self._boxes, lambda: dict(self._fingers), merged_rate)
        self._publish_description()
        self._publish_health()
        self._executor = MultiThreadedExecutor(num_threads=_THREADS)
        self._threads = [Thread(target=self._spin, name="executor"), Thread(target=self._watch_fingers, name="fingers")]

    def start(self) -> None:
        """Answer from now on."""
        for node in self._nodes():
            self._executor.add_node(node)
        for publisher in self._states:
            publisher.start()
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Answer nobody any more and destroy the nodes."""
        self._is_over.set()
        for publisher in self._states:
            publisher.stop()
        self._executor.shutdown(timeout_sec=2.0)
        for thread in self._threads:
            if thread.ident is not None:
                thread.join()
        for action in self._actions:
            action.destroy()
        for node in self._nodes():
            node.destroy_node()

    def tell(self, event: Event) -> None:
        """Log what happened in a fast line."""
        log = self._arm_nodes[event.side].get_logger()
        if is_fault(event):
            log.error(str(event))
        else:
            log.info(str(event))

    def say(self, sentence: str) -> None:
        """Log one line of the robot manager."""
        self._manager_node.get_logger().info(sentence)

    def make_ready(self) -> None:
        """Bring the robot to ready, or say why it is not; start_egm tries again."""
        try:
            self._manager.make_ready()
            calibrate(self._grippers, self.say, self._manager_node.get_logger().error)
            self.say("The robot is ready.")
        except YumiError as error:
            self._manager_node.get_logger().error(str(error))

    def _nodes(self) -> list[Any]:
        return [self._manager_node, *self._arm_nodes.values(), *self._gripper_nodes.values()]

    def _spin(self) -> None:
        while not self._is_over.is_set():
            self._executor.spin_once(timeout_sec=0.1)

    def _publish_description(self) -> None:
        self._description = self._manager_node.create_publisher(String, "robot_description", _LATCHED)
        self._description.publish(String(data=robot_description()))

    def _publish_health(self) -> None:
        for side, node in self._arm_nodes.items():
            publisher = node.create_publisher(DiagnosticStatus, "egm_state", 1)
            node.create_timer(_EGM_STATE_PERIOD, partial(self._publish_status, publisher, side))
        self._diagnostics = self._manager_node.create_publisher(DiagnosticArray, "/diagnostics", 1)
        self._manager_node.create_timer(_DIAGNOSTICS_PERIOD, self._publish_diagnostics)

    def _publish_status(self, publisher: Any, side: Side) -> None:
        publisher.publish(egm_status(side, self._snapshot(side)))

    def _publish_diagnostics(self) -> None:
        array = DiagnosticArray()
        array.header.stamp = stamp(self._manager_node.get_clock().now().nanoseconds)
        array.status = [egm_status(side, self._snapshot(side)) for side in Side]
        self._diagnostics.publish(array)

    def _watch_fingers(self) -> None:
        """Keep the finger positions of ``joint_states`` fresh; a robot that does not answer leaves them as they are."""
        while not self._is_over.wait(_FINGER_PERIOD):
            for side, gripper in self._grippers.items():
                try:
                    self._fingers[side] = gripper.recent_position(_FINGER_PERIOD)
                except YumiError:
                    self._fingers.pop(side, None)


def open_ros() -> None:
    """Start ROS in this process; signals stay with the application."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)


def close_ros() -> None:
    """End ROS in this process."""
    rclpy.try_shutdown()
