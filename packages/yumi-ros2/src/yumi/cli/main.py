"""The command line: ``yumi <command>``. A refusal is one sentence and an exit code.

A command is loaded when it is asked for: ``yumi controller`` need not wait for what the driver's commands import.
Commands of other packages, such as ``yumi evaluate``, come by the entry-point group ``yumi.commands``.
"""

from __future__ import annotations

import errno
import logging
import re
import sys
from collections.abc import Mapping, Sequence
from importlib.metadata import EntryPoint, entry_points
from typing import Any

import click

from abb_protocols.catalogue import message, speak_as
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import SettingsError, YumiError, missing_extra
from abb_runtime.options import with_json_targets
from yumi import __version__

ROS_ARGUMENTS = "yumi.ros_arguments"
"""Where a command's context has what came after ``--ros-args``."""

_NAMES_NODES = re.compile(r"(?:[^:]*:)?__(?:ns|node|name):=")
"""A rule of rcl's remapping that gives nodes another namespace or name."""

_NAMESPACE = "__ns:="
"""The rule for all nodes; `yumi up` takes it as its option --namespace. A launch file makes it of PushRosNamespace."""

_OPERATE = (
    *("state", "mode", "start", "stop", "recover", "retreat", "move", "grip", "calibrate"),
    *("speed-scale", "controllers", "switch", "shell", "teleop"),
)
_SECTIONS: Mapping[str, tuple[str, ...]] = {
    "Start": ("demo", "controller", "up"),
    "Operate": _OPERATE,
    "ROS 2": ("topics", "echo", "call", "param", "moveit-config"),
    "RAPID and web services": ("rapid", "answer", "rws", "fault"),
    "Look": ("view", "record"),
    "Measure": ("measure", "compare", "tune", "evaluate", "bench"),
    "Set up": ("doctor", "install", "uninstall", "completion"),
}
"""The headings of `yumi --help`, with their commands."""

_OWN: Mapping[str, str] = {
    "answer": "yumi.cli.answer:answer",
    "call": "yumi.cli.graph:call",
    "completion": "yumi.cli.shell:completion",
    "demo": "yumi.cli.demo:demo",
    "doctor": "yumi.cli.doctor:doctor",
    "echo": "yumi.cli.graph:echo",
    "fault": "abb_runtime.fault_command:fault",
    "install": "yumi.cli.install:install",
    "moveit-config": "yumi.cli.moveit:moveit_config",
    "param": "yumi.cli.graph:param",
    "record": "yumi.cli.record:record",
    "rws": "yumi.cli.rws_command:rws",
    "shell": "yumi.cli.shell:shell",
    "teleop": "yumi.cli.teleop:teleop",
    "topics": "yumi.cli.graph:topics",
    "uninstall": "yumi.cli.install:uninstall",
    "up": "yumi.cli.up:up",
    "view": "yumi.cli.view:view",
}
"""Where the commands are, beside those that are made from the driver's table of commands."""

_EXHAUSTED = (errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.ENOSPC, errno.EAGAIN)


class _Commands(click.Group):
    """Turns our errors into one sentence and exit code 1 (2 for wrong settings); leaves ROS's arguments to ROS."""

    def make_context(self, info_name: str | None, args: list[str], *rest: Any, **extra: Any) -> click.Context:
        own, ros = _split_ros_arguments(args)
        own = with_json_targets(own)
        names = [argument.removeprefix(_NAMESPACE) for argument in ros if argument.startswith(_NAMESPACE)]
        if names and own[:1] == ["up"]:
            if any(argument.partition("=")[0] == "--namespace" for argument in own):
                raise click.UsageError(f"--namespace and {_NAMESPACE} both name the namespace; give one of them.")
            # rcl would put it in the place of r and l; it comes before them.
            own += ["--namespace", names[0]]
            places = [index for index, argument in enumerate(ros) if argument.startswith(_NAMESPACE)]
            ros = [argument for index, argument in enumerate(ros) if not {index, index + 1} & {*places}]
        elif own[:1] == ["controller"]:  # a launch file gives its namespace to every program; this one has no nodes
            ros = []
        context = super().make_context(info_name, own, *rest, **extra)
        context.meta[ROS_ARGUMENTS] = ros
        return context

    def format_commands(self, context: click.Context, formatter: click.HelpFormatter) -> None:
        """The commands under headings, all in the same two columns."""
        names = self.list_commands(context)
        width = max(map(len, names))
        known = {name for section in sections().values() for name in section}
        others = {"Others": tuple(name for name in names if name not in known)}
        for heading, section in {**sections(), **others}.items():
            commands = [(name, self.get_command(context, name)) for name in section if name in names]
            rows = [
                (name.ljust(width), command.get_short_help_str(formatter.width - 6 - width))
                for name, command in commands
                if command is not None and not command.hidden
            ]
            if rows:
                with formatter.section(heading):
                    formatter.write_dl(rows)

    def list_commands(self, context: click.Context) -> list[str]:
        return sorted({*super().list_commands(context), *_OWN, *_of_driver(), *_entry_points()})

    def get_command(self, context: click.Context, name: str) -> click.Command | None:
        """A command is loaded only when it is asked for: it may need much, one of another package what is missing."""
        if name in self.commands:
            return self.commands[name]
        if name in _OWN:
            self.add_command(EntryPoint(name, _OWN[name], "yumi.commands").load(), name)
        elif name in _entry_points():
            self.add_command(_load(_entry_points()[name]), name)
        elif name in _of_driver():
            self.add_command(_of_driver()[name], name)
        return super().get_command(context, name)

    def invoke(self, context: click.Context) -> Any:
        try:
            for rule in context.meta[ROS_ARGUMENTS]:
                if _NAMES_NODES.match(rule):
                    raise SettingsError(message("nodes_would_merge", rule=rule))
            speak_as(FrontEnd.SHELL)
            return super().invoke(context)
        except YumiError as error:
            click.echo(f"Error: {error}", err=True)
            sys.exit(2 if isinstance(error, SettingsError) else 1)
        except (OSError, MemoryError) as error:
            if isinstance(error, OSError) and error.errno not in _EXHAUSTED:
                raise
            reason = message("text", text=str(error)) if str(error) else message("no_memory")
            click.echo(f"Error: {message('machine_gives_too_little', reason=reason)}", err=True)
            sys.exit(1)


def sections() -> Mapping[str, tuple[str, ...]]:
    """All commands as `yumi --help` groups them."""
    return {**_SECTIONS, "Operate": (*_OPERATE, *(name for name in _of_driver() if name not in _OPERATE))}


def _of_driver() -> Mapping[str, click.Command]:
    """The commands that are made from the driver's table of commands."""
    from yumi.cli.robot_commands import DRIVER_COMMANDS  # noqa: PLC0415 - most other commands do without

    return {str(each.name): each for each in DRIVER_COMMANDS}


def _entry_points() -> dict[str, EntryPoint]:
    return {each.name: each for each in entry_points(group="yumi.commands")}


def _load(entry_point: EntryPoint) -> click.Command:
    """The command, or one that says what it lacks: ``yumi --help`` must list all commands in either case."""
    try:
        command: click.Command = entry_point.load()
        return command
    except ImportError as error:
        reason = str(error)

    @click.command(
        entry_point.name,
        help=f"Not installed: {reason}.",
        context_settings={"ignore_unknown_options": True, "help_option_names": ["-h", "--help"]},
    )
    @click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
    def missing(arguments: tuple[str, ...]) -> None:
        lack = message("command_installed_in_part", command=entry_point.name, reason=reason)
        if entry_point.value.startswith("yumi_evaluation."):
            raise missing_extra(lack, "yumi-ros2", "evaluation")
        raise missing_extra(lack, "yumi-ros2", "virtual")

    return missing


def _split_ros_arguments(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Our arguments, and those from ``--ros-args`` to ``--`` or to the end, which rclpy reads by itself."""
    own: list[str] = []
    ros: list[str] = []
    is_ours = True
    for argument in arguments:
        if argument == "--ros-args":
            is_ours = False
        elif is_ours:
            own.append(argument)
        elif argument == "--":
            is_ours = True
        else:
            ros.append(argument)
    return own, ros


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="yumi")
def main() -> None:
    """Drive an ABB YuMi from ROS 2, or a virtual one.

    \b
    Examples:
      yumi view --virtual                 a virtual robot in the browser
      yumi demo                           its arms move and grab
      yumi controller                     a virtual controller for any client
      yumi up --robot 192.168.125.1       the driver for a real robot
      yumi install --robot 192.168.125.1  set up a controller; it asks first
      yumi state                          what the driver's robot does
    """
    logging.basicConfig(level=logging.INFO, format="%(levelname)s %(name)s: %(message)s")
    for noisy in ("httpx", "matplotlib"):
        logging.getLogger(noisy).setLevel(logging.WARNING)
