"""``yumi view``: a running driver's robot in the browser, a controller that no driver can run for, or a recording."""

from __future__ import annotations

import secrets
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from threading import Event as Flag
from typing import Any

import click

from abb_protocols.catalogue import message
from abb_protocols.errors import RobotNotReady, SettingsError
from abb_runtime.options import (
    FILE_TYPE,
    end_flag,
    https_option,
    listen_option,
    logs_option,
    page_port_option,
    robot_option,
    until_stdin_closes_option,
)
from abb_runtime.process.command_process import CommandProcess
from abb_runtime.rws.login import password_of_environment
from abb_runtime.udp import free_port, is_loopback
from yumi.cli.driver_options import config_option, settings_of
from yumi.driver.endpoint import find_driver
from yumi.driver.settings import RobotSettings

_READY_TIMEOUT = 60.0  # [s] for a driver or a virtual robot that `yumi view` starts


@click.command()
@click.argument("recording", required=False, type=FILE_TYPE)
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
    from yumi.web.page_words import PAGE_PROGRAM  # noqa: PLC0415
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
            serve_pages(ControllerServer(shown, PAGE_PROGRAM, controller, reopen), is_over, click.echo)
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
