"""``yumi rapid``: RAPID programs, checked here or stepped through on a controller; ``yumi answer``: their questions."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from yumi.cli.options import PORT, password_options
from yumi.cli.rws import of_controller
from yumi.errors import CommandRefused, ControllerRefused

if TYPE_CHECKING:
    from yumi.rws.client import RwsClient

_FILE = click.Path(exists=True, dir_okay=False, path_type=Path)


@click.group()
def rapid() -> None:
    """Work on RAPID programs.

    \b
    Example:
      yumi rapid check src/yumi/controller_files/*.mod src/yumi/controller_files/*.sys
    """


@rapid.command()
@click.argument("files", nargs=-1, required=True, type=_FILE, metavar="FILE…")
@click.option("--cfg", multiple=True, type=_FILE, help="System parameters the program needs, such as your EIO.cfg.")
@click.option(
    "--robot",
    type=click.Choice(["yumi", "irb14050", "irb120"]),
    default="yumi",
    show_default=True,
    help="Whose program it is: of a YuMi, or of a robot with ROB_1 and T_ROB1, as yumi controller --robot has them.",
)
@click.option("--json", "as_json", is_flag=True, help="A JSON list, for editors.")
def check(files: tuple[Path, ...], cfg: tuple[Path, ...], robot: str, as_json: bool) -> None:
    """List syntax errors, type errors and unknown names of modules, which are checked as one program.

    One line each: file, line, column, and what is expected. "unknown" is what nothing declares (an error where it is
    executed, once all modules are there), "missing" what RobotWare has and this package has not. Exit code 1 with any.

    \b
    Examples:
      yumi rapid check src/yumi/controller_files/*.mod src/yumi/controller_files/*.sys
      yumi rapid check --json src/yumi/controller_files/*.mod src/yumi/controller_files/*.sys
    """
    from yumi.virtual.program_check import check_program  # noqa: PLC0415 - a quick --help

    faults = check_program(files, cfg, robot)
    if as_json:
        click.echo(json.dumps([fault.as_dict() for fault in faults], indent=2))
    else:
        for fault in faults:
            click.echo(f"{fault.file}:{fault.line}:{fault.column}: {fault.kind}: {fault.sentence}")
        if not faults:
            click.echo(f"{len(files)} {'file' if len(files) == 1 else 'files'}: nothing found")
    if faults:
        sys.exit(1)


@rapid.command("debug")
@click.argument("task")
@click.option("--yes", is_flag=True, help="Do not ask before the first start.")
@of_controller
def debug_(client: RwsClient, task: str, yes: bool) -> None:
    """Step through the RAPID of TASK on a controller: steps, breakpoints, call stack, data.

    Commands are typed, or come from standard input: step, next, out, continue, stop, main, where, list, break
    MODULE:LINE, print [NAME], set NAME VALUE, quit; help explains them. All tasks that are selected on the task panel
    start, and arms move: it asks before the first start; commands that are not typed need --yes for it. Ctrl-C stops
    what was started.

    \b
    Examples:
      yumi rapid debug T_ROB_R --robot 192.168.125.1
      printf "main\\nstep\\nwhere\\n" | yumi rapid debug T_ROB_R --yes
    """
    from yumi.cli.debugger import Debugger  # noqa: PLC0415 - a quick --help
    from yumi.clock import SystemClock  # noqa: PLC0415

    commands = None if sys.stdin.isatty() else sys.stdin

    def confirm(question: str) -> bool:
        return yes or (commands is None and click.confirm(question))

    debugger = Debugger(client, task, SystemClock(), sys.stdout, confirm, commands)
    if commands is not None:
        debugger.prompt = ""
    try:
        debugger.cmdloop()
    except KeyboardInterrupt:
        sys.exit(130)


@click.command()
@click.argument("value", required=False)
@click.option("--robot", default="127.0.0.1", show_default=True, help="Address of the controller.")
@click.option("--rws-port", type=PORT, default=8080, show_default=True, help="Its HTTP port.")
@click.option("--user", default="Default User", show_default=True, help="User that may log in.")
@password_options
def answer(value: str | None, robot: str, rws_port: int, user: str, password: str | None) -> None:
    """Answer the question that a RAPID program asks the operator; without VALUE, show it.

    VALUE is a button's or an item's text, the value that the program gets for it, a number, or a text.
    """
    from yumi.driver.settings import RobotSettings  # noqa: PLC0415 - a quick --help
    from yumi.rws.client import RwsClient  # noqa: PLC0415

    own = RobotSettings()
    with RwsClient(f"{robot}:{rws_port}", user=user, password=password or own.password, timeout=own.timeout) as client:
        dialog = client.dialog()
        if dialog is None:
            raise CommandRefused("No program asks anything.")
        asked = [f"{name}: {text}" for name, text in client.dialog_parameters(dialog.stack).items() if text]
        if value is None:
            click.echo("\n".join([f"{dialog.instruction} of {dialog.stack.split('/')[1]}", *asked]))
            return
        try:
            client.answer_dialog(dialog.stack, value)
        except ControllerRefused as error:
            raise CommandRefused(
                f"The controller refuses {value!r} as an answer to {dialog.instruction} ({', '.join(asked)})."
            ) from error
