"""Texts about the driver: its control process, the state machine on the robot, and EGM from a script."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

DRIVER: Mapping[str, Text] = {
    # ---- the control process
    "control_process_is_gone": Text("the control process has ended", "{recover}, which starts another one"),
    "control_process_starts": Text("the control process is starting", "try again in a few seconds"),
    "control_process_ended_at_start": Text(
        "the control process ended while it started", "read the cause in the output of the driver"
    ),
    "control_process_stands_still": Text(
        "the control process has stood still for {duration:.0f} s", "restart the driver"
    ),
    "control_process_does_not_answer": Text(
        "the control process did not answer within {timeout:g} s", "restart the driver"
    ),
    "control_process_stood_still_too_long": Text(
        "this process stood still for {duration:g} s, and what it was asked for meanwhile, be it a motion or a stop, "
        "is dropped; the arm holds"
    ),
    "no_thread_for_core": Text(
        "the operating system gives the control process no thread that answers the robot while a controller is busy",
        "raise the limits of processes and of open files",
    ),
    "command_too_late": Text("the command {command} came too late and is dropped; the arms hold"),
    "command_unknown": Text("there is no command {command:quoted}"),
    "command_unreadable": Text("the command cannot be read: {kind}: {reason}"),
    # ---- the speed
    "speed_scale_no_number": Text("speed_scale is {value}", "give a number from {lowest:g} to {highest:g}"),
    "speed_scale_out_of_range": Text("speed_scale is {value:g}; allowed is {lowest:g} to {highest:g}"),
    "speed_scale_in_force": Text(
        "speed_scale is {value:g}: every controller moves with at most {value:.0%} of its speeds"
    ),
    "speed_scale_waits_for_egm": Text(
        "speed_scale is {value:g}, but EGM was started with {in_force:g}, which the robot's own limit "
        "(MaxSpeedDeviation) keeps until EGM is started again",
        "{restart_egm}",
    ),
    "real_robot_answers": Text(
        "the controller does not report that it is virtual, as one was expected: speed_scale is {value:g} from now on",
        "raise it once you have seen the robot move",
    ),
    # ---- the state machine on the robot
    "state_machines_did_not_start_egm": Text(
        "the state machines did not start EGM within {timeout:g} s ({machines:list})",
        "see that the RAPID program runs and EGM motions are allowed",
    ),
    "state_machines_not_idle_in_time": Text(
        "the state machines did not become idle within {timeout:g} s ({machines:list})",
        "look at the event log on the FlexPendant",
    ),
    "machine_state_unknown": Text(
        "{symbol} is {value}, which is not a state of the state machine", "load the RAPID modules of this version"
    ),
    "rapid_record_of_unknown_layout": Text(
        "{symbol} has an unknown layout: {value}", "load the RAPID modules of this version"
    ),
    "egm_settings_not_taken": Text("{task} did not take the EGM settings: wrote {written}, it holds {read}"),
    "tool_fixed_while_egm_runs": Text(
        "EGM runs on the {arm} arm with the tool and payload it was started with",
        "{stop_egm}, set them, then {start_egm}",
    ),
    # ---- EGM from a script
    "no_robot_spoke": Text(
        "no robot spoke on UDP port {port} within {timeout:g} s",
        "start EGM in the RAPID program, and check the remote address and port of its UDPUC device",
    ),
    "no_robot_spoke_on_this_machine": Text(
        "no robot spoke on UDP port {port} within {timeout:g} s, where without robot= or host= this machine alone is "
        "heard",
        "start EGM in the RAPID program, and check the remote address and port of its UDPUC device",
    ),
    "no_state_to_answer": Text("no robot has spoken yet", "receive a state first, then answer it"),
    "sender_cannot_be_guided": Text("what speaks on UDP port {port} cannot be guided: {reason}"),
    "reference_not_unit_quaternion": Text(
        "reference refused: orientation of pose has norm {norm:g}; a unit quaternion has 1"
    ),
    "reference_of_other_length": Text("reference refused: {name} has {count} values; this robot takes {needed}"),
    "reference_not_finite": Text("reference refused: {name} has {value}; the robot takes finite numbers only"),
    "rapid_data_too_long": Text("data refused: {count} numbers; a RAPID program takes {limit}"),
    "correction_of_other_age": Text("correction refused: age is {age} s; a measurement is 0 to {limit:g} s old"),
}
