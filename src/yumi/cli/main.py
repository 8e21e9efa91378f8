"""The command line: ``yumi demo | up | doctor | controller | fault``; a refusal is one sentence and an exit code."""

from __future__ import annotations

import errno
import json
import logging
import os
import re
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib.metadata import entry_points
from math import degrees, isnan, radians
from pathlib import Path
from threading import Event as Flag
from threading import Thread
from types import FrameType
from typing import Any

import click

from yumi import __version__
from yumi.cli.doctor import doctor
from yumi.cli.fault import fault
from yumi.cli.options import limit_discovery, password_options
from yumi.cli.record import record as record_commands
from yumi.driver.settings import (
    MAX_PORT,
    PASSWORD_VARIABLE,
    RobotSettings,
    Settings,
    override,
    read_controllers,
    read_settings,
)
from yumi.errors import CommandRefused, MissingPrerequisite, SettingsError, YumiError
from yumi.process.child import CONTROLLER_READY, DRIVER_READY, DRIVER_RUNNING
from yumi.robot.gripper import TRAVEL, GripperModules
from yumi.robot.joints import Side

_INTERRUPTED = 130
_ROS_ARGUMENTS = "yumi.ros_arguments"
_NAMES_ALL_NODES = re.compile(r"(?:[^:]*:)?__(?:ns|node|name):=")
"""A rule of rcl's remapping that gives nodes another namespace or name."""

_EXHAUSTED = (errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.ENOSPC, errno.EAGAIN)
_UNTIL = click.option("--until-stdin-closes", is_flag=True, help="End when standard input does (for a parent process).")


class _Measure(click.FloatRange):
    """A number with a range; "nan", which no range refuses, is none."""

    def __init__(self, noun: str, lowest: float, highest: float, *, is_open: bool) -> None:
        super().__init__(lowest, highest, min_open=is_open)
        self._noun = noun

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        if isnan(number):
            self.fail(f"{value!r} is not a {self._noun}.", param, ctx)
        return number


_PORT = click.IntRange(1, MAX_PORT)
_WIDTH = _Measure("width", 0.0, 2.0 * TRAVEL, is_open=True)
_LEAK = _Measure("leak", 0.0, 1.0, is_open=False)
_SCALE = _Measure("factor", 0.01, 1.0, is_open=False)
_MODULES = click.Choice([modules.value for modules in GripperModules])


class _Commands(click.Group):
    """Turns our errors into one sentence and exit code 1 (2 for wrong settings); leaves ROS's arguments to ROS."""

    def make_context(self, info_name: str | None, args: list[str], *rest: Any, **extra: Any) -> click.Context:
        own, ros = _split_ros_arguments(args)
        context = super().make_context(info_name, own, *rest, **extra)
        context.meta[_ROS_ARGUMENTS] = ros
        return context

    def invoke(self, context: click.Context) -> Any:
        try:
            _refuse_other_names(context.meta[_ROS_ARGUMENTS])
            return super().invoke(context)
        except YumiError as error:
            click.echo(f"Error: {error}", err=True)
            sys.exit(2 if isinstance(error, SettingsError) else 1)
        except (OSError, MemoryError) as error:
            if isinstance(error, OSError) and error.errno not in _EXHAUSTED:
                raise
            click.echo(
                f"Error: this machine gives the program too little: {str(error) or 'no memory'}; see its limits "
                "(ulimit -a) and that no disk is full (df).",
                err=True,
            )
            sys.exit(1)


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="yumi")
def main() -> None:
    """Drive an ABB YuMi from ROS 2, or a virtual one.

    \b
    Examples:
      yumi demo                          both arms of a virtual YuMi move and grab
      yumi up --robot 192.168.125.1      the driver for a real one
      yumi controller --rws-port 8080    a virtual controller for any client
    """
    logging.basicConfig(level=logging.INFO, format="%(levelname)s %(name)s: %(message)s")
    for noisy in ("httpx", "matplotlib"):
        logging.getLogger(noisy).setLevel(logging.WARNING)


@main.command()
@click.option(
    "--rws-port",
    type=click.IntRange(0, MAX_PORT),
    default=8080,
    show_default=True,
    help="HTTP port of Robot Web Services; 0 takes a free one.",
)
@click.option("--listen", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option("--robot-name", default="Virtual_YuMi", show_default=True, help="Name of the controller's system.")
@click.option("--egm-host", default="127.0.0.1", show_default=True, help="Where the driver is: EGM goes there.")
@click.option(
    "--left-egm-port", type=_PORT, default=6511, show_default=True, help="The driver's UDP port for the left arm."
)
@click.option(
    "--right-egm-port", type=_PORT, default=6512, show_default=True, help="The driver's UDP port for the right arm."
)
@click.option("--left-object", type=_WIDTH, help="Width of an object between the left fingers [m].")
@click.option("--right-object", type=_WIDTH, help="Width of an object between the right fingers [m].")
@click.option(
    "--left-gripper", type=_MODULES, default="servo", show_default=True, help="What the left hand is made of."
)
@click.option("--right-gripper", type=_MODULES, default="servo", show_default=True, help="And the right hand.")
@click.option("--left-leak", type=_LEAK, help="An object lies under the left hand's cups; 0 is tight, 1 as if none.")
@click.option("--right-leak", type=_LEAK, help="And under the right hand's.")
@click.option("--calibrated", is_flag=True, help="Somebody has calibrated the hands already.")
@click.option("--user", default="Default User", show_default=True, help="User that may log in.")
@password_options
@_UNTIL
def controller(
    rws_port: int,
    listen: str,
    robot_name: str,
    egm_host: str,
    left_egm_port: int,
    right_egm_port: int,
    left_object: float | None,
    right_object: float | None,
    left_gripper: str,
    right_gripper: str,
    left_leak: float | None,
    right_leak: float | None,
    calibrated: bool,
    user: str,
    password: str | None,
    until_stdin_closes: bool,
) -> None:
    """Run a virtual IRC5 with a YuMi: true wire, true RAPID; `yumi fault` lets things happen to it.

    Its password is "robotics", as of a new controller, unless a file, a prompt or YUMI_PASSWORD gives another.

    \b
    Example:
      yumi controller --rws-port 8080 --left-object 0.02
      curl --digest -u "Default User:robotics" http://127.0.0.1:8080/rw/panel/ctrlstate?json=1
    """
    from yumi.virtual.server import VirtualController, world_settings  # noqa: PLC0415 - a quick --help

    settings = world_settings(
        robot_name=robot_name,
        egm_host=egm_host,
        egm_ports={Side.LEFT: left_egm_port, Side.RIGHT: right_egm_port},
        objects={Side.LEFT: left_object, Side.RIGHT: right_object},
        grippers={Side.LEFT: GripperModules(left_gripper), Side.RIGHT: GripperModules(right_gripper)},
        leaks={Side.LEFT: left_leak, Side.RIGHT: right_leak},
        are_calibrated=calibrated,
    )
    chosen = password or RobotSettings().password
    virtual = VirtualController(settings, rws_port=rws_port, user=user, password=chosen, host=listen)
    is_over = _end_flag(until_stdin_closes)
    virtual.run(is_over, lambda port: click.echo(f"{CONTROLLER_READY}http://{listen}:{port}"))


@main.command()
@click.option("--robot", help="Address of the controller; 127.0.0.1 for a virtual one on this machine.")
@click.option("--rws-port", type=_PORT, help="HTTP port of its Robot Web Services.")
@click.option("--left-egm-port", type=_PORT, help="UDP port where the left arm's datagrams arrive.")
@click.option("--right-egm-port", type=_PORT, help="UDP port where the right arm's datagrams arrive.")
@click.option("--speed-scale", type=_SCALE, help="Factor on all speeds; else 1 on this machine, 0.1 elsewhere.")
@click.option("--user", help="User name on the controller.")
@password_options
@click.option("--config", type=click.Path(path_type=Path), help="Settings instead of the delivered yumi.yaml.")
@click.option(
    "--controllers", type=click.Path(path_type=Path), help="Controllers instead of the delivered controllers.yaml."
)
@click.option("--record", type=click.Path(dir_okay=False, path_type=Path), help="Record every cycle to this MCAP file.")
@click.option(
    "--bringup/--no-bringup",
    default=None,
    help="Bring the robot to ready at start: motors on, RAPID started, grippers calibrated. Without, the driver "
    "connects and only reads until start_egm, set_mode or recover is called.",
)
@click.option("--network", is_flag=True, help="Let all machines of the subnet find the driver's ROS 2 nodes.")
@_UNTIL
def up(
    config: Path | None,
    controllers: Path | None,
    record: Path | None,
    network: bool,
    until_stdin_closes: bool,
    **options: Any,
) -> None:
    """Run the driver: bring the robot to ready and serve ROS 2.

    It says what it will do to the robot before it does it.

    \b
    Examples:
      yumi up --robot 192.168.125.1
      yumi up --robot 127.0.0.1 --rws-port 8080      with `yumi controller` in another terminal
      yumi up --robot 192.168.125.1 --no-bringup     changes nothing on the robot until it is asked to
      ros2 service call /yumi_robot_manager/start_egm std_srvs/srv/Trigger
    """
    _demand_ros()
    click.echo(limit_discovery(is_open=network))
    from yumi.cli.up import end_by_force, run_driver  # noqa: PLC0415 - a quick --help

    settings = _with_options(read_settings(config), options)
    chosen = {side: read_controllers(side, controllers) for side in Side}
    address = f"{settings.robot.address}:{settings.robot.rws_port}"
    is_over = _end_flag(until_stdin_closes)
    end_by_force(is_over)

    def report_ready(reason: str) -> None:
        if reason:
            click.echo(f"{DRIVER_RUNNING}{reason} When that is done, call recover.")
        else:
            click.echo(f"{DRIVER_READY}serving the robot at {address}")

    run_driver(settings, chosen, is_over, report_ready, record)


@main.command()
@click.option("--robot", help="Address of a real controller; without it a virtual one is started.")
@click.option("--rws-port", type=_PORT, help="HTTP port of its Robot Web Services.")
@click.option("--left-egm-port", type=_PORT, help="UDP port where its left arm's datagrams arrive.")
@click.option("--right-egm-port", type=_PORT, help="UDP port where its right arm's datagrams arrive.")
@click.option("--user", help="User name on it.")
@password_options
@click.option("--speed-scale", type=_SCALE, help="Factor on all speeds; else 1 for a virtual robot, 0.1 for another.")
@click.option("--yes", is_flag=True, help="Ask nobody: a robot given by --robot moves, a stop ends the demonstration.")
@click.option(
    "--picture",
    type=click.Path(path_type=Path),
    default=Path("demo_joint_paths.png"),
    show_default=True,
    help="Where the picture of the joint paths goes.",
)
@click.option("--json", "report", type=click.Path(path_type=Path), help="Also write the final figures to this file.")
@click.option(
    "--logs",
    type=click.Path(path_type=Path),
    default=Path("build/demo"),
    show_default=True,
    help="Folder for the output of driver and controller.",
)
def demo(
    robot: str | None,
    password: str | None,
    speed_scale: float | None,
    yes: bool,
    picture: Path,
    report: Path | None,
    logs: Path,
    **where: str | int | None,
) -> None:
    """Run the dual-arm move-and-grab task, on a virtual YuMi unless told otherwise.

    After a stop it says what happened and goes on only when a person types yes; without a terminal, or with --yes, it
    ends.

    \b
    Examples:
      yumi demo
      yumi demo --robot 192.168.125.1
      yumi demo --robot 127.0.0.1 --rws-port 8080      rehearses that with `yumi controller` in another terminal
    """
    options = tuple(
        text
        for name, value in where.items()
        if value is not None
        for text in (f"--{name.replace('_', '-')}", str(value))
    )
    if options and robot is None:
        raise CommandRefused(f"{options[0]} is about a robot that runs already; name it with --robot.")
    _demand_ros()
    limit_discovery()
    os.environ.setdefault("ROS_LOG_DIR", str(logs.absolute() / "ros"))
    os.environ.setdefault("MPLCONFIGDIR", str(logs.absolute() / "matplotlib"))
    if speed_scale is not None:
        options = (*options, "--speed-scale", str(speed_scale))
    from yumi.cli.demo import (  # noqa: PLC0415 - a quick --help
        Cancelled,
        DemoPlan,
        DemoScreen,
        motions_ahead,
        read_positions,
        run_demo,
    )
    from yumi.driver.wiring import first_speed_scale  # noqa: PLC0415 - a quick --help
    from yumi.recording.pictures import draw_joint_paths  # noqa: PLC0415

    if robot:
        given = {"robot": robot, "password": password, "speed_scale": speed_scale, **where}
        settings = _with_options(read_settings(None), given)
        top_speed = radians(settings.egm_motion.max_speed_deviation)
        click.echo(motions_ahead(read_positions(settings.robot), top_speed, first_speed_scale(settings)))
        if not yes:
            click.confirm(f"This moves the robot at {robot}. Is its workspace free?", abort=True)
    is_over = _end_flag(False)
    with DemoScreen() as screen:
        confirm = (lambda *_: False) if yes else screen.confirm
        try:
            secrets = {PASSWORD_VARIABLE: password} if password else {}
            reports = run_demo(DemoPlan(robot, options, logs, secrets), screen, is_over.is_set, confirm)
        except Cancelled:
            screen.note("cancelled: motion stopped, EGM ended")
            sys.exit(_INTERRUPTED)
    screen.table(reports)
    draw_joint_paths({side: item.path for side, item in reports.items()}, picture)
    if report:
        figures = {
            side.word: {
                "duration_s": item.duration,
                "final_error_deg": degrees(item.final_error),
                "missed_cycles": item.missed,
                "grip": item.grip.word if item.grip else None,
            }
            for side, item in reports.items()
        }
        report.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
    click.echo(f"Picture of the joint paths: {picture}")
    click.echo("Task completed")


main.add_command(doctor)
main.add_command(fault)
main.add_command(record_commands)
for _command in entry_points(group="yumi.commands"):
    main.add_command(_command.load())


def _with_options(settings: Settings, options: dict[str, Any]) -> Settings:
    """Settings with what the command line says on top."""
    given = {key: value for key, value in options.items() if value is not None}
    names = {
        "robot": {
            "robot": "address",
            "rws_port": "rws_port",
            "user": "user",
            "password": "password",
            "speed_scale": "speed_scale",
        },
        "egm": {"left_egm_port": "left_port", "right_egm_port": "right_port"},
        "ros": {"bringup": "bringup"},
    }
    values = {
        group: {name: given[option] for option, name in entries.items() if option in given}
        for group, entries in names.items()
    }
    return override(settings, values, "command line")


def _split_ros_arguments(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Our arguments, and those from ``--ros-args`` to ``--`` or to the end, which rclpy reads by itself."""
    own: list[str] = []
    ros: list[str] = []
    is_ours = True
    for argument in arguments:
        if argument == "--ros-args":
            is_ours = False
        elif is_ours:
            own.append(argument)
        elif argument == "--":
            is_ours = True
        else:
            ros.append(argument)
    return own, ros


def _refuse_other_names(ros_arguments: Sequence[str]) -> None:
    """Refuse what would give the nodes of both arms one name: rcl puts it in the place of ``r`` and ``l``.

    Raises:
        SettingsError: there is such a rule; a launch file's namespace is one, too.
    """
    for rule in ros_arguments:
        if _NAMES_ALL_NODES.match(rule):
            raise SettingsError(
                f"{rule!r} would merge both arms, whose nodes are told apart by the namespaces r and l; start without "
                "it, and give each robot a ROS_DOMAIN_ID of its own."
            )


def _demand_ros() -> None:
    try:
        import control_msgs  # noqa: F401, PLC0415
        import rclpy  # noqa: F401, PLC0415
    except ImportError as error:
        raise MissingPrerequisite(
            f"ROS 2 is missing ({error}); run `make setup` in a clone of yumi-ros2, or source your ROS 2 Jazzy."
        ) from error


def _end_flag(until_stdin_closes: bool) -> Flag:
    """A flag that Ctrl-C, a termination request, a closed terminal or the end of standard input sets."""
    is_over = Flag()

    def end(number: int, frame: FrameType | None) -> None:
        is_over.set()

    for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(each, end)
    if until_stdin_closes:
        Thread(target=_wait_for_end_of_input, args=(is_over.set,), name="stdin", daemon=True).start()
    return is_over


def _wait_for_end_of_input(then: Callable[[], None]) -> None:
    with suppress(OSError):  # what cannot be read has ended
        while os.read(sys.stdin.fileno(), 4096):
            continue
    then()
