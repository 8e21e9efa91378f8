"""EGM datagrams and the UDP ports that they come by."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

EGM: Mapping[str, Text] = {
    # ---- datagrams
    "datagram_too_long": Text("EGM datagram of {size} bytes: at most {most} are allowed"),
    "datagram_not_decoded": Text("EGM datagram of {size} bytes cannot be decoded: {error}"),
    "datagram_of_wrong_type": Text("EGM datagram of type {type}: a robot sends type {expected} with a sequence number"),
    "datagram_corrects_path": Text("EGM datagram of type {type} corrects a path: references have another type"),
    "datagram_has_references": Text(
        "EGM datagram of type {type} has references: corrections of a path have another type"
    ),
    "correction_without_position": Text("EGM path correction has no position: a robot that moves on a path needs one"),
    "datagram_without_time": Text(
        "EGM feedBack has no time: RobotWare before 6.07, whose joints are radians", "use RobotWare 6.07 or newer"
    ),
    "datagram_without_state": Text("EGM datagram has no {part}: it was cut off, a robot always sends it"),
    "datagram_axes_not_of_yumi": Text(
        "EGM {part} has {joints} joints and {external} external joints: a YuMi arm sends {expected} and 1"
    ),
    "datagram_axes_not_of_robot": Text(
        "EGM {part} has {joints} joints and {external} external joints: a robot sends {expected}"
    ),
    "datagram_joint_implausible": Text(
        "EGM {part} has a joint that no arm has: [{joints_deg:list}], [{external_deg:list}] are to be finite degrees"
    ),
    "datagram_joint_not_finite": Text(
        "EGM {part} has a joint that is not a finite number: [{joints:list}], [{external:list}]"
    ),
    "datagram_pose_not_finite": Text(
        "EGM has a tool pose that is not finite numbers: ({position:list}), ({orientation:list})"
    ),
    # ---- ports and hosts
    "udp_port_taken": Text(
        "UDP port {port} is taken: another driver may be running", "stop it or choose another EGM port"
    ),
    "udp_port_not_opened": Text("cannot listen for EGM on {host}:{port}: {error}"),
    "host_not_routed": Text("there is no way to {host:quoted}: {error}", "check the address"),
    "host_unknown": Text("the name {host:quoted} is not known: {error}", "give an address"),
}
