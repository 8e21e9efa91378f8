"""``yumi moveit-config``: files for MoveIt."""

from __future__ import annotations

from pathlib import Path

import click

from yumi.robot.gripper import GripperModules
from yumi.robot.joints import Side

_MODULES = click.Choice([modules.value for modules in GripperModules])


@click.command("moveit-config")
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--right-gripper", type=_MODULES, default="servo", show_default=True, help="Its modules.")
@click.option("--left-gripper", type=_MODULES, default="servo", show_default=True, help="And of the left one.")
def moveit_config(folder: Path, right_gripper: str, left_gripper: str) -> None:
    """Write a MoveIt configuration package of this robot into FOLDER.

    \b
    Examples:
      yumi moveit-config ~/ros2_ws/src/yumi_moveit_config
      yumi moveit-config yumi_moveit_config --right-gripper servo+vacuum
    """
    from yumi.planning.moveit import write_moveit_config  # noqa: PLC0415 - a quick --help

    write_moveit_config(folder, {Side.RIGHT: GripperModules(right_gripper), Side.LEFT: GripperModules(left_gripper)})
    click.echo(f"Written: {folder}. Copy it into a workspace with MoveIt, build it there, start yumi up, then")
    click.echo("ros2 launch yumi_moveit_config move_group.launch.py")
