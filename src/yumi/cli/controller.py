"""Commands for controllers: ``yumi controller`` runs a virtual one with a virtual YuMi, ``yumi fault`` injects faults.

``yumi rws`` uses the Robot Web Services of any controller by hand.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from functools import wraps
from pathlib import Path
from typing import Any

import click

from yumi.catalogue import message
from yumi.cli.driver_options import config_option, robot_options, settings_of
from yumi.cli.options import (
    FILE,
    NEW_FILE,
    ONCE,
    JsonOutput,
    Measure,
    arm_option,
    cfg_option,
    count_option,
    egm_port_options,
    end_flag,
    gripper_options,
    json_option,
    listen_option,
    model_option,
    password_options,
    robot_option,
    until_stdin_closes_option,
    user_option,
)
from yumi.driver.settings import RobotSettings
from yumi.errors import CommandRefused
from yumi.process.command import CONTROLLER_READY
from yumi.robot.gripper import TRAVEL, GripperModules
from yumi.robot.joints import Side
from yumi.rws.client import EXECUTION, Change, RwsClient, event_log, signal_state, variable_value
from yumi.rws.documents import Page, State, decode_form
from yumi.rws.login import MAX_PORT, VIRTUAL_RWS_PORT
from yumi.rws.types import GRANTS, Resource
from yumi.virtual.faults import Fault, FaultKind, Way, inject_fault

_WIDTH = Measure("width", 0.0, 2.0 * TRAVEL, is_open=True)
_LEAK = Measure("leak", 0.0, 1.0, is_open=False)
_SPEED = Measure("factor", 0.01, 100.0, is_open=False)
_ARM_TASKS = {side.word: side.task for side in Side}


@click.command()
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
@cfg_option
@click.option(
    "--system",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="A backup of a controller, as RobotStudio writes it: its tasks, modules, signals and HOME.",
)
@click.option(
    "--dynamics", type=FILE, help="Settings with which its arms follow EGM, as `yumi compare` has written them."
)
@click.option("--start", is_flag=True, help="Switch the motors on and start RAPID.")
@click.option("--once", is_flag=True, help=ONCE)
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
    """Run a virtual IRC5 with a YuMi.

    It has the protocols and the RAPID of a real one; `yumi fault` injects faults. It runs the state machine of this
    package, or your own RAPID (--program, --system).

    Only --user may log in. The password is "robotics", ABB's default, unless a file, a prompt or YUMI_PASSWORD gives
    another.

    \b
    Example:
      yumi controller --left-object 0.02
      curl --digest -u "Default User:robotics" "127.0.0.1:8080/rw/panel/ctrlstate?json=1"
    """
    from yumi.virtual.controller.installed_system import (  # noqa: PLC0415
        ROBOTS,
        delivered_system,
        factory_system,
        read_backup,
        with_programs,
    )
    from yumi.virtual.server import VirtualController, world_settings  # noqa: PLC0415 - a quick --help

    if once and not start:
        raise click.UsageError("--once is for --start: give both.")
    kind = ROBOTS[model]
    delivered = delivered_system() if kind.is_yumi and not factory else factory_system(kind)
    begin = read_backup(system, kind) if system else delivered
    settings = world_settings(
        robot_name=robot_name or f"Virtual_{kind.system_name}",
        egm_host=egm_host,
        egm_ports={Side.LEFT: left_egm_port, Side.RIGHT: right_egm_port},
        objects={Side.LEFT: left_object, Side.RIGHT: right_object},
        grippers={Side.LEFT: GripperModules(left_gripper), Side.RIGHT: GripperModules(right_gripper)},
        leaks={Side.LEFT: left_leak, Side.RIGHT: right_leak},
        are_calibrated=calibrated,
        system=with_programs(begin, _programs(programs), cfg),
        dynamics=dynamics,
    )
    chosen = password or RobotSettings().password
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
        show=_show if show else None,
        rapid_sockets=rapid_sockets,
        is_robotware_7=robotware == "7",
    )
    scheme = "https" if robotware == "7" else "http"
    is_over = end_flag(until_stdin_closes)
    virtual.run(is_over, lambda port: click.echo(f"{CONTROLLER_READY}{scheme}://{listen}:{port}"))


def _show(task: str, line: str) -> None:
    click.echo(f"[{task}] {line}")


def _programs(given: tuple[str, ...]) -> dict[str, list[Path]]:
    """The files of each task."""
    programs: dict[str, list[Path]] = {}
    for each in given:
        task, equals, files = each.partition("=")
        if not equals or not task:
            raise click.UsageError(f"--program {each}: TASK=FILE[,FILE…] is needed, such as left=main.mod,tools.sys.")
        programs.setdefault(_ARM_TASKS.get(task.lower(), task), []).extend(map(Path, filter(None, files.split(","))))
    return programs


# ---- yumi fault

_FAULT_WIDTH = 120


def _fault_table(kinds: list[FaultKind]) -> str:
    """The faults, one a line; the width of the names is that of the longest. Choices that do not fit go below."""
    width = max(len(kind.name) for kind in kinds)
    lines = []
    for kind in kinds:
        line, choices = f"  {kind.name:<{width}}  {kind.meaning}", _options_of(kind)
        fits = len(line + choices) < _FAULT_WIDTH
        lines.append(line + choices if fits else f"{line}\n{' ' * (width + 3)}{choices}")
    return "\n".join(lines)


def _options_of(kind: FaultKind) -> str:
    limit = "for ever" if kind.default_duration is None else f"{kind.default_duration:g} s"
    choices = ["--arm"] * kind.has_side + [f"--duration, else {limit}"] * kind.has_duration
    if kind.amount is not None:
        usual = "at random" if kind.amount.default is None else f"{kind.amount.default:g}"
        choices.append(f"--by {kind.amount.unit}, else {usual}")
    choices += ["--way"] * kind.has_way
    return f" ({'; '.join(choices)})" if choices else ""


_FAULTS = _fault_table([fault.value for fault in Fault])


@click.command(
    epilog="\b\nFaults:\n" + _FAULTS,
    context_settings={"max_content_width": _FAULT_WIDTH},
)
@click.argument("name", required=False, type=click.Choice([fault.value.name for fault in Fault]), metavar="[NAME]")
@robot_option(default="127.0.0.1")
@arm_option("both")
@click.option("--duration", type=float, help="How long it lasts [s].")
@click.option("--by", type=float, help="Its strength, in the unit of the list below.")
@click.option(
    "--way", type=click.Choice([way.value for way in Way]), help="Direction of the datagrams; both without it."
)
@json_option
def fault(
    name: str | None,
    robot: str,
    arm: str | None,
    duration: float | None,
    by: float | None,
    way: str | None,
    json_output: JsonOutput,
) -> None:
    """Inject a fault into a virtual controller, or list them.

    Without NAME it lists the faults.

    \b
    Examples:
      yumi fault emergency-stop
      yumi fault egm-silence --arm left --duration 1
      yumi fault egm-loss --by 50 --duration 2
      yumi fault egm-loss --way to-robot --duration 0.5    robot receives nothing
      yumi fault egm-delay --by 20 --arm right --duration 2
      yumi fault warm-restart --robot 127.0.0.1:8080
    """
    if name is None:
        json_output.write(json.dumps({kind.name: kind.meaning for kind in (fault.value for fault in Fault)}, indent=2))
        if not json_output.is_printed:
            click.echo(_FAULTS)
        return
    numbers = {"duration": duration, "by": by}
    chosen = {"side": arm, "way": way, **{key: None if each is None else repr(each) for key, each in numbers.items()}}
    given = {key: text for key, text in chosen.items() if text is not None}
    where = settings_of(None, {"robot": robot}).robot
    inject_fault(f"{where.address}:{where.rws_port}", name, given)
    json_output.write(json.dumps({"fault": name, **given}))
    if not json_output.is_printed:
        click.echo(f"{name}: done")


# ---- yumi rws

_SYMBOL_PARTS = 3  # task, module, name
_PANEL_RESOURCES = ("ctrlstate", "opmode", "speedratio", "coldetstate")


def of_controller(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options that say which controller; the command gets a connected client first."""

    @robot_options()
    @config_option
    @wraps(command)
    def with_client(config: Path | None, **options: Any) -> Any:
        names = ("robot", "user", "password")
        where = settings_of(config, {name: options.pop(name) for name in names}).robot
        address = f"{where.address}:{where.rws_port}"
        with RwsClient(address, user=where.user, password=where.password, timeout=where.timeout) as client:
            return command(client, **options)

    return with_client


@click.group()
def rws() -> None:
    """Use Robot Web Services of a controller by hand.

    A TARGET is a resource (/rw/panel/opmode), a signal (signal:EGM_STOP), a RAPID symbol (T_ROB_R/TRobEGM/settings)
    or a file (HOME:/pick.mod).

    \b
    Examples:
      yumi rws get --robot 192.168.125.1 /rw/panel/opmode
      yumi rws get --robot 192.168.125.1 T_ROB_R/TRobMain/current_state
      yumi rws watch --robot 192.168.125.1 ctrlstate signal:EGM_STOP
    """


@rws.command("get")
@click.argument("target")
@click.argument("file", required=False, type=NEW_FILE)
@json_option
@of_controller
def rws_get(client: RwsClient, target: str, file: Path | None, json_output: JsonOutput) -> None:
    """Read a resource, signal, symbol or file.

    A file goes to FILE of this machine, or is printed. A resource is JSON in any case. With --json a signal is a
    number, and a RAPID symbol a number, bool, string, or list for a record or an array.

    \b
    Examples:
      yumi rws get /rw/rapid/tasks
      yumi rws get signal:hand_ActualPosition_R
      yumi rws get --json T_ROB_R/TRobEGM/settings
      yumi rws get HOME:/pick.mod pick.mod
    """
    device, colon, _ = target.partition(":/")
    if target.startswith("/"):
        path, _, query = target.partition("?")
        _print(client.call("GET", path, decode_form(query)), json_output)
    elif target.startswith("signal:"):
        found = client.signal(target.removeprefix("signal:"))
        json_output.write(json.dumps(found.value))
        if not json_output.is_printed:
            click.echo(f"{found.value:g}")
    elif colon and device.isalnum():
        content = client.read_file(target)
        if file is None:
            sys.stdout.buffer.write(content)
        else:
            file.write_bytes(content)
            click.echo(f"{len(content)} bytes written")
    elif symbol := _symbol_of(target):
        json_output.write(json.dumps(client.value(*symbol), ensure_ascii=False))
        if not json_output.is_printed:
            click.echo(client.symbol(*symbol))
    else:
        raise _unknown_target(target)


@rws.command("set")
@click.argument("target")
@click.argument("value")
@of_controller
def rws_set(client: RwsClient, target: str, value: str) -> None:
    """Write a value to a signal or a RAPID symbol.

    \b
    Examples:
      yumi rws set signal:EGM_STOP 1
      yumi rws set T_ROB_R/TRobRAPID/routine_name_input '"runMoveAbsJ"'
    """
    if target.startswith("signal:"):
        try:
            number = float(value)
        except ValueError as error:
            raise CommandRefused(message("signal_value_no_number", value=value)) from error
        client.set_signal(target.removeprefix("signal:"), number)
    elif symbol := _symbol_of(target):
        client.set_symbol(*symbol, value)
    else:
        raise _unknown_target(target)


@rws.command("ls")
@click.argument("path", default="HOME:/")
@json_option
@of_controller
def rws_ls(client: RwsClient, path: str, json_output: JsonOutput) -> None:
    """List a directory or the entries of a resource.

    PATH is a directory of the controller or a resource, of which all pages are read.

    \b
    Examples:
      yumi rws ls HOME:/yumi
      yumi rws ls /rw/iosystem/signals
      yumi rws ls --json /rw/iosystem/signals
    """
    if path.startswith("/"):
        states = client.entries(path)
        json_output.write(_states_text(states))
        if not json_output.is_printed:
            for state in states:
                click.echo(state.title)
        return
    entries = client.files(path)
    json_output.write(json.dumps([{"name": each.name, "size": each.size} for each in entries], indent=2))
    if not json_output.is_printed:
        for entry in entries:
            click.echo(f"{entry.name}/" if entry.size is None else f"{entry.name:<40}{entry.size:>12}")


@rws.command("put")
@click.argument("file", type=FILE)
@click.argument("path")
@of_controller
def rws_put(client: RwsClient, file: Path, path: str) -> None:
    """Write a file of this machine to the controller.

    \b
    Examples:
      yumi rws put pick.mod HOME:/pick.mod
    """
    content = file.read_bytes()
    client.write_file(f"{path}{file.name}" if path.endswith("/") else path, content)
    click.echo(f"{len(content)} bytes written")


@rws.command("watch")
@click.argument("targets", nargs=-1, required=True)
@count_option()
@json_option
@of_controller
def rws_watch(client: RwsClient, targets: tuple[str, ...], count: int | None, json_output: JsonOutput) -> None:
    """Print values and each of their changes.

    It subscribes again after a break, and prints that. With --json each line is an object.

    \b
    TARGETS: ctrlstate, opmode, speedratio, coldetstate, execution, elog,
      signal:NAME, TASK/MODULE/NAME (PERS)

    \b
    Examples:
      yumi rws watch ctrlstate opmode execution
      yumi rws watch --json signal:EGM_STOP
    """
    for number, item in enumerate(client.watch([_resource_of(target) for target in targets]), 1):
        line = {"interrupted": item.reason} if not isinstance(item, Change) else {"path": item.path, **item.fields}
        json_output.write(json.dumps(line, ensure_ascii=False))
        if json_output.is_printed:
            pass
        elif isinstance(item, Change):
            click.echo(f"{item.path} {' '.join(f'{name}={text}' for name, text in item.fields.items())}".rstrip())
        else:
            click.echo(f"interrupted: {item.reason}; subscribing again", err=True)
        if number == count:
            return


@rws.command("call")
@click.argument("method", type=click.Choice(["GET", "POST", "PUT", "DELETE", "HEAD"], case_sensitive=False))
@click.argument("path")
@click.argument("fields", nargs=-1)
@json_option
@of_controller
def rws_call(client: RwsClient, method: str, path: str, fields: tuple[str, ...], json_output: JsonOutput) -> None:
    """Send any request; the answer is JSON.

    FIELDS are NAME=VALUE in its body.

    \b
    Examples:
      yumi rws call POST '/rw/panel/speedratio?action=setspeedratio' speed-ratio=50
      yumi rws call POST '/rw/rapid/symbols?action=search-symbols' view=block blockurl=RAPID/T_ROB_R symtyp=per
    """
    wrong = [field for field in fields if "=" not in field]
    if wrong:
        raise CommandRefused(message("field_without_value", field=wrong[0]))
    where, _, query = path.partition("?")
    form = tuple((name, value) for name, _, value in (field.partition("=") for field in fields))
    _print(client.call(method, where, decode_form(query), form or None), json_output)


def _resource_of(target: str) -> Resource:
    if target in _PANEL_RESOURCES:
        return Resource(f"/rw/panel/{target}")
    if target == "execution":
        return EXECUTION
    if target == "elog":
        return event_log()
    if target.startswith("signal:"):
        return signal_state(target.removeprefix("signal:"))
    if target.startswith("/"):
        return Resource(target)
    if symbol := _symbol_of(target):
        return variable_value(*symbol)
    raise _unknown_target(target)


def _symbol_of(target: str) -> tuple[str, str, str] | None:
    parts = target.split("/")
    return (parts[0], parts[1], parts[2]) if len(parts) == _SYMBOL_PARTS and all(parts) else None


def _unknown_target(target: str) -> CommandRefused:
    return CommandRefused(message("no_target", target=target))


def _print(page: Page | None, json_output: JsonOutput) -> None:
    """Print a resource as JSON, whether that is asked for or not."""
    if page is None:
        return
    text = _states_text(page.states)
    json_output.write(text)
    if not json_output.is_printed:
        click.echo(text)


def _states_text(states: Sequence[State]) -> str:
    return json.dumps([_as_object(state) for state in states], indent=2, ensure_ascii=False)


def _as_object(state: State) -> dict[str, object]:
    value: dict[str, object] = {"type": state.type, "title": state.title, **state.fields}
    if state.children:
        value["items"] = [_as_object(child) for child in state.children]
    return value
