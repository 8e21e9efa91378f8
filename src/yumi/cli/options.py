"""What several commands share: options, the password, who sees the ROS 2 graph of the driver, and when to end."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import wraps
from math import isnan
from pathlib import Path
from threading import Event as Flag
from threading import Thread
from types import FrameType
from typing import Any

import click

from yumi.driver.settings import MAX_PORT, PASSWORD_VARIABLE, Settings, override, password_of_environment, read_settings
from yumi.errors import MissingPrerequisite, SettingsError
from yumi.robot.gripper import GripperModules

ROS_ARGUMENTS = "yumi.ros_arguments"
"""Where a command's context has what came after ``--ros-args``."""

_OTHERS_MAY_NOT = 0o077  # read, write or enter
_DISCOVERY = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_DISCOVERY_VARIABLES = (_DISCOVERY, "ROS_STATIC_PEERS", "ROS_LOCALHOST_ONLY", "ROS_DISCOVERY_SERVER")
"""ROS's own variables that say who finds whom; the first three are rmw's, the last one is Fast DDS's."""


class Measure(click.FloatRange):
    """A number with a range; "nan", which no range refuses, is refused, too."""

    def __init__(self, noun: str, lowest: float, highest: float, *, is_open: bool) -> None:
        super().__init__(lowest, highest, min_open=is_open)
        self._noun = noun

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        if isnan(number):
            self.fail(f"{value!r} is not a {self._noun}.", param, ctx)
        return number


FILE = click.Path(exists=True, dir_okay=False, path_type=Path)
GRIPPER_MODULES = click.Choice([modules.value for modules in GripperModules])
PORT = click.IntRange(1, MAX_PORT)
ROBOT_MODEL = click.Choice(["yumi", "irb14050", "irb120"])
SCALE = Measure("factor", 0.01, 1.0, is_open=False)
config_option = click.option(
    "--config", type=click.Path(path_type=Path), help="Settings instead of the delivered yumi.yaml."
)
until_stdin_closes_option = click.option(
    "--until-stdin-closes", is_flag=True, help="End when standard input does (for a parent process)."
)


def robot_options(robot_help: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Options that say where the robot is, see :func:`settings_of`."""

    def with_options(command: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(
            (
                click.option("--robot", help=robot_help),
                click.option("--rws-port", type=PORT, help="HTTP port of its Robot Web Services."),
                click.option("--left-egm-port", type=PORT, help="UDP port where the left arm's datagrams arrive."),
                click.option("--right-egm-port", type=PORT, help="UDP port where the right arm's datagrams arrive."),
                click.option("--user", help="User name on the controller."),
                password_options,
            )
        ):
            command = option(command)
        return command

    return with_options


def settings_of(config: Path | None, options: Mapping[str, Any]) -> Settings:
    """The settings of a file, or the delivered ones, with the options of the command line that are given."""
    names = {
        "robot": {
            "robot": "address",
            "rws_port": "rws_port",
            "user": "user",
            "password": "password",
            "speed_scale": "speed_scale",
        },
        "egm": {"left_egm_port": "left_port", "right_egm_port": "right_port"},
        "ros": {
            "bringup": "bringup",
            "initial_joint_controller": "initial_joint_controller",
            "namespace": "namespace",
            "prefix": "prefix",
            "frame_prefix": "frame_prefix",
        },
    }
    values = {
        group: {name: options[option] for option, name in entries.items() if options.get(option) is not None}
        for group, entries in names.items()
    }
    return override(read_settings(config), values, "command line")


def password_options(command: Callable[..., Any]) -> Callable[..., Any]:
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
        raise SettingsError("The password is given twice; give --password-file or --ask-password.")
    if is_asked:
        return str(click.prompt("Password", hide_input=True, err=True))
    if not file:
        return password_of_environment()
    try:  # the first line of the file
        with file.open(encoding="utf-8") as opened:
            mode = os.fstat(opened.fileno()).st_mode
            password = opened.readline().rstrip("\r\n")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise SettingsError(f"Cannot read the password file {file}: {reason}.") from error
    if mode & _OTHERS_MAY_NOT:
        raise SettingsError(f"Other users can read the password file {file}; close it with: chmod 600 {file}")
    if not password:
        raise SettingsError(f"The password file {file} has an empty first line; write the password there.")
    return password


def limit_discovery(*, is_open: bool = False) -> str:
    """Let only this machine see the ROS 2 nodes of this process and its children, unless the network is opened.

    Args:
        is_open: whether the whole subnet sees them; ROS's own variables win over it.

    Returns:
        Who sees them, as a sentence.
    """
    given = [f"{name}={os.environ[name]}" for name in _DISCOVERY_VARIABLES if os.environ.get(name)]
    if given:
        return f"ROS 2 discovery is as the environment says: {', '.join(given)}."
    if is_open:
        domain = os.environ.get("ROS_DOMAIN_ID", "0")
        return f"ROS 2 is open to the subnet: every machine with ROS_DOMAIN_ID={domain} in it can move the robot."
    os.environ[_DISCOVERY] = "LOCALHOST"
    return "ROS 2 is visible on this machine only; --network opens it to the subnet."


def demand_ros(otherwise: str = "") -> None:
    """Raise MissingPrerequisite where ROS 2 cannot be imported; ``otherwise`` names what works without it."""
    try:
        import control_msgs  # noqa: F401, PLC0415
        import rclpy  # noqa: F401, PLC0415
    except ImportError as error:
        raise MissingPrerequisite(
            f"ROS 2 is missing ({error}): install yumi-ros2[ros] from a wheel that `make wheels` has built for this "
            f"Python, run `make setup` in a clone, or source your ROS 2 Jazzy{otherwise}."
        ) from error


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
