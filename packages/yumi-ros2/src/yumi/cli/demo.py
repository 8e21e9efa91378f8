"""``yumi demo``: virtual controller, driver and move-and-grab application, and what a person sees of them."""

from __future__ import annotations

import json
import os
import sys
import termios
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from importlib import import_module
from importlib.util import find_spec
from math import degrees, radians
from pathlib import Path
from select import select
from typing import TYPE_CHECKING

import click
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, TaskID, TextColumn
from rich.progress import Progress as ProgressBars
from rich.table import Table

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, RobotNotReady, YumiError, missing_extra
from abb_protocols.robot.joints import YUMI_LIMITS, Joints, Side, joint_names
from abb_runtime.options import (
    STARTED_HELP,
    JsonOutput,
    egm_port_options,
    end_flag,
    json_option,
    logs_option,
    picture_option,
    speed_scale_option,
    yes_option,
)
from abb_runtime.process.command_process import CommandProcess
from abb_runtime.rws.login import PASSWORD_VARIABLE
from abb_runtime.udp import free_port
from yumi.cli.driver_options import demand_ros, limit_discovery, robot_options, settings_of
from yumi.driver.bringup import BRINGUP_ANNOUNCEMENT
from yumi.driver.settings import RobotSettings, read_settings

if TYPE_CHECKING:
    from yumi.ros.move_and_grab import MoveAndGrabArmReport, MoveAndGrabProgress

_INTERRUPTED = 130
_PICTURE = Path("demo_joint_paths.png")
_OBJECT_WIDTH = 0.020
"""What lies between the left fingers of the virtual robot [m]."""

_READY_TIMEOUT = 60.0
_REAL = (
    "Look at the robot: is what stopped it gone, is its way free of people and things, is what an arm touched freed? "
    "The motors are switched on and the motion goes on to the same goals."
)
_VIRTUAL = "This robot is virtual: nothing can be hit. The motion goes on to the same goals."


@dataclass(frozen=True, slots=True)
class DemoPlan:
    """What the demonstration runs on.

    Attributes:
        robot: address of a real controller; None brings a virtual one.
        options: further options for the driver, e.g. a settings file.
        logs: folder for the processes' output.
        secrets: environment variables for the driver and the virtual controller: the password.
    """

    robot: str | None
    options: tuple[str, ...]
    logs: Path
    secrets: Mapping[str, str] = field(default_factory=dict, repr=False)


def _can_draw(*, is_asked: bool) -> bool:
    """Whether there can be a picture; raises MissingPrerequisite where there cannot and it was asked for."""
    can_draw = find_spec("matplotlib") is not None
    if is_asked and not can_draw:
        raise missing_extra(message("picture_needs_matplotlib"), "yumi-ros2", "plot")
    if not can_draw:
        click.echo(missing_extra(message("no_picture_without_matplotlib"), "yumi-ros2", "plot"), err=True)
    return can_draw


class Cancelled(Exception):
    """A person has ended the demonstration."""


_Confirm = Callable[[str, Callable[[], None]], bool]
"""Asks a person on the terminal, and calls a check again and again while it waits; False without a terminal."""


def run_demo(
    plan: DemoPlan,
    progress: MoveAndGrabProgress,
    is_cancelled: Callable[[], bool],
    confirm: _Confirm = lambda *_: False,
) -> Mapping[Side, MoveAndGrabArmReport]:
    """Run the task from start to end; on any way out motion is stopped and every process has ended.

    Args:
        plan: what it runs on.
        progress: shows the steps.
        is_cancelled: whether it must end.
        confirm: asked whether the robot may go on after a stop.

    Raises:
        YumiError: a step failed; the message says which.
        Cancelled: it was ended.
    """

    def check() -> None:
        if is_cancelled():
            raise Cancelled

    def check_driver() -> None:
        check()
        if driver.exit_code is not None:
            raise RobotNotReady(message("driver_program_ended", exit_code=driver.exit_code, log=str(driver.log)))

    def ask(sentence: str) -> bool:
        return confirm(f"{sentence}\n{_REAL if plan.robot else _VIRTUAL}", check_driver)

    def show_announcement(line: str) -> None:
        """Of the driver's log, a person at the terminal must see what the driver will do to the robot."""
        _, announces, steps = line.partition(BRINGUP_ANNOUNCEMENT)
        if announces:
            progress.note(f"{BRINGUP_ANNOUNCEMENT}{steps}")

    plan.logs.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        where: tuple[str, ...] = ("--robot", plan.robot or "")
        if not plan.robot:
            progress.step("start the virtual controller")
            ports = ("--left-egm-port", str(free_port()), "--right-egm-port", str(free_port()))
            arguments = ("controller", "--rws-port", "0", "--left-object", str(_OBJECT_WIDTH), *ports)
            controller = CommandProcess(
                "virtual controller", "yumi", arguments, plan.logs / "controller.log", plan.secrets
            )
            stack.enter_context(controller)
            import_module("yumi.ros.move_and_grab")  # takes a second, as the start of the controller does
            address = controller.wait_until_ready(_READY_TIMEOUT, check)
            progress.note(address)
            where = ("--robot", address.removeprefix("http://"), *ports)
        progress.step("start the driver")
        command = CommandProcess(
            "driver", "yumi", ("up", *where, *plan.options), plan.logs / "driver.log", plan.secrets
        )
        driver = stack.enter_context(command)
        progress.note(driver.wait_until_ready(_READY_TIMEOUT, check, show_announcement))
        approaches = not plan.robot and read_settings().collision.enabled  # as the driver's own
        return _run_application(progress, check_driver, ask, approaches=approaches)


def motions_ahead(start: Mapping[Side, Joints], top_speed: float, speed_scale: float = 1.0) -> str:
    """What the demonstration will do to a robot, for a person who decides whether it may.

    Args:
        start: where the arms stand, chain order [rad].
        top_speed: highest speed that a joint is given at a speed scale of 1 [rad/s].
        speed_scale: share of all speeds.
    """
    from yumi.ros.move_and_grab import GRAB_GOALS, GRAB_LIFT, LIFTING_ARM  # noqa: PLC0415 - the command line works without ROS

    def in_degrees(position: Joints) -> str:
        return ", ".join(f"{degrees(value):.1f}" for value in position) + "° (axes 1, 2, 7, 3, 4, 5, 6)"

    lines = ["The motors are switched on, the program pointers are moved to main, and the grippers are calibrated."]
    for side, goal in GRAB_GOALS.items():
        moves = [abs(end - begin) for begin, end in zip(start[side], goal, strict=True)]
        name = joint_names(side)[moves.index(max(moves))]
        lines += [
            f"The {side.word} arm moves by up to {degrees(max(moves)):.1f}° ({name}), straight in joint space:",
            f"  from {in_degrees(start[side])}",
            f"  to   {in_degrees(goal)}",
        ]
    highest = speed_scale * min(top_speed, max(YUMI_LIMITS.velocity))
    lines.append(f"No joint is faster than {degrees(highest):.0f} °/s (speed_scale {speed_scale:g}).")
    lines.append(
        f"Both grippers open before and close afterwards; then the {LIFTING_ARM.word} tool is lifted by "
        f"{GRAB_LIFT * 1e3:.0f} mm on a straight line and put back. Arms are not kept apart: look where they go."
    )
    return "\n".join(lines)


def read_positions(robot: RobotSettings) -> Mapping[Side, Joints]:
    """Where the arms of a robot stand, chain order [rad]; nothing is changed there.

    Raises:
        YumiError: its controller cannot be reached or asked.
    """
    with robot.client() as client:
        return {side: client.joint_target(side.unit) for side in Side}


def _run_application(
    progress: MoveAndGrabProgress, check: Callable[[], None], confirm: Callable[[str], bool], *, approaches: bool
) -> Mapping[Side, MoveAndGrabArmReport]:
    from yumi.ros.move_and_grab import MoveAndGrab  # noqa: PLC0415
    from yumi.ros.ros_driver import close_ros, open_ros  # noqa: PLC0415 - the command line works without ROS

    open_ros()
    application = MoveAndGrab(progress, check, confirm, approaches=approaches)
    try:
        application.run()
    except BaseException:
        with suppress(YumiError):  # a person must read the first error; the driver ends EGM as well
            application.stop_motion()
        raise
    finally:
        application.close()
        close_ros()
    return application.reports


_POLL = 0.1  # [s]


class DemoScreen:
    """Shows progress on the terminal, or as plain lines where there is none."""

    def __init__(self, *, is_quiet: bool = False) -> None:
        """``is_quiet``: standard output is for something else."""
        self._console = Console(highlight=False, stderr=is_quiet)
        self._bars = ProgressBars(
            TextColumn("     {task.description}"),
            BarColumn(bar_width=32),
            TextColumn("joint error {task.fields[error]:6.2f}°"),
            console=self._console,
            transient=False,
        )
        self._tasks: dict[Side, TaskID] = {}
        self._printed: dict[Side, float] = {}
        self._count = 0

    def __enter__(self) -> DemoScreen:
        self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bars.stop()

    def step(self, sentence: str) -> None:
        self._count += 1
        self._bars.console.print(f"[bold cyan]{self._count:2d}[/]  {sentence}")

    def note(self, sentence: str) -> None:
        self._bars.console.print(f"    [green]✓[/] {sentence}")

    def error(self, side: Side, error_deg: float, share: float) -> None:
        if side not in self._tasks:
            self._tasks[side] = self._bars.add_task(f"{side.word} arm", total=1.0, error=error_deg)
        self._bars.update(self._tasks[side], completed=min(max(share, 0.0), 1.0), error=error_deg)
        # Where no bar can move: a line whenever the error has become half as large.
        if not self._console.is_terminal and error_deg <= self._printed.get(side, 2.0 * error_deg) / 2.0:
            self._printed[side] = error_deg
            self._console.print(f"     {side.word} arm: joint error {error_deg:6.2f}°")

    def confirm(self, sentence: str, check: Callable[[], None]) -> bool:
        """Ask on the terminal whether the robot may go on; False without a terminal.

        Args:
            sentence: what happened, and what to look at.
            check: called while there is no answer; raises when waiting has become useless.
        """
        if not (sys.stdin.isatty() and self._console.is_terminal):
            return False
        was_shown = self._bars.live.is_started
        self._bars.stop()
        try:
            self._console.print(f"[bold yellow]{escape(sentence)}[/]")
            termios.tcflush(sys.stdin, termios.TCIFLUSH)  # an answer given before the question does not count
            self._console.print("Type yes when the robot may move, anything else ends the demonstration: ", end="")
            while not select([sys.stdin], [], [], _POLL)[0]:  # Ctrl-C must end it, which a plain read would not see
                check()
            return sys.stdin.readline().strip().lower() == "yes"
        finally:
            if was_shown:
                self._bars.start()

    def table(self, reports: Mapping[Side, MoveAndGrabArmReport]) -> None:
        """Print what became of each arm."""
        table = Table("arm", "time to goal", "joint error", "missed cycles", "gripper")
        for side, report in reports.items():
            grip = f"{report.grip.word}, {report.grip.width}" if report.grip else "-"
            table.add_row(
                side.word,
                f"{report.duration:.2f} s",
                f"{degrees(report.final_error):.3f}°",
                str(report.missed),
                grip,
            )
        self._console.print(table)


@click.command()
@robot_options(STARTED_HELP)
@egm_port_options()
@speed_scale_option()
@yes_option
@picture_option(str(_PICTURE))
@json_option
@logs_option("build/demo")
def demo(
    robot: str | None,
    password: str | None,
    speed_scale: float | None,
    yes: bool,
    picture: Path | None,
    json_output: JsonOutput,
    logs: Path,
    **where: str | int | None,
) -> None:
    """Both arms of a virtual YuMi move and grab.

    With --robot a real one does, after you have confirmed it. After a stop it prints the cause and goes on only when a
    person types yes; without a terminal, or with --yes, it ends. --picture shows the joint paths, and needs
    yumi-ros2[plot].

    \b
    Examples:
      yumi demo
      yumi demo --robot 192.168.125.1
      yumi demo --robot 127.0.0.1    with `yumi controller` in another terminal
    """
    options = tuple(
        text
        for name, value in where.items()
        if value is not None
        for text in (f"--{name.replace('_', '-')}", str(value))
    )
    if options and robot is None:
        raise CommandRefused(message("option_needs_robot", option=options[0]))
    demand_ros()
    limit_discovery()
    os.environ.setdefault("ROS_LOG_DIR", str(logs.absolute() / "ros"))
    os.environ.setdefault("MPLCONFIGDIR", str(logs.absolute() / "matplotlib"))
    if speed_scale is not None:
        options = (*options, "--speed-scale", str(speed_scale))
    can_draw = _can_draw(is_asked=picture is not None)
    from yumi.recording.pictures import draw_joint_paths  # noqa: PLC0415 - a quick --help

    if robot:
        given = {"robot": robot, "password": password, "speed_scale": speed_scale, **where}
        settings = settings_of(None, given)
        top_speed = radians(settings.egm_motion.max_speed_deviation)
        is_quiet = json_output.is_printed
        ahead = motions_ahead(read_positions(settings.robot), top_speed, settings.robot.first_speed_scale)
        click.echo(ahead, err=is_quiet)
        if not yes:
            click.confirm(f"This moves the robot at {robot}. Is its workspace free?", abort=True, err=is_quiet)
        options = (*options, "--bringup")
    is_over = end_flag()
    with DemoScreen(is_quiet=json_output.is_printed) as screen:
        confirm = (lambda *_: False) if yes else screen.confirm
        try:
            secrets = {PASSWORD_VARIABLE: password} if password else {}
            reports = run_demo(DemoPlan(robot, options, logs, secrets), screen, is_over.is_set, confirm)
        except Cancelled:
            screen.note("cancelled: motion stopped, EGM ended")
            sys.exit(_INTERRUPTED)
    screen.table(reports)
    if can_draw:
        draw_joint_paths({side: item.path for side, item in reports.items()}, picture or _PICTURE)
    json_output.write(
        json.dumps(
            {
                side.word: {
                    "duration_s": item.duration,
                    "final_error_deg": degrees(item.final_error),
                    "missed_cycles": item.missed,
                    "grip": item.grip.word if item.grip else None,
                }
                for side, item in reports.items()
            },
            indent=2,
        )
    )
    if can_draw:
        click.echo(f"Picture of the joint paths: {picture or _PICTURE}", err=json_output.is_printed)
    click.echo("Task completed", err=json_output.is_printed)
