"""Refusals of requests to a running driver."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

ENDPOINT: Mapping[str, Text] = {
    # ---- the driver
    "no_driver_runs": Text(
        "no driver runs on this machine for this user",
        "start one with `yumi up --robot <address>` (a virtual robot first: `yumi controller`, then `yumi up --robot "
        "127.0.0.1`)",
    ),
    "no_driver_of_robot": Text("no driver of {robot:quoted} runs on this machine; there is one of {drivers:list}"),
    "several_drivers_run": Text("several drivers run on this machine: {drivers:list}", "name one with --robot"),
    "driver_does_not_answer": Text("the driver behind {path} does not answer: {why}"),
    "driver_connection_lost": Text(
        "the connection to the driver behind {name} is lost: {why}", "see its output, and start it again with `yumi up`"
    ),
    "driver_of_other_version": Text(
        "the driver's answer cannot be read ({why})",
        "use the same version of driver and client",
    ),
    "driver_closed_connection": Text("it closed the connection"),
    "no_endpoint_folder": Text("no local endpoint can be made in {folder}: {why}"),
    "endpoint_folder_open_to_others": Text(
        "{folder} belongs to another user, or other users can enter it",
        "set XDG_RUNTIME_DIR to a folder that only you may enter",
    ),
    "endpoint_path_too_long": Text(
        "the path of the local endpoint is too long: {path}", "set XDG_RUNTIME_DIR to a shorter one"
    ),
    # ---- its clients
    "too_many_clients": Text(
        "the driver serves {most} clients already; a stop is served all the same", "disconnect one"
    ),
    "silent_client": Text("no request came within {duration:g} s; the connection is closed"),
    "too_many_requests": Text("the driver carries out too many requests already", "wait for their answers"),
    "request_too_long": Text("a request is longer than {most} bytes; the connection is closed"),
    "request_not_understood": Text("request refused: {why}"),
    "request_nested_too_deeply": Text("its lists or objects are nested too deeply"),
    "request_not_utf_8": Text("it is not in UTF-8"),
    "value_not_finite": Text("request refused: {name} is {value}", "give a finite number"),
    "driver_failed": Text("the driver failed with {kind}: {why}; see its log"),
    # ---- requests
    "asker_is_gone": Text("what was asked for was ended before its next step: who asked for it is gone"),
    "no_gripper_named": Text("no gripper is named", "name right, left or both"),
    "force_while_opening": Text(
        "the force is for closing only",
        "leave the force out",
    ),
    "width_while_closing": Text("a gripper closes on whatever is there", "name a width only to open it"),
    "gripper_stopped_asker_gone": Text("the {arm} gripper was stopped: who asked for it is gone"),
    "no_controller_named": Text("no controller is named", "name what to activate or to deactivate"),
    "tool_speed_without_line": Text(
        "a speed of the tool is for a straight line", "ask for one, or leave the speed out"
    ),
    "line_without_pose": Text("a straight line, and a speed of the tool, are for poses", "ask for a pose"),
    "no_arm_has_goal": Text("no arm has a goal", "name right, left or both"),
    "another_move_under_way": Text("another move is being carried out", "wait for its end, or stop it"),
    "arm_moves_commanded_by": Text("the {arm} arm moves, commanded by {controllers}", "wait until it stands"),
    "arm_moves_without_controller": Text("the {arm} arm moves, commanded by no controller", "wait until it stands"),
    "motion_interrupted": Text("the command was interrupted; the driver ends its motion, and its arms come to rest"),
    "motion_stopped_asker_gone": Text("the motion was stopped: who asked for it is gone"),
    "motion_took_too_long": Text("the motion was stopped: it took longer than {longest:g} s"),
}
