"""Texts about planned paths: why there is none, and which goals are refused."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

PLANNING: Mapping[str, Text] = {
    "plan_goal_not_free": Text("the goal is not free: {where}. Plans keep clear of everything", "choose another goal"),
    "plan_start_not_free": Text(
        "the start is not free: {where}. Plans keep clear of everything", "move the arm away from there first"
    ),
    "parts_are_near": Text("nearest are {part} and {other}, {distance:.0mm} apart"),
    "parts_overlap": Text("{part} and {other} overlap by {depth:.0mm}"),
    "arm_touches_itself": Text("an arm touches itself"),
    "plan_joint_out_of_range": Text(
        "nothing was planned: {joint} is {position:.1°}; its range is {lower:.1°} to {upper:.1°}"
    ),
    "plan_pose_out_of_reach": Text(
        "the {arm} arm does not reach this pose, whatever its arm angle", "take another pose"
    ),
    "planning_process_ended": Text("the process that plans has ended before its plan was made", "plan again"),
    "no_path": Text(
        "there is no path, as far as complete searches show ({duration:.1f} s): every one that was tried comes too "
        "near to the robot itself or to a box",
        "take a goal with more room about it, or plan in two steps",
    ),
    "no_path_in_time": Text(
        "no path was found in the time given, {duration:.1f} s; there may be one. The planner had a processor for "
        "{share:.0%} of that time",
        "give more time, take a goal with more room about it, or plan in two steps",
    ),
    "no_path_in_time_busy": Text(
        "no path was found in the time given, {duration:.1f} s; there may be one. The planner had a processor for "
        "only {share:.0%} of that time, as other programs keep this machine busy",
        "end some of them and plan again",
    ),
}
