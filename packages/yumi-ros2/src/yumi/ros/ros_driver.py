"""The ROS side of the driver: which nodes exist, and which topics, services and actions each one has.

============================== ====================================================================
node                           what it has
============================== ====================================================================
r/controller_manager           the services of ros2_control, activity, joint_states, /diagnostics
r/<controller>                 the parameters of each controller
r/joint_trajectory_controller  follow_joint_trajectory, joint_trajectory, controller_state,
                               speed_scaling_input
r/cartesian_controller         move_linear, target_pose, servo_pose, servo_twist, inverse_kinematics, jacobian
r/yumi_topics                  the command topics of controllers, egm_state, gripper/joint_states,
                               gripper/state, gripper/vacuum_1/pressure and object_picked
r/gripper                      gripper_cmd, parallel_gripper_cmd, calibrate, jog_open, jog_close, stop,
                               clear_error, vacuum_1, blow_1 … (and all of these for l)
dual_arm_trajectory_controller what the trajectory controllers have, for both arms; inter_arm_skew;
                               dual_arm_cartesian_controller/move_linear
yumi_robot_manager             start_egm, stop_egm, robot_is_ready, get_state … set_mode, recover,
                               set_speed_scale, speed_scale, set_tool, set_payload, gpio_states, state, /diagnostics
robot_state_publisher          /tf, /tf_static, robot_description (topic and parameter)
yumi_topics                    joint_states (merged)
============================== ====================================================================

All of them are in the robot's namespace, which is empty for the only robot of a ROS graph. ``r/yumi_topics`` publishes
``tcp_pose``, too.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.signals import SignalHandlerOptions

from abb_protocols.catalogue import Message, message, said_by
from abb_protocols.errors import CommandRefused, MissingPrerequisite, SettingsError
from abb_protocols.robot.joints import JointLimits, Side, prefixed
from abb_protocols.robot.urdf import MESHES, robot_description
from abb_runtime.clock import Clock
from yumi.control.controller import State
from yumi.control.loop_events import Event, RobotStoppedFollowing, SessionLost, SessionStarted
from yumi.driver.command import CommandedRobot
from yumi.driver.control_process import ControlProcess
from yumi.driver.controller_names import DUAL_ARM_CONTROLLER
from yumi.driver.gripper_setup import set_up_grippers
from yumi.driver.robot_manager import RobotManager
from yumi.driver.robot_start import start_robot
from yumi.driver.settings import ControllerSettings, Settings, config_folder
from yumi.ros.cartesian_interfaces import cartesian_interfaces
from yumi.ros.command_services import CommandActions, CommandServices, SpeedScaleInterface
from yumi.ros.command_topics import (
    CommandTopic,
    JointCommandTopic,
    JointStreamTopic,
    JointVelocityTopic,
    forward_interfaces,
)
from yumi.ros.controller_manager_node import ArmHardware, ControllerManagerNode
from yumi.ros.frames import ROBOT_STATE_PUBLISHER, FramePublisher, RobotFrames
from yumi.ros.gripper_actions import GripperParts, Grippers
from yumi.ros.nodes import Executors, TimerThread
from yumi.ros.state_topics import (
    HealthTopics,
    JointStatePublisher,
    MergedJointStates,
    RobotStateTopic,
    SignalsTopic,
    newest_state,
)
from yumi.ros.trajectory_action import TrajectoryControllers


class RosDriver:
    """All nodes of the driver in one process.

    Args:
        control: the control process.
        controllers: those of ``controllers.yaml``.
        manager: the robot manager.
        grippers: both grippers, with their signals and settings.
        settings: names, rates, and the tool in use.
        clock: the machine's clock.
        limits: of the joints on trajectories.

    Raises:
        MissingPrerequisite: the middleware cannot be started.
    """

    def __init__(
        self,
        control: ControlProcess,
        controllers: Mapping[Side, Iterable[ControllerSettings]],
        manager: RobotManager,
        grippers: GripperParts,
        settings: Settings,
        clock: Clock,
        limits: JointLimits,
    ) -> None:
        self._manager, self._clock, self._hand_over = manager, clock, control.hand_over
        self._gripper_parts = grippers
        control.hand_over.own_name = "ROS"
        self._hardware = {side: ArmHardware(side, control) for side in Side}
        root = settings.ros.root
        namespaces = {side: f"{root}/{side.value}" for side in Side}
        try:
            # A node for topics alone has no parameter services: its executor finds work sooner.
            self._streams = {side: _topics_node(namespaces[side]) for side in Side}
            self._stream = _topics_node(root)
            self._node: Any = rclpy.create_node("yumi_robot_manager", namespace=root)
            dual = rclpy.create_node(DUAL_ARM_CONTROLLER, namespace=root)
            gripper_nodes = {side: rclpy.create_node("gripper", namespace=namespaces[side]) for side in Side}
            description_node = rclpy.create_node(ROBOT_STATE_PUBLISHER, namespace=root)
        except RCLError as error:
            raise MissingPrerequisite(message("ros_makes_no_nodes", why=said_by(error))) from error
        streams = (self._stream, *self._streams.values())
        self._nodes = (self._node, dual, *gripper_nodes.values(), description_node, *streams)
        log_error = self._node.get_logger().error
        self._executors = Executors(log_error)
        self._timers = TimerThread(clock, log_error)
        slow_timers = {side: TimerThread(clock, log_error, f"slow-timers-{side.value}") for side in Side}

        base = settings.ros.frames + prefixed("yumi_base_link")
        buffers, robot, polled = control.buffers, manager.monitor.state, manager.monitor.joints
        self._trajectories = TrajectoryControllers(
            dual,
            {side: each.trajectory for side, each in buffers.items()},
            {side: each.dual_trajectory for side, each in buffers.items()},
            control,
            clock,
            limits,
            self._timers,
            manager.monitor,
            base,
            self.update_activity,
        )
        self._grippers = Grippers(
            grippers,
            gripper_nodes,
            self._streams,
            self.info,
            self._timers,
            manager.check_gripper,
            manager.calibrate,
            settings.ros.frames,
        )
        frames = RobotFrames(
            robot_description(limits, {side: grippers.settings.modules(side) for side in Side}, _meshes()),
            settings.ros.frames,
            manager.tcp,
            lambda side: newest_state(buffers[side], polled(side)),
            self._grippers.fingers,
            clock.now,
        )
        interfaces = {
            **self._trajectories.interfaces,
            **forward_interfaces(self._streams, control, clock.now),
            **cartesian_interfaces(
                dual,
                self._streams,
                control,
                clock.now,
                frames,
                limits,
                settings.ros.frames + prefixed("yumi_base"),
                settings.tool_limits.limits,
            ),
        }
        self._arms = {
            side: ControllerManagerNode(
                side,
                namespaces[side],
                control,
                own,
                self._executors.add_multi_threaded(f"services-{side.value}"),
                interfaces,
                clock,
                slow_timers[side],
            )
            for side, own in controllers.items()
        }

        self._gripper_setup = set_up_grippers(
            manager, grippers.grippers, grippers.settings, lambda said: log_error(str(said))
        )

        who = control.hand_over
        self._joint_commands = {
            side: JointCommandTopic(node, side, buffers[side].goals, partial(control.snapshot, side), clock.now, who)
            for side, node in self._streams.items()
        }
        self._commands: list[CommandTopic] = [
            *self._joint_commands.values(),
            *(
                JointVelocityTopic(node, side, buffers[side].speeds, partial(control.snapshot, side), clock.now, who)
                for side, node in self._streams.items()
            ),
        ]
        self._gripper_work = ThreadPoolExecutor(len(Side), "gripper-streams")
        for topic in self._commands:
            topic.why_stopped = manager.monitor.cause

        self._base, self._actions = base, list[CommandActions]()
        self._speed = SpeedScaleInterface(self._node, manager.speed, self._timers)
        signal_timers = TimerThread(clock, log_error, "signal-timers")
        self._signals = SignalsTopic(self._node, manager.signals, signal_timers, base)
        self._executors.add_multi_threaded("services", self._node, description_node)
        self._executors.add_multi_threaded("services-dual", dual)
        self._executors.add_multi_threaded("services-grippers", *gripper_nodes.values())
        self._executors.add_single_threaded("streams", *streams)

        manager.monitor.read_joints()
        self._states = [
            JointStatePublisher(arm.node, side, buffers[side], clock, polled, base) for side, arm in self._arms.items()
        ]
        self._threads: tuple[Any, ...] = (
            *(self._timers, *slow_timers.values(), signal_timers),
            *(*self._states, self._grippers, self._executors),
        )
        self._state = RobotStateTopic(self._node, robot, clock, self._timers, base)
        self._merged = MergedJointStates(
            self._stream,
            buffers,
            self._grippers.fingers,
            settings.ros.merged_rate,
            clock,
            self._timers,
            polled,
            base,
        )
        self._frames = FramePublisher(
            description_node,
            self._streams,
            frames.urdf,
            settings.ros,
            manager.tcp,
            frames.measured,
            self._grippers.fingers,
            clock,
            self._timers,
        )
        self._health = HealthTopics(
            self._node,
            self._streams,
            control.snapshot,
            robot,
            self._grippers.statuses,
            self._timers,
            control.hand_over,
            lambda: manager.egm_arms,
        )

    def serve_commands(self, robot: CommandedRobot) -> CommandedRobot:
        """Have services and actions for commands, before :meth:`start`; the robot with what ROS knows of its arms."""
        robot = replace(robot, check_arms=self.check_arms, on_change=self.update_activity)
        CommandServices(self._node, robot)
        JointStreamTopic(
            self._stream,
            self._joint_commands,
            lambda closed: robot.follow_with_grippers(closed, self._have_done),
            self._clock.now,
            self._hand_over,
        )
        self._actions.append(CommandActions(self._node, robot, self._base))
        return robot

    def _have_done(self, work: Callable[[], None]) -> None:
        """Have something done for a stream, which does not wait for it."""
        self._gripper_work.submit(work).add_done_callback(self._log_failure)

    def _log_failure(self, work: Future[None]) -> None:
        error = work.exception()
        if error is not None:
            self._node.get_logger().error(str(message("gripper_follows_not_by_fault", error=repr(error))))

    def start(self) -> None:
        """Serve from now on."""
        for part in self._threads:
            part.start()

    def stop(self) -> None:
        """Serve no longer, and destroy the nodes."""
        for part in self._threads:
            part.stop()
        self._gripper_work.shutdown()
        for actions in self._actions:
            actions.destroy()
        self._grippers.destroy()
        self._trajectories.destroy()
        for arm in self._arms.values():
            arm.destroy()
        for node in self._nodes:
            node.destroy_node()

    def on_event(self, event: Event) -> None:
        """Log an event of the control of an arm, and publish what it changed."""
        is_end_of_egm = isinstance(event, SessionLost | SessionStarted | RobotStoppedFollowing)
        self._arms[event.side].on_event(event, self._manager.monitor.explain if is_end_of_egm else None)

    def info(self, sentence: str) -> None:
        """Log one line of the robot manager."""
        self.log(logging.INFO, sentence)

    def warn(self, sentence: str) -> None:
        """Log one line of the robot manager that a person should do something about."""
        self.log(logging.WARNING, sentence)

    def log(self, level: int, said: Message | str) -> None:
        """Log one line of the robot manager, with a level of :mod:`logging`."""
        log, sentence = self._node.get_logger(), str(said)
        if level >= logging.ERROR:  # a line for each: rclpy refuses another severity from the same line
            log.error(sentence)
        elif level >= logging.WARNING:
            log.warning(sentence)
        elif level >= logging.INFO:
            log.info(sentence)
        else:
            log.debug(sentence)

    def bring_up(self, *, is_reading_only: bool = False) -> Message | None:
        """Bring the robot to ready.

        Args:
            is_reading_only: whether the robot is left as it is.

        Returns:
            Why it is not ready; None when it is, or is left as it is.
        """
        return start_robot(
            self._manager,
            self._gripper_setup,
            self.log,
            is_tested=self._gripper_parts.settings.test_at_start,
            is_reading_only=is_reading_only,
        )

    def check_arms(self, sides: Iterable[Side]) -> None:
        """Refuse what needs an arm whose hardware component a user has deactivated.

        Raises:
            CommandRefused: there is one.
        """
        for side in sides:
            state = self._hardware[side].state
            if state in {State.INACTIVE, State.UNCONFIGURED}:
                service = f"{self._arms[side].node.get_fully_qualified_name()}/set_hardware_component_state"
                raise CommandRefused(
                    message(
                        "arm_hardware_not_active",
                        arm=side.word,
                        state=state.value,
                        component=side.unit,
                        service=service,
                    )
                )

    def update_activity(self) -> None:
        """Publish which controllers are active where that has changed."""
        for arm in self._arms.values():
            arm.update()


def _topics_node(namespace: str) -> Any:
    return rclpy.create_node("yumi_topics", namespace=namespace, start_parameter_services=False)


_PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
"""Where the user names profiles of Fast DDS; or in these files, beside which the driver is started."""
_PROFILE_FILES = ("DEFAULT_FASTRTPS_PROFILES.xml", "DEFAULT_FASTDDS_PROFILES.xml")


def open_ros(arguments: Sequence[str] | None = None) -> None:
    """Start ROS in this process; signals stay with the application.

    Args:
        arguments: with its ``--ros-args``; None: those of this process.

    Raises:
        SettingsError: its folder for logs cannot be written, or its environment is not as it should be.
    """
    # With Fast DDS's own period of announcements, 3 s, others find the driver up to 3 s late (config/fastdds.xml).
    if not any(map(os.environ.get, _PROFILES)) and not any(Path(name).exists() for name in _PROFILE_FILES):
        os.environ[_PROFILES[0]] = str(config_folder() / "fastdds.xml")
    try:
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    except RCLError as error:
        raise SettingsError(message("ros_does_not_start", why=said_by(error))) from error


def close_ros() -> None:
    """End ROS in this process."""
    rclpy.try_shutdown()


def _meshes() -> str:
    """Where ROS's tools find our meshes; empty, which shows simple shapes, where this package is in no workspace."""
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    is_there = any((Path(prefix) / "share/yumi_ros2/meshes").is_dir() for prefix in prefixes if prefix)
    return MESHES if is_there else ""
