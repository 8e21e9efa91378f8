"""`virtual-irc5 view`: a controller in the browser, by the page of the package abb-view."""

from __future__ import annotations

import secrets

import click

from abb_protocols.catalogue import message
from abb_protocols.errors import missing_extra
from abb_runtime.options import (
    end_flag,
    https_option,
    listen_option,
    page_port_option,
    password_options,
    robot_option,
    until_stdin_closes_option,
    user_option,
)
from abb_runtime.rws.client import DEFAULT_PASSWORD, DEFAULT_USER, RwsClient
from abb_runtime.rws.login import with_usual_port
from abb_runtime.udp import is_loopback

_PROGRAM = "virtual-irc5 view"
_ANSWER = 2.0  # [s] longest wait for one answer of the controller


@click.command()
@robot_option(default="127.0.0.1")
@user_option(DEFAULT_USER)
@password_options
@https_option
@page_port_option
@listen_option
@until_stdin_closes_option
def view(
    robot: str, user: str, password: str | None, https: bool, port: int, listen: str, until_stdin_closes: bool
) -> None:
    """Show a controller in the browser.

    Open the address that is printed. It shows the robot in 3-D, the RAPID tasks with their program pointers, and the
    event log, of a virtual controller or of a real one with RobotWare 6, which is only read. On a virtual one of this
    machine the page presses the emergency stop, turns the key, and injects faults; a page on another machine, with
    --listen, does not.

    \b
    Examples:
      virtual-irc5 view
      virtual-irc5 view --robot 192.168.125.1 --port 0
      virtual-irc5 view --https --listen 192.168.1.20    for other machines
    """
    try:
        from abb_view.controller_reader import ControllerReader, open_reader  # noqa: PLC0415 - an extra
        from abb_view.controller_server import ControllerServer  # noqa: PLC0415
        from abb_view.page_build import CONTROLLER_PAGE, page_folder  # noqa: PLC0415
        from abb_view.page_server import PageSettings, page_tls, serve_pages  # noqa: PLC0415
    except ModuleNotFoundError as error:
        if not (error.name or "").startswith("abb_view"):
            raise
        what = message("command_needs_packages", packages=("abb-view",))
        raise missing_extra(what, "virtual-irc5", "page") from error

    is_over = end_flag(until_stdin_closes)
    page_folder(CONTROLLER_PAGE, click.echo)

    def open_controller() -> ControllerReader:
        client = RwsClient(with_usual_port(robot), user=user, password=password or DEFAULT_PASSWORD, timeout=_ANSWER)
        client.connect()
        return open_reader(client)

    reader = open_controller()
    try:
        tls = page_tls(listen, "virtual-irc5", click.echo) if https else None
        token = "" if is_loopback(listen) else secrets.token_urlsafe(18)
        settings = PageSettings(host=listen, port=port, tls=tls, token=token)
        server = ControllerServer(settings, _PROGRAM, reader, open_controller, takes_faults=True)
        serve_pages(server, is_over, click.echo)
    finally:
        reader.close()
