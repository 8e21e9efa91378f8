"""Refusals of the evaluation: experiments, measurements of a robot, comparisons of logs, and the benchmark."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

EVALUATION: Mapping[str, Text] = {
    "real_robot_in_virtual_time": Text("a real robot has no virtual time", "give either --robot or --virtual-time"),
    "experiments_failed": Text("{count} experiments could not be run", "see the reasons in the report"),
    "gains_not_in_order": Text("the gains go from {lowest:g} to {highest:g}; --from must be below --to"),
    "ros_missing_for_evaluation": Text(
        "ROS 2 is missing",
        "install yumi-ros2[ros], run `make setup` in a clone of yumi-ros2, or add --virtual-time",
    ),
    "parameters_not_taken": Text("the controller's parameters could not be set: {reason}"),
    "controllers_not_switched": Text("the controllers could not be switched: {reason}"),
    "joint_states_missed": Text(
        "no joint state came for {gap:.0ms}: the machine is too busy, or the robot was lost",
        "try again when it is idle",
    ),
    "state_machine_silent": Text("the state machine of the {arm} arm did not answer within {timeout:g} s"),
    # ---- measuring a robot
    "measurement_exists": Text("{folder} is there already", "give the folder of a new measurement with --output"),
    "motion_not_confirmed": Text("not confirmed: nothing more moves"),
    "yes_for_virtual_robots": Text(
        "--yes is for virtual robots, on this machine or in RobotStudio, and {address} is not one: each motion is "
        "confirmed at a terminal",
        "leave --yes out",
    ),
    "no_terminal": Text(
        "each motion has to be confirmed at a terminal, and standard input is none",
        "run the command in a terminal, beside the robot",
    ),
    "no_terminal_for_virtual": Text(
        "each motion has to be confirmed at a terminal, and standard input is none", "add --yes"
    ),
    "measurement_ended": Text("{error:sentence} What was recorded until then is in {file}"),
    "ended_by_signal": Text("ended by Ctrl-C or a signal"),
    "follows_speeds_alone": Text(
        "egm_motion.pos_corr_gain is 0: the robot would follow speeds alone",
        "set it above 0 up to 1, or leave it out",
    ),
    "joint_without_room": Text(
        "joint {axis} of the {arm} arm is at {position:.1°}, allowed is {lower:.1°} to {upper:.1°}, and {room:.0°} "
        "are needed on both sides",
        "move the arm away from there, e.g. yumi move {arm} ready",
    ),
    "part_too_near": Text(
        "the {part} is too near to the {other}: within the motions {distance:.0mm} are between their covers and "
        "paddings",
        "move the arm away from there, e.g. yumi move both ready",
    ),
    # ---- logs
    "log_missing": Text("there is no {file}", "give a recording, an MCAP or CSV file, or a folder of records"),
    "commands_beside_other_log": Text(
        "--commands belongs to a CSV file; {file} brings its own commands", "leave it out"
    ),
    "log_empty": Text("{file} is empty: nothing was recorded", "give a file with a motion in it"),
    "table_without_commands": Text(
        "{file} has no commands", "give the file with them, --commands FILE.csv, with columns of the same names"
    ),
    "no_log": Text(
        "{file} is not a log: allowed are a recording or other MCAP file (.mcap), a table (.csv) with --commands, and "
        "a folder with records.json"
    ),
    "table_unreadable": Text("cannot read {file}: {reason}", "give a CSV file in UTF-8"),
    "not_text": Text("it is not text"),
    "table_header_wrong": Text(
        "{file} begins with {header:quoted}; needed is a header {first},NAME_rad,… (or _deg), each name once"
    ),
    "table_line_incomplete": Text(
        "{file} line {line}: needed are {count} numbers; the file is cut, or not a table of numbers"
    ),
    "table_not_finite": Text("{file} has values that are not finite numbers", "leave out the rows where nothing was"),
    "table_times_not_increasing": Text(
        "{file} line {line}: its time is not after the one before", "sort the rows by time"
    ),
    "commands_of_other_joints": Text("{file} has no commands of {missing:list}; both files need the same joints"),
    "log_too_short": Text("{log} has {rows} rows; needed are at least {least}"),
    "commands_at_other_times": Text("no command of {log} is within the time of its rows: {begin:g} s on"),
    "log_without_motion": Text(
        "{file} has no motion under EGM: no arm followed commands for {least} cycles", "record while it moves"
    ),
    "topics_without_commands": Text(
        "{file} has joint states on {topics:quoted}, but no commands of the same joints: needed are JointState or "
        "Float64MultiArray messages on a topic with 'command' in its name"
    ),
    "no_folder_of_records": Text(
        "{folder} is not a folder of records: it needs recordings (.mcap), or {file}, which cannot be read ({reason})"
    ),
    "records_not_described": Text("{file} does not describe records: {error}"),
    "no_record_there": Text("{folder} has none of the records that {file} describes", "put their CSV files there"),
    "record_too_short": Text("{file} needs at least {least} rows of {joints:list}"),
    "record_out_of_range": Text(
        "{record} in {file}: points_sent is {points}, allowed is 2 to {most:g}, of at least {knots} knots; cycle_s is "
        "{cycle:g}, which must be above 0"
    ),
    "record_row_negative": Text("{record} in {file}: its first row is {row}; a row cannot be below 0"),
    # ---- why a parameter of the arm model is not determined
    "no_joint_moves": Text("no joint moves"),
    "joint_does_not_move": Text("it does not move"),
    "too_few_rows": Text("there are too few rows without a gap"),
    "slower_at_several_speeds": Text("it is slower than asked, but not at one speed"),
    "never_asked_for_more": Text("it was never asked for more than it did"),
    "not_shown_by_motion": Text("the motion does not show it"),
    # ---- benchmark
    "wake_mode_unknown": Text("there is no wake mode {mode:quoted}; there are: {known:list}"),
    "server_has_no_soak": Text("--soak loads both arms, and a --server answers one", "leave out one of both options"),
    "contender_unknown": Text("there is no contender {name:quoted}; there are: {known:list}"),
    "benchmark_without_controller": Text("there is no controller in this benchmark; only EGM is spoken"),
    "benchmark_needs_linux": Text("the benchmark needs Linux: it uses kernel receive time stamps and /proc"),
    "benchmark_needs_compiler": Text(
        "the benchmark's load generator needs a C compiler", "install one (apt install g++)"
    ),
    "compiler_refused": Text("the compiler refused {file}: {reason}"),
    "peers_without_environment": Text("the peers' environment cannot be made: {reason}"),
    "peers_not_installed": Text("the PyPI peers could not be installed: {reason}", "leave them out with --only"),
    "contender_did_not_start": Text("the {contender} did not start", "see {log}"),
    "load_generator_failed": Text("{case}: {reason}"),
    "load_generator_killed": Text("the load generator was killed"),
}
