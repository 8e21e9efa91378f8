"""``yumi shell``, a Python prompt that is connected; and the completion of commands in the user's own shell."""

from __future__ import annotations

import code
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import click
from click.shell_completion import get_completion_class

import yumi
from yumi.api.attach import attach
from yumi.cli.options import SCALE, robot_options
from yumi.driver.endpoint import HOW_TO_START
from yumi.errors import RobotNotReady

HISTORY = Path.home() / ".yumi_history"


@click.command()
@robot_options("Address of the controller to connect to; else the running driver is used.")
@click.option("--speed-scale", type=SCALE, help="Factor on all speeds; else 1 on this machine, 0.1 elsewhere.")
def shell(**options: Any) -> None:
    """A Python prompt with completion: ``driver`` where a driver runs, or ``robot`` at an address.

    \b
    Examples:
      yumi shell                            driver.state, driver.move_to(right="home")
      yumi shell --robot 192.168.125.1      robot.right.position, robot.right.move_to("home")
    """
    if options["robot"] is None:
        if any(value is not None for value in options.values()):
            raise click.UsageError("These options need --robot; without it the running driver is used as it is.")
        try:
            driver = attach()
        except RobotNotReady as error:
            if str(error) != HOW_TO_START:
                raise
            raise RobotNotReady(f"{error} Or connect the prompt to a robot: yumi shell --robot <address>.") from None
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
            readline.read_history_file(HISTORY)
        readline.set_history_length(1000)
    sys.ps1 = "yumi> "
    try:
        code.interact(banner, local=names, exitmsg="")
    finally:
        with suppress(ImportError, OSError):
            import readline  # noqa: PLC0415

            readline.write_history_file(HISTORY)


@click.command()
@click.argument("name", metavar="SHELL", type=click.Choice(["bash", "zsh", "fish"]))
@click.pass_context
def completion(context: click.Context, name: str) -> None:
    """Print what makes SHELL complete the commands, options, controllers and poses of yumi.

    \b
    Examples:
      eval "$(yumi completion bash)"               in ~/.bashrc; zsh likewise
      yumi completion fish | source                in ~/.config/fish/config.fish
    """
    kind = get_completion_class(name)
    assert kind is not None, "these are click's own"
    click.echo(kind(context.find_root().command, {}, "yumi", "_YUMI_COMPLETE").source())


COMMANDS = (shell, completion)
