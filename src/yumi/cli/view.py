"""``yumi view``: the robot in the browser, live or from a recording."""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from threading import Event as Flag
from typing import TYPE_CHECKING, Any

import click

from yumi.cli.options import end_flag, until_stdin_closes_option
from yumi.driver.endpoint import find_driver
from yumi.driver.settings import MAX_PORT
from yumi.egm.udp import free_port
from yumi.errors import RobotNotReady, SettingsError
from yumi.process.supervision import PAGE_READY, Command

if TYPE_CHECKING:
    from yumi.web.server import ViewSettings

_READY_TIMEOUT = 60.0


@click.command()
@click.argument("recording", required=False, type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option(
    "--robot",
    default="",
    help="Address of the robot, or namespace, where several drivers run. Where no driver of it runs, one is started.",
)
@click.option("--virtual", is_flag=True, help="Start a virtual robot with a driver, and show that one.")
@click.option("--operate", is_flag=True, help="Let a page on this machine operate a real robot; a virtual one it may.")
@click.option("--port", type=click.IntRange(0, MAX_PORT), default=8090, show_default=True, help="0 takes a free one.")
@click.option(
    "--listen",
    default="127.0.0.1",
    show_default=True,
    help="Address to listen on; another one than this machine's own takes a token, as --operate does.",
)
@click.option(
    "--logs",
    type=click.Path(path_type=Path),
    default=Path("build/view"),
    show_default=True,
    help="Folder for the output of a driver and a virtual robot that are started.",
)
@click.option(
    "--config",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Settings of a driver that is started, instead of the delivered yumi.yaml: boxes, grippers, limits.",
)
@until_stdin_closes_option
def view(
    recording: Path | None,
    robot: str,
    virtual: bool,
    operate: bool,
    port: int,
    listen: str,
    logs: Path,
    config: Path | None,
    until_stdin_closes: bool,
) -> None:
    """Show the robot of the running driver in the browser, or a RECORDING: open the address that is printed.

    A page only looks until a person takes control there; a real robot is operated with --operate on this machine only.

    \b
    Examples:
      yumi view                               the robot of the driver that runs, or will
      yumi view --virtual                     a virtual robot to try
      yumi view --robot 192.168.125.1         with a driver that only reads, where none runs
      yumi view session.mcap                  a recording or flight record, with a time slider
    """
    from yumi.egm.udp import is_loopback  # noqa: PLC0415
    from yumi.web.records import page_recording  # noqa: PLC0415 - a quick --help
    from yumi.web.server import ViewSettings  # noqa: PLC0415

    if recording is not None and (robot or virtual or operate):
        raise SettingsError("A recording is shown alone; leave --robot, --virtual and --operate out.")
    if virtual and robot:
        raise SettingsError("--virtual starts a robot of its own; leave --robot out.")
    if config is not None and not (virtual or robot):
        raise SettingsError("--config is for a driver that is started; name its robot with --robot, or take --virtual.")
    is_over = end_flag(until_stdin_closes)
    own = () if config is None else ("--config", str(config))
    with ExitStack() as stack:
        if virtual:
            robot = stack.enter_context(_virtual_robot(logs, is_over, own))
        elif robot and _has_driver(robot):
            if config is not None:
                raise SettingsError(
                    f"A driver of {robot} runs already, with its own settings; leave --config out, or end that driver."
                )
        elif robot:
            click.echo(f"No driver of {robot} runs; one is started" + ("." if operate else ", which only reads."))
            stack.enter_context(_driver(robot, logs, is_over, (*own, *(() if operate else ("--no-bringup",)))))
        may_operate = operate and not virtual  # a virtual one is operated anyway
        settings = ViewSettings(
            robot=robot,
            host=listen,
            port=port,
            may_operate=may_operate,
            token=secrets.token_urlsafe(18) if may_operate or not is_loopback(listen) else "",
            recording=None if recording is None else page_recording(recording),
        )
        asyncio.run(_serve(settings, is_over))


async def _serve(settings: ViewSettings, is_over: Flag) -> None:
    from yumi.web.server import ViewServer  # noqa: PLC0415 - a quick --help

    server = ViewServer(settings)
    await server.start()
    click.echo(f"{PAGE_READY}{server.url}")
    try:
        await asyncio.to_thread(is_over.wait)
    finally:
        await server.stop()


def _has_driver(robot: str) -> bool:
    try:
        find_driver(robot)
    except RobotNotReady:
        return False
    return True


@contextmanager
def _driver(robot: str, logs: Path, is_over: Flag, options: tuple[str, ...]) -> Iterator[None]:
    """A driver without ROS in a process of its own: the page must not disturb the control loop."""
    host, _, rws_port = robot.partition(":")
    where = ("--robot", host, *(("--rws-port", rws_port) if rws_port else ()))
    with _command("driver", ("up", *where, "--no-ros", *options), logs, is_over):
        yield


@contextmanager
def _virtual_robot(logs: Path, is_over: Flag, options: tuple[str, ...]) -> Iterator[str]:
    """A virtual controller and its driver; the address of the robot."""
    ports = ("--left-egm-port", str(free_port()), "--right-egm-port", str(free_port()))
    arguments = ("controller", "--rws-port", "0", *ports)
    with _command("virtual controller", arguments, logs, is_over) as address:
        robot = address.rpartition("/")[2]
        with _driver(robot, logs, is_over, (*ports, *options)):
            yield robot


@contextmanager
def _command(name: str, arguments: tuple[str, ...], logs: Path, is_over: Flag) -> Iterator[str]:
    def check() -> None:
        if is_over.is_set():
            raise RobotNotReady(f"Ended before the {name} was ready.")

    def show(line: str) -> None:
        click.echo(line, err=True)

    logs.mkdir(parents=True, exist_ok=True)
    command: Any = Command(name, arguments, logs / f"{name.replace(' ', '_')}.log")
    with command:
        yield command.wait_until_ready(_READY_TIMEOUT, check, show)
