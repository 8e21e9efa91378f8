"""Texts about what was done: the results of commands."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

RESULTS: Mapping[str, Text] = {
    # ---- the robot
    "robot_is_ready": Text("the robot is ready"),
    "robot_is_ready_without_egm": Text("the robot is ready, EGM does not run"),
    "egm_runs": Text("EGM runs on {arms}, the controllers are active"),
    "egm_has_ended": Text("EGM has ended on both arms"),
    "motors_switched_on": Text("the motors are on"),
    "motors_switched_off": Text("the motors are off"),
    "tool_is_set": Text(
        "EGM will start on the {arm} arm with {total:.3f} kg at [{centre}] mm from tool0: tool {tool:.3f} kg, payload "
        "{payload:.3f} kg"
    ),
    # ---- arms and grippers
    "arm_at_goal": Text("the {arm} arm stands at the goal"),
    "arms_at_goal": Text("the right and the left arm stand at the goal"),
    "controllers_switched": Text("the controllers of the {arm} arm are switched"),
    "arms_given_back": Text("programs may command {arms} again"),
    "no_arm_reserved": Text("no arm is reserved for a person"),
    "gripper_now_calibrated": Text("the {arm} gripper is calibrated"),
    "grippers_now_calibrated": Text("the right and left grippers are calibrated"),
    "contact_allowed": Text("{part} and {other} may touch for {duration:g} s, and the arms are slow as long"),
    "contact_ended": Text("{part} and {other} are kept apart"),
    # ---- the program, signals and variables
    "rapid_runs": Text("the RAPID program runs"),
    "rapid_is_stopped": Text("the RAPID program is stopped"),
    "pointers_at_main": Text("the program pointers are at main"),
    "speed_ratio_is": Text("the speed ratio is {percent} %"),
    "routine_has_run": Text("routine {routine} of {task} has run"),
    "module_is_loaded": Text("{task} has loaded HOME:/{file}"),
    "signal_is": Text("signal {signal} is {value}"),
    "variable_is": Text("{task}/{module}/{variable} is {value}"),
}
