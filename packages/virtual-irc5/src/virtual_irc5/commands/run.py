"""``virtual-irc5 run`` and ``yumi controller``: a virtual controller with a virtual robot, as a process."""

from __future__ import annotations

import time
from pathlib import Path

import click

from abb_protocols.robot.gripper_values import FINGER_TRAVEL, GripperModules
from abb_protocols.robot.joints import Side
from abb_protocols.rws.values import GRANTS
from abb_runtime.options import (
    FILE_TYPE,
    ONCE_HELP,
    OptionNumber,
    SharedCommand,
    cfg_option,
    egm_port_options,
    end_flag,
    gripper_options,
    listen_option,
    model_option,
    password_options,
    until_stdin_closes_option,
    user_option,
)
from abb_runtime.process.command_process import CONTROLLER_READY
from abb_runtime.rws.client import DEFAULT_PASSWORD
from abb_runtime.rws.login import MAX_PORT, VIRTUAL_RWS_PORT
from abb_runtime.udp import address_of_host

_WIDTH = OptionNumber("width", 0.0, 2.0 * FINGER_TRAVEL, is_open=True)
_LEAK = OptionNumber("leak", 0.0, 1.0, is_open=False)
_SPEED = OptionNumber("factor", 0.01, 100.0, is_open=False)
_ARM_TASKS = {side.word: side.task for side in Side}


@click.command(cls=SharedCommand)
@click.option(
    "--rws-port",
    type=click.IntRange(0, MAX_PORT),
    default=VIRTUAL_RWS_PORT,
    show_default=True,
    help="Port of Robot Web Services; 0 takes a free one.",
)
@listen_option
@click.option(
    "--rapid-sockets",
    metavar="ADDRESS",
    help="Address of this machine that RAPID's sockets may use, 0.0.0.0 for all; --listen's without it. Sockets that "
    "may use a loopback address only reach nothing but this machine, whatever address a program names.",
)
@model_option
@click.option(
    "--robotware",
    type=click.Choice(["6", "7"]),
    default="6",
    show_default=True,
    help="Whose Robot Web Services it has: 1.0 over HTTP, or 2.0 over HTTPS with a certificate of its own.",
)
@click.option(
    "--robot-name",
    default=None,
    show_default="Virtual_ and the robot, such as Virtual_YuMi",
    help="Name of the controller's system.",
)
@click.option("--egm-host", default="127.0.0.1", show_default=True, help="Where the driver is: EGM goes there.")
@egm_port_options(6511, 6512)
@click.option("--left-object", type=_WIDTH, help="Width of an object between the left fingers [m].")
@click.option("--right-object", type=_WIDTH, help="Width of an object between the right fingers [m].")
@gripper_options
@click.option(
    "--left-leak", type=_LEAK, help="An object lies under the left gripper's cups: 0 tight, 1 as if there were none."
)
@click.option("--right-leak", type=_LEAK, help="An object lies under the right gripper's cups.")
@click.option("--calibrated", is_flag=True, help="The grippers are calibrated already.")
@click.option(
    "--factory",
    is_flag=True,
    help="As it leaves the factory: without the programs that `yumi install` of yumi-ros2 brings.",
)
@click.option(
    "--program",
    "programs",
    multiple=True,
    metavar="TASK=FILE[,FILE…]",
    help="Your RAPID modules (.mod, .sys) or program (.pgf) instead of ours, in the task of an arm (left, right) or of "
    "another name; may be given for several tasks.",
)
@cfg_option
@click.option(
    "--system",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="A backup of a controller, as RobotStudio writes it: its tasks, modules, signals and HOME.",
)
@click.option(
    "--dynamics",
    type=FILE_TYPE,
    help="Settings with which its arms follow EGM, as `yumi compare` of yumi-ros2 has written them.",
)
@click.option("--start", is_flag=True, help="Switch the motors on and start RAPID.")
@click.option("--once", is_flag=True, help=ONCE_HELP)
@click.option(
    "--real-time-factor", type=_SPEED, default=1.0, show_default=True, help="Run so many times as fast as a real one."
)
@click.option("--show", is_flag=True, help="Print what programs write to the FlexPendant (TPWrite), with their task.")
@user_option("Default User")
@click.option(
    "--without-grant",
    "missing_grants",
    multiple=True,
    type=click.Choice([each.value for each in GRANTS]),
    metavar="GRANT",
    help="What the user may not do, such as UAS_IO_WRITE: it is refused with 403. May be repeated.",
)
@password_options
@until_stdin_closes_option
def controller(
    rws_port: int,
    listen: str,
    rapid_sockets: str | None,
    model: str,
    robotware: str,
    robot_name: str | None,
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
    factory: bool,
    programs: tuple[str, ...],
    cfg: tuple[Path, ...],
    system: Path | None,
    dynamics: Path | None,
    start: bool,
    once: bool,
    real_time_factor: float,
    show: bool,
    user: str,
    missing_grants: tuple[str, ...],
    password: str | None,
    until_stdin_closes: bool,
) -> None:
    """Run a virtual IRC5 with a robot.

    It has the protocols and the RAPID of a real one, with a YuMi or the robot of --model. It runs the state machine of
    yumi-ros2, or your own RAPID (--program, --system). The command fault injects faults.

    Only --user may log in. The password is "robotics", ABB's default, unless a file, a prompt or YUMI_PASSWORD gives
    another.

    \b
    Examples:
      {command} --left-object 0.02
      {command} --model irb120 --program T_ROB1=main.mod --start
      curl --digest -u "Default User:robotics" "127.0.0.1:8080/rw/panel/ctrlstate?json=1"
    """
    from virtual_irc5.controller.installed_system import (  # noqa: PLC0415
        ROBOTS,
        delivered_system,
        factory_system,
        read_backup,
        with_programs,
    )
    from virtual_irc5.mechanics.egm_parameters import EgmParameters, read_egm_parameters  # noqa: PLC0415
    from virtual_irc5.mechanics.virtual_gripper import CupObject, Workpiece  # noqa: PLC0415
    from virtual_irc5.server import VirtualController  # noqa: PLC0415 - a quick --help
    from virtual_irc5.world import WorldSettings  # noqa: PLC0415

    if once and not start:
        raise click.UsageError("--once is for --start: give both.")
    kind = ROBOTS[model]
    delivered = factory_system(kind) if factory else delivered_system(kind)
    begin = read_backup(system, kind) if system else delivered
    widths = {Side.LEFT: left_object, Side.RIGHT: right_object}
    leaks = {Side.LEFT: left_leak, Side.RIGHT: right_leak}
    settings = WorldSettings(
        robot_name=robot_name or f"Virtual_{kind.system_name}",
        egm_host=address_of_host(egm_host),  # once, since looking a name up takes longer than a cycle
        egm_ports={Side.LEFT: left_egm_port, Side.RIGHT: right_egm_port},
        workpieces={side: Workpiece(width) for side, width in widths.items() if width is not None},
        gripper_modules={Side.LEFT: GripperModules(left_gripper), Side.RIGHT: GripperModules(right_gripper)},
        cup_objects={side: CupObject(leak) for side, leak in leaks.items() if leak is not None},
        grippers_are_calibrated=calibrated,
        start_time=time.time(),
        system=with_programs(begin, _programs(programs), cfg),
        egm_parameters=EgmParameters() if dynamics is None else read_egm_parameters(dynamics),
    )
    chosen = password or DEFAULT_PASSWORD
    virtual = VirtualController(
        settings,
        rws_port=rws_port,
        user=user,
        password=chosen,
        granted=[each for each in GRANTS if each.value not in missing_grants],
        host=listen,
        speed=real_time_factor,
        is_started=start,
        runs_once=once,
        show=(lambda task, line: click.echo(f"[{task}] {line}")) if show else None,
        rapid_sockets=rapid_sockets,
        is_robotware_7=robotware == "7",
    )
    scheme = "https" if robotware == "7" else "http"
    is_over = end_flag(until_stdin_closes)
    virtual.run(is_over, lambda port: click.echo(f"{CONTROLLER_READY}{scheme}://{listen}:{port}"))


def _programs(given: tuple[str, ...]) -> dict[str, list[Path]]:
    """The files of each task."""
    programs: dict[str, list[Path]] = {}
    for each in given:
        task, equals, files = each.partition("=")
        if not equals or not task:
            raise click.UsageError(f"--program {each}: TASK=FILE[,FILE…] is needed, such as left=main.mod,tools.sys.")
        programs.setdefault(_ARM_TASKS.get(task.lower(), task), []).extend(map(Path, filter(None, files.split(","))))
    return programs
