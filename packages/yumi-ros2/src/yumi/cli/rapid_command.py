"""``yumi rapid check`` and ``yumi rapid debug``: RAPID programs, checked here or stepped through on a controller."""

from __future__ import annotations

import click

from abb_runtime.options import ONCE_HELP, yes_option
from abb_runtime.rws.client import RwsClient
from virtual_irc5.commands.check import check
from virtual_irc5.commands.debugger import run_debugger
from yumi.cli.rws_command import of_controller


@click.group()
def rapid() -> None:
    """Work on RAPID programs.

    \b
    Examples:
      yumi rapid check pick.mod
      yumi rapid debug T_ROB_R --robot 192.168.125.1
    """


rapid.add_command(check)


@rapid.command("debug")
@click.argument("task")
@yes_option
@click.option("--once", is_flag=True, help=ONCE_HELP)
@of_controller
def debug(client: RwsClient, task: str, yes: bool, once: bool) -> None:
    """Step through the RAPID of a task on a controller.

    Commands are typed, or come from standard input: step, next, out, continue, stop, main, where, list, break
    MODULE:LINE, clear [MODULE:LINE], locals, print [NAME], set NAME VALUE, quit; help explains them. All tasks that
    are selected on the task panel start, and arms move: it asks before the first start; commands that are not typed
    need --yes for it. Ctrl-C stops what was started.

    \b
    Examples:
      yumi rapid debug T_ROB_R --robot 192.168.125.1
      printf "main\\nstep\\nwhere\\n" | yumi rapid debug T_ROB_R --yes
    """
    run_debugger(client, task, yes, once)
