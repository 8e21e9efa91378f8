"""Texts about the set-up of a robot: an installation, and the findings of the doctor."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

_LOAD = "load the RAPID modules of this package: `yumi install`"
_DISCOVERY = "set it to LOCALHOST, or to SUBNET for several machines, or unset it"

SET_UP: Mapping[str, Text] = {
    # ---- what the controller is, for the doctor and an installation
    "robotware_without_egm": Text(
        "RobotWare {version} has no EGM for seven axes", "have it updated to 6.09 or newer, but not 7"
    ),
    "robotware_too_new": Text(
        "RobotWare {version} has another protocol (Robot Web Services 2); this package is for RobotWare 6"
    ),
    "option_not_installed": Text("the option {option:quoted} is missing: {loss}", "have ABB add it to the system"),
    "no_task": Text("there is no task {task}", "see that this is a YuMi (IRB 14000)"),
    "mastership_held": Text("{holder} holds the mastership of {domain}", "release it there (RobotStudio, FlexPendant)"),
    "grants_missing": Text(
        "the user lacks {grants:list}",
        "give them to the user in RobotStudio (User Accounts), or log in as another user (--user)",
    ),
    "program_runs_on_controller": Text("a RAPID program runs", "stop it first (the stop button of the FlexPendant)"),
    # ---- an installation
    "nothing_changed": Text("nothing was changed: {reason}", "{reason:remedy}"),
    "not_possible_now": Text("not possible now: {reason}", "{reason:remedy}"),
    "not_restarted": Text(
        "the controller must be restarted, and was not: {reason}",
        "{reason:remedy}, then run the command again",
    ),
    "changes_not_read_back": Text(
        "{count} of the changes cannot be read back, first: {first}", "look at the controller's event log"
    ),
    "module_with_main": Text(
        "{task} has a program of its own: its module {module} ({lines} lines) has a main",
        "save it and remove it (FlexPendant: Program Editor, Tasks and Programs, Show Modules, File, Delete Module)",
    ),
    "configured_module_with_main": Text(
        "the configuration loads {file}, which has a main, at each start",
        "remove its entry (FlexPendant: Control Panel, Configuration, Controller, Automatic Loading of Modules)",
    ),
    "other_main_in_task": Text(
        "{program}, and a task can have only one",
        "{program:remedy}, or say --replace-main: it comes back with --roll-back",
    ),
    "other_main_goes": Text("{program}: it goes, and comes back with --roll-back"),
    "configured_name_taken": Text(
        "{type} has another {name}, with {attribute} {value:quoted} instead of {needed:quoted}",
        "rename it (FlexPendant: Control Panel, Configuration), as its name is needed",
    ),
    "add_in_keeps_modules": Text(
        "ABB's Add-In {add_in:quoted} is on the controller: it has the same interface, so its modules and signals "
        "stay, and only the destinations of the EGM datagrams are set"
    ),
    "module_left_out": Text("the product {product:quoted} is missing: {module} is left out, which needs it"),
    "restart_is_due": Text(
        "the controller has not restarted since its configuration was changed: it restarts now",
    ),
    "nothing_to_roll_back": Text(
        "there is nothing to roll back here: {file} does not exist on this machine",
        "run --roll-back on the computer that was used for the installation, or remove what has this package's names "
        "with `yumi uninstall`",
    ),
    "names_are_of_add_in": Text(
        "ABB's Add-In {add_in:quoted} is on the controller, and this machine has no record of an installation: the "
        "parts with this package's names belong to the Add-In",
        "run `yumi uninstall` on the computer that was used for the installation",
    ),
    "removed_by_name": Text("this machine has no record of an installation: what has the names of this package goes"),
    "change_of_module_lost": Text("{module} in {task} was changed since; the change is lost"),
    "own_file_stays": Text("{file} was changed: it stays as a file"),
    "module_loaded_since_stays": Text("{module} in {task} was loaded since: it stays as it is"),
    "record_unreadable": Text("the record {file} cannot be read: {reason}", "restore the backup beside it"),
    "record_folder_not_writable": Text(
        "nothing was changed: what was there before is kept in {folder}, which cannot be written: {reason}",
        "choose another folder with XDG_STATE_HOME",
    ),
    "record_not_writable": Text("the record {file} cannot be written: {reason}; nothing was changed"),
    "no_backup": Text(
        "what is in {folder} is not a backup, it has no {needed}",
        "make one on the FlexPendant (Backup and Restore), and say --no-backup",
    ),
    "backup_not_writable": Text("the backup cannot be written to {folder}: {reason}; nothing was changed"),
    # ---- the doctor: the controller
    "as_found": Text("{value}"),
    "logged_in": Text("system {system:quoted}"),
    "arm_moved_by_controller": Text("moved by this controller"),
    "could_not_be_read": Text("{reason}", "look at the controller's event log"),
    "add_in_found": Text("{add_in}: the state machine may be ABB's own"),
    "gripper_product_missing": Text("{product} is missing: the grippers cannot be used"),
    "mode_keeps_programs_out": Text(
        "{mode}: programs on a computer cannot change anything, unless a person grants the remote manual mode "
        "privilege (RMMP)",
        "{turn_to_auto}",
    ),
    "motors_are_on": Text("on"),
    "motors_kept_off": Text("{state}: {reason}", "{reason:remedy}"),
    "motors_not_on_yet": Text("{state}; `yumi up` switches them on"),
    "program_is_running": Text("runs"),
    "program_not_running_yet": Text("stopped; `yumi up` moves its pointers to main and starts it"),
    "arm_has_collided": Text(
        "an arm has collided, and the program was stopped", "look at the robot, then let `yumi recover` confirm it"
    ),
    "speed_ratio": Text("{percent} %"),
    "speed_ratio_zero": Text("0 %", "raise it on the FlexPendant"),
    "mastership_free": Text("free"),
    "grants_found": Text("the user has {count}"),
    "sessions_found": Text("{count} of {limit} clients are known"),
    "many_sessions": Text(
        "{count} of {limit} clients are logged in",
        "end programs that log in again and again without logging out; an idle session ends after 5 minutes",
    ),
    "task_switched_off": Text("{task} is switched off, and does not start", "switch it on in the task panel"),
    "task_moves_nothing": Text("{task} does not move a mechanical unit", "see Controller, Task in the configuration"),
    "tasks_found": Text("{tasks:list}"),
    "module_has_main": Text(
        "{module} has a main of its own", "save it and remove it, or let `yumi install --replace-main` do so"
    ),
    "modules_without_task": Text("there is no task {task} ({reason})", "see that this is a YuMi"),
    "modules_missing": Text("{modules:list} missing", _LOAD),
    "gripper_module_missing": Text("{module} missing: the grippers cannot be used", _LOAD),
    "watchdog_missing": Text("{module} missing: the robot does not stop when the driver dies", _LOAD),
    "modules_not_comparable": Text("all needed are loaded; their texts cannot be compared: {reason}"),
    "modules_differ": Text("{modules:list} not as in this package", f"unless that is meant, {_LOAD}"),
    "modules_of_add_in": Text(
        "{modules:list} not as in this package, as ABB's add-in has its own", f"unless that is meant, {_LOAD}"
    ),
    "modules_as_delivered": Text("all loaded, as in this package"),
    "signals_missing": Text("{signals:list} missing", "load EIO.cfg: `yumi install`"),
    "signal_on_device": Text(
        "is on the device {device}: another signal has its name", "rename that one, then load EIO.cfg"
    ),
    "signal_differs": Text(
        "has {attribute} {value:quoted}, not {needed:quoted}", "change it, or load EIO.cfg: `yumi install`"
    ),
    "signals_not_in_use": Text("{signals:list} configured, but not in use yet", "restart the controller"),
    "signals_found": Text("all {count} of the state machine"),
    "motion_data_missing": Text(
        "{names:list} missing in External Motion Interface Data", "load MOC.cfg: `yumi install`"
    ),
    "motion_data_found": Text("filtered and raw, for both arms"),
    "device_sends_here": Text("sends to {host}:{port}, where it is awaited"),
    "devices_share_port": Text(
        "ROB_R and ROB_L both send to port {port}", "give each arm a port of its own: `yumi install`"
    ),
    "gripper_not_there": Text(
        "the controller has no signals of it: it is not there", "connect it, or leave the grippers out"
    ),
    "gripper_is_calibrated": Text("calibrated"),
    "gripper_not_calibrated_yet": Text("not calibrated yet; `yumi up` calibrates it, its fingers close"),
    "clock_unreadable": Text("cannot be read: {reason}"),
    "clock_agrees": Text("{difference:.0f} s from this machine's"),
    "clock_differs": Text(
        "{there} there, {here} here (local times, zones are not compared)",
        "set it on the FlexPendant, so that its event log can be matched",
    ),
    # ---- the doctor: this machine
    "arms_share_port": Text(
        "both arms' datagrams are awaited at port {port}", "give the arms two ports in the settings (egm)"
    ),
    "port_free": Text("free for the {arm} arm"),
    "permitted": Text("permitted"),
    "priority_not_permitted": Text(
        "not permitted to this user; EGM works, with more jitter under load",
        "add 'rtprio 99' for the user to /etc/security/limits.d",
    ),
    "locked_memory_not_permitted": Text(
        "not permitted to this user; EGM works, with rare delays when memory is short",
        "add 'memlock unlimited' for the user to /etc/security/limits.d",
    ),
    "robot_on_this_machine": Text("the robot is on this machine"),
    "no_card_with_address": Text(
        "no network card has the address {host}, where datagrams are awaited",
        "set egm.listen to auto, or give the card this address",
    ),
    "card_in_network": Text("{card} is in the robot's network {network}"),
    "card_in_other_network": Text(
        "{card} is in {network}, the robot {robot} is not: a router is between them",
        "connect this machine to the robot's network by a cable, with an address of its own there",
    ),
    "cards_share_network": Text(
        "{others:list} is in the robot's network, too, beside {card}",
        "leave one card in that network: datagrams may leave by the other, and the robot ignores them",
    ),
    "card_is_wireless": Text(
        "{card} is a radio link (Wi-Fi)", "use a cable: a radio link delays single datagrams by far"
    ),
    "card_is_tunnel": Text("{card} is a tunnel (VPN)", "connect by a cable"),
    "card_not_connected": Text("{card} is not connected", "plug the cable in"),
    "card_with_small_mtu": Text(
        "{card} is set to packets of {mtu} bytes",
        "run `sudo ip link set {card} mtu 1500`",
    ),
    "card_found": Text("{card}, MTU {mtu}"),
    "firewall_does_not_matter": Text("does not matter to this machine's own address"),
    "ufw_is_on": Text(
        "ufw is on, its rules are not readable without root",
        "run `sudo ufw allow from {robot} to any port {ports} proto udp`",
    ),
    "firewall_unreadable": Text(
        "{firewall}: not readable without root", "see with sudo that UDP ports {ports} are open to {robot}"
    ),
    "firewall_closes_something": Text(
        "{firewall} closes something, and does not name all of the ports {ports}",
        "see that UDP ports {ports} are open to {robot}",
    ),
    "firewall_open": Text("{firewall} shows nothing that closes UDP ports {ports}"),
    "no_firewall_found": Text("none found (ufw, nft, iptables)"),
    "ros_not_installed": Text(
        "not installed for this Python", "install yumi-ros2[ros] or source your ROS 2 Jazzy, unless you need no ROS"
    ),
    "ros_domain_invalid": Text("ROS_DOMAIN_ID is {value:quoted}", "set it to a number from 0 to {highest}"),
    "ros_domain_high": Text(
        "ROS_DOMAIN_ID is {value}: its ports may be taken by outgoing connections",
        "set it to a number from 0 to {highest}",
    ),
    "ros_discovery_overruled": Text(
        "ROS_LOCALHOST_ONLY, which is set too, overrules ROS_AUTOMATIC_DISCOVERY_RANGE={value}",
        "unset ROS_LOCALHOST_ONLY",
    ),
    "ros_discovery_off": Text("OFF: no other program finds the driver", _DISCOVERY),
    "ros_discovery_invalid": Text(
        "ROS_AUTOMATIC_DISCOVERY_RANGE is {value:quoted}, which means SUBNET: all machines of the network find it",
        _DISCOVERY,
    ),
    "ros_discovery_of_driver": Text("as the driver sets it"),
    # ---- the doctor: the position streams
    "no_state_machine_to_start": Text(
        "{task} has no state machine of this package, so nothing is started there", "load it: `yumi install`"
    ),
    "other_program_not_started": Text(
        "{task} has another program: its module {module} has a main, so nothing is started", "save and remove it"
    ),
    "state_machine_does_not_become_idle": Text(
        "the state machine on the robot does not become idle", "look at the FlexPendant"
    ),
    "tasks_left_off": Text(
        "still switched off: task {tasks:and}", "select it on the FlexPendant (QuickSet menu, Tasks)"
    ),
    "tasks_left_off_after": Text(
        "an earlier step failed: {reason:sentence} Still switched off: task {tasks:and}",
        "select it on the FlexPendant (QuickSet menu, Tasks)",
    ),
    "stream_not_tried": Text("not tried, nothing was started: {requirement}: {reason}", "solve that first"),
    "stream_not_egm": Text(
        "what comes to port {port} is not EGM of a seven-axis arm", "see what sends there: it is not this robot"
    ),
    "stream_dropped": Text(
        "the robot sends, and nothing comes to {host}:{port}: it is dropped on the way",
        "open UDP port {port} in this machine's firewall, and see the route",
    ),
    "stream_of_other_arm": Text(
        "the datagrams at port {port} come from the other arm",
        "exchange the ports of the UDPUC devices: `yumi install`",
    ),
    "stream_not_of_this_arm": Text(
        "the datagrams at port {port} are not this arm's",
        "check what sends to this port, and the remote ports of the UDPUC devices",
    ),
    "stream_quality": Text(
        "{received} datagrams, one every {period:.2ms}, {lost} lost, jitter {jitter:.2ms}, worst {worst:.1ms}"
    ),
    "stream_lossy": Text("{loss:.1%} is lost on the way: {quality}", "use a cable, and no VPN"),
    "stream_irregular": Text("it comes irregularly: {quality}", "use a cable; look at the load of this machine"),
}
