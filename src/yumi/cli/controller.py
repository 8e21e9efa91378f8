"""``yumi controller``: a virtual controller with a virtual YuMi.

The command ``yumi fault``: injects a fault into a running virtual controller.
"""

from __future__ import annotations

import logging
from pathlib import Path

import click

from yumi.cli.options import PORT, Measure, end_flag, password_options, until_stdin_closes_option
from yumi.driver.settings import MAX_PORT, RobotSettings
from yumi.process.supervision import CONTROLLER_READY
from yumi.robot.gripper import TRAVEL, GripperModules
from yumi.robot.joints import Side
from yumi.rws.types import GRANTS
from yumi.virtual.controller.fault_names import Fault, FaultKind, Way

_WIDTH = Measure("width", 0.0, 2.0 * TRAVEL, is_open=True)
_LEAK = Measure("leak", 0.0, 1.0, is_open=False)
_MODULES = click.Choice([modules.value for modules in GripperModules])
_FILE = click.Path(exists=True, dir_okay=False, path_type=Path)
_SPEED = Measure("factor", 0.01, 100.0, is_open=False)
_ARM_TASKS = {side.word: side.task for side in Side}


@click.command()
@click.option(
    "--rws-port",
    type=click.IntRange(0, MAX_PORT),
    default=8080,
    show_default=True,
    help="Port of Robot Web Services; 0 takes a free one.",
)
@click.option("--listen", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option(
    "--rapid-sockets",
    metavar="ADDRESS",
    help="Address of this machine that RAPID's sockets may use, 0.0.0.0 for all; --listen's without it. Sockets that "
    "may use a loopback address only reach nothing but this machine, whatever address a program names.",
)
@click.option(
    "--robot",
    type=click.Choice(["yumi", "irb14050", "irb120"]),
    default="yumi",
    show_default=True,
    help="What it moves: a YuMi, a single-arm YuMi, or an IRB 120 of six axes (both T_ROB1, ROB_1).",
)
@click.option(
    "--robotware",
    type=click.Choice(["6", "7"]),
    default="6",
    show_default=True,
    help="Whose Robot Web Services it has: 1.0 over HTTP, or 2.0 over HTTPS with a certificate of its own.",
)
@click.option("--robot-name", default="Virtual_YuMi", show_default=True, help="Name of the controller's system.")
@click.option("--egm-host", default="127.0.0.1", show_default=True, help="Where the driver is: EGM goes there.")
@click.option(
    "--left-egm-port", type=PORT, default=6511, show_default=True, help="The driver's UDP port for the left arm."
)
@click.option(
    "--right-egm-port", type=PORT, default=6512, show_default=True, help="The driver's UDP port for the right arm."
)
@click.option("--left-object", type=_WIDTH, help="Width of an object between the left fingers [m].")
@click.option("--right-object", type=_WIDTH, help="Width of an object between the right fingers [m].")
@click.option("--left-gripper", type=_MODULES, default="servo", show_default=True, help="Modules of the left gripper.")
@click.option("--right-gripper", type=_MODULES, default="servo", show_default=True, help="And of the right one.")
@click.option("--left-leak", type=_LEAK, help="An object lies under the left gripper's cups; 0 is tight, 1 as if none.")
@click.option("--right-leak", type=_LEAK, help="And under the right one's.")
@click.option("--calibrated", is_flag=True, help="The grippers are calibrated already.")
@click.option(
    "--factory", is_flag=True, help="As it leaves the factory: nothing of this package is on it; see `yumi install`."
)
@click.option(
    "--program",
    "programs",
    multiple=True,
    metavar="TASK=FILE[,FILE…]",
    help="Your RAPID modules (.mod, .sys) or program (.pgf) instead of ours, in the task of an arm (left, right) or of "
    "another name; may be given for several tasks.",
)
@click.option("--cfg", multiple=True, type=_FILE, help="System parameters to add, such as an EIO.cfg of your own.")
@click.option(
    "--system",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="A backup of a controller, as RobotStudio writes it: its tasks, modules, signals and HOME.",
)
@click.option("--start", is_flag=True, help="Switch the motors on and start RAPID.")
@click.option("--speed", type=_SPEED, default=1.0, show_default=True, help="Times real time.")
@click.option("--show", is_flag=True, help="Print what programs write to the FlexPendant (TPWrite).")
@click.option("--user", default="Default User", show_default=True, help="User that may log in.")
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
    robot: str,
    robotware: str,
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
    factory: bool,
    programs: tuple[str, ...],
    cfg: tuple[Path, ...],
    system: Path | None,
    start: bool,
    speed: float,
    show: bool,
    user: str,
    missing_grants: tuple[str, ...],
    password: str | None,
    until_stdin_closes: bool,
) -> None:
    """Run a virtual IRC5 with a YuMi: the protocols and the RAPID of a real one; `yumi fault` injects faults.

    It runs the state machine of this package, or your own RAPID (--program, --system).

    Its password is "robotics", as of a new controller, unless a file, a prompt or YUMI_PASSWORD gives another.

    \b
    Example:
      yumi controller --rws-port 8080 --left-object 0.02
      curl --digest -u "Default User:robotics" http://127.0.0.1:8080/rw/panel/ctrlstate?json=1
    """
    from yumi.virtual.controller.system import (  # noqa: PLC0415
        ROBOTS,
        delivered_system,
        factory_system,
        read_backup,
        with_programs,
    )
    from yumi.virtual.server import VirtualController, world_settings  # noqa: PLC0415 - a quick --help

    if show:
        logging.getLogger("yumi.virtual.controller.tasks").setLevel(logging.DEBUG)
    model = ROBOTS[robot]
    delivered = delivered_system() if model.is_yumi and not factory else factory_system(model)
    begin = read_backup(system, model) if system else delivered
    settings = world_settings(
        robot_name=robot_name,
        egm_host=egm_host,
        egm_ports={Side.LEFT: left_egm_port, Side.RIGHT: right_egm_port},
        objects={Side.LEFT: left_object, Side.RIGHT: right_object},
        grippers={Side.LEFT: GripperModules(left_gripper), Side.RIGHT: GripperModules(right_gripper)},
        leaks={Side.LEFT: left_leak, Side.RIGHT: right_leak},
        are_calibrated=calibrated,
        system=with_programs(begin, _programs(programs), cfg),
    )
    chosen = password or RobotSettings().password
    virtual = VirtualController(
        settings,
        rws_port=rws_port,
        user=user,
        password=chosen,
        granted=[each for each in GRANTS if each.value not in missing_grants],
        host=listen,
        speed=speed,
        is_started=start,
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


_FAULT_WIDTH = 120


def _table(kinds: list[FaultKind]) -> str:
    """The faults, one a line; the width of the names is that of the longest. Choices that do not fit go below."""
    width = max(len(kind.name) for kind in kinds)
    lines = []
    for kind in kinds:
        line, choices = f"  {kind.name:<{width}}  {kind.meaning}", _choices(kind)
        fits = len(line + choices) < _FAULT_WIDTH
        lines.append(line + choices if fits else f"{line}\n{' ' * (width + 3)}{choices}")
    return "\n".join(lines)


def _choices(kind: FaultKind) -> str:
    limit = "for ever" if kind.default_duration is None else f"{kind.default_duration:g} s"
    choices = ["--side"] * kind.has_side + [f"--duration, else {limit}"] * kind.has_duration
    if kind.amount is not None:
        usual = "at random" if kind.amount.default is None else f"{kind.amount.default:g}"
        choices.append(f"--by {kind.amount.unit}, else {usual}")
    choices += ["--way"] * kind.has_way
    return f" ({'; '.join(choices)})" if choices else ""


_LIST = _table([fault.value for fault in Fault])


@click.command(
    epilog="\b\nFaults:\n" + _LIST,
    context_settings={"max_content_width": _FAULT_WIDTH},
)
@click.argument("name", required=False, type=click.Choice([fault.value.name for fault in Fault]), metavar="[NAME]")
@click.option("--rws-port", type=click.IntRange(1, 65535), default=8080, show_default=True, help="Its HTTP port.")
@click.option("--side", type=click.Choice([side.word for side in Side]), help="One arm; both without it.")
@click.option("--duration", type=float, help="How long it lasts [s].")
@click.option("--by", type=float, help="Its strength, in the unit of the list below.")
@click.option(
    "--way", type=click.Choice([way.value for way in Way]), help="Direction of the datagrams; both without it."
)
def fault(
    name: str | None, rws_port: int, side: str | None, duration: float | None, by: float | None, way: str | None
) -> None:
    """Inject a fault into a virtual controller that runs on this machine; without NAME, list the faults.

    \b
    Examples:
      yumi fault emergency-stop
      yumi fault egm-silence --side left --duration 1
      yumi fault egm-loss --by 50 --duration 2
      yumi fault egm-loss --way to-robot --duration 0.5    the robot receives nothing
      yumi fault egm-delay --by 20 --side right --duration 2
      yumi fault warm-restart --rws-port 8080
    """
    if name is None:
        click.echo(_LIST)
        return
    numbers = {"duration": duration, "by": by}
    chosen = {"side": side, "way": way, **{key: None if each is None else repr(each) for key, each in numbers.items()}}
    from yumi.virtual.fault_injection import inject_fault  # noqa: PLC0415 - a quick --help

    inject_fault(f"127.0.0.1:{rws_port}", name, {key: text for key, text in chosen.items() if text is not None})
    click.echo(f"{name}: done")
