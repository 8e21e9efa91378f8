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
                               set_speed_scale, state, robot_description, /diagnostics
yumi_robot                     the life of the connection to the robot
yumi_topics                    joint_states (merged)
============================== ====================================================================
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any, NamedTuple

import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.signals import SignalHandlerOptions

from yumi.clock import Clock
from yumi.control.events import Event, RobotStoppedFollowing, SessionLost, SessionStarted
from yumi.driver.bringup import ANNOUNCEMENT
from yumi.driver.control_process import ControlProcess
from yumi.driver.gripper import GripperSetup, close_as_test
from yumi.driver.robot_manager import RobotManager
from yumi.driver.settings import CalibrateWhen, ControllerSettings
from yumi.errors import MissingPrerequisite, RobotNotReady, SettingsError, YumiError
from yumi.robot.joints import JointLimits, Side
from yumi.ros.controller_manager import ArmManager
from yumi.ros.controllers import MakeInterface
from yumi.ros.executors import Executors, Ticker
from yumi.ros.gripper import HandParts, Hands
from yumi.ros.health import HealthTopics, RobotStateTopic
from yumi.ros.lifecycle import Connection, ManagedNodes, demand
from yumi.ros.robot_manager import RobotManagerActions, RobotManagerServices, SpeedScaleInterface
from yumi.ros.topics import (
    CommandTopic,
    JointCommandTopic,
    JointStatePublisher,
    JointVelocityTopic,
    MergedJointStates,
    forward_interfaces,
    publish_descriptions,
)
from yumi.ros.trajectory import DUAL_ARM, TrajectoryControllers


class DriverNodes(NamedTuple):
    """The nodes that are nobody else's.

    Attributes:
        manager: the robot manager's.
        dual: that of the controller of both arms.
        stream: for topics about both arms.
        streams: for those about each.
    """

    manager: Any
    dual: Any
    stream: Any
    streams: Mapping[Side, Any]

    @classmethod
    def make(cls) -> DriverNodes:
        """Make them, the first nodes of the process.

        Raises:
            MissingPrerequisite: the middleware cannot be started.
        """
        try:
            streams = {side: stream_node(side.value) for side in Side}
            return cls(rclpy.create_node("yumi_robot_manager"), rclpy.create_node(DUAL_ARM), stream_node(), streams)
        except RCLError as error:
            raise MissingPrerequisite(
                f"ROS 2 cannot make its nodes: {str(error).partition(', at ')[0]}; see its lines above, and that the "
                "limits of this program are not too low (ulimit -n, ulimit -v)."
            ) from error

    @property
    def streaming(self) -> tuple[Any, ...]:
        """Those with topics alone."""
        return (self.stream, *self.streams.values())

    def destroy(self) -> None:
        for node in (self.manager, self.dual, *self.streaming):
            node.destroy_node()


class RosDriver:
    """All nodes of the driver in one process.

    Args:
        control: the control process.
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
        control: ControlProcess,
        controllers: Mapping[Side, Iterable[ControllerSettings]],
        manager: RobotManager,
        connection: Connection,
        hands: HandParts,
        merged_rate: float,
        clock: Clock,
        limits: JointLimits,
    ) -> None:
        self._manager = manager
        self._hand_parts = hands
        self._nodes = nodes = DriverNodes.make()
        complain = nodes.manager.get_logger().error
        self._executors = Executors(complain)
        self._ticker = Ticker(clock, complain)
        self._slow_tickers = {side: Ticker(clock, complain, f"slow-ticker-{side.value}") for side in Side}
        self._trajectories = TrajectoryControllers(
            nodes.dual,
            {side: boxes.trajectory for side, boxes in control.buffers.items()},
            {side: boxes.dual_trajectory for side, boxes in control.buffers.items()},
            control,
            clock,
            limits,
            self._ticker,
            manager.monitor,
        )
        forwarding = forward_interfaces(nodes.streams, control, clock.now)
        interfaces = {**self._trajectories.interfaces, **forwarding}
        self._arms = {side: self._make_arm(side, own, control, interfaces, clock) for side, own in controllers.items()}
        self._managed = ManagedNodes(connection, manager, control, hands.grippers, self._look)
        self._hands = Hands(
            hands,
            self._managed.grippers,
            nodes.streams,
            self.say,
            self._ticker,
            self._why_no_grip,
            self._managed.may_ask_hand,
            manager.calibrate,
        )
        self._gripper_setup = GripperSetup(
            hands.grippers,
            manager.step,
            nodes.manager.get_logger().error,
            is_allowed=hands.settings.calibrate is CalibrateWhen.AT_START,
            why_not=self._managed.why_no_grip,  # a stop is confirmed before the robot becomes ready, but not closed yet
            is_confirmed=lambda: not manager.is_unattended,
        )
        manager.when_ready(self._gripper_setup.run)
        self._commands = command_topics(nodes.streams, control, clock)
        for topic in self._commands:
            topic.why_stopped = manager.monitor.cause
        offered = (nodes.manager, manager, self._managed.permission, self._look)
        self._services = RobotManagerServices(*offered)
        self._manager_actions = RobotManagerActions(*offered)
        self._speed = SpeedScaleInterface(nodes.manager, manager.speed)
        self._executors.add_answering("answers", nodes.manager)
        self._executors.add_answering("answers-dual", nodes.dual)
        self._executors.add_answering("answers-lives", *self._managed.all)
        self._executors.add_streaming("streams", *nodes.streaming)
        self._publish(control, merged_rate, clock, limits)

    def start(self) -> None:
        """Answer from now on."""
        for ticker in self._tickers:
            ticker.start()
        for publisher in self._states:
            publisher.start()
        self._hands.start()
        self._executors.start()

    def stop(self) -> None:
        """Answer nobody any more and destroy the nodes."""
        for ticker in self._tickers:
            ticker.stop()
        for publisher in self._states:
            publisher.stop()
        self._hands.stop()
        self._executors.stop()
        self._manager_actions.destroy()
        self._hands.destroy()
        self._trajectories.destroy()
        for arm in self._arms.values():
            arm.destroy()
        self._managed.destroy()
        self._nodes.destroy()

    def tell(self, event: Event) -> None:
        """Log what happened in a fast line, and see what has changed."""
        is_end_of_egm = isinstance(event, SessionLost | SessionStarted | RobotStoppedFollowing)
        self._arms[event.side].tell(event, self._manager.monitor.explain if is_end_of_egm else None)

    def say(self, sentence: str) -> None:
        """Log one line of the robot manager."""
        self._nodes.manager.get_logger().info(sentence)

    def warn(self, sentence: str) -> None:
        """Log one line of the robot manager that a person should do something about."""
        self.report(logging.WARNING, sentence)

    def report(self, level: int, sentence: str) -> None:
        """Log one line of the robot manager, with a level of :mod:`logging`."""
        log = self._nodes.manager.get_logger()
        if level >= logging.ERROR:  # a line for each: rclpy refuses another severity from the same line
            log.error(sentence)
        elif level >= logging.WARNING:
            log.warning(sentence)
        else:
            log.info(sentence)

    def bring_up(self, *, is_reading_only: bool = False) -> str:
        """Activate all managed nodes, as far as that goes, and bring the robot to ready.

        Args:
            is_reading_only: whether the robot is left as it is.

        Returns:
            Why it is not ready; empty when it is, or is left as it is.
        """
        self._managed.bring_up()
        try:
            demand(self._managed.permission.to_move())
            if is_reading_only:
                self._manager.report_remarks()
                self.say("The robot is left as it is until start_egm, set_mode or recover is called.")
                return ""
            is_tested = self._hand_parts.settings.test_at_start
            steps = [*self._manager.steps_to_ready(), *self._gripper_setup.steps(is_tested=is_tested)]
            if steps:
                self.warn(f"{ANNOUNCEMENT}{', '.join(steps)}.")
            self._manager.make_ready()
            self._test_grippers()
            self.say("The robot is ready.")
        except YumiError as error:
            self._nodes.manager.get_logger().error(str(error))
            return str(error)
        return ""

    def _test_grippers(self) -> None:
        if self._hand_parts.settings.test_at_start:
            close_as_test(self._hand_parts.grippers, self.say, self._nodes.manager.get_logger().error)

    def _why_no_grip(self, side: Side) -> str | None:
        reason = self._managed.why_no_grip(side)
        if reason is None:
            try:
                self._manager.check_not_stopped()
            except RobotNotReady as error:
                return str(error)
        return reason

    @property
    def is_connected(self) -> bool:
        """Whether the robot may be asked."""
        return self._managed.is_connected

    def _look(self) -> None:
        for arm in self._arms.values():
            arm.look()

    @property
    def _tickers(self) -> tuple[Ticker, ...]:
        return (self._ticker, *self._slow_tickers.values())

    def _make_arm(
        self,
        side: Side,
        own: Iterable[ControllerSettings],
        control: ControlProcess,
        interfaces: Mapping[str, MakeInterface],
        clock: Clock,
    ) -> ArmManager:
        executor, follow = self._executors.add_answering(f"answers-{side.value}"), partial(self._follow_hardware, side)
        return ArmManager(side, control, own, executor, interfaces, clock, self._slow_tickers[side], follow)

    def _follow_hardware(self, side: Side) -> None:
        self._managed.follow_hardware(side)

    def _publish(self, control: ControlProcess, merged_rate: float, clock: Clock, limits: JointLimits) -> None:
        """Publish what is known."""
        nodes, robot, boxes = self._nodes, self._manager.monitor.state, control.buffers
        self._states = [JointStatePublisher(arm.node, side, boxes[side], clock) for side, arm in self._arms.items()]
        self._state = RobotStateTopic(nodes.manager, robot, clock, self._ticker)
        self._merged = MergedJointStates(nodes.stream, boxes, self._hands.fingers, merged_rate, clock, self._ticker)
        modules = {side: self._hand_parts.settings.modules(side) for side in Side}
        self._descriptions = publish_descriptions(nodes.manager, limits, modules)
        self._health = HealthTopics(
            nodes.manager, nodes.streams, control.snapshot, robot, self._hands.statuses, self._ticker
        )


def stream_node(namespace: str = "") -> Any:
    """A node for topics alone: without the services that every other node has, looking for work is quick."""
    return rclpy.create_node("yumi_topics", namespace=namespace, start_parameter_services=False)


def command_topics(nodes: Mapping[Side, Any], control: ControlProcess, clock: Clock) -> list[CommandTopic]:
    """The topics of goals and of speeds, of both arms."""
    topics: list[CommandTopic] = []
    for side, node in nodes.items():
        boxes, snapshot = control.buffers[side], partial(control.snapshot, side)
        topics.append(JointCommandTopic(node, side, boxes.goals, snapshot, clock.now))
        topics.append(JointVelocityTopic(node, side, boxes.speeds, snapshot, clock.now))
    return topics


def open_ros() -> None:
    """Start ROS in this process; signals stay with the application.

    Raises:
        SettingsError: its folder for logs cannot be written, or its environment is not as it should be.
    """
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RCLError as error:
        reason = str(error).partition(", at ")[0]
        raise SettingsError(
            f"ROS 2 does not start: {reason}; set ROS_LOG_DIR to a folder that can be written, or unset it."
            if "log" in reason
            else f"ROS 2 does not start: {reason}; check ROS_DOMAIN_ID, RMW_IMPLEMENTATION and the --ros-args."
        ) from error


def close_ros() -> None:
    """End ROS in this process."""
    rclpy.try_shutdown()
