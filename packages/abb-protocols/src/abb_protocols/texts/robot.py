"""The model of the robot: named poses, kinematics, what is declared beside the arms, tools and grippers."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

_NAMES: Mapping[str, tuple[str, str]] = {
    "one_too_many": ("it is one of {count}, allowed are {most}", ""),
    "without_name": ("it has no name", "give one such as table or needle"),
    "named_as_robot": ("a part of the robot has this name", "give another one"),
    "named_twice": ("another one has this name", "give each a name of its own"),
}

ROBOT: Mapping[str, Text] = {
    "pose_moved_along_unknown_frame": Text("pose refused: the frame is {frame:quoted}", "choose 'base' or 'tool'"),
    "pose_moved_by_no_numbers": Text("pose refused: moved by {by:list}", "give finite numbers [m]"),
    "pose_name_unknown": Text("goal refused: there is no pose {name:quoted}; there are {poses:list}"),
    # ---- kinematics
    "pose_not_reached": Text(
        "the {arm} arm does not reach the pose from where it is: the nearest posture misses it by {miss:.4f} (metres "
        "and radians)",
        "choose a pose within reach, or another arm angle",
    ),
    "pose_beyond_range": Text(
        "the {arm} arm would leave the range of its joint {joint} of 7 ({lower:.1°} to {upper:.1°}): the pose needs "
        "{position:.1°}",
        "choose another arm angle or configuration",
    ),
    "nearest_pose": Text(
        "{reason:sentence} The nearest that was found is tool0 at x {x:.3f}, y {y:.3f}, z {z:.3f} m, {distance:.0mm} "
        "and {turn:.1°} away"
    ),
    "nearest_arm_angle": Text("{reason:sentence} With arm angle {angle:.0°} there is one"),
    "path_lost": Text("the arm cannot follow the path beyond its pose {pose}"),
    # ---- what is declared for collision avoidance
    **{
        f"tool_{fault}": Text(f"tool {{name:quoted}} of the {{arm}} arm refused: {what}", remedy)
        for fault, (what, remedy) in _NAMES.items()
    },
    **{
        f"box_{fault}": Text(f"box {{name:quoted}} refused: {what}", remedy) for fault, (what, remedy) in _NAMES.items()
    },
    "core_not_loaded": Text(
        "the core, which limits what the arms are sent, cannot be loaded: {error}",
        "if it is damaged or of another machine, remove {path}: it is compiled anew then",
    ),
    "compiler_missing": Text(
        "the core, which limits what the arms are sent, must be compiled, and no C++ compiler was found",
        "install one (Debian, Ubuntu: apt install g++), name one in CXX, or install yumi-ros2 from a wheel, which "
        "contains it compiled",
    ),
    "ruckig_without_library": Text(
        "the core, which limits what the arms are sent, must be compiled with Ruckig, and the ruckig that is installed "
        "is not PyPI's wheel, which contains its C++ library",
        "pip install --force-reinstall ruckig",
    ),
    "core_not_compiled": Text(
        "the core, which limits what the arms are sent, could not be compiled: {command}\n{output}"
    ),
    "core_not_written": Text("the core, which limits what the arms are sent, could not be compiled: {error}"),
    # ---- tools and loads
    "load_not_finite": Text("the {part} has a value that is not finite: {values}", "give finite numbers"),
    "load_out_of_range": Text(
        "the {part} has {mass:g} kg at {distance:g} m from the flange",
        "give a mass from 0 to {most:g} kg, at most {farthest:g} m away",
    ),
    "inertia_negative": Text("the {part} has a negative moment of inertia", "give that about its own centre"),
    "load_too_heavy": Text(
        "tool and payload have {mass:g} kg together; an arm carries up to {most:g} kg, its gripper included"
    ),
    "tcp_too_far": Text("the TCP is at {position:list}", "give a place up to {farthest:g} m from the flange"),
    "tcp_not_unit": Text(
        "the TCP's orientation {orientation:list} is not a unit quaternion", "give a unit quaternion as w, x, y, z"
    ),
    # ---- grippers
    "gripper_state_unknown": Text(
        "the gripper reports state {state:g}, which no Smart Gripper has",
        "check its firmware and its fieldbus configuration",
    ),
    "gripper_position_out_of_range": Text(
        "gripper position {position} m is out of range; each finger travels 0 to {most} m"
    ),
    "gripper_force_out_of_range": Text("gripper force {force} N is out of range; allowed is above 0 to {most:g} N"),
    "gripper_speed_out_of_range": Text(
        "gripper speed {speed} m/s is out of range; each finger moves with {lowest} to {highest} m/s"
    ),
    "gripper_effort_out_of_range": Text(
        "gripper effort {effort} N is out of range; allowed is 0 (the usual force) to {most:g} N"
    ),
}
