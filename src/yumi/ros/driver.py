"""The ROS side of the driver: which nodes exist, and which topics, services and actions each one has.

============================== ====================================================================
node                           what it has
============================== ====================================================================
r/controller_manager           the services of ros2_control, activity, joint_states, /diagnostics
r/<controller>                 the parameters of each controller
r/joint_trajectory_controller  follow_joint_trajectory, joint_trajectory, controller_state,
                               speed_scaling_input
r/yumi_topics                  the command topics of controllers, egm_state, gripper/joint_states,
                               gripper/state, gripper/vacuum_1/pressure and object_picked
r/arm                          the life of an arm as a managed node
r/gripper                      gripper_cmd, parallel_gripper_cmd, calibrate, jog_open, jog_close, stop,
                               clear_error, vacuum_1, blow_1 …, and its life (and all of these for l)
dual_arm_trajectory_controller what the trajectory controllers have, for both arms; inter_arm_skew
yumi_robot_manager             start_egm, stop_egm, robot_is_ready, get_state … set_mode, recover,
                               state, robot_description, /diagnostics
yumi_robot                     the life of the connection to the robot
yumi_topics                    joint_states (merged)
============================== ====================================================================

Two executors: one answers services and actions on many threads, which costs milliseconds a turn with so many
entities; what comes or goes hundreds of times a second has a lean one of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from threading import Event as Flag
from threading import Thread
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy._rclpy_pybind11 import InvalidHandle
from rclpy.executors import Executor, MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from yumi.clock import Clock
from yumi.control.mailbox import Mailbox
from yumi.control.requests import Event
from yumi.errors import YumiError
from yumi.hardware.fast_line import ArmBoxes
from yumi.hardware.fast_lines import FastLines
from yumi.hardware.hand_setup import set_up_hands
from yumi.hardware.robot_manager import RobotManager
from yumi.robot.joints import Side
from yumi.robot.limits import JointLimits
from yumi.ros.arm_manager import ArmManager
from yumi.ros.command_topics import (
    CommandTopic,
    JointCommandTopic,
    JointVelocityTopic,
)
from yumi.ros.conversions import egm_status, stamp
from yumi.ros.description_topic import publish_descriptions
from yumi.ros.forward_controllers import forward_interfaces
from yumi.ros.hands import HandParts, Hands
from yumi.ros.joint_state_topics import JointStatePublisher, MergedJointStates
from yumi.ros.lives import Connection
from yumi.ros.managed_node import demand
from yumi.ros.managed_nodes import ManagedNodes
from yumi.ros.robot_actions import RobotManagerActions
from yumi.ros.robot_manager import RobotManagerServices
from yumi.ros.robot_messages import robot_status
from yumi.ros.robot_state_topic import RobotStateTopic
from yumi.ros.trajectory_controllers import DUAL_ARM, TrajectoryControllers
from yumi.settings import ControllerSettings

_THREADS = 8  # more than there are slow services and actions
_EGM_STATE_PERIOD = 0.1  # [s]
_DIAGNOSTICS_PERIOD = 1.0  # [s]


class RosDriver:
    """All nodes of the driver in one process.

    Args:
        fast_lines: both arms'.
        controllers: those of ``controllers.yaml``.
        manager: the robot manager.
        connection: the way to the controller.
        hands: both grippers, with their signals and settings.
        merged_rate: of the merged joint states [Hz].
        clock: the machine's clock.
        limits: what the joints may do on trajectories.
    """

    def __init__(
        self,
        fast_lines: FastLines,
        controllers: Mapping[Side, Iterable[ControllerSettings]],
        manager: RobotManager,
        connection: Connection,
        hands: HandParts,
        merged_rate: float,
        clock: Clock,
        limits: JointLimits,
    ) -> None:
        self._boxes = fast_lines.boxes
        self._snapshot = fast_lines.snapshot
        self._manager = manager
        self._hand_parts = hands
        self._is_over = Flag()
        self._executor = MultiThreadedExecutor(num_threads=_THREADS)
        self._streams = SingleThreadedExecutor()
        self._manager_node = rclpy.create_node("yumi_robot_manager")
        self._dual_node = rclpy.create_node(DUAL_ARM)
        self._stream_node = stream_node()
        self._stream_nodes = {side: stream_node(side.value) for side in Side}
        self._trajectories = TrajectoryControllers(
            self._dual_node,
            {side: boxes.trajectory for side, boxes in self._boxes.items()},
            {side: boxes.dual_trajectory for side, boxes in self._boxes.items()},
            fast_lines.ask,
            clock,
            limits,
            self._stream_node,
        )
        interfaces = {
            **self._trajectories.interfaces,
            **forward_interfaces(self._stream_nodes, fast_lines, clock.now),
        }
        self._arms = {
            side: ArmManager(
                side,
                fast_lines,
                controllers[side],
                self._executor,
                interfaces,
                clock,
                partial(self._follow_hardware, side),
            )
            for side in Side
        }
        self._managed = ManagedNodes(connection, manager, fast_lines, hands.grippers, self._look)
        self._states = [
            JointStatePublisher(arm.node, side, self._boxes[side], clock) for side, arm in self._arms.items()
        ]
        self._hands = Hands(
            hands,
            self._managed.grippers,
            self._stream_nodes,
            self.say,
            self._managed.why_no_grip,
            self._managed.may_ask_hand,
        )
        self._commands = [
            topic(node, side, box, partial(fast_lines.snapshot, side), clock.now)
            for side, node in self._stream_nodes.items()
            for topic, box in _command_topics(self._boxes[side])
        ]
        offered = (self._manager_node, manager, self._managed.permission, self._look)
        self._services = RobotManagerServices(*offered)
        self._manager_actions = RobotManagerActions(*offered)
        self._state = RobotStateTopic(self._manager_node, manager.watch.state, clock)
        self._merged = MergedJointStates(self._stream_node, self._boxes, self._hands.fingers, merged_rate, clock)
        self._descriptions = publish_descriptions(
            self._manager_node, limits, {side: hands.settings.modules(side) for side in Side}
        )
        self._publish_health()
        self._threads = [
            Thread(target=self._spin, args=(self._executor,), name="executor"),
            Thread(target=self._spin, args=(self._streams,), name="streams"),
        ]

    def start(self) -> None:
        """Answer from now on."""
        for node in self._answering():
            self._executor.add_node(node)
        for node in self._streaming():
            self._streams.add_node(node)
        self._state.start()
        for publisher in self._states:
            publisher.start()
        self._hands.start()
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Answer nobody any more and destroy the nodes."""
        self._is_over.set()
        self._state.stop()
        for publisher in self._states:
            publisher.stop()
        self._hands.stop()
        self._executor.shutdown(timeout_sec=2.0)
        self._streams.shutdown(timeout_sec=2.0)
        for thread in self._threads:
            if thread.ident is not None:
                thread.join()
        self._manager_actions.destroy()
        self._hands.destroy()
        self._trajectories.destroy()
        for arm in self._arms.values():
            arm.destroy()
        self._managed.destroy()
        for node in (self._manager_node, self._dual_node, *self._streaming()):
            node.destroy_node()

    def tell(self, event: Event) -> None:
        """Log what happened in a fast line, and see what has changed."""
        self._arms[event.side].tell(event)

    def say(self, sentence: str) -> None:
        """Log one line of the robot manager."""
        self._manager_node.get_logger().info(sentence)

    def bring_up(self) -> None:
        """Activate all managed nodes, as far as that goes, and bring the robot to ready, or say why it is not."""
        self._managed.bring_up()
        try:
            demand(self._managed.permission.to_move())
            self._manager.make_ready()
            self._set_up_hands()
            self.say("The robot is ready.")
        except YumiError as error:
            self._manager_node.get_logger().error(str(error))

    def _set_up_hands(self) -> None:
        complain = self._manager_node.get_logger().error
        set_up_hands(self._hand_parts.grippers, self.say, complain, is_tested=self._hand_parts.settings.test_at_start)

    @property
    def is_connected(self) -> bool:
        """Whether the robot may be asked."""
        return self._managed.is_connected

    def _look(self) -> None:
        for arm in self._arms.values():
            arm.look()

    def _follow_hardware(self, side: Side) -> None:
        self._managed.follow_hardware(side)

    def _answering(self) -> list[Any]:
        return [
            self._manager_node,
            self._dual_node,
            *(arm.node for arm in self._arms.values()),
            *self._managed.all,
        ]

    def _streaming(self) -> list[Any]:
        return [self._stream_node, *self._stream_nodes.values()]

    def _spin(self, executor: Executor) -> None:
        while not self._is_over.is_set():
            try:
                executor.spin_once(timeout_sec=0.1)
            except InvalidHandle:
                continue  # a controller's node went while the executor looked for work
            except Exception as error:  # of a callback; everybody else still wants to be answered
                self._manager_node.get_logger().error(f"A callback failed with {type(error).__name__}: {error}.")

    def _publish_health(self) -> None:
        for side, node in self._stream_nodes.items():
            publisher = node.create_publisher(DiagnosticStatus, "egm_state", 1)
            node.create_timer(_EGM_STATE_PERIOD, partial(self._publish_status, publisher, side))
        self._diagnostics = self._manager_node.create_publisher(DiagnosticArray, "/diagnostics", 1)
        self._manager_node.create_timer(_DIAGNOSTICS_PERIOD, self._publish_diagnostics)

    def _publish_status(self, publisher: Any, side: Side) -> None:
        publisher.publish(egm_status(side, self._snapshot(side)))

    def _publish_diagnostics(self) -> None:
        array = DiagnosticArray()
        array.header.stamp = stamp(self._manager_node.get_clock().now().nanoseconds)
        array.status = [
            robot_status(self._manager.watch.state()),
            *(egm_status(side, self._snapshot(side)) for side in Side),
            *self._hands.statuses(),
        ]
        self._diagnostics.publish(array)


def stream_node(namespace: str = "") -> Any:
    """A node for topics alone: without the services that every other node has, looking for work is quick."""
    return rclpy.create_node("yumi_topics", namespace=namespace, start_parameter_services=False)


def _command_topics(boxes: ArmBoxes) -> tuple[tuple[type[CommandTopic], Mailbox], ...]:
    return (
        (JointCommandTopic, boxes.goals),
        (JointVelocityTopic, boxes.speeds),
    )


def open_ros() -> None:
    """Start ROS in this process; signals stay with the application."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)


def close_ros() -> None:
    """End ROS in this process."""
    rclpy.try_shutdown()
