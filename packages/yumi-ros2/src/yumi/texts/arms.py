"""Texts about an arm: its EGM session, its feedback, and its limits."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

ARMS: Mapping[str, Text] = {
    # ---- why an arm holds whatever it is asked to do
    "references_ignored": Text(
        "{arm} arm: the robot does not follow the references; the driver's replies may not reach the robot",
        "check that this machine's firewall lets UDP out to the controller",
    ),
    "feedback_implausible": Text(
        "{arm} arm: the robot reports positions that the arm cannot have reached: the datagrams are old, forged or "
        "from another arm, or a joint is out of its range",
        "check what else sends to this port, and the remote ports of the controller's UDPUC devices; jog a joint that "
        "is out of its range back",
    ),
    "arm_without_egm": Text("EGM is not running on the {arm} arm", "{start_egm}"),
    # ---- what happened
    "session_started": Text("{arm} arm: EGM session {session} started"),
    "session_restarted_in_motion": Text(
        "{arm} arm: the robot began EGM session {session} in the middle of a motion; {controllers} deactivated",
        "{start_egm} to go on",
    ),
    "commanded_since": Text("commanded by {who} ({client}) since {since}"),
    "reserved_for_person": Text("reserved for a person", "{give_back} for programs to command it again"),
    "last_take_over_refused": Text("the last request was refused: {reason}"),
    "commander_silent": Text(
        "{arm} arm: who commanded it has sent nothing for {silence:.0ms}; it comes to rest and holds"
    ),
    "arm_taken": Text("{arm} arm: commanded by {who} ({client})"),
    "arm_taken_over": Text("{arm} arm: commanded by {who} ({client}), in place of {before}"),
    "arm_let_go": Text(
        "{arm} arm: {before} ({client}) has let it go; it holds, reserved for a person", "{give_back} for programs"
    ),
    "arm_given_back": Text("{arm} arm: given back; programs may command it"),
    "session_resumed": Text(
        "{arm} arm: EGM feedback is back, session {session} goes on and the arm holds", "{start_egm} to go on"
    ),
    "session_ended": Text("{arm} arm: EGM has ended; the robot has been silent for {silence:.0ms}"),
    "feedback_lost": Text(
        "{arm} arm: EGM feedback lost, the robot has been silent for {silence:.0ms}; {controllers} deactivated",
        "{start_egm} when the connection is back",
    ),
    "driver_stood_still": Text(
        "{arm} arm: the control process stood still for {duration:.2g} s; the arm was not controlled meanwhile"
    ),
    "driver_stood_still_in_motion": Text(
        "{arm} arm: the control process stood still for {duration:.2g} s, the arm was not controlled meanwhile; "
        "{controllers} deactivated",
        "{start_egm} to go on",
    ),
    "controllers_were_late": Text(
        "{arm} arm: {controllers} did not answer {cycles} datagrams within 2 ms; the arm braked and went on",
        "find out what keeps the controller, or the machine, busy",
    ),
    "controllers_hung": Text(
        "{arm} arm: {controllers} did not answer {cycles} datagrams and were deactivated; the arm braked and holds",
        "find out what keeps the controller, or the machine, busy, then {recover}",
    ),
    "loop_was_late": Text(
        "{arm} arm: the control loop did not answer {cycles} datagrams within 2 ms; the arm held meanwhile",
        "find out what keeps the machine busy",
    ),
    "virtual_robot_was_late": Text(
        "{arm} arm: this machine was too busy for its virtual robot, which sent nothing for {silence:.0ms}; "
        "{controllers} deactivated",
        "{start_egm} to go on",
    ),
    "robot_follows": Text("{arm} arm: the robot follows commands"),
    "robot_stopped_following": Text("{arm} arm: the robot no longer follows commands"),
    "robot_stopped_following_in_motion": Text(
        "{arm} arm: the robot no longer follows commands; {controllers} deactivated", "{start_egm} to go on"
    ),
    "position_not_believed": Text(
        "{arm} arm: the reported position of {joint} is {distance:.1°} from where the arm can be; the datagram was "
        "not used (an old, forged or mixed-up one)"
    ),
    "position_not_believed_for_long": Text(
        "{arm} arm: the reported position of {joint} is {distance:.1°} from where the arm can be; the arm "
        "holds{ended}. Cause: {cause}",
        "{cause:remedy}; {restart_egm} when this is corrected",
    ),
    "controllers_deactivated": Text("; {controllers} deactivated"),
    "nothing": Text(""),
    "positions_of_other_arm": Text(
        "that is where the other arm is; the left and right EGM ports may be exchanged",
        "check the remote ports of the controller's UDPUC devices ROB_L and ROB_R",
    ),
    "positions_implausible": Text(
        "the datagrams are old, forged or from another arm, or a joint is out of its range",
        "check what else sends to this port, and the remote ports of the controller's UDPUC devices; jog a joint that "
        "is out of its range back",
    ),
    "arm_holds_ignored": Text("{problem}; the arm holds{ended}", "{problem:remedy}; then {recover}"),
    "references_followed_again": Text("{arm} arm: the robot follows the references again", "{recover} to go on"),
    "positions_plausible_again": Text("{arm} arm: the reported positions are plausible again", "{recover} to go on"),
    "parts_near": Text("{part} - {other}, {distance:.0mm}"),
    "parts_not_compared": Text("{part} - {other}, {distance:.0mm}, not shown to stay apart within one cycle"),
    "no_shared_memory": Text(
        "the operating system gives no shared memory ({why})",
        "see that /dev/shm exists and has some MB left (df /dev/shm), and that the limits of this program are not too "
        "low (ulimit -n, ulimit -v)",
    ),
    "interrupted_while_planned": Text(
        "the {arm} arm was stopped, or another controller took it over, while the motion was planned",
        "give the goal again",
    ),
    "goal_refused": Text("goal refused: {reason}", "{reason:remedy}"),
    "arm_moves": Text(
        "the {arm} arm moves",
        "wait until the arm is at rest",
    ),
    "arm_held_before_goal": Text(
        "the {arm} arm is held, and its goal lies {distance:.1°} beyond",
        "stop that motion, or send the arm to where it is",
    ),
    "no_position_yet": Text("the {arm} arm has not reported a position yet", "{start_egm}"),
    "several_commands": Text(
        "controller {controller:quoted} of the {arm} arm is sent {count} commands at once", "send one"
    ),
    "command_failed": Text("the command {command} failed with {kind}: {why}"),
    "nothing_to_allow": Text(
        "there is nothing to allow: nothing keeps the arms apart, as collision.enabled is false in the driver's "
        "settings"
    ),
    "contact_time_out_of_range": Text(
        "collision not allowed: the time is {time:g} s; allowed is more than 0, up to {longest:g} s"
    ),
    "contact_is_for_slow_motions": Text(
        "collision not allowed, since contact is for slow motions: {reason}", "{reason:remedy}"
    ),
    "no_such_parts": Text(
        "there are no two parts {part:quoted} and {other:quoted} that are kept apart; nothing was changed",
        "name them as the log does: 'right gripper' (with its fingers), 'right arm' (all of it), 'body', or a "
        "declared box",
    ),
    "arm_waits_for_recovery": Text("goal refused: {fault}", "{fault:remedy}"),
    "goal_not_reached": Text("the {arm} arm did not reach its goal: {reason}"),
    "goal_not_reached_limited": Text(
        "the {arm} arm did not reach its goal: {reason}; the limiter keeps it apart: {limited}",
        "plan a path around the obstacle, or {retreat} to bring both arms home",
    ),
    "motion_limited": Text("{arm} arm: motion limited by {limited}"),
    "all_kept_apart": Text("all parts are kept apart again, and the arms have their speed"),
    "may_touch": Text("may touch for a while, slowly: {pairs:list}"),
    "controller_failed": Text("{arm} arm: {failure}", "{recover} to go on"),
    "controller_reports": Text("{arm} arm: {controller}: {report}"),
    "cycle_failed": Text("{arm} arm: a cycle could not be completed: {failure}", "{recover} to go on"),
    "reports_dropped": Text(
        "{arm} arm: the driver did not read the control process's reports for a while and {count} were dropped; the "
        "arms were served meanwhile, and hold now",
        "see whether the driver was stopped or its machine is overloaded, then {recover}",
    ),
    "control_process_ended": Text(
        "{arm} arm: the control process has ended (exit code {exit_code}); the robot gets no answers any more and "
        "keeps its last references",
        "{recover}, which starts another one",
    ),
}
