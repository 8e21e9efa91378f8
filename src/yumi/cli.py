"""The command line: ``yumi demo | up | controller | fault``; every refusal is one sentence and an exit code."""

from __future__ import annotations

import json
import logging
import os
import signal
import sys
from collections.abc import Callable, Sequence
from math import degrees, isnan
from pathlib import Path
from threading import Event as Flag
from threading import Thread
from types import FrameType
from typing import Any

import click

from yumi import __version__
from yumi.cli_bench import bench
from yumi.cli_evaluate import evaluate, tune
from yumi.cli_fault import fault
from yumi.cli_record import record as record_commands
from yumi.errors import MissingPrerequisite, SettingsError, YumiError
from yumi.links.command import READY
from yumi.robot.gripper import TRAVEL, GripperModules
from yumi.robot.joints import Side
from yumi.settings import MAX_PORT, Settings, override, read_controllers, read_settings

_INTERRUPTED = 130
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
        return super().make_context(info_name, _without_ros_arguments(args), *rest, **extra)

    def invoke(self, context: click.Context) -> Any:
        try:
            return super().invoke(context)
        except YumiError as error:
            click.echo(f"Error: {error}", err=True)
            sys.exit(2 if isinstance(error, SettingsError) else 1)


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
@click.option("--user", default="Default User", show_default=True)
@click.option("--password", default="robotics", show_default=True)
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
    password: str,
    until_stdin_closes: bool,
) -> None:
    """Run a virtual IRC5 with a YuMi: true wire, true RAPID; `yumi fault` lets things happen to it.

    \b
    Example:
      yumi controller --rws-port 8080 --left-object 0.02
      curl --digest -u "Default User:robotics" http://127.0.0.1:8080/rw/panel/ctrlstate?json=1
    """
    from yumi.virtual_controller import VirtualController, world_settings  # noqa: PLC0415 - a quick --help

    settings = world_settings(
        robot_name=robot_name,
        egm_host=egm_host,
        egm_ports={Side.LEFT: left_egm_port, Side.RIGHT: right_egm_port},
        objects={Side.LEFT: left_object, Side.RIGHT: right_object},
        grippers={Side.LEFT: GripperModules(left_gripper), Side.RIGHT: GripperModules(right_gripper)},
        leaks={Side.LEFT: left_leak, Side.RIGHT: right_leak},
        are_calibrated=calibrated,
    )
    virtual = VirtualController(settings, rws_port=rws_port, user=user, password=password, host=listen)
    virtual.run(_end_flag(until_stdin_closes), lambda port: _say_ready(f"http://{listen}:{port}"))


@main.command()
@click.option("--robot", help="Address of the controller; 127.0.0.1 for a virtual one on this machine.")
@click.option("--rws-port", type=_PORT, help="HTTP port of its Robot Web Services.")
@click.option("--left-egm-port", type=_PORT, help="UDP port where the left arm's datagrams arrive.")
@click.option("--right-egm-port", type=_PORT, help="UDP port where the right arm's datagrams arrive.")
@click.option("--speed-scale", type=_SCALE, help="Factor on all speeds; else 1 on this machine, 0.1 elsewhere.")
@click.option("--user", help="User name on the controller.")
@click.option("--password", help="Its password.")
@click.option("--config", type=click.Path(path_type=Path), help="Settings instead of the delivered yumi.yaml.")
@click.option(
    "--controllers", type=click.Path(path_type=Path), help="Controllers instead of the delivered controllers.yaml."
)
@click.option("--record", type=click.Path(dir_okay=False, path_type=Path), help="Record every cycle to this MCAP file.")
@click.option(
    "--autostart/--no-autostart", default=None, help="Whether to connect and activate the managed nodes by itself."
)
@_UNTIL
def up(
    config: Path | None, controllers: Path | None, record: Path | None, until_stdin_closes: bool, **options: Any
) -> None:
    """Run the driver: bring the robot to ready and serve ROS 2.

    \b
    Examples:
      yumi up --robot 192.168.125.1
      yumi up --robot 127.0.0.1 --rws-port 8080      with `yumi controller` in another terminal
      ros2 service call /yumi_robot_manager/start_egm std_srvs/srv/Trigger
    """
    _demand_ros()
    from yumi.app import run_driver  # noqa: PLC0415 - a quick --help

    settings = _with_options(read_settings(config), options)
    chosen = {side: read_controllers(side, controllers) for side in Side}
    address = f"{settings.robot.address}:{settings.robot.rws_port}"
    is_over = _end_flag(until_stdin_closes)
    run_driver(settings, chosen, is_over, lambda: _say_ready(f"driving the robot at {address}"), record)


@main.command()
@click.option("--robot", help="Address of a real controller; without it a virtual one is started.")
@click.option("--speed-scale", type=_SCALE, help="Factor on all speeds; else 1 for a virtual robot, 0.1 for another.")
@click.option("--yes", is_flag=True, help="Do not ask before a real robot moves.")
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
    robot: str | None, speed_scale: float | None, yes: bool, picture: Path, report: Path | None, logs: Path
) -> None:
    """Run the dual-arm move-and-grab task, on a virtual YuMi unless told otherwise.

    \b
    Examples:
      yumi demo
      yumi demo --robot 192.168.125.1
    """
    _demand_ros()
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ.setdefault("ROS_LOG_DIR", str(logs.absolute() / "ros"))
    os.environ.setdefault("MPLCONFIGDIR", str(logs.absolute() / "matplotlib"))
    if robot and not yes:
        click.confirm(f"Both arms of the robot at {robot} will move. Is its workspace free?", abort=True)
    from yumi.demo import Cancelled, DemoPlan, run_demo  # noqa: PLC0415 - a quick --help
    from yumi.demo_screen import DemoScreen  # noqa: PLC0415
    from yumi.evaluation.joint_paths import draw_joint_paths  # noqa: PLC0415

    is_over = _end_flag(False)
    with DemoScreen() as screen:
        try:
            options = () if speed_scale is None else ("--speed-scale", str(speed_scale))
            reports = run_demo(DemoPlan(robot, options, logs), screen, is_over.is_set)
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


main.add_command(bench)
main.add_command(fault)
main.add_command(evaluate)
main.add_command(tune)
main.add_command(record_commands)


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
        "ros": {"autostart": "autostart"},
    }
    values = {
        group: {name: given[option] for option, name in entries.items() if option in given}
        for group, entries in names.items()
    }
    return override(settings, values, "command line")


def _without_ros_arguments(arguments: Sequence[str]) -> list[str]:
    """``arguments`` less what stands from ``--ros-args`` to ``--`` or to the end; rclpy reads that by itself."""
    kept: list[str] = []
    is_ours = True
    for argument in arguments:
        if argument == "--ros-args":
            is_ours = False
        elif is_ours:
            kept.append(argument)
        elif argument == "--":
            is_ours = True
    return kept


def _say_ready(what: str) -> None:
    click.echo(f"{READY}: {what}")


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
    while os.read(sys.stdin.fileno(), 4096):
        continue
    then()
