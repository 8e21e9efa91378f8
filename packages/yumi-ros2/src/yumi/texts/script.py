"""Refusals of a script, and the ends of its motions and grips."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

_POSTURE = "pose refused: the {arm} arm has no posture"
_PLACE = "for tool0 at x {x:.3f}, y {y:.3f}, z {z:.3f} m and its orientation"
_NEAREST = "or leave the configuration out: it takes the nearest posture then"

SCRIPT: Mapping[str, Text] = {
    # ---- connect
    "fraction_out_of_range": Text("{parameter} is {value}; allowed is above 0 up to 1"),
    "arm_name_unknown": Text("there is no arm {given}", "choose 'right' or 'left'"),
    "connect_arms_unknown": Text("arms is {given}", "name 'right', 'left' or both"),
    "connect_port_twice": Text("the port is given twice, in {address:quoted} and as rws_port={port}", "give it once"),
    "controllers_missing": Text("the controllers of the {arm} arm lack {missing:list}", "add them"),
    "script_not_connected": Text(
        "the robot is not connected", "write `with yumi.connect(...) as robot`, or call open()"
    ),
    "arm_not_named_to_connect": Text("EGM is not started on the {arm} arm", "name it in connect(arms=...)"),
    "arm_sends_no_positions": Text("the robot sends no positions of its {arm} arm: EGM is not running", "{start_egm}"),
    # ---- goals by joints
    "goal_not_angles": Text("goal refused: expected seven angles in radians, got {given}"),
    "goal_position_not_finite": Text(
        "goal refused: position {position} is {value}; a position is a finite number of radians"
    ),
    "goal_joint_count_of_arm": Text("goal refused: it has {count} positions; an arm has {joints} joints: {names:list}"),
    "goal_joint_unknown": Text(
        "goal refused: {joint:quoted} is not a joint of the {arm} arm; its joints are {joints:list}, or j1 to "
        "j{count} for short"
    ),
    "goal_joint_of_other_arm": Text(
        "goal refused: {joint:quoted} is a joint of the {other} arm, and this is the {arm} arm"
    ),
    "goal_scale_no_number": Text("goal refused: {name} is {given}", "give a number above 0 up to 1"),
    "trajectory_point_without_joints": Text(
        "trajectory refused: without {missing:list}; each of its points names all {joints} joints"
    ),
    "trajectory_points_malformed": Text(
        "trajectory refused: each of its points is a time and seven positions, and no more than velocities and "
        "accelerations besides ({error})"
    ),
    "plan_without_position": Text(
        "plan refused: where the {arm} arm is, is not known while EGM does not report it",
        "{start_egm}, then plan again",
    ),
    "arm_moved_since_plan": Text(
        "plan refused: the {arm} arm is {distance:.1°} away from where it was when the plan was made", "plan again"
    ),
    # ---- jogging and streams
    "jog_speeds_malformed": Text("jog refused: expected {count} finite speeds [rad/s] in chain order, got {given}"),
    "jog_too_old": Text("jog refused: it was asked for {age:.2f} s ago, allowed are {oldest:g} s", "press again"),
    "jog_twist_malformed": Text("jog refused: expected {count} velocities of the tool, got {given}"),
    "jog_streamed_by_another": Text(
        "jog refused: another program streams to the {controller} of the {arm} arm", "stop it first"
    ),
    "jogged_by_another": Text(
        "jog refused: another client jogs the {arm} arm", "wait until it has ended its jog, then press again"
    ),
    "jog_switched_by_another": Text(
        "jog refused: another program has switched the controllers of the {arm} arm", "press again to take it back"
    ),
    "jog_while_moving": Text("jog refused: another motion of the {arm} arm is under way", "stop it first"),
    "stream_time_malformed": Text(
        "stream refused: the time of the point is {given}",
        "give seconds by time.monotonic() of the driver's machine, or none: then the moment of the call counts",
    ),
    "stream_time_far": Text(
        "stream refused: the point is for {away:.3f} s from now, by time.monotonic() of the driver's machine; "
        "allowed is {oldest:g} to {newest:g} s",
        "give none where no such time is known: then the moment of the call counts",
    ),
    "stream_velocity_malformed": Text(
        "stream refused: the velocities of the {arm} arm are not {count} finite numbers [rad/s] in chain order"
    ),
    "stream_tracking_unknown": Text("stream refused: tracking is {given:quoted}", "choose {known:or}"),
    "stream_delay_out_of_range": Text(
        "stream refused: delay is {given}; allowed is 0 to {longest:g} s, with tracking 'feed_forward'"
    ),
    "stream_counts_differ": Text(
        "stream refused: it has {names} names and {positions} positions; velocities are as many, or none"
    ),
    "stream_joint_unknown": Text(
        "stream refused: {joint:quoted} is neither a joint of an arm nor of a gripper", "name them as in joint_states"
    ),
    "stream_velocity_without_position": Text("stream refused: the {arm} arm has a velocity and no position"),
    "stream_empty": Text("stream refused: neither an arm nor a gripper has a goal"),
    "gripper_follows_not_by_fault": Text("a gripper does not follow the stream, by a fault of the driver: {error}"),
    "gripper_follows_not": Text("the {arm} gripper does not follow the stream: {reason}", "{reason:remedy}"),
    "stream_grippers_malformed": Text(
        "stream refused: the goal of gripper {arm:quoted} is {given}",
        "give 'right' or 'left' a width [m] from 0, closed, to {most:g}",
    ),
    "cartesian_controller_missing": Text(
        "the {arm} arm has no {controller}, which moves its tool",
        "name it in controllers.yaml as the delivered file does",
    ),
    "twist_frame_unknown": Text("velocity refused: frame is {frame:quoted}", "choose 'base' or 'tool'"),
    "twist_malformed": Text("velocity refused: give three numbers each for linear and angular"),
    # ---- how a wait ended
    "goal_not_reached_yet": Text("the {arm} arm has not reached its goal within {timeout:g} s; it is still on its way"),
    "goal_not_reached_in_time": Text("the {arms:and} arm did not arrive within {timeout:g} s and was stopped"),
    # ---- poses
    "pose_orientation_twice": Text("pose refused: give its orientation as quaternion= or as rpy=, not both"),
    "pose_quaternion_without_direction": Text("pose refused: the quaternion has no direction", "give w, x, y, z"),
    "pose_values_no_numbers": Text("pose refused: {name} is {given}", "give {count} numbers"),
    "pose_values_not_finite": Text("pose refused: {name} is {given}", "give {count} finite numbers"),
    "size_of_box": Text("the size of box {box:quoted}"),
    "box_edge_not_positive": Text("box refused: an edge of {box:quoted} is not longer than 0", "give metres"),
    "tool_name_unknown": Text("there is no tool {name:quoted}; there are {known:list}"),
    "work_object_unknown": Text("there is no work object {name:quoted}; there are {known:list}"),
    "pose_angle_not_finite": Text(
        "pose refused: the arm angle is {given}",
        "give a finite number of radians",
    ),
    "pose_configuration_not_whole": Text(
        "pose refused: configuration is {given}", "give the whole numbers cf1, cf4, cf6 and cfx"
    ),
    "posture_missing": Text(f"{_POSTURE} {_PLACE}, with any arm angle tried", "choose a pose within reach"),
    "posture_missing_at_angle": Text(
        f"{_POSTURE} {_PLACE}, with this arm angle", "choose a pose within reach, or another arm angle"
    ),
    "posture_missing_in_configuration": Text(
        f"{_POSTURE} with configuration ({{configuration:list}}) {_PLACE}, with any arm angle tried",
        f"choose a pose within reach, {_NEAREST}",
    ),
    "posture_missing_in_configuration_at_angle": Text(
        f"{_POSTURE} with configuration ({{configuration:list}}) {_PLACE}, with this arm angle",
        f"choose a pose within reach, or another arm angle, {_NEAREST}",
    ),
    # ---- grippers
    "gripper_width_out_of_range": Text("gripper width {width} m is out of range; allowed is above 0 to {most} m"),
    "object_width_out_of_range": Text("object width {width} m is out of range; allowed is above 0 to {most} m"),
    "gripper_stopped_short": Text(
        "the {gripper} gripper stopped at {width:.1mm} instead of {wanted:.1mm}",
        "look at what is in the way",
    ),
    "gripper_holds_nothing": Text("the {gripper} gripper holds nothing: it is {outcome}"),
    "gripper_holds_other_width": Text(
        "the {gripper} gripper holds something {width:.1mm} wide, not {wanted:.1mm}; it holds on"
    ),
    "vacuum_picked_nothing": Text(
        "vacuum {channel} of the {gripper} gripper has picked nothing: {pressure:.0f} Pa after {timeout:g} s, "
        "{needed:.0f} Pa or less are needed"
    ),
}
