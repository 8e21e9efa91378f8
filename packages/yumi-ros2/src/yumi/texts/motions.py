"""Motions: goals, trajectories and tool paths, why they are refused and how they end, and the controllers."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

_RANGE = "its range is {lower:.1°} to {upper:.1°}"

_GOALS: Mapping[str, tuple[str, str]] = {
    "goal_joint_not_finite": ("{joint} is {value}; a position is a finite number of radians", ""),
    "goal_joint_out_of_range": (f"{{joint}} is {{position:.1°}}; {_RANGE}", ""),
    "goal_joint_in_degrees": (
        f"{{joint}} is {{position:.1°}}; {_RANGE}; {{position:g}} looks like degrees",
        "{give_radians}",
    ),
    "goal_joint_count": ("it has {count} positions; an arm has {joints} joints", ""),
    "goal_scale_out_of_range": ("{name} is {value:g}; allowed is above 0 up to 1", ""),
    "goal_turn_too_fast": (
        "axis {axis} is too fast to turn round within its range ({lower:.1°} to {upper:.1°}) at this acceleration",
        "ask for a higher one or let the arm stop first",
    ),
    "goal_without_motion": (
        "no motion within the limits leads there from ({start:.4g}) rad ({result})",
        "let the arm come to rest first",
    ),
}

_TRAJECTORIES: Mapping[str, tuple[str, str]] = {
    # ---- its form
    "trajectory_too_long": (
        "it has {points} points; at most {most} are taken",
        "leave out points, or send it in several goals",
    ),
    "trajectory_without_joints": ("it names no joints", "name {joints:list}"),
    "trajectory_joint_twice": ("it names the joint {joint:quoted} twice", "name each once"),
    "trajectory_joint_unknown": (
        "{joint:quoted} is not a joint of this controller; its joints are {joints:list}",
        "",
    ),
    "trajectory_joints_missing": ("it leaves out {missing:list}", "name all joints"),
    "trajectory_is_partial": (
        "it leaves out {missing:list}",
        "name all joints, or set the controller's parameter allow_partial_joints_goal to true",
    ),
    "trajectory_without_points": ("it has no points", "to stop a motion, cancel its goal"),
    "trajectory_start_not_finite": ("its start is {start}; a time is a finite number of seconds", ""),
    "trajectory_begins_too_early": ("point 1 is due at {time:g} s; time_from_start is 0 s or later", ""),
    "trajectory_times_not_increasing": (
        "point {point} is due at {time:g} s, not after point {before} at {time_before:g} s; the times of the points "
        "increase",
        "",
    ),
    "trajectory_ends_too_late": ("its last point is due at {time:g} s; the latest is at {latest:.0f} s", ""),
    "trajectory_ends_in_motion": ("its last point has a velocity; a trajectory ends at rest", ""),
    "point_time_not_finite": ("point {point} is due at {time} s; a time is a finite number of seconds", ""),
    "point_without_positions": ("point {point} has no positions; every point has one for each joint", ""),
    "point_without_velocities": ("point {point} has accelerations without velocities", "give both or neither"),
    "point_value_count": (
        "point {point} has {count} {quantity} for {joints} joints",
        "give one for each joint, or none",
    ),
    "point_value_not_finite": ("point {point} has {value} among its {quantity}; all values are finite numbers", ""),
    # ---- what it asks of the joints
    "point_out_of_range": (f"point {{point}} has {{joint}} at {{position:.1°}}; {_RANGE}", ""),
    "point_in_degrees": (
        f"point {{point}} has {{joint}} at {{position:.1°}}; {_RANGE}; {{position:g}} looks like degrees",
        "{give_radians}",
    ),
    "point_beyond_limit": (
        "point {point} gives {joint} the {quantity} {value:.4g} {unit}; its limit is {limit:.2f} {unit}",
        "give it more time",
    ),
    "trajectory_leaves_range": (
        f"{{joint}} would be at {{position:.1°}} at {{time:.3f}} s, between two points; {_RANGE}",
        "",
    ),
    "trajectory_beyond_limit": (
        "{joint} would have the {quantity} {value:.2f} {unit} at {time:.3f} s; its limit is {limit:.2f} {unit}",
        "give it more time",
    ),
    # ---- whether the arm can begin it
    "trajectory_is_over": (
        "it ended {late:.3f} s ago",
        "send it before its end, or with the stamp 0 to start at once",
    ),
    "trajectory_too_far_away": ("the arm is too far from it to join it in motion, within {duration:g} s", ""),
    "trajectory_begins_elsewhere": (
        "its first point, due at {time:g} s, has {joint} at {first:.1°}, while the arm is commanded to be at "
        "{position:.1°}",
        "begin where the arm is, or give it time to go there",
    ),
    "trajectory_is_elsewhere": (
        "its first point, due at {time:g} s, has {joint} at {first:.1°} and moved it to {now:.1°} in the {since:.3f} "
        "s since then, while the arm is commanded to be at {position:.1°}",
        "begin where the arm is, or give it time to go there",
    ),
    "trajectory_while_arm_moves": (
        "the arm still moves from before this controller was activated",
        "wait until it stands",
    ),
    "trajectory_of_other_arm": ("it is planned for the {arm} arm; this controller moves the {own_arm} one", ""),
    "trajectory_with_efforts": (
        "a point has efforts; this robot takes positions, velocities and accelerations",
        "",
    ),
    "joint_tolerance_not_a_number": (
        "a tolerance of {joint} is nan",
        "give a number, 0 for the controller's own, -1 for none",
    ),
    "tolerance_not_a_number": ("a tolerance is nan", "give a number, 0 for the controller's own, -1 for none"),
}

_CHUNKS: Mapping[str, tuple[str, str]] = {
    # ---- its form
    "chunk_without_arm": ("it has points for no arm", "give right, left or both"),
    "chunk_arm_not_taken": ("it has points for the {arm} arm, which does not follow chunks", "follow: {arms:list}"),
    "chunk_points_malformed": (
        "the points of the {arm} arm are not rows of {joints} finite positions in radians ({error})",
        "",
    ),
    "chunk_point_count": ("it has {points} points; allowed are {least} to {most}", ""),
    "chunk_counts_differ": ("it has {points} points for the {part}, and {others} for the {other}", "give as many"),
    "chunk_time_out_of_range": ("{name} is {value:g} s; allowed is {lowest:g} to {highest:g} s", ""),
    "chunk_gripper_malformed": (
        "the points of the {arm} gripper are not numbers from 0, open, to 1, closed ({given})",
        "",
    ),
    # ---- what it asks of the joints
    "chunk_beyond_limit": (
        "{joint} would have the {quantity} {value:.2f} {unit} at {time:.3f} s; its limit is {limit:.2f} {unit}",
        "give it more time, or points with less noise",
    ),
    # ---- whether the arm can go on with it
    "chunk_is_over": ("its last point was due {late:.3f} s ago", "send it earlier, or with more points"),
    "chunk_begins_too_late": (
        "it begins {early:.2f} s after the points before; at most {most:g} s are allowed",
        "send it later, or with an earlier start",
    ),
    "chunk_jumps": (
        "{joint} would have to jump by {distance:+.1°}; at most {most:.1°} are allowed",
        "begin where the arm is commanded to be",
    ),
    "chunk_out_of_reach": (
        "the joints cannot get onto it within their limits in the {duration:.3f} s that are left of it",
        "begin nearer to where the arm is commanded to be, or give it more points",
    ),
    "chunks_taken_over": (
        "something else commands the {arm} arm since then",
        "follow chunks anew where the arm may go on",
    ),
    "chunks_ended": ("this following of chunks has ended", "follow chunks anew"),
}

_PATHS: Mapping[str, tuple[str, str]] = {
    "path_without_poses": ("it has no poses", "give at least one"),
    "path_angle_not_finite": ("the arm angle of pose {pose} is {angle}", "give a finite number of radians"),
    "path_value_out_of_range": ("{name} is {value:g}; allowed is {lowest:g} to {highest:g} {unit}", ""),
    "path_through_wall": (
        "pose {pose} is {distance:.0mm} beyond the wall {wall:quoted} (tool_limits.walls)",
        "choose a pose on its free side, or move the wall in yumi.yaml",
    ),
    "path_unreachable": (
        "the {arm} arm cannot follow it beyond {share:.0%}, at x {x:.3f}, y {y:.3f}, z {z:.3f} m: {reason}",
        "choose another arm angle, begin in another posture, or take another path",
    ),
    "path_beyond_limits": ("no motion along it keeps the joints' limits", "take another path"),
}

MOTIONS: Mapping[str, Text] = {
    **{code: Text(f"goal refused: {what}", remedy) for code, (what, remedy) in _GOALS.items()},
    **{code: Text(f"trajectory refused: {what}", remedy) for code, (what, remedy) in _TRAJECTORIES.items()},
    **{code: Text(f"chunk refused: {what}", remedy) for code, (what, remedy) in _CHUNKS.items()},
    **{code: Text(f"path refused: {what}", remedy) for code, (what, remedy) in _PATHS.items()},
    # ---- poses and velocities of a tool
    "arm_stretched_out": Text("the arm is stretched out there, or has to fold over"),
    "joint_leaves_range": Text("{joint} would be at {position:.1°}, out of its range {lower:.1°} to {upper:.1°}"),
    "pose_not_finite": Text("pose refused: {pose} has a value that is not finite", "give metres and a quaternion"),
    "pose_too_far": Text(
        "pose refused: {pose} is {distance:g} m from the body; at most {farthest:g} m are allowed",
        "give positions in metres",
    ),
    "pose_not_unit": Text(
        "pose refused: the orientation of {pose} has length {length:.3f}", "give a unit quaternion, w first"
    ),
    "plan_beyond_limits": Text(
        "nothing was planned: no motion along the path keeps the joints' limits", "take another goal"
    ),
    "twist_implausible": Text(
        "velocity refused: {value} is not finite, or beyond {most:g} m/s or rad/s; the tool reaches 1.5"
    ),
    "speed_scaling_factor_out_of_range": Text("speed scaling refused: the factor is {factor}; allowed is 0 to 1"),
    "tool_held_by_wall": Text(
        "the tool is held by the wall {wall:quoted} of tool_limits",
        "lead it away from there, or move the wall in yumi.yaml",
    ),
    # ---- a stream of joint positions
    "stream_followed": Text("follows a stream of {rate:.0f} Hz {delay:.0ms} late"),
    "stream_rate_out_of_range": Text(
        "the stream has {rate:.2g} points a second; it is followed as documented from {lowest:g} to {highest:g} Hz",
        "send goals more often, or as a trajectory, where they are too few",
    ),
    "stream_late": Text(
        "points of the stream come up to {lateness:.0ms} later than they are needed at a delay of {delay:.0ms}, and "
        "the motion is rougher than the stream",
        "give a delay of {better:.3f} s, or send them in time",
    ),
    "stream_ended_in_motion": Text(
        "the stream ended in motion: no point has come for {silence:.0ms}; the arm brakes and holds",
        "end a stream with points that stand still",
    ),
    "stream_jumps": Text(
        "the stream jumps by {way:.1°} at {joint} within {interval:.0ms}, faster than the joint may move; the arm goes "
        "there within its limits",
        "begin a stream where the arm is, and stamp points with the time they are for",
    ),
    "stream_beyond_limits": Text(
        "{joint} is slower than the stream, within its limits and the speed scale; the arm comes later than the delay",
        "send a slower stream, or raise the speed scale",
    ),
    # ---- how a motion ended
    "goal_reached": Text("the goal is reached"),
    "goal_replaced": Text("another goal replaced this one"),
    "trajectory_replaced": Text("a newer trajectory has replaced this one"),
    "motion_replaced_by_stream": Text("a stream of the tool has replaced this motion"),
    "chunks_exhausted": Text("the points of the chunks are exhausted, the last of chunk {number}; the arm brakes"),
    "motion_stopped": Text("the arm was commanded to stop"),
    "motion_cancelled": Text("the motion was cancelled; the arm is at rest"),
    "controller_deactivated": Text("the controller was deactivated; the arm holds"),
    "axis_off_path": Text("axis {axis} was {distance:.1°} from its path", "see what holds the arm back"),
    "axis_off_goal": Text(
        "axis {axis} was {distance:.1°} from the goal when its time was up", "see what holds the arm back"
    ),
    "joint_off_trajectory": Text(
        "{joint} was {distance:+.2°} from the trajectory at {time:.3f} s; its path tolerance is {tolerance:.2°}"
    ),
    "joint_off_speed": Text(
        "{joint} was {difference:+.3f} rad/s off the planned speed at {time:.3f} s; its path tolerance is "
        "{tolerance:.3f} rad/s"
    ),
    "joint_off_goal": Text(
        "{joint} was still {distance:+.2°} from the goal {late:.2f} s after the end of the trajectory; its goal "
        "tolerance is {tolerance:.2°}"
    ),
    "arm_moved_after_trajectory": Text("the arm still moved {late:.2f} s after the end of the trajectory"),
    "other_arm_not_following": Text("the other arm has not followed the trajectory for {silence:.0ms}; both arms stop"),
    "other_arm_aborted": Text("the other arm's part of the motion was aborted; both arms stop"),
    "motion_ended": Text("motion {number}: {reason}", "{reason:remedy}"),
    "trajectory_ended": Text("{outcome}: {reason}", "{reason:remedy}"),
}

CONTROLLERS: Mapping[str, Text] = {
    # ---- commands
    "controller_takes_no_commands": Text("a controller of type {type} takes no commands"),
    "command_of_other_controller": Text("a controller of type {type} takes {allowed:or}, not {command}"),
    "controller_not_active": Text(
        "controller {controller:quoted} is {state} and takes no commands", "activate it first"
    ),
    # ---- parameters
    "parameter_joint_foreign": Text(
        "parameter 'joints': {joint:quoted} is not a joint of this arm", "name {joints:list}, in this order"
    ),
    "parameter_joints_out_of_order": Text(
        "parameter 'joints': it is {given:cut}", "name {joints:list} in this order: commands come by index"
    ),
    "parameter_joints_incomplete": Text("parameter 'joints': it is {given:cut}", "name {joints:list}, in any order"),
    "parameter_interfaces_unknown": Text(
        "parameter {parameter:quoted} is [{given:cut}]", "choose [position] or [position, velocity]"
    ),
    "controller_parameter_unknown": Text(
        "controller {controller:quoted} has no parameter {parameter:quoted}; it has: {parameters:list}"
    ),
    "controller_parameter_refused": Text("controller {controller:quoted}: {reason}", "{reason:remedy}"),
    "controller_parameter_settled": Text(
        "parameter {parameter:quoted} of controller {controller:quoted} is settled while it is {state}",
        "clean the controller up to change it",
    ),
    # ---- loading and switching
    "controller_unknown": Text("there is no controller {controller:quoted}; loaded are: {loaded:list}"),
    "controller_type_unknown": Text(
        "controller {controller:quoted} cannot be loaded: type {type:quoted} is not known; known are: {types:list}"
    ),
    "controller_loaded_already": Text(
        "controller {controller:quoted} is loaded already", "unload it first or choose another name"
    ),
    "controller_name_not_allowed": Text(
        "controller name {controller:quoted} cannot be the name of a node", "use letters, digits and underscores"
    ),
    "controller_still_active": Text(
        "controller {controller:quoted} is active and cannot be unloaded", "deactivate it first"
    ),
    "transition_not_allowed": Text(
        "controller {controller:quoted} is {state} and cannot {transition}; it can {allowed:list}"
    ),
    "controller_without_egm": Text(
        "controller {controller:quoted} cannot start: EGM is not running on this arm", "{start_egm}"
    ),
    "arm_commanded_by_another": Text(
        "the {arm} arm is commanded by {who} ({client})", "wait until that has ended, or stop it"
    ),
    "arm_reserved_for_person": Text(
        "the {arm} arm is reserved for a person, who has let it go; a program ({who}) is refused",
        "{give_back} for programs",
    ),
    "give_back_while_commanded": Text(
        "the {arm} arm is commanded by a person now ({who})", "let it go first: release the clutch or the key"
    ),
    "stream_begins_elsewhere": Text(
        "a joint of the stream's first position is {distance:.1°} away from where the {arm} arm is sent; "
        "it may be {most:.1°} away",
        "begin the stream where the arm is, move there before, or give blend, in seconds",
    ),
    "tool_stream_begins_elsewhere": Text(
        "the stream's first pose is {distance:.3f} m and {turn:.1°} away from where the {arm} tool is sent, which "
        "something else has moved meanwhile; it may be {most:g} m and {most_turn:.1°} away",
        "begin the stream where the tool is, or move there before",
    ),
    "blend_out_of_range": Text("stream refused: blend is {given}; allowed is above 0 to {longest:g} s"),
    "controllers_were_ended": Text(
        "controller {controller:quoted} is inactive: what commanded the arm was ended",
        "{recover}, or activate {controller}",
    ),
    "controller_inactive": Text(
        "controller {controller:quoted} is inactive, and {commanding:and} commands the arm",
        "wait until its motion has ended, or activate {controller}",
    ),
    "interface_named_twice": Text(
        "controller {controller:quoted} names interface {interface} twice", "name each one once"
    ),
    "interface_missing": Text(
        "controller {controller:quoted} needs {interface}, which this arm does not have; it has: {interfaces:list}"
    ),
    "interface_claimed": Text(
        "controller {controller:quoted} needs {interface}, which {owner:quoted} has claimed",
        "deactivate {owner:quoted} in the same switch",
    ),
    "hardware_not_active": Text(
        "controller {controller:quoted} cannot start: hardware component {component:quoted} is {state}",
        "make it active first",
    ),
    "hardware_unknown": Text("there is no hardware component {component:quoted}; this arm has: {own_component}"),
    "hardware_state_not_allowed": Text(
        "hardware component {component:quoted} cannot become {state} while the driver runs; choose from: {allowed:list}"
    ),
    "switched": Text("successfully switched controllers!"),
    "nothing_to_switch": Text("after checking the controllers, no controllers need to be activated or deactivated"),
    "switch_without_effect": Text("nothing was switched: {reasons}"),
    "switch_failed": Text("the switch failed: {failures}; active now: {active:list}"),
    # ---- errors in a controller
    "controller_raised": Text("controller {controller:quoted} failed in {call} with {type}: {error}"),
    "watching_controller_failed": Text(
        "controller {controller:quoted} failed with {type}: {error}; it was deactivated"
    ),
    "commanding_controller_failed": Text(
        "controller {controller:quoted} failed with {type}: {error}; it was deactivated and the arm holds"
    ),
    "commanding_controllers_failed": Text(
        "controller {controller:quoted} failed with {type}: {error}; it and {others:list} were deactivated and the "
        "arm holds"
    ),
}
