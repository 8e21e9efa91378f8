"""The command line: ``virtual-irc5 run``, ``check``, ``debug``, ``fault`` and ``view``."""

from __future__ import annotations

import logging
import sys
from typing import Any

import click

from abb_protocols.catalogue import speak_as
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import SettingsError, YumiError
from abb_runtime.fault_command import fault
from abb_runtime.options import ONCE_HELP, password_options, robot_option, user_option, with_json_targets, yes_option
from abb_runtime.rws.client import DEFAULT_PASSWORD, DEFAULT_USER, RwsClient
from abb_runtime.rws.login import with_usual_port
from virtual_irc5 import __version__
from virtual_irc5.commands.check import check
from virtual_irc5.commands.debugger import run_debugger
from virtual_irc5.commands.run import controller
from virtual_irc5.commands.view import view


class _Commands(click.Group):
    """Turns our errors into one sentence and exit code 1 (2 for wrong settings)."""

    def make_context(self, info_name: str | None, args: list[str], *rest: Any, **extra: Any) -> click.Context:
        return super().make_context(info_name, with_json_targets(args), *rest, **extra)

    def invoke(self, context: click.Context) -> Any:
        try:
            speak_as(FrontEnd.SHELL)
            return super().invoke(context)
        except YumiError as error:
            click.echo(f"Error: {error}", err=True)
            sys.exit(2 if isinstance(error, SettingsError) else 1)


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="virtual-irc5")
def main() -> None:
    """A virtual IRC5 controller with any ABB robot, for tests of what speaks to one.

    \b
    Examples:
      virtual-irc5 run --model irb120 --program T_ROB1=main.mod --start
      virtual-irc5 check --model irb120 main.mod
      virtual-irc5 debug T_ROB1 --yes
      virtual-irc5 fault emergency-stop
      virtual-irc5 view
    """
    logging.basicConfig(level=logging.INFO, format="%(levelname)s %(name)s: %(message)s")
    logging.getLogger("httpx").setLevel(logging.WARNING)


@main.command("debug")
@click.argument("task")
@yes_option
@click.option("--once", is_flag=True, help=ONCE_HELP)
@robot_option(default="127.0.0.1")
@user_option(DEFAULT_USER)
@password_options
def _debug(task: str, yes: bool, once: bool, robot: str, user: str, password: str | None) -> None:
    """Step through the RAPID of a task on a controller.

    Commands are typed, or come from standard input; help explains them. All tasks that are selected on the task panel
    start, and arms move: it asks before the first start; commands that are not typed need --yes for it.

    \b
    Example:
      printf "main\\nstep\\nwhere\\n" | virtual-irc5 debug T_ROB1 --yes
    """
    with RwsClient(with_usual_port(robot), user=user, password=password or DEFAULT_PASSWORD) as client:
        run_debugger(client, task, yes, once)


main.add_command(controller, "run")
main.add_command(check)
main.add_command(fault)
main.add_command(view)
