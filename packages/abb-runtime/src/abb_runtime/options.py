"""Options that several commands share, each with one name, type and help: the robot, the password, when to end."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import wraps
from math import isnan
from pathlib import Path
from threading import Event as Flag
from threading import Thread
from types import FrameType
from typing import Any

import click

from abb_protocols.catalogue import message
from abb_protocols.errors import SettingsError
from abb_protocols.robot.gripper_values import GripperModules
from abb_runtime.rws.login import MAX_PORT, PASSWORD_VARIABLE, password_of_environment

_OTHERS_MAY_NOT = 0o077  # read, write or enter


class OptionNumber(click.FloatRange):
    """A number with a range; "nan", which no range refuses, is refused, too."""

    def __init__(self, noun: str, lowest: float, highest: float, *, is_open: bool) -> None:
        super().__init__(lowest, highest, min_open=is_open)
        self._noun = noun

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        if isnan(number):
            self.fail(f"{value!r} is not a {self._noun}.", param, ctx)
        return number


FILE_TYPE = click.Path(exists=True, dir_okay=False, path_type=Path)
FOLDER_TYPE = click.Path(file_okay=False, path_type=Path)
NEW_FILE_TYPE = click.Path(dir_okay=False, path_type=Path)
_GRIPPER_MODULES = click.Choice([modules.value for modules in GripperModules])
ARM_TYPE = click.Choice(["right", "left"])
ARMS_TYPE = click.Choice(["right", "left", "both"])
_PORT = click.IntRange(1, MAX_PORT)
FACTOR_TYPE = OptionNumber("factor", 0.01, 1.0, is_open=False)
TIME_TYPE = OptionNumber("time", 0.0, 3600.0, is_open=True)

Command = Callable[..., Any]
OptionDecorator = Callable[[Command], Command]


class SharedCommand(click.Command):
    """A command of several command lines: ``{command}`` in its help is what starts it, such as ``yumi rapid check``."""

    def get_help(self, ctx: click.Context) -> str:
        return super().get_help(ctx).replace("{command}", ctx.command_path)


# ---- one option for one thing: its name, type and help are the same in every command that has it

until_stdin_closes_option = click.option(
    "--until-stdin-closes", is_flag=True, help="End when standard input does (for a parent process)."
)
listen_option = click.option("--listen", default="127.0.0.1", show_default=True, help="Address to listen on.")
page_port_option = click.option(
    "--port", type=click.IntRange(0, MAX_PORT), default=8090, show_default=True, help="0 takes a free one."
)
https_option = click.option(
    "--https", is_flag=True, help="Serve over HTTPS, with a certificate that this installation makes."
)
yes_option = click.option("--yes", is_flag=True, help="Do not ask.")
dry_run_option = click.option("--dry-run", is_flag=True, help="Show what would change, and change nothing.")
cfg_option = click.option(
    "--cfg", multiple=True, type=FILE_TYPE, help="System parameters to add, such as your EIO.cfg; may be repeated."
)
model_option = click.option(
    "--model",
    type=click.Choice(["yumi", "irb14050", "irb120"]),
    default="yumi",
    show_default=True,
    help="The robot: a YuMi, a single-arm YuMi, or an IRB 120 of six axes (both T_ROB1, ROB_1).",
)

SETTINGS_HELP = "as in the settings"
ONCE_HELP = "Only once: a program ends with main, a topic gives one message."
"""The help of ``--once``."""

DRIVER_HELP = "that of the running driver"
STARTED_HELP = "a virtual one that is started"
"""What ``--robot`` is in its absence."""


def robot_option(without: str = DRIVER_HELP, default: str | None = None) -> OptionDecorator:
    """``--robot``: the robot by the address of its controller, also where a command uses its driver.

    Args:
        without: which one it is without the option, for the help.
        default: address without the option.
    """
    return click.option(
        "--robot",
        metavar="ADDRESS[:PORT]",
        default=default,
        show_default=default is not None or without,
        help="Address of the robot's controller; without PORT it is 8080 on this machine, else 80.",
    )


def user_option(default: str | None = None) -> OptionDecorator:
    """``--user``, with the settings' one where there is no default."""
    shown = default is not None or SETTINGS_HELP
    return click.option("--user", default=default, show_default=shown, help="User name on the controller.")


def egm_port_options(left: int | None = None, right: int | None = None) -> OptionDecorator:
    """Where EGM's datagrams arrive, for the commands that receive them, or send them there."""

    def with_options(command: Command) -> Command:
        for word, port in (("right", right), ("left", left)):
            command = click.option(
                f"--{word}-egm-port",
                type=_PORT,
                default=port,
                show_default=port is not None or SETTINGS_HELP,
                help=f"UDP port where the {word} arm's datagrams arrive.",
            )(command)
        return command

    return with_options


def gripper_options(command: Command) -> Command:
    """The modules of both grippers."""
    for word in ("left", "right"):
        command = click.option(
            f"--{word}-gripper",
            type=_GRIPPER_MODULES,
            default="servo",
            show_default=True,
            help=f"Modules of the {word} gripper.",
        )(command)
    return command


def speed_scale_option(without: str = "1 on this machine, 0.1 elsewhere") -> OptionDecorator:
    """``--speed-scale``, with what it is in its absence."""
    return click.option("--speed-scale", type=FACTOR_TYPE, show_default=without, help="Factor on all speeds.")


def arm_option(without: str) -> OptionDecorator:
    """``--arm`` of commands that are about one arm or another; those that act on an arm take it as an argument."""
    return click.option("--arm", type=ARM_TYPE, show_default=without, help="Which arm.")


def count_option(default: int | None = None) -> OptionDecorator:
    """``--count`` of commands that print line after line."""
    return click.option("--count", type=click.IntRange(1), default=default, help="End after so many.")


def timeout_option(default: float | None = None) -> OptionDecorator:
    """``--timeout``, of a wait or a motion."""
    return click.option("--timeout", type=TIME_TYPE, default=default, show_default=True, help="Longest time [s].")


def stream_option(default: bool) -> OptionDecorator:
    """``--stream`` of commands that can see whether EGM works."""
    return click.option(
        "--stream/--no-stream",
        default=default,
        show_default=True,
        help="Receive EGM of both arms for some seconds, to see that it arrives; it asks first.",
    )


def picture_option(without: str) -> OptionDecorator:
    """``--picture``, with where it goes, or what becomes of it, without the option."""
    return click.option("--picture", type=NEW_FILE_TYPE, show_default=without, help="File of the picture.")


def output_option(default: str, *, is_shown_only: bool = False) -> OptionDecorator:
    """``--output`` of commands that write several files; the default may be one that depends on the time."""
    return click.option(
        "--output",
        type=FOLDER_TYPE,
        default=None if is_shown_only else Path(default),
        show_default=default,
        help="Folder of the files that are written.",
    )


def logs_option(default: str) -> OptionDecorator:
    """``--logs`` of commands that start others."""
    return click.option(
        "--logs",
        type=FOLDER_TYPE,
        default=Path(default),
        show_default=True,
        help="Folder for the output of the processes that are started.",
    )


# ---- --json


class JsonOutput:
    """Where ``--json`` writes: to standard output in place of the text, to a file beside the text, or nowhere.

    Args:
        target: the option's value; None without the option.
    """

    def __init__(self, target: str | None) -> None:
        self._target = target
        self._has_begun = False

    @property
    def is_printed(self) -> bool:
        """Whether it is all that may be printed."""
        return self._target == "-"

    def say(self, text: object) -> None:
        """Print a text for people, where the document is not all that may be printed."""
        if not self.is_printed:
            click.echo(text)

    def write(self, text: str) -> None:
        """Write a document, or the next one, each in lines of its own.

        Raises:
            SettingsError: the file cannot be written.
        """
        if self._target is None:
            return
        if self.is_printed:
            click.echo(text)
            return
        file = Path(self._target)
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            with file.open("a" if self._has_begun else "w", encoding="utf-8") as opened:
                opened.write(f"{text}\n")
        except OSError as error:
            raise SettingsError(
                message("json_not_writable", file=str(file), reason=error.strerror or str(error))
            ) from error
        self._has_begun = True


json_option = click.option(
    "--json",
    "json_output",
    is_flag=False,
    flag_value="-",
    metavar="[FILE]",
    type=click.Path(dir_okay=False, allow_dash=True),
    callback=lambda context, parameter, target: JsonOutput(target),
    help="Print JSON and nothing else; with FILE (*.json), write it there as well as the text.",
)


def with_json_targets(arguments: Sequence[str]) -> list[str]:
    """The arguments with ``--json=-`` where ``--json`` is not followed by ``-`` or the name of a .json file.

    Click would take any argument behind it as its file: ``yumi rapid check --json pick.mod`` would overwrite pick.mod.
    """
    targets: list[str] = []
    for argument, following in zip(arguments, (*arguments[1:], ""), strict=False):
        if argument == "--":
            return [*targets, *arguments[len(targets) :]]
        is_alone = argument == "--json" and following != "-" and not following.endswith(".json")
        targets.append("--json=-" if is_alone else argument)
    return targets


# ---- passwords


def password_options(command: Command) -> Command:
    """Options that give ``command`` a ``password``: from a file, a prompt or the environment, else None.

    There is no option for the password itself: every user of the machine can read the arguments of a process.
    """

    @click.option(
        "--password-file",
        type=click.Path(dir_okay=False, path_type=Path),
        help=f"File with the password of the user; or set {PASSWORD_VARIABLE}.",
    )
    @click.option("--ask-password", is_flag=True, help="Ask for the password on the terminal.")
    @wraps(command)
    def with_password(*args: Any, password_file: Path | None, ask_password: bool, **options: Any) -> Any:
        return command(*args, password=_password(password_file, ask_password), **options)

    return with_password


def _password(file: Path | None, is_asked: bool) -> str | None:
    if file and is_asked:
        raise SettingsError(message("password_given_twice"))
    if is_asked:
        return str(click.prompt("Password", hide_input=True, err=True))
    if not file:
        return password_of_environment()
    try:  # the first line of the file
        with file.open(encoding="utf-8") as opened:
            mode = os.fstat(opened.fileno()).st_mode
            password = opened.readline().rstrip("\r\n")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror or str(error) if isinstance(error, OSError) else message("not_utf8_text")
        raise SettingsError(message("password_file_unreadable", file=str(file), reason=reason)) from error
    if mode & _OTHERS_MAY_NOT:
        raise SettingsError(message("password_file_open_to_others", file=str(file)))
    if not password:
        raise SettingsError(message("password_file_empty", file=str(file)))
    return password


# ---- the end


def end_flag(until_stdin_closes: bool = False) -> Flag:
    """A flag that Ctrl-C, a termination request, a closed terminal or the end of standard input sets."""
    is_over = Flag()

    def end(number: int, frame: FrameType | None) -> None:
        is_over.set()

    def wait_for_end_of_input() -> None:
        with suppress(OSError):  # an input that cannot be read has ended
            while os.read(sys.stdin.fileno(), 4096):
                continue
        is_over.set()

    for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(each, end)
    if until_stdin_closes:
        Thread(target=wait_for_end_of_input, name="stdin", daemon=True).start()
    return is_over
