"""``yumi up``: the driver as a program. It connects, brings the robot to ready, and serves ROS until it must end."""

from __future__ import annotations

import logging
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from threading import Event as Flag
from threading import Thread
from typing import TYPE_CHECKING, Any

import click
import msgspec

from yumi.api.motion import MotionExecutor, MotionRegistry
from yumi.cli.options import (
    ROS_ARGUMENTS,
    SCALE,
    demand_ros,
    end_flag,
    limit_discovery,
    robot_options,
    settings_of,
    until_stdin_closes_option,
)
from yumi.clock import SystemClock
from yumi.control.events import ControllerReport, Event, is_fault
from yumi.control.loop import Commands
from yumi.driver.control_process import ControlProcess
from yumi.driver.endpoint_server import DriverAccess, EndpointServer, surroundings_of
from yumi.driver.gripper import GripperSetup
from yumi.driver.robot_manager import RobotConnection, RobotManager, bring_up
from yumi.driver.settings import CalibrateWhen, Settings, read_controllers
from yumi.driver.wiring import Controllers, DriverParts, make_parts, only_at_robot
from yumi.errors import YumiError
from yumi.process.realtime import release_process, settle_memory, short_switch_interval
from yumi.process.single_instance import Only
from yumi.process.supervision import DRIVER_READY, DRIVER_RUNNING, Failures, SupervisedThread, start_thread
from yumi.recording.mcap import STATE, Recorder, Source
from yumi.robot.joints import Side
from yumi.rws.client import RwsClient

if TYPE_CHECKING:
    from yumi.ros.driver import RosDriver

END_REQUESTS = 3.0
"""A driver that must end abandons its requests to the controller after this time [s]: the network may be dead."""

END = 4.5
"""A driver that has not ended this long after it was asked to is ended by force [s]."""

_POLL = 0.05  # [s]
_SIGNALS = 1.0  # [s] between two attempts to subscribe to the grippers' signals
_log = logging.getLogger("yumi")


@click.command()
@robot_options("Address of the controller; 127.0.0.1 for a virtual one on this machine.")
@click.option("--speed-scale", type=SCALE, help="Factor on all speeds; else 1 on this machine, 0.1 elsewhere.")
@click.option("--config", type=click.Path(path_type=Path), help="Settings instead of the delivered yumi.yaml.")
@click.option(
    "--controllers", type=click.Path(path_type=Path), help="Controllers instead of the delivered controllers.yaml."
)
@click.option(
    "--initial-joint-controller",
    metavar="NAME",
    help="Controller that commands the arms after EGM has started; else joint_position_controller.",
)
@click.option("--record", type=click.Path(dir_okay=False, path_type=Path), help="Record every cycle to this MCAP file.")
@click.option(
    "--bringup/--no-bringup",
    default=None,
    help="Bring the robot to ready at start: motors on, RAPID started, grippers calibrated. Without, the driver "
    "connects and only reads until start_egm, set_mode or recover is called.",
)
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
    until_stdin_closes: bool,
    **options: Any,
) -> None:
    """Run the driver: bring the robot to ready and serve ROS 2, the commands of yumi and scripts that attach to it.

    It says what it will do to the robot before it does it.

    \b
    Examples:
      yumi up --robot 192.168.125.1
      yumi up --robot 127.0.0.1 --rws-port 8080      with `yumi controller` in another terminal
      yumi up --robot 192.168.125.1 --no-bringup     changes nothing on the robot until it is asked to
      yumi up --robot 192.168.125.1 --namespace cell1    one of several robots: /cell1/r/joint_states
      yumi up --robot 192.168.125.1 --no-ros         no ROS 2 is needed; move it with `yumi start`, `yumi move`
      yumi state                                     what it does, in another terminal
      ros2 service call /yumi_robot_manager/start_egm std_srvs/srv/Trigger
    """
    if with_ros:
        demand_ros("; or run the driver without it: --no-ros")
        click.echo(limit_discovery(is_open=network))
    settings = settings_of(config, options)
    chosen = {side: read_controllers(side, controllers) for side in Side}
    address = f"{settings.robot.address}:{settings.robot.rws_port}"
    is_over = end_flag(until_stdin_closes)
    end_by_force(is_over)

    def report_ready(reason: str) -> None:
        if reason:
            click.echo(f"{DRIVER_RUNNING}{reason} When that is done, call recover.")
        else:
            click.echo(f"{DRIVER_READY}serving the robot at {address}")

    ros_arguments = ["--ros-args", *click.get_current_context().meta[ROS_ARGUMENTS]]
    run_driver(settings, chosen, is_over, report_ready, record, ros_arguments, with_ros=with_ros)


def run_driver(
    settings: Settings,
    controllers: Controllers,
    is_over: Flag,
    on_ready: Callable[[str], None],
    record: Path | None = None,
    ros_arguments: Sequence[str] | None = None,
    *,
    with_ros: bool = True,
) -> None:
    """The driver: connect, bring the robot to ready, serve until ``is_over``; leaves the robot without EGM.

    Without ``ros.bringup`` it connects and reads, and changes nothing on the robot until it is asked to.

    Args:
        settings: where the robot is, and how it moves.
        controllers: what runs on each arm.
        is_over: set when it must end.
        on_ready: called when it serves and the robot was brought to ready, with the reason why it is not, or "".
        record: file for every cycle of both arms.
        ros_arguments: for rclpy; None: those of this process.
        with_ros: whether it serves ROS 2, too, beside its local endpoint.

    Raises:
        YumiError: the robot cannot be reached or used; nothing was started.
    """
    clock = SystemClock()

    def log(level: int, sentence: str) -> None:
        front.log(level, sentence)
        endpoint.note(level, sentence)

    failures = Failures()

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
        control.launch()
        stack.callback(control.stop)  # where something fails before it is waited for; else it has ended by then
        front = _with_ros(stack, parts, settings, ros_arguments) if with_ros else DriverWithoutRos(parts, settings)
        stack.callback(front.stop)
        folder, keep = Path(settings.recorder.folder), settings.recorder.keep
        records = Recorder(folder, keep, control.recorders, front.info, clock, manager.monitor.describe)
        stack.callback(records.close)
        if record:
            sources: dict[str, Source] = {STATE: manager.monitor.state}
            sources |= {f"{side.value}/gripper": partial(parts.signals.state, side) for side in Side}
            records.record_all(record, time.time() - clock.now(), sources)

        motions = MotionRegistry(is_script=False)
        endpoint = _endpoint_of(parts, settings, motions, front)
        manager.monitor.log.report = log
        control.start()
        stack.callback(control.stop)
        stack.callback(connection.disconnect)
        stack.callback(_end_motion, manager, control, connection, front.info)
        connected = connection.connect()
        front.start()
        endpoint.start()
        stack.callback(endpoint.stop)
        how = "yumi_robot_manager/set_speed_scale" if with_ros else "yumi speed-scale"
        speed = f"{manager.speed} Change it with {how} or the setting robot.speed_scale."
        for sentence in (connected, control.started_as, *settings.collision.remarks, speed):
            log(logging.INFO, sentence)
        reason = front.bring_up(is_reading_only=not settings.ros.bringup)
        settle_memory()
        on_ready(reason)
        is_over.wait()


def _only_under_name(root: str) -> Only:
    where = f"in the namespace {root}" if root else "without a namespace"
    return Only(
        f"yumi-driver-in-ros-domain-{os.environ.get('ROS_DOMAIN_ID', '0')}{root.replace('/', '.')}",
        f"Another driver runs on this machine in the same ROS domain {where} "
        "({owner}); stop it, or give one of the two another --namespace.",
    )


def _with_ros(
    stack: ExitStack, parts: DriverParts, settings: Settings, ros_arguments: Sequence[str] | None
) -> RosDriver:
    from yumi.ros.driver import RosDriver, close_ros, open_ros  # noqa: PLC0415 - yumi works without ROS
    from yumi.ros.gripper import GripperParts  # noqa: PLC0415

    open_ros(ros_arguments)
    stack.callback(close_ros)
    grippers, plan = GripperParts(parts.grippers, parts.signals, settings.gripper), parts.plan
    return RosDriver(parts.control, plan.controllers, parts.manager, grippers, settings, SystemClock(), plan.limits)


def _endpoint_of(
    parts: DriverParts, settings: Settings, motions: MotionRegistry, front: RosDriver | DriverWithoutRos
) -> EndpointServer:
    """The driver's local endpoint, and what moves the arms for it."""
    control, manager, buffers = parts.control, parts.manager, parts.control.buffers
    motions.explain = manager.monitor.explain
    mover = MotionExecutor(
        control,
        {side: each.goals for side, each in buffers.items()},
        motions,
        tuple(Side),
        parts.plan.limits,
        SystemClock(),
        {side: (each.trajectory, each.dual_trajectory, each.tool_path) for side, each in buffers.items()},
        lambda: manager.speed.in_force,
        {side: each.tool_goals for side, each in buffers.items()},
        {side: each.speeds for side, each in buffers.items()},
        settings.tool_limits.limits,
    )
    access = DriverAccess(
        robot=f"{settings.robot.address}:{settings.robot.rws_port}",
        manager=manager,
        control=control,
        datagram=lambda side: buffers[side].datagram.read(),
        grippers=parts.grippers,
        gripper_state=parts.signals.state,
        force=settings.gripper.force,
        mover=mover,
        recover=manager.recover,
        calibrate=lambda sides, check: manager.calibrate(*(parts.grippers[side] for side in sides), check=check),
        check_arms=front.check_arms,
        on_change=front.update_activity,
        namespace=settings.ros.root,
        surroundings=msgspec.structs.replace(surroundings_of(settings), velocity=mover.limits.velocity),
        joints=manager.monitor.joints,
        on_subscription=manager.monitor.read_joints,
    )
    return EndpointServer(access, front.log)


class DriverWithoutRos:
    """What a driver does beside its local endpoint where it serves no ROS: it logs, and calibrates the grippers.

    Args:
        parts: of the driver.
        settings: of the driver.
    """

    def __init__(self, parts: DriverParts, settings: Settings) -> None:
        manager, own = parts.manager, settings.gripper
        self._parts = parts
        self._is_tested = own.test_at_start
        self._setup = GripperSetup(
            parts.grippers,
            manager.step,
            partial(self.log, logging.ERROR),
            is_allowed=own.calibrate is CalibrateWhen.AT_START,
            is_confirmed=lambda: not manager.is_unattended,
        )
        self._is_over = Flag()
        self._signals = SupervisedThread("grippers", self._keep_signals, self._is_over)
        manager.when_ready(self._setup.run)

    def start(self) -> None:
        """Subscribe to the grippers' signals, again and again should the subscription be lost."""
        self._signals.start()

    def stop(self) -> None:
        self._is_over.set()
        self._signals.join()

    def check_arms(self, sides: Sequence[Side]) -> None:
        """No arm can be deactivated without ROS."""

    def update_activity(self) -> None:
        """There is no topic for it."""

    def on_event(self, event: Event) -> None:
        """Log an event of the control process, with its cause where EGM has ended."""
        if not isinstance(event, ControllerReport):
            level = logging.WARNING if is_fault(event) else logging.INFO
            self._parts.manager.monitor.describe(event, partial(self.log, level))

    def info(self, sentence: str) -> None:
        self.log(logging.INFO, sentence)

    def log(self, level: int, sentence: str) -> None:
        _log.log(level, sentence)

    def bring_up(self, *, is_reading_only: bool = False) -> str:
        """Bring the robot to ready; returns why it is not ready, or nothing."""
        return bring_up(
            self._parts.manager,
            self._setup,
            self._parts.grippers,
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
        if not has_ended.wait(END_REQUESTS):
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
