"""``yumi shell``, a prompt of Python that is connected to the driver or to a robot; and ``yumi completion``."""

from __future__ import annotations

import code
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import click
from click.shell_completion import get_completion_class

import yumi
from abb_protocols.catalogue import message
from abb_protocols.errors import RobotNotReady
from abb_runtime.options import DRIVER_HELP, egm_port_options, speed_scale_option
from yumi.api.attach import attach
from yumi.cli.driver_options import bringup_option, robot_options

_HISTORY = Path.home() / ".yumi_history"


@click.command()
@robot_options(DRIVER_HELP)
@egm_port_options()
@speed_scale_option()
@bringup_option
def shell(**options: Any) -> None:
    """Open a Python prompt with the driver or a robot.

    With a driver that runs it has `driver`. With --robot it connects to that robot by itself, and has `robot`.

    \b
    Examples:
      yumi shell                          driver.move_to(right="home")
      yumi shell --robot 192.168.125.1 --bringup    robot.right.move_to("home")
    """
    if options["robot"] is None:
        if any(value is not None for value in options.values()):
            raise click.UsageError("These options need --robot; without it the running driver is used as it is.")
        try:
            driver = attach()
        except RobotNotReady as error:
            if error.said.code != "no_driver_runs":
                raise
            raise RobotNotReady(message("no_driver_for_shell", error=error.said)) from None
        with driver:
            prompt({"driver": driver, "yumi": yumi}, f"{driver!r}: driver.state, driver.move_to(right='home') …")
        return
    with yumi.connect(options.pop("robot"), **options) as robot:
        prompt({"robot": robot, "yumi": yumi}, f"{robot!r}: robot.right.move_to('home') …")


def prompt(names: dict[str, object], banner: str) -> None:
    """Read and carry out Python until the end of input, with completion and history where there is readline."""
    with suppress(ImportError):
        import readline  # noqa: PLC0415 - not every Python has it
        import rlcompleter  # noqa: PLC0415

        readline.set_completer(rlcompleter.Completer(names).complete)
        readline.parse_and_bind("tab: complete")
        with suppress(OSError):  # there is none yet
            readline.read_history_file(_HISTORY)
        readline.set_history_length(1000)
    sys.ps1 = "yumi> "
    try:
        code.interact(banner, local=names, exitmsg="")
    finally:
        with suppress(ImportError, OSError):
            import readline  # noqa: PLC0415

            readline.write_history_file(_HISTORY)


@click.command()
@click.argument("name", metavar="SHELL", type=click.Choice(["bash", "zsh", "fish"]))
@click.pass_context
def completion(context: click.Context, name: str) -> None:
    """Print what makes the shell complete yumi's commands.

    It completes commands, options, controllers and poses.

    \b
    Examples:
      eval "$(yumi completion bash)"               in ~/.bashrc; zsh likewise
      yumi completion fish | source                in ~/.config/fish/config.fish
    """
    kind = get_completion_class(name)
    assert kind is not None, "these are click's own"
    click.echo(kind(context.find_root().command, {}, "yumi", "_YUMI_COMPLETE").source())
