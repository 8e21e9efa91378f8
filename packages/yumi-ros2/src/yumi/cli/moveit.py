"""``yumi moveit-config``: a MoveIt configuration package of this robot, as files to copy and change.

MoveIt plans, this driver executes: each group of the SRDF has a ``FollowJointTrajectory`` action of the driver, and the
grippers their ``GripperCommand``.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
import yaml

from abb_protocols.catalogue import message
from abb_protocols.errors import SettingsError
from abb_protocols.robot.gripper_values import TOP_FINGER_SPEED, GripperModules
from abb_protocols.robot.joints import YUMI_LIMITS, Side, finger_names, joint_names
from abb_protocols.robot.urdf import robot_description
from abb_runtime.options import gripper_options
from yumi.driver.controller_names import DUAL_ARM_CONTROLLER


@click.command("moveit-config")
@click.argument("folder", type=click.Path(path_type=Path))
@gripper_options
def moveit_config(folder: Path, right_gripper: str, left_gripper: str) -> None:
    """Write a MoveIt configuration package of this robot.

    \b
    Examples:
      yumi moveit-config ~/ros2_ws/src/yumi_moveit_config
      yumi moveit-config yumi_moveit_config --right-gripper servo+vacuum
    """
    _write_moveit_config(folder, {Side.RIGHT: GripperModules(right_gripper), Side.LEFT: GripperModules(left_gripper)})
    click.echo(f"Written: {folder}. Copy it into a workspace with MoveIt, build it there, start yumi up, then")
    click.echo("ros2 launch yumi_moveit_config move_group.launch.py")


_PACKAGE = "yumi_moveit_config"

_PACKAGE_XML = f"""<?xml version="1.0"?>
<package format="3">
  <name>{_PACKAGE}</name>
  <version>0.1.0</version>
  <description>MoveIt for an ABB YuMi driven by yumi-ros2; written by yumi moveit-config</description>
  <maintainer email="you@example.com">you</maintainer>
  <license>Apache-2.0</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <exec_depend>moveit_ros_move_group</exec_depend>
  <exec_depend>moveit_planners</exec_depend>
  <exec_depend>moveit_kinematics</exec_depend>
  <exec_depend>moveit_simple_controller_manager</exec_depend>
  <exec_depend>moveit_configs_utils</exec_depend>
  <exec_depend>moveit_ros_visualization</exec_depend>
  <export><build_type>ament_cmake</build_type></export>
</package>
"""

_CMAKE = f"""cmake_minimum_required(VERSION 3.22)
project({_PACKAGE})
find_package(ament_cmake REQUIRED)
install(DIRECTORY config launch DESTINATION share/${{PROJECT_NAME}})
install(FILES .setup_assistant DESTINATION share/${{PROJECT_NAME}})
ament_package()
"""

_LAUNCH = f'''"""MoveIt's move_group and, unless rviz:=false, RViz. The driver (yumi up) is started on its own."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from moveit_configs_utils import MoveItConfigsBuilder


def generate_launch_description():
    config = MoveItConfigsBuilder("yumi", package_name="{_PACKAGE}").to_moveit_configs()
    group = Node(package="moveit_ros_move_group", executable="move_group", parameters=[config.to_dict()])
    rviz = Node(
        package="rviz2",
        executable="rviz2",
        parameters=[config.robot_description, config.robot_description_semantic, config.robot_description_kinematics],
        condition=IfCondition(LaunchConfiguration("rviz")),
    )
    return LaunchDescription([DeclareLaunchArgument("rviz", default_value="true"), group, rviz])
'''

_SETUP_ASSISTANT = """moveit_setup_assistant_config:
  urdf:
    package: yumi_moveit_config
    relative_path: config/yumi.urdf
  srdf:
    relative_path: config/yumi.srdf
"""


def _write_moveit_config(folder: Path, grippers: Mapping[Side, GripperModules] | None = None) -> None:
    """Write the package into ``folder``, which must be new or empty.

    Raises:
        SettingsError: there is something in the folder.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise SettingsError(message("folder_not_empty", folder=str(folder)))
    for path, text in moveit_files(grippers).items():
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")


def moveit_files(grippers: Mapping[Side, GripperModules] | None = None) -> Mapping[str, str]:
    """The package's files, text by path; ``grippers`` are the modules of each arm's gripper."""
    from yumi.planning.scene_description import GROUPS, semantic_description  # noqa: PLC0415 - a quick --help

    modules = grippers or dict.fromkeys(Side, GripperModules.SERVO)
    joint_limits: dict[str, Any] = {}
    for side in Side:
        rows = zip(joint_names(side), YUMI_LIMITS.velocity, YUMI_LIMITS.acceleration, YUMI_LIMITS.jerk, strict=True)
        for name, velocity, acceleration, jerk in rows:
            joint_limits[name] = {
                "has_velocity_limits": True,
                "max_velocity": round(velocity, 6),
                "has_acceleration_limits": True,
                "max_acceleration": acceleration,
                "has_jerk_limits": True,
                "max_jerk": jerk,
            }
        for name in finger_names(side):
            joint_limits[name] = {"has_velocity_limits": True, "max_velocity": TOP_FINGER_SPEED}
    arms = {
        f"{side.value}/joint_trajectory_controller": {
            "type": "FollowJointTrajectory",
            "action_ns": "follow_joint_trajectory",
            "default": True,
            "joints": list(joint_names(side)),
        }
        for side in Side
    }
    ends = {
        f"{side.value}/gripper": {
            "type": "GripperCommand",
            "action_ns": "gripper_cmd",
            "default": True,
            "joints": [finger_names(side)[0]],
        }
        for side in Side
    }
    both = {
        DUAL_ARM_CONTROLLER: {
            "type": "FollowJointTrajectory",
            "action_ns": "follow_joint_trajectory",
            "default": True,
            "joints": [name for side in GROUPS["both_arms"] for name in joint_names(side)],
        }
    }
    controllers = {**both, **arms, **ends}
    manager = "moveit_simple_controller_manager"
    execution = {
        "moveit_controller_manager": f"{manager}/MoveItSimpleControllerManager",
        manager: {"controller_names": list(controllers), **controllers},
        # The driver slows down where the joints or the arms' distance ask for it; MoveIt would take it for a failure.
        "trajectory_execution": {"execution_duration_monitoring": False},
    }
    solver = {
        "kinematics_solver": "kdl_kinematics_plugin/KDLKinematicsPlugin",
        "kinematics_solver_search_resolution": 0.005,
        "kinematics_solver_timeout": 0.05,
    }
    cartesian = {"max_trans_vel": 0.25, "max_trans_acc": 1.0, "max_trans_dec": -1.0, "max_rot_vel": 1.57}
    return {
        "package.xml": _PACKAGE_XML,
        "CMakeLists.txt": _CMAKE,
        ".setup_assistant": _SETUP_ASSISTANT,
        "launch/move_group.launch.py": _LAUNCH,
        "config/yumi.urdf": robot_description(YUMI_LIMITS, modules),
        "config/yumi.srdf": semantic_description(),
        "config/kinematics.yaml": _yaml({name: solver for name, sides in GROUPS.items() if len(sides) == 1}),
        "config/joint_limits.yaml": _yaml(
            {
                "default_velocity_scaling_factor": 0.5,
                "default_acceleration_scaling_factor": 0.5,
                "joint_limits": joint_limits,
            }
        ),
        "config/moveit_controllers.yaml": _yaml(execution),
        "config/pilz_cartesian_limits.yaml": _yaml({"cartesian_limits": cartesian}),
    }


def _yaml(content: Mapping[str, Any]) -> str:
    return yaml.safe_dump(dict(content), sort_keys=False)
