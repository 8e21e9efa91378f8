"""Refusals of the page of `yumi view`: who operates, and what prevents it."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

PAGE: Mapping[str, Text] = {
    "driver_looked_for": Text("the driver is being looked for"),
    "driver_sent_no_state": Text("the driver has sent no state for {duration:g} s"),
    "connection_to_driver_lost": Text("the connection to the driver is lost: {why}"),
    "view_has_ended": Text("yumi view has ended"),
    "driver_has_ended": Text("the driver has ended"),
    # ---- who operates
    "control_not_taken": Text("this page does not have control", "take control first"),
    "control_given_back": Text("control was given back before this was asked for"),
    "control_taken_by_other": Text("another page has taken control"),
    "page_closed": Text("the page that had control was closed"),
    "page_was_silent": Text("this page did not answer for a while, and has lost control"),
    "is_a_recording": Text("this is a recording"),
    "no_driver_for_robot": Text("the robot is {robot}: no driver of this package runs for it"),
    "driver_can_run_now": Text("a driver can run for the controller at {address} now", "start `yumi view` anew"),
    "page_only_shows": Text("this page only shows the robot", "to operate a real one, start `yumi view --operate`"),
    "operated_elsewhere_over_https": Text(
        "a real robot is operated from another machine only over HTTPS",
        "start `yumi view --operate --https`, or use the machine on which `yumi view` runs",
    ),
    "operated_once_paired": Text(
        "this page on another machine is not paired", "type the code that `yumi view` shows in its terminal"
    ),
    "pairing_not_needed": Text("this page needs no code, or may not be paired"),
    "pairing_code_wrong": Text("the code is wrong", "type the code that `yumi view` shows in its terminal now"),
    "pairing_paused": Text(
        "too many wrong codes: for {duration:.0f} s none is taken",
        "wait, then type the new code that `yumi view` shows in its terminal",
    ),
    "operating_page_needs_token": Text(
        "every user of this machine reaches the page; to operate a real robot it needs a token"
    ),
    # ---- what it asks for
    "page_too_slow_to_jog": Text(
        "jog refused: the connection to the page is too slow now", "press again when it is better"
    ),
    "plan_is_old": Text("this plan is not the one that was made last, or was followed already", "plan again"),
    "no_pose_of_fingertips": Text("a pose of the fingertips is x, y, z [m] and the quaternion w, x, y, z"),
}
