"""Texts about the controller: options, program, motors, signals, RAPID variables, routines and modules."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

ROBOT_CONTROLLER: Mapping[str, Text] = {
    "robotware_too_old": Text("the controller runs RobotWare {version}; EGM for a YuMi needs {oldest} or newer"),
    "option_missing": Text("the controller lacks the option {option:quoted}; without it {loss}"),
    "not_a_yumi": Text(
        "the controller at {address} is {robot}",
        "for other robots use yumi.EgmServer (docs/how-to/control-any-abb-robot.md), or look with `yumi view --robot "
        "{address}`",
    ),
    "is_a_yumi": Text("a YuMi"),
    "unit_missing": Text("the controller has no mechanical unit {unit}; it does not move a YuMi's {arm} arm"),
    "state_machine_missing": Text(
        "task {task} has no state machine ({module})", "load the RAPID modules of this package into it"
    ),
    "state_has_wrong_type": Text(
        "{task}/{module}/current_state has type {kind}, not num", "load the RAPID modules of this package into it"
    ),
    "state_machine_of_other_version": Text(
        "task {task} has version {version} of the state machine, not {expected}",
        "load the RAPID modules of this package into it",
    ),
    "udpuc_device_missing": Text(
        "the controller has no UDPUC device {device} (Communication, Transmission Protocol)",
        "load SIO.cfg of this package and restart it",
    ),
    "datagrams_go_elsewhere": Text(
        "the {arm} arm's datagrams go to {there}, here they are awaited at {here}",
        "make the UDPUC device {device} or the settings fit",
    ),
    "grippers_missing": Text("the controller lacks the product {product:quoted}; the grippers cannot be used"),
    "motors_stay_off": Text(
        "the motors do not switch on: the controller is in {state:quoted}",
        "release any emergency or guard stop, look at the event log on the FlexPendant, and try again",
    ),
    "motors_stay_on": Text(
        "the motors do not switch off",
        "press an emergency stop button",
    ),
    "speed_ratio_not_kept": Text(
        "the controller keeps a speed ratio of {kept} %, not {asked} %", "see the FlexPendant"
    ),
    "program_does_not_obey": Text(
        "the RAPID program is not {state} after {duration:g} s", "look at the event log on the FlexPendant"
    ),
    # ---- signals and variables
    "no_number_for_signal": Text("{value:quoted} is not a value for signal {signal}", "give a number"),
    "signal_not_finite": Text("signal {signal} cannot be {value}", "give a finite number"),
    "signal_value_refused": Text(
        "the controller does not take {value} for signal {signal}; a digital signal is 0 or 1, another one has the "
        "range of its configuration"
    ),
    "signal_not_kept": Text(
        "signal {signal} is {kept} after {written} was written",
        "find what else writes this signal",
    ),
    "no_signal_name": Text("{name:quoted} is not a name of a signal", "give one of the controller's I/O signals"),
    "signal_unknown": Text("the controller has no signal {signal:quoted}", "look at its list of I/O signals"),
    "no_rapid_value": Text(
        "{value:quoted} is not a RAPID value; {module}/{variable} of {task} takes a {kind}, such as {example}"
    ),
    "variable_refused": Text(
        "the controller does not take {value} for {module}/{variable} of {task}: it is a {kind}, such as {example}, "
        "or a constant, which cannot be written"
    ),
    "no_rapid_name": Text("{name:quoted} is not a RAPID name", "give task, module and variable"),
    "variable_unknown": Text("the controller has no {module}/{variable} in task {task}", "check the names"),
    # ---- routines and modules
    "no_routine_name": Text(
        "{name:quoted} is not a name of a RAPID routine",
        "give a letter, then at most 31 letters, digits and underscores",
    ),
    "routine_not_ended": Text("routine {routine} of {task} has not ended after {duration:g} s", "look at the robot"),
    "routine_without_speed": Text(
        "routine {routine} of {task} has not ended after {duration:g} s: the speed ratio is 0 %, with which no RAPID "
        "motion goes on",
        "look at the robot, then raise the speed ratio (set_speed_ratio, or at the FlexPendant)",
    ),
    "rapid_path_unknown": Text(
        "the path of routine {routine} of {task} is not known, so it is not checked, and the limiter does not act on "
        "motions by RAPID",
        "look that nothing is in the way of both arms, then call it with unchecked: true",
    ),
    "rapid_path_too_near": Text(
        "routine {routine} would bring {part} and {other} too near to each other, after {share:.0f} % of its way",
        "choose another goal, or move the other arm away first",
    ),
    "rapid_beside_moving_arm": Text(
        "the {arm} arm may move while {routine} runs, on which the limiter does not act", "{stop_egm} first"
    ),
    "rapid_signal_not_written": Text(
        "{signal} would run a RAPID routine of a real robot unchecked", "call run_routine, which checks the path"
    ),
    "rapid_variable_not_written": Text(
        "{module}/{variable} would start a RAPID routine of a real robot unchecked",
        "call run_routine, which checks the path",
    ),
    "rapid_goal_out_of_range": Text(
        "routine {routine} would bring {joint} to {position:.1°}; its range is {lower:.1°} to {upper:.1°}",
        "choose another goal",
    ),
    "first_run_stays_slow": Text(
        "{why} The speed ratio stays at {ratio} %: the routine runs for the first time, and may go on",
        "look at the robot, then choose the speed ratio (set_speed_ratio, or at the FlexPendant)",
    ),
    "rapid_start_in_routine": Text(
        "the program of {task} stands in {place}, whose motion would go on; the limiter does not act on it",
        "move the program pointers to main (pp_to_main), or start the program at the FlexPendant",
    ),
    "routine_unknown": Text("task {task} has no routine {routine}", "load a module that has it"),
    "module_from_other_file": Text(
        "task {task} has a module {module} from another file", "unload that, or rename yours"
    ),
    "module_not_loaded": Text("{task} did not load {path}; it is not a correct RAPID module", "see the event log"),
    "program_stopped_in_routine": Text("the RAPID program stopped while {task} ran a routine", "see the event log"),
    "no_rapid_file_name": Text(
        "{name:quoted} is not a name of a RAPID file",
        "give a letter, then letters and digits, and .mod or .sys at the end",
    ),
    "text_without_module": Text("the text of {file} declares no MODULE", "give a whole RAPID module"),
    "module_name_reserved": Text("modules TRob... such as {module} belong to the robot-side program", "rename yours"),
}
