"""Starts the driver, and a virtual robot for it with ``virtual:=true``.

::

    ros2 launch yumi_ros2 yumi.launch.py robot:=192.168.125.1
    ros2 launch yumi_ros2 yumi.launch.py virtual:=true
    ros2 launch yumi_ros2 yumi.launch.py robot:=192.168.125.1 bringup:=false       # touch nothing until it is asked

The password of a robot is read from the environment variable YUMI_PASSWORD.
"""

from __future__ import annotations

from typing import Any

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, RegisterEventHandler, Shutdown
from launch.event_handlers import OnProcessIO
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

READY = b"Virtual controller ready"
"""What the virtual controller prints when it serves."""

ARGUMENTS = (
    ("robot", "192.168.125.1", "Address of the controller."),
    ("rws_port", "", "HTTP port of its Robot Web Services; empty: as in the settings, or 8080 of a virtual one."),
    ("speed_scale", "", "Factor on all speeds; empty: as in the settings, 1 on this machine and 0.1 elsewhere."),
    ("config", "", "Settings instead of the delivered yumi.yaml."),
    ("controllers", "", "Controllers instead of the delivered controllers.yaml."),
    (
        "initial_joint_controller",
        "",
        "Controller that commands the arms after EGM has started; empty: as in the settings.",
    ),
    ("record", "", "Record every cycle of both arms to this MCAP file."),
    ("bringup", "true", "Whether the driver brings the robot to ready at start; else it only reads until it is asked."),
    ("network", "false", "Whether all machines of the subnet find the driver's ROS 2 nodes."),
    ("virtual", "false", "Whether to start a virtual controller, and drive that."),
    ("log_level", "info", "Of the driver: debug, info, warn or error."),
)
PASSED_ON = ("robot", "rws_port", "speed_scale", "config", "controllers", "initial_joint_controller", "record")
VIRTUAL = {"robot": "127.0.0.1", "rws_port": "8080"}


def generate_launch_description() -> LaunchDescription:
    """What ``ros2 launch`` asks for."""
    declared = [DeclareLaunchArgument(name, default_value=value, description=text) for name, value, text in ARGUMENTS]
    return LaunchDescription([*declared, OpaqueFunction(function=_start)])


def _start(context: Any) -> list[Any]:
    given = {name: LaunchConfiguration(name).perform(context) for name, _, _ in ARGUMENTS}
    if given["virtual"].lower() != "true":
        return [_driver(given)]
    given["robot"], given["rws_port"] = VIRTUAL["robot"], given["rws_port"] or VIRTUAL["rws_port"]
    controller = _command("controller", ["--rws-port", given["rws_port"]])
    waiting = [_driver(given)]

    def start_driver(event: Any) -> list[Any] | None:
        return [waiting.pop()] if waiting and READY in event.text else None

    return [RegisterEventHandler(OnProcessIO(target_action=controller, on_stdout=start_driver)), controller]


def _driver(given: dict[str, str]) -> Node:
    options = [part for name in PASSED_ON if given[name] for part in (f"--{name.replace('_', '-')}", given[name])]
    options.append("--bringup" if given["bringup"].lower() == "true" else "--no-bringup")
    if given["network"].lower() == "true":
        options.append("--network")
    return _command("up", options, ["--log-level", given["log_level"]])


def _command(name: str, options: list[str], ros_arguments: list[str] | None = None) -> Node:
    return Node(
        package="yumi_ros2",
        executable="yumi",
        arguments=[name, *options],
        ros_arguments=ros_arguments or [],
        output="screen",
        on_exit=Shutdown(reason=f"yumi {name} has ended"),
    )
