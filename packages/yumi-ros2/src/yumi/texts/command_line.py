"""Refusals of the command line itself."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

_INSTALL_ROS = (
    "install yumi-ros2[ros] from a wheel that `make wheels` has built for this Python, run `make setup` in a clone, "
    "or source your ROS 2 Jazzy"
)
_DRIVER_RUNS = "see that a driver runs, with the same ROS_DOMAIN_ID"

COMMAND_LINE: Mapping[str, Text] = {
    "confirm_by_option": Text(
        "the robot was stopped by {causes:full}",
        "look at the robot; when no person is near it and nothing is in its way, confirm this stop: yumi recover "
        "--confirm {stop}",
    ),
    "not_confirmed": Text("not confirmed; nothing was changed"),
    "no_driver_for_shell": Text("{error:sentence} Or connect the prompt to a robot: yumi shell --robot <address>"),
    # ---- options that do not go together
    "driver_of_robot_runs": Text(
        "a driver of {robot} runs already, with its own settings", "leave --config out, or end that driver"
    ),
    "recording_shown_alone": Text("a recording is shown alone", "leave --robot, --virtual and --operate out"),
    "virtual_starts_a_robot": Text("--virtual starts a robot of its own", "leave --robot out"),
    "config_without_driver": Text(
        "--config is for a driver that is started", "name its robot with --robot, or take --virtual"
    ),
    "option_needs_robot": Text("{option} is about a robot that runs already", "name it with --robot"),
    "line_options_need_pose": Text("--linear and --speed are for poses", "add --pose"),
    "abb_order_of_names": Text("--abb is for seven angles in a row; joints by name have no order"),
    "nodes_would_merge": Text(
        "{rule:quoted} would merge both arms, whose nodes differ only in the namespaces r and l",
        "start without it, or give all nodes of a robot a namespace with yumi up --namespace",
    ),
    # ---- goals
    "both_arms_take_a_pose": Text(
        "both arms together take only a pose: their joints are mirrored",
        "move one after the other",
    ),
    "no_pose_on_command_line": Text(
        "a pose is x y z [m], or x y z and w x y z of the orientation; without w x y z the orientation stays as it is",
    ),
    "no_angle": Text(
        "{text:quoted} is not an angle",
        "give a pose ({poses:list}), joints such as j1=20, or seven angles",
    ),
    "angle_count": Text("{count} angles are given; an arm has {joints} joints"),
    "some_joint_named_twice": Text("a joint is named twice", "name each once"),
    # ---- files and passwords
    "folder_not_empty": Text("{folder} is not empty; nothing was written", "name a new folder"),
    "records_unreadable": Text("{damaged} of the {count} files in {folder} cannot be read"),
    # ---- programs
    "ros_missing": Text("ROS 2 is missing ({reason})", _INSTALL_ROS),
    "ros_missing_for_driver": Text(
        "ROS 2 is missing ({reason})", f"{_INSTALL_ROS}; or run the driver without it: --no-ros"
    ),
    "driver_program_ended": Text("the driver has ended (exit code {exit_code})", "see {log}"),
    "ended_before_ready": Text("ended before the {program} was ready"),
    "machine_gives_too_little": Text(
        "this machine gives the program too little: {reason}",
        "see its limits (ulimit -a) and that no disk is full (df)",
    ),
    "no_memory": Text("no memory"),
    # ---- the installation's test
    "no_datagram_at_test": Text(
        "no datagram of the {arm} arm came to {address}",
        "open the port in this machine's firewall, and see `yumi doctor --stream`",
    ),
    "datagrams_of_other_arm": Text(
        "the datagrams at port {port} are not the {arm} arm's",
        "exchange the ports of the UDPUC devices ROB_R and ROB_L",
    ),
    "datagrams_lost": Text("{share:.0%} of the {arm} arm's datagrams are lost", "use a cable"),
    # ---- Robot Web Services
    "signal_value_no_number": Text("a signal takes a number, not {value:quoted}"),
    "field_without_value": Text("{field:quoted} is not NAME=VALUE"),
    "no_target": Text(
        "{target:quoted} is not a target",
        "give a resource (/rw/panel/opmode), signal:NAME, TASK/MODULE/NAME or a file (HOME:/pick.mod)",
    ),
    # ---- the ROS 2 graph
    "no_message_on_topic": Text("no message came on {topic} within {timeout:g} s"),
    "request_no_yaml": Text("{request:quoted} is neither JSON nor YAML: {error}"),
    "node_without_parameter": Text("{node} has no parameter {name:quoted}", "`yumi param {node}` lists them"),
    "no_value_of_parameter": Text("{value:quoted} is no value of a parameter"),
    "parameter_not_set": Text("{name} of {node} was not set: {reason}"),
    "topic_not_in_graph": Text("there is no topic {name} in the ROS 2 graph", _DRIVER_RUNS),
    "topic_not_in_graph_similar": Text(
        "there is no topic {name} in the ROS 2 graph; similar: {similar:list}", _DRIVER_RUNS
    ),
    "service_not_in_graph": Text("there is no service {name} in the ROS 2 graph", _DRIVER_RUNS),
    "service_not_in_graph_similar": Text(
        "there is no service {name} in the ROS 2 graph; similar: {similar:list}", _DRIVER_RUNS
    ),
    "type_not_installed": Text("{name} has the type {type}, which is not installed here"),
    "fields_no_object": Text("{given} is no JSON object; the fields are {fields:list}"),
    "no_field": Text("there is no field {name:quoted}; the fields are {fields:list}"),
    "field_takes_other": Text("{name} is {given}; it takes {type}"),
    "service_unavailable": Text(
        "the service {service} does not answer", "see that the node runs, with the same ROS_DOMAIN_ID"
    ),
    "service_not_in_time": Text("the service {service} did not answer within {timeout:g} s"),
    # ---- RAPID
    "program_asks_nothing": Text("no program asks anything"),
    "answer_refused": Text("the controller refuses {value:quoted} as an answer to {instruction} ({asked:list})"),
}
