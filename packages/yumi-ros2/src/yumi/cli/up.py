"""The driver as a program, and what shows its robot: ``yumi up``, ``yumi view`` and ``yumi record``.

``up`` connects, brings the robot to ready, and serves ROS until it must end. ``view`` shows a running driver's robot in
the browser, or a recording. ``record`` shows and exports the recordings and flight records that a driver writes.
"""

from __future__ import annotations

import json
import logging
import os
import secrets
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
from abb_protocols.errors import NoConnection, ProtocolError, RobotNotReady, SettingsError, YumiError
from abb_protocols.robot.joints import Side
from abb_runtime.clock import SystemClock
from abb_runtime.options import (
    FILE,
    FOLDER,
    NEW_FILE,
    TIME,
    JsonOutput,
    arm_option,
    egm_port_options,
    end_flag,
    https_option,
    json_option,
    listen_option,
    logs_option,
    page_port_option,
    picture_option,
    robot_option,
    speed_scale_option,
    until_stdin_closes_option,
)
from abb_runtime.process.command_process import DRIVER_READY, DRIVER_RUNNING, CommandProcess
from abb_runtime.process.realtime import release_process, settle_memory, short_switch_interval
from abb_runtime.process.single_instance import SingleInstance
from abb_runtime.process.supervision import Failures, SupervisedThread, start_thread
from abb_runtime.rws.client import RwsClient
from abb_runtime.rws.login import password_of_environment
from abb_runtime.udp import address_of_host, free_port, is_loopback
from yumi.api.connection import commanded_robot, motion_executor, recorded_sources
from yumi.api.motion_registry import MotionRegistry
from yumi.cli.driver_options import (
    ROS_ARGUMENTS,
    bringup_option,
    config_option,
    demand_ros,
    limit_discovery,
    robot_options,
    settings_of,
)
from yumi.control.loop_commands import Commands
from yumi.control.loop_events import Event, is_logged, is_warning
from yumi.control.speed_scale import FULL
from yumi.driver.command import CommandedRobot
from yumi.driver.control_process import ControlProcess
from yumi.driver.endpoint import find_driver
from yumi.driver.endpoint_server import EndpointServer
from yumi.driver.gripper import GripperSetup
from yumi.driver.robot_connection import RobotConnection
from yumi.driver.robot_manager import RobotManager, bring_up
from yumi.driver.settings import CalibrateWhen, RobotSettings, Settings, read_controllers, read_settings
from yumi.driver.wiring import Controllers, DriverParts, brings_up, check_kind, make_parts, only_at_robot
from yumi.recording.reader import read_recording
from yumi.recording.recorder import Recorder

if TYPE_CHECKING:
    from yumi.recording.tables import TableName
    from yumi.ros.ros_driver import RosDriver

_log = logging.getLogger("yumi")

END_REQUESTS = 3.0
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
    type=TIME,
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
@click.option("--record", type=NEW_FILE, help="Record every cycle to this MCAP file.")
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
    address = f"{settings.robot.address}:{settings.robot.rws_port}"
    is_over = end_flag(until_stdin_closes)
    end_by_force(is_over)

    def report_ready(reason: Message | None) -> None:
        if reason is not None:
            click.echo(f"{DRIVER_RUNNING}{message('not_ready_yet', reason=reason)}")
        else:
            click.echo(f"{DRIVER_READY}serving the robot at {address}")

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
    address, end, is_reported = f"{robot.address}:{robot.rws_port}", time.monotonic() + timeout, False
    while not is_over.is_set():
        client = RwsClient(address, user=robot.user, password=robot.password, timeout=robot.timeout)
        try:
            client.connect()
            return True
        except NoConnection:
            if time.monotonic() >= end:
                raise
        finally:
            client.close()
        if not is_reported:
            click.echo(f"Waiting up to {timeout:g} s for a controller at {address}.")
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
        check_kind(manager, parts.client, settings)
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
        reason = front.bring_up(is_reading_only=not brings_up(settings, is_real=manager.is_real))
        settle_memory()
        on_ready(reason)
        is_over.wait()


def _speed_line(manager: RobotManager, *, with_ros: bool) -> tuple[int, str]:
    """How fast the robot may move and how to change that, and the level of the line: who has all speeds needs none."""
    how = "yumi_robot_manager/set_speed_scale" if with_ros else "yumi speed-scale"
    level = logging.INFO if manager.speed.in_force < FULL else logging.DEBUG
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
        manager, own = parts.manager, settings.gripper
        self._parts = parts
        self._is_tested = own.test_at_start
        self._setup = GripperSetup(
            parts.grippers,
            manager.step,
            lambda said: self.log(logging.ERROR, str(said)),
            is_allowed=own.calibrate is CalibrateWhen.AT_START,
            is_named=lambda: manager.may_calibrate,
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


# ---- yumi view

_READY_TIMEOUT = 60.0  # [s] for a driver or a virtual robot that `yumi view` starts


@click.command()
@click.argument("recording", required=False, type=FILE)
@robot_option()
@click.option("--virtual", is_flag=True, help="Start a virtual robot with a driver, and show that one.")
@click.option("--operate", is_flag=True, help="Let a page operate a real robot; a virtual one it may.")
@https_option
@page_port_option
@listen_option
@logs_option("build/view")
@config_option
@until_stdin_closes_option
def view(
    recording: Path | None,
    robot: str | None,
    virtual: bool,
    operate: bool,
    https: bool,
    port: int,
    listen: str,
    logs: Path,
    config: Path | None,
    until_stdin_closes: bool,
) -> None:
    """Show the robot, or a recording, in the browser.

    Open the address that is printed. Where no driver of the robot that --robot names runs, one is started, with
    --config if it is given. A page only looks until a person takes control there. A real robot is operated with
    --operate, by a page with the token: on this machine, or with --https and --listen on another one, once a person
    has typed there the code that is printed here.
    A controller without the state machine of this package, or of another robot, is shown by what it reports: joints,
    RAPID tasks with their program pointers, and its log.

    \b
    Examples:
      yumi view                          the robot of the running driver
      yumi view --virtual                a virtual robot to try
      yumi view --robot 192.168.125.1    a driver that only reads is started
      yumi view --robot 127.0.0.1:8080   any program of `yumi controller`
      yumi view session.mcap             a recording or flight record
      yumi view --operate --https --listen 192.168.1.20   for a headset
    """
    from abb_view.controller_server import ControllerServer  # noqa: PLC0415 - a quick --help
    from abb_view.page_build import CONTROLLER_PAGE, page_folder  # noqa: PLC0415
    from abb_view.page_server import PageSettings, page_tls, serve_pages  # noqa: PLC0415
    from yumi.web.page_build import ROBOT_PAGE  # noqa: PLC0415
    from yumi.web.page_recording import page_recording  # noqa: PLC0415
    from yumi.web.page_words import PROGRAM  # noqa: PLC0415
    from yumi.web.view_only import open_controller, reopen_controller  # noqa: PLC0415
    from yumi.web.view_server import ViewServer, ViewSettings  # noqa: PLC0415

    robot = robot or ""
    if recording is not None and (robot or virtual or operate):
        raise SettingsError(message("recording_shown_alone"))
    if virtual and robot:
        raise SettingsError(message("virtual_starts_a_robot"))
    if config is not None and not (virtual or robot):
        raise SettingsError(message("config_without_driver"))
    is_over = end_flag(until_stdin_closes)
    page_folder(ROBOT_PAGE, click.echo)  # before a robot is started for a page that cannot be built
    own = () if config is None else ("--config", str(config))
    with ExitStack() as stack:
        if virtual:
            robot = stack.enter_context(_started_virtual_robot(logs, is_over, own))
        elif robot and _has_driver(robot):
            if config is not None:
                raise SettingsError(message("driver_of_robot_runs", robot=robot))
        elif robot and not operate and (controller := open_controller(_robot_at(robot, config))) is not None:
            stack.callback(controller.close)
            click.echo("View only, since no driver can run for this controller:")
            for sentence in controller.message().missing:
                click.echo(f"  {sentence}")
            page_folder(CONTROLLER_PAGE, click.echo)
            shown = PageSettings(
                host=listen,
                port=port,
                tls=page_tls(listen, "yumi-ros2", click.echo) if https else None,
                token="" if is_loopback(listen) else secrets.token_urlsafe(18),
            )
            reopen = partial(reopen_controller, _robot_at(robot, config))
            serve_pages(ControllerServer(shown, PROGRAM, controller, reopen), is_over, click.echo)
            return
        elif robot:
            click.echo(f"No driver of {robot} runs; one is started" + ("." if operate else ", which only reads."))
            stack.enter_context(_started_driver(robot, logs, is_over, (*own, *(() if operate else ("--no-bringup",)))))
        may_operate = operate and not virtual  # a virtual robot is operated anyway
        settings = ViewSettings(
            robot=robot,
            host=listen,
            port=port,
            may_operate=may_operate,
            tls=page_tls(listen, "yumi-ros2", click.echo) if https else None,
            show_code=lambda code: click.echo(f"Code for a page on another machine, for one page: {code}"),
            token=secrets.token_urlsafe(18) if may_operate or not is_loopback(listen) else "",
            recording=None if recording is None else page_recording(recording),
        )
        serve_pages(ViewServer(settings), is_over, click.echo)


def _has_driver(robot: str) -> bool:
    try:
        find_driver(robot)
    except RobotNotReady:
        return False
    return True


def _robot_at(robot: str, config: Path | None) -> RobotSettings:
    """Where the controller at host or host:port is, and who logs in."""
    return settings_of(config, {"robot": robot, "password": password_of_environment()}).robot


@contextmanager
def _started_driver(robot: str, logs: Path, is_over: Flag, options: tuple[str, ...]) -> Iterator[None]:
    """A driver without ROS in a process of its own: the page must not disturb the control loop."""
    with _started("driver", ("up", "--robot", robot, "--no-ros", *options), logs, is_over):
        yield


@contextmanager
def _started_virtual_robot(logs: Path, is_over: Flag, options: tuple[str, ...]) -> Iterator[str]:
    """A virtual controller and its driver; the address of the robot."""
    ports = ("--left-egm-port", str(free_port()), "--right-egm-port", str(free_port()))
    arguments = ("controller", "--rws-port", "0", *ports)
    with _started("virtual controller", arguments, logs, is_over) as address:
        robot = address.rpartition("/")[2]
        with _started_driver(robot, logs, is_over, (*ports, *options)):
            yield robot


@contextmanager
def _started(name: str, arguments: tuple[str, ...], logs: Path, is_over: Flag) -> Iterator[str]:
    """A command of yumi in a process of its own, once it serves; what it says of where it serves."""

    def check() -> None:
        if is_over.is_set():
            raise RobotNotReady(message("ended_before_ready", program=name))

    def show(line: str) -> None:
        click.echo(line, err=True)

    logs.mkdir(parents=True, exist_ok=True)
    command: Any = CommandProcess(name, "yumi", arguments, logs / f"{name.replace(' ', '_')}.log")
    with command:
        yield command.wait_until_ready(_READY_TIMEOUT, check, show)


# ---- yumi record


@click.group()
def record() -> None:
    """Look at flight records and recordings.

    They can be exported, too.

    \b
    Examples:
      yumi record list
      yumi record show FILE
      yumi up --record session.mcap     records every cycle of both arms
      yumi record export session.mcap session.csv
    """


@record.command("show")
@click.argument("file", type=FILE)
@click.option("--cycles", type=click.IntRange(1), default=20, show_default=True, help="Number of cycles.")
@arm_option("the one that stopped")
@picture_option("none is drawn")
@json_option
def show_record(file: Path, cycles: int, arm: str | None, picture: Path | None, json_output: JsonOutput) -> None:
    """Show what led to the event that stopped the motion.

    --cycles is how many the table has.

    \b
    Examples:
      yumi record show FILE --cycles 50
      yumi record show FILE --arm left --picture stop.png
    """
    from rich.console import Console  # noqa: PLC0415 - a quick --help

    from yumi.recording.tables import draw_recording, recording_document, recording_table  # noqa: PLC0415

    recording = read_recording(file)
    side = next((side for side in Side if side.word == arm), recording.arm)
    json_output.write(json.dumps(recording_document(recording, side, cycles)))
    if not json_output.is_printed:
        console = Console(soft_wrap=False)
        console.print(recording_table(recording, side, cycles, console.width))
    if picture:
        draw_recording(recording, side, picture)
        click.echo(f"Picture: {picture}", err=json_output.is_printed)


@record.command("export")
@click.argument("file", type=FILE)
@click.argument("output", type=click.Path(dir_okay=False, path_type=Path))
@click.option(
    "--table",
    type=click.Choice(["cycles", "events", "grippers", "state"]),
    default="cycles",
    show_default=True,
    help="Which table of the recording.",
)
def export_record(file: Path, output: Path, table: TableName) -> None:
    """Write a table of a recording as CSV or Parquet.

    The ending of OUTPUT says which.

    \b
    Examples:
      yumi record export FILE session.csv
      yumi record export FILE events.csv --table events
      yumi record export FILE session.parquet     with yumi-ros2[data]
    """
    from yumi.recording.tables import export  # noqa: PLC0415 - a quick --help

    click.echo(f"{export(file, output, table)} rows: {output}")


@record.command("list")
@click.option("--folder", type=FOLDER, show_default="as in the settings", help="Where they are.")
@json_option
def list_records(folder: Path | None, json_output: JsonOutput) -> None:
    """List flight records with what stopped the motion.

    \b
    Example:
      yumi record list --folder build/flight_records
    """
    folder = folder or Path(read_settings().recorder.folder)
    files = sorted(folder.glob("*.mcap"))
    if not files and not json_output.is_printed:
        click.echo(f"There are no records in {folder}.")
    damaged = 0
    stops: list[dict[str, str | None]] = []
    for file in files:
        try:
            stop = read_recording(file, before=0.0).stop
        except ProtocolError as error:  # one that was cut off must not hide the others
            damaged += 1
            click.echo(f"{error}", err=True)
            continue
        stops.append({"file": str(file), "stop": stop.sentence if stop else None})
        if not json_output.is_printed:
            click.echo(f"{file}  {stop.sentence if stop else 'nothing stopped a motion'}")
    json_output.write(json.dumps(stops))
    if damaged:
        raise ProtocolError(message("records_unreadable", damaged=damaged, count=len(files), folder=str(folder)))
