"""Starts the driver, and a virtual robot for it with ``virtual:=true``.

::

    ros2 launch yumi_ros2 yumi.launch.py robot:=192.168.125.1
    ros2 launch yumi_ros2 yumi.launch.py virtual:=true
    ros2 launch yumi_ros2 yumi.launch.py robot:=192.168.125.1 bringup:=true        # motors on, grippers calibrated
    ros2 launch yumi_ros2 yumi.launch.py robot:=192.168.125.1 namespace:=cell1     # one of several robots

The password of a robot is read from the environment variable YUMI_PASSWORD, or from a file. Included in a group with
``PushRosNamespace``, everything is in that namespace, too; give either that or ``namespace``.
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
    ("robot", "192.168.125.1", "Address of the controller, with :PORT where it is not 80."),
    ("wait", "", "Wait so long until a controller answers there [s]; empty: it must answer at once."),
    ("rws_port", "8080", "HTTP port of a virtual controller."),
    ("left_egm_port", "", "UDP port where the left arm's datagrams arrive; empty: as in the settings."),
    ("right_egm_port", "", "UDP port where the right arm's datagrams arrive; empty: as in the settings."),
    ("user", "", "User name on the controller; empty: as in the settings."),
    ("password_file", "", "File with the password of the user; empty: YUMI_PASSWORD, or as in the settings."),
    ("speed_scale", "", "Factor on all speeds; empty: as in the settings, 1 on this machine and 0.1 elsewhere."),
    ("config", "", "Settings instead of the delivered yumi.yaml."),
    ("controllers", "", "Controllers instead of the delivered controllers.yaml."),
    (
        "initial_joint_controller",
        "",
        "Controller that commands the arms after EGM has started; empty: as in the settings.",
    ),
    ("record", "", "Record every cycle of both arms to this MCAP file."),
    (
        "bringup",
        "",
        "Whether the driver brings the robot to ready at start, or only reads until asked; empty: only a virtual one.",
    ),
    ("namespace", "", "Of this robot among several in one ROS graph, such as cell1; all its nodes are under it."),
    ("prefix", "", "What stands before the names of all joints and links, such as a_."),
    ("frame_prefix", "", "What stands before the names of frames on /tf; empty: the namespace and a slash."),
    ("network", "false", "Whether all machines of the subnet find the driver's ROS 2 nodes."),
    ("virtual", "false", "Whether to start a virtual controller, and drive that."),
    ("log_level", "info", "Of the driver: debug, info, warn or error."),
)
EGM_PORTS = ("left_egm_port", "right_egm_port")
PASSED_ON = (
    *("robot", "wait", *EGM_PORTS, "user", "password_file", "speed_scale", "config", "controllers", "record"),
    "initial_joint_controller",
    *("namespace", "prefix", "frame_prefix"),
)


def generate_launch_description() -> LaunchDescription:
    """What ``ros2 launch`` asks for."""
    declared = [DeclareLaunchArgument(name, default_value=value, description=text) for name, value, text in ARGUMENTS]
    return LaunchDescription([*declared, OpaqueFunction(function=_start)])


def _start(context: Any) -> list[Any]:
    given = {name: LaunchConfiguration(name).perform(context) for name, _, _ in ARGUMENTS}
    if given["virtual"].lower() != "true":
        return [_driver(given)]
    given["robot"] = f"127.0.0.1:{given['rws_port']}"
    controller = _command("controller", ["--rws-port", given["rws_port"], *_options(given, EGM_PORTS)])
    waiting = [_driver(given)]

    def start_driver(event: Any) -> list[Any] | None:
        return [waiting.pop()] if waiting and READY in event.text else None

    return [RegisterEventHandler(OnProcessIO(target_action=controller, on_stdout=start_driver)), controller]


def _driver(given: dict[str, str]) -> Node:
    options = _options(given, PASSED_ON)
    if given["bringup"]:
        options.append("--bringup" if given["bringup"].lower() == "true" else "--no-bringup")
    if given["network"].lower() == "true":
        options.append("--network")
    return _command("up", options, ["--log-level", given["log_level"]])


def _options(given: dict[str, str], names: tuple[str, ...]) -> list[str]:
    return [part for name in names if given[name] for part in (f"--{name.replace('_', '-')}", given[name])]


def _command(name: str, options: list[str], ros_arguments: list[str] | None = None) -> Node:
    return Node(
        package="yumi_ros2",
        executable="yumi",
        arguments=[name, *options],
        ros_arguments=ros_arguments or [],
        output="screen",
        on_exit=Shutdown(reason=f"yumi {name} has ended"),
    )
