"""Teleoperation: frames of devices that are refused, and why a held clutch moves nothing."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

_AGAIN = "release the clutch and press it again"

TELEOPERATION: Mapping[str, Text] = {
    # ---- frames that are refused
    "device_motion_count": Text(
        "for the {arm} arm the frame has {count} of pose, twist and joints; with the clutch held it has exactly one"
    ),
    "device_value_implausible": Text("the device reports {value} m or rad for the {arm} arm"),
    "device_quaternion_malformed": Text(
        "the device's orientation for the {arm} arm is a quaternion of length {length:.3g}; it has length 1"
    ),
    "device_setting_out_of_range": Text("{name} is {value:g}; its range is {lowest:g} to {highest:g}"),
    "device_time_not_finite": Text("the frame's time is {time}; a time is a finite number of seconds"),
    "teleoperated_by_another": Text(
        "another device teleoperates the robot", "wait until its operator has ended, for a second"
    ),
    # ---- why a held clutch moves nothing
    "teleoperation_begins": Text("the clutch was held already when the device connected", _AGAIN),
    "teleoperation_link_lost": Text("no frame of the device came for a while; the clutch moves nothing", _AGAIN),
    "teleoperation_link_slow": Text(
        "the link to the device is slow: a frame may be {age:.2f} s old when it comes, allowed are {most:.1f} s; "
        "the clutch moves nothing",
        "use a faster network, then release the clutch and press it again",
    ),
    "teleoperation_interrupted": Text("something else commands the {arm} arm, or EGM has ended on it", _AGAIN),
    "device_hand_jumped": Text("the device's hand for the {arm} arm has jumped; the clutch moves nothing", _AGAIN),
    "device_motion_changed": Text(
        "the device moves the {arm} arm in another way than before; the clutch moves nothing", _AGAIN
    ),
    "leader_too_far": Text(
        "a joint of the leader is {distance:.1°} away from the {arm} arm; it may be {most:.1°} away",
        "bring the leader to where the arm is, then press the clutch again",
    ),
    # ---- devices of this machine
    "devices_need_evdev": Text("gamepads and SpaceMice are read by evdev, which is not installed"),
    "no_input_device": Text("no {kind} is connected to this machine", "connect one; `yumi teleop --list` lists them"),
    "input_devices_unreadable": Text(
        "no {kind} is among the input devices that this user may read; {count} others may not be read",
        "add the user to the group input (`sudo usermod -aG input $USER`), and log in again",
    ),
    "input_device_unreadable": Text("{path} cannot be opened: {why}"),
    "input_device_of_other_kind": Text("{name} ({path}) is not a {kind} that is known here"),
    "input_device_gone": Text("the device {name} is gone: {why}; the arms hold", "connect it, and start again"),
    # ---- leader arms
    "leader_options_missing": Text(
        "a leader needs what makes it, and the arm that follows", "give --leader FILE.py:NAME and --arm right or left"
    ),
    "leader_not_made": Text("{place} makes no leader: {kind}: {why}"),
    "leader_failed": Text("the leader arm failed with {kind}: {why}; the arms hold"),
    "leader_signs_malformed": Text("a leader needs {count} signs, 1 or -1; given are {given}"),
    "leader_offsets_malformed": Text("a leader needs {count} finite offsets [rad]; given are {given}"),
    "leader_joints_malformed": Text("a leader has {count} finite joint positions [rad]; this one reports {given}"),
}
