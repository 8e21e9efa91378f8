"""``yumi up``, the driver as a program: it connects, brings the robot to ready, and serves ROS until it must end."""

from __future__ import annotations

import logging
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from threading import Event as Flag
from threading import Thread
from typing import TYPE_CHECKING, Any

import click

from abb_protocols.catalogue import Message, message, speak_as
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import NoConnection, YumiError
from abb_protocols.robot.joints import Side
from abb_runtime.clock import SystemClock
from abb_runtime.options import (
    NEW_FILE_TYPE,
    TIME_TYPE,
    egm_port_options,
    end_flag,
    speed_scale_option,
    until_stdin_closes_option,
)
from abb_runtime.process.command_process import DRIVER_READY, DRIVER_RUNNING
from abb_runtime.process.realtime import release_process, settle_memory, short_switch_interval
from abb_runtime.process.single_instance import SingleInstance
from abb_runtime.process.supervision import SupervisedThread, ThreadFailures, start_thread
from abb_runtime.rws.client import RwsClient
from abb_runtime.udp import address_of_host
from yumi.api.connection import commanded_robot, motion_executor, recorded_sources
from yumi.api.motion_registry import MotionRegistry
from yumi.cli.driver_options import (
    bringup_option,
    config_option,
    demand_ros,
    limit_discovery,
    robot_options,
    settings_of,
)
from yumi.cli.main import ROS_ARGUMENTS
from yumi.control.loop_commands import Commands
from yumi.control.loop_events import Event, is_logged, is_warning
from yumi.control.speed_scale import FULL_SPEED
from yumi.driver.command import CommandedRobot
from yumi.driver.control_process import ControlProcess
from yumi.driver.endpoint_server import EndpointServer
from yumi.driver.gripper_setup import set_up_grippers
from yumi.driver.initial_controllers import Controllers
from yumi.driver.robot_connection import RobotConnection
from yumi.driver.robot_manager import RobotManager
from yumi.driver.robot_start import start_robot
from yumi.driver.settings import RobotSettings, Settings, read_controllers
from yumi.driver.wiring import DriverParts, make_parts, only_at_robot
from yumi.recording.recorder import Recorder

if TYPE_CHECKING:
    from yumi.ros.ros_driver import RosDriver

_log = logging.getLogger("yumi")

_END_REQUESTS = 3.0
"""A driver that must end abandons its requests to the controller after this time [s]: the network may be dead."""

END = 4.5
"""A driver that has not ended this long after it was asked to is ended by force [s]."""

DEFAULT_WAIT = 60.0
"""So long does ``yumi up --wait`` wait for a controller [s]."""

_POLL = 0.05  # [s]
_WAIT_PERIOD = 0.5  # [s] between two attempts to reach a controller that is waited for
_SIGNALS = 1.0  # [s] between two attempts to subscribe to the grippers' signals


@click.command()
@robot_options()
@egm_port_options()
@click.option(
    "--wait",
    is_flag=False,
    flag_value=DEFAULT_WAIT,
    type=TIME_TYPE,
    metavar="[SECONDS]",
    help=f"Wait until a controller answers at the address, {DEFAULT_WAIT:g} s at most unless SECONDS is given.",
)
@speed_scale_option()
@config_option
@click.option(
    "--controllers", type=click.Path(path_type=Path), help="Controllers instead of the delivered controllers.yaml."
)
@click.option(
    "--initial-joint-controller",
    metavar="NAME",
    help="Controller that commands the arms after EGM has started; else joint_position_controller.",
)
@click.option("--record", type=NEW_FILE_TYPE, help="Record every cycle to this MCAP file.")
@bringup_option
@click.option(
    "--namespace", help="Of this robot among several in one ROS graph, such as cell1; all its nodes are under it."
)
@click.option("--prefix", help="Put it before the names of all joints and links, such as a_.")
@click.option("--frame-prefix", help="Put it before the names of frames on /tf; else the namespace and a slash.")
@click.option("--network", is_flag=True, help="Let all machines of the subnet find the driver's ROS 2 nodes.")
@click.option("--ros/--no-ros", "with_ros", default=True, help="Serve ROS 2; without, the commands and scripts alone.")
@until_stdin_closes_option
def up(
    config: Path | None,
    controllers: Path | None,
    record: Path | None,
    network: bool,
    with_ros: bool,
    wait: float | None,
    until_stdin_closes: bool,
    **options: Any,
) -> None:
    """Run the driver; with --bringup it brings the robot to ready.

    It serves ROS 2, the commands of yumi and scripts that attach to it, and prints what it will do to the robot
    beforehand.

    \b
    Examples:
      yumi up --robot 192.168.125.1            only reads at first
      yumi up --robot 192.168.125.1 --bringup  motors on, grippers calibrated
      yumi up --robot 127.0.0.1            `yumi controller` in another terminal
      yumi up --robot 127.0.0.1 --wait     the controller may start later
      yumi up --robot 192.168.125.1 --namespace cell1    /cell1/r/joint_states
      yumi up --robot 192.168.125.1 --no-ros             no ROS 2 is needed
      yumi state                           what it does, in another terminal
      ros2 service call /yumi_robot_manager/start_egm std_srvs/srv/Trigger
    """
    if with_ros:
        demand_ros(for_driver=True)
        click.echo(limit_discovery(is_open=network))
    settings = settings_of(config, options)
    chosen = {side: read_controllers(side, controllers) for side in Side}
    is_over = end_flag(until_stdin_closes)
    end_by_force(is_over)

    def report_ready(reason: Message | None) -> None:
        if reason is not None:
            click.echo(f"{DRIVER_RUNNING}{message('not_ready_yet', reason=reason)}")
        else:
            click.echo(f"{DRIVER_READY}serving the robot at {settings.robot.host_and_port}")

    ros_arguments = ["--ros-args", *click.get_current_context().meta[ROS_ARGUMENTS]]
    if with_ros:
        speak_as(FrontEnd.ROS)
    if wait is not None and not wait_for_controller(settings.robot, wait, is_over):
        return
    run_driver(settings, chosen, is_over, report_ready, record, ros_arguments, with_ros=with_ros)


def wait_for_controller(robot: RobotSettings, timeout: float, is_over: Flag) -> bool:
    """Wait until a controller answers at the robot's address; False when ``is_over`` was set first.

    Args:
        robot: where it is, and who logs in.
        timeout: longest wait [s].
        is_over: ends the wait.

    Raises:
        NoConnection: none answers in time, or the address is unknown.
        YumiError: what answers refuses the user, or is not a controller.
    """
    address_of_host(robot.address)  # an unknown name does not become known
    end, is_reported = time.monotonic() + timeout, False
    while not is_over.is_set():
        client = robot.client()
        try:
            client.connect()
            return True
        except NoConnection:
            if time.monotonic() >= end:
                raise
        finally:
            client.close()
        if not is_reported:
            click.echo(f"Waiting up to {timeout:g} s for a controller at {robot.host_and_port}.")
            is_reported = True
        is_over.wait(_WAIT_PERIOD)
    return False


def run_driver(
    settings: Settings,
    controllers: Controllers,
    is_over: Flag,
    on_ready: Callable[[Message | None], None],
    record: Path | None = None,
    ros_arguments: Sequence[str] | None = None,
    *,
    with_ros: bool = True,
) -> None:
    """The driver: connect, bring the robot to ready, serve until ``is_over``; leaves the robot without EGM.

    Unless ``ros.bringup`` names it, a real robot is left as it is until the driver is asked for more.

    Args:
        settings: where the robot is, and how it moves.
        controllers: what runs on each arm.
        is_over: set when it must end.
        on_ready: called when it serves and the robot was brought to ready, with the reason why it is not, or None.
        record: file for every cycle of both arms.
        ros_arguments: for rclpy; None: those of this process.
        with_ros: whether it serves ROS 2, too, beside its local endpoint.

    Raises:
        YumiError: the robot cannot be reached or used; nothing was started.
    """
    clock = SystemClock()

    def log(level: int, said: Message | str) -> None:
        front.log(level, said)
        endpoint.note(level, said)

    failures = ThreadFailures()

    def on_event(event: Event) -> None:
        record_event = partial(records.on_event, now=clock.now(), time_of_day=time.time())
        what = f"Handling {type(event).__name__} of the {event.side.word} arm"
        for listener in (record_event, parts.manager.note, front.on_event, motions.note, endpoint.note_event):
            failures.attempt(what, listener, event)

    with short_switch_interval(), ExitStack() as stack:
        stack.callback(release_process)
        for only in (*((_only_under_name(settings.ros.root),) if with_ros else ()), only_at_robot(settings)):
            only.claim()
            stack.callback(only.release)
        parts = make_parts(
            settings,
            controllers,
            on_event,
            lambda step: log(logging.INFO, f"Bring-up: {step}"),
            warn=lambda remark: log(logging.WARNING, f"Bring-up: {remark}"),
        )
        stack.enter_context(_ending_in_time(parts.client, parts.manager, is_over))
        stack.callback(parts.client.close)
        check = partial(parts.bringup.check_controller, parts.plan.addresses)
        connection = RobotConnection(parts.client, check, parts.manager, parts.signals.close)
        connection.check()
        control, manager = parts.control, parts.manager
        manager.is_real()  # asked now, since a virtual controller takes requests as fast as they come from then on
        control.launch()
        stack.callback(control.stop)  # where something fails before it is waited for; else it has ended by then
        front = _with_ros(stack, parts, settings, ros_arguments) if with_ros else DriverWithoutRos(parts, settings)
        stack.callback(front.stop)
        folder, keep = Path(settings.recorder.folder), settings.recorder.keep
        records = Recorder(folder, keep, control.recorders, front.info, clock, manager.monitor.describe)
        stack.callback(records.close)
        if record:
            records.record_all(record, time.time() - clock.now(), recorded_sources(manager, parts.signals))

        motions = MotionRegistry(is_script=False)
        endpoint = EndpointServer(_commanded_robot(parts, settings, motions, front), front.log)
        manager.monitor.log.report = log
        control.start()
        stack.callback(control.stop)
        stack.callback(connection.disconnect)
        stack.callback(_end_motion, manager, control, connection, front.info)
        connected = connection.connect()
        front.start()
        endpoint.start()
        stack.callback(endpoint.stop)
        for sentence in (connected, *map(str, settings.collision.remarks)):
            log(logging.INFO, sentence)
        log(logging.DEBUG, control.started_as)
        log(*_speed_line(manager, with_ros=with_ros))
        reason = front.bring_up(is_reading_only=not settings.ros.brings_up(is_real=manager.is_real()))
        settle_memory()
        on_ready(reason)
        is_over.wait()


def _speed_line(manager: RobotManager, *, with_ros: bool) -> tuple[int, str]:
    """How fast the robot may move and how to change that, and the level of the line: who has all speeds needs none."""
    how = "yumi_robot_manager/set_speed_scale" if with_ros else "yumi speed-scale"
    level = logging.INFO if manager.speed.in_force < FULL_SPEED else logging.DEBUG
    return level, f"{manager.speed} Change it with {how} or the setting robot.speed_scale."


def _only_under_name(root: str) -> SingleInstance:
    def refusal(owner: Message) -> Message:
        if root:
            return message("ros_namespace_taken", namespace=root, owner=owner)
        return message("ros_domain_taken", owner=owner)

    return SingleInstance(
        f"yumi-driver-in-ros-domain-{os.environ.get('ROS_DOMAIN_ID', '0')}{root.replace('/', '.')}",
        refusal,
    )


def _with_ros(
    stack: ExitStack, parts: DriverParts, settings: Settings, ros_arguments: Sequence[str] | None
) -> RosDriver:
    from yumi.ros.gripper_actions import GripperParts  # noqa: PLC0415
    from yumi.ros.ros_driver import RosDriver, close_ros, open_ros  # noqa: PLC0415 - yumi works without ROS

    open_ros(ros_arguments)
    stack.callback(close_ros)
    grippers, plan = GripperParts(parts.grippers, parts.signals, settings.gripper), parts.plan
    return RosDriver(parts.control, plan.controllers, parts.manager, grippers, settings, SystemClock(), plan.limits)


def _commanded_robot(
    parts: DriverParts, settings: Settings, motions: MotionRegistry, front: RosDriver | DriverWithoutRos
) -> CommandedRobot:
    """The robot as commands reach it, with what moves the arms for them."""
    executor = motion_executor(parts, settings, motions, tuple(Side))
    return front.serve_commands(replace(commanded_robot(parts, settings, executor), namespace=settings.ros.root))


class DriverWithoutRos:
    """What a driver does beside its local endpoint where it serves no ROS: it logs, and calibrates the grippers.

    Args:
        parts: of the driver.
        settings: of the driver.
    """

    def __init__(self, parts: DriverParts, settings: Settings) -> None:
        self._parts, self._is_tested = parts, settings.gripper.test_at_start
        self._setup = set_up_grippers(parts.manager, parts.grippers, settings.gripper, _log.error)
        self._is_over = Flag()
        self._signals = SupervisedThread("grippers", self._keep_signals, self._is_over)

    def start(self) -> None:
        """Subscribe to the grippers' signals, again and again should the subscription be lost."""
        self._signals.start()

    def stop(self) -> None:
        self._is_over.set()
        self._signals.join()

    def serve_commands(self, robot: CommandedRobot) -> CommandedRobot:
        """The robot as it is: the local endpoint alone serves commands."""
        return robot

    def on_event(self, event: Event) -> None:
        """Log an event of the control process, with its cause where EGM has ended."""
        if is_logged(event):
            level = logging.WARNING if is_warning(event) else logging.INFO
            self._parts.manager.monitor.describe(event, partial(self.log, level))

    def info(self, sentence: str) -> None:
        self.log(logging.INFO, sentence)

    def log(self, level: int, said: Message | str) -> None:
        _log.log(level, said)

    def bring_up(self, *, is_reading_only: bool = False) -> Message | None:
        """Bring the robot to ready; returns why it is not ready, or None."""
        return start_robot(
            self._parts.manager,
            self._setup,
            self.log,
            is_tested=self._is_tested,
            is_reading_only=is_reading_only,
        )

    def _keep_signals(self) -> None:
        while not self._is_over.wait(_SIGNALS):
            with suppress(YumiError):  # while the controller does not answer, or where it has no gripper
                self._parts.signals.keep_open()


@contextmanager
def _ending_in_time(client: RwsClient, manager: RobotManager, is_over: Flag) -> Iterator[None]:
    """Once ``is_over``, what is being done to the robot ends at its next step, and the controller is soon given up."""
    has_ended = Flag()

    def watch() -> None:
        while not is_over.wait(_POLL):
            if has_ended.is_set():
                return
        manager.interrupt()
        if not has_ended.wait(_END_REQUESTS):
            client.abandon()

    thread = Thread(target=watch, name="end-in-time", daemon=True)
    start_thread(thread)
    try:
        yield
    finally:
        has_ended.set()
        thread.join()


def _end_motion(
    manager: RobotManager, control: ControlProcess, connection: RobotConnection, log: Callable[[str], None]
) -> None:
    """Hold the arms, whatever the network does, and have the controller end EGM, if it answers."""
    for side in Side:
        if control.snapshot(side).is_commanded:
            with suppress(YumiError):  # a control process that has ended: EGM is ended all the same
                control.call(Commands.hold, side)
    try:
        if connection.is_open and manager.has_acted:  # else EGM, if it runs, is another program's
            manager.end_motion()
    except YumiError as error:
        log(f"EGM could not be ended on the robot: {error}")


def end_by_force(is_over: Flag) -> None:
    """End the process :data:`END` after ``is_over`` is set, should it still be there; the arms' processes hold then.

    Something may wait for what never comes: a user who has asked the driver to end needs no other program for it.
    """

    def end() -> None:
        is_over.wait()
        time.sleep(END)
        busy = [each.name for each in threading.enumerate() if not each.daemon and each is not threading.main_thread()]
        words = f"; these threads had not ended: {', '.join(sorted(busy))}" if busy else ""
        sys.stderr.write(f"Error: the driver did not end within {END:g} s and is ended by force{words}.\n")
        sys.stderr.flush()
        os._exit(1)

    start_thread(Thread(target=end, name="forced-end", daemon=True))
