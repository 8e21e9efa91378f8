"""Texts about what the machine lacks: packages, what the operating system grants, and other programs."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

PREREQUISITES: Mapping[str, Text] = {
    # ---- packages
    "recordings_need_mcap": Text("recordings need mcap"),
    "data_frame_needs_pandas": Text(
        "a DataFrame needs pandas and pyarrow (CSV needs neither: `yumi record export FILE FILE.csv`)"
    ),
    "parquet_needs_pandas": Text(
        "parquet needs pandas and pyarrow (CSV needs neither: `yumi record export FILE FILE.csv`)"
    ),
    "pictures_need_matplotlib": Text("pictures need matplotlib"),
    "picture_needs_matplotlib": Text("the picture needs matplotlib; leave --picture out, or install matplotlib"),
    "no_picture_without_matplotlib": Text("no picture of the joint paths: matplotlib is not installed"),
    "planning_needs_roboplan": Text("planning needs RoboPlan"),
    "https_needs_cryptography": Text("the package cryptography is missing, which HTTPS needs"),
    "certificate_failed": Text(
        "the certificate of this installation, {file}, cannot be read or written: {why}",
        "delete the file, or choose another folder with XDG_STATE_HOME",
    ),
    "command_needs_packages": Text("this command needs {packages:and}"),
    "command_installed_in_part": Text("`yumi {command}` is not installed completely ({reason})"),
    # ---- what the operating system grants
    "no_further_thread": Text(
        "the operating system permits no further thread for {thread} ({reason})",
        "raise the limits of processes and memory (ulimit -u, ulimit -v) or end other programs",
    ),
    "no_further_process": Text(
        "the operating system does not let the process {process} start ({reason})",
        "see that the limits of this program are not too low (ulimit -n, ulimit -u, ulimit -v)",
    ),
    "no_lock": Text(
        "no lock against a second driver can be made in {folder}: {reason}",
        "set XDG_RUNTIME_DIR to a folder that only you may enter",
    ),
    "lock_folder_open_to_others": Text(
        "no lock against a second driver can be made in {folder}: it is not this user's own, or open to others",
        "set XDG_RUNTIME_DIR to a folder that only you may enter",
    ),
    # ---- other programs
    "robot_driven_by_another": Text(
        "the robot at {address} is driven by another program ({owner})",
        "end it first, or have that one move the robot: `yumi state` and the other commands, yumi.attach() in a script",
    ),
    "ros_namespace_taken": Text(
        "another driver runs on this machine in the same ROS domain in the namespace {namespace} ({owner})",
        "stop it, or give one of the two another --namespace",
    ),
    "ros_domain_taken": Text(
        "another driver runs on this machine in the same ROS domain without a namespace ({owner})",
        "stop it, or give one of the two another --namespace",
    ),
    "owner_process": Text("process {process}"),
    "owner_starting": Text("it is starting"),
    "output_not_writable": Text("the output of the {program} cannot go to {file}: {reason}"),
    "exited_silently": Text("the {program} exited without a message", "see {log}"),
    "program_not_ready_in_time": Text("the {program} was not ready within {timeout:g} s", "see {log}"),
}
