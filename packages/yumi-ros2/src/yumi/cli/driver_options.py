"""What commands of the driver share: settings, with the options that go over them, and who sees the ROS 2 graph."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from abb_protocols.catalogue import message
from abb_protocols.errors import MissingPrerequisite
from abb_runtime.options import SETTINGS_HELP, Command, OptionDecorator, password_options, robot_option, user_option
from yumi.driver.settings import Settings, address_values, override, read_settings

_DISCOVERY = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_DISCOVERY_VARIABLES = (_DISCOVERY, "ROS_STATIC_PEERS", "ROS_LOCALHOST_ONLY", "ROS_DISCOVERY_SERVER")
"""ROS's own variables that say who finds whom; the first three are rmw's, the last one is Fast DDS's."""

config_option = click.option(
    "--config", type=click.Path(path_type=Path), help="Settings instead of the delivered yumi.yaml."
)


bringup_option = click.option(
    "--bringup/--no-bringup",
    default=None,
    help="Bring the robot to ready: motors on, RAPID started, grippers calibrated. Unless given, a robot on this "
    "machine is brought to ready, and a real one is not.",
)


def robot_options(without: str = SETTINGS_HELP) -> OptionDecorator:
    """Options that say where the robot is and who logs in, see :func:`settings_of`."""

    def with_options(command: Command) -> Command:
        for option in (password_options, user_option(), robot_option(without)):
            command = option(command)
        return command

    return with_options


def settings_of(config: Path | None, options: Mapping[str, Any]) -> Settings:
    """The settings of a file, or the delivered ones, with the options of the command line that are given."""
    names = {
        "robot": {
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
    if options.get("robot") is not None:
        values["robot"] |= address_values(options["robot"])
    return override(read_settings(config), values, "command line")


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


def demand_ros(*, for_driver: bool = False) -> None:
    """Raise MissingPrerequisite where ROS 2 cannot be imported; a driver works without it, which is said then."""
    try:
        import control_msgs  # noqa: F401, PLC0415
        import rclpy  # noqa: F401, PLC0415
    except ImportError as error:
        raise MissingPrerequisite(
            message("ros_missing_for_driver" if for_driver else "ros_missing", reason=str(error))
        ) from error
