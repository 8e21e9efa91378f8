"""Refusals of ROS 2 topics, services, actions and parameters, and the ends of the dual-arm task."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

ROS: Mapping[str, Text] = {
    # ---- start
    "ros_does_not_start": Text(
        "ROS 2 does not start: {why}",
        "set ROS_LOG_DIR to a folder that can be written, or unset it, and check ROS_DOMAIN_ID, RMW_IMPLEMENTATION "
        "and the --ros-args",
    ),
    "ros_makes_no_nodes": Text(
        "ROS 2 cannot make its nodes: {why}",
        "see its lines above, and that the limits of this program are not too low (ulimit -n, ulimit -v)",
    ),
    # ---- commands on topics
    "command_refused": Text("{noun} refused: {reason}", "{reason:remedy}"),
    "command_waited": Text(
        "it waited for {waited:.1f} s in the driver and may be from before a stop, at most {longest:g} s are allowed",
        "send it again",
    ),
    "stamp_too_old": Text(
        "its stamp is {age:.2f} s old, and twist.timeout is {longest:g} s",
        "compare the clocks of the machines, or leave the stamp empty",
    ),
    "no_controller_for_topic": Text("no {taker} is active on the {arm} arm", "activate one first: {how}"),
    "controller_inactive_on_arm": Text("{controller} is not active on the {arm} arm", "activate it first: {how}"),
    "no_reference_yet": Text("the {arm} arm has no reference yet", "send the goal again"),
    "values_wrong_count": Text("it has {count} values; an arm has {joints} joints"),
    "names_and_values_differ": Text("name has {names} entries, {what} has {values}", "give one {what} for each name"),
    "no_joint_of_arm": Text("{name:quoted} is not a joint of the {arm} arm; it has {joints:list}"),
    "joint_named_twice": Text("{name} is named twice", "give each joint once"),
    "speed_not_finite": Text("{name} is {value}; a speed is a finite number of radians a second"),
    "speed_too_high": Text(
        "{name} is {value:.1°}/s; its highest speed is {highest:.0°}/s",
    ),
    "speed_looks_like_degrees": Text(
        "{name} is {value:.1°}/s; its highest speed is {highest:.0°}/s; {value:g} looks like degrees",
        "give radians per second",
    ),
    "nanoseconds_out_of_range": Text("{name} has {nanoseconds} ns beside its seconds; allowed is 0 to 999999999"),
    # ---- targets of the tool
    "number_not_finite": Text("{name} is {value:g}", "give a finite number"),
    "number_negative": Text("{name} is {value:g}", "give a finite number, not below 0"),
    "arm_still_moved": Text(
        "the {arm} arm still moved; it stops now", "send the target again when it stands, or a stream to servo_pose"
    ),
    "arm_held_from_command": Text(
        "the {arm} arm is held {distance:.1°} from where {controller} commands it to be",
        "deactivate that controller and activate it again: it begins where the arm is",
    ),
    "arm_held_from_command_by": Text(
        "the {arm} arm is held {distance:.1°} from where {controller} commands it to be, by {limited}",
        "deactivate that controller and activate it again: it begins where the arm is",
    ),
    "controller_not_loaded": Text("the {arm} arm has no {controller}", "load it first"),
    "arm_not_at_rest": Text("the {arms:and} arm did not come to rest", "end the stream that leads it first"),
    "line_ended_unreported": Text(
        "the line was ended: the {arms:and} arm was stopped, or another controller took it over; how the line ended "
        "was not reported"
    ),
    "line_ended_unloaded": Text("the line was ended: the controller was unloaded"),
    "one_arm_without_pose": Text("one arm has no pose", "for one alone take its own {controller}/move_linear"),
    "position_unknown": Text("the position of the {arm} arm is not known", "{start_egm}"),
    "arm_angle_not_finite": Text(
        "the arm angle is {value}",
        "give a finite number of radians",
    ),
    "no_posture_with_arm_angle": Text(
        "no posture of the {arm} arm has this pose with this arm angle", "try other angles"
    ),
    "no_joint_positions": Text(
        "the joint positions are not valid",
        "give {joints} finite numbers [rad] in chain order, or none at all",
    ),
    # ---- frames
    "frame_unknown": Text(
        "there is no frame {frame:quoted}",
        "take {base}, {tool}, another frame of the robot, or one on /tf_static that is fixed to one of them",
    ),
    "frame_not_located": Text("where frame {frame:quoted} is, is not known: its {what} is not heard"),
    "frame_not_connected": Text("frame {frame:quoted} is not connected to the robot", "see /tf_static"),
    "frame_not_on_flange": Text(
        "frame {frame:quoted} is not fixed to the flange of the {arm} arm",
        "take one that is, such as {example}, or leave it empty for the tool in use",
    ),
    # ---- controllers, hardware and parameters
    "controller_type_not_here": Text(
        "controller {controller:quoted} cannot be loaded: there is no type {kind:quoted} here", "{advice}"
    ),
    "controller_without_type": Text(
        "controller {controller:quoted} has no type", "set the parameter {controller:cut}.type of {node} to one first"
    ),
    "controller_with_types": Text(
        "controller {controller:quoted} has the types {kinds:quoted}",
        "set the parameter {controller:cut}.type of {node} to one first",
    ),
    "strictness_unknown": Text("strictness {value} is unknown", "choose 1 (best effort) or 2 (strict)"),
    "switch_timed_out": Text("switch controller timed out after {limit:g} seconds"),
    "controllers_are_active": Text("controllers are active: {controllers:list}", "deactivate them first, or force it"),
    "arm_hardware_not_active": Text(
        "the {arm} arm is {state}", "activate its hardware component {component} first ({service})"
    ),
    "state_not_primary": Text("state {number} {label:quoted} is not a primary state", "choose from: {choices}"),
    "parameter_not_accepted": Text("parameter {name:quoted} of {node:quoted}: {why}", "{why:remedy}"),
    "parameter_unknown": Text("parameter {name:quoted} of {node:quoted} does not exist; it has: {known:list}"),
    "parameter_unknown_similar": Text(
        "parameter {name:quoted} of {node:quoted} does not exist; did you mean {similar:quoted}?"
    ),
    "section_of_other_node": Text(
        "{place}: {section} is not the node {node}", "write /**/{controller}, or its namespace before it"
    ),
    # ---- grippers and the robot manager
    "no_finger": Text("{name:quoted} is not a finger of this gripper", "name {fingers:or}, or none"),
    "another_grip_under_way": Text("another command is being carried out", "wait for its end, or cancel it"),
    "failed_and_stopped": Text("{error:sentence} {stop:sentence}"),
    "goal_without_position": Text("the goal has no position", "give that of a finger [m]"),
    "fingers_with_different_values": Text("the fingers cannot have different values of {what}: one motor moves both"),
    "arm_unknown": Text("there is no arm {arm:quoted}", "choose right or left"),
    "mode_not_known": Text("there is no mode {mode:quoted}", "choose one of {modes:list}"),
    "another_mode_change": Text("another set_mode or recover is being carried out", "wait for its result or cancel it"),
    # ---- the dual-arm task
    "not_ready_in_time": Text(
        "{error:sentence} The driver's answer: {answer}",
    ),
    "arm_stopped_before_motion": Text("the {arm} arm was stopped before it moved"),
    "arm_stopped_before_goal": Text("the {arm} arm was stopped {distance:.1°} before its goal"),
    "arm_stopped_on_line": Text("the {arm} arm was stopped on its line"),
    "arm_stopped_on_way": Text("the {arm} arm was stopped on its way to the other one"),
    "gripper_refused_goal": Text("the {arm} gripper refused the goal: {reason}"),
    "controller_not_activated": Text("the {arm} arm's {controller} was not activated: {why}"),
    "did_not_happen": Text("{what} did not happen within {longest:g} s"),
    "did_not_happen_kept_apart": Text("{error:sentence} The driver keeps apart: {pairs}"),
}
